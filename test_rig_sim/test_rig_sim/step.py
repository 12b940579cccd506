"""The real-time step of one cycle: inner control steps, drive, pantograph, contact and load cell in one kernel.

Method: classical Runge-Kutta of fourth order, `substeps` to an inner step of 0.2 ms. Stiff are the head and the drive
on the contact spring (omega about 120 rad/s), the modes of the structure (some 100 Hz) and above all the smoothed dry
friction, whose rate F_s / (m v_0) is up to 1000/s: omega h < 0.1 against the stability limit of 2.8. Runge-Kutta only
loses energy at such steps (its amplification is below 1), so contact cannot create any. The current is held over an
inner step, as a digital amplifier does. The load cell is far faster (12000 rad/s): it is sampled exactly instead.

The compiled kernel is kept between runs by a digest of the sources of all packages that it uses (`phil_base.kernels`):
with any change in a file of theirs it is compiled anew.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phil_base.held import Held
from phil_base.kernels import njit
from test_rig_sim.contact import Contact, contact_force
from test_rig_sim.drive import Drive, drive_acceleration, stator_force
from test_rig_sim.force_observer import ForceObserver, observe_force
from test_rig_sim.inner_loop import InnerLoop, control_law, observe
from test_rig_sim.load_cell import LoadCell, cell_input, encode, sense
from test_rig_sim.pantographs.motion import Load, Pantograph, head_position, head_velocity, rate
from test_rig_sim.structure import Structure, mode_acceleration

Array = npt.NDArray[np.float64]

# Places in Memory.signals.
W, V, F_TR, F_RAW, REFERENCE, CURRENT, WORK, IMPULSE, F_CONTACT, SATURATED = range(10)
W_TRUE, V_TRUE, TRUE_WORK, TRUE_IMPULSE = range(10, 14)
SIGNALS = 14


class Mechanics(NamedTuple):
    """The constants of all that moves, out of a `Plant`, which does instead of it but for speed.

    Compiled code counts references to every array in a tuple that it hands on; handing the whole plant on in the
    innermost functions would cost more than the mechanics themselves.
    """

    drive: Drive
    structure: Structure
    pantograph: Pantograph
    contact: Contact


class Plant(NamedTuple):
    """All that the kernel is told once: constants of the rig and of its sampling."""

    drive: Drive
    structure: Structure
    pantograph: Pantograph
    contact: Contact
    cell: LoadCell
    force: ForceObserver
    loop: InnerLoop
    encoder_resolution: float  # m, 0: none
    inner_period: float  # s
    inner_steps: int  # 1, inner steps a cycle
    substeps: int  # 1, integration steps an inner step


class Memory(NamedTuple):
    """All that the kernel changes. n is the number of modes, m that of the pantograph's states, f that of filters."""

    state: Array  # (2 + 2n + m,): absolute w, v of the slider, q (n) and q' (n) of the structure, x_p of the pantograph
    estimate: Array  # (3,): w, v, d of the observer
    filters: Array  # (4 f,): filters of the inner loop
    queue: Array  # (delay + 1,): demands in A, from the one that acts to the newest one
    cell: Array  # (2,): load cell
    force: Array  # (2,): force and its rate of the force observer
    signals: Array  # (SIGNALS,): what the rig shows after the cycle, see W, V, ...
    scratch: Array  # (3, 2 + 2n + m): Runge-Kutta slopes and stage


def memory_for(states: int, modes: int = 0, filters: int = 0, delay: int = 0) -> Memory:
    """Return zeroed memory for that many states of the pantograph, modes, filters, and inner steps of delay."""
    size = 2 + 2 * modes + states
    return Memory(
        state=np.zeros(size),
        estimate=np.zeros(3),
        filters=np.zeros(4 * filters),
        queue=np.zeros(delay + 1),
        cell=np.zeros(2),
        force=np.zeros(2),
        signals=np.zeros(SIGNALS),
        scratch=np.zeros((3, size)),
    )


