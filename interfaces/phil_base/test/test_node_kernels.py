"""Kernels that are kept between runs: never stale, whole or absent, and no start fails on them."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from phil_base import kernels

CALLEE = (
    "from phil_base.kernels import njit\nFACTOR = {factor}\n\n\n@njit(cache=True)\ndef inner(x):\n    return {body}\n"
)
CALLER = """
from phil_base.kernels import njit
from {package}.callee import inner, FACTOR


@njit(cache=True)
def outer(x):
    return inner(x) * FACTOR
"""


MAKER = """
from phil_base.kernels import njit


def made(inner, factor):
    @njit(cache=True)
    def outer(x):
        return inner(x) * factor

    return outer
"""
MADE = """
from phil_base.kernels import njit
from {package}.callee import inner, FACTOR
from {package}.maker import made


@njit(cache=True)
def other(x):
    return x - 1.0


outer, twice, of_other = made(inner, FACTOR), made(inner, 2.0), made(other, 1.0)
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., ModuleType]]:
    """Write a package of two modules with kernels and import it as a new process would."""
    name = "kernel_trial"
    monkeypatch.setattr(kernels, "_place", lambda: tmp_path / "kept")
    monkeypatch.syspath_prepend(str(tmp_path))
    folder = tmp_path / name
    folder.mkdir()

    def write(body: str = "x + 1.0", factor: float = 1.0, caller: str = "caller") -> ModuleType:
        (folder / "__init__.py").write_text("")
        (folder / "callee.py").write_text(CALLEE.format(body=body, factor=factor))
        (folder / "caller.py").write_text(CALLER.format(package=name))
        (folder / "maker.py").write_text(MAKER)
        (folder / "made.py").write_text(MADE.format(package=name))
        for module in [key for key in sys.modules if key.partition(".")[0] == name]:
            del sys.modules[module]
        kernels._seen.clear()
        sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
        try:
            return import_module(f"{name}.{caller}")
        finally:
            sys.dont_write_bytecode = before

    yield write
    for module in [key for key in sys.modules if key.partition(".")[0] == name]:
        del sys.modules[module]


def kept(tmp_path: Path, name: str = "*") -> list[Path]:
    return sorted((tmp_path / "kept").glob(f"*/kernel_trial.{name}.nbc"))


def hits(module: ModuleType) -> int:
    return sum(module.outer.stats.cache_hits.values())


def test_a_kernel_is_taken_from_disk_while_nothing_changes(package: Callable[..., ModuleType]) -> None:
    first = package()
    assert first.outer(1.0) == 2.0 and hits(first) == 0
    again = package()
    assert again.outer(1.0) == 2.0 and hits(again) == 1


def test_a_change_in_another_file_acts(package: Callable[..., ModuleType]) -> None:
    assert package("x + 1.0").outer(1.0) == 2.0
    assert package("x + 9.0").outer(1.0) == 10.0  # a callee; same size of the file
    assert package("x + 9.0", 2.0).outer(1.0) == 20.0  # a constant that was imported
    back = package("x + 1.0")
    assert back.outer(1.0) == 2.0 and hits(back) == 1


def test_kernels_made_in_a_function_are_kept_each_on_its_own(package: Callable[..., ModuleType]) -> None:
    for was_kept in (0, 1):
        made = package(caller="made")
        assert (made.outer(1.0), made.twice(1.0), made.of_other(1.0)) == (2.0, 4.0, 0.0)
        assert [sum(one.stats.cache_hits.values()) for one in (made.outer, made.twice, made.of_other)] == [was_kept] * 3


def test_a_change_in_what_they_were_made_with_acts(package: Callable[..., ModuleType]) -> None:
    assert package("x + 1.0", caller="made").outer(1.0) == 2.0
    assert package("x + 9.0", caller="made").outer(1.0) == 10.0
    assert package("x + 9.0", 2.0, caller="made").outer(1.0) == 20.0


def test_the_package_of_what_a_kernel_is_made_with_counts(package: Callable[..., ModuleType], tmp_path: Path) -> None:
    inner = package().inner

    @kernels.njit(cache=True)
    def outer(x: Any) -> Any:
        return inner(x)

    assert outer(1.0) == 2.0
    assert tmp_path / "kernel_trial" in outer._cache._sources and len(outer._cache._sources) > 1


def test_a_source_changed_after_it_was_read_leaves_no_kernel(
    package: Callable[..., ModuleType], tmp_path: Path
) -> None:
    module = package("x + 1.0")
    (tmp_path / "kernel_trial" / "callee.py").write_text(CALLEE.format(body="x + 5.0", factor=1.0))
    assert module.outer(1.0) == 2.0
    assert kept(tmp_path) == []


