"""The catenary-fixed reference itself: statics, orders of convergence, wall time.

statics       equilibrium of the mesh against the closed form, dx 0.25 m
free wire     a smooth wave on the contact wire against the exact solution: orders of the scheme alone
ride          the standard's pantograph at 250 km/h over droppers and masts, against a much finer run. Here the
              contact point and the clamps are point loads, which bend the wire over sqrt(EI/T) = 9 cm: the orders of
              the free wire only show once that is resolved
wall time     Table 3.1's resolution (28 spans, 0.25 m, 0.2 ms) on one core, beside the banded solve that it replaces
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

from catenary_model.line import CONTACT_3_1, Line, Span, Wire
from catenary_model.reference import Config, Reference, equilibrium
from catenary_model.statics import DROPPER
from phil_study.drawing import save, subplots
from phil_study.outcome import Outcome, Row
from validate.en50318 import Setting, pantograph, zero_phase

Array = NDArray[np.float64]
Say = Callable[[str], None]

V = 250.0 / 3.6
PULSE, HEIGHT, TIME = 3.0, 0.01, 0.3
"""Width (m, one sigma) and height (m) of the smooth wave, time it runs (s)."""
RUN_IN, COMPARED, RIDE = 1.0, 4.3, 4.6
"""Compared from s to s, length of the ride (s)."""
GRID = 0.01
"""Step of the common time grid, s."""


def spectral(wire: Wire, length: float, nodes: int, middle: float, t: float) -> tuple[Array, Array, Array, Array]:
    """Exact damped motion of a wire released as a Gaussian: w, w_x at time t, w_tt and w_xtt at t = 0; periodic."""
    x = length / nodes * np.arange(nodes)
    k = 2.0 * np.pi * np.fft.rfftfreq(nodes, length / nodes)
    shape = np.fft.rfft(HEIGHT * np.exp(-0.5 * ((x - middle) / PULSE) ** 2))
    square = (wire.tension * k**2 + wire.bending_stiffness * k**4) / wire.mass_per_length
    half = 0.5 * wire.damping / wire.mass_per_length
    omega = np.sqrt(square - half**2 + 0j)
    swing = np.exp(-half * t) * (np.cos(omega * t) + half / omega * np.sin(omega * t)).real
    parts = (swing, 1j * k * swing, -square, -1j * k * square)
    w, slope, a, bend = (np.fft.irfft(part * shape, nodes) for part in parts)
    return w, slope, a, bend


def free_wave_error(h: float, ts: float) -> float:
    """Error of the released contact wire after `TIME`, rms at the nodes over rms."""
    span, spans = 60.0, 4
    bare = Line(spans=(Span(span, ()),))
    middle, length = 0.5 * span * spans, span * spans
    reference = Reference(
        Config(line=bare, speed=0.0, spans=spans, element_length=h, time_step=ts, start_position=middle)
    )
    w, slope, a, bend = spectral(CONTACT_3_1, length, reference.mesh.elements, middle, 0.0)
    reference.state.q[0, 2:, :-1] = w, slope
    reference.state.q[2, 2:, :-1] = a, bend
    reference.push(np.zeros(round(TIME / ts)), fresh=False)
    exact = spectral(CONTACT_3_1, length, reference.mesh.elements, middle, TIME)[0]
    return float(np.sqrt(((reference.state.q[0, 2, :-1] - exact) ** 2).mean() / (exact**2).mean()))


def ride_of(h: float, ts: float) -> tuple[Array, Array]:
    """Contact force below 20 Hz (N) and displacement of the contact point (m) on the common time grid."""
    line = Setting().line()
    reference = Reference(
        Config(line=line, speed=V, spans=8, first_span=-1, start_position=30.0, element_length=h, time_step=ts)
    )
    record = reference.ride(pantograph(), RIDE)
    grid = np.arange(RUN_IN, COMPARED, GRID)
    return np.interp(grid, record.t, zero_phase(record.F, ts)), np.interp(grid, record.t, record.w)


def _orders(sizes: Array, errors: Array) -> Array:
    return np.append(np.nan, np.log(errors[:-1] / errors[1:]) / np.log(sizes[:-1] / sizes[1:]))


def statics_rows() -> list[Row]:
    """Compare the mesh's equilibrium with the closed form: lengths given, and forces given (as rides start)."""
    reference = Reference(Config(line=Setting().line(), spans=8))
    mesh, sites, rest = reference.mesh, reference.sites, reference.statics
    drop = sites.kind == DROPPER
    exact = rest.contact(mesh.zeta)
    solved = equilibrium.solve(rest, mesh, sites)
    force = np.abs(solved.force - sites.force)[drop].max()
    case = "at rest, dx 0.25 m, lengths of the closed form"
    note = "largest difference from the closed form"
    return [
        Row("dropper force", case, float(force), "N", None, 0.5, note),
        Row("contact wire", case, 1e3 * float(np.abs(solved.nodal[2] - exact).max()), "mm", None, 0.2, note),
        Row(
            "contact wire",
            "at rest, dx 0.25 m, forces of the closed form",
            1e3 * float(np.abs(reference.static[0] - exact).max()),
            "mm",
            None,
            0.05,
            note,
        ),
    ]


