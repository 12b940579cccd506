"""Waves of a line at rest that repeats itself: Bloch waves, and those among them that a moving load leaves behind.

All droppers taut, without damping. Over one period L of the line (from mast to mast) a wave of the whole structure is
u(zeta) exp(i mu zeta/L) with u as periodic as the line, so that nodes at the end of a period move as those at its
beginning times exp(i mu): K(mu) phi = omega^2 M(mu) phi gives the bands omega(mu).

A load that runs with v and repeats itself from span to span is stationary for a wave whose phase at the load comes
round with the passing of spans: f + v mu/(2 pi L) = N v/L. So it feeds waves of the track frequencies

    f = v/L (N - mu/(2 pi))

where these lines meet the bands. Between bands there is none: what excites the line there stays where it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array, diags_array

from catenary_model import statics
from catenary_model.line import Line
from catenary_model.reference.equilibrium import incidence, wire_matrices
from catenary_model.reference.mesh import mesh_spans
from catenary_model.reference.sites import repeated
from catenary_model.statics import DROPPER, MAST

Array = NDArray[np.float64]

PHASES = 241
"""Values of mu from -pi to pi, an odd number."""


def bands(line: Line, element: float, count: int) -> tuple[Array, Array]:
    """Return mu, (phases,), and the lowest frequencies (Hz), (phases, count); element length in m."""
    solved = statics.solve(line)
    mesh = mesh_spans(line, 0, len(line.spans), element)
    sites = repeated(solved, mesh)
    M, _, K = wire_matrices(line, mesh)
    on_carrier = np.isin(sites.kind, (DROPPER, MAST)).astype(np.float64)
    on_contact = np.where(sites.kind == DROPPER, -1.0, np.where(sites.kind == MAST, 0.0, 1.0))
    g = csr_array(incidence(mesh, sites.position, on_carrier, on_contact))
    # the mast at the end is the next period's
    own = sites.position < mesh.end - 0.5 * mesh.h
    stiff = np.asarray((K + g.T @ diags_array(sites.stiffness * own) @ g).todense())
    mass = np.asarray(M.todense())
    free = stiff.shape[0] - 4
    mu = np.linspace(-np.pi, np.pi, PHASES)
    found = []
    for phase in mu[PHASES // 2 :]:
        tied = (_tied(matrix, free, np.exp(1j * phase)) for matrix in (stiff, mass))
        squares = eigh(*tied, eigvals_only=True, subset_by_index=[0, count - 1])
        found.append(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi))
    # a wave and the same one backwards have one frequency
    return mu, np.array([*found[:0:-1], *found])


def _tied(matrix: Array, free: int, turn: complex) -> NDArray[np.complex128]:
    """Fold the last nodes, which move as the first ones times `turn`, into these: T^H A T."""
    out = matrix[:free, :free].astype(np.complex128)
    last = matrix.shape[0] - free
    out[:last] += np.conj(turn) * matrix[free:, :free]
    out[:, :last] += turn * matrix[:free, free:]
    out[:last, :last] += matrix[free:, free:]
    return out


def left_behind(line: Line, speed: float, element: float = 0.5, count: int = 20) -> Array:
    """Return the track frequencies (Hz, rising) of the waves that a load at `speed` (m/s) feeds; the lowest bands."""
    mu, frequency = bands(line, element, count)
    passing = speed / line.period
    found = []
    for band in frequency.T:
        N = band / passing + mu / (2.0 * np.pi)
        for j in range(mu.size - 1):
            low, high = sorted((N[j], N[j + 1]))
            for whole in range(int(np.ceil(low)), int(np.floor(high)) + 1):
                share = (whole - N[j]) / (N[j + 1] - N[j]) if high > low else 0.0
                found.append(band[j] + share * (band[j + 1] - band[j]))
    return np.array(sorted(found))
