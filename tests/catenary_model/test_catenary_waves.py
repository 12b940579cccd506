"""Waves: speed, absorption at the ends, and independence of the frame that they are looked at from."""

import numpy as np
import pytest

from catenary_model import elements
from catenary_model.line import CONTACT_3_1, Line
from catenary_model.model import Catenary, Config

FREE = Line(dropper_positions=())
TS = 0.002


def pulse(t: float, length: float = 0.1) -> float:
    """A smooth push of `length` s; its spectrum ends at about 2 / length."""
    return 100.0 * np.sin(np.pi * t / length) ** 2 if 0.0 < t < length else 0.0


@pytest.mark.parametrize(("speed", "side"), [(0.0, 1), (0.0, -1), (250 / 3.6, 1), (250 / 3.6, -1)])
def test_waves_run_with_c_minus_v_ahead_and_c_plus_v_behind(speed: float, side: int) -> None:
    """Time between two stations 30 m apart at half the rise; 1 %: bending and mesh disperse little at 20 Hz."""
    catenary = Catenary(Config(line=FREE, speed=speed, spans=4))
    stations = [catenary.mesh.middle + side * 20, catenary.mesh.middle + side * 50]
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
def test_matched_dashpot_absorbs(speed_kmh: float) -> None:
    """Free contact wire, push below 20 Hz, 2 spans against 12: less than 3 % of what clamped ends send back.

    3 s: at 320 km/h what comes back from either end needs 2.1 s to the pantograph.
    """
    cycles = 1500
    records = {}
    for name, boundary, spans in (
        ("open", "matched_dashpot", 12),
        ("dashpot", "matched_dashpot", 2),
        ("clamped", "clamped", 2),
    ):
        catenary = Catenary(Config(line=FREE, speed=speed_kmh / 3.6, spans=spans, boundary=boundary))
        w = np.zeros(cycles)
        for k in range(cycles):
            catenary.step(pulse((k + 1) * TS))
            w[k] = catenary.w_cat
        records[name] = w
    error = {name: np.sqrt(np.mean((records[name] - records["open"]) ** 2)) for name in ("dashpot", "clamped")}
    assert error["clamped"] > 1e-3
    assert error["dashpot"] < 0.03 * error["clamped"]


def push_at(catenary: Catenary, x: float, force: float) -> None:
    """Put a force on the contact wire at x (m, relative to the pantograph) of the next step."""
    mesh = catenary.mesh
    at = (x + mesh.half_length) / mesh.h
    e = int(at)
    psi = np.zeros(4)
    elements.shape_functions(at - e, mesh.h, psi)
    catenary.external_load[:] = 0.0
    for j, station in ((0, e), (2, e + 1)):
        catenary.external_load[4 * station + 2 : 4 * station + 4] = force * psi[j : j + 2]


def look_at(catenary: Catenary, x: float) -> float:
    """Deviation of the contact wire at x (m, relative to the pantograph)."""
    mesh = catenary.mesh
    at = (x + mesh.half_length) / mesh.h
    e = int(at)
    psi = np.zeros(4)
    elements.shape_functions(at - e, mesh.h, psi)
    contact = catenary.deviation[0, :, 1]
    return float(psi[:2] @ contact[e] + psi[2:] @ contact[e + 1])


@pytest.mark.parametrize(
    ("line", "tolerance"),
    [
        # the frames differ in mesh and in how far droppers fade; the physics is the same
        pytest.param(FREE, 0.005, id="free wires"),
        pytest.param(Line(), 0.02, id="droppers and masts"),
    ],
)
def test_frame_of_the_train_makes_no_difference(line: Line, tolerance: float) -> None:
    """A push at a fixed point of the line, seen at 250 km/h and at rest; rms of the difference over rms of the motion.

    Observed where it is pushed and 12.3 m on, for 0.5 s, before anything comes back from the ends.
    """
    pushed, seen = 97.3, (97.3, 109.6)
    records = []
    for speed, start in ((0.0, 90.0), (250 / 3.6, 75.0)):
        catenary = Catenary(Config(line=line, speed=speed, start_position=start, spans=6, cycle_time=0.001))
        w = []
        for k in range(1, 501):
            zeta = start + speed * 0.001 * k
            push_at(catenary, pushed - zeta, pulse(k * 0.001, 0.15))
            catenary.step(0.0)
            w.append([look_at(catenary, at - zeta) for at in seen])
        records.append(np.array(w))
    still, moving = records
    rms = np.sqrt(np.mean((moving - still) ** 2, axis=0)) / np.sqrt(np.mean(still**2, axis=0))
    assert rms.max() < tolerance


def test_two_spans_agree_with_many_on_the_same_mesh() -> None:
    """Truncation of the domain with droppers: a ride's mean and standard deviation of w_cat, 4 spans against 12."""
    records = []
    for spans in (4, 12):
        catenary = Catenary(Config(spans=spans))
        w = np.zeros(2500)
        for k in range(2500):
            t = k * TS
            catenary.step(min(1.0, t) * (120.0 + 25.0 * np.sin(2 * np.pi * 1.157 * t)))
            w[k] = catenary.w_cat
        records.append(w[1000:])
    short, long = records
    difference = np.sqrt(np.mean((short - long) ** 2))
    assert difference < 0.15 * long.std()
