"""The simulated test rig: what its inner loop, its observers and its identified model are worth.

identification   PT2 with dead time (3.44), fitted to the response to a sum of sines, held against coloured noise
resonances       current at the structure's frequencies with the frequency weighting (3.43) over that without: from the
                 matrices of the whole loop, and measured at the end of a dwell of the simulated rig with all that is
                 not linear. Enters by the reference, or by the contact force (the head is shaken)
chirp            10 mm from 0.5 to 12 Hz, what the current allows, against the identified model, free and in contact;
                 and 1 mm, where friction and cogging weigh more
force step       200 N that no sensor shows; deviation of the slider against its stator
at rest          what friction, cogging and the encoder's steps make of a drive that shall stand still
force observer   lag and gain error of F_tr for a slow force: of the observer alone, and with plate and noise
work             the rig's own account of the work on it against the exact one
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from phil_base.parameters import build
from phil_loop import resolve
from phil_study.outcome import Outcome, Row
from test_rig_sim import linear_loop, step
from test_rig_sim.identify import Pt2, identify, relative_error, ride, simulate_pt2
from test_rig_sim.pantographs.motion import Load
from test_rig_sim.parameters import Parameters
from test_rig_sim.rig import Rig
from validate.rig_findings import Findings

Array = NDArray[np.float64]
Say = Callable[[str], None]

RIGS = ("ideal", "nominal", "harsh")
RESIDUAL = {"ideal": 2.0, "nominal": 5.0, "harsh": 10.0}
"""Largest residual of the identified model, % of the position."""
CHIRP = {"ideal": 1.0, "nominal": 2.0, "harsh": 5.0}
"""Largest error of the chirp against the model, % of the position."""
WORK = {"ideal": 0.1, "nominal": 0.2, "harsh": 0.5}
"""Largest error of the rig's account of work, % of what was exchanged."""
LESS = -20.0
"""Current at a resonance with the weighting over that without, dB."""
STEP_FORCE, STEP_TIME = 200.0, 0.3
"""Force in N that comes at once, and the time in s for which it is watched."""
SETTLED = 0.02e-3
"""Deviation in m below which the force step counts as rejected."""
LAG, SLOW = 20.0, 5.0
"""Largest lag of the observed force in us, and the frequency in Hz at which it is measured."""
DWELL, CARRIER, CARRIER_HZ = 6.0, 0.02, 0.7
"""Length of a dwell in s; amplitude (m) and frequency (Hz) of the slow motion under it: no rig rides at rest."""
INPUTS = {"reference": linear_loop.REFERENCE, "contact force": linear_loop.FORCE}


def parameters(name: str, **changes: object) -> Parameters:
    """Return a rig of the package, changed by names in which two underscores stand for the dot."""
    overrides = {key.replace("__", "."): value for key, value in changes.items()}
    return build(Parameters, resolve(None, {"test_rig_sim": overrides}, name)["test_rig_sim"])


def level(ratio: float) -> float:
    """Return a ratio of amplitudes in dB."""
    return 20.0 * math.log10(ratio)


def wave_of(values: Array, frequency: float, period: float) -> complex:
    """Return the complex amplitude of a frequency (Hz) in the second half of values sampled every period (s)."""
    t = period * np.arange(values.size)
    half = values.size // 2
    window = np.hanning(values.size - half)
    return complex(2.0 * (window * values[half:] * np.exp(-2j * math.pi * frequency * t[half:])).sum() / window.sum())


