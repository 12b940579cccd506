"""The straightforward way for comparison: LU of the coupled step matrix, assembled and factored anew every step.

    (K_DM + beta Ts^2 sum_i k_i g_i g_i^T) q'' = r - sum_i (k_i g_i . q_p + b_i) g_i

Droppers, masts and arms stand in the matrix itself. Degrees of freedom (w_ca, phi_ca, w_co, phi_co) station by
station, so everything lies within seven diagonals on either side; elimination row by row, without pivoting, as the
mass matrix dominates. Where the slack state was wrong, assembly and elimination are done again from the first row
concerned on: the rows before it stay as they are.

Everything else is the model's own and as fast: the list of sites, predictors, the product K q + D q', correctors,
masses on the wires, observation. What is compared is the coupled solve alone. A site's missing compliance is not
known here: `Config.local_compliance` must be off, and the boundary must be one without feedback.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model import cycle, layout, sites, step, wires
from catenary_model.layout import Constants, State
from catenary_model.model import Catenary, Config
from catenary_model.wires import PAD
from phil_base.kernels import njit

Array = NDArray[np.float64]

HALF = 7
"""Diagonals beside the main one."""
PADDED = 8
"""Zeros behind the solution, so that its last rows need no special case."""


class Band(NamedTuple):
    """What the coupled matrix needs beside the model's own bundles."""

    newmark: Array
    """K_DM of the wires in compact form, (4 stations, 6), see `moving_frame`."""
    inner: Array
    """K and D of the rows that are alike, as `wires.load` wants them, (3, wire, row kind, 12)."""
    outer: Array
    """The same of the rows at the ends, (side, wire, row kind, 12, rows)."""
    lu: Array
    """Work: the matrix, then its factors, (4 stations, 16); column 7 is the diagonal, the last one stays zero."""
    y: Array
    """Work: the right side, then as eliminated, (4 stations,)."""
    a: Array
    """Work: the solution q'', (4 stations + PADDED,)."""


def band(catenary: Catenary) -> Band:
    """Prepare the wires' matrices of a model and the memory for its coupled one. Raises ValueError for a feedback."""
    if catenary.feedback is not None or catenary.config.local_compliance:
        raise ValueError("the coupled matrix knows neither a boundary with feedback nor local_compliance")
    frame, config, n = catenary.frame, catenary.config, catenary.mesh.stations
    given = [part.reshape(n, 2, 2, 6) for part in (frame.stiffness, frame.damping)]
    matrix = np.concatenate(given, axis=3)
    middle, ends = n // 2, 1
    for side in (matrix[:middle], matrix[:middle:-1]):
        differs = (side != side[-1]).reshape(middle, -1).any(axis=1)
        ends = max(ends, int(np.flatnonzero(differs).max(initial=0)) + 1)
    return Band(
        newmark=wires.step_matrix(frame, config.step_time, config.newmark_beta, config.newmark_gamma),
        inner=np.stack([matrix[middle - 1], matrix[middle + 1], matrix[middle]]),
        outer=np.ascontiguousarray(np.stack([matrix[:ends], matrix[n - ends :]]).transpose(0, 2, 3, 4, 1)),
        lu=np.zeros((4 * n, 16)),
        y=np.zeros(4 * n),
        a=np.zeros(4 * n + PADDED),
    )


@njit(cache=True, fastmath=False)
def laws(c: Constants, s: State) -> None:
    """Write stiffness and constant force of every site for the present slack state, both with its fade."""
    ts, scale = c.real.ts, c.real.beta * c.real.ts**2
    for i in range(s.counter[layout.SITES]):
        row, slot = s.where[layout.ROW, i], s.where[layout.SLOT, i]
        k, b = 0.0, 0.0
        if row < 0:
            b = s.contact[layout.GIVEN]
        elif c.site[row, layout.ONE_SIDED] > 0.0:
            b = -c.site[row, layout.FORCE]
            if s.taut[slot] == 1:
                k = c.site[row, layout.STIFFNESS]
                b += k * c.site[row, layout.ELONGATION]
        else:
            k = c.site[row, layout.STIFFNESS]
            if c.site[row, layout.INERTIA] > 0.0:
                y = s.particle[slot]
                m = y[layout.KNOWN] * c.site[row, layout.INERTIA] / scale
                k += m
                b = -m * (y[0] + ts * y[1] + (0.5 * ts * ts - scale) * y[2])
        s.here[layout.LAW_K, i] = s.here[layout.FADE, i] * k
        s.here[layout.LAW_B, i] = s.here[layout.FADE, i] * b


@njit(cache=True, fastmath=False)
def assemble(c: Constants, s: State, m: Band, first: int) -> None:
    """Write matrix and right side for the present laws, rows `first` (the first of a station) and on."""
    n = m.y.size
    for i in range(first, n):
        row = m.lu[i]
        row[:] = 0.0
        o = 3 - (i & 1)
        for j in range(3):
            row[o + 4 * j] = m.newmark[i, 2 * j]
            row[o + 4 * j + 1] = m.newmark[i, 2 * j + 1]
        m.y[i] = s.rhs[(i >> 1) & 1, i & 1, i >> 2]
    scale = c.real.beta * c.real.ts**2
    g = np.empty(8)
    for i in range(s.counter[layout.SITES]):
        base = 4 * s.where[layout.ELEMENT, i]
        if base + 8 <= first:
            continue
        for j in range(8):
            on = s.here[layout.CONTACT_WIRE, i] if j & 2 else s.here[layout.CARRIER, i]
            g[j] = on * s.psi[2 * (j >> 2) + (j & 1), i]
        k = s.here[layout.LAW_K, i]
        force = s.here[layout.LAW_B, i] + k * sites.elongation(i, s.here, s.where, s.psi, s.q[0])
        for j in range(8):
            if base + j >= first and g[j] != 0.0:
                m.y[base + j] -= force * g[j]
                if k != 0.0:
                    for o in range(8):
                        m.lu[base + j, HALF + o - j] += scale * k * g[j] * g[o]


