"""One wire by finite differences against closed forms: motion, work, energy, and what an absorbing end sends back."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from moving_frames import FREE, HEAVY, difference, pulse

from catenary_model.build import Config
from catenary_model.finite_difference import Catenary, grid
from catenary_model.finite_difference import layout as fd
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line, Span, SteadyArm, Wire

STRING = Wire(1.35, 0.0, 1e-3, 20e3)
"""Without damping and all but without bending: d'Alembert's solution holds."""
STRINGS = Line(carrier=STRING, contact=STRING, spans=(Span(60.0, ()),), name="strings")


def setting(**changes: object) -> Config:
    """Finite differences with ends that need no design."""
    base = Config(discretisation="fd", grid_boundary="one_way")
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0])
@pytest.mark.slow
def test_a_string_under_a_moving_force_moves_by_its_impulse(speed_kmh: float) -> None:
    """D'Alembert: the wire under the force is at c/(2 T) times the impulse, at any speed below c; so is the work.

    Before anything is back from the ends; 0.02 % of the largest displacement, 0.2 % of the work, less on a finer grid.
    """
    per_impulse = STRING.wave_speed / (2.0 * STRING.tension)
    errors = []
    for dx, steps in ((0.5, 2), (0.25, 4)):
        catenary = Catenary(setting(line=STRINGS, speed=speed_kmh / 3.6, grid_spacing=dx, grid_substeps=steps))
        catenary_w, expected, impulse = [], [], 0.0
        for k in range(1, 201):
            fine = np.linspace((k - 1) * 0.002, k * 0.002, 2)
            impulse += 0.5 * 0.002 * (pulse(fine[0], 0.3) + pulse(fine[1], 0.3))
            catenary.step(pulse(k * 0.002, 0.3))
            catenary_w.append(catenary.w_cat)
            expected.append(per_impulse * impulse)
        errors.append(np.abs(np.array(catenary_w) - np.array(expected)).max())
        work = per_impulse * 0.002 * sum(pulse(k * 0.002, 0.3) ** 2 for k in range(201))
        assert catenary.work == pytest.approx(work, rel=2e-3)
        assert catenary.impulse == pytest.approx(impulse, rel=1e-12)
        assert errors[-1] < 2e-4 * max(expected)
    assert errors[1] < errors[0]


def test_rates_are_those_of_the_motion() -> None:
    """v_cat and a_cat against differences of w_cat over cycles, second order in the cycle: 0.3 and 1 % at 6.7 Hz."""
    catenary = Catenary(setting(line=FREE, cycle_time=0.001, grid_substeps=1))
    w, v, a = [], [], []
    for k in range(1, 400):
        catenary.step(pulse(k * 0.001, 0.15))
        w.append(catenary.w_cat)
        v.append(catenary.v_cat)
        a.append(catenary.a_cat)
    rate = (np.array(w[2:]) - np.array(w[:-2])) / 0.002
    assert np.abs(rate - v[1:-1])[20:].max() < 0.003 * np.abs(rate).max()
    rate_2 = (np.array(v[2:]) - np.array(v[:-2])) / 0.002
    assert np.abs(rate_2 - a[1:-1])[20:].max() < 0.01 * np.abs(rate_2).max()


def test_energy_grows_by_the_work_of_the_force_and_by_nothing_else() -> None:
    """Clamped wires on masts and arms without damping at rest: the scheme's energy, step by step, to rounding.

    E = 1/2 m |w(n+1) - w(n)|^2/dt^2 + 1/2 w(n+1) K w(n) + sum k e(n+1) e(n) / 2 is what the leapfrog keeps, with
    K = m (2 - C)/dt^2; a force adds F(n) (w(n+1) - w(n-1))/2. 1e-10 of the largest energy.
    """
    line = Line(
        carrier=dataclasses.replace(CARRIER_3_1, damping=0.0),
        contact=dataclasses.replace(CONTACT_3_1, damping=0.0),
        spans=(Span(40.0, (), steady_arm=SteadyArm(4000.0)),),
    )
    config = setting(
        line=line,
        speed=0.0,
        spans=1,
        layer_behind=15.0,
        layer_ahead=15.0,
        start_position=13.1,
        grid_boundary="clamped",
        grid_substeps=2,
        local_compliance=False,
    )
    catenary = Catenary(config)
    s, dt, n = catenary.state, config.step_time, catenary.mesh.stations

    def levels() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        now = s.counter[fd.NOW]
        return tuple(s.w[(now + i) % s.w.shape[0], :, :n].copy() for i in (-1, 0, 1))  # type: ignore[return-value]

    def energy(old: np.ndarray, new: np.ndarray) -> float:
        total = 0.0
        for i, wire in enumerate((line.carrier, line.contact)):
            mass = wire.mass_per_length * catenary.mesh.h
            weights = catenary.stencils[i].weights()[0]
            forward = np.convolve(old[i], weights, mode="same")
            velocity = (new[i] - old[i]) / dt
            total += 0.5 * mass * (velocity @ velocity + new[i] @ (2.0 * old[i] - forward) / dt**2)
        for k in range(s.counter[catenary_sites]):
            row = s.where[2, k]
            if row >= 0:
                e, psi = s.where[0, k], s.psi[:, k]
                wire_index = 1 if catenary.constants.site[row, 2] else 0
                a, b = (field[wire_index, e - 1 : e + 3] @ psi for field in (old, new))
                total += 0.5 * s.here[1, k] * catenary.constants.site[row, 3] * a * b
        return float(total)

    catenary_sites, most, before = 3, 0.0, 0.0
    middle = catenary.mesh.middle
    work_of_steps = 0.0
    last = levels()
    for k in range(1, 500):
        catenary.step(pulse(k * 0.002))
        present = levels()
        # two steps a cycle: the first one's force is the mean of the two cycles'
        half = 0.5 * (pulse((k - 1) * 0.002) + pulse(k * 0.002))
        work_of_steps += half * 0.5 * (present[1][1, middle] - last[1][1, middle])
        work_of_steps += pulse(k * 0.002) * 0.5 * (present[2][1, middle] - present[0][1, middle])
        now = energy(present[1], present[2])
        assert now == pytest.approx(work_of_steps, abs=1e-10 * max(most, 1.0))
        most, last, before = max(most, now), present, now
    assert most > 1.0
    assert before == pytest.approx(most, rel=1e-9)


def push_at(catenary: Catenary, x: float, force: float) -> None:
    """Put a force on the contact wire at x (m, relative to the pantograph) of the next step."""
    at = (x + catenary.mesh.behind) / catenary.mesh.h
    e = int(at)
    catenary.external_load[:] = 0.0
    catenary.external_load[e - 1 : e + 3, 1] = force * grid.weights(np.array(at - e))[0]


def look_at(catenary: Catenary, x: float) -> float:
    """Deviation of the contact wire at x (m, relative to the pantograph)."""
    at = (x + catenary.mesh.behind) / catenary.mesh.h
    e = int(at)
    return float(catenary.deviation[0, e - 1 : e + 3, 1] @ grid.weights(np.array(at - e))[0])


@pytest.mark.parametrize(
    ("line", "tolerance"),
    [
        # the frames differ in where nodes are and in how far droppers fade; the physics is the same
        pytest.param(FREE, 0.002, id="free wires"),
        pytest.param(Line(), 0.005, id="droppers and masts"),
        pytest.param(HEAVY, 0.008, id="masses and arms, uneven spans"),
    ],
)
@pytest.mark.parametrize("speed_kmh", [100.0, 300.0])
@pytest.mark.slow
def test_frame_of_the_train_makes_no_difference(line: Line, tolerance: float, speed_kmh: float) -> None:
    """Galilean invariance: a push at a fixed point of the line, seen from the train and at rest (`difference`)."""

    def make(v: float, start: float) -> Catenary:
        config = setting(line=line, speed=v, start_position=start, spans=4, cycle_time=0.001, grid_substeps=1)
        return Catenary(config)

    assert difference(make, push_at, look_at, speed_kmh / 3.6) < tolerance


@pytest.mark.slow
def test_absorbing_ends_send_back_little(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Free wire at 250 km/h, push below 20 Hz, short domain against a long one: 0.1 % of what clamped ends send back.

    Both wires alike, so the second one finds the first one's design in the cache.
    """
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path))
    records = {}
    for name, changes in (
        ("open", {"spans": 12}),
        ("absorbing", {"grid_boundary": "absorbing"}),
        ("clamped", {"grid_boundary": "clamped"}),
    ):
        base = setting(line=FREE, spans=2, layer_behind=0.0, layer_ahead=0.0, grid_boundary_nodes=10)
        catenary = Catenary(dataclasses.replace(base, grid_boundary_levels=2, **changes))  # type: ignore[arg-type]
        w = np.zeros(1200)
        for k in range(w.size):
            catenary.step(pulse((k + 1) * 0.002))
            w[k] = catenary.w_cat
        records[name] = w
    error = {name: np.sqrt(np.mean((records[name] - records["open"]) ** 2)) for name in ("absorbing", "clamped")}
    assert error["clamped"] > 1e-3
    assert error["absorbing"] < 1e-3 * error["clamped"]
    assert list(tmp_path.rglob("*.json"))
