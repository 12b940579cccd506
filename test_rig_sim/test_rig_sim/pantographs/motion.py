"""How a pantograph moves: the rate of change of its state, compiled and free of allocation.

Two kinds go through the same three functions, so the rig's step does not know which one it carries:

- a chain of masses on a frame, M q'' + D q' + K q = e_frame F_frame - e_head f, with x = (q, q'). F_frame holds what
  the car body does through the lowest spring and dashpot, and the laws of `frame.py`;
- a linear system that was read from a file, x' = A x + B (lift, base, base_rate, f), in coordinates in which place and
  velocity of the head are the first two.

Compiled without Python's error on division by zero (`error_model`): its branches would cost ten times the arithmetic.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phil_base.kernels import njit
from test_rig_sim.pantographs.frame import Frame, frame_force

Array = npt.NDArray[np.float64]

LIFT, BASE, BASE_RATE, CONTACT = range(4)
"""Columns of B."""


class Pantograph(NamedTuple):
    """A pantograph of either kind. SI units, up is positive. Made by `of_chain` and `of_linear`.

    All matrices are in one array: compiled code counts references to every array of a tuple that it hands on, which in
    the innermost functions would cost more than the arithmetic.
    """

    bodies: int  # 1, n of a chain, frame first, head last; 0: linear system
    states: int  # 1, m
    head: int  # 1, index of the head's place in the state
    head_rate: int  # 1, index of its velocity
    table: Array  # chain (2n + 1, n): K, D, diagonal of M; linear system (m, m + 4): A, B
    ground_damping: float  # N s/m, of the dashpot between car body and frame
    ground_stiffness: float  # N/m, of the spring between car body and frame
    preload: float  # N, constant force beside the lift: puts the nominal height where the lowest spring is unloaded
    plain: bool  # the frame has no laws beyond spring and dashpot: they are left out
    frame: Frame  # laws on the frame's body, see there

    @property
    def mass(self) -> Array:
        """Diagonal of M, kg, (n,)."""
        return self.table[2 * self.bodies] if self.bodies else np.zeros(0)

    @property
    def damping(self) -> Array:
        """D, N s/m, (n, n)."""
        return self.table[self.bodies : 2 * self.bodies]

    @property
    def stiffness(self) -> Array:
        """K, N/m, (n, n)."""
        return self.table[: self.bodies]

    @property
    def A(self) -> Array:
        """A of a linear system, (m, m)."""
        return self.table[: self.states, : self.states]

    @property
    def B(self) -> Array:
        """B of a linear system, (m, 4), columns LIFT, BASE, BASE_RATE, CONTACT."""
        return self.table[: self.states, self.states :]


def of_chain(mass: Array, damping: Array, stiffness: Array, frame: Frame) -> Pantograph:
    """Return the pantograph of M (n,), D (n, n) and K (n, n), whose row sums are the links to the car body."""
    n = mass.size
    return Pantograph(
        bodies=n,
        states=2 * n,
        head=n - 1,
        head_rate=2 * n - 1,
        table=np.vstack([stiffness, damping, mass]),
        ground_damping=float(damping[0].sum()),
        ground_stiffness=float(stiffness[0].sum()),
        preload=0.0,
        plain=frame == Frame(),
        frame=frame,
    )


def of_linear(A: Array, B: Array) -> Pantograph:
    """Return the pantograph of x' = A x + B u, whose first two states are place and velocity of the head."""
    return Pantograph(
        bodies=0,
        states=B.shape[0],
        head=0,
        head_rate=1,
        table=np.hstack([A, B]),
        ground_damping=0.0,
        ground_stiffness=0.0,
        preload=0.0,
        plain=True,
        frame=Frame(),
    )


class Load(NamedTuple):
    """What acts on the pantograph from outside, beside the contact."""

    lift: float = 0.0  # N, force of the actuator on the frame
    base: float = 0.0  # m, displacement of the car body under the frame
    base_rate: float = 0.0  # m/s
    knock: float = 0.0  # N, force on the head, downwards


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def rate(p: Pantograph, x: Array, lift: float, base: float, base_rate: float, f: float, out: Array) -> None:
    """Write the rate of change of the state x (m,) to out (m,).

    lift in N is the actuator's force on the frame, base (m) and base_rate (m/s) the motion of the car body, f in N
    pushes the head down.
    """
    table = p.table
    n = p.bodies
    if n == 0:
        m = p.states
        push = lift + p.frame.air + p.preload
        for i in range(m):
            change = table[i, m + LIFT] * push + table[i, m + BASE] * base
            change += table[i, m + BASE_RATE] * base_rate + table[i, m + CONTACT] * f
            for j in range(m):
                change += table[i, j] * x[j]
            out[i] = change
        return
    for i in range(n):
        force = 0.0
        for j in range(n):
            force -= table[i, j] * x[j] + table[n + i, j] * x[n + j]
        mass = table[2 * n, i]
        if i == 0:
            force += p.ground_stiffness * base + p.ground_damping * base_rate
            if p.plain:
                force += lift + p.preload
            else:
                h = x[0] - p.frame.rest - base
                v = x[n] - base_rate
                force += frame_force(p.frame, h, v, lift) + p.preload
                force -= mass * p.frame.inertia_slope * (v - 0.5 * x[n]) * x[n]
                mass *= 1.0 + p.frame.inertia_slope * h
        if i == n - 1:
            force -= f
        out[i] = x[n + i]
        out[n + i] = force / mass


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def head_position(p: Pantograph, x: Array) -> float:
    """Place of the head in m of the state x (m,)."""
    return x[p.head]


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def head_velocity(p: Pantograph, x: Array) -> float:
    """Velocity of the head in m/s of the state x (m,)."""
    return x[p.head_rate]


def states(p: Pantograph) -> int:
    """Return the number m of states."""
    return p.states


def bodies(p: Pantograph) -> int:
    """Return the number of bodies whose motion is known: of a linear system that is the head alone."""
    return max(1, p.bodies)


def body_motion(p: Pantograph, x: Array) -> tuple[Array, Array]:
    """Return displacement in m and velocity in m/s of the bodies, frame first, head last."""
    if p.bodies:
        return x[: p.bodies].copy(), x[p.bodies :].copy()
    return x[:1].copy(), x[1:2].copy()
