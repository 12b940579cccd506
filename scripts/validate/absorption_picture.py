"""Pictures of the absorbing boundaries: reflection over frequency, and a wire with a dropper that moves through it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary import impose
from catenary_model.boundary.springs import Spring, fade
from catenary_model.boundary.stability import Stepper
from catenary_model.moving_frame import CONTACT
from validate import absorption

matplotlib.use("Agg")
from matplotlib import pyplot

KMH = 250
"""Speed of the frame with the dropper."""
DROPPER, AT = 2e4, 42.0
"""Stiffness of a dropper that hangs on something rigid, N/m; where it is at first, m."""
INSIDE, FAR = 60.0, 260.0
"""Half lengths of the domain without its layers, and of the one without boundaries, m."""
TIMES = (0.12, 0.3, 0.5, 0.8, 1.1, 1.5)
"""Snapshots, s."""


def reflections(curves: absorption.Curves, path: Path) -> None:
    """Draw reflected amplitude over frequency, a row a speed, a column an end; carrier dashed."""
    figure, axes = pyplot.subplots(3, 2, figsize=(11, 10), sharex=True, sharey=True, layout="constrained")
    for (kmh, wire, end), of in curves.items():
        axis = axes[absorption.SPEEDS.index(kmh), end]
        for number, (kind, curve) in enumerate(of.items()):
            label = kind.replace("_", " ") if wire == CONTACT else None
            style = "-" if wire == CONTACT else "--"
            axis.semilogy(curve.frequency, 100.0 * curve.share, style, color=f"C{number}", lw=1.2, label=label)
        axis.set_title(f"{absorption.ENDS[end]}, {kmh} km/h")
        axis.axvline(absorption.LOW, color="0.5", lw=0.8)
        axis.axhline(absorption.WORST, xmax=0.5, color="0.5", lw=0.8, ls=":")
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("frequency seen from the train in Hz")
    for axis in axes[:, 0]:
        axis.set_ylabel("reflected amplitude in %")
    axes[0, 0].set_ylim(1e-3, 200.0)
    axes[0, 0].legend(fontsize=8, title="contact wire (dashed: carrier)", title_fontsize=8)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def passing_dropper(path: Path) -> None:
    """Draw a contact wire that is pushed at x = 0 while a dropper moves through, with layers and without ends."""
    mesh = absorption.MESH
    speed = KMH / 3.6
    layer = mesh[1]
    short = absorption.frame(speed, mesh, INSIDE + absorption.NODES * mesh[0])
    feedback = impose("controlled", short, layer)
    long = absorption.frame(speed, mesh, FAR)
    impose("matched_dashpot", long, replace(layer, nodes=0))
    runs = [Stepper(short, feedback, layer), Stepper(long, None, layer)]
    figure, axes = pyplot.subplots(len(TIMES) + 1, 1, figsize=(9, 11), sharex=True, layout="constrained")
    x = short.mesh.x
    axes[0].plot(x, [fade(short.mesh, at, absorption.FADING) for at in x], "C0-.", label="fading of droppers and masts")
    axes[0].set(ylabel="fade", title=f"Contact wire at {KMH} km/h: unbounded (dashed), with controlled layers (solid)")
    axes[0].legend(fontsize=8)
    picture = 1
    for step in range(1, round(TIMES[-1] / layer.ts) + 1):
        time = step * layer.ts
        dropper = AT - speed * time
        stiffness = DROPPER * fade(short.mesh, dropper, absorption.FADING)
        springs = [Spring(dropper, stiffness, 0.0, 1.0)] if stiffness > 0.0 else []
        push = 300.0 * np.sin(np.pi * time / 0.1) ** 2 if time < 0.1 else 0.0
        for run in runs:
            force = np.zeros((4 * run.frame.mesh.stations, 1))
            force[4 * run.frame.mesh.middle + 2] = push
            run.step(springs, force)
        if picture <= len(TIMES) and time >= TIMES[picture - 1] - 1e-9:
            axis = axes[picture]
            axis.plot(short.mesh.x, 1e3 * _contact(runs[0]), color="0.5", lw=2.0)
            axis.plot(long.mesh.x, 1e3 * _contact(runs[1]), "k--", lw=1.0)
            if springs:
                axis.axvline(dropper, color="C0", lw=1.0)
            axis.set_ylabel("w in mm")
            axis.text(0.01, 0.85, f"{time:.2f} s", transform=axis.transAxes)
            picture += 1
    for axis in axes:
        for edge in (-1.0, 1.0):
            axis.axvspan(edge * INSIDE, edge * short.mesh.half_length, color="C1", alpha=0.15, lw=0)
        axis.grid(alpha=0.3)
    axes[-1].set(xlabel="x in m, pantograph at 0, layers shaded", xlim=(-120.0, 120.0))
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def _contact(run: Stepper) -> NDArray[np.float64]:
    return run.x[0, 2 * CONTACT :: 4, 0]
