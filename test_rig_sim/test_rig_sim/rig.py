"""The simulated rig as one object: reset it, advance it cycle by cycle, read its state."""

from collections import deque
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phil_base.held import Held, hold
from test_rig_sim import assembly, step
from test_rig_sim.load_cell import encode
from test_rig_sim.loads import Loads
from test_rig_sim.mounting import mount
from test_rig_sim.pantographs.motion import bodies, body_motion, head_position, states
from test_rig_sim.pantographs.statics import equilibrium, set_up
from test_rig_sim.rig_parameters import RigParameters

Array = npt.NDArray[np.float64]

FAR_ABOVE = 1.0
"""m, a drive that stands there touches no pantograph without lift."""


NOISE_AHEAD = 64
"""Cycles for which noise is drawn at once: the same numbers, for a tenth of the time."""


class RigSample(NamedTuple):
    """What the rig shows at t_k (the quantities of the message RigState), and what only a simulation knows."""

    w_tr: float  # m, encoder: slider against stator
    v_tr: float  # m/s, observer
    f_tr: float  # N, observer of the contact force
    f_raw: float  # N, load cell
    reference: float  # m, end of the last ramp that was accepted; it is reached `command_delay` cycles later
    current: float  # A, the one that acts
    work: float  # J, integral of f_tr v_tr
    impulse: float  # N s, integral of f_tr
    f_contact: float  # N, true contact force
    saturated: int  # 1, inner steps of the last cycle with the demand at the current limit
    w_true: float  # m, absolute position of the contact point
    v_true: float  # m/s, its velocity
    true_work: float  # J, integral of true contact force times true velocity
    true_impulse: float  # N s, integral of the true contact force


