"""Forecasts of the contact force: closed forms, contact that ends and returns, noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impedance_mpc.forecast import ForecastRule, design, forecast, observe, start

TS, NP = 0.002, 30
RULE = {
    "stiffness": 5e4, "head_mass": 7.2, "noise": 0.3, "load_noise": 100.0, "rate_noise": 1e4, "decay": 0.01
}  # fmt: skip


def make(kind, **changes):
    d = design(ForecastRule(kind, **{**RULE, **changes}), TS)
    return d, np.zeros(3)


def ahead(d, x, force, way=None):
    out = np.zeros(NP)
    forecast(d, x, force, np.zeros(NP) if way is None else way, out, np.zeros(3))
    return out


def head_on_spring(cycles, load, v_tr, fine=100):
    """Head of 7.2 kg on 5e4 N/m under a load (N) over a drive at v_tr(t), in fine steps; force and way each cycle."""
    k, m, h = RULE["stiffness"], RULE["head_mass"], TS / fine
    x, v, t = load / k, 0.0, 0.0
    force, way = [load], [0.0]
    for _ in range(cycles):
        gone = 0.0
        for _ in range(fine):
            v += h * (load - k * max(0.0, x)) / m
            x += h * (v - v_tr(t))
            gone += h * v_tr(t)
            t += h
        force.append(k * max(0.0, x))
        way.append(gone)
    return np.array(force), np.array(way)


def test_constant_is_the_thesis():
    d, x = make("constant")
    start(d, x, 100.0, 0.0)
    observe(d, x, 123.0, 0.001)
    np.testing.assert_array_equal(ahead(d, x, 123.0), 123.0)


@pytest.mark.parametrize("kind", ["constant", "linear", "contact"])
def test_a_force_at_rest_stays(kind):
    """Nothing moves: every forecast is the force itself, to rounding."""
    d, x = make(kind)
    start(d, x, 118.0, 0.0)
    for _ in range(50):
        observe(d, x, 118.0, 0.0)
    np.testing.assert_allclose(ahead(d, x, 118.0), 118.0, rtol=1e-12)


def test_linear_follows_a_ramp_and_lets_its_rate_die_out():
    """A ramp of 1000 N/s is followed without lag (constant-rate filter); the forecast's sum of steps is geometric."""
    d, x = make("linear")
    start(d, x, 0.0, 0.0)
    for k in range(1, 300):
        observe(d, x, 2.0 * k, 0.0)
    out = ahead(d, x, 598.0)
    assert out[0] == pytest.approx(600.0, abs=1e-6)
    q = np.exp(-TS / RULE["decay"])
    assert out[-1] == pytest.approx(598.0 + 2.0 * (1.0 - q**NP) / (1.0 - q), abs=1e-6)


def test_contact_knows_what_the_drive_is_about_to_do():
    """Head at rest, drive moved up by 0.1 mm within one cycle: the force rises as that of the simulated head.

    The spring alone would give 5 N; the head gives way meanwhile. 2 % is the drive's even speed within the cycle.
    """
    d, x = make("contact")
    start(d, x, 100.0, 0.0)
    way = np.zeros(NP)
    way[3] = -1e-4  # down: away from the head below it
    force, _ = head_on_spring(NP, 100.0, lambda t: -0.05 if 3 * TS <= t < 4 * TS - 1e-9 else 0.0)
    out = ahead(d, x, 100.0, way)
    np.testing.assert_allclose(out[:3], 100.0, rtol=1e-12)
    np.testing.assert_allclose(out - 100.0, force[1:] - 100.0, atol=0.02 * np.abs(force - 100.0).max())


@pytest.mark.parametrize(("kind", "better"), [("linear", 2.5), ("contact", 4.0)])
def test_one_cycle_ahead_beats_the_constant(kind, better):
    """A drive that swings at 1 and 8 Hz below a head under 120 N with noise of 0.3 N: several times less error."""

    def v_tr(t):
        return 0.15 * np.sin(2.0 * np.pi * t) + 0.04 * np.sin(2.0 * np.pi * 8.0 * t)

    force, way = head_on_spring(1500, 120.0, v_tr, fine=20)
    noisy = force + 0.3 * np.random.default_rng(1).standard_normal(force.size)
    d, x = make(kind)
    start(d, x, noisy[0], 0.0)
    errors = {"it": [], "constant": []}
    for k in range(1, force.size - 1):
        observe(d, x, noisy[k], way[k])
        coming = np.zeros(NP)
        coming[0] = way[k + 1]
        errors["it"].append(ahead(d, x, noisy[k], coming)[0] - force[k + 1])
        errors["constant"].append(noisy[k] - force[k + 1])
    it, constant = (np.std(errors[name][200:]) for name in ("it", "constant"))
    assert it * better < constant


def test_contact_that_is_lost_and_returns():
    """A drive that jumps away by 5 mm leaves the head flying; its forecast is no force until the head is back.

    The head of 7.2 kg under 120 N needs sqrt(2 * 5 mm / (120 / 7.2 m/s^2)) = 24.5 ms for what the drive did in one
    cycle: at most one cycle of 2 ms off.
    """
    d, x = make("contact")
    start(d, x, 120.0, 0.0)
    for _ in range(20):
        observe(d, x, 120.0, 0.0)
    observe(d, x, 0.0, 0.005 + 120.0 / 5e4)
    out = ahead(d, x, 0.0)
    first = int(np.argmax(out > 0.0))
    assert abs((first + 1) * TS - 0.0245) <= 2 * TS
    assert np.all(out[:first] == 0.0)
    for _ in range(100):
        observe(d, x, 0.0, 0.0)
    for _ in range(300):
        observe(d, x, 120.0, 0.0)
    np.testing.assert_allclose(ahead(d, x, 120.0), 120.0, rtol=1e-3)


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from(["constant", "linear", "contact"]),
    st.lists(st.tuples(st.floats(0.0, 1000.0), st.floats(-0.01, 0.01)), min_size=1, max_size=60),
)
def test_no_forecast_pulls_and_none_runs_away(kind, signals):
    """Whatever is measured: finite, never negative, bounded by what the spring and the measured jumps can make."""
    d, x = make(kind)
    start(d, x, signals[0][0], 0.0)
    for force, way in signals:
        observe(d, x, force, way)
        out = ahead(d, x, force)
        assert np.all(np.isfinite(out))
        assert out.min() >= 0.0
        assert out.max() < 1e6


def test_senseless_rules_are_refused():
    with pytest.raises(ValueError, match="none of"):
        ForecastRule("wild", **RULE)
    with pytest.raises(ValueError, match="positive"):
        ForecastRule("contact", **{**RULE, "head_mass": 0.0})
