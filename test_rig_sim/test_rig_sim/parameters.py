"""Parameters of the simulated rig; their defaults are in config/test_rig_sim.yaml."""

from pydantic import model_validator

from phil_node.parameters import Group, parameter
from test_rig_sim.pantographs import PANTOGRAPHS


class DriveParameters(Group):
    """Constants of the linear drive, eq. (3.42)."""

    mass: float = parameter("Slider with contact plate", unit="kg", low=0.1, high=200.0)
    force_constant: float = parameter("Force constant K_f of the motor", unit="N/A", low=0.1, high=1000.0)
    current_limit: float = parameter("Largest current of either sign", unit="A", low=0.1, high=1000.0)
    gravity: float = parameter("Acceleration of gravity", unit="m/s^2", low=0.0, high=20.0)
    coulomb_friction: float = parameter("Coulomb friction", unit="N", low=0.0, high=500.0)
    friction_speed: float = parameter(
        "Speed over which the Coulomb friction builds up", unit="m/s", low=0.001, high=1.0
    )
    viscous_friction: float = parameter("Viscous friction", unit="N s/m", low=0.0, high=1000.0)
    cogging_amplitude: float = parameter("Amplitude of the cogging force", unit="N", low=0.0, high=500.0)
    cogging_period: float = parameter("Period of the cogging force", unit="m", low=0.001, high=1.0)


class InnerLoopParameters(Group):
    """Weights of the inner loop's LQR."""

    position_weight: float = parameter("Weight of the position error", unit="1/m^2", low=1e-6, high=1e12)
    velocity_weight: float = parameter("Weight of the velocity", unit="s^2/m^2", low=0.0, high=1e9)
    current_weight: float = parameter("Weight of the current", unit="1/A^2", low=1e-9, high=1e6)


class ObserverParameters(Group):
    """Noise that the Kalman filter of the inner loop assumes; their ratio sets its speed."""

    disturbance_noise: float = parameter("Random walk of the unknown force", unit="N/sqrt(s)", low=1e-3, high=1e6)
    position_noise: float = parameter("Noise of one encoder sample", unit="m", low=1e-10, high=1e-2)


class LoadCellParameters(Group):
    """The force measurement."""

    noise: float = parameter("Standard deviation of one sample", unit="N", low=0.0, high=100.0)
    bias: float = parameter("Constant error", unit="N", low=-100.0, high=100.0)
    cut_off_hz: float = parameter("Cut-off of the second-order low-pass", unit="Hz", low=1.0, high=1e5)
    damping: float = parameter("Damping ratio of the low-pass", unit="1", low=0.1, high=2.0)


class ContactParameters(Group):
    """The one-sided contact between head and drive."""

    stiffness: float = parameter("Stiffness", unit="N/m", low=1e3, high=5e5)
    damping: float = parameter("Damping", unit="N s/m", low=0.0, high=1e3)


class LimitParameters(Group):
    """When commands are refused and when the rig trips to the retract motion."""

    position: float = parameter("Largest reference position of either sign", unit="m", low=0.001, high=2.0)
    reference_step: float = parameter("Largest change of the reference within a cycle", unit="m", low=1e-5, high=1.0)
    trip_position: float = parameter("Position of either sign that trips", unit="m", low=0.001, high=2.0)
    trip_speed: float = parameter("Speed of either sign that trips", unit="m/s", low=0.01, high=20.0)
    trip_force: float = parameter("Contact force that trips", unit="N", low=1.0, high=1e5)
    trip_saturation: int = parameter("Successive cycles at the current limit that trip", low=1, high=100000)


class RetractParameters(Group):
    """The motion to the safe position."""

    position: float = parameter("Safe position", unit="m", low=-2.0, high=2.0)
    speed: float = parameter("Largest speed", unit="m/s", low=0.001, high=5.0)
    acceleration: float = parameter("Largest acceleration", unit="m/s^2", low=0.01, high=200.0)


class Parameters(Group):
    """All parameters of the node test_rig_sim."""

    mode: str = parameter(
        "lockstep: waits for each command; realtime: ticks on the wall clock", choices=("lockstep", "realtime")
    )
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
    pantograph: str = parameter("Kind of pantograph", choices=tuple(PANTOGRAPHS))
    uplift_force: float = parameter(
        "Static force on the frame, the contact force at nominal height", unit="N", low=1.0, high=1000.0
    )
    run_in: float = parameter("Time in which the uplift force rises to its value", unit="s", low=0.0, high=60.0)
    initial_force_share: float = parameter("Share of the uplift force at cycle 0", unit="1", low=0.0, high=1.0)
    encoder_resolution: float = parameter("Step of the position encoder, 0: none", unit="m", low=0.0, high=1e-3)
    drive: DriveParameters = parameter("Linear drive")
    inner_loop: InnerLoopParameters = parameter("Inner position loop")
    observer: ObserverParameters = parameter("Disturbance observer")
    load_cell: LoadCellParameters = parameter("Load cell")
    contact: ContactParameters = parameter("Contact")
    limits: LimitParameters = parameter("Limits")
    retract: RetractParameters = parameter("Retract motion")

    @model_validator(mode="after")
    def _check(self) -> "Parameters":
        if self.limits.trip_position < self.limits.position:
            raise ValueError(
                f"limits.trip_position = {self.limits.trip_position} must be at least "
                f"limits.position = {self.limits.position}"
            )
        if abs(self.retract.position) > self.limits.position:
            raise ValueError(
                f"retract.position = {self.retract.position} must lie within limits.position = {self.limits.position}"
            )
        half_rate = 0.5 * self.inner_steps / self.cycle_time
        if self.load_cell.cut_off_hz >= half_rate:
            raise ValueError(
                f"load_cell.cut_off_hz = {self.load_cell.cut_off_hz} must be below "
                f"inner_steps / (2 cycle_time) = {half_rate:g} Hz"
            )
        if self.drive.force_constant * self.drive.current_limit <= self.drive.mass * self.drive.gravity:
            raise ValueError(f"drive.current_limit = {self.drive.current_limit:g} cannot carry drive.mass")
        return self
