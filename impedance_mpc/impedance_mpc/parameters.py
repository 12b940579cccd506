"""Parameters of the impedance controller; the defaults are in config/impedance_mpc.yaml."""

from __future__ import annotations

from pydantic import model_validator
from typing_extensions import Self

from impedance_mpc.environment_parameters import EnvironmentParameters
from phil_base.parameters import Group, parameter
from phil_base.real_time import RealTime

CASCADED, INTEGRATED, CORRECTED = "cascaded", "integrated", "integrated_with_correction"

START = 0.0
"""m, where the drive stands when a ride begins."""


class Weights(Group):
    """Weights of the cost (3.55): the cost of one unit of error, an instant or a move."""

    position: float = parameter("Cost of the position error", unit="1/mm^2", low=0.0, high=1e6)
    velocity: float = parameter("Cost of the velocity error", unit="1/(mm/s)^2", low=0.0, high=1e6)
    momentum: float = parameter("Cost of the momentum error", unit="1/(N s)^2", low=0.0, high=1e6)
    correction_force: float = parameter("Cost of the correction force", unit="1/N^2", low=1e-9, high=1e6)
    reference_rate: float = parameter("Cost of a change of the reference", unit="1/(mm/cycle)^2", low=1e-9, high=1e6)
    correction_rate: float = parameter(
        "Cost of a change of the correction force", unit="1/(N/cycle)^2", low=0.0, high=1e6
    )
    softening: float = parameter(
        "Cost of breaking a limit of the drive by 1 mm (or 100 mm/s, or 0.1 mm of lead)",
        unit="1/mm^2",
        low=1.0,
        high=1e9,
    )


class Forecast(Group):
    """How the contact force is predicted."""

    kind: str = parameter(
        "constant: F_tr(k) as in the thesis; linear: by its rate; contact: head mass on the contact's stiffness",
        choices=("constant", "linear", "contact"),
    )
    stiffness: float = parameter("Measured stiffness k_c of the contact", unit="N/m", low=100.0, high=1e7)
    head_mass: float = parameter("Mass m_h that moves with the pantograph's head", unit="kg", low=0.1, high=100.0)
    noise: float = parameter("Standard deviation of one F_tr", unit="N", low=1e-3, high=100.0)
    load_noise: float = parameter(
        "Wandering of the unknown load on the head (contact)", unit="N/sqrt(s)", low=1.0, high=1e6
    )
    rate_noise: float = parameter("Wandering of the force's rate (linear)", unit="N/s/sqrt(s)", low=10.0, high=1e8)
    decay: float = parameter("Time in which the force's rate dies out (linear)", unit="s", low=1e-3, high=10.0)


class Parameters(Group):
    """All parameters of the node."""

    mode: str = parameter(
        "Clock of the ride, as in test_rig_sim: what is sent before cycle 0 is stamped with 0 (lockstep) or with the "
        "wall clock (realtime)",
        choices=("lockstep", "realtime"),
    )
    cycle_time: float = parameter("Cycle time Ts; has to be the step of the catenary", unit="s", low=1e-4, high=0.1)
    prediction_horizon: int = parameter("Predicted cycles Np", unit="1", low=2, high=200)
    control_horizon: int = parameter("Free moves Nc; later moves are held", unit="1", low=2, high=200)
    weights: Weights
    forecast: Forecast
    rig_natural_frequency_hz: float = parameter(
        "Natural frequency of the rig's closed position loop (PT2)", unit="Hz", low=1.0, high=1000.0
    )
    rig_damping_ratio: float = parameter("Damping ratio of the same loop", unit="1", low=0.05, high=5.0)
    rig_delay: float = parameter(
        "Dead time of the same loop behind its commands, whole cycles included",
        unit="s",
        low=0.0,
        high=0.02,
    )
    position_minimum: float = parameter("Lowest reference and position of the drive", unit="m", low=-5.0, high=5.0)
    position_maximum: float = parameter("Highest reference and position of the drive", unit="m", low=-5.0, high=5.0)
    velocity_limit: float = parameter("Largest speed of the drive", unit="m/s", low=0.01, high=50.0)
    acceleration_limit: float = parameter(
        "Largest acceleration of the drive: what its current limit leaves", unit="m/s^2", low=0.1, high=10000.0
    )
    constraint_stride: int = parameter("Cycles from one constraint on the drive to the next", unit="1", low=1, high=50)
    approach_time: float = parameter(
        "Time in which the drive goes to the wire's height at the start", unit="s", low=0.0, high=60.0
    )
    environment: str = parameter(
        "What the rig behaves like: the catenary, its reduced model alone, or a mass on spring and damper",
        choices=("catenary", "reduced", "mass_spring_damper"),
        live=True,
    )
    environments: EnvironmentParameters
    control: str = parameter(
        "cascaded: the wire's position is the reference; integrated: predictive, both models in one; "
        "integrated_with_correction: with the correction force F_cor",
        choices=(CASCADED, INTEGRATED, CORRECTED),
        live=True,
    )
    correction_book: str = parameter(
        "What F_cor keeps consistent: the sums of eq. (3.46), the work that was done, or the mean of both",
        choices=("sums", "work", "both"),
    )
    correction_tolerance: float = parameter("Energy error that is left alone", unit="J", low=0.0, high=1000.0)
    correction_alpha: float = parameter(
        "Slowest decay of the energy error a cycle, eq. (3.49)", unit="1", low=0.0, high=1.0
    )
    correction_cap: float = parameter("Largest correction force", unit="N", low=0.01, high=1000.0)
    correction_dead_zone: float = parameter(
        "Wire velocity below which eq. (3.49) is not enforced", unit="m/s", low=0.0, high=10.0
    )
    correction_rate_limit: float = parameter("Fastest change of the correction force", unit="N/s", low=1.0, high=1e7)
    correction_instantaneous_term: bool = parameter("Keep the instantaneous term in the bounds of eq. (3.49)")
    solver: str = parameter("Solver of the quadratic program", choices=("daqp", "proxqp"))
    qp_max_iterations: int = parameter(
        "Iterations of the solver (daqp: changes of the active set; proxqp: Newton steps) after which the plan of the "
        "cycle before is used",
        unit="1",
        low=1,
        high=10000,
    )
    qp_tolerance: float = parameter(
        "Violation of a constraint that counts as none: the change of the plan that would mend it (mm, N)",
        unit="1",
        low=1e-12,
        high=0.01,
    )
    model_timeout: float = parameter("Time to wait for the impedance model", unit="s", low=0.1, high=600.0)
    real_time: RealTime = parameter("What the process asks of the system")

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        if self.control_horizon > self.prediction_horizon:
            raise ValueError(
                f"'control_horizon' = {self.control_horizon} is longer than "
                f"'prediction_horizon' = {self.prediction_horizon}"
            )
        if self.position_minimum >= self.position_maximum:
            raise ValueError(
                f"'position_minimum' = {self.position_minimum} is not below "
                f"'position_maximum' = {self.position_maximum}"
            )
        if not self.position_minimum <= START <= self.position_maximum:
            raise ValueError(
                f"'position_minimum' = {self.position_minimum} to 'position_maximum' = {self.position_maximum}: has to "
                f"contain the drive's start, {START:g} m"
            )
        if not 0.0 < self.correction_alpha < 1.0:
            raise ValueError(f"'correction_alpha' = {self.correction_alpha} is not strictly between 0 and 1")
        return self
