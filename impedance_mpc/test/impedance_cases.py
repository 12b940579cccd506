"""One cycle of a controller of one mass, for tests."""

import numpy as np
from impedance_loop import MassSpringDamper

from impedance_mpc.controller import EnvironmentReading, ImpedanceController, RigReading
from impedance_mpc.parameters import Parameters
from phil_base.parameters import build, defaults

# A rig of round numbers and without dead time; the defaults are those of a rig that was identified.
RIG = {"rig_natural_frequency_hz": 40.0, "rig_damping_ratio": 0.8, "rig_delay": 0.0}
DEFAULTS = {**defaults("impedance_mpc"), **RIG}


def parameters(**changes):
    return build(Parameters, {**DEFAULTS, **{name.replace("__", "."): value for name, value in changes.items()}})


def mass_controller(**changes):
    """Controller of one mass; without the approach, so that the first cycle already follows the wire."""
    changes = {"approach_time": 0.0, **changes}
    return ImpedanceController(parameters(**changes), MassSpringDamper().impedance)


def environment(w_cat=0.0, v_cat=0.0, force=0.0, beyond=0.0, work=0.0, held=0.0):
    """The mass where the contact point is, or ``beyond`` (m) below it; ``held`` (N) keeps it there."""
    one = np.ones(1)
    state = ((w_cat - beyond) * one, v_cat * one, 0.0 * one, held * one)
    return EnvironmentReading(*state, w_cat, v_cat, force, work)


def call(controller, w_tr=0.0, v_tr=0.0, f_tr=0.0, w_cat=0.0, v_cat=0.0, reference=float("nan"), force=None, **more):
    """One cycle; without ``force`` the environment feels what the rig does."""
    where = environment(w_cat, v_cat, f_tr if force is None else force, **more)
    return controller.command(RigReading(w_tr, v_tr, f_tr, reference), where)
