"""Parameters of operating modes, limits and the drive's own motions; part of the node's parameters."""

from phil_base.parameters import Group, parameter
from test_rig_sim.trajectory import KINDS, LONGEST


class LimitParameters(Group):
    """Soft limits, and what trips the rig to the retract motion."""

    position: float = parameter("Largest reference position of either sign (cut)", unit="m", low=0.001, high=2.0)
    speed: float = parameter("Largest speed of the reference (cut)", unit="m/s", low=0.01, high=20.0)
    force: float = parameter("Contact force beyond which the rig warns", unit="N", low=1.0, high=1e5)
    current: float = parameter(
        "Effective current that the motor bears for ever; more trips, nine tenths warn", unit="A", low=0.1, high=1000.0
    )
    thermal_time: float = parameter("Time constant of the effective current", unit="s", low=0.1, high=1e4)
    reference_step: float = parameter(
        "Change of the reference within a cycle beyond which a command is refused", unit="m", low=1e-5, high=1.0
    )
    trip_position: float = parameter("Position of either sign that trips", unit="m", low=0.001, high=2.0)
    trip_speed: float = parameter("Speed of either sign that trips", unit="m/s", low=0.01, high=20.0)
    trip_force: float = parameter("Contact force that trips", unit="N", low=1.0, high=1e5)
    trip_saturation: int = parameter("Successive cycles at the current limit that trip", low=1, high=100000)


class RetractParameters(Group):
    """The motion to the safe position."""

    position: float = parameter("Safe position", unit="m", low=-2.0, high=2.0)
    speed: float = parameter("Largest speed", unit="m/s", low=0.001, high=5.0)
    acceleration: float = parameter("Largest acceleration", unit="m/s^2", low=0.01, high=200.0)
    braking: float = parameter("Deceleration from the speed at the trip", unit="m/s^2", low=0.1, high=1000.0)


class MotionParameters(Group):
    """The drive's own motions in the operating modes hold and position."""

    speed: float = parameter("Largest speed on the way to a trajectory's start", unit="m/s", low=0.001, high=5.0)
    acceleration: float = parameter("Largest acceleration, and braking", unit="m/s^2", low=0.01, high=200.0)
    entry_time: float = parameter(
        "Time for which commands are watched that follow a motion", unit="s", low=0.0, high=10.0
    )
    entry_acceleration: float = parameter("Largest acceleration during that time", unit="m/s^2", low=0.1, high=1000.0)


class TouchParameters(Group):
    """Soft start and soft landing of the contact."""

    gap: float = parameter("Distance between drive and head before and after", unit="m", low=0.0, high=0.5)
    speed: float = parameter("Speed of the drive towards the head", unit="m/s", low=0.0001, high=0.5)
    landing_speed: float = parameter("Speed of the drive away from the head", unit="m/s", low=0.0001, high=0.5)
    acceleration: float = parameter("Acceleration of both", unit="m/s^2", low=0.001, high=50.0)
    force: float = parameter("Contact force from which on they touch", unit="N", low=0.1, high=1000.0)
    cycles: int = parameter("Successive cycles for which the force has to say so", low=1, high=1000)
    lowest: float = parameter("Position at which the way down ends without contact", unit="m", low=-2.0, high=2.0)
    highest: float = parameter("Position at which the way up ends in contact", unit="m", low=-2.0, high=2.0)


class TrajectoryParameters(Group):
    """Trajectory of the operating mode position."""

    kind: str = parameter("Kind of trajectory", choices=KINDS)
    center: float = parameter("Position about which sine, chirp and steps go", unit="m", low=-2.0, high=2.0)
    amplitude: float = parameter("Amplitude of sine, chirp and steps", unit="m", low=0.0, high=2.0)
    frequency: float = parameter("Frequency; of a chirp at its start", unit="Hz", low=0.001, high=250.0)
    end_frequency: float = parameter("Frequency of a chirp at its end", unit="Hz", low=0.001, high=250.0)
    duration: float = parameter("Length of sine, chirp and steps", unit="s", low=0.01, high=LONGEST)
    fade: float = parameter("Time in which sine and chirp come and go", unit="s", low=0.0, high=60.0)
    file: str = parameter("CSV file with time (s) and position (m) in each line, at most an hour, for kind file")