def dwell(p: Parameters, frequency: float, enters: str) -> float:
    """Return the amplitude of the current in A over that of what enters (m or N) at a frequency in Hz, simulated."""
    period = p.cycle_time / p.inner_steps
    fine = p.model_copy(update={"cycle_time": period, "inner_steps": 1, "run_in": 0.0, "initial_force_share": 1.0})
    contact = enters == "contact force"
    rig = Rig(fine, contact=contact)
    cycles = round(DWELL / period)
    t = period * np.arange(cycles + 1)
    u = CARRIER * (1.0 - np.cos(2.0 * math.pi * CARRIER_HZ * t)) / 2.0
    shaken = np.sin(2.0 * math.pi * frequency * t)
    u = u if contact else u + 0.5e-3 * shaken
    knock = 300.0 * shaken if contact else np.zeros(cycles + 1)
    loads = [Load(p.uplift_force, 0.0, 0.0, force) for force in knock.tolist()]
    noise = np.random.default_rng(p.seed).standard_normal(cycles)
    noise *= p.load_cell.noise if p.imperfections.load_cell_noise else 0.0
    current, entered = np.empty(cycles), np.empty(cycles)
    for k in range(cycles):
        step.advance(rig.plant, rig.memory, noise[k : k + 1], float(u[k]), float(u[k + 1]), loads[k], loads[k + 1])
        current[k] = rig.memory.signals[step.CURRENT]
        entered[k] = rig.memory.signals[step.F_CONTACT] if contact else u[k]
    return abs(wave_of(current, frequency, period) / wave_of(entered, frequency, period))


def resonance_rows(name: str, quick: bool, say: Say) -> list[Row]:
    """Compare the current at the resonances with and without the weighting."""
    with_, without = parameters(name), parameters(name, inner_loop__frequency_weighting=False)
    loops = [linear_loop.linear_loop(p) for p in (with_, without)]
    rows = []
    for frequency in with_.structure.frequencies_hz[: 1 if quick else 2]:
        for enters, column in INPUTS.items():
            say(f"{name}: resonance {frequency:g} Hz, {enters}")
            near = frequency * np.linspace(0.99, 1.01, 21)
            gains = [np.abs(loop.response(near, column, linear_loop.CURRENT)) for loop in loops]
            case = f"{name}, {frequency:g} Hz, from {enters}"
            note = f"worst within 1 %: {level(float((gains[0] / gains[1]).max())):.1f} dB"
            value = level(float(gains[0][10] / gains[1][10]))
            rows.append(Row("current, matrices", case, value, "dB", None, LESS, note))
            measured = dwell(with_, frequency, enters) / dwell(without, frequency, enters)
            rows.append(Row("current, simulated", case, level(measured), "dB", None, LESS))
        shaken = [
            np.abs(loop.response(frequency * np.linspace(0.9, 1.1, 201), linear_loop.FORCE, linear_loop.STATOR)).max()
            for loop in loops
        ]
        case = f"{name}, {frequency:g} Hz, from contact force"
        rows.append(Row("peak of the stator's motion", case, level(float(shaken[0] / shaken[1])), "dB"))
    return rows


def chirp(amplitude: float, duration: float, period: float) -> Array:
    """Return a chirp (n,) of that amplitude (m) from 0.5 to 12 Hz."""
    t = np.arange(round(duration / period)) * period
    sweep = 11.5 / duration
    return np.asarray(amplitude * np.sin(2.0 * math.pi * (0.5 * t + 0.5 * sweep * t**2)))


def chirp_rows(name: str, found: Pt2, duration: float) -> tuple[list[Row], tuple[Array, Array, Array]]:
    """Follow the chirps and compare them with the identified model."""
    p = parameters(name)
    rows, course = [], (np.empty(0), np.empty(0), np.empty(0))
    for amplitude, contact in ((0.01, False), (0.01, True), (0.001, True)):
        u = chirp(amplitude, duration, p.cycle_time)
        model = simulate_pt2(found.natural_frequency_hz, found.damping, p.cycle_time, u, found.delay)
        motion = ride(Rig(p, contact), u)
        error = 100.0 * relative_error(model, motion)
        case = f"{name}, {1e3 * amplitude:g} mm, {'in contact' if contact else 'free'}"
        note = f"velocity {error[1]:.2f} %, largest {1e3 * np.abs(motion[:, 0] - model[:, 0]).max():.3f} mm"
        goal = CHIRP[name] if amplitude > 0.005 else None
        rows.append(Row("chirp against the model, rms", case, float(error[0]), "%", None, goal, note))
        if not contact:
            course = u, motion[:, 0], model[:, 0]
    return rows, course


