"""One ride of the closed loop, or of the same pantograph coupled to the same catenary without any rig.

Both start at the same track position with the same static force law, so that their samples belong together. The rig's
pantograph is lifted by share(t) times its static force, and by the preload that stands for the rest position of its
frame's spring; the share comes up as (1 - cos)/2 within `RUN_IN` on both sides. The direct coupling applies it to the
preload as well, and the drive first has to go to the wire: two rides that differ by a newton or two in the first two
seconds differ by a twentieth of that at 5 s and by a hundredth at 10 s (320 km/h; half of it at 160).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.mpc_split import timed_solver
from catenary_model.build import build as build_catenary
from catenary_model.pantograph import Pantograph
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.ride import ride
from impedance_mpc.parts import PARTS
from impedance_mpc.solver import DAQP
from phil_base.parameters import build
from phil_loop import ClosedLoop, Moment, resolve
from phil_loop.resolution import Settings
from test_rig_sim.limits import Guard, Limits, Measurement
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.pantographs.statics import set_up
from test_rig_sim.parameters import Parameters as RigParameters

Array = NDArray[np.float64]

RUN_IN = 2.0
"""Time within which the static force comes up, s."""
BEYOND = 1.0
"""A drive that is further away than this (m) has left the loop: the ride is ended there."""
SLOWER, SOFTER = 0.7, 0.675
"""Natural frequency of the slow rig over that of its model (as identified), and the factor in its weights for that."""
VARIANTS = ("", "delayed", "slower")
"""What is done to a rig: nothing, one more cycle of delay, 30 % slower than its model."""
CASCADED, INTEGRATED, CORRECTED = CONTROLS = ("cascaded", "integrated", "integrated_with_correction")
SHORT = {CASCADED: "cascaded", INTEGRATED: "integrated", CORRECTED: "corrected"}
"""Controls, and how tables call them."""


@dataclass(frozen=True)
class Case:
    """What is ridden: speed in km/h, names of pantograph, rig and control, and what is done to the rig (`VARIANTS`)."""

    speed: int
    pantograph: str
    rig: str = "nominal"
    control: str = CORRECTED
    variant: str = ""
    solver: str = field(default=DAQP, compare=False)
    """Solver of the controller; the figures are to be the same with each."""

    @property
    def at(self) -> tuple[int, str]:
        """Speed (km/h) and pantograph: what the coupling without a rig depends on."""
        return self.speed, self.pantograph

    def __str__(self) -> str:
        parts = (f"{self.speed} km/h", self.pantograph, self.rig, self.variant, SHORT[self.control])
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class Direct:
    """The coupling without a rig; each array (cycles,), entry k at t_k, entry 0 that of cycle 1."""

    ts: float
    """Cycle time, s."""
    w: Array
    """Height of the contact point, m."""
    v: Array
    """Its velocity, m/s."""
    f: Array
    """Contact force, N."""
    track: Array
    """Track position, m."""


@dataclass(frozen=True)
class Record:
    """What happened in a ride of the closed loop; each array (cycles,), entry k at t_k or the command of cycle k."""

    ts: float
    """Cycle time, s."""
    w: Array
    """True position of the contact point on the rig, m."""
    v: Array
    """Its true velocity, m/s."""
    f: Array
    """True contact force, N."""
    v_tr: Array
    """Velocity that the rig shows, m/s."""
    f_tr: Array
    """Force that the rig shows, N."""
    work: Array
    """Work that the rig shows, J."""
    impulse: Array
    """Impulse that the rig shows, N s."""
    true_work: Array
    """Work that was done on the rig, J."""
    true_impulse: Array
    """Impulse that was given to the rig, N s."""
    w_cat: Array
    """Height of the wire, m."""
    v_cat: Array
    """Its velocity, m/s."""
    f_cat: Array
    """Force on the wire, N."""
    work_cat: Array
    """Work that was done on the wire, J."""
    impulse_cat: Array
    """Impulse that was given to the wire, N s."""
    track: Array
    """Track position, m."""
    f_cor: Array
    """Correction force, N."""
    delta_e: Array
    """Energy error by the controller's own book, J."""
    delta_p: Array
    """Momentum error by the controller's own book, N s."""
    iterations: Array
    """Iterations of the quadratic program."""
    fallbacks: Array
    """Cycles answered without a solution so far."""
    program: Array
    """Time that the quadratic program took, s."""
    controller: Array
    """Time that the controller took for the whole cycle, s."""
    left: float | None
    """Time at which the drive was further away than `BEYOND`, or a number was not finite, s; None: never."""
    tripped: float | None
    """Time at which the rig's limits would have ended the ride, s; None: never."""
    reason: str
    """Why they would have."""

    @property
    def cycles(self) -> int:
        """Length of the ride."""
        return int(self.w.size)


