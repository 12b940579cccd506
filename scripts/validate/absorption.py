"""What the ends of the wires send back: wave packets in time against an unbounded wire, all kinds, both directions.

The reflected amplitude of a packet is the rms of what the end adds to the unbounded wire's motion over the rms of the
packet, divided by the same quotient of an end that is clamped where the layer begins (clamped, short waves do not
come back with the amplitude they went out with, and the integration damps on the way). Frequencies are those that the
train sees. The same from the exact waves of the mesh, without packets, serves as a check and for the finer meshes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary import BOUNDARIES, Feedback, Layer, impose
from catenary_model.boundary.packets import far, passing, rms
from catenary_model.boundary.reflection import reflection
from catenary_model.boundary.springs import Spring, fade, frozen
from catenary_model.boundary.stability import Stepper, growth_per_period, spectral_radius
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line
from catenary_model.model import Config
from catenary_model.moving_frame import CARRIER, CONTACT, Mesh, MovingFrame, assemble
from phil_study.outcome import Outcome, Row
from validate.absorption_curves import ENDS, Curve, Curves, Passing, Snapshot

Array = NDArray[np.float64]
Say = Callable[[str], None]

SPEEDS = (0, 250, 320)
"""km/h."""
WIRES = {CARRIER: "carrier", CONTACT: "contact"}
NODES = 20
"""Nodes of a layer."""
DEFAULT = Config()
Numerics = tuple[float, Layer]
"""dx (m), and step with Newmark's parameters."""
MESH: Numerics = (
    DEFAULT.element_length,
    Layer(NODES, DEFAULT.step_time, DEFAULT.newmark_beta, DEFAULT.newmark_gamma),
)
"""Of the packets and of the goals: those of the real-time model."""
MESHES: tuple[Numerics, ...] = (
    MESH,
    (1.0, Layer(NODES, 0.002)),
    (1.0, Layer(NODES, 0.001)),
    (0.75, Layer(NODES, 0.002)),
    (0.5, Layer(NODES, 0.002)),
    (0.5, Layer(NODES, 0.001)),
)
"""Meshes and steps that are looked at."""
BANDS = (np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0]), np.arange(4.0, 16.0), np.r_[16.0:31.0, 32.0:61.0:2.0])
"""Frequencies of the packets, Hz; the long waves apart because they take long."""
RMS, WORST, TIMES, ABOVE = 0.5, 1.0, 4.0, 20.0
"""Goals: %, %, times better than the matched dashpot, %."""
BETWEEN = 60.0
"""Domain between the layers for the coupled wires, m."""
POSITIONS = (0.0, 3.0, 7.0, 13.7, 30.0, 46.0)
"""Track positions of the pantograph with droppers frozen, m."""
FADING = DEFAULT.fading_length
"""Distance from either end over which droppers and masts fade, m."""
KMH = 250
"""Speed of the frame that a dropper moves through."""
DROPPER, AT = 2e4, 42.0
"""Stiffness of a dropper that hangs on something rigid, N/m; where it is at first, m."""
INSIDE, FAR = 60.0, 260.0
"""Half lengths of the domain without its layers, and of the one without boundaries, m."""
SNAPSHOTS = (0.12, 0.3, 0.5, 0.8, 1.1, 1.5)
"""s."""

HELD = "clamped"
BARE = "matched_dashpot"
"""Kinds without a layer: they stand where the layers of the others begin."""


def named(mesh: Numerics) -> str:
    """Return mesh and step in words."""
    return f"dx {mesh[0]:g} m, {1e3 * mesh[1].ts:g} ms, Newmark {mesh[1].beta:g}/{mesh[1].gamma:g}"


def nodes_of(kind: str) -> int:
    """Return the layer's nodes of a kind; clamped and dashpot stand where it would begin."""
    return 0 if kind in (HELD, BARE) else NODES


def frame(speed: float, mesh: Numerics, half_length: float) -> MovingFrame:
    """Return both wires of Table 3.1 with free ends."""
    return assemble(Mesh(mesh[0], round(half_length / mesh[0])), CARRIER_3_1, CONTACT_3_1, speed)


