"""The whole inner loop as one linear system at the inner rate: what the design leaves out is in it.

Drive with viscous friction, structure, load cell with its plate, force observer, disturbance observer, filters, delay:
everything of the kernel but dry friction, cogging, limits, steps of the encoder. Nothing is written down twice: the
matrices are the answers of the kernel's own functions to unit vectors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from test_rig_sim import assembly
from test_rig_sim.force_observer import observe_force
from test_rig_sim.inner_loop import control_law, observe
from test_rig_sim.load_cell import load_cell, sense
from test_rig_sim.parameters import Parameters

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

W, V, STATOR, CURRENT, DEMAND, F_TR = range(6)
"""Rows of `LinearLoop.output`: slider against stator (m), its rate (m/s), the stator's place (m), the current that acts
and the one that is demanded (A), the observer's force (N)."""
REFERENCE, FORCE, DISTURBANCE = range(3)
"""Columns of `LinearLoop.input`: reference (m), force (N) that the load cell shows, and one that it does not."""


@dataclass(frozen=True)
class LinearLoop:
    """x(k+1) = transition x(k) + input u(k) + ahead u(k+1), y(k) = output x(k), period in s.

    The reference is held over a step, forces go in straight lines, as they do in the simulation.
    """

    transition: Array
    input: Array
    ahead: Array
    output: Array
    period: float

    def response(self, frequencies_hz: Array, column: int, row: int) -> Complex:
        """Return the complex gain from an input to an output at frequencies in Hz."""
        identity, found = np.eye(self.transition.shape[0]), []
        for z in np.exp(2j * math.pi * np.asarray(frequencies_hz) * self.period):
            entry = self.input[:, column] + z * self.ahead[:, column]
            found.append(self.output[row] @ np.linalg.solve(z * identity - self.transition, entry))
        return np.array(found, dtype=np.complex128)

    @property
    def radius(self) -> float:
        """Spectral radius: below 1 if the loop is stable."""
        return float(np.abs(np.linalg.eigvals(self.transition)).max())


def linear_loop(parameters: Parameters, viscous_friction: float | None = None) -> LinearLoop:
    """Return the closed inner loop of the rig without a pantograph.

    viscous_friction in N s/m replaces that of the drive in the plant alone, not in the design: the slope of the dry
    friction at rest, for instance. Raises ValueError if the design itself is not stable.
    """
    p = parameters
    loop = assembly.loop_of(p)._replace(weight_force=0.0, current_limit=math.inf, current_step=math.inf)
    drive, body, observer = assembly.drive_of(p), assembly.structure_of(p, 0.0), assembly.force_observer_of(p)
    cell_parameters = p.load_cell
    kept = assembly.cell_of(p)
    bandwidth = cell_parameters.bandwidth_hz if p.imperfections.load_cell_dynamics else 0.0
    cell = load_cell(kept.plate_mass, 0.0, bandwidth, cell_parameters.damping, assembly.period_of(p))
    friction = drive.viscous_friction if viscous_friction is None else viscous_friction
    n, delay = body.modes, assembly.amplifier_of(p).delay

    # Motion: (w, v, q, q') absolute; inputs current and outer force.
    size = 2 + 2 * n
    relative = np.zeros(size)
    relative[0], relative[2 : 2 + n] = 1.0, -1.0
    speed = np.zeros(size)
    speed[1], speed[2 + n :] = 1.0, -1.0
    a, b = np.zeros((size, size)), np.zeros((size, 2))
    a[0, 1] = 1.0
    a[1] = -friction / drive.mass * speed
    b[1] = drive.force_constant / drive.mass, 1.0 / drive.mass
    for j in range(n):
        a[2 + j, 2 + n + j] = 1.0
        a[2 + n + j] = friction / body.mass[j] * speed
        a[2 + n + j, 2 + j] -= body.stiffness[j]
        a[2 + n + j, 2 + n + j] -= body.damping[j]
        b[2 + n + j, 0] = -drive.force_constant / body.mass[j]
    # Current held, outer force from one value to the next: the last state is its change per step.
    generator = np.zeros((size + 3, size + 3))
    generator[:size, :size], generator[:size, size : size + 2] = a, b
    generator *= assembly.period_of(p)
    generator[size + 1, size + 2] = 1.0
    moved = expm(generator)[:size]

    parts = np.cumsum([size, 2, 2, 3, 2 * loop.filter_input.size, delay + 1])

    def step(x: Array, before: Array, after: Array) -> Array:
        """Give the state after a step in which the inputs (3,) go from before to after."""
        y = x.copy()
        motion, sensed, force, estimate, filters, queue = np.split(y, parts[:-1])
        f_before = force[0] + observer.lag * force[1]
        control_law(loop, estimate, filters, queue, float(before[REFERENCE]), f_before)
        outer = before[FORCE] + before[DISTURBANCE], after[FORCE] + after[DISTURBANCE]
        # The load cell has the plate's inertia, and of the outer forces the contact's alone.
        push = before[FORCE] - cell.plate_mass * (a[1] @ motion + b[1] @ [queue[0], outer[0]])
        motion[:] = moved @ np.concatenate([motion, [queue[0], outer[0], outer[1] - outer[0]]])
        pull = after[FORCE] - cell.plate_mass * (a[1] @ motion + b[1] @ [queue[0], outer[1]])
        f_after = observe_force(observer, force, sense(cell, sensed, float(push), float(pull)))
        observe(loop, estimate, queue[0], 0.5 * (f_before + f_after), float(relative @ motion))
        return y

    total = int(parts[-1])
    still, nothing = np.zeros(total), np.zeros(3)
    transition = np.column_stack([step(unit, nothing, nothing) for unit in np.eye(total)])
    entry = np.column_stack([step(still, unit, nothing) for unit in np.eye(3)])
    ahead = np.column_stack([step(still, nothing, unit) for unit in np.eye(3)])
    output = np.zeros((6, total))
    output[W, :size] = relative
    output[V, :size] = speed
    output[STATOR, :size] = [0.0, 0.0] + [1.0] * n + [0.0] * n
    output[CURRENT, parts[-2]] = 1.0
    output[DEMAND, parts[-1] - 1] = 1.0
    output[F_TR, parts[1] : parts[2]] = 1.0, observer.lag
    return LinearLoop(transition, entry, ahead, output, assembly.period_of(p))
