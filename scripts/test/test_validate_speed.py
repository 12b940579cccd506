"""Speed that changes: what the study compares, and a shortened run of it."""

from pathlib import Path

import numpy as np
import pytest

from validate import speed
from validate.speed import Course, parting, string_error


def test_phases_fill_the_journey() -> None:
    """Start and brake last v/a + a/j; the train has its cruising speed at the end of the one, the other's beginning."""
    course = Course()
    (_, first), (begin, end), (brake, last) = course.phases.values()
    assert (first, end) == (begin, brake)
    for t in (begin, 0.5 * (begin + end), end):
        assert course.travel.at(t)[1] == pytest.approx(speed.CRUISE, rel=1e-12)
    assert course.travel.at(last)[:2] == pytest.approx((course.distance, 0.0), rel=1e-12)
    assert course.travel.at(first - 1.0)[1] < speed.CRUISE
    # the mesh begins before the start and ends behind the stop
    assert speed.START + course.distance < (course.spans - 2) * speed.SPAN


def test_string_is_the_better_the_finer() -> None:
    coarse, fine = string_error(2.0, 2e-3), string_error(1.0, 1e-3)
    assert max(fine) < 0.004
    assert all(0.4 * a < b < 0.6 * a for a, b in zip(coarse, fine, strict=True))


@pytest.mark.slow
def test_forces_part_with_the_square_of_the_step() -> None:
    assert 0.0 < parting(5e-4) < 0.35 * parting(1e-3)


@pytest.mark.slow
def test_a_shortened_run_gives_rows_and_a_picture(tmp_path: Path) -> None:
    said: list[str] = []
    outcome = speed.run(True, tmp_path, said.append)
    assert outcome.holds and said
    values = {(row.name, row.case): row.value for row in outcome.rows}  # type: ignore[union-attr]
    assert all(np.isfinite(value) for value in values.values())
    assert {case.split(",")[0] for name, case in values if name == "error of force"} == {"start", "cruise", "brake"}
    outcome.pictures["journey"](tmp_path / "journey.png")
    assert (tmp_path / "journey.png").stat().st_size > 10_000
