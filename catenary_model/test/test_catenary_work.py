"""Work and impulse that the contact force gives to the wire, as the model accumulates them between its samples."""

import numpy as np
import pytest

from catenary_model.line import Line, Span, SteadyArm
from catenary_model.model import Catenary, Config

TS = 0.002
HELD = Line(spans=(Span(60.0, (), steady_arm=SteadyArm(4000.0)),), name="wires on arms, without droppers")


def force(k: int) -> float:
    t = k * TS
    return 118.0 * min(1.0, t) + 25.0 * np.sin(2 * np.pi * 1.16 * t) + 10.0 * np.sin(2 * np.pi * 9.0 * t)


def ride(substeps: int, cycles: int = 1500, local_compliance: bool = True) -> tuple[Catenary, float, float]:
    """Ride; give the catenary and trapezoids a cycle each of force over way, and of force over time."""
    catenary = Catenary(
        Config(substeps=substeps, local_compliance=local_compliance, newmark_beta=0.28, newmark_gamma=0.55)
    )
    work = impulse = before = 0.0
    for k in range(1, cycles + 1):
        w = catenary.w_cat
        catenary.step(force(k))
        work += 0.5 * (before + force(k)) * (catenary.w_cat - w)
        impulse += 0.5 * TS * (before + force(k))
        before = force(k)
    return catenary, work, impulse


@pytest.mark.parametrize("local_compliance", [True, False])
def test_with_one_step_a_cycle_work_is_force_over_way(local_compliance: bool) -> None:
    """One trapezoid a cycle, from outside and from inside: equal to rounding of 1500 sums."""
    catenary, work, impulse = ride(1, local_compliance=local_compliance)
    assert catenary.work == pytest.approx(work, rel=1e-10)
    assert catenary.impulse == pytest.approx(impulse, rel=1e-10)


def test_work_between_the_samples_is_part_of_it() -> None:
    """Two steps a cycle: what happens within is counted, a small but not a vanishing share; the impulse is the same."""
    catenary, work, impulse = ride(2)
    assert catenary.impulse == pytest.approx(impulse, rel=1e-10)
    assert 1e-6 < abs(catenary.work - work) / work < 1e-2


def test_slow_load_at_rest_stores_half_of_force_times_way() -> None:
    """A wire without droppers is a spring under a slow load: W = F w / 2, and all of it comes back.

    Up and down within 8 s each, slow against the wire's lowest mode (0.6 Hz); 1 % for what its motion takes.
    """
    catenary = Catenary(Config(line=HELD, speed=0.0))
    rise = 4000
    for k in range(1, rise + 1):
        catenary.step(60.0 * (1.0 - np.cos(np.pi * k / rise)))
    stored = catenary.work
    assert stored == pytest.approx(0.5 * 120.0 * catenary.w_cat, rel=0.01)
    for k in range(1, rise + 1):
        catenary.step(60.0 * (1.0 + np.cos(np.pi * k / rise)))
    assert abs(catenary.work) < 0.01 * stored


def test_reset_empties_the_books() -> None:
    catenary, _, _ = ride(2, 50)
    assert catenary.work != 0.0
    catenary.reset()
    assert (catenary.work, catenary.impulse) == (0.0, 0.0)
