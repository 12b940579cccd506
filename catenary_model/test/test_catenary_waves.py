"""Waves: speed, absorption at the ends, and independence of the frame that they are looked at from."""

import numpy as np
import pytest
from dense_step import place
from moving_frames import FREE, HEAVY, difference, pulse

from catenary_model.line import CONTACT_3_1, Line
from catenary_model.model import Catenary, Config

TS = 0.002


@pytest.mark.parametrize(("speed", "side"), [(0.0, 1), (0.0, -1), (250 / 3.6, 1), (250 / 3.6, -1)])
def test_waves_run_with_c_minus_v_ahead_and_c_plus_v_behind(speed: float, side: int) -> None:
    """Time between two stations 30 m apart at half the rise; 1 %: bending and mesh disperse little at 20 Hz."""
    catenary = Catenary(Config(line=FREE, speed=speed, spans=4))
    stations = [catenary.mesh.middle + side * 20, catenary.mesh.middle + side * 60]
    history = []
    for k in range(1, 900):
        catenary.step(pulse(k * TS))
        history.append(catenary.deviation[0, stations, 1, 0])
    w = np.array(history)
    arrival = []
    for column in w.T:
        level = 0.5 * column.max()
        i = int(np.argmax(column > level))
        arrival.append((i - 1 + (level - column[i - 1]) / (column[i] - column[i - 1])) * TS)
    measured = 30.0 / (arrival[1] - arrival[0])
    assert measured == pytest.approx(CONTACT_3_1.wave_speed - side * speed, rel=0.01)


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0, 320.0])
@pytest.mark.slow
def test_matched_dashpot_absorbs(speed_kmh: float) -> None:
    """Free contact wire, push below 20 Hz, 2 spans against 12: less than 0.5 % of what clamped ends send back.

    3 s: at 320 km/h what comes back from either end needs 2.1 s to the pantograph.
    """
    cycles = 1500
    records = {}
    for name, boundary, spans in (
        ("open", "matched_dashpot", 12),
        ("dashpot", "matched_dashpot", 2),
        ("clamped", "clamped", 2),
    ):
        config = Config(
            line=FREE, speed=speed_kmh / 3.6, spans=spans, layer_behind=0.0, layer_ahead=0.0, boundary=boundary
        )
        catenary = Catenary(config)
        w = np.zeros(cycles)
        for k in range(cycles):
            catenary.step(pulse((k + 1) * TS))
            w[k] = catenary.w_cat
        records[name] = w
    error = {name: np.sqrt(np.mean((records[name] - records["open"]) ** 2)) for name in ("dashpot", "clamped")}
    assert error["clamped"] > 1e-3
    assert error["dashpot"] < 0.005 * error["clamped"]


def push_at(catenary: Catenary, x: float, force: float) -> None:
    """Put a force on the contact wire at x (m, relative to the pantograph) of the next step."""
    e, psi = place(catenary, x)
    catenary.external_load[:] = 0.0
    catenary.external_load[e : e + 2, 1] = force * psi.reshape(2, 2)


def look_at(catenary: Catenary, x: float) -> float:
    """Deviation of the contact wire at x (m, relative to the pantograph)."""
    e, psi = place(catenary, x)
    return float((catenary.deviation[0, e : e + 2, 1] * psi.reshape(2, 2)).sum())


@pytest.mark.parametrize(
    ("line", "tolerance"),
    [
        # the frames differ in mesh and in how far droppers fade; the physics is the same
        pytest.param(FREE, 0.003, id="free wires"),
        pytest.param(Line(), 0.006, id="droppers and masts"),
        pytest.param(HEAVY, 0.01, id="masses and arms, uneven spans"),
    ],
)
@pytest.mark.parametrize("speed_kmh", [100.0, 250.0])
@pytest.mark.slow
def test_frame_of_the_train_makes_no_difference(line: Line, tolerance: float, speed_kmh: float) -> None:
    """Galilean invariance: a push at a fixed point of the line, seen from the train and at rest (`difference`)."""

    def make(v: float, start: float) -> Catenary:
        return Catenary(Config(line=line, speed=v, start_position=start, spans=4, cycle_time=0.001))

    assert difference(make, push_at, look_at, speed_kmh / 3.6) < tolerance


def test_two_spans_agree_with_many_on_the_same_mesh() -> None:
    """Truncation of the domain with droppers: the motion under a given force, 2 spans and layers against 12 spans.

    Rms of the difference over the standard deviation, measured 0.3 %.
    """
    records = []
    for spans in (2, 12):
        catenary = Catenary(Config(spans=spans))
        w = np.zeros(2500)
        for k in range(2500):
            t = k * TS
            catenary.step(min(1.0, t) * (120.0 + 25.0 * np.sin(2 * np.pi * 1.157 * t)))
            w[k] = catenary.w_cat
        records.append(w[1000:])
    short, long = records
    difference = np.sqrt(np.mean((short - long) ** 2))
    assert difference < 0.01 * long.std()
