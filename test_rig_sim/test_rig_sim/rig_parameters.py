"""What the simulated rig is made of, and what of that contradicts itself; `parameters` asks whether it can be built."""

from pydantic import model_validator

from phil_base.parameters import Group, parameter
from phil_base.real_time import RealTime
from test_rig_sim.operation_parameters import (
    LimitParameters,
    MotionParameters,
    RetractParameters,
    TouchParameters,
    TrajectoryParameters,
)
from test_rig_sim.pantograph_parameters import CarBodyParameters, EventParameters, NonlinearFrameParameters
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.structure import MAX_MODES
from test_rig_sim.supervisor import OPERATIONS


class Imperfections(Group):
    """What distinguishes a real rig from an ideal one; each can be switched off, its numbers then do not matter."""

    friction: bool = parameter("Coulomb, static and viscous friction of the drive")
    cogging: bool = parameter("Cogging force of the drive")
    current_limit: bool = parameter("Limit of the motor current")
    current_slew: bool = parameter("Limit of the motor current's rate of change")
    delay: bool = parameter("Delay between current demand and force")
    encoder: bool = parameter("Steps of the position encoder")
    structure: bool = parameter("Resonances of the supporting structure; without them it is rigid")
    load_cell_noise: bool = parameter("Noise of the load cell")
    load_cell_bias: bool = parameter("Constant error of the load cell")
    load_cell_dynamics: bool = parameter("Limited bandwidth of the load cell")
    load_cell_inertia: bool = parameter("Inertia of the contact plate in the load cell's reading")


class DriveParameters(Group):
    """Constants of the linear drive, eq. (3.42)."""

    mass: float = parameter("Slider with contact plate", unit="kg", low=0.1, high=200.0)
    force_constant: float = parameter("Force constant K_f of the motor", unit="N/A", low=0.1, high=1000.0)
    current_limit: float = parameter("Largest current of either sign", unit="A", low=0.1, high=1000.0)
    current_slew: float = parameter("Fastest change of the current", unit="A/s", low=100.0, high=1e7)
    delay: int = parameter("Inner steps between current demand and force", low=0, high=20)
    gravity: float = parameter("Acceleration of gravity", unit="m/s^2", low=0.0, high=20.0)
    coulomb_friction: float = parameter("Coulomb friction, of the moving slider", unit="N", low=0.0, high=500.0)
    static_friction: float = parameter(
        "Static friction at the edge of motion (Stribeck), at least the Coulomb friction", unit="N", low=0.0, high=500.0
    )
    stribeck_speed: float = parameter(
        "Speed over which static friction falls to Coulomb friction", unit="m/s", low=0.001, high=1.0
    )
    friction_speed: float = parameter("Speed over which dry friction builds up", unit="m/s", low=0.001, high=1.0)
    viscous_friction: float = parameter("Viscous friction", unit="N s/m", low=0.0, high=1000.0)
    cogging_amplitude: float = parameter("First harmonic of the cogging force", unit="N", low=0.0, high=500.0)
    cogging_second: float = parameter("Second harmonic of the cogging force", unit="N", low=0.0, high=500.0)
    cogging_period: float = parameter("Period of the first harmonic", unit="m", low=0.001, high=1.0)


class StructureParameters(Group):
    """Modes of the structure that carries the stator; one entry of each list a mode."""

    frequencies_hz: list[float] = parameter("Natural frequencies", unit="Hz", low=1.0, high=1000.0)
    damping_ratios: list[float] = parameter("Damping ratios", unit="1", low=0.0, high=1.0)
    modal_masses: list[float] = parameter("Modal masses, for unit motion of the stator", unit="kg", low=1.0, high=1e6)


