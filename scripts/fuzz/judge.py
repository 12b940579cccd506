"""What a damaged file may lead to: a result, or a refusal in lines that a person can use."""

from __future__ import annotations

import re
from dataclasses import dataclass

MOST_LETTERS = 1000
"""Length of a line that is still clear."""
REFUSED, GOOD = 2, (0, 1)


@dataclass(frozen=True)
class Outcome:
    """What became of a case: ``ended`` says how the process went if it did."""

    code: int | None = None
    said: str = ""
    fault: str = ""
    trace: str = ""
    mib: float = 0.0
    seconds: float = 0.0
    ended: str = ""


def fault_of(outcome: Outcome, name: str, most_mib: float, *, several: bool, naming: str = "") -> str:
    """Say what is wrong with an outcome, empty if nothing is; equal texts are faults of one kind.

    Args:
        outcome: of the case.
        name: of the file or folder: every line has to name it, or a node and its parameter.
        most_mib: memory that a case may take, MiB.
        several: whether there may be one line for each wrong value, or only one.
        naming: pattern of what a line may name in place of these.
    """
    if outcome.ended:
        return outcome.ended
    if outcome.fault:
        return outcome.fault
    if outcome.mib > most_mib:
        return "more memory than is allowed"
    # For a word of more than 1 KiB rcutils writes a line of its own, from C and past every logger.
    lines = [line for line in outcome.said.splitlines() if not line.startswith("[rcutils|error_handling.c")]
    if outcome.code in GOOD:
        rest = [line for line in lines if not line.startswith("note: ")]
        return "words on standard error beside a result" if rest else _unclear(lines)
    if outcome.code != REFUSED:
        return f"exit code {outcome.code}"
    if not lines or not all(line.strip() for line in lines):
        return "refused without a word"
    if len(lines) > 1 and not several:
        return "refused in more than one line"
    if any("Traceback (most recent call last)" in line for line in lines):
        return "a traceback among the words"
    named = re.compile(f"{_PARAMETER}|{naming}" if naming else _PARAMETER)
    if not all(name in line or named.search(line) for line in lines):
        return "a line names neither file nor parameter"
    return _unclear(lines)


_PARAMETER = r"^\w+: .|parameter '"


def _unclear(lines: list[str]) -> str:
    if any(len(line) > MOST_LETTERS for line in lines):
        return f"a line of more than {MOST_LETTERS} letters"
    return "" if all(line.isprintable() for line in lines) else "letters in a line that cannot be printed"
