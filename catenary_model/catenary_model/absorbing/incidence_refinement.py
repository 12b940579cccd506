"""Refinement of a stable boundary over all of its coefficients, stability as a linear constraint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from catenary_model.absorbing import assembly, square
from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.incidence_design import Progress, Samples, Tuning, samples
from catenary_model.absorbing.periodic_strip import stability
from catenary_model.absorbing.plane_waves import reflected_roots
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

SHARE = 0.3
"""Least real part of D / D_start on the unit circle, see `refine`."""


def constrained_least_squares(A: Array, b: Array, G: Array, h: Array) -> Array | None:
    """Minimise |A x - b| subject to G x >= h, by non-negative least squares on the dual.

    C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, chapter 23 (LSI by way of LDP).

    Args:
        A: shape (m, n) with full column rank.
        b: shape (m,).
        G: shape (k, n).
        h: shape (k,).

    Returns:
        x, shape (n,), or None if the constraints contradict each other.
    """
    Q, R = np.linalg.qr(A)
    free = Q.T @ b
    rows = np.linalg.solve(R.T, G.T)
    dual = np.vstack([rows, (h - free @ rows)[None]])
    dual = dual / np.maximum(np.linalg.norm(dual, axis=0), 1e-300)
    target = np.zeros(len(dual))
    target[-1] = 1.0
    try:
        u, distance = nnls(dual, target, maxiter=50 * len(dual))
    except RuntimeError:
        return None
    if distance < 1e-10:
        return None
    residual = dual @ u - target
    return np.asarray(np.linalg.solve(R, free - residual[:-1] / residual[-1]))


class _Space(NamedTuple):
    """Unknowns of a boundary that is symmetric along itself: (level, node, tangential distance)."""

    shape: tuple[int, int, int]
    unknowns: list[tuple[int, int, int]]

    def fill(self, x: Array) -> BoundaryStencil:
        """Boundary with the unknowns x."""
        half = self.shape[2] // 2
        c = np.zeros((1, *self.shape))
        for value, (level, k, m) in zip(x, self.unknowns, strict=True):
            c[0, level, k, half + m] = c[0, level, k, half - m] = value
        return BoundaryStencil(c)

    def take(self, boundary: BoundaryStencil) -> Array:
        """Unknowns of a boundary that is not larger than this space."""
        c = boundary.coefficients[0]
        c = c[..., None] if c.ndim == 2 else c
        if any(a > b for a, b in zip(c.shape, self.shape, strict=True)):
            raise ValueError(f"a boundary of shape {c.shape} does not fit into {self.shape}")
        half = c.shape[2] // 2
        return np.array(
            [
                c[level, k, half + m] if level < c.shape[0] and k < c.shape[1] and m <= half else 0.0
                for level, k, m in self.unknowns
            ]
        )

    def rows(self, z: ComplexArray, xi: ComplexArray, eta: ComplexArray) -> ComplexArray:
        """Sum of the right-hand side of the update on a wave, by unknown: shape (m, unknowns); 1 - rows . x is D."""
        columns = [z**-level * xi**k * (1.0 if m == 0 else eta**m + eta**-m) for level, k, m in self.unknowns]
        return np.stack(columns, axis=-1)


def _space(shape: tuple[int, int, int]) -> _Space:
    levels, n_x, n_y = shape
    return _Space(
        shape, [(q, k, m) for q in range(levels) for k in range(n_x) for m in range(n_y // 2 + 1) if q > 0 or k > 0]
    )


class _Stability(NamedTuple):
    """Linear constraints G x >= h that keep D away from zero on and outside the unit circle."""

    G: Array
    h: Array


def _constraints(stencil: Stencil, space: _Space, start: Array, phases: int = 4) -> _Stability:
    """Positive real part of D / D_start, and of (D - e^{i phi} N) / D_start where waves propagate."""
    frequency = np.concatenate([np.geomspace(1e-4, 0.1, 14), np.linspace(0.12, np.pi, 50)])
    k_y = np.concatenate([[0.0], np.geomspace(1e-4, 0.1, 10), np.linspace(0.15, np.pi, 20)])
    z, eta = (a.ravel() for a in np.meshgrid(np.exp(1j * frequency), np.exp(1j * k_y), indexing="ij"))
    xi = reflected_roots(stencil, z, eta)[:, 0]
    inwards = space.rows(z, xi, eta)
    reference = (1.0 - inwards @ start)[:, None]
    G, h = [-(inwards / reference).real], [SHARE - (1.0 / reference[:, 0]).real]
    waves = np.abs(np.abs(xi) - 1.0) < 1e-6
    outwards = space.rows(z[waves], 1.0 / xi[waves], eta[waves])
    for phi in 2.0 * np.pi * np.arange(phases) / phases:
        turned = np.exp(1j * phi)
        G.append(((turned * outwards - inwards[waves]) / reference[waves]).real)
        # The start has |N| <= |D|, with equality at grazing: a hair of room keeps it feasible in rounding.
        h.append(-((1.0 - turned) / reference[waves, 0]).real - 1e-9)
    return _Stability(np.vstack(G), np.concatenate(h))


class Refined(NamedTuple):
    """A refined boundary."""

    boundary: BoundaryStencil
    objective: float
    """Weighted rms of the reflected amplitude."""
    radius: float
    """Largest spectral radius of the closed domains that judged it."""
    history: tuple[float, ...]
    """Objective of the start and of every iterate."""


def objective(boundary: BoundaryStencil, waves: Samples) -> float:
    """Weighted rms of the reflected amplitude over the samples of a tuning."""
    c = boundary.coefficients.shape
    space = _space((c[1], c[2], c[3] if len(c) == 4 else 1))
    x = space.take(boundary)
    return float(np.linalg.norm(waves.weight * _reflection(space, x, waves)))


def _reflection(space: _Space, x: Array, waves: Samples) -> ComplexArray:
    outwards = 1.0 - space.rows(waves.z, waves.incident, waves.eta) @ x
    return np.asarray(-outwards / (1.0 - space.rows(waves.z, waves.reflected, waves.eta) @ x), complex)


def closed_radius(
    stencil: Stencil,
    boundary: BoundaryStencil,
    near_corner: BoundaryStencil | None = None,
    corner: Array | None = None,
    limit: float = np.inf,
) -> float:
    """Largest spectral radius of two strips over all tangential wave numbers and, given a corner rule, of a square.

    Strips do not see the corners: a boundary can be stable on every strip and unstable in a square.

    Args:
        stencil: of the interior.
        boundary: at all sides.
        near_corner: see `square.update`.
        corner: see `square.update`; None leaves the square out.
        limit: above it the rest is not computed any more.
    """
    least, largest = boundary.n_x + 2, 0.0
    for nodes, numbers in ((least, 5), (least, 25), (least + 5, 25)):
        largest = max(largest, stability(stencil, boundary, nodes=nodes, samples=numbers).radius)
        if largest > limit:
            return largest
    if corner is not None:
        largest = max(largest, assembly.radius(square.update(stencil, boundary, least + 5, corner, near_corner)))
    return largest


def refine(
    stencil: Stencil,
    start: BoundaryStencil,
    shape: tuple[int, int, int],
    tuning: Tuning,
    corner: Array | None = None,
    radius_limit: float = 0.9999,
    iterations: int = 12,
    progress: Progress | None = None,
) -> Refined:
    """Improve a stable boundary over all coefficients of a shape, tangential neighbours included.

    Let D(z, k_y) be the residual of the boundary's update on the wave that goes inwards (linear in the coefficients).
    The half space has no growing mode if D has no zero for |z| > 1. Since D / D_start is analytic there and tends to 1,
    a positive real part on the circle |z| = 1, for all k_y, is enough: a linear constraint, here with the share
    `SHARE`, so that disturbances at the boundary are not amplified much more than by the start either. Where waves
    propagate, the same of D - e^{i phi} N, with N the residual on the outgoing wave, bounds the reflection by 1, for
    the sake of the opposite side. Gauss-Newton steps on the reflection under these constraints, Levenberg's damping,
    and the spectral radius of closed domains as the judge of every step.

    Args:
        stencil: of the interior, symmetric along y and reaching one node.
        start: a stable boundary with |reflection| <= 1, for example from `design_product`.
        shape: (1 + N_t, N_x, N_y) of the result, not smaller than the start.
        tuning: what is wanted.
        corner: rule at the corners of a square, see `square.update`, where the start stands beside the corners; with
            it a square is among the closed domains, without it only strips are.
        radius_limit: largest spectral radius that a step may end at; that of the start if it is larger.
        iterations: at most.
        progress: receives a line an iteration.
    """
    space, waves = _space(shape), samples(stencil, tuning)
    x = space.take(start)
    constraints = _constraints(stencil, space, x)
    incident = space.rows(waves.z, waves.incident, waves.eta)
    reflected = space.rows(waves.z, waves.reflected, waves.eta)
    value, radius = objective(start, waves), closed_radius(stencil, space.fill(x), start, corner)
    limit, levenberg, history = max(radius, radius_limit), 1e-2, [value]
    for iteration in range(iterations):
        R = _reflection(space, x, waves)
        slope = (incident + R[:, None] * reflected) / (1.0 - reflected @ x)[:, None] * waves.weight[:, None]
        A = np.vstack([slope.real, slope.imag])
        b = -np.concatenate([(R * waves.weight).real, (R * waves.weight).imag])
        h = constraints.h - constraints.G @ x
        accepted = False
        for _ in range(6):
            ridge = levenberg * value * np.eye(len(x))
            step = constrained_least_squares(
                np.vstack([A, ridge]), np.concatenate([b, np.zeros(len(x))]), constraints.G, h
            )
            for share in (1.0, 0.4, 0.15):
                if step is None:
                    break
                trial = x + share * step
                reached = float(np.linalg.norm(waves.weight * _reflection(space, trial, waves)))
                if reached < value * (1.0 - 1e-3):
                    trial_radius = closed_radius(stencil, space.fill(trial), start, corner, limit)
                    if trial_radius <= limit:
                        accepted = True
                        break
            if accepted:
                break
            levenberg *= 6.0
        if not accepted:
            break
        x, value, radius = trial, reached, trial_radius
        levenberg = max(levenberg / 3.0, 1e-7)
        history.append(value)
        if progress:
            progress(f"refinement {iteration + 1}: {value:.2e}, spectral radius {radius:.6f}")
        if value > 0.99 * history[-2]:
            break
    return Refined(space.fill(x), value, radius, tuple(history))
