"""Parameters of the monitor; their defaults are in config/energy_monitor.yaml."""

from pydantic import model_validator

from energy_monitor.limits import chosen
from phil_base.parameters import Group, parameter
from phil_base.real_time import RealTime


class ContactParameters(Group):
    """How the contact force is evaluated (EN 50317)."""

    run_in: float = parameter("Start of the ride that the statistics leave out", unit="s", low=0.0, high=600.0)
    loss_threshold: float = parameter(
        "Measured force at or below which contact is lost; above the noise of the load cell",
        unit="N",
        low=0.0,
        high=50.0,
    )
    loss_duration: float = parameter(
        "Shortest loss of contact that counts; arcs count from 0.005 s on (TSI ENE with EN 50317, as commonly quoted)",
        unit="s",
        low=0.0,
        high=1.0,
    )
    cutoff: float = parameter("Cut-off of the low-pass; 20 Hz in EN 50317", unit="Hz", low=1.0, high=200.0)
    order: int = parameter(
        "Order of the causal Butterworth low-pass; EN 50317 leaves it open", unit="1", low=1, high=10
    )


class ToleranceParameters(Group):
    """How far the controller's books may be from the monitor's."""

    energy: float = parameter("Difference of dE", unit="J", low=0.0, high=1000.0, live=True)
    momentum: float = parameter("Difference of dp", unit="N s", low=0.0, high=1000.0, live=True)
    relative: float = parameter(
        "Difference in addition, as a share of what was exchanged", unit="1", low=0.0, high=1.0, live=True
    )


class LimitsParameters(Group):
    """What the contact force is held against."""

    file: str = parameter("Table of limits; empty: config/contact_force_limits.yaml of the package")
    standard: str = parameter("Name of the standard in the table")


class Parameters(Group):
    """All parameters of the node energy_monitor."""

    mode: str = parameter(
        "Clock of the ride, as in test_rig_sim: what is sent before cycle 0 is stamped with 0 (lockstep) or with the "
        "wall clock (realtime)",
        choices=("lockstep", "realtime"),
    )
    cycle_time: float = parameter(
        "Cycle time Ts, the same as of rig, controller and catenary", unit="s", low=1e-4, high=0.1
    )
    window: int = parameter(
        "Later cycles of a stream after which one that it has left out counts as missing", unit="1", low=2, high=100000
    )
    age_limit: float = parameter(
        "Age of the newest complete cycle above which a ride counts as stalled",
        unit="s",
        low=0.01,
        high=3600.0,
        live=True,
    )
    books_decimation: int = parameter("Cycles from one published book to the next", unit="1", low=1, high=10000)
    quality_decimation: int = parameter(
        "Cycles from one published contact quality to the next", unit="1", low=1, high=10000
    )
    contact: ContactParameters = parameter("Evaluation of the contact force")
    tolerance: ToleranceParameters = parameter("Tolerance between two books")
    limits: LimitsParameters = parameter("Limits of the contact force")
    real_time: RealTime = parameter("What the process asks of the system")

    @model_validator(mode="after")
    def _low_pass_is_possible(self) -> "Parameters":
        highest = 0.5 / self.cycle_time
        if self.contact.cutoff >= highest:
            raise ValueError(
                f"'contact.cutoff' = {self.contact.cutoff:g} Hz has to be below half the cycle rate "
                f"1 / 'cycle_time', {highest:g} Hz"
            )
        return self

    def check_build(self) -> None:
        """Read the table of limits. Raises ValueError."""
        chosen(self.limits.file, self.limits.standard)