def in_time(kmh: int, wire: int, end: int, bands: tuple[Array, ...]) -> dict[str, Curve]:
    """Send packets against every kind."""
    speed = kmh / 3.6
    returned: dict[str, list[Array]] = {kind: [] for kind in BOUNDARIES}
    for band in bands:
        away = far((CARRIER_3_1, CONTACT_3_1)[wire], speed, band)
        layer = MESH[1]
        unbounded = frame(speed, MESH, away + 20.0)
        impose(BARE, unbounded, layer)
        without = passing(unbounded, None, wire, end, layer, band, unbounded.mesh.half_elements)
        for kind in BOUNDARIES:
            here = replace(layer, nodes=nodes_of(kind))
            bounded = frame(speed, MESH, 0.5 * away + 40.0)
            feedback = impose(kind, bounded, here)
            with_end = passing(bounded, feedback, wire, end, here, band, here.nodes)
            returned[kind].append(rms(with_end - without))
    frequency = np.concatenate(bands)
    whole = np.concatenate(returned[HELD])
    return {kind: Curve(frequency, np.concatenate(parts) / whole) for kind, parts in returned.items()}


def by_waves(kmh: int, wire: int, end: int, mesh: Numerics, frequency: Array) -> dict[str, Curve]:
    """Return the same from the exact waves of mesh and step, per kind."""
    raw = {}
    for kind in BOUNDARIES:
        layer = replace(mesh[1], nodes=nodes_of(kind))
        ended = frame(kmh / 3.6, mesh, (NODES + 5) * mesh[0])
        feedback = impose(kind, ended, layer)
        raw[kind] = np.abs(reflection(ended, feedback, wire, end, layer, frequency))
    return {kind: Curve(frequency, R / raw[HELD]) for kind, R in raw.items()}


def rows_of(case: str, curves: dict[str, Curve]) -> list[Row]:
    """Return the rows of one speed, wire and end."""
    ours, plain = curves["controlled"], curves[BARE]
    rows = [
        Row("controlled, rms to 30 Hz", case, ours.rms, "%", high=RMS),
        Row("controlled, worst to 30 Hz", case, ours.worst, "%", high=WORST),
        Row("controlled, rms better than dashpot", case, plain.rms / ours.rms, "times", low=TIMES),
        Row("controlled, worst 31 to 60 Hz", case, ours.above, "%", high=ABOVE),
    ]
    for kind in BOUNDARIES:
        if kind not in ("controlled", HELD):
            note = f"worst {curves[kind].worst:.2g} %, 31 to 60 Hz {curves[kind].above:.2g} %"
            rows.append(Row(f"{kind}, rms to 30 Hz", case, curves[kind].rms, "%", note=note))
    return rows


def coupled(kmh: int, mesh: Numerics) -> tuple[MovingFrame, Feedback | None, Layer]:
    """Return a short domain with controlled layers at both ends of both wires."""
    layer = mesh[1]
    domain = frame(kmh / 3.6, mesh, 0.5 * BETWEEN + NODES * mesh[0])
    return domain, impose("controlled", domain, layer), layer


def stability_rows(quick: bool, say: Say) -> list[Row]:
    """Spectral radius with droppers frozen, growth while a span passes."""
    rows = []
    speeds = SPEEDS[1:2] if quick else SPEEDS
    for kmh, mesh in itertools.product(speeds, MESHES[:1] if quick else (MESH, MESHES[1])):
        case = f"{named(mesh)}, {kmh} km/h"
        domain, feedback, layer = coupled(kmh, mesh)
        radii = []
        for zeta in POSITIONS[:2] if quick or mesh != MESH else POSITIONS:
            say(f"spectral radius, {case}, droppers as at {zeta:g} m")
            springs = frozen(Line(), domain.mesh, zeta, FADING)
            radii.append(spectral_radius(domain, feedback, layer, springs))
        note = f"{len(radii)} positions, 2 ends, 2 wires"
        rows.append(Row("spectral radius, droppers frozen", case, max(radii), "", high=1.0 - 1e-9, note=note))
        if kmh > 0 and mesh == MESH:
            periods = 1 if quick else 6

            def passed(period: int, case: str = case, periods: int = periods) -> None:
                say(f"growth, {case}: span {period} of {periods}")

            growth = growth_per_period(domain, feedback, layer, Line(), FADING, periods, passed)
            rows.append(Row("growth while a span passes", case, growth, "times", high=1.0 - 1e-9))
    return rows


