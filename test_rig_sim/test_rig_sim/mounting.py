"""The pantograph that the rig's parameters ask for, and whether the rig can carry it."""

from __future__ import annotations

import numpy as np

from test_rig_sim.car_body import CarBody
from test_rig_sim.pantographs import PANTOGRAPHS, Options, Pantograph
from test_rig_sim.pantographs.frame import Frame
from test_rig_sim.pantographs.motion import BASE, BASE_RATE, CONTACT
from test_rig_sim.rig_parameters import RigParameters

FASTEST = 1.5
"""Largest product of a pole and the integration step; Runge-Kutta of fourth order is stable up to 2.7."""


def mount(parameters: RigParameters) -> Pantograph:
    """Return the pantograph, not yet put at its nominal height. Raises ValueError, naming the parameter."""
    p = parameters
    values = p.nonlinear_frame.model_dump()
    coefficient = values.pop("aerodynamic_lift")
    frame = Frame(air=coefficient * (p.speed_kmh / 3.6) ** 2, **values)
    try:
        pantograph = PANTOGRAPHS[p.pantograph](Options(frame, p.pantograph_file))
    except ValueError as error:
        raise ValueError(f"parameter 'pantograph_file': {error}") from None
    _check(pantograph, p)
    return pantograph


def _check(pantograph: Pantograph, p: RigParameters) -> None:
    """Refuse a pantograph of a file that the rig would be unstable with, or that knows no car body but gets one."""
    if pantograph.bodies:
        return
    touching = pantograph.A.copy()
    touching[:, pantograph.head] += p.contact.stiffness * pantograph.B[:, CONTACT]
    poles = np.linalg.eigvals(touching)
    if poles.real.max() >= 0.0:
        raise ValueError(
            f"parameter 'pantograph_file': in contact (contact.stiffness = {p.contact.stiffness:g} N/m) the pantograph "
            f"is unstable, pole at {poles.real.max():.4g} 1/s"
        )
    fastest = max(float(np.abs(poles).max()), float(np.abs(np.linalg.eigvals(pantograph.A)).max()))
    if fastest * p.cycle_time / (p.inner_steps * p.substeps) > FASTEST:
        needed = int(np.ceil(fastest * p.cycle_time / p.inner_steps / FASTEST))
        raise ValueError(f"parameter 'pantograph_file': pole of {fastest:.4g} 1/s needs substeps = {needed} or more")
    moving = CarBody(p.car_body, p.cycle_time).moving
    if moving and not pantograph.B[:, [BASE, BASE_RATE]].any():
        raise ValueError(
            "parameter 'pantograph_file': the file says nothing of the car body ('base'), but car_body moves"
        )
