"""A linear PDE as the explicit finite-difference scheme of its interior nodes (thesis 3.1.2.1, Figure 3.3)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]


def difference(order: int, points: Sequence[int]) -> Array:
    """Weights of the derivative of an order on integer points, for unit spacing: Taylor series as in (3.8), (3.9).

    Args:
        order: of the derivative; 0 interpolates at the origin.
        points: distinct integers where the function is sampled, more than `order` of them.

    Returns:
        The weights, shape (len(points),): f^(order)(0) ~ sum_i weights[i] f(points[i]).

    Raises:
        ValueError: points repeat, or there are too few of them.
    """
    n = len(points)
    if len(set(points)) != n:
        raise ValueError(f"difference points repeat: {list(points)}")
    if not 0 <= order < n:
        raise ValueError(f"a derivative of order {order} needs at least {order + 1} points, not {n}")
    powers = np.vander(np.asarray(points, float), n, increasing=True).T
    moments = np.zeros(n)
    moments[order] = math.factorial(order)
    weights: Array = np.linalg.solve(powers, moments).astype(np.float64)
    return weights


def centred(order: int, accuracy: int = 2) -> tuple[int, ...]:
    """Points of the centred difference of an order of derivative, with an even order of accuracy.

    Raises:
        ValueError: the accuracy is not a positive even number.
    """
    if accuracy < 2 or accuracy % 2:
        raise ValueError(f"centred differences have an even order of accuracy, not {accuracy}")
    half = (order + 1) // 2 + accuracy // 2 - 1 if order else 0
    return tuple(range(-half, half + 1))


class Term(NamedTuple):
    """One term of a linear PDE written as sum = 0: factor times a derivative in space and time.

    Example:
        T w_xx on the left-hand side with a minus: `Term(-T, space=(2,))`; rhoA w_tt: `Term(rhoA, time=2)`.
    """

    factor: float
    space: tuple[int, ...] = ()
    """Order of the derivative along every dimension; missing ones are 0."""
    time: int = 0
    accuracy: int = 2
    """Of the centred differences in space."""
    time_points: tuple[int, ...] | None = None
    """Levels of the time difference (1 is the new one); as they are: time 0: (0), 1 and 2: (-1, 0, 1), and for a mixed
    derivative, which may not use the new level beside the node itself, (-2, -1, 0)."""
    space_points: tuple[tuple[int, ...], ...] | None = None
    """Points of the differences along every dimension, in place of the centred ones."""


@dataclass(frozen=True, eq=False)
class Stencil:
    """The explicit interior scheme sum_i coefficients[i] w[j + offsets[i, :-1], n + offsets[i, -1]] = 0 (Figure 3.3).

    The new time level (offset +1) appears exactly once, at space offset 0, so that the scheme is explicit.

    Attributes:
        offsets: integers, shape (n, dims + 1): one column a space dimension, the last one is time.
        coefficients: shape (n,).
        dx: grid spacing along each dimension, m.
        dt: time step, s.
        name: of the PDE, for files and figures.
        parameters: of the PDE by name, for files and figures only.
    """

    offsets: IntArray
    coefficients: Array
    dx: tuple[float, ...]
    dt: float
    name: str = "pde"
    parameters: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Bring the arrays into canonical form (sorted, equal offsets summed, zeros dropped) and check them."""
        offsets = np.atleast_2d(np.asarray(self.offsets))
        coefficients = np.atleast_1d(np.asarray(self.coefficients, float))
        dx = tuple(float(h) for h in self.dx)
        if not np.array_equal(offsets, np.round(offsets)):
            raise ValueError("offsets of a stencil are integers")
        if offsets.ndim != 2 or coefficients.ndim != 1 or len(offsets) != len(coefficients):
            raise ValueError(f"{offsets.shape} offsets do not fit {coefficients.shape} coefficients")
        if offsets.shape[1] != len(dx) + 1:
            raise ValueError(f"offsets have {offsets.shape[1]} columns; {len(dx)} space dimensions and time need more")
        if not np.all(np.isfinite(coefficients)):
            raise ValueError("coefficients of a stencil are finite numbers")
        if not all(math.isfinite(h) and h > 0.0 for h in (*dx, self.dt)):
            raise ValueError(f"grid spacing {dx} and time step {self.dt} must be positive")
        unique, inverse = np.unique(offsets.astype(np.int64), axis=0, return_inverse=True)
        summed = np.zeros(len(unique))
        np.add.at(summed, np.ravel(inverse), coefficients)
        keep = np.abs(summed) > 1e-14 * np.abs(summed).max(initial=0.0)
        unique, summed = unique[keep], summed[keep]
        new = unique[:, -1] > 0
        if new.sum() != 1 or unique[new][0, -1] != 1 or np.any(unique[new][0, :-1]):
            raise ValueError("an explicit stencil has one coefficient on the new level: time offset +1, space offset 0")
        object.__setattr__(self, "offsets", unique)
        object.__setattr__(self, "coefficients", summed)
        object.__setattr__(self, "dx", dx)
        object.__setattr__(self, "dt", float(self.dt))

    @property
    def dims(self) -> int:
        """Number of space dimensions."""
        return len(self.dx)

    @property
    def levels(self) -> int:
        """Number of old time levels that the update reads: 2 for a wave equation."""
        return int(max(1, 1 - self.offsets[:, -1].min()))

    @property
    def reach(self) -> tuple[tuple[int, int], ...]:
        """Nodes that the update reads to the lower and to the upper side, for every dimension."""
        space = self.offsets[:, :-1]
        return tuple((int(max(0, -space[:, d].min())), int(max(0, space[:, d].max()))) for d in range(self.dims))

    def nodes_at(self, side: str, axis: int = 0) -> int:
        """Number of nodes at a side ("left", "right") that the interior scheme cannot update.

        Raises:
            ValueError: the side is neither of the two.
        """
        if side not in ("left", "right"):
            raise ValueError(f'side is "left" or "right", not {side!r}')
        return self.reach[axis][0 if side == "left" else 1]

    def mirrored(self, axis: int = 0) -> Stencil:
        """Return the scheme for the reversed coordinate: its left boundary is the right one of this scheme."""
        sign = np.ones(self.dims + 1, np.int64)
        sign[axis] = -1
        return replace(self, offsets=self.offsets * sign)

    def weights(self) -> Array:
        """Weights of the explicit update, old values only.

        Returns:
            Shape (levels, low + high + 1, ...) with (low, high) the reach along each dimension: entry [l, k, ...]
            multiplies w[j - low + k, ..., n - l].
        """
        reach = self.reach
        dense = np.zeros((self.levels, *(low + high + 1 for low, high in reach)))
        new = self.offsets[:, -1] == 1
        for offset, coefficient in zip(self.offsets[~new], self.coefficients[~new], strict=True):
            index = (-offset[-1], *(o + low for o, (low, _) in zip(offset[:-1], reach, strict=True)))
            dense[index] = -coefficient / self.new_coefficient
        return dense

    @property
    def new_coefficient(self) -> float:
        """Coefficient of the new value: a load f on the right-hand side of the PDE adds f / new_coefficient to it."""
        return float(self.coefficients[self.offsets[:, -1] == 1][0])

    def symbol(self, *factors: ComplexArray | complex) -> ComplexArray:
        """Value of the stencil on the harmonic wave (3.27), divided by that wave: 0 is the dispersion relation.

        Args:
            factors: e^{i omega_x dx} for every dimension, then e^{i omega_t dt}; broadcast against each other.
        """
        if len(factors) != self.dims + 1:
            raise ValueError(f"the wave needs {self.dims + 1} factors, not {len(factors)}")
        arrays = np.broadcast_arrays(*(np.asarray(f, complex) for f in factors))
        total = np.zeros(arrays[0].shape, complex)
        for offset, coefficient in zip(self.offsets, self.coefficients, strict=True):
            wave = np.full(arrays[0].shape, complex(coefficient))
            for factor, power in zip(arrays, offset, strict=True):
                wave = wave * factor ** int(power)
            total = total + wave
        return total


