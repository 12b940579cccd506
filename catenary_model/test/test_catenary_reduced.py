"""The reduced model of the controller against the full one (thesis 3.1.9)."""

import dataclasses

import numpy as np
import pytest

from catenary_model.lattice import local_compliance
from catenary_model.line import Line, Span
from catenary_model.model import Catenary, Config
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA, discretise

FREE = Line(spans=(Span(60.0, ()),), name="free wires")
TS = 0.002
HORIZON = 30


def ride(
    config: Config, cycles: int, contact: float = 1.0
) -> tuple[Catenary, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ride with a pantograph-like force; return model, forces, w_cat, states (q, q', q''), f_held per cycle."""
    catenary = Catenary(dataclasses.replace(config, start_position=12.3))
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
    states: np.ndarray,
    held: np.ndarray,
    first: int,
    hold: bool = True,
) -> np.ndarray:
    """Errors of c . q over the horizon for predictions from every eleventh cycle; the forces to come are known."""
    A, B, B_held = discretise(catenary.reduced, catenary.config.cycle_time)
    at = int(np.flatnonzero(catenary.reduced.b)[0])
    errors = []
    for k in range(first, len(states) - HORIZON - 1, 11):
        x = states[k].copy()
        force = B_held @ held[k] if hold else 0.0
        row = []
        for i in range(1, HORIZON + 1):
            x = A @ x + B * forces[k + i] + force
            row.append(x[at] - states[k + i, at])
        errors.append(row)
    return np.array(errors)


def test_matrices_are_a_free_segment() -> None:
    model = Catenary(Config()).reduced
    stations = model.x.size
    assert model.n == 2 * stations
    assert -model.x[0] == model.x[-1] == pytest.approx(Config().segment_half_length, abs=0.5 * Config().element_length)
    # total mass: rigid translation
    rigid = np.tile([1.0, 0.0], stations)
    assert rigid @ model.M @ rigid == pytest.approx(1.35 * (model.x[-1] - model.x[0]), rel=1e-12)
    assert model.b @ rigid == 1.0
    np.testing.assert_allclose(model.M, model.M.T)
    assert np.linalg.eigvalsh(model.M).min() > 0.0


def test_definition_of_the_held_force() -> None:
    """f_held = M q'' + D q' + K q - b f_cat with the full model's state, to rounding; w_cat is c . q + dC f_cat."""
    catenary, forces, w, states, held = ride(Config(), 700)
    model, n = catenary.reduced, catenary.reduced.n
    q, v, a = states[-1, :n], states[-1, n : 2 * n], states[-1, 2 * n :]
    expected = model.M @ a + model.D @ v + model.K @ q - model.b * forces[-1]
    np.testing.assert_allclose(held[-1], expected, atol=1e-9 * np.abs(expected).max())
    assert catenary.f_cat == forces[-1]
    dC = local_compliance(catenary.config.line.contact.seen_from(250 / 3.6), catenary.mesh.h)
    assert w[-1] == pytest.approx(model.b @ q + dC * forces[-1], abs=1e-15)


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0, 320.0])
def test_equals_the_full_model_without_droppers(speed_kmh: float) -> None:
    """Same steps, same mesh: rounding but for the segment's ends, whose reflections are not back yet, 1 micrometre."""
    config = Config(
        line=FREE, speed=speed_kmh / 3.6, substeps=1, newmark_beta=NEWMARK_BETA, newmark_gamma=NEWMARK_GAMMA
    )
    catenary, forces, _, states, held = ride(config, 1500)
    assert np.abs(prediction_errors(catenary, forces, states, held, first=500)).max() < 1e-6


def test_own_steps_predict_the_full_model_s_half_steps() -> None:
    """The controller's steps of 2 ms against the default integration, free wires: below 20 micrometres in 30 steps."""
    catenary, forces, _, states, held = ride(Config(line=FREE), 1500)
    errors = prediction_errors(catenary, forces, states, held, first=500)
    assert np.sqrt(np.mean(errors**2, axis=0)).max() < 20e-6


def test_steps_of_the_controller_are_stable() -> None:
    """At every speed that the parameters allow, also where the full model's own parameters would not be over Ts."""
    for speed_kmh in (400.0, 250.0):
        model = Catenary(Config(speed=speed_kmh / 3.6)).reduced
        assert np.abs(np.linalg.eigvals(discretise(model, TS)[0])).max() < 1.0
    A, _, _ = discretise(model, TS, Config().newmark_beta, Config().newmark_gamma)
    assert np.abs(np.linalg.eigvals(A)).max() > 1.0  # the reason for parameters of its own


def test_held_forces_predict_with_droppers() -> None:
    """250 km/h, droppers pass the pantograph every 90 ms: rms over the ride at 1, 5, 10, 30 steps, in mm.

    Bounds are 1.5 times what was measured; the motion itself has an rms of about 10 mm. Without f_held it is worse.
    """
    catenary, forces, _, states, held = ride(Config(), 2500)
    rms = 1e3 * np.sqrt(np.mean(prediction_errors(catenary, forces, states, held, first=800) ** 2, axis=0))
    without = prediction_errors(catenary, forces, states, held, first=800, hold=False)
    assert rms[0] < 0.02
    assert rms[4] < 0.2
    assert rms[9] < 0.9
    assert rms[29] < 8.5
    assert rms[9] < 0.6 * 1e3 * np.sqrt(np.mean(without[:, 9] ** 2))


def test_at_rest_without_force_the_prediction_stays() -> None:
    """Standing train, wire at rest: held dropper forces and weight keep it there, 1e-9 m over the horizon."""
    catenary, _, _, states, held = ride(Config(speed=0.0), 200, contact=0.0)
    errors = prediction_errors(catenary, np.zeros(200), states, held, first=0)
    assert np.abs(errors).max() < 1e-9