@njit(cache=True, fastmath=False, forceinline=True)
def force_of(mechanics: Mechanics, state: Array) -> float:
    """Return the true contact force in N of a state (2 + 2n + m,)."""
    p, x = mechanics.pantograph, state[2 + 2 * mechanics.structure.modes :]
    return contact_force(mechanics.contact, head_position(p, x) - state[0], head_velocity(p, x) - state[1])


@njit(cache=True, fastmath=False, forceinline=True)
def stator_of(mechanics: Mechanics, state: Array) -> tuple[float, float]:
    """Return place (m) and velocity (m/s) of the stator: the sums of the structure's modes."""
    n = mechanics.structure.modes
    place = 0.0
    speed = 0.0
    for j in range(n):
        place += state[2 + j]
        speed += state[2 + n + j]
    return place, speed


@njit(cache=True, fastmath=False, forceinline=True)
def plate_acceleration(mechanics: Mechanics, state: Array, current: float, contact: float) -> float:
    """Return the absolute acceleration in m/s^2 of slider and contact plate for current (A) and contact force (N)."""
    place, speed = stator_of(mechanics, state)
    push = stator_force(mechanics.drive, state[0] - place, state[1] - speed, current)
    return drive_acceleration(mechanics.drive, push, contact)


@njit(cache=True, fastmath=False, forceinline=True)
def slope(mechanics: Mechanics, state: Array, current: float, load: Load, out: Array) -> None:
    """Write the rate of change of the state (2 + 2n + m,) to out.

    That is (3.42), the structure, and the pantograph with its one-sided contact. current in A; load is what acts on the
    pantograph beside the contact.
    """
    n = mechanics.structure.modes
    f = force_of(mechanics, state)
    place, speed = stator_of(mechanics, state)
    push = stator_force(mechanics.drive, state[0] - place, state[1] - speed, current)
    out[0] = state[1]
    out[1] = drive_acceleration(mechanics.drive, push, f)
    for j in range(n):
        out[2 + j] = state[2 + n + j]
        out[2 + n + j] = mode_acceleration(mechanics.structure, j, state[2 + j], state[2 + n + j], push)
    first = 2 + 2 * n
    rate(mechanics.pantograph, state[first:], load.lift, load.base, load.base_rate, f + load.knock, out[first:])


@njit(cache=True, fastmath=False, forceinline=True)
def integrate(
    mechanics: Mechanics, state: Array, scratch: Array, current: float, load: Load, h: float, steps: int
) -> None:
    """Move the state (2 + 2n + m,) on by steps Runge-Kutta steps of h (s), in place; scratch is (3, 2 + 2n + m)."""
    size = state.size
    total = scratch[0]
    change = scratch[1]
    stage = scratch[2]
    for _ in range(steps):
        slope(mechanics, state, current, load, change)
        for i in range(size):
            total[i] = change[i]
            stage[i] = state[i] + 0.5 * h * change[i]
        slope(mechanics, stage, current, load, change)
        for i in range(size):
            total[i] += 2.0 * change[i]
            stage[i] = state[i] + 0.5 * h * change[i]
        slope(mechanics, stage, current, load, change)
        for i in range(size):
            total[i] += 2.0 * change[i]
            stage[i] = state[i] + h * change[i]
        slope(mechanics, stage, current, load, change)
        for i in range(size):
            state[i] += h / 6.0 * (total[i] + change[i])


@njit(cache=True, fastmath=False, forceinline=True)
def load_between(start: Load, end: Load, share: float, period: float) -> Load:
    """Return the load at a share (1) of a cycle of that period (s).

    Forces go in a straight line. The car body follows the cubic through place and rate of both ends, so its rate is the
    rate of its place at every instant, and both are continuous from cycle to cycle.
    """
    step = end.base - start.base
    s0, s1 = period * start.base_rate, period * end.base_rate
    a2 = 3.0 * step - 2.0 * s0 - s1
    a3 = s0 + s1 - 2.0 * step
    return Load(
        start.lift + share * (end.lift - start.lift),
        start.base + share * (s0 + share * (a2 + share * a3)),
        (s0 + share * (2.0 * a2 + share * 3.0 * a3)) / period,
        start.knock + share * (end.knock - start.knock),
    )