def free_wave_rows(quick: bool) -> list[Row]:
    """Orders on a smooth wave; goals are those of the elements (at least 4) and of Newmark's method (2)."""
    made = []
    for name, sizes, error, least, unit in (
        ("dx", (2.0, 1.5, 1.0), lambda size: free_wave_error(size, 4e-5 if quick else 1e-5), 4.0, "m"),
        ("dt", (2e-3, 1e-3, 5e-4), lambda size: free_wave_error(0.5, size), 1.9, "s"),
    ):
        errors = np.array([error(size) for size in sizes])
        for size, value, order in zip(sizes, errors, _orders(np.array(sizes), errors), strict=True):
            case = f"free wire, {name} {size:g} {unit}"
            made.append(Row("error", case, 100.0 * float(value), "%", note="rms over rms, smooth wave"))
            if np.isfinite(order):
                made.append(Row(f"order in {name}", case, float(order), "", least))
    return made


def ride_rows(quick: bool, say: Say) -> list[Row]:
    """Errors and orders of force and displacement of a ride, in dx and in dt."""
    made = []
    for name, unit, all_sizes, best, both in (
        ("dx", "m", (2.0, 1.0, 0.5, 0.25, 0.125), 0.0625, lambda size: (size, 2e-4)),
        ("dt", "s", (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4), 2.5e-5, lambda size: (0.25, size)),
    ):
        sizes, finest = (all_sizes[:2], all_sizes[3]) if quick else (all_sizes, best)
        say(f"ride, {name} {finest:g} {unit}")
        F, w = ride_of(*both(finest))
        errors = []
        for size in sizes:
            say(f"ride, {name} {size:g} {unit}")
            F_now, w_now = ride_of(*both(size))
            errors.append((np.sqrt(((F_now - F) ** 2).mean()) / F.std(), np.sqrt(((w_now - w) ** 2).mean())))
        table = np.array(errors)
        orders = [_orders(np.array(sizes), column) for column in table.T]
        for i, size in enumerate(sizes):
            case = f"ride, {name} {size:g} {unit}"
            against = f"against {finest:g} {unit}"
            for column, (what, scale, shown) in enumerate((("force", 100.0, "%"), ("displacement", 1e3, "mm"))):
                order = orders[column][i]
                note = against + (f", order {order:.2f}" if np.isfinite(order) else "")
                made.append(Row(f"error of {what}", case, scale * float(table[i, column]), shown, note=note))
    return made


def speed_rows(quick: bool, say: Say) -> list[Row]:
    """Wall time per simulated second, in pieces of 0.1 s, beside the banded solve of the same system."""
    say("wall time")
    reference = Reference(Config(line=Setting().line(), speed=V))
    reference.ride(pantograph(), 0.2)  # compiles
    stamps = [time.perf_counter()]
    reference.ride(pantograph(), 2.0 if quick else 20.0, progress=lambda _: stamps.append(time.perf_counter()))
    wall = np.diff(stamps) / 0.1
    case = f"28 spans, 0.25 m, 0.2 ms ({4 * reference.mesh.nodes} degrees of freedom)"
    n = 4 * reference.mesh.nodes
    band = np.zeros((8, n))
    band[0], band[1:] = 4.0, 0.1
    factors = (cholesky_banded(band, lower=True), True)
    right = np.ones(n)
    taken = []
    for _ in range(50 if quick else 500):
        begin = time.perf_counter()
        cho_solve_banded(factors, right, check_finite=False)
        taken.append(time.perf_counter() - begin)
    solve = float(np.median(taken)) / reference.config.time_step
    return [
        Row("wall time per simulated second, median", case, float(np.median(wall)), "s", None, 3.0, "pieces of 0.1 s"),
        Row("wall time per simulated second, p99", case, float(np.percentile(wall, 99)), "s", None, 3.0),
        Row("wall time per simulated second, maximum", case, float(wall.max()), "s"),
        Row("for comparison", case, solve, "s", note="one solve a step alone, both wires in one band matrix, LAPACK"),
    ]


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Measure all of it."""
    made = statics_rows()
    say("free wire")
    made += free_wave_rows(quick)
    riding = ride_rows(quick, say)
    made += riding
    made += speed_rows(quick, say)
    if out is not None:
        _draw(riding, out / "validate-reference.png")
    notes = [
        f"Ride: {RUN_IN:g} to {COMPARED:g} s, force below 20 Hz without phase, rms over the finest run's standard "
        "deviation; displacement of the contact point, rms."
    ]
    return Outcome("Catenary-fixed reference", made, notes)


def _draw(rows: list[Row], path: Path) -> None:
    figure, axes = subplots(1, 2, figsize=(9, 4), layout="constrained")
    for axis, name in zip(axes, ("dx", "dt"), strict=True):
        for what in ("force", "displacement"):
            chosen = [row for row in rows if row.case.startswith(f"ride, {name}") and row.name.endswith(what)]
            sizes = np.array([float(row.case.split()[2]) for row in chosen])
            values = np.array([row.value for row in chosen])
            axis.loglog(sizes, values, "o-", label=f"{what} in {chosen[0].unit}")
        axis.loglog(sizes, values[0] * (sizes / sizes[0]) ** 2, "k:", lw=0.8, label="order 2")
        axis.set(xlabel=f"{name} in {'m' if name == 'dx' else 's'}", ylabel="error")
        axis.set_xticks(sizes, [f"{size:g}" for size in sizes])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.suptitle("Ride at 250 km/h against a much finer run")
    save(figure, path)
