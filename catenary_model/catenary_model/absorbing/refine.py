"""Nonlinear refinement of a boundary within bounds, with stability as a constraint.

The reflected amplitudes follow from the coefficients by a linear system, and an eigenvalue's change by first-order
perturbation; so all derivatives are exact and a trust-region least-squares method (scipy) does the work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from catenary_model.absorbing import stability
from catenary_model.absorbing.boundary import BoundaryStencil, unknowns
from catenary_model.absorbing.design import (
    DEMANDS,
    Candidate,
    Demands,
    Design,
    Progress,
    as_design,
    closed_radius,
    closings,
)
from catenary_model.absorbing.dispersion import Waves
from catenary_model.absorbing.judge import Judge, judge
from catenary_model.absorbing.least_squares import mode_weights, passes_constant
from catenary_model.absorbing.objective import errors, errors_with_derivative, output_error, quadrature, spatial_weights
from catenary_model.absorbing.reflection import amplitudes_with_derivative, echo_matrix
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

OE_POINTS = 60
"""Spatial frequencies of the output-error objective."""

LEAST_LEAK = 0.1
"""Share of the leak of the start that the refinement must leave."""
SUM_PENALTY = 100.0
"""Weight of sums beyond their limit, relative to the other penalties: leaks are small numbers."""


class Settings(NamedTuple):
    """How long and how far the refinement goes."""

    rounds: int = 6
    """Least-squares problems, each weighted towards the worst frequencies of the one before (Lawson)."""
    evaluations: int = 40
    """Of the residuals in every round."""
    step: float = 2.0
    """Bound: no coefficient moves further than this from where it started."""
    penalty: float = 30.0
    """Weight of eigenvalues and gains beyond their limits; grows where it does not suffice."""


def refine(
    design: Design,
    demands: Demands = DEMANDS,
    settings: Settings | None = None,
    progress: Progress | None = None,
    objective: str = "reflection",
    opposite: BoundaryStencil | None = None,
) -> Design:
    """Lower the largest reflection in the band, or J_OE, starting from a design, never leaving what is stable.

    Args:
        design: to start from; it need not be stable.
        demands: on stability.
        settings: of the optimiser.
        progress: called after every round.
        objective: "reflection", or "output_error" for (3.29): the sum of moduli by reweighted squares.
        opposite: boundary of the other side, if one is known already.

    Returns:
        The best design that fulfils the demands among those at the end of every round; the given one if none is better.

    Raises:
        ValueError: the objective is neither of the two.
    """
    settings = settings or Settings()
    if objective not in ("reflection", "output_error"):
        raise ValueError(f'objective is "reflection" or "output_error", not {objective!r}')
    stencil, start = design.stencil, design.boundary
    bench = judge(stencil, design.weighting, start.side)
    space = _Space.of(stencil, start)
    omega_x, spatial = spatial_weights(stencil, design.weighting, OE_POINTS)
    share = quadrature(omega_x, spatial)

    def score(boundary: BoundaryStencil, reflected: float) -> float:
        return reflected if objective == "reflection" else float(share @ output_error(stencil, boundary, omega_x))

    best, best_score = design, score(start, design.reflection)
    if max(design.radius, closed_radius(stencil, _candidate(bench, start), demands, opposite)) > 1.0 - demands.margin:
        best_score = np.inf

    def next_weight(boundary: BoundaryStencil, weight: Array) -> Array:
        if objective == "reflection":  # towards the worst frequencies: Lawson, for the smallest maximum
            size = bench.echo(boundary).max(axis=1) * bench.inside_weights
            weight = np.sqrt(weight**2 * size / max(float(np.average(size, weights=weight**2)), 1e-300))
            return weight / np.sqrt(np.mean(weight**2))
        e = np.abs(errors(stencil, boundary, omega_x))  # squares that touch the moduli where the last round ended
        return np.sqrt(share[:, None, None] / np.maximum(e, 1e-4 * e.max()))

    weight = next_weight(start, np.ones(len(bench.inside.z)))
    penalty, x = settings.penalty, np.zeros(space.basis.shape[1])
    for done in range(settings.rounds):

        def fun(y: Array, weight: Array = weight, mu: float = penalty) -> tuple[Array, Array]:
            boundary = space.boundary(y)
            if objective == "reflection":
                aim = _reflection_rows(boundary, bench.inside, bench.inside_weights * weight)
            else:
                aim = _output_rows(stencil, boundary, omega_x, weight)
            limits = _limits(stencil, boundary, bench.modes, demands, mu, opposite)
            values, slopes = zip(aim, limits, space.limits(y, mu), strict=True)
            return np.concatenate(values), np.concatenate(slopes) @ space.basis

        x = _minimise(fun, x, settings)
        boundary = space.boundary(x)
        candidate = _candidate(bench, boundary)
        worst = closed_radius(stencil, candidate, demands, opposite)
        reached = score(boundary, candidate.reflection)
        if worst > 1.0 - demands.margin:
            penalty *= 10.0
        elif reached < best_score:
            origin = tuple({**dict(design.origin), "refined": float(done + 1)}.items())
            best, best_score = replace(as_design(stencil, candidate, design.weighting, worst), origin=origin), reached
        weight = next_weight(boundary, weight)
        if progress:
            progress(done + 1, settings.rounds, f"{objective} {reached:.2e}, radius - 1 {worst - 1.0:.1e}")
    return best


class _Space(NamedTuple):
    """Coefficients as start + basis . x: those that are unknown; a node's sum is held if it keeps a constant exactly.

    Otherwise the sum is free up to `keep`, what a node may keep of a constant displacement in one step. With damping
    the best sum is not the largest: a slow wave leaves weaker than it came.
    """

    shape: tuple[int, ...]
    side: str
    start: Array
    basis: Array
    sums: Array
    keep: Array

    @staticmethod
    def of(stencil: Stencil, boundary: BoundaryStencil) -> _Space:
        shape = boundary.coefficients.shape
        mask = unknowns(shape)
        n = int(mask.sum())
        start, basis = boundary.coefficients[mask], np.eye(n)
        sums = np.zeros((shape[0], n))
        keep = np.full(shape[0], np.inf)
        if passes_constant(stencil):
            sums[np.argwhere(mask)[:, 0], np.arange(n)] = 1.0
            leak = 1.0 - sums @ start
            keep = 1.0 - LEAST_LEAK * leak
            if np.all(leak < 1e-12):
                basis = np.linalg.svd(sums)[2][shape[0] :].T
                keep[:] = np.inf
        return _Space(shape, boundary.side, start, basis, sums, keep)

    def limits(self, x: Array, penalty: float) -> tuple[Array, Array]:
        """Sums beyond what may be kept, and their derivatives by the coefficients."""
        over = np.maximum(self.sums @ (self.start + self.basis @ x) - self.keep, 0.0)
        return SUM_PENALTY * penalty * over, SUM_PENALTY * penalty * (over > 0.0)[:, None] * self.sums

    def boundary(self, x: Array) -> BoundaryStencil:
        coefficients = np.zeros(self.shape)
        coefficients[unknowns(self.shape)] = self.start + self.basis @ x
        return BoundaryStencil(coefficients, self.side)


def _candidate(bench: Judge, boundary: BoundaryStencil) -> Candidate:
    return Candidate(boundary, *bench.figures(boundary), 0.0, 0.0, 0.0, 0)


def _minimise(fun: Callable[[Array], tuple[Array, Array]], x: Array, settings: Settings) -> Array:
    """Trust-region least squares; value and slope of a point are computed together and kept for the next call."""
    memo: dict[bytes, tuple[Array, Array]] = {}

    def both(y: Array) -> tuple[Array, Array]:
        if y.tobytes() not in memo:
            memo.clear()
            memo[y.tobytes()] = fun(y)
        return memo[y.tobytes()]

    def value(y: Array) -> Array:
        return both(y)[0]

    def slope(y: Array) -> Array:
        return both(y)[1]

    limit = settings.step
    from scipy.optimize import least_squares  # a fifth of a second to load, and a ride on elements needs it not

    found = least_squares(
        value,
        np.clip(x, -limit, limit),
        slope,
        bounds=(-limit, limit),
        max_nfev=settings.evaluations,
        x_scale="jac",
    )
    return np.asarray(found.x, float)


def _reflection_rows(boundary: BoundaryStencil, modes: Waves, weights: Array) -> tuple[Array, Array]:
    a, da = amplitudes_with_derivative(boundary, modes)
    seen = echo_matrix(modes)
    a, da = (seen @ a[..., None])[..., 0], seen @ da
    scale = weights[:, None] / np.sqrt(len(weights)) * mode_weights(boundary.nodes)
    return _real((a * scale).ravel(), (da * scale[..., None]).reshape(-1, da.shape[-1]))


def _output_rows(stencil: Stencil, boundary: BoundaryStencil, omega_x: Array, scale: Array) -> tuple[Array, Array]:
    e, de = errors_with_derivative(stencil, boundary, omega_x)
    return _real((e * scale).ravel(), (de * scale[..., None]).reshape(-1, de.shape[-1]))


def _real(values: ComplexArray, slopes: ComplexArray) -> tuple[Array, Array]:
    return np.concatenate([values.real, values.imag]), np.concatenate([slopes.real, slopes.imag])


def _limits(
    stencil: Stencil,
    boundary: BoundaryStencil,
    modes: Waves,
    demands: Demands,
    penalty: float,
    opposite: BoundaryStencil | None,
) -> tuple[Array, Array]:
    """What lies beyond the limits of gain and spectral radius, and its derivatives."""
    a, da = amplitudes_with_derivative(boundary, modes)
    R, dR = a[:, 0], da[:, 0]
    decay = np.abs(modes.reflected[:, 0] / modes.incident[:, 0]) ** boundary.n_x
    modulus = np.maximum(np.abs(R), 1e-300)
    by_modulus = decay[:, None] * np.real(np.conj(R)[:, None] * dR) / modulus[:, None]
    over = [modulus * decay - (demands.gain - 1e-3)]
    slopes = [by_modulus]
    for left, right in closings(stencil, boundary, opposite):
        for nodes in demands.nodes:
            size = max(nodes, stability.smallest(left, right))
            moduli, derivative = stability.moduli_with_derivative(stencil, left, right, size, boundary.side)
            over.append(moduli - (1.0 - 2.0 * demands.margin))
            slopes.append(derivative)
    beyond: Array = np.concatenate(over).astype(np.float64)
    rows: Array = (penalty * (beyond > 0.0)[:, None] * np.concatenate(slopes)).astype(np.float64)
    return penalty * np.maximum(beyond, 0.0), rows