def settings_of(case: Case) -> Settings:
    """Give all parameters of a case."""
    changes: dict[str, dict[str, Any]] = {
        "catenary_model": {"speed_kmh": float(case.speed)},
        "impedance_mpc": {"control": case.control, "solver": case.solver},
        "test_rig_sim": {"pantograph": case.pantograph, "run_in": RUN_IN, "initial_force_share": 0.0},
    }
    settings = resolve(None, changes, case.rig)
    rig, control = settings["test_rig_sim"], settings["impedance_mpc"]
    if case.variant == VARIANTS[1]:
        changes["test_rig_sim"]["command_delay"] = rig["command_delay"] + 1
        changes["impedance_mpc"]["rig_delay"] = control["rig_delay"] + control["cycle_time"]
    elif case.variant == VARIANTS[2]:
        # A double integrator under LQR: omega^4 ~ position weight, (zeta omega)^2 ~ velocity weight; the filters of the
        # current and the delays, which stay as they are, take a little of it.
        for name, power in (("position_weight", 4), ("velocity_weight", 2)):
            changes["test_rig_sim"][f"inner_loop.{name}"] = SOFTER**power * rig[f"inner_loop.{name}"]
    return resolve(None, changes, case.rig)


def rider(settings: Settings) -> Pantograph:
    """Give the pantograph of a rig as the catenary's model takes it: same masses, same static force law."""
    rig = build(RigParameters, settings["test_rig_sim"])
    chain = set_up(PANTOGRAPHS[rig.pantograph](), rig.uplift_force, rig.contact.stiffness)
    lift = rig.uplift_force + chain.preload
    return Pantograph.of(chain.mass, chain.damping, chain.stiffness, lift, rig.contact.stiffness)


def direct(case: Case, duration: float) -> Direct:
    """Ride `duration` s without a rig."""
    settings = settings_of(case)
    catenary = build_catenary(build(CatenaryParameters, settings["catenary_model"]).config())
    record = ride(catenary, rider(settings), duration, RUN_IN)
    if catenary.unsettled_steps:
        raise RuntimeError(f"{case}: {catenary.unsettled_steps} steps have no consistent slack state")
    return Direct(catenary.config.cycle_time, record.w, record.v, record.F, record.track)


class Watch:
    """Observes a ride: notes when the rig's limits would have ended it, ends it when the drive has left the loop."""

    def __init__(self, settings: Settings, cycles: int, took: list[int], told: Callable[[float], None]) -> None:
        """Watch so many cycles; ``took`` has the time of the newest quadratic program, ns; `told` hears the share."""
        rig = build(RigParameters, settings["test_rig_sim"])
        self._guard = Guard(Limits(**rig.limits.model_dump()), rig.cycle_time)
        self._inner_steps = rig.inner_steps
        self._cycles, self._took, self._told = cycles, took, told
        self.program: list[int] = []
        self.last = cycles
        self.tripped: int | None = None
        self.reason = ""

    def __call__(self, moment: Moment) -> None:
        """Look at a cycle."""
        rig, k = moment.rig, moment.cycle
        self.program.append(self._took[0])
        self._took[0] = 0
        if abs(rig.w_true) > BEYOND:
            self.last = k
            moment.loop.stop()
            return
        if not self.reason:
            whole = rig.saturated >= self._inner_steps
            self.reason = self._guard.check(Measurement(rig.w_tr, rig.v_tr, rig.f_tr, rig.current, whole))
            self.tripped = k if self.reason else None
        if k % 500 == 499:
            self._told((k + 1) / self._cycles)


def watched(settings: Settings, cycles: int, told: Callable[[float], None] = lambda _: None) -> Record:
    """Ride, until the end or until the drive is further away than `BEYOND`; `told` hears the share done.

    The rig's limits end nothing, they are only watched.
    """
    ts, took = float(settings["test_rig_sim"]["cycle_time"]), [0]
    watch = Watch(settings, cycles, took, told)
    loop = ClosedLoop(settings, observers=[watch], limits=False, parts=PARTS._replace(solver=timed_solver(took)))
    ride = loop.begin(0.0, timed=True)
    ride.run(cycles)
    found, last = ride.record(), min(watch.last, ride.cycle)
    rig, true, wire, command, books = found.rig, found.true, found.wire, found.command, found.books
    assert found.times is not None
    columns = {
        "w": true.w_true, "v": true.v_true, "f": true.f_contact, "v_tr": rig.v_tr, "f_tr": rig.f_tr,
        "work": rig.work, "impulse": rig.impulse, "true_work": true.true_work, "true_impulse": true.true_impulse,
        "w_cat": wire.w_cat, "v_cat": wire.v_cat, "f_cat": wire.f_cat,
        "work_cat": wire.work, "impulse_cat": wire.impulse, "track": wire.track_position,
        "f_cor": command.f_cor, "delta_e": books.delta_e, "delta_p": books.delta_p,
        "iterations": command.iterations.astype(np.float64), "fallbacks": command.fallbacks.astype(np.float64),
        "program": 1e-9 * np.array(watch.program, dtype=np.float64), "controller": found.times.controller,
    }  # fmt: skip
    return Record(
        ts,
        **{name: column[:last] for name, column in columns.items()},
        left=None if last == cycles else last * ts,
        tripped=None if watch.tripped is None else watch.tripped * ts,
        reason=watch.reason,
    )


def closed_loop(case: Case, duration: float, told: Callable[[float], None] = lambda _: None) -> Record:
    """Ride `duration` s with a rig."""
    settings = settings_of(case)
    return watched(settings, round(duration / settings["test_rig_sim"]["cycle_time"]), told)
