"""Predictions of the reduced model: what is measured is what the controller has, and the measure is right."""

import numpy as np
import pytest

from catenary_model.line import CARRIER_3_1, CONTACT_3_1
from catenary_model.model import Config
from catenary_model.moving_frame import Mesh
from catenary_model.reduced import reduce
from validate import reduced
from validate.realtime import config

MESH = Mesh(0.75, 80)
V = 250.0 / 3.6


def test_matched_segment_is_that_of_the_model() -> None:
    ours, theirs = reduced.segment(MESH, CONTACT_3_1, V, 15.0, "matched_dashpot"), reduce(MESH, CONTACT_3_1, V, 15.0)
    for name in ("x", "M", "D", "K", "b"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))


def test_ends_differ_only_at_the_ends() -> None:
    free, held, matched = (reduced.segment(MESH, CONTACT_3_1, V, 15.0, ends) for ends in reduced.ENDS)
    for model in (held, matched):
        for name in ("M", "D", "K"):
            difference = getattr(model, name) - getattr(free, name)
            assert np.count_nonzero(difference[2:-2]) == 0
    assert np.count_nonzero(matched.D - free.D) == 2
    assert np.count_nonzero(held.K - free.K) == 4


@pytest.mark.parametrize("power", [0, 1, 2, 3])
def test_carried_forces_do_the_work_of_moved_ones(power: int) -> None:
    """For any cubic q, which Hermite elements have exactly, the moved load works on q as read 0.3 m further behind."""
    model = reduced.segment(MESH, CONTACT_3_1, V, 15.0, "free")
    S = reduced.carried(model, 0.3)
    f = np.zeros(model.n)
    f[20:60] = np.random.default_rng(2).standard_normal(40)

    def work(force: np.ndarray, shift: float) -> float:
        x = model.x - shift
        q = np.stack([x**power, power * x ** max(power - 1, 0)], axis=1).ravel()
        return float(force @ q)

    assert work(S @ f, 0.0) == pytest.approx(work(f, 0.3), rel=1e-9, abs=1e-9)


def test_forces_on_the_end_nodes_stay() -> None:
    model = reduced.segment(MESH, CONTACT_3_1, V, 15.0, "free")
    S = reduced.carried(model, 0.3)
    for i in (0, 1, -2, -1):
        f = np.zeros(model.n)
        f[i] = 1.0
        np.testing.assert_array_equal(S @ f, f)


def test_damping_of_the_droppers() -> None:
    """Half of 2 sqrt(T rhoA) of the carrier, nine droppers in 60 m; none without droppers."""
    line = Config().line
    more = 0.5 * 2.0 * np.sqrt(CARRIER_3_1.tension * CARRIER_3_1.mass_per_length) * 9 / 60.0
    assert reduced.damped(line).damping == pytest.approx(CONTACT_3_1.damping + more)
    assert reduced.damped(reduced.bare(line)) == line.contact


def test_predictions() -> None:
    """A bare wire is predicted to a micrometre; with droppers f_held matters, and the error grows with the horizon."""
    cycles = round(reduced.SETTLED / 2e-3) + 300
    settings = (config(250, 2, line=line) for line in reduced.lines(config(250, 2)).values())
    droppers, bare = (reduced.record(setting, 144.0, cycles, lambda _: None) for setting in settings)
    assert np.abs(reduced.errors(bare, 15.0, "matched_dashpot", "at rest")).max() < 1e-6
    course = reduced.rms(droppers, 15.0, "matched_dashpot", "at rest")
    nothing = reduced.rms(droppers, 15.0, "matched_dashpot", "nothing")
    assert course[0] < 0.05 < course[9] < course[29] < 9.0
    assert nothing[9] > 1.5 * course[9]
