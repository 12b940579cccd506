"""The condensed prediction and its program against a plant that is stepped one cycle after the other."""

import numpy as np
import pytest
from impedance_loop import random_impedance

from impedance_mpc.condense import LEAD, POSITION, VELOCITY, Weights, program
from impedance_mpc.plant import newmark_state_space, pt2_rig
from impedance_mpc.predict import (
    CORRECTION,
    DRIFT,
    FORCE_NOW,
    MOMENTUM,
    OTHERS,
    POSITION_BIAS,
    REFERENCE,
    VELOCITY_BIAS,
    predict,
)

TS = 0.002


def simulate(rig, model, layout, p, u, f):
    """Position, velocity and momentum error, the drive and its lead, instant by instant: (3.40), (3.44), (3.47)."""
    n, others = model.n, p[layout.momentum :]
    cat = newmark_state_space(model)
    x, wire = p[:2].copy(), p[2 : 2 + 3 * n].copy()
    held = p[2 + 3 * n : 2 + 4 * n]
    past = p[layout.ramp : layout.force].reshape(-1, 2)
    n_c = u.size

    def ramp(j):
        return past[-1 - j] if j < 0 else np.array([u[min(j, n_c - 1)], u[min(j + 1, n_c - 1)]])

    def reference(i):
        """Start of the ramp that arrives nearest to t_(k+i)."""
        return ramp(i - rig.cycles - (rig.share >= 0.5))[0]

    lead_time = 2.0 * rig.damping / rig.omega
    before, dp = others[FORCE_NOW], others[MOMENTUM]
    errors, drive, leads = [], [], [reference(0) - x[0] - lead_time * x[1]]
    for i in range(layout.horizon):
        x = rig.a @ x + rig.tail @ ramp(i - rig.cycles - 1) + rig.head @ ramp(i - rig.cycles)
        f_cor = f[min(i, n_c - 1)]
        force = p[layout.force + i] + f_cor
        wire = cat.a @ wire + cat.b * force + cat.b_force @ held
        w, v = cat.c @ wire
        w += model.compliance * force + others[POSITION_BIAS] + others[DRIFT] * TS * (i + 1)
        v += model.compliance * (force - before) / TS + others[VELOCITY_BIAS] + others[DRIFT]
        before = force
        dp -= TS * f_cor
        errors.append([x[0] - w, x[1] - v, dp])
        drive.append(x)
        leads.append(reference(i + 1) - x[0] - lead_time * x[1])
    return np.array(errors), np.array(drive), np.array(leads)


CASES = [(30, 20, 0.0), (7, 7, 0.0007), (9, 2, 0.002), (12, 6, 0.0045)]


@pytest.mark.parametrize(("n_p", "n_c", "delay"), CASES)
def test_condensed_prediction_equals_the_simulation_step_by_step(n_p, n_c, delay):
    """Same arithmetic in another order: 1e-10 of the largest output."""
    rig, model = pt2_rig(40.0, 0.8, TS, delay), random_impedance(4, compliance=2e-6)
    found = predict(rig, model, n_p, n_c)
    rng = np.random.default_rng(2)
    p = rng.normal(size=found.layout.size)
    p[found.layout.force : found.layout.momentum] *= 100.0
    u, f = rng.normal(size=n_c), 10.0 * rng.normal(size=n_c)
    errors, drive, leads = simulate(rig, model, found.layout, p, u, f)
    y = (found.free @ p + found.moved @ np.concatenate([u, f])).reshape(3, n_p).T
    np.testing.assert_allclose(y, errors, atol=1e-10 * np.abs(errors).max())
    motion = (found.drive_free @ p + found.drive_moved @ u).reshape(2, n_p).T
    np.testing.assert_allclose(motion, drive, atol=1e-10 * np.abs(drive).max())
    lead = found.lead_free @ p + found.lead_moved @ u
    inside = slice(0, n_p)  # the last one would need a move beyond the horizon
    np.testing.assert_allclose(lead[inside], leads[inside], atol=1e-10 * np.abs(leads).max())


@pytest.mark.parametrize(("n_p", "n_c", "delay"), CASES)
def test_hessian_gradient_and_rows_are_those_of_the_cost(n_p, n_c, delay):
    """H and G p are second and first derivative of (3.55): an independent sum of squares agrees to 1e-8."""
    rig, model = pt2_rig(40.0, 0.8, TS, delay), random_impedance(3, compliance=1e-6)
    w = Weights(2.0, 3e-4, 0.5, 0.07, 0.11, 0.13, 50.0)
    found = program(predict(rig, model, n_p, n_c), w, n_c, 3)
    rng = np.random.default_rng(5)
    p = rng.normal(size=found.layout.size) * 1e-2
    others = p[-OTHERS:]

    def cost(z):
        u, f = z[:n_c] * 1e-3, z[n_c:]
        errors, _, _ = simulate(rig, model, found.layout, p, u, f)
        total = np.sum(w.position * (errors[:, 0] * 1e3) ** 2 + w.velocity * (errors[:, 1] * 1e3) ** 2)
        total += w.momentum * np.sum(errors[:, 2] ** 2) + w.correction_force * np.sum(f**2)
        total += w.reference_rate * np.sum((np.diff(np.concatenate([[others[REFERENCE]], u])) * 1e3) ** 2)
        return total + w.correction_rate * np.sum(np.diff(np.concatenate([[others[CORRECTION]], f])) ** 2)

    base = cost(np.zeros(2 * n_c))
    for _ in range(5):
        z = rng.normal(size=2 * n_c)
        quadratic = 0.5 * z @ found.hessian @ z + (found.gradient_t.T @ p) @ z
        assert quadratic == pytest.approx(cost(z) - base, rel=1e-8)
    assert np.array_equal(found.hessian, found.hessian.T)
    assert np.linalg.eigvalsh(found.hessian)[0] > 0.0

    z = rng.normal(size=2 * n_c)
    _, drive, leads = simulate(rig, model, found.layout, p, z[:n_c] * 1e-3, z[n_c:])
    rows = found.rows @ z + found.row_free @ p[found.row_columns]
    for kind, values in ((POSITION, drive[:, 0]), (VELOCITY, drive[:, 1]), (LEAD, leads)):
        for row in rows[found.kind == kind]:
            assert np.abs(values * 1e3 - row).min() < 1e-9 * max(1.0, np.abs(values).max() * 1e3)
    np.testing.assert_allclose(found.softness[found.kind == VELOCITY], 2.0 * 50.0 / 100.0**2)


def test_rows_that_no_move_can_change_are_left_out():
    """With two cycles of dead time the first two instants of the drive are decided already."""
    late = program(
        predict(pt2_rig(40.0, 0.8, TS, 0.004), random_impedance(1), 10, 5), Weights(1, 1, 1, 1, 1, 1, 1), 5, 1
    )
    assert np.all(np.any(late.rows != 0.0, axis=1))
    assert np.count_nonzero(late.kind == POSITION) == 8


def test_control_horizon_has_to_fit():
    with pytest.raises(ValueError, match="control horizon"):
        predict(pt2_rig(40.0, 0.8, TS), random_impedance(1), 5, 6)
