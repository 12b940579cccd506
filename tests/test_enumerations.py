"""The named numbers of phil_base are those of the message definitions, in both directions."""

import re
from pathlib import Path

import pytest

from phil_base.enumerations import FOLLOWING, Correction, EnvironmentKind, Mode, Named, SolverStatus
from phil_base.workspace import workspace

MESSAGES = sorted((workspace() / "interfaces" / "phil_interfaces" / "msg").glob("*.msg"))
CONSTANT = re.compile(r"^\w+\s+([A-Z]\w*)\s*=\s*(-?\w+)", re.MULTILINE)
KINDS: list[tuple[type[Named], str, str]] = [
    (Mode, "RigState", "MODE_"),
    (SolverStatus, "ImpedanceCommand", ""),
    (Correction, "ImpedanceCommand", "CORRECTION_"),
    (EnvironmentKind, "ImpedanceCommand", "ENVIRONMENT_"),
]


def constants(message: Path) -> dict[tuple[str, str], int]:
    """Message and name of every constant of a definition, with its number."""
    return {(message.stem, name): int(number, 0) for name, number in CONSTANT.findall(message.read_text())}


def test_every_constant_of_a_message_has_its_name_here_and_every_name_its_constant() -> None:
    defined = {key: number for message in MESSAGES for key, number in constants(message).items()}
    named = {(message, prefix + each.name): int(each) for kind, message, prefix in KINDS for each in kind}
    assert named == defined and len(defined) >= 20


@pytest.mark.parametrize(("kind", "message", "prefix"), KINDS)
def test_the_built_message_has_the_same_numbers(kind: type[Named], message: str, prefix: str) -> None:
    import phil_interfaces.msg

    built = getattr(phil_interfaces.msg, message)
    assert {each: getattr(built, prefix + each.name) for each in kind} == {each: int(each) for each in kind}


def test_words_are_those_of_the_reports() -> None:
    assert [kind.words for kind in Correction][3:5] == ["projected", "dead zone"]
    assert [mode.words for mode in FOLLOWING] == ["tracking", "bridging", "holding"]
