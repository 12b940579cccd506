"""The reduced model of the controller against the full one (thesis 3.1.9)."""

import numpy as np
import pytest

from catenary_model.line import Line
from catenary_model.model import Catenary, Config
from catenary_model.reduced import discretise

TS = 0.002
HORIZON = 30


def ride(
    line: Line, speed: float, cycles: int, contact: float = 1.0
) -> tuple[Catenary, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ride with a pantograph-like force; return model, forces, w_cat, states (q, q', q''), f_held per cycle."""
    catenary = Catenary(Config(line=line, speed=speed, start_position=12.3))
    n = catenary.reduced.n
    t = TS * np.arange(cycles)
    forces = (
        contact * np.minimum(1.0, t) * (120.0 + 25.0 * np.sin(2 * np.pi * 1.16 * t) + 8.0 * np.sin(2 * np.pi * 6.3 * t))
    )
    w, states, held = np.zeros(cycles), np.zeros((cycles, 3 * n)), np.zeros((cycles, n))
    for k in range(cycles):
        catenary.step(float(forces[k]))
        w[k] = catenary.w_cat
        states[k] = np.concatenate(
            [catenary.segment_displacement, catenary.segment_velocity, catenary.segment_acceleration]
        )
        held[k] = catenary.segment_force
    return catenary, forces, w, states, held


def prediction_errors(
    catenary: Catenary,
    forces: np.ndarray,
    w: np.ndarray,
    states: np.ndarray,
    held: np.ndarray,
    first: int,
    hold: bool = True,
) -> np.ndarray:
    config = catenary.config
    A, B, B_held = discretise(catenary.reduced, config.cycle_time, config.newmark_beta, config.newmark_gamma)
    at = int(np.flatnonzero(catenary.reduced.b)[0])
    errors = []
    for k in range(first, len(w) - HORIZON - 1, 11):
        x = states[k].copy()
        force = B_held @ held[k] if hold else 0.0
        row = []
        for i in range(1, HORIZON + 1):
            x = A @ x + B * forces[k + i] + force
            row.append(x[at] - w[k + i])
        errors.append(row)
    return np.array(errors)


def test_matrices_are_a_free_segment() -> None:
    model = Catenary(Config()).reduced
    assert model.n == 82
    assert model.x[0] == -20.0 and model.x[-1] == 20.0
    # total mass: rigid translation
    rigid = np.tile([1.0, 0.0], 41)
    assert rigid @ model.M @ rigid == pytest.approx(1.35 * 40.0, rel=1e-12)
    assert model.b @ rigid == 1.0
    np.testing.assert_allclose(model.M, model.M.T)
    assert np.linalg.eigvalsh(model.M).min() > 0.0


def test_definition_of_the_held_force() -> None:
    """f_held = M q'' + D q' + K q - b f_cat with the full model's state, to rounding."""
    catenary, forces, w, states, held = ride(Line(), 250 / 3.6, 700)
    model, n = catenary.reduced, catenary.reduced.n
    q, v, a = states[-1, :n], states[-1, n : 2 * n], states[-1, 2 * n :]
    expected = model.M @ a + model.D @ v + model.K @ q - model.b * forces[-1]
    np.testing.assert_allclose(held[-1], expected, atol=1e-9 * np.abs(expected).max())
    assert catenary.f_cat == forces[-1]
    assert w[-1] == model.b @ q


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0, 320.0])
def test_equals_the_full_model_without_droppers(speed_kmh: float) -> None:
    """Below 1 micrometre over 30 steps: only what the segment's ends reflect differs, and that has not come back."""
    errors = prediction_errors(*ride(Line(dropper_positions=()), speed_kmh / 3.6, 1500), first=500)
    assert np.abs(errors).max() < 1e-6


def test_held_forces_predict_with_droppers() -> None:
    """250 km/h, droppers pass the pantograph every 90 ms: rms over the ride at 1, 5, 10, 30 steps, in mm.

    Bounds are 1.5 times what was measured; the motion itself has an rms of about 10 mm. Without f_held it is worse.
    """
    data = ride(Line(), 250 / 3.6, 2500)
    rms = 1e3 * np.sqrt(np.mean(prediction_errors(*data, first=800) ** 2, axis=0))
    without = 1e3 * np.sqrt(np.mean(prediction_errors(*data, first=800, hold=False) ** 2, axis=0))
    assert rms[0] < 0.02
    assert rms[4] < 0.3
    assert rms[9] < 1.2
    assert rms[29] < 9.0
    assert rms[9] < 0.6 * without[9]


def test_at_rest_without_force_the_prediction_stays() -> None:
    """Standing train, wire at rest: held dropper forces and weight keep it there, 1e-9 m over the horizon."""
    catenary, _, w, states, held = ride(Line(), 0.0, 200, contact=0.0)
    errors = prediction_errors(catenary, np.zeros(200), w, states, held, first=0)
    assert np.abs(errors).max() < 1e-9
