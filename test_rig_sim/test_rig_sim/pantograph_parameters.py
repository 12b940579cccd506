"""Parameters of the pantograph and of what happens to it; their defaults are in config/test_rig_sim.yaml."""

from pydantic import model_validator

from phil_base.parameters import Group, parameter
from test_rig_sim.pantographs.frame import bellows_volume


class NonlinearFrameParameters(Group):
    """Laws on the frame of the pantograph `nonlinear`; each is switched off by a zero."""

    aerodynamic_lift: float = parameter(
        "Quasi-static lift by the air flow on the frame, over the square of the speed",
        unit="N s^2/m^2",
        low=0.0,
        high=0.1,
    )
    friction: float = parameter("Coulomb friction of the joints, 0: no friction", unit="N", low=0.0, high=200.0)
    breakaway: float = parameter(
        "Friction of slow motion (Stribeck), counts where above the Coulomb friction", unit="N", low=0.0, high=200.0
    )
    stribeck_speed: float = parameter(
        "Speed over which the breakaway force goes to the Coulomb friction", unit="m/s", low=1e-3, high=10.0
    )
    friction_speed: float = parameter("Speed over which the friction builds up", unit="m/s", low=1e-3, high=1.0)
    stop_stiffness: float = parameter("Stiffness of the end stops, 0: no stops", unit="N/m", low=0.0, high=1e6)
    stop_damping: float = parameter("Damping of the end stops", unit="N s/m", low=0.0, high=1e4)
    lower_stop: float = parameter("Lower stop, from the nominal height", unit="m", low=-2.0, high=0.0)
    upper_stop: float = parameter("Upper stop, from the nominal height", unit="m", low=0.0, high=2.0)
    area: float = parameter(
        "Area of the bellows reduced to the frame's body, 0: force of the actuator independent of height",
        unit="m^2",
        low=0.0,
        high=0.1,
    )
    area_slope: float = parameter("Change of that area with height (leverage)", unit="m", low=-0.1, high=0.1)
    volume: float = parameter("Volume of bellows and pipes at nominal height", unit="m^3", low=1e-5, high=1.0)
    exponent: float = parameter("Polytropic exponent: 1 isothermal, 1.4 adiabatic", unit="1", low=1.0, high=1.7)
    inertia_slope: float = parameter(
        "Relative change of the frame's effective mass with height", unit="1/m", low=-1.0, high=1.0
    )

    @model_validator(mode="after")
    def _check(self) -> "NonlinearFrameParameters":
        ends = (self.lower_stop, self.upper_stop)
        if min(self.area + self.area_slope * h for h in ends) < 0.0:
            raise ValueError("area and area_slope must give an area above 0 between the stops")
        if min(bellows_volume(self.volume, self.area, self.area_slope, h) for h in ends) < 0.1 * self.volume:
            raise ValueError("volume must be so large that a tenth of it is left at either stop")
        if min(1.0 + self.inertia_slope * h for h in ends) < 0.1:
            raise ValueError("inertia_slope must leave a tenth of the frame's mass at either stop")
        return self


class CarBodyParameters(Group):
    """Motion of the car body under the pantograph: two harmonics and a low-pass random part, each 0: none."""

    bounce_amplitude: float = parameter("Amplitude of the bounce, 0: none", unit="m", low=0.0, high=0.2)
    bounce_frequency_hz: float = parameter("Frequency of the bounce", unit="Hz", low=0.05, high=20.0)
    pitch_amplitude: float = parameter("Amplitude of the pitch at the pantograph, 0: none", unit="m", low=0.0, high=0.2)
    pitch_frequency_hz: float = parameter("Frequency of the pitch", unit="Hz", low=0.05, high=20.0)
    random_rms: float = parameter("Rms of the random part, 0: none", unit="m", low=0.0, high=0.1)
    random_cut_off_hz: float = parameter(
        "Corner of the random part's third-order low-pass", unit="Hz", low=0.05, high=20.0
    )
    seed: int = parameter("Seed of the random part", low=0, high=2**31 - 1)


class EventParameters(Group):
    """Sudden events during a ride; a time of 0 means: not."""

    pressure_time: float = parameter(
        "Time at which the actuator's pressure changes, 0: never", unit="s", low=0.0, high=1e6
    )
    pressure_share: float = parameter("Share of the uplift force it changes to", unit="1", low=0.0, high=2.0)
    pressure_ramp: float = parameter("Time that the change takes", unit="s", low=0.01, high=60.0)
    pressure_return_time: float = parameter("Time at which it changes back, 0: never", unit="s", low=0.0, high=1e6)
    knock_time: float = parameter("Time at which the head is knocked down, 0: never", unit="s", low=0.0, high=1e6)
    knock_impulse: float = parameter("Impulse of the knock", unit="N s", low=0.0, high=50.0)
    knock_duration: float = parameter("Duration of the knock", unit="s", low=0.004, high=1.0)

    @model_validator(mode="after")
    def _check(self) -> "EventParameters":
        if 0.0 < self.pressure_return_time < self.pressure_time + self.pressure_ramp:
            raise ValueError(
                f"pressure_return_time = {self.pressure_return_time:g} must not be before pressure_time + pressure_ramp"
                f" = {self.pressure_time + self.pressure_ramp:g} s"
            )
        return self
