"""Picture of a static push along a line: elasticity by all models, and what they differ by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phil_study.drawing import save, subplots

Array = NDArray[np.float64]

MARKERS = "o+x^v"


@dataclass(frozen=True)
class Pushes:
    """One line, pushed; elasticities in mm/N, (points, forces)."""

    name: str
    zeta: Array
    """Track positions that were pushed, m, (points,)."""
    supports: Array
    """Track positions of the masts, m."""
    forces: tuple[float, ...]
    """N."""
    fine: Array
    """Further track positions, m, (places,)."""
    between: Array
    """Elasticity there by the model that the others are held against, (places, forces)."""
    elasticity: Mapping[str, Array]
    """By model."""
    truth: str
    """The model that the others are held against."""


def draw(shown: Pushes, path: Path) -> None:
    """Draw the elasticity along the line for every force, and below it the difference of the models in %."""
    figure, (upper, lower) = subplots(2, 1, figsize=(10, 7), sharex=True, layout="constrained")
    others = [name for name in shown.elasticity if name != shown.truth]
    for j, force in enumerate(shown.forces):
        upper.plot(shown.fine, shown.between[:, j], color=f"C{j}", lw=1.2, label=f"{force:g} N, {shown.truth}")
        for marker, name in zip(MARKERS, others, strict=False):
            e = shown.elasticity[name][:, j]
            of = f"{force:g} N, {name}"
            upper.plot(shown.zeta, e, marker, color=f"C{j}", ms=5, mfc="none", label=of)
            off = 100.0 * (e / shown.elasticity[shown.truth][:, j] - 1.0)
            lower.plot(shown.zeta, off, marker, color=f"C{j}", ms=5, mfc="none", label=of)
    for axis in (upper, lower):
        for mast in shown.supports:
            axis.axvline(mast, color="k", lw=0.8, alpha=0.5)
        axis.grid(alpha=0.3)
    lower.axhline(0.0, color="k", lw=0.8)
    upper.set(ylabel="elasticity in mm/N", title=f"{shown.name}: static push (upright lines: supports)")
    upper.legend(fontsize=7, ncols=len(shown.forces))
    lower.set(xlabel="track position in m", ylabel=f"difference from {shown.truth} in %")
    save(figure, path)
