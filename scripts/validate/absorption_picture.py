"""Pictures of the absorbing boundaries: reflection over frequency, and a wire with a dropper that moves through it."""

from __future__ import annotations

from pathlib import Path

from catenary_model.moving_frame import CONTACT
from phil_study.drawing import save, subplots
from validate.absorption_curves import ENDS, LOW, Curves, Passing


def reflections(curves: Curves, goal: float, path: Path) -> None:
    """Draw reflected amplitude over frequency, a row a speed, a column an end; ``goal`` in % up to LOW."""
    speeds = list(dict.fromkeys(kmh for kmh, _, _ in curves))
    figure, axes = subplots(3, 2, figsize=(11, 10), sharex=True, sharey=True, layout="constrained")
    for (kmh, wire, end), of in curves.items():
        axis = axes[speeds.index(kmh), end]
        for number, (kind, curve) in enumerate(of.items()):
            label = kind.replace("_", " ") if wire == CONTACT else None
            style = "-" if wire == CONTACT else "--"
            axis.semilogy(curve.frequency, 100.0 * curve.share, style, color=f"C{number}", lw=1.2, label=label)
        axis.set_title(f"{ENDS[end]}, {kmh} km/h")
        axis.axvline(LOW, color="0.5", lw=0.8)
        axis.axhline(goal, xmax=0.5, color="0.5", lw=0.8, ls=":")
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("frequency seen from the train in Hz")
    for axis in axes[:, 0]:
        axis.set_ylabel("reflected amplitude in %")
    axes[0, 0].set_ylim(1e-3, 200.0)
    axes[0, 0].legend(fontsize=8, title="contact wire (dashed: carrier)", title_fontsize=8)
    save(figure, path)


def passing_dropper(passing: Passing, path: Path) -> None:
    """Draw a contact wire that is pushed at x = 0 while a dropper moves through, with layers and without ends."""
    count = len(passing.snapshots)
    figure, axes = subplots(count + 1, 1, figsize=(9, 11), sharex=True, layout="constrained")
    x = passing.x
    axes[0].plot(x, passing.fading, "C0-.", label="fading of droppers and masts")
    title = f"Contact wire at {passing.kmh} km/h: unbounded (dashed), with controlled layers (solid)"
    axes[0].set(ylabel="fade", title=title)
    axes[0].legend(fontsize=8)
    for axis, shot in zip(axes[1:], passing.snapshots, strict=True):
        axis.plot(x, 1e3 * shot.layered, color="0.5", lw=2.0)
        axis.plot(passing.far, 1e3 * shot.unbounded, "k--", lw=1.0)
        if shot.dropper is not None:
            axis.axvline(shot.dropper, color="C0", lw=1.0)
        axis.set_ylabel("w in mm")
        axis.text(0.01, 0.85, f"{shot.time:.2f} s", transform=axis.transAxes)
    for axis in axes:
        for edge in (-1.0, 1.0):
            axis.axvspan(edge * passing.inside, edge * x[-1], color="C1", alpha=0.15, lw=0)
        axis.grid(alpha=0.3)
    axes[-1].set(xlabel="x in m, pantograph at 0, layers shaded", xlim=(-120.0, 120.0))
    save(figure, path)
