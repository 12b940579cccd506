"""The index of equations, docs/equations.md: complete, and what it names is there and has the equation's number."""

import importlib
import re
import tokenize
from functools import reduce
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "equations.md"
EQUATIONS = range(1, 57)

# (3.19), (3.19, 3.20), (3.47, sign corrected); not (3.1.9), a section
LISTED = re.compile(r"\((?:3\.\d+(?:, | and )?)+(?=[),])")
# (3.19) to (3.23), (3.19 to 3.23)
RANGE = re.compile(r"\(3\.(\d+)\)? to \(?3\.(\d+)\)")


class Row(NamedTuple):
    """One line of the tables."""

    equations: list[int]
    says: str
    function: str
    also: list[str]
    tests: list[str]

    @property
    def places(self) -> list[str]:
        return [self.function, *self.also]


def numbers(text: str) -> list[int]:
    """The equations that a text refers to in brackets, ranges written out."""
    found = [int(n) for listed in LISTED.findall(text) for n in re.findall(r"3\.(\d+)", listed)]
    for first, last in RANGE.findall(text):
        found += range(int(first), int(last) + 1)
    return sorted(set(found))


def read() -> list[Row]:
    rows = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("| (3."):
            equation, says, function, also, tests = (cell.strip() for cell in line.strip("|").split(" |"))
            (only,) = re.findall(r"`([^`]+)`", function)
            rows.append(Row(numbers(equation), says, only, *(re.findall(r"`([^`]+)`", cell) for cell in (also, tests))))
    return rows


ROWS = read()


def words(path: Path) -> str:
    """Comments and strings of a source file: a number in its code is no equation."""
    with tokenize.open(path) as source:
        kept = (tokenize.COMMENT, tokenize.STRING)
        return "\n".join(token.string for token in tokenize.generate_tokens(source.readline) if token.type in kept)


def test_how_equations_are_cited() -> None:
    assert numbers("(3.2, 3.3), eq. (3.47, sign corrected), (3.10) to (3.12), (3.21 to 3.23)") == [
        *(2, 3, 10, 11, 12, 21, 22, 23, 47)
    ]
    assert numbers("thesis (3.1.9), 3.6 km/h, Fig. 3.4, (3.5 m), Table 3.2, 3.7, figure 3.8)") == []


def test_every_equation_has_one_row() -> None:
    assert sorted(number for row in ROWS for number in row.equations) == list(EQUATIONS)


def test_every_row_says_something_and_names_a_test() -> None:
    for row in ROWS:
        assert row.says and row.tests, row


@pytest.mark.parametrize("place", sorted({place for row in ROWS for place in row.places}))
def test_function_is_there_and_its_module_has_the_number(place: str) -> None:
    name, qualname = place.split(":")
    module = importlib.import_module(name)
    found = reduce(getattr, qualname.split("."), module)
    assert callable(found)
    assert module.__file__ is not None
    source = Path(module.__file__)
    # where it is defined, not where it is imported
    assert re.search(rf"^ *(?:def|class) {qualname.split('.')[-1]}\b", source.read_text(encoding="utf-8"), re.M)
    wanted = {number for row in ROWS if place in row.places for number in row.equations}
    assert wanted <= set(numbers(words(source))), f"{source.name} does not say which equation it is"


@pytest.mark.parametrize("test", sorted({test for row in ROWS for test in row.tests}))
def test_test_is_there(test: str) -> None:
    path, name = test.split("::")
    assert re.search(rf"^def {name}\(", (ROOT / path).read_text(encoding="utf-8"), re.M)