class Rig:
    """Drive with inner loop, pantograph, contact and load cell, sampled once a cycle.

    Starts at w_tr = 0 in static contact under the initial share of the uplift force. Two rigs with equal parameters
    and commands give equal numbers to the last bit. With contact=False head and drive pass through each other
    (identification of the inner loop). Raises ValueError for parameters that give no stable inner loop.
    """

    def __init__(self, parameters: RigParameters, contact: bool = True) -> None:
        p = parameters
        self.cycle_time = p.cycle_time
        self._bare = mount(p)
        self._held: Held | None = None
        self._contact_stiffness = p.contact.stiffness
        pantograph = set_up(self._bare, p.uplift_force, p.contact.stiffness)
        loop = assembly.loop_of(p)
        structure = assembly.structure_of(p, loop.weight_force)
        self.plant = step.Plant(
            drive=assembly.drive_of(p),
            structure=structure,
            pantograph=pantograph,
            contact=assembly.contact_of(p, contact),
            cell=assembly.cell_of(p),
            force=assembly.force_observer_of(p),
            loop=loop,
            encoder_resolution=assembly.resolution_of(p),
            inner_period=assembly.period_of(p),
            inner_steps=p.inner_steps,
            substeps=p.substeps,
        )
        self.bodies = bodies(pantograph)
        self._loads = Loads(p, pantograph.frame.air)
        self._noise_sigma = assembly.noise_of(p)
        self._seed = p.seed
        self._gap = p.touch.gap if p.start == "apart" else None
        self._lowest, self._highest = p.touch.lowest, p.touch.highest
        self._noise = np.zeros((NOISE_AHEAD, p.inner_steps))
        self._delay = p.command_delay
        self._waiting: deque[tuple[float, float]] = deque()
        self._body = 2 + 2 * structure.modes  # where the pantograph begins in the state
        filters, delay = loop.filter_input.size // 2, assembly.amplifier_of(p).delay
        self.memory = step.memory_for(states(pantograph), structure.modes, filters, delay)
        self.reset()

    def reset(self) -> None:
        """Go back to cycle 0: everything at rest, empty books, noise from the seed anew.

        The drive is in static contact at w_tr = 0, or (`start: apart`) it stands by the gap above a pantograph without
        lift. Raises ValueError if that one does not stand within reach of the drive.
        """
        self.cycle = 0
        self._random = np.random.default_rng(self._seed)
        memory = self.memory
        for array in memory:
            array.fill(0.0)
        state, estimate, signals = memory.state, memory.estimate, memory.signals
        self._load = self._loads.reset(lowered=self._gap is not None)
        pantograph = set_up(self._bare, self._loads.uplift_force, self._contact_stiffness)
        height = 0.0
        if self._gap is not None:
            state[self._body :] = equilibrium(pantograph, self._load.lift, self._contact_stiffness, FAR_ABOVE)
            height = head_position(pantograph, state[self._body :]) + self._gap
            if not self._lowest < height < self._highest:
                raise ValueError(f"start = apart: the head of the pantograph without lift stands {height:.3g} m high")
            state[0] = estimate[0] = height
            signals[step.W] = signals[step.REFERENCE] = encode(height, self.plant.encoder_resolution)
        state[self._body :] = equilibrium(pantograph, self._load.lift, self._contact_stiffness, height)
        pressed = self.plant.contact.stiffness * max(0.0, head_position(pantograph, state[self._body :]) - height)
        loop, bias = self.plant.loop, self.plant.cell.bias
        held = loop.weight_force - pressed
        structure = self.plant.structure._replace(rest_force=held)
        self.plant = self.plant._replace(pantograph=pantograph, structure=structure)
        self._waiting = deque([(height, height)] * self._delay)
        memory.queue[:] = held / loop.force_constant
        # The notches have let this feedforward pass for long; the feedback's filters have seen nothing.
        memory.filters[loop.filter_input.size :: 2] = held / loop.force_constant
        memory.cell[0] = pressed
        memory.force[0] = pressed + bias
        estimate[2] = -bias
        signals[step.F_CONTACT] = pressed
        signals[step.F_RAW] = signals[step.F_TR] = pressed + bias
        signals[step.CURRENT] = held / loop.force_constant
        signals[step.W_TRUE] = height

    def advance(self, u_start: float, u_end: float) -> None:
        """Run one cycle with the reference going linearly from u_start to u_end (m), `command_delay` cycles later."""
        accepted = u_end
        if self._delay:
            self._waiting.append((u_start, u_end))
            u_start, u_end = self._waiting.popleft()
        at = self.cycle % NOISE_AHEAD
        if at == 0:
            self._random.standard_normal(out=self._noise)
            self._noise *= self._noise_sigma
        self.cycle += 1
        start, self._load = self._load, self._loads.next()
        if self._held is None:
            self._held = hold(self._plant, self.memory)
        step.advance_held(self._held, self._noise[at], u_start, u_end, start, self._load)
        self.memory.signals[step.REFERENCE] = accepted

    @property
    def plant(self) -> step.Plant:
        """All constants; another plant takes effect with the next cycle."""
        return self._plant

    @plant.setter
    def plant(self, plant: step.Plant) -> None:
        self._plant = plant
        self._held = None

    @property
    def signals(self) -> Array:
        """What the rig shows at the present cycle, in the order of `RigSample`, (14,); `advance` overwrites it."""
        return self.memory.signals

    @property
    def state(self) -> RigSample:
        """What the rig shows at the present cycle."""
        shown = self.memory.signals.tolist()
        shown[step.SATURATED] = int(shown[step.SATURATED])
        return RigSample(*shown)

    def pantograph_state(self) -> tuple[Array, Array]:
        """Return displacement (n,) in m and velocity (n,) in m/s of the pantograph's bodies, frame first."""
        return body_motion(self.plant.pantograph, self.memory.state[self._body :])

    def lift_pantograph(self) -> None:
        """Let the whole lift of the pantograph come up within the run-in."""
        self._loads.lift_pantograph()

    def lower_pantograph(self) -> None:
        """Let the whole lift of the pantograph go within the run-in."""
        self._loads.lower_pantograph()

    def set_uplift_force(self, force: float) -> None:
        """Let the actuator go to another uplift force (N), in 0.2 s from the present cycle on; a reset keeps it."""
        self._loads.change_uplift_force(force)