def from_terms(
    terms: Iterable[Term], dx: float | Sequence[float], dt: float, name: str = "pde", **parameters: float
) -> Stencil:
    """Discretise a linear PDE, given as terms whose sum is 0, by differences at node j and time n (3.8), (3.9).

    Example:
        The 1-D wave equation w_tt = c^2 w_xx: `from_terms([Term(1.0, time=2), Term(-c**2, space=(2,))], dx, dt)`.

    Args:
        terms: of the PDE; the one with the highest time derivative must reach the new level.
        dx: grid spacing, m; one number a dimension.
        dt: time step, s.
        name: of the PDE.
        parameters: of the PDE, kept for files and figures.

    Raises:
        ValueError: the terms do not make an explicit scheme.
    """
    spacing = (float(dx),) if isinstance(dx, int | float) else tuple(float(h) for h in dx)
    sums: dict[tuple[int, ...], float] = {}
    for term in terms:
        orders = (*term.space, *(0,) * (len(spacing) - len(term.space)))
        if len(orders) != len(spacing):
            raise ValueError(f"{term} has more space dimensions than the grid, which has {len(spacing)}")
        points = term.space_points or tuple(centred(order, term.accuracy) for order in orders)
        times = term.time_points or _times(term)
        axes = [*zip(orders, points, spacing, strict=True), (term.time, times, dt)]
        weights = [difference(order, p) / step**order for order, p, step in axes]
        for choice in product(*(range(len(p)) for _, p, _ in axes)):
            value = term.factor * math.prod(float(w[i]) for w, i in zip(weights, choice, strict=True))
            if value != 0.0:
                key = tuple(p[i] for (_, p, _), i in zip(axes, choice, strict=True))
                sums[key] = sums.get(key, 0.0) + value
    if not sums:
        raise ValueError("a PDE needs at least one term that is not zero")
    offsets = np.array(list(sums), np.int64)
    return Stencil(offsets, np.array(list(sums.values())), spacing, dt, name, tuple(parameters.items()))


def _times(term: Term) -> tuple[int, ...]:
    if term.time == 0:
        return (0,)
    if any(term.space):
        return tuple(range(-term.time - 1, 1))
    return centred(term.time)