class InnerLoopParameters(Group):
    """The inner loop's LQR: weights, and filters (3.43) that keep frequencies out of the current."""

    position_weight: float = parameter("Weight of the position error", unit="1/m^2", low=1e-6, high=1e12)
    velocity_weight: float = parameter("Weight of the velocity", unit="s^2/m^2", low=0.0, high=1e9)
    current_weight: float = parameter("Weight of the current", unit="1/A^2", low=1e-9, high=1e6)
    frequency_weighting: bool = parameter("Frequency weighting of the current (3.43) on")
    filter_frequencies_hz: list[float] = parameter("Frequencies kept out of the current", unit="Hz", low=1.0, high=1e3)
    filter_damping_ratios: list[float] = parameter(
        "Damping factors of the filters: the less, the deeper and the narrower", unit="1", low=1e-4, high=1.0
    )
    filter_weights: list[float] = parameter(
        "Weights of the filters' outputs over current_weight", unit="1", low=1e-6, high=1e6
    )


class ObserverParameters(Group):
    """Noise that the Kalman filter of the inner loop assumes; their ratio sets its speed."""

    disturbance_noise: float = parameter("Random walk of the unknown force", unit="N/sqrt(s)", low=1e-3, high=1e6)
    position_noise: float = parameter("Noise of one encoder sample", unit="m", low=1e-10, high=1e-2)


class LoadCellParameters(Group):
    """The force measurement, between slider and contact plate."""

    noise: float = parameter("Standard deviation of one sample", unit="N", low=0.0, high=100.0)
    bias: float = parameter("Constant error", unit="N", low=-100.0, high=100.0)
    bandwidth_hz: float = parameter("Natural frequency of the sensor", unit="Hz", low=10.0, high=1e5)
    damping: float = parameter("Damping ratio of the sensor", unit="1", low=0.05, high=2.0)
    plate_mass: float = parameter("Mass between cell and contact", unit="kg", low=0.0, high=100.0)
    compensation: float = parameter("Share of the plate's inertia force that is taken off", unit="1", low=0.0, high=2.0)


class ForceObserverParameters(Group):
    """The observer of the contact force: low-pass without lag for slow signals."""

    bandwidth_hz: float = parameter("Natural frequency", unit="Hz", low=1.0, high=5000.0)
    damping: float = parameter("Damping ratio", unit="1", low=0.3, high=5.0)
    cell_lag: float = parameter(
        "Known lag of the load cell, 2 damping / (2 pi bandwidth), that is made up for", unit="s", low=0.0, high=0.01
    )


class ContactParameters(Group):
    """The one-sided contact between head and drive."""

    stiffness: float = parameter("Stiffness", unit="N/m", low=1e3, high=5e5)
    damping: float = parameter("Damping", unit="N s/m", low=0.0, high=1e3)