def step_rows(name: str) -> tuple[list[Row], Array]:
    """Let a force that no sensor shows come at once; give the deviation every inner step."""
    p = parameters(name)
    period = p.cycle_time / p.inner_steps
    rig = Rig(p.model_copy(update={"cycle_time": period, "inner_steps": 1}), contact=False)
    for _ in range(round(0.2 / period)):
        rig.advance(0.0, 0.0)
    drive = rig.plant.drive
    rig.plant = rig.plant._replace(drive=drive._replace(gravity=drive.gravity + STEP_FORCE / drive.mass))
    deviation = np.empty(round(STEP_TIME / period))
    for k in range(deviation.size):
        rig.advance(0.0, 0.0)
        deviation[k] = rig.state.w_tr
    loop = rig.plant.loop
    stiffness = loop.position_gain * loop.force_constant
    above = np.flatnonzero(np.abs(deviation) > SETTLED)
    settled = 1e3 * period * (int(above[-1]) + 1 if above.size else 0)
    stator = 1e3 * abs(rig.state.w_true - rig.state.w_tr)
    note = f"without the observer {1e3 * STEP_FORCE / stiffness:.2f} mm would stay; stator in the end {stator:.3f} mm"
    return [
        Row("force step, largest deviation", name, 1e3 * float(np.abs(deviation).max()), "mm", None, 0.4, note),
        Row("force step, within 0.02 mm after", name, settled, "ms", None, 100.0),
    ], deviation


def rest_row(name: str, duration: float) -> Row:
    """Let the drive stand still in contact, away from the cogging's zero."""
    p = parameters(name)
    rig, place = Rig(p), []
    for k in range(round((3.0 + duration) / p.cycle_time)):
        goal = min(0.004, 0.004 * k * p.cycle_time)
        rig.advance(goal, goal)
        if k * p.cycle_time > 3.0:
            place.append(rig.state.w_true)
    span = 1e6 * (max(place) - min(place))
    return Row(
        "limit cycle at rest, peak to peak", name, span, "um", None, 25.0, f"encoder {rig.plant.encoder_resolution:g} m"
    )


def force_rows(name: str, duration: float) -> list[Row]:
    """Move the drive slowly in contact; compare observed and true force, and both accounts of work."""
    p = parameters(name)
    period, cycles = p.cycle_time, round(duration / p.cycle_time)
    t = period * np.arange(cycles + 1)
    u = 0.002 * np.sin(2.0 * math.pi * SLOW * t) + 0.02 * np.sin(2.0 * math.pi * t)

    quiet = parameters(name, imperfections__load_cell_inertia=False, imperfections__load_cell_noise=False)

    def gain_of(p: Parameters) -> tuple[complex, Array, float, float]:
        rig = Rig(p)
        shown, true, works = np.empty(cycles), np.empty(cycles), np.empty((cycles, 2))
        exchanged = 0.0
        for k in range(cycles):
            rig.advance(float(u[k]), float(u[k + 1]))
            state = rig.state
            shown[k], true[k], works[k] = state.f_tr, state.f_contact, (state.work, state.true_work)
            exchanged += period * abs(state.f_contact * state.v_true)
        ratio = wave_of(shown - shown.mean(), SLOW, period) / wave_of(true - true.mean(), SLOW, period)
        return ratio, shown - true, float(np.abs(works[:, 0] - works[:, 1]).max()), exchanged

    ratio, _, _, _ = gain_of(quiet)
    whole, noise, error, exchanged = gain_of(p)
    lag = -1e6 * float(np.angle(ratio)) / (2.0 * math.pi * SLOW)
    said = f"gain {100.0 * (abs(ratio) - 1.0):+.3f} %"
    plate = f"plate of {p.load_cell.plate_mass * (1.0 - p.load_cell.compensation):.2g} kg left"
    plate = plate if p.imperfections.load_cell_inertia else "no plate"
    plate += f"; all errors: mean {noise.mean():+.2f} N, deviation {noise.std():.2f} N"
    return [
        Row(f"lag of F_tr at {SLOW:g} Hz, observer alone", name, abs(lag), "us", None, LAG, said),
        Row(
            f"error of F_tr at {SLOW:g} Hz, with plate and noise",
            name,
            100.0 * abs(whole - 1.0),
            "%",
            None,
            None,
            plate,
        ),
        Row(
            "work observed against true, largest",
            name,
            100.0 * error / exchanged,
            "%",
            None,
            WORK[name],
            f"of {exchanged:.0f} J exchanged",
        ),
    ]