@njit(cache=True, fastmath=False, forceinline=True)
def move(plant: Plant, memory: Memory, current: float, load: Load) -> float:
    """Run one inner step of the motion under a held current (A) and load; return what the load cell shows (N).

    The true work and impulse of the contact are trapezoidal sums over the integration steps.
    """
    mechanics = Mechanics(plant.drive, plant.structure, plant.pantograph, plant.contact)
    state, signals = memory.state, memory.signals
    h = plant.inner_period / plant.substeps
    contact = signals[F_CONTACT]
    # The current has just changed, and with it the acceleration.
    inner = cell_input(plant.cell, contact, plate_acceleration(mechanics, state, current, contact))
    shown = 0.0
    for _ in range(plant.substeps):
        power = contact * state[1]
        before, inner_before = contact, inner
        integrate(mechanics, state, memory.scratch, current, load, h, 1)
        contact = force_of(mechanics, state)
        inner = cell_input(plant.cell, contact, plate_acceleration(mechanics, state, current, contact))
        shown = sense(plant.cell, memory.cell, inner_before, inner)
        signals[TRUE_WORK] += 0.5 * h * (power + contact * state[1])
        signals[TRUE_IMPULSE] += 0.5 * h * (before + contact)
    signals[F_CONTACT] = contact
    return shown


@njit(cache=True, fastmath=False)
def advance(
    plant: Plant, memory: Memory, noise: Array, u_start: float, u_end: float, load_start: Load, load_end: Load
) -> None:
    """Run one cycle: inner_steps times control law, motion, measurement, observers, books. Changes memory in place.

    The reference goes linearly from u_start to u_end (m), the load from load_start to load_end (`load_between`).
    noise (inner_steps,) in N is added to the load cell. The reference of an inner step is the ramp's value in its
    middle, so holding it costs no delay. Work and impulse are trapezoidal sums of f_tr v_tr and f_tr.
    """
    signals = memory.signals
    estimate = memory.estimate
    h = plant.inner_period
    saturated = 0
    for j in range(plant.inner_steps):
        share = (j + 0.5) / plant.inner_steps
        reference = u_start + share * (u_end - u_start)
        load = load_between(load_start, load_end, share, h * plant.inner_steps)
        demand = control_law(plant.loop, estimate, memory.filters, memory.queue, reference, signals[F_TR])
        if abs(demand) >= plant.loop.current_limit:
            saturated += 1
        current = memory.queue[0]
        before_f = signals[F_TR]
        before_v = signals[V]
        signals[F_RAW] = move(plant, memory, current, load) + plant.cell.bias + noise[j]
        signals[F_TR] = observe_force(plant.force, memory.force, signals[F_RAW])
        signals[W] = encode(memory.state[0] - stator_of(plant, memory.state)[0], plant.encoder_resolution)
        # The mean of both ends of the step is the force that acted during it.
        observe(plant.loop, estimate, current, 0.5 * (before_f + signals[F_TR]), signals[W])
        signals[V] = estimate[1]
        signals[CURRENT] = current
        signals[WORK] += 0.5 * h * (before_f * before_v + signals[F_TR] * signals[V])
        signals[IMPULSE] += 0.5 * h * (before_f + signals[F_TR])
    signals[W_TRUE] = memory.state[0]
    signals[V_TRUE] = memory.state[1]
    signals[REFERENCE] = u_end
    signals[SATURATED] = saturated


@njit(cache=True, fastmath=False)
def advance_held(held: Held, noise: Array, u_start: float, u_end: float, load_start: Load, load_end: Load) -> None:
    """Run one cycle of the plant and the memory that are held (`phil_base.held.hold`), see `advance`."""
    advance(held.constants, held.state, noise, u_start, u_end, load_start, load_end)