def mesh_rows(quick: bool, say: Say) -> list[Row]:
    """Return what meshes and steps cost, worst of both wires and ends, from the waves of the mesh."""
    rows = []
    frequency = np.arange(0.5, 60.1, 2.5 if quick else 0.5)
    for mesh, kmh in itertools.product(MESHES[:1] if quick else MESHES, SPEEDS):
        say(f"waves of the mesh, {named(mesh)}, {kmh} km/h")
        found = [by_waves(kmh, wire, end, mesh, frequency) for wire, end in itertools.product(WIRES, ENDS)]
        case = f"{named(mesh)}, {kmh} km/h"
        for kind in ("controlled", "controlled_continuous", BARE):
            worst, above = max(c[kind].worst for c in found), max(c[kind].above for c in found)
            note = f"worst {worst:.2g} %, 31 to 60 Hz {above:.2g} %"
            rows.append(Row(f"{kind}, waves, rms", case, max(c[kind].rms for c in found), "%", note=note))
    return rows


def passing_dropper() -> Passing:
    """Push a contact wire at x = 0 while a dropper moves through, with layers and without ends."""
    speed, layer = KMH / 3.6, MESH[1]
    short, long = frame(speed, MESH, INSIDE + NODES * MESH[0]), frame(speed, MESH, FAR)
    feedback = impose("controlled", short, layer)
    impose(BARE, long, replace(layer, nodes=0))
    runs = [Stepper(short, feedback, layer), Stepper(long, None, layer)]
    shots: list[Snapshot] = []
    for step in range(1, round(SNAPSHOTS[-1] / layer.ts) + 1):
        time = step * layer.ts
        dropper = AT - speed * time
        stiffness = DROPPER * fade(short.mesh, dropper, FADING)
        springs = [Spring(dropper, stiffness, 0.0, 1.0)] if stiffness > 0.0 else []
        push = 300.0 * np.sin(np.pi * time / 0.1) ** 2 if time < 0.1 else 0.0
        for one in runs:
            force = np.zeros((4 * one.frame.mesh.stations, 1))
            force[4 * one.frame.mesh.middle + 2] = push
            one.step(springs, force)
        if len(shots) < len(SNAPSHOTS) and time >= SNAPSHOTS[len(shots)] - 1e-9:
            layered, unbounded = (one.x[0, 2 * CONTACT :: 4, 0].copy() for one in runs)
            shots.append(Snapshot(time, dropper if springs else None, layered, unbounded))
    x = short.mesh.x
    fading = np.array([fade(short.mesh, at, FADING) for at in x])
    return Passing(KMH, x, long.mesh.x, fading, INSIDE, shots)


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Measure all, draw reflection and a passing dropper."""
    bands = (np.array([4.0, 10.0, 20.0, 30.0, 45.0]),) if quick else BANDS
    curves: Curves = {}
    rows: list[Row] = []
    for kmh, wire, end in itertools.product(SPEEDS, WIRES, ENDS):
        case = f"{WIRES[wire]}, {ENDS[end]}, {kmh} km/h"
        say(f"packets: {case}")
        curves[kmh, wire, end] = in_time(kmh, wire, end, bands)
        rows += rows_of(case, curves[kmh, wire, end])
    rows += stability_rows(quick, say)
    rows += mesh_rows(quick, say)
    if out is not None:
        from validate import absorption_picture

        say("pictures")
        absorption_picture.reflections(curves, WORST, out / "absorption.png")
        absorption_picture.passing_dropper(passing_dropper(), out / "absorption_dropper.png")
    notes = [
        f"packets: {named(MESH)}, layers of {NODES} nodes; the matched dashpot stands where they begin; percent of "
        "what a clamped end there returns",
        "no wave up to 60 Hz is beyond the mesh; where a wave that runs ahead and one that runs back have the same "
        "pattern on the nodes (43 Hz at 320 km/h and dx 1 m) the mesh mixes them in a narrow band",
    ]
    return Outcome("Absorbing boundaries: reflected amplitude", rows, notes)