def speed_row(name: str, cycles: int) -> Row:
    """Measure the time of one cycle of 2 ms."""
    rig = Rig(parameters(name))
    u = (0.01 * np.sin(0.02 * np.arange(cycles + 1))).tolist()
    times = np.empty(cycles)
    for k in range(cycles):
        begun = perf_counter()
        rig.advance(u[k], u[k + 1])
        times[k] = perf_counter() - begun
    note = f"99 % within {1e6 * np.percentile(times, 99):.0f} us"
    return Row("computing one cycle, median", name, 1e6 * float(np.median(times)), "us", None, None, note)


def identification_rows(name: str, found: Pt2) -> list[Row]:
    """Tell the identified model and its residuals."""
    said = f"damping {found.damping:.3f}, delay {1e3 * found.delay:.3f} ms, gain {found.gain:.5f}"
    other = f"velocity {100.0 * found.velocity_residual:.2f} %"
    return [
        Row("natural frequency", name, found.natural_frequency_hz, "Hz", note=said),
        Row("residual, validation, position", name, 100.0 * found.residual, "%", None, RESIDUAL[name], other),
        Row("residual, fit, |G / G_model - 1| rms", name, 100.0 * found.fit_residual, "%"),
    ]


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Measure every rig; a quick run takes shorter motions and one resonance."""
    rows: list[Row] = []
    findings: list[Findings] = []
    for name in RIGS:
        say(f"{name}: identification")
        p = parameters(name)
        found, response, _ = identify(p)
        rows += identification_rows(name, found)
        if p.imperfections.structure:
            rows += resonance_rows(name, quick, say)
        say(f"{name}: motion")
        of_chirp, course = chirp_rows(name, found, 4.0 if quick else 10.0)
        of_step, deviation = step_rows(name)
        rows += [*of_chirp, *of_step, rest_row(name, 0.5 if quick else 3.0), *force_rows(name, 3.0 if quick else 20.0)]
        rows.append(speed_row(name, 500 if quick else 5000))
        loops = tuple(
            linear_loop.linear_loop(parameters(name, inner_loop__frequency_weighting=on)) for on in (False, True)
        )
        findings.append(Findings(name, p, found, response, course, deviation, loops))
    if out is not None:
        from validate.rig_picture import draw

        draw(findings, STEP_FORCE, out / "validate-rig.png")
    notes = [
        f"Resonances: simulated by a dwell of {DWELL:g} s on a slow motion of {1e3 * CARRIER:g} mm; the filters are "
        "narrow, so what is left 1 % beside a resonance is told too.",
        f"Identification: 0.5 to 30 Hz; validation: coloured noise. Force step: {STEP_FORCE:g} N of weight.",
        f"Work: 20 mm at 1 Hz and 2 mm at {SLOW:g} Hz in contact; the true one is the integral of true force times "
        "absolute velocity of the contact point.",
    ]
    return Outcome("Simulated test rig: inner loop, observers, identified model", rows, notes)