def damaged_in_place(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(change(path.read_bytes())) and None


def made_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / "x").write_text("x")


DAMAGES = {
    "cut off": damaged_in_place(lambda content: content[: len(content) // 2]),
    "cut in the checksum": damaged_in_place(lambda content: content[:7]),
    "empty": damaged_in_place(lambda content: b""),
    "garbage": damaged_in_place(lambda content: b"\x80\x04garbage" * 99),
    "one bit": damaged_in_place(lambda content: content[:-200] + bytes([content[-200] ^ 4]) + content[-199:]),
    "unreadable": lambda path: path.unlink() or path.symlink_to(path),
    "a folder": made_a_folder,
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.slow
def test_a_damaged_file_is_made_again(package: Callable[..., ModuleType], tmp_path: Path, damage: str) -> None:
    assert package().outer(1.0) == 2.0
    whole = kept(tmp_path)
    assert len(whole) == 2
    for path in whole:
        DAMAGES[damage](path)
    module = package()
    assert module.outer(1.0) == 2.0 and hits(module) == 0
    assert kept(tmp_path) == whole and all(path.is_file() for path in whole)
    again = package()
    assert again.outer(1.0) == 2.0 and hits(again) == 1


@pytest.mark.slow
def test_signatures_lie_in_files_of_their_own(package: Callable[..., ModuleType], tmp_path: Path) -> None:
    # So two processes that compile two signatures at once cannot mix them up, whoever is first.
    module, other = package(), package()
    assert module.outer(1.0) == 2.0
    assert other.outer(np.ones(2)).tolist() == [2.0, 2.0]
    assert len(kept(tmp_path, "caller.outer*")) == 2
    both = package()
    assert both.outer(1.0) == 2.0 and both.outer(np.ones(2)).tolist() == [2.0, 2.0] and hits(both) == 2


@pytest.mark.slow
def test_a_file_of_another_signature_is_not_taken(package: Callable[..., ModuleType], tmp_path: Path) -> None:
    module = package()
    module.outer(1.0)
    module.outer(np.ones(2))
    first, second = kept(tmp_path, "caller.outer*")
    content = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(content)
    again = package()
    assert again.outer(1.0) == 2.0 and again.outer(np.ones(2)).tolist() == [2.0, 2.0]


def test_a_place_that_cannot_be_written_costs_time_only(
    package: Callable[..., ModuleType], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "kept").write_text("a file in the place of the folder")
    kernels._complain.cache_clear()
    assert package().outer(1.0) == 2.0
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and str(tmp_path / "kept") in said


def test_states_used_long_ago_go(tmp_path: Path) -> None:
    for age in range(kernels.KEPT + 3):
        folder = tmp_path / f"one-{age:02d}"
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    (tmp_path / "two-00").mkdir()
    fresh = tmp_path / "one-new"
    fresh.mkdir()
    kernels._prune(fresh)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == [*(f"one-{age:02d}" for age in range(kernels.KEPT - 1)), "one-new", "two-00"]


def test_kernels_of_other_packages_count(tmp_path: Path) -> None:
    # A script's kernel that calls the catenary's is compiled anew with the catenary.
    import bench.sparse_lu
    import catenary_model.step

    names = {path.name for path in bench.sparse_lu.columns._cache._sources}
    own = {path.name for path in catenary_model.step.substep._cache._sources}
    assert "catenary_model" in own and "bench" not in own
    assert names >= own | {"bench"}


@pytest.mark.slow
def test_where_kernels_lie(tmp_path: Path) -> None:
    # In processes of their own: the place is found once. HOME in /proc cannot be made by anybody.
    code = "from phil_base.kernels import _place; print(_place())"
    found = {}
    for name, given in {
        "numba": {"NUMBA_CACHE_DIR": str(tmp_path / "n"), "PHIL_CACHE": str(tmp_path / "p")},
        "ours": {"PHIL_CACHE": str(tmp_path / "p"), "XDG_CACHE_HOME": str(tmp_path / "x")},
        "unwritable": {"PHIL_CACHE": "/proc/none", "HOME": "/proc/none", "TMPDIR": str(tmp_path)},
    }.items():
        environment = {k: v for k, v in os.environ.items() if k not in ("PHIL_CACHE", "XDG_CACHE_HOME")} | given
        done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], env=environment, capture_output=True)
        found[name] = done.stdout.decode().strip()
    assert found == {
        "numba": str(tmp_path / "n"),
        "ours": str(tmp_path / "p" / "kernels"),
        "unwritable": str(tmp_path / f"phil-catenary-kernels-{os.getuid()}"),
    }
