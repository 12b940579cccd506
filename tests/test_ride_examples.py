"""Every example of help, README and documentation is one that works: commands, files, names, YAML and Python."""

import argparse
import ast
import importlib
import importlib.util
import re
import shlex
from pathlib import Path

import pytest

import bench.__main__ as bench
import doctor.__main__ as doctor
import validate.__main__ as validate
from bench.realtime.options import add_options, options_from
from catenary_model import line_file
from energy_monitor import record
from energy_monitor.report import cli
from energy_monitor.topics import RECORDED
from phil_base.parameters import infos
from phil_base.yaml_file import parse_yaml
from ride import options
from ride.options import EXAMPLES, parse
from ride.settings import NODES, resolve
from test_rig_sim.pantographs.linear_file import read_pantograph

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "examples/README.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
SCRIPTS = sorted((ROOT / "scripts").glob("*.sh"))
SOURCES = [path for package in NODES for path in (ROOT / package / package).rglob("*.py")]
PARAMETERS = {
    name: {i.name: i for i in infos(importlib.import_module(f"{name}.parameters").Parameters)} for name in NODES
}
BEGIN = re.compile(r"^(scripts/\w+\.sh|ros2 |python |python3 )")


def code(text):
    """Give what stands in a document as code: spans, and the lines of indented and fenced blocks."""
    fenced, kept = [], []
    for i, part in enumerate(re.split(r"^```.*$", text, flags=re.MULTILINE)):
        (fenced if i % 2 else kept).append(part)
    prose = "\n".join(kept)
    yield from re.findall(r"`([^`\n]+)`", prose)
    for line in [*re.findall(r"^    (.+)$", prose, flags=re.MULTILINE), *"\n".join(fenced).splitlines()]:
        # A comment begins behind two spaces; two commands beside each other stand five apart.
        yield from re.split(r"\s{5,}", re.split(r"\s{2,}#", line)[0].strip())


def commands():
    for path in DOCUMENTS:
        for found in code(path.read_text()):
            if BEGIN.match(found):
                yield found
    yield from EXAMPLES
    for path in SCRIPTS:
        for found in re.findall(r"scripts/\w+\.sh [^\n#.]*(?:  |\.)", path.read_text()):
            yield found.strip(" .")


def blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```", (ROOT / path).read_text(), flags=re.MULTILINE | re.DOTALL)


def indented(path, first):
    """Give the indented block that begins with a line."""
    (found,) = re.findall(
        rf"^((?:    .*\n)*?    {first}\n(?:    .*\n)*)", (ROOT / path).read_text(), flags=re.MULTILINE
    )
    return re.sub("^    ", "", found, flags=re.MULTILINE)


@pytest.fixture
def users_files(tmp_path, monkeypatch):
    """The files of a user that the examples name, as the documentation says to write them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_line.yaml").write_text(re.sub("^    ", "", line_file.__doc__.split("\n\n")[1], flags=re.MULTILINE))
    (tmp_path / "my.yaml").write_text(indented("README.md", "catenary_model:"))
    (tmp_path / "mine.yaml").write_text(blocks("docs/pantographs.md", "yaml")[0])
    return tmp_path


@pytest.mark.parametrize("example", sorted(set(commands())))
def test_a_command_is_understood(users_files, example):
    for command in example.split(" | "):
        words = shlex.split(command)
        if words[0].startswith("scripts/"):
            assert (ROOT / words[0]).is_file()
            SCRIPT.get(words[0], lambda arguments: None)(words[1:])
        elif words[0] == "ros2":
            of_ros(words[1:])
        elif words[0].startswith("python"):
            of_python(words[1:])
        else:  # a further name of what stands before |
            SCRIPT[shlex.split(example)[0]](words)


def ride(arguments):
    if len(arguments) == 1 and arguments[0].startswith("-"):  # an option is mentioned
        assert arguments[0] == "--help" or f'"{arguments[0]}"' in Path(options.__file__).read_text()
        return
    given = parse(arguments)
    resolve(given.params, given.overrides, given.rig)


def of(names, module):
    def check(arguments):
        for word in arguments:
            if word.startswith("-"):
                assert word in module.parser()._option_string_actions
            else:
                assert word in names or word.isupper()

    return check


def measurement(arguments):
    """Take a command of the benches; a list of their names, with or without a ride in real time, is one as well."""
    if arguments[:1] != ["realtime"]:
        of(bench.NAMES, bench)([word for word in arguments if word != "|"])
        return
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--json")
    parser.add_argument("--out")
    parser.add_argument("--quick", action="store_true")
    add_options(parser)
    options_from(parser, parser.parse_args(arguments))


def examination(arguments):
    """Take the synopsis "[--seconds 10] [--domain N] ..." as if everything in it was given, N for a number."""
    words = [{"N": "7"}.get(word.strip("[]"), word.strip("[]")) for word in arguments]
    assert doctor.parser().parse_args(words)


SCRIPT = {
    "scripts/run.sh": ride,
    "scripts/validate.sh": of(validate.NAMES, validate),
    "scripts/bench.sh": measurement,
    "scripts/doctor.sh": examination,
    "scripts/record.sh": lambda arguments: record.arguments(arguments) if arguments else None,
    "scripts/analyze.sh": lambda arguments: cli.arguments(arguments) if arguments else None,
}


def of_ros(words):
    verb, rest = tuple(words[:2]), words[2:]
    if not rest:  # a command is mentioned
        mentioned = {"param": ("set", "load", "dump"), "topic": ("echo", "list", "hz"), "lifecycle": ("get", "set")}
        assert verb == ("run",) or verb[1] in mentioned[verb[0]]
    elif verb in (("param", "set"), ("param", "describe"), ("param", "get")):
        node = rest[0].removeprefix("/")
        if len(rest) > 1:
            assert rest[1] in PARAMETERS[node]
        if len(rest) > 2:
            resolve(None, {node: {rest[1]: parse_yaml(rest[2])}})
    elif verb[0] == "run":
        assert verb[1] in NODES and rest == [verb[1]]
    elif verb[0] == "lifecycle":
        assert rest[0].removeprefix("/") in (*NODES, "NODE")
    elif verb[0] == "topic":
        assert rest[0].removeprefix("/") in [name.removeprefix("/") for name in RECORDED]
    elif verb == ("service", "call"):
        package, kind, name = rest[1].split("/")
        assert kind == "srv"
        assert hasattr(importlib.import_module(f"{package}.srv"), name)
        sources = [*SOURCES, *(ROOT / "interfaces").rglob("*.py")]
        texts = "\n".join(path.read_text() for path in sources)
        offered = re.findall(r"(?:serve|create_service)\((\w+), \"([^\"]+)\"", texts)
        assert (name, rest[0].removeprefix("/").replace("NODE/", "~/")) in offered
    else:
        raise AssertionError(f"ros2 {' '.join(words)}: nothing is known of it")


def of_python(words):
    if words[0] == "-m":
        assert importlib.util.find_spec(words[1])
    else:
        assert (ROOT / words[0]).is_file()


def test_there_are_examples_of_every_kind():
    found = "\n".join(commands())
    for kind in ("run.sh --set", "ros2 param set", "ros2 topic", "ros2 service", "validate.sh impedance", "python -m"):
        assert kind in found


def test_every_name_of_validate_and_bench_is_in_the_readme():
    text = (ROOT / "README.md").read_text()
    (line,) = [line for line in text.splitlines() if line.strip().startswith("scripts/validate.sh impedance")]
    assert set(re.findall(r"[a-z0-9-]+", line)) >= set(validate.NAMES)
    (line,) = [line for line in text.splitlines() if line.strip().startswith("scripts/bench.sh catenary |")]
    assert set(re.findall(r"[a-z0-9-]+", line)) >= set(bench.NAMES)


FOLDERS = (*NODES, "interfaces", "scripts", "docs", "examples", "tests")
FILES = [str(file) for folder in FOLDERS for file in (ROOT / folder).rglob("*.*")]
MADE = re.compile(r"^(params|line|pantograph|my|mine|my_line|report|metadata)\.(yaml|json|html)$")
"""Files of a ride or of a user."""


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_that_is_named_exists(path):
    for name in {
        word for span in code(path.read_text()) for word in re.findall(r"[\w./-]+\.(?:py|sh|yaml|msg|css)\b", span)
    }:
        if not (MADE.match(Path(name).name) or re.search(r"[A-Z]{4,}", name) or "rides/" in name):
            assert any(f"/{file}".endswith(f"/{name.removeprefix('./')}") for file in FILES), name


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_somewhere(path):
    for target in re.findall(r"\]\(([^)]+)\)", path.read_text()):
        name, _, anchor = target.partition("#")
        if name.startswith("http"):
            continue
        page = (path.parent / name) if name else path
        assert page.exists(), target
        if anchor:
            titles = re.findall(r"^#+ (.+)$", page.read_text(), flags=re.MULTILINE)
            assert anchor in [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles], target


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_every_parameter_that_is_named_with_its_node_exists(path):
    for span in code(path.read_text()):
        for node, key in re.findall(rf"\b({'|'.join(NODES)})\.([a-z_0-9.]+)\b(?![/*(])", span):
            module = importlib.util.find_spec(node) and (ROOT / node / node / f"{key.split('.')[0]}.py").exists()
            assert key in PARAMETERS[node] or module or (ROOT / node / node / key.split(".")[0]).is_dir(), span


def test_every_pantograph_of_the_documentation_can_be_read(users_files):
    for block in blocks("docs/pantographs.md", "yaml"):
        (users_files / "block.yaml").write_text(block)
        read_pantograph(users_files / "block.yaml")


def test_the_line_at_the_top_of_the_reader_can_be_read(users_files):
    assert len(line_file.load_line(users_files / "my_line.yaml").spans) == 4


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_python_of_the_documentation_imports_what_there_is(path):
    for block in blocks(path, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    importlib.import_module(alias.name)
            elif isinstance(node, ast.ImportFrom):
                module = importlib.import_module(node.module)
                for alias in node.names:
                    assert hasattr(module, alias.name) or importlib.import_module(f"{node.module}.{alias.name}")
