"""Factors of a free wire's step matrix: the wires alone are uniform and do not change in time.

Newmark's unknown is the displacement q of the new instant, and the damping of a wire is proportional to its mass,
D = (beta_w / rhoA) M, so that a step needs the mass matrix only:

    A q = M (s q_p - beta Ts^2 d v_p) + beta Ts^2 f,    A = s M + beta Ts^2 K,  s = 1 + gamma Ts d,  d = beta_w / rhoA

(q_p, v_p: predictors (3.19, 3.20); A is K_DM of (3.22), see `catenary_model.wires`). Rayleigh's damping has a part
b K as well. With kappa = 1 + b gamma/(beta Ts) and the shift r = (b/kappa) (v_p - gamma/(beta Ts) q_p), which is known,

    A (q + r) = M (s (q_p + r) - beta Ts^2 d v_p) + beta Ts^2 f,    A = s M + beta Ts^2 kappa K,

the same step for q + r. A is block tridiagonal with 2 x 2
blocks, one a node. Its factors S_(i+1) = D - B^T S_i^-1 B converge to a constant within some dozen nodes, to the last
bit: only this head is kept, the rest of a wire, however long, is two recursions with constant coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import elements
from catenary_model.line import Wire

Array = NDArray[np.float64]

_LONGEST_HEAD = 2000


@dataclass(frozen=True)
class WireFactor:
    """Factors of A; the last entry of each array holds for all later nodes but the very last one."""

    forward: Array
    """B^T S_i^-1, (head, 4) row by row: y_(i+1) = r_(i+1) - forward_i y_i."""
    inverse: Array
    """S_i^-1, (head, 4)."""
    backward: Array
    """S_i^-1 B, (head, 4): x_i = inverse_i y_i - backward_i x_(i+1)."""
    last: Array
    """S^-1 of the last node, (4,)."""


def factor(wire: Wire, h: float, nodes: int, ts: float, beta: float, gamma: float) -> WireFactor:
    """Factor A of a wire (3.1) with free ends, `nodes` nodes, elements of length h (m) and steps of ts (s)."""
    stiffness = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
    stiffness = (1.0 + wire.stiffness_damping * gamma / (beta * ts)) * stiffness
    block = (wire.mass_per_length + gamma * ts * wire.damping) * elements.mass(h) + beta * ts**2 * stiffness
    B = block[:2, 2:]
    first, last = block[:2, :2], block[2:, 2:]
    S = [first]
    while len(S) < min(nodes - 1, _LONGEST_HEAD):
        S.append(first + last - B.T @ np.linalg.solve(S[-1], B))
        if np.abs(S[-1] - S[-2]).max() <= 1e-17 * np.abs(S[-1]).max() or np.array_equal(S[-1], S[-2]):
            break
    inverse = np.array([np.linalg.inv(s) for s in S])
    return WireFactor(
        forward=np.array([(B.T @ i).ravel() for i in inverse]),
        inverse=inverse.reshape(-1, 4),
        backward=np.array([(i @ B).ravel() for i in inverse]),
        last=np.linalg.inv(last - B.T @ inverse[-1] @ B).ravel(),
    )


def shift(wire: Wire, ts: float, beta: float, gamma: float) -> Array:
    """Return r as a combination of q, q', q'', (3,): the module's docstring; zero without b."""
    b, per = wire.stiffness_damping, gamma / (beta * ts)
    of_q_p, of_v_p = np.array([1.0, ts, ts**2 * (0.5 - beta)]), np.array([0.0, 1.0, ts * (1.0 - gamma)])
    return np.asarray(b / (1.0 + b * per) * (of_v_p - per * of_q_p))


def mass_stencil(wire: Wire, h: float) -> Array:
    """Coefficients of M on a uniform mesh, (6,).

    An inner node's row is  w: c0 w + c1 (w- + w+) + c2 (phi- - phi+),  phi: c3 phi + c2 (w+ - w-) - c4 (phi- + phi+);
    an end node has half of c0 and c3, and -+c5 between its own w and phi.
    """
    return wire.mass_per_length * h / 420.0 * np.array([312.0, 54.0, 13.0 * h, 8.0 * h * h, 3.0 * h * h, 22.0 * h])
