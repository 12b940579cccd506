"""Where tests lie: in the packages they test, under names of their own, and nothing beside the installation needed."""

import ast
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
IGNORED = {"build", "install", "log", "rides", "__pycache__"}


def sources() -> list[Path]:
    """All Python files of the repository, but those that tools made."""
    found = [path.relative_to(ROOT) for path in ROOT.rglob("*.py")]
    return [path for path in found if not any(part in IGNORED or part.startswith(".") for part in path.parts)]


SOURCES = sources()
OF_TESTS = [path for path in SOURCES if {"test", "tests"} & set(path.parts)]


def test_every_test_lies_where_pytest_looks(pytestconfig: pytest.Config) -> None:
    folders = [Path(folder) for folder in pytestconfig.getini("testpaths")]
    assert all((ROOT / folder).is_dir() for folder in folders)
    tests = [path for path in SOURCES if path.name.startswith("test_")]
    assert len(tests) > 100
    assert [path for path in tests if not any(folder in path.parents for folder in folders)] == []


def test_every_package_holds_its_own() -> None:
    packages = [path.parent for path in ROOT.glob("*/package.xml")] + [
        path.parent for path in ROOT.glob("interfaces/*/package.xml") if path.parent.name != "phil_interfaces"
    ]
    assert len(packages) == 7
    assert [package.name for package in packages if not list((package / "test").glob("test_*.py"))] == []


def test_names_are_unique() -> None:
    """Test folders are on one path: two files of one name would be one module, and one of them would not run."""
    names = Counter(path.name for path in OF_TESTS if path.name != "conftest.py")
    assert [name for name, times in names.items() if times > 1] == []
    assert [path for path in OF_TESTS if path.name == "__init__.py"] == []


def test_no_test_changes_where_modules_are_looked_for() -> None:
    for path in OF_TESTS:
        text = (ROOT / path).read_text(encoding="utf-8")
        if "sys.path." not in text:
            continue
        called = (node.func for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
        assert not {"sys.path.insert", "sys.path.append"} & {ast.unparse(function) for function in called}, path
