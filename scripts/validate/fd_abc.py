"""Absorbing boundaries by optimisation: the results of the thesis's Publication A again (3.1.5.3).

(a) A beam of 100 m under tension, the contact wire of Table 3.1: an initial deflection of 0.5 m leaves through the left
end and is reflected by the clamped right one; reflected amplitude from the dispersion relation of the scheme and from
runs in time, eigenvalues, a million steps. First without damping, as nothing but the boundary takes energy out there,
then with that of Table 3.1. (b) The 2-D wave equation: reflected amplitude over the angle of incidence beside Engquist
and Majda's boundaries of first and second order, one boundary tuned for normal incidence and one for 60 degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.table import Table

from catenary_model import absorbing
from catenary_model.absorbing import assembly, incidence, plane_waves, square
from catenary_model.absorbing.higdon import diagonal, higdon
from catenary_model.line import CONTACT_3_1
from phil_study.outcome import Outcome, Row
from validate import fd_abc_beam as beams

Say = Callable[[str], None]

REFLECTED = 0.5
"""Goal of (a), % of the incident amplitude, and of the initial deflection."""
STABLE = 1.0 - beams.MARGIN
"""Goal of spectral radii."""
ANGLES = range(0, 61, 5)
"""Angles of incidence with a row, degrees."""
SHOWN = (*range(0, 86, 5),)
"""Angles in the table, degrees."""
DOUBLINGS = 20
"""2^20 steps of the square."""
AGREES = 0.1
"""Goal: runs in time and analysis differ by at most this, % of the incident amplitude."""
DAMPED, LOSSLESS = "beam, damping of Table 3.1", "beam without damping"
BOX = "EM 2 box"
"""Second-order condition of Engquist and Majda for normal incidence as the square of a box scheme (Higdon)."""
DIAGONAL, MUR = "EM 2", "EM 2 centred"
NORMAL, SIXTY = "tuned for 0", "tuned for 60"
CASES = {NORMAL: "2-D, tuned for normal incidence", SIXTY: "2-D, tuned for 60 degrees"}


def beam_rows(case: beams.Case) -> list[Row]:
    """Return the rows with goals of one beam."""
    back, design = case.reflected, case.design
    c = design.boundary
    size = f"{c.n_x} nodes, {c.n_t} old level{'s' if c.n_t > 1 else ''}"
    expected = np.abs(absorbing.reflection(case.stencil, c, back.f_packets))
    last = float(case.long_run[-1] / case.long_run[1])
    held = absorbing.J_OE(case.stencil, absorbing.clamped(case.stencil, "left"), beams.WEIGHTING)

    def worst(f: np.ndarray, amplitude: np.ndarray) -> tuple[float, str]:
        return 100.0 * float(amplitude.max()), f"worst at {f[np.argmax(amplitude)]:.2g} Hz"

    waves, note = worst(back.f, back.waves)
    pulse, pulse_note = worst(back.f_pulse, back.pulse)
    packets, packets_note = worst(back.f_packets, back.packets)
    band = f"{beams.LOW:g} to {beams.HIGH:g} Hz"
    most = f"from {back.f_pulse[0]:g} Hz" if back.f_pulse[0] > beams.LOW else band
    sizes = " ".join(str(n) for n in beams.SMALL)
    return [
        Row(f"reflected, {band}, waves", case.name, waves, "%", high=REFLECTED, note=f"{note}; {size}"),
        Row("reflected, pulse in time", case.name, pulse, "%", high=REFLECTED, note=f"{pulse_note}; {most}"),
        Row("reflected, packets in time", case.name, packets, "%", high=REFLECTED, note=packets_note),
        Row(
            "packets in time against waves",
            case.name,
            100.0 * float(np.abs(back.packets - expected).max()),
            "%",
            high=AGREES,
            note="largest difference; a packet is not one frequency",
        ),
        Row(
            "snapshots against the long beam",
            case.name,
            100.0 * case.snapshots.difference / beams.DEFLECTION,
            "%",
            high=REFLECTED,
            note="of the initial deflection, largest at any time up to T8 and anywhere",
        ),
        Row(
            "spectral radius - 1, small domain",
            case.name,
            case.radii.small - 1.0,
            "",
            high=STABLE - 1.0,
            note=f"{sizes} nodes, opposite end clamped or alike",
        ),
        Row("spectral radius - 1, 100 m", case.name, case.radii.whole - 1.0, "", high=STABLE - 1.0, note="as above"),
        Row(
            "mean output error J_OE (3.29)",
            case.name,
            absorbing.J_OE(case.stencil, c, beams.WEIGHTING),
            "",
            note=f"clamped: {held:.3g}",
        ),
        Row(
            "last part of the long run",
            case.name,
            last,
            "times",
            high=1.0,
            note=f"largest displacement over that of the second of {beams.BLOCKS} parts, {case.steps} steps from noise",
        ),
    ]


def other_ends(case: beams.Case) -> list[Row]:
    """Return what ends that nobody optimised do to the same beam."""
    stencil = case.stencil
    rows = []
    f = np.geomspace(beams.LOW, beams.HIGH, 200)
    ends = {"w_t = c w_x, as for a string": beams.one_way(stencil), "clamped": absorbing.clamped(stencil, "left")}
    for name, end in ends.items():
        share = 100.0 * float(np.abs(absorbing.reflection(stencil, end, f)).max())
        apart = 100.0 * beams.snapshots(stencil, end).difference / beams.DEFLECTION
        rows.append(Row(f"reflected, {name}", case.name, share, "%", note=f"snapshots {apart:.3g} %"))
    return rows


def amplitudes(result: incidence.Incidence) -> dict[str, np.ndarray]:
    """Return the largest reflected amplitude over the band (%) by boundary, the box scheme included."""
    box = 100.0 * plane_waves.worst(result.stencil, higdon(result.stencil, (0.0, 0.0)), result.degrees, result.band)
    found: dict[str, np.ndarray] = {}
    for name, values in result.worst.items():
        if name == NORMAL:
            found[BOX] = box
        found[name] = values
    return found


def angle_rows(result: incidence.Incidence) -> list[Row]:
    """Return a row for every angle, and what the tuning gains."""
    most = amplitudes(result)
    inside = result.degrees <= 60.0
    case = CASES[NORMAL]
    rows = []
    for angle in ANGLES:
        at = {name: float(np.interp(angle, result.degrees, values)) for name, values in most.items()}
        note = (
            f"EM 2 {at[DIAGONAL]:.2g}, centred {at[MUR]:.2g}, box {at[BOX]:.2g}; EM 1 {at['EM 1']:.2g}; "
            f"tuned for 60: {at[SIXTY]:.2g}"
        )
        high = min(at[DIAGONAL], at[MUR])
        rows.append(Row(f"reflected at {angle} degrees", case, at[NORMAL], "%", high=high, note=note))
    for name, label, limit in ((DIAGONAL, ", diagonal", 1.0), (MUR, ", centred", 1.0), (BOX, ", box scheme", None)):
        ratio = (most[NORMAL] / most[name])[inside]
        above = result.degrees[inside][ratio > 1.0]
        note = "below it everywhere" if above.size == 0 else f"above it at {above[0]:g} to {above[-1]:g} degrees"
        what = f"largest share of Engquist-Majda 2{label}"
        rows.append(Row(what, case, float(ratio.max()), "times", high=limit, note=note))
    end = {name: float(np.interp(60.0, result.degrees, values)) for name, values in most.items()}
    case = CASES[SIXTY]
    rows.append(Row("reflected at 60 degrees", case, end[SIXTY], "%", high=end[NORMAL], note="goal: tuned for 0"))
    ratio = most[SIXTY] / most[DIAGONAL]
    above = result.degrees[inside][ratio[inside] > 1.0]
    note = "below it everywhere" if above.size == 0 else f"above it at {above[0]:g} to {above[-1]:g} degrees"
    rows.append(Row("largest share of Engquist-Majda 2", case, float(ratio[inside].max()), "times", note=note))
    return rows


def square_rows(result: incidence.Incidence, say: Say) -> list[Row]:
    """Return stability and runs in time of the two tuned boundaries."""
    rows = []
    theirs = result.figures[DIAGONAL]
    for name, design in result.designs.items():
        case = CASES[name]
        found = result.figures[name]
        corner = diagonal(result.stencil, damping=design.damping)
        say(f"square, {2**DOUBLINGS} steps: {name}")
        step = square.update(result.stencil, design.boundary, 10, corner, design.near_corner)
        growth = assembly.growth_after(step, DOUBLINGS)
        high = 100.0 * theirs.point_source if name == NORMAL else None
        rows += [
            Row(
                "spectral radius - 1, strips",
                case,
                found.strip_radius - 1.0,
                "",
                high=STABLE - 1.0,
                note="all wave numbers along the boundary",
            ),
            Row(
                "spectral radius - 1, squares",
                case,
                found.square_radius - 1.0,
                "",
                high=STABLE - 1.0,
                note=f"10 and 13 nodes, four sides and corners; strip of Engquist-Majda 2: {theirs.strip_radius:.6f}",
            ),
            Row("any state of the square after 2^20 steps", case, growth, "times", high=1.0, note="largest, norm"),
            Row(
                "amplification on the way",
                case,
                found.amplification,
                "times",
                note=f"any state of a strip; Engquist-Majda 2: {theirs.amplification:.3g}, growing on",
            ),
            Row(
                "packets in time against waves",
                case,
                100.0 * found.packet,
                "%",
                high=AGREES,
                note="20, 45 and 60 degrees",
            ),
            Row(
                "bump in a square against a large domain",
                case,
                100.0 * found.point_source,
                "%",
                high=high,
                note=f"of its norm; Engquist-Majda 2: {100.0 * theirs.point_source:.2g} %, "
                f"1: {100.0 * result.figures['EM 1'].point_source:.2g} %",
            ),
        ]
    return rows


def sheet(result: incidence.Incidence) -> Table:
    """Make the table of all boundaries over the angle."""
    most = amplitudes(result)
    made = Table(title="2-D: largest reflected amplitude over the band, %", title_justify="left")
    made.add_column("degrees", justify="right")
    for name in most:
        made.add_column(name, justify="right")
    for angle in SHOWN:
        cells = (f"{np.interp(angle, result.degrees, values):.3g}" for values in most.values())
        made.add_row(f"{angle}", *cells)
    return made


def details(result: incidence.Incidence, cases: tuple[beams.Case, ...], fronts: beams.Fronts) -> list[Row]:
    """Return curves and fronts for the file."""
    rows = []
    for case in cases:
        back = case.reflected
        for kind, f, share in (
            ("waves", back.f[::10], back.waves[::10]),
            ("pulse", back.f_pulse, back.pulse),
            ("packet", back.f_packets, back.packets),
        ):
            rows += [
                Row(f"{kind}, {a:.4g} Hz", case.name, 100.0 * float(b), "%") for a, b in zip(f, share, strict=True)
            ]
    for kind, designs in (("size", fronts.designs), ("stability", fronts.margins)):
        for d in designs:
            note = f"radius - 1: {d.radius - 1.0:.3g}, gain {d.gain:.3g}"
            what = f"front over {kind}, {d.boundary.n_x} nodes, {d.boundary.n_t} old levels"
            rows.append(Row(what, LOSSLESS, 100.0 * d.reflection, "%", note=note))
    for name, values in amplitudes(result).items():
        rows += [Row(f"{a} degrees", name, float(np.interp(a, result.degrees, values)), "%") for a in SHOWN]
    for title, kinds in (("stability", result.stability_fronts), ("size", result.size_fronts)):
        for name, points in kinds.items():
            for point in points:
                note = f"radius - 1: {point.radius - 1.0:.3g}, amplification {point.amplification:.3g}"
                what = f"front over {title}, {point.size} coefficients"
                rows.append(Row(what, name, 100.0 * point.objective, "%", note=note))
    return rows


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Design, measure, draw."""
    stencil, lossless = beams.beam(CONTACT_3_1.damping), beams.beam(0.0)
    fronts = beams.fronts(lossless, quick, say)
    cases = [beams.measured(LOSSLESS, lossless, fronts.chosen, quick, say)]
    if not quick:
        say(f"{DAMPED}: design")
        sizes = fronts.chosen.boundary.n_x, fronts.chosen.boundary.n_t
        cases.append(beams.measured(DAMPED, stencil, beams.designed(stencil, *sizes), quick, say))
    result = incidence.incidence(step_degrees=5.0 if quick else 1.0, fronts=not quick, progress=say)
    rows = [row for case in cases for row in (*beam_rows(case), *other_ends(case))]
    rows += [
        *sorted((*angle_rows(result), *square_rows(result, say)), key=lambda row: list(CASES.values()).index(row.case)),
    ]
    if out is not None:
        from validate import fd_abc_picture

        say("pictures")
        fd_abc_picture.draw(fronts, tuple(cases), result, amplitudes(result)[BOX], out)
    notes = [
        f"(a) contact wire of Table 3.1 at rest, {beams.LENGTH:g} m, dx {beams.DX:g} m, {1e3 * beams.DT:g} ms; "
        "reflected over incident amplitude. Chosen: the smallest stencil that reflects at most "
        f"{100.0 * beams.ENOUGH:g} % in the band, of those that are stable in all closed domains.",
        f"(b) waves of {result.band.shortest:g} to {result.band.longest:g} grid spacings, the worst of them; Courant "
        "number 0.5. Second order: EM 2 is the diagonal form that we know as that of the paper of 1977 (not at hand), "
        "EM 2 centred G. Mur's of 1981; EM 2 box the same condition as the square of a box scheme (R. L. Higdon "
        "1986, both angles 0). The goal is the lower one of the first two.",
    ]
    return Outcome(
        "Absorbing boundaries by optimisation",
        rows,
        notes,
        details(result, tuple(cases), fronts),
        (sheet(result),),
        grouped=True,
    )
