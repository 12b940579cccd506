"""Damaged files of every kind, and damaged command lines, lead to a result or to clear lines.

``scripts/fuzz.sh`` does it a thousand times each.

Damaged bags are read in energy_monitor/test.
"""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from fuzz.entries import ENTRIES
from fuzz.judge import Outcome, fault_of
from fuzz.kinds import KINDS, Example
from fuzz.mutations import DAMAGES, mutants

CASES = {"yaml": 6, "line": 6, "pantograph": 12, "trajectory": 20, "limits": 25, "report-limits": 25}
CASES["command-line"] = 40
WITH_ROS = (b"node", b"record")
"""Commands that initialise ROS, which a process of tests may have done already."""


def outcome_of(entry: str, case: Path) -> Outcome:
    """Read a case in this process: an exception is the test's."""
    words = io.StringIO()
    with contextlib.redirect_stderr(words):
        try:
            code = ENTRIES[entry](case)
        except SystemExit as error:
            code = error.code if isinstance(error.code, int) else 1
    return Outcome(code, words.getvalue())


@pytest.mark.parametrize("name", sorted(CASES))
@pytest.mark.slow
def test_damaged_files_end_in_a_result_or_in_clear_lines(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    examples = [good for good in kind.examples(None) if good.content.split(b"\0")[0] not in WITH_ROS]

    @settings(
        max_examples=CASES[name], database=None, phases=(Phase.generate,), suppress_health_check=list(HealthCheck)
    )
    @given(
        st.sampled_from(examples).flatmap(lambda good: mutants(good.content, good.form).map(lambda new: (good, new)))
    )
    def read(drawn: tuple[Example, bytes]) -> None:
        shutil.rmtree(tmp_path / "case", ignore_errors=True)
        case = drawn[0].lay(tmp_path / "case", drawn[1])
        found = outcome_of(kind.entries[0], case)
        assert not fault_of(found, case.name, kind.most_mib, several=kind.several, naming=kind.naming), found.said

    read()


def test_good_examples_are_read(tmp_path: Path) -> None:
    for name in ("pantograph", "trajectory", "limits", "report-limits"):
        for number, example in enumerate(KINDS[name].examples(None)):
            found = outcome_of(KINDS[name].entries[0], example.lay(tmp_path / f"{name}{number}"))
            assert (found.code, found.said) == (0, "")


@pytest.mark.parametrize(
    ("outcome", "fault"),
    [
        (Outcome(2, "a.yaml: 'x' is unknown\n"), ""),
        (Outcome(2, "run: error: --set x: the form is NODE.KEY=VALUE\n"), ""),
        (Outcome(0, "note: a.yaml: 010 is read as 8\n"), ""),
        (Outcome(2, "rig: parameter 'x' = 1 is not allowed\nrig: parameter 'y' = 1 is not allowed\n"), ""),
        (Outcome(2), "without a word"),
        (Outcome(2, "[rcutils|error_handling.c:65] an error string will be truncated\n"), "without a word"),
        (Outcome(1, "a.yaml: warning\n"), "beside a result"),
        (Outcome(3, "a.yaml: no\n"), "exit code 3"),
        (Outcome(2, "it is wrong\n"), "neither file nor parameter"),
        (Outcome(2, f"a.yaml: {'x' * 2000}\n"), "more than 1000 letters"),
        (Outcome(2, "a.yaml: \x1b[31mred\n"), "cannot be printed"),
        (Outcome(2, "a.yaml: no\n", mib=1e4), "memory"),
        (Outcome(fault="KeyError from bag.py, read"), "KeyError"),
        (Outcome(ended="no answer within 20 s"), "no answer"),
    ],
)
def test_the_judge_tells_clear_refusals_from_faults(outcome: Outcome, fault: str) -> None:
    found = fault_of(outcome, "a.yaml", 100.0, several=True)
    assert fault in found and bool(found) == bool(fault)


def test_one_line_is_wanted_where_the_first_mistake_ends_the_reading() -> None:
    found = fault_of(Outcome(2, "a.yaml: one\na.yaml: two\n"), "a.yaml", 100.0, several=False)
    assert found == "refused in more than one line"


@pytest.mark.parametrize("form", sorted(DAMAGES))
def test_damages_take_whatever_the_one_before_left(form: str) -> None:
    @settings(max_examples=60, database=None)
    @given(DAMAGES[form], st.binary(max_size=40))
    def damage(damage: Callable[[bytes], bytes], content: bytes) -> None:
        assert isinstance(damage(content), bytes)
        assert damage(content) == damage(content)

    damage()
