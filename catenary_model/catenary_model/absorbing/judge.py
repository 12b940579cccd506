"""Figures of merit of a boundary: what comes back in the band, and the most that comes back at any frequency."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.dispersion import Waves, growth, waves
from catenary_model.absorbing.least_squares import mode_weights
from catenary_model.absorbing.objective import outgoing
from catenary_model.absorbing.reflection import amplitudes, echo_matrix
from catenary_model.absorbing.stencil import Array, Stencil
from catenary_model.absorbing.weighting import Weighting


class Judge(NamedTuple):
    """Waves at all frequencies and in the band, with their weights."""

    modes: Waves
    weights: Array
    inside: Waves
    inside_weights: Array

    def echo(self, boundary: BoundaryStencil) -> Array:
        """Return what comes back in the band and what stays near the boundary, weighted, shape (m, nodes)."""
        seen = echo_matrix(self.inside) @ amplitudes(boundary, self.inside)[..., None]
        return np.abs(seen[..., 0]) * mode_weights(boundary.nodes)

    def figures(self, boundary: BoundaryStencil) -> tuple[float, float]:
        """Return `reflection` and `gain` of a `Candidate`; infinite where they cannot be computed."""
        with np.errstate(all="ignore"):
            try:
                banded = self.echo(boundary).max(axis=1) * self.inside_weights
                everywhere = np.abs(amplitudes(boundary, self.modes)[:, 0])
            except np.linalg.LinAlgError:
                return np.inf, np.inf
            decay = np.abs(self.modes.reflected[:, 0] / self.modes.incident[:, 0]) ** boundary.n_x
            values = float(banded.max()), float((everywhere * decay).max())
        return values if np.all(np.isfinite(values)) else (np.inf, np.inf)


def judge(stencil: Stencil, weighting: Weighting, side: str) -> Judge:
    """Prepare the waves at all frequencies of a weighting.

    Raises:
        ValueError: the interior scheme is unstable or has more than one space dimension.
    """
    if stencil.dims != 1:
        raise ValueError(f"{stencil.name} has {stencil.dims} space dimensions; this design is for one")
    factor = growth(stencil)
    # At the limit of stability (Courant number 1) a double root is off by the square root of rounding.
    if factor > 1.0 + 1e-7:
        raise ValueError(f"the interior scheme itself grows by a factor {factor:.6f} a step: choose a smaller dt")
    f, inside = np.union1d(weighting.grid(stencil.dt), grid_frequencies(stencil, side)), weighting.inside()
    return Judge(
        waves(stencil, np.exp(2j * np.pi * f * stencil.dt), side),
        weighting(f),
        waves(stencil, np.exp(2j * np.pi * inside * stencil.dt), side),
        weighting(inside),
    )


def grid_frequencies(stencil: Stencil, side: str, points: int = 80) -> Array:
    """Frequencies of waves evenly spaced over spatial frequency, Hz: dense where the grid's waves end.

    Close below its cut-off every boundary reflects nearly all, and often a little more than that.
    """
    omega_x = np.linspace(0.1, 0.999, points) * np.pi / stencil.dx[0]
    f = np.abs(np.angle(outgoing(stencil, omega_x, side))) / (2.0 * np.pi * stencil.dt)
    return f[(f > 1e-6 / stencil.dt) & (f < 0.499 / stencil.dt)]
