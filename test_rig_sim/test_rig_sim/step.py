"""The real-time step of one cycle: inner control steps, drive, pantograph, contact and load cell in one kernel.

Method: classical Runge-Kutta of fourth order, `substeps` to an inner step of 0.2 ms. The stiffest parts are the head
and the drive on the contact spring (omega about 120 rad/s) and the smoothed Coulomb friction (rate about 150/s), so
omega h < 0.03 against the stability limit of 2.8, and the truncation error is far below the load cell's noise.
Runge-Kutta only loses energy at such steps (its amplification is below 1), so contact cannot create any. The current
is held over an inner step, as a digital amplifier does.

The compiled kernel is cached beside this file and knows only of changes in this file: after a change in a compiled
function of drive, contact, load_cell or inner_loop, delete `__pycache__` (or touch this file).
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from test_rig_sim.contact import Contact, contact_force
from test_rig_sim.drive import Drive, drive_acceleration
from test_rig_sim.inner_loop import InnerLoop, control_law, observe
from test_rig_sim.load_cell import LoadCell, encode, filter_step
from test_rig_sim.pantographs import Pantograph

Array = npt.NDArray[np.float64]

# Places in Memory.signals.
W, V, F_TR, F_RAW, REFERENCE, CURRENT, WORK, IMPULSE, F_CONTACT, SATURATED = range(10)
SIGNALS = 10


class Plant(NamedTuple):
    """All that the kernel is told once: constants of the rig and of its sampling."""

    drive: Drive
    pantograph: Pantograph
    contact: Contact
    cell: LoadCell
    loop: InnerLoop
    encoder_resolution: float  # m, 0: none
    inner_period: float  # s
    inner_steps: int  # 1, inner steps a cycle
    substeps: int  # 1, integration steps an inner step


class Memory(NamedTuple):
    """All that the kernel changes. n is the number of the pantograph's bodies."""

    state: Array  # (2 + 2n,): w, v of the drive, then q (n), then q' (n)
    estimate: Array  # (3,): w, v, d of the observer
    filter: Array  # (2,): low-pass of the load cell
    signals: Array  # (SIGNALS,): what the rig shows after the cycle, see W, V, ...
    scratch: Array  # (4, 2 + 2n): Runge-Kutta slopes and stage


def memory_for(bodies: int) -> Memory:
    """Return zeroed memory for a pantograph with that number of bodies."""
    size = 2 + 2 * bodies
    return Memory(np.zeros(size), np.zeros(3), np.zeros(2), np.zeros(SIGNALS), np.zeros((4, size)))


@njit(cache=True, fastmath=False)
def force_of(plant: Plant, state: Array) -> float:
    """Return the true contact force in N of a state (2 + 2n,)."""
    n = plant.pantograph.mass.size
    return contact_force(plant.contact, state[1 + n] - state[0], state[1 + 2 * n] - state[1])


@njit(cache=True, fastmath=False)
def slope(plant: Plant, state: Array, current: float, frame_force: float, out: Array) -> None:
    """Write the rate of change of the state (2 + 2n,) to out: (3.42) and the chain with its one-sided contact.

    current in A; frame_force in N is all that lifts the pantograph's frame.
    """
    pantograph = plant.pantograph
    n = pantograph.mass.size
    f = force_of(plant, state)
    out[0] = state[1]
    out[1] = drive_acceleration(plant.drive, state[0], state[1], current, f)
    for i in range(n):
        force = 0.0
        for j in range(n):
            force -= pantograph.stiffness[i, j] * state[2 + j] + pantograph.damping[i, j] * state[2 + n + j]
        if i == 0:
            force += frame_force
        if i == n - 1:
            force -= f
        out[2 + i] = state[2 + n + i]
        out[2 + n + i] = force / pantograph.mass[i]


@njit(cache=True, fastmath=False)
def integrate(
    plant: Plant, state: Array, scratch: Array, current: float, frame_force: float, h: float, steps: int
) -> None:
    """Move the state (2 + 2n,) on by steps Runge-Kutta steps of h (s), in place; scratch is (4, 2 + 2n)."""
    size = state.size
    total = scratch[0]
    rate = scratch[1]
    stage = scratch[2]
    for _ in range(steps):
        slope(plant, state, current, frame_force, rate)
        for i in range(size):
            total[i] = rate[i]
            stage[i] = state[i] + 0.5 * h * rate[i]
        slope(plant, stage, current, frame_force, rate)
        for i in range(size):
            total[i] += 2.0 * rate[i]
            stage[i] = state[i] + 0.5 * h * rate[i]
        slope(plant, stage, current, frame_force, rate)
        for i in range(size):
            total[i] += 2.0 * rate[i]
            stage[i] = state[i] + h * rate[i]
        slope(plant, stage, current, frame_force, rate)
        for i in range(size):
            state[i] += h / 6.0 * (total[i] + rate[i])


@njit(cache=True, fastmath=False)
def advance(
    plant: Plant, memory: Memory, noise: Array, u_start: float, u_end: float, lift_start: float, lift_end: float
) -> None:
    """Run one cycle: inner_steps times control law, motion, measurement, observer, books. Changes memory in place.

    The reference goes linearly from u_start to u_end (m), the force on the frame from lift_start to lift_end (N).
    noise (inner_steps,) in N is added to the load cell. The reference of an inner step is the ramp's value in its
    middle, so holding it costs no delay. Work and impulse are trapezoidal sums of f_raw v_tr and f_raw.
    """
    signals = memory.signals
    estimate = memory.estimate
    state = memory.state
    h = plant.inner_period
    saturated = 0
    for j in range(plant.inner_steps):
        share = (j + 0.5) / plant.inner_steps
        reference = u_start + share * (u_end - u_start)
        lift = lift_start + share * (lift_end - lift_start)
        current = control_law(plant.loop, estimate, reference, signals[F_TR])
        if abs(current) >= plant.loop.current_limit:
            saturated += 1
        integrate(plant, state, memory.scratch, current, lift, h / plant.substeps, plant.substeps)

        before_raw = signals[F_RAW]
        before_v = signals[V]
        before_tr = signals[F_TR]
        signals[F_CONTACT] = force_of(plant, state)
        signals[F_RAW] = signals[F_CONTACT] + plant.cell.bias + noise[j]
        signals[F_TR] = filter_step(plant.cell, memory.filter, signals[F_RAW])
        signals[W] = encode(state[0], plant.encoder_resolution)
        # The mean of both ends of the step is the force that acted during it.
        observe(plant.loop, estimate, current, 0.5 * (before_tr + signals[F_TR]), signals[W])
        signals[V] = estimate[1]
        signals[CURRENT] = current
        signals[WORK] += 0.5 * h * (before_raw * before_v + signals[F_RAW] * signals[V])
        signals[IMPULSE] += 0.5 * h * (before_raw + signals[F_RAW])
    signals[REFERENCE] = u_end
    signals[SATURATED] = saturated