class RigParameters(Group):
    """All parameters of the rig, each in its range and those that belong together in agreement."""

    mode: str = parameter(
        "lockstep: waits for each command; realtime: ticks on the wall clock", choices=("lockstep", "realtime")
    )
    operating_mode: str = parameter(
        "hold: the drive stays; position: it follows a trajectory; impedance: it follows the commands",
        choices=OPERATIONS,
        live=True,
    )
    start: str = parameter(
        "in_contact: the head touches the drive at cycle 0; apart: the drive comes down to it",
        choices=("in_contact", "apart"),
    )
    land_at_end: bool = parameter("Land softly after the duration of the ride; the ride ends when the drive rests")
    duration: float = parameter("Length of the ride, 0: endless", unit="s", low=0.0, high=1e6)
    seed: int = parameter("Seed of the measurement noise", low=0, high=2**31 - 1)
    wait_for_subscribers: int = parameter("Listeners to the state before cycle 0", low=0, high=100)
    cycle_time: float = parameter("Cycle time Ts", unit="s", low=1e-4, high=0.1)
    inner_steps: int = parameter("Inner control steps a cycle", low=1, high=1000)
    substeps: int = parameter("Integration steps an inner step", low=1, high=100)
    catch_up: int = parameter("Most cycles made up at once after a late tick (realtime)", low=1, high=100)
    late_limit: int = parameter(
        "Successive cycles without a usable command after which the rig retracts", low=1, high=100000
    )
    view_decimation: int = parameter("Cycles from one viewing message to the next", low=1, high=10000)
    speed_kmh: float = parameter("Speed of the train, as in catenary_model", unit="km/h", low=0.0, high=400.0)
    pantograph: str = parameter("Kind of pantograph", choices=tuple(PANTOGRAPHS))
    pantograph_file: str = parameter("Path of the file of the pantograph `state_space`, empty: the shipped example")
    uplift_force: float = parameter(
        "Static force on the frame, the contact force at nominal height at rest; a change takes 0.2 s",
        unit="N",
        low=1.0,
        high=1000.0,
        live=True,
    )
    run_in: float = parameter("Time in which the uplift force rises to its value", unit="s", low=0.0, high=60.0)
    initial_force_share: float = parameter("Share of the uplift force at cycle 0", unit="1", low=0.0, high=1.0)
    encoder_resolution: float = parameter("Step of the position encoder, 0: none", unit="m", low=0.0, high=1e-3)
    command_delay: int = parameter("Cycles by which every command acts later", low=0, high=5)
    imperfections: Imperfections = parameter("Imperfections")
    drive: DriveParameters = parameter("Linear drive")
    structure: StructureParameters = parameter("Supporting structure")
    inner_loop: InnerLoopParameters = parameter("Inner position loop")
    observer: ObserverParameters = parameter("Disturbance observer")
    load_cell: LoadCellParameters = parameter("Load cell")
    force_observer: ForceObserverParameters = parameter("Observer of the contact force")
    contact: ContactParameters = parameter("Contact")
    limits: LimitParameters = parameter("Limits")
    retract: RetractParameters = parameter("Retract motion")
    motion: MotionParameters = parameter("The drive's own motions")
    touch: TouchParameters = parameter("Soft start and landing")
    trajectory: TrajectoryParameters = parameter("Trajectory")
    nonlinear_frame: NonlinearFrameParameters = parameter("Frame of the pantograph `nonlinear`")
    car_body: CarBodyParameters = parameter("Motion of the car body")
    events: EventParameters = parameter("Sudden events")
    real_time: RealTime = parameter("What the process asks of the system")

    @model_validator(mode="after")
    def _check(self) -> "RigParameters":
        period = self.cycle_time / self.inner_steps
        if self.force_observer.bandwidth_hz >= 0.2 / period:
            raise ValueError(
                f"force_observer.bandwidth_hz = {self.force_observer.bandwidth_hz} must be below a fifth of the inner "
                f"rate, {0.2 / period:g} Hz"
            )
        drive = self.drive
        if drive.force_constant * drive.current_limit <= drive.mass * drive.gravity:
            raise ValueError(f"drive.current_limit = {drive.current_limit:g} cannot carry drive.mass")
        if drive.static_friction < drive.coulomb_friction:
            raise ValueError(
                f"drive.static_friction = {drive.static_friction:g} must be at least "
                f"drive.coulomb_friction = {drive.coulomb_friction:g}"
            )
        stiffest = drive.static_friction / (drive.mass * drive.friction_speed) * period / self.substeps
        if stiffest > 1.0:
            raise ValueError(
                f"drive.friction_speed = {drive.friction_speed:g} is too small for the integration step: dry friction "
                f"changes by {stiffest:.2g} of the slider's momentum within one"
            )
        _equally_many("structure", self.structure.model_dump())
        filters = self.inner_loop.model_dump()
        _equally_many("inner_loop", {name: value for name, value in filters.items() if isinstance(value, list)})
        if max(self.inner_loop.filter_frequencies_hz) >= 0.2 / period:
            raise ValueError(f"inner_loop.filter_frequencies_hz must be below {0.2 / period:g} Hz")
        if len(self.structure.modal_masses) > MAX_MODES:
            raise ValueError(f"structure: at most {MAX_MODES} modes")
        return self


def _equally_many(group: str, lists: dict[str, list[float]]) -> None:
    counts = {len(entries) for entries in lists.values()}
    if len(counts) > 1:
        said = ", ".join(f"{group}.{name} has {len(entries)}" for name, entries in lists.items())
        raise ValueError(f"these need equally many entries: {said}")
