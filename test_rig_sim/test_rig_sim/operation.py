"""Operation of the rig from its parameters: checks what belongs together, and builds the supervisor."""

import math
import sys

from test_rig_sim import trajectory
from test_rig_sim.inner_loop import InnerLoop
from test_rig_sim.limits import Limits
from test_rig_sim.motion import Pace, Response
from test_rig_sim.retract import Retract
from test_rig_sim.rig_parameters import RigParameters
from test_rig_sim.supervisor import Rules, Supervisor
from test_rig_sim.touch import Touch


def available_acceleration(p: RigParameters) -> float:
    """Return the acceleration in m/s^2 that the current limit leaves in the harder direction.

    Upwards the weight is in the way, downwards the static contact force, less the weight.
    """
    drive = p.drive
    in_the_way = max(drive.gravity, p.uplift_force / drive.mass - drive.gravity)
    return drive.force_constant * drive.current_limit / drive.mass - in_the_way


def check(p: RigParameters) -> None:
    """Refuse limits and motions that contradict each other or ask the drive for more than it has.

    Raises
    ------
    ValueError
        The text names the keys.
    """
    limits, touch = p.limits, p.touch
    for name in ("position", "speed", "force"):
        soft, trip = getattr(limits, name), getattr(limits, f"trip_{name}")
        if trip < soft:
            raise ValueError(f"limits.trip_{name} = {trip} must be at least limits.{name} = {soft}")
    for key, value in (
        ("retract.position", p.retract.position),
        ("touch.lowest", touch.lowest),
        ("touch.highest", touch.highest),
    ):
        if abs(value) > limits.position:
            raise ValueError(f"{key} = {value} must lie within limits.position = {limits.position}")
    if touch.lowest >= touch.gap or touch.gap >= touch.highest:
        raise ValueError(
            f"touch.gap = {touch.gap} must lie between touch.lowest = {touch.lowest} "
            f"and touch.highest = {touch.highest}"
        )
    available = available_acceleration(p)
    for key, value in (
        ("retract.braking", p.retract.braking),
        ("retract.acceleration", p.retract.acceleration),
        ("motion.acceleration", p.motion.acceleration),
        ("motion.entry_acceleration", p.motion.entry_acceleration),
        ("touch.acceleration", touch.acceleration),
    ):
        if value > available:
            raise ValueError(f"{key} = {value} m/s^2 is more than the drive can do: {available:.3g} m/s^2")
    for key, value in (("motion.speed", p.motion.speed), ("retract.speed", p.retract.speed)):
        if value > limits.speed:
            raise ValueError(f"{key} = {value} m/s must not be above limits.speed = {limits.speed}")


def rules(p: RigParameters, loop: InnerLoop) -> Rules:
    """Return all that the supervisor has to know; ``loop`` says how the drive answers to its reference.

    Raises
    ------
    ValueError
        The trajectory cannot be read, or asks for more than drive and limits allow; the text names the keys.
    """
    pace = Pace(p.motion.speed, p.motion.acceleration)
    shape = trajectory.Shape(**p.trajectory.model_dump())
    positions = trajectory.sample(shape, pace, p.cycle_time)
    ability = trajectory.Ability(p.limits.position, p.limits.speed, available_acceleration(p))
    trajectory.check(positions, shape, ability, p.cycle_time)
    stiffness = loop.position_gain * p.drive.force_constant / p.drive.mass
    return Rules(
        period=p.cycle_time,
        late_limit=p.late_limit,
        limits=Limits(**p.limits.model_dump()),
        retract=Retract(**p.retract.model_dump()),
        touch=Touch(**p.touch.model_dump()),
        pace=pace,
        entry_cycles=round(p.motion.entry_time / p.cycle_time),
        entry_acceleration=p.motion.entry_acceleration,
        response=Response(loop.velocity_gain / loop.position_gain, stiffness),
        trajectory=positions,
    )


def supervisor_for(p: RigParameters, found: Rules, reference: float = 0.0) -> Supervisor:
    """Return a supervisor at cycle 0 of a drive that stands at reference (m)."""
    return Supervisor(found, p.operating_mode, reference, touching=p.start == "in_contact")


def unlimited(found: Rules) -> Rules:
    """Return the rules of a drive that follows each command as it is, for studies of what limits would have done."""
    limits = Limits(
        position=math.inf,
        speed=math.inf,
        force=math.inf,
        current=math.inf,
        reference_step=math.inf,
        trip_position=math.inf,
        trip_speed=math.inf,
        trip_force=math.inf,
        trip_saturation=sys.maxsize,
        thermal_time=found.limits.thermal_time,
    )
    return found._replace(limits=limits, late_limit=sys.maxsize, entry_cycles=0)
