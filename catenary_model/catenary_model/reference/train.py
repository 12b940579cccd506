"""The pantographs of a train, one behind the other, coupled to the line and by it to each other within the step.

Every contact is a one-sided spring, F_p >= 0, F_p = k_c (y_p - w_p) where it pushes. At Newmark's new instant heads and
wire are affine in all contact forces,

    y_p = y_free,p - c_p F_p,    w_p = w_free,p + sum_q C_pq F_q,
    (1/k_c + c_p) F_p + sum_q C_pq F_q = y_free,p - w_free,p    if all push,

with C_pq what the wire answers at p to a unit force at q in one step: of some weight a few elements apart, zero beyond
the dozens over which a step's answer dies away. The matrix is symmetric and positive definite, so there is exactly one
set of forces in which none pulls and no head without force is above the wire; it is found by changing the state of the
first contact that contradicts (Murty's rule, which ends for such matrices).

The masses of all pantographs are one block-diagonal `pantograph.Constants`: a mass of one adds exactly nothing to
another, and one alone is the pantograph itself, to the last bit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from catenary_model import pantograph as panto
from catenary_model.pantograph import BETA, TS, Pantograph
from catenary_model.reference import step
from phil_base.kernels import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Mounted(NamedTuple):
    """A pantograph and its place on the train."""

    pantograph: Pantograph
    behind: float = 0.0
    """Distance behind the leading pantograph, m; 0 for that one."""
    static_force: float | None = None
    """Constant force on its first mass, N; None: the uplift that the pantograph has by itself."""

    @property
    def lifted(self) -> Pantograph:
        """The pantograph with this static force."""
        if self.static_force is None:
            return self.pantograph
        uplift = np.zeros(self.pantograph.uplift.size)
        uplift[0] = self.static_force
        return dataclasses.replace(self.pantograph, uplift=uplift)


class Train(NamedTuple):
    """All pantographs for the compiled step; p counts them from the front."""

    constants: panto.Constants
    """Of all masses, (masses of all, ...)."""
    state: panto.State
    head: Ints
    """Number of each head among the masses, (pantographs,)."""
    flexibility: Array
    """1/k_c of each, m/N."""
    behind: Array
    """Distance behind the leading one, m."""
    free: Array
    """Work: y_free of the heads, m."""
    force: Array
    """Contact forces of the new instant, N."""
    system: Array
    """Work: the matrix of the contacts and its right side, (pantographs, pantographs + 1)."""
    pushes: Ints
    """Work: 1 for a contact that is taken to push."""


def mounted(entries: Iterable[Mounted | tuple[Pantograph, float, float | None]], element: float) -> list[Mounted]:
    """Check the pantographs of a train; `element` is the length of one of the mesh, m.

    Raises ValueError naming the pantograph: the leading one is at 0, the others behind it, at least an element apart.
    """
    made = [Mounted(*entry) for entry in entries]
    if not made:
        raise ValueError("pantographs: there are none; allowed is at least one")
    for i, entry in enumerate(made):
        name = f"pantographs[{i}].behind = {entry.behind:g} m"
        if not 0.0 <= entry.behind < math.inf:
            raise ValueError(f"{name}: allowed is 0 m (the leading one) or more than that")
        if entry.static_force is not None and not math.isfinite(entry.static_force):
            raise ValueError(f"pantographs[{i}].static_force = {entry.static_force} N: allowed is a finite number")
        for j, other in enumerate(made[:i]):
            if abs(entry.behind - other.behind) < element:
                apart = f"at least {element:g} m (an element of the mesh) from pantographs[{j}] at {other.behind:g} m"
                raise ValueError(f"{name}: allowed is {apart}")
    if all(entry.behind > 0.0 for entry in made):
        least = min(entry.behind for entry in made)
        raise ValueError(f"pantographs: the first is {least:g} m behind; allowed is 0 m for the one that leads")
    return made


def train(entries: Sequence[Mounted], heights: Sequence[float], ts: float, beta: float, gamma: float) -> Train:
    """Couple pantographs, given from the front, for steps of ts (s); each begins at rest at its height (m)."""
    parts = [entry.lifted for entry in entries]
    constants = [panto.constants(part, ts, beta, gamma) for part in parts]
    rest = [panto.at_rest(part, height) for part, height in zip(parts, heights, strict=True)]
    masses = [part.uplift.size for part in parts]
    n, m = len(parts), sum(masses)
    together = panto.Constants(
        real=constants[0].real,
        damping=np.ascontiguousarray(block_diag(*(c.damping for c in constants))),
        stiffness=np.ascontiguousarray(block_diag(*(c.stiffness for c in constants))),
        inverse=np.ascontiguousarray(block_diag(*(c.inverse for c in constants))),
        uplift=np.concatenate([c.uplift for c in constants]),
    )
    state = panto.State(np.ascontiguousarray(np.concatenate([s.y for s in rest], axis=1)), np.zeros((3, m)))
    return Train(
        constants=together,
        state=state,
        head=np.cumsum(masses).astype(np.int64) - 1,
        flexibility=np.array([c.real[panto.CONTACT_COMPLIANCE] for c in constants]),
        behind=np.array([entry.behind for entry in entries], dtype=np.float64),
        free=np.zeros(n),
        force=np.zeros(n),
        system=np.zeros((n, n + 1)),
        pushes=np.ones(n, dtype=np.int64),
    )


@njit(cache=True, fastmath=False)
def begin(t: Train, share: float) -> None:
    """Step all masses to k+1 as if there were no contact, with the uplift times share (1); read the heads."""
    c = t.constants
    panto.free(c, t.state, share)
    ts, beta = c.real[TS], c.real[BETA]
    for p in range(t.head.size):
        t.free[p] = t.state.predicted[0, t.head[p]] + beta * ts * ts * t.state.predicted[2, t.head[p]]


@njit(cache=True, fastmath=False)
def push(t: Train, s: step.State) -> None:
    """Find all contact forces (N) for what the wire answers, `step.respond`."""
    n = t.head.size
    for p in range(n):
        t.pushes[p] = 1
    while True:
        _solve(t, s)
        first = -1
        for p in range(n):
            if t.pushes[p] == 1:
                wrong = t.force[p] < 0.0
            else:
                gap = t.free[p] - s.point[p, step.W_FREE]
                for q in range(n):
                    gap -= s.between[p, q] * t.force[q]
                wrong = gap > 0.0
            if wrong:
                first = p
                break
        if first < 0:
            break
        t.pushes[first] = 1 - t.pushes[first]
    for p in range(n):
        t.force[p] = max(0.0, t.force[p])


@njit(cache=True, fastmath=False)
def _solve(t: Train, s: step.State) -> None:
    """Solve for the forces of the contacts that push, by elimination; the matrix is positive definite."""
    n = t.head.size
    c, A = t.constants, t.system
    for p in range(n):
        own = c.real[BETA] * c.real[TS] * c.real[TS] * c.inverse[t.head[p], t.head[p]]
        for q in range(n):
            A[p, q] = s.between[p, q] if t.pushes[p] == 1 and t.pushes[q] == 1 else 0.0
        A[p, p] = t.flexibility[p] + own + s.between[p, p] if t.pushes[p] == 1 else 1.0
        A[p, n] = t.free[p] - s.point[p, step.W_FREE] if t.pushes[p] == 1 else 0.0
    for p in range(n):
        for i in range(p + 1, n):
            share = A[i, p] / A[p, p]
            for q in range(p, n + 1):
                A[i, q] -= share * A[p, q]
    for p in range(n - 1, -1, -1):
        value = A[p, n]
        for q in range(p + 1, n):
            value -= A[p, q] * t.force[q]
        t.force[p] = value / A[p, p]


@njit(cache=True, fastmath=False)
def finish(t: Train) -> None:
    """Complete the step that `begin` began with the contact forces."""
    c, s = t.constants, t.state
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[panto.GAMMA]
    for i in range(c.uplift.size):
        a = s.predicted[2, i]
        for p in range(t.head.size):
            a -= c.inverse[i, t.head[p]] * t.force[p]
        s.y[0, i] = s.predicted[0, i] + beta * ts * ts * a
        s.y[1, i] = s.predicted[1, i] + gamma * ts * a
        s.y[2, i] = a
