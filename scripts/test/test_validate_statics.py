"""Static push by all models: points and averages are right, models agree, a wrong stiffness of any kind is noticed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from catenary_model.line import Line, Mast, SteadyArm
from catenary_model.line_file import load_line
from phil_study.outcome import Row
from validate import statics
from validate.statics import MODELS, Curve, Point, mesh_free, points_of, rested, rows, stairs

LINE = load_line("en50318_2002")
SPAN = LINE.spans[0]
FORCES = (150.0,)
POINTS = [Point(0.0, "support"), Point(5.0, "dropper"), Point(26.75, "between"), Point(30.0, "dropper")]


def with_span(**changes: object) -> Line:
    return replace(LINE, spans=(replace(SPAN, **changes),))  # type: ignore[arg-type]


WRONG = {
    "tension of the contact wire, 2 % more": replace(LINE, contact=replace(LINE.contact, tension=1.02 * 20e3)),
    "tension of the carrier, 2 % less": replace(LINE, carrier=replace(LINE.carrier, tension=0.98 * 16e3)),
    "droppers of half the stiffness": with_span(droppers=tuple(replace(d, stiffness=5e4) for d in SPAN.droppers)),
    "masts of a tenth": with_span(mast=Mast(stiffness=5e4)),
    "steady arms that are not there": with_span(steady_arm=SteadyArm(270.0)),
}


def verdicts(found: dict[str, Curve]) -> dict[tuple[str, str], Row]:
    truth = mesh_free(LINE, POINTS, FORCES)
    made = rows(LINE, POINTS, FORCES, truth, found)
    return {(row.name, row.case.removeprefix(f"{LINE.name}, ")): row for row in made}


def test_points_are_supports_droppers_and_middles_between_droppers() -> None:
    points = points_of(load_line("alternating_spans"))
    assert [point.what for point in points].count("support") == 2
    assert [point.what for point in points].count("dropper") == 16
    assert [point.what for point in points].count("between") == 14
    assert [point.zeta for point in points] == sorted(point.zeta for point in points)
    assert Point(50.0, "support") in points and Point(57.75, "between") in points


def test_an_average_sees_the_place_of_rest_and_a_drift() -> None:
    """A swing of a tenth of the lift at 1 Hz leaves less than 1e-5 of it (Hann); a drift of 1 % a second is seen."""
    force, ends = stairs((100.0, 200.0))
    assert [float(force[end - 1]) for end in ends] == [100.0, 200.0]
    t = statics.TIME_STEP * np.arange(force.size)
    mean, apart = rested(1e-4 * force * (1.0 + 0.1 * np.sin(2.0 * np.pi * 1.03 * t)), ends)
    assert mean == pytest.approx([0.01, 0.02], rel=1e-5)
    assert apart < statics.REST
    assert rested(0.01 * (1.0 + 0.01 * t), ends)[1] > statics.REST


@pytest.fixture(scope="module")
def right() -> dict[str, Curve]:
    return {name: model(LINE, POINTS, FORCES, lambda _: None) for name, model in MODELS.items()}


@pytest.mark.slow
def test_all_models_agree_on_the_right_line(right: dict[str, Curve]) -> None:
    """Limits are those of the study. Between droppers no mesh is in the way: 1e-4 for what is compensated there."""
    found = verdicts(right)
    assert [key for key, row in found.items() if row.holds is False] == []
    assert sum(row.holds is True for row in found.values()) == 1 + 4 * len(MODELS)
    truth = mesh_free(LINE, POINTS, FORCES).uplift
    for name in ("fe", "fd"):
        np.testing.assert_allclose(right[name].uplift[[0, 2]], truth[[0, 2]], rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_stiffness_is_noticed(what: str, name: str) -> None:
    curve = MODELS[name](WRONG[what], POINTS, FORCES, lambda _: None)
    found = verdicts({name: curve})
    assert found["e against mesh-free", name].holds is False
    assert found["not at rest", name].holds is True  # it is the stiffness, and no unrest


@pytest.mark.slow
def test_a_dropper_that_slackens_at_another_force_is_noticed(right: dict[str, Curve]) -> None:
    """A curve that says one slack dropper too many at one push."""
    more = right["fe"].slack.copy()
    more[0, 0] += 1
    row = verdicts({"fe": replace(right["fe"], slack=more)})["other slack droppers, pushes", "fe"]
    assert (row.value, row.holds) == (1.0, False)


@pytest.mark.slow
def test_a_curve_that_still_moves_is_noticed(right: dict[str, Curve]) -> None:
    row = verdicts({"fe": replace(right["fe"], unrest=2.0 * statics.REST)})["not at rest", "fe"]
    assert row.holds is False


def test_non_uniformity_of_known_elasticities() -> None:
    assert statics.non_uniformity(np.array([[0.2, 0.3], [0.6, 0.3], [0.4, 0.3]])) == pytest.approx([0.5, 0.0])


@pytest.mark.slow
def test_a_shortened_run_gives_rows_points_and_a_picture(tmp_path) -> None:
    said: list[str] = []
    outcome = statics.run(True, tmp_path, said.append)
    assert outcome.holds and said
    document = json.loads(json.dumps(outcome.document()))
    points = document["points_of_en50318_2002"]
    assert {point["what"] for point in points} == {"support", "dropper", "between"}
    assert set(points[0]["elasticity_mm_N"]) == {"mesh-free", *MODELS}
    assert all(0.19 < point["elasticity_mm_N"]["fe"][0] < 0.5 for point in points)
    for name, picture in outcome.pictures.items():
        picture(tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert any("none was read" in note for note in outcome.notes)
