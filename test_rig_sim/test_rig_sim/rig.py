"""The simulated rig as one object: reset it, advance it cycle by cycle, read its state."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from test_rig_sim import inner_loop, step
from test_rig_sim.contact import Contact
from test_rig_sim.drive import Drive
from test_rig_sim.load_cell import load_cell, settle
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.pantographs.chain import operating_point, static_displacement
from test_rig_sim.parameters import Parameters

Array = npt.NDArray[np.float64]


class RigSample(NamedTuple):
    """What the rig shows at t_k (the quantities of the message RigState), and what only a simulation knows."""

    w_tr: float  # m, encoder
    v_tr: float  # m/s, observer
    f_tr: float  # N, load cell, low-passed
    f_raw: float  # N, load cell
    reference: float  # m
    current: float  # A
    work: float  # J, integral of f_raw v_tr
    impulse: float  # N s, integral of f_raw
    f_contact: float  # N, true contact force
    saturated: int  # 1, inner steps of the last cycle with the current at its limit


class Rig:
    """Drive with inner loop, pantograph, contact and load cell, sampled once a cycle.

    Starts at w_tr = 0 in static contact under the initial share of the uplift force. Two rigs with equal parameters
    and commands give equal numbers to the last bit. With contact=False head and drive pass through each other
    (identification of the inner loop). Raises ValueError for parameters that give no stable inner loop.
    """

    def __init__(self, parameters: Parameters, contact: bool = True) -> None:
        p = parameters
        self.cycle_time = p.cycle_time
        period = p.cycle_time / p.inner_steps
        drive = Drive(**p.drive.model_dump())
        loop = inner_loop.design(
            drive,
            inner_loop.Weights(**p.inner_loop.model_dump()),
            inner_loop.Noise(**p.observer.model_dump()),
            period,
        )
        cell = load_cell(p.load_cell.bias, p.load_cell.cut_off_hz, p.load_cell.damping, 1.0 / period)
        pantograph = PANTOGRAPHS[p.pantograph]()
        stiffness = p.contact.stiffness if contact else 0.0
        damping = p.contact.damping if contact else 0.0
        self.plant = step.Plant(
            drive=drive,
            pantograph=pantograph,
            contact=Contact(stiffness, damping),
            cell=cell,
            loop=loop,
            encoder_resolution=p.encoder_resolution,
            inner_period=period,
            inner_steps=p.inner_steps,
            substeps=p.substeps,
        )
        self.bodies = pantograph.mass.size
        self._uplift_force = p.uplift_force
        self._initial_share = p.initial_force_share
        self._run_in = p.run_in
        self._preload = operating_point(pantograph, p.uplift_force, p.contact.stiffness).preload
        self._start = static_displacement(pantograph, self._lift(0.0), p.contact.stiffness, 0.0)
        self._start_force = stiffness * max(0.0, float(self._start[-1]))
        self._noise_sigma = p.load_cell.noise
        self._seed = p.seed
        self._noise = np.zeros(p.inner_steps)
        self.memory = step.memory_for(self.bodies)
        self.reset()

    def reset(self) -> None:
        """Go back to cycle 0: drive at rest at w_tr = 0, static contact, empty books, noise from the seed anew."""
        self.cycle = 0
        self._random = np.random.default_rng(self._seed)
        state, estimate, _, signals, _ = self.memory
        for array in self.memory:
            array.fill(0.0)
        state[2 : 2 + self.bodies] = self._start
        force = self._start_force + self.plant.cell.bias
        settle(self.plant.cell, self.memory.filter, force)
        estimate[2] = -self.plant.cell.bias
        signals[step.F_CONTACT] = self._start_force
        signals[step.F_RAW] = signals[step.F_TR] = force
        loop = self.plant.loop
        signals[step.CURRENT] = (loop.weight_force - self._start_force) / loop.force_constant

    def advance(self, u_start: float, u_end: float) -> None:
        """Run one cycle with the reference going linearly from u_start to u_end (m)."""
        self._random.standard_normal(out=self._noise)
        self._noise *= self._noise_sigma
        start = self._lift(self.cycle * self.cycle_time)
        self.cycle += 1
        end = self._lift(self.cycle * self.cycle_time)
        step.advance(self.plant, self.memory, self._noise, u_start, u_end, start, end)

    @property
    def state(self) -> RigSample:
        """What the rig shows at the present cycle."""
        s = self.memory.signals.tolist()
        return RigSample(
            w_tr=s[step.W],
            v_tr=s[step.V],
            f_tr=s[step.F_TR],
            f_raw=s[step.F_RAW],
            reference=s[step.REFERENCE],
            current=s[step.CURRENT],
            work=s[step.WORK],
            impulse=s[step.IMPULSE],
            f_contact=s[step.F_CONTACT],
            saturated=int(s[step.SATURATED]),
        )

    def pantograph_state(self) -> tuple[Array, Array]:
        """Return displacement (n,) in m and velocity (n,) in m/s of the pantograph's bodies, frame first."""
        n = self.bodies
        return self.memory.state[2 : 2 + n].copy(), self.memory.state[2 + n :].copy()

    def _lift(self, t: float) -> float:
        """Force on the frame in N: uplift force, ramped by a half cosine over the run-in, and preload."""
        share = 1.0
        if t < self._run_in:
            share -= (1.0 - self._initial_share) * 0.5 * (1.0 + math.cos(math.pi * t / self._run_in))
        return share * self._uplift_force + self._preload