@njit(cache=True, fastmath=False)
def factor_and_solve(m: Band, first: int) -> None:
    """Eliminate rows `first` and on, then substitute back over all rows."""
    lu, y, a = m.lu, m.y, m.a
    n = y.size
    for i in range(first, n):
        row = lu[i]
        total = y[i]
        for k in range(max(0, i - HALF), i):
            o = k - i + HALF
            if row[o] != 0.0:
                pivot = lu[k]
                factor = row[o] * pivot[HALF]
                row[o] = factor
                for j in range(1, 9):
                    row[o + j] -= factor * pivot[HALF + j]
                total -= factor * y[k]
        row[HALF] = 1.0 / row[HALF]
        y[i] = total
    for i in range(n - 1, -1, -1):
        row = lu[i]
        value = y[i]
        for j in range(1, HALF + 1):
            value -= row[HALF + j] * a[i + j]
        a[i] = value * row[HALF]


@njit(cache=True, fastmath=False)
def take(a: Array, q: Array) -> None:
    """Put the solution where the model keeps q''."""
    for i in range(4 * (q.shape[3] - 2 * PAD)):
        q[2, (i >> 1) & 1, i & 1, (i >> 2) + PAD] = a[i]


@njit(cache=True, fastmath=False)
def recheck(c: Constants, s: State) -> int:
    """Flip the droppers that contradict the solution; return the first row concerned, or -1."""
    scale = c.real.beta * c.real.ts**2
    first, slack = -1, 0
    for i in range(s.counter[layout.SITES]):
        stretch = sites.elongation(i, s.here, s.where, s.psi, s.q[0])
        stretch += scale * sites.elongation(i, s.here, s.where, s.psi, s.q[2])
        s.here[layout.STRETCH, i] = stretch
        row, slot = s.where[layout.ROW, i], s.where[layout.SLOT, i]
        if row >= 0 and c.site[row, layout.ONE_SIDED] > 0.0:
            taut = 1 if c.site[row, layout.ELONGATION] + stretch > 0.0 else 0
            if taut != s.taut[slot]:
                s.taut[slot] = taut
                if first < 0:
                    first = 4 * s.where[layout.ELEMENT, i]
            slack += 1 - taut
    s.counter[layout.SLACK] = slack
    return first


@njit(cache=True, fastmath=False)
def begin(c: Constants, s: State, m: Band) -> None:
    """Do what comes before the coupled solve: sites, predictors, right side of the wires."""
    s.counter[layout.STEPS] += 1
    sites.collect(c, s, cycle.track_position(c, s))
    wires.predict(s.q, c.real.ts, c.real.beta, c.real.gamma)
    wires.load(m.inner, m.outer, s.q, s.rhs)


@njit(cache=True, fastmath=False)
def finish(c: Constants, s: State, iterations: int) -> None:
    """Do what comes after it: correctors, masses on the wires."""
    s.counter[layout.ITERATIONS] = max(s.counter[layout.ITERATIONS], iterations)
    wires.correct(s.q, c.real.ts, c.real.beta, c.real.gamma)
    sites.move_masses(c, s)


@njit(cache=True, fastmath=False)
def substep(c: Constants, s: State, m: Band) -> None:
    """Integrate one step with the contact force `State.contact[GIVEN]`."""
    begin(c, s, m)
    first, iterations = 0, 0
    while True:
        laws(c, s)
        assemble(c, s, m, first)
        factor_and_solve(m, first)
        take(m.a, s.q)
        iterations += 1
        first = recheck(c, s)
        if first < 0:
            break
        if iterations >= c.whole.max_iterations:
            s.counter[layout.UNSETTLED] += 1
            break
    finish(c, s, iterations)


@njit(cache=True, fastmath=False)
def advance(c: Constants, s: State, m: Band, f_cat: float) -> None:
    """Go on one cycle, as `catenary_model.step.advance` does."""
    n, before = c.whole.substeps, s.contact[layout.LAST_FORCE]
    s.counter[layout.ITERATIONS] = 0
    for j in range(n):
        s.contact[layout.GIVEN] = before + (f_cat - before) * ((j + 1) / n)
        substep(c, s, m)
    s.contact[layout.LAST_FORCE] = f_cat
    step.observe(c, s, f_cat)


@njit(cache=True, fastmath=False)
def steps(c: Constants, s: State, m: Band, force: Array) -> None:
    """Integrate a step for every force (N)."""
    for i in range(force.size):
        s.contact[layout.GIVEN] = force[i]
        substep(c, s, m)
    s.contact[layout.LAST_FORCE] = force[-1]


class BandedLU:
    """A catenary whose steps factor the coupled matrix; `catenary` holds its state and tells what is seen."""

    def __init__(self, config: Config) -> None:
        self.catenary = Catenary(config)
        self._band = band(self.catenary)

    def step(self, f_cat: float) -> None:
        """Advance one cycle with the contact force f_cat (N)."""
        advance(self.catenary.constants, self.catenary.state, self._band, f_cat)

    def steps(self, force: Array) -> None:
        """Integrate a step for every force (N), without an observation."""
        steps(self.catenary.constants, self.catenary.state, self._band, force)
