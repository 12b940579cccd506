"""Where a pantograph stands at rest: its operating point, and its equilibrium under a drive of any height."""

import math

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from test_rig_sim.pantographs.frame import frame_force
from test_rig_sim.pantographs.motion import CONTACT, LIFT, Pantograph

Array = npt.NDArray[np.float64]

REACH = 10.0
"""m, farther than this from its nominal height no pantograph stands."""
STRONGEST = 1e6
"""N, no actuator lifts a pantograph with more."""


def set_up(p: Pantograph, lift: float, contact_stiffness: float) -> Pantograph:
    """Return the pantograph put at its nominal height: touching a drive at w_tr = 0, the contact force is the lift.

    lift in N; to it comes the lift by the air flow. The frame's spring is unloaded there and the heights of the frame's
    laws count from there, so the whole lift passes through the chain: the head stands F / k_contact above the drive's
    surface and every body below it the deflection of the springs between them higher. Away from the nominal height
    the frame adds to or takes from the force. contact_stiffness in N/m. Raises ValueError if no lift moves the head.
    """
    force = lift + p.frame.air
    n = p.bodies
    if n:
        rest = force / contact_stiffness + force * _compliance(p)
        return p._replace(preload=p.ground_stiffness * rest, frame=p.frame._replace(rest=rest))
    # 0 = A x + b_lift (F + preload) + b_contact F and c x = F / k: m + 1 equations for x and the preload.
    m = p.states
    matrix = np.zeros((m + 1, m + 1))
    matrix[:m, :m], matrix[:m, m], matrix[m, p.head] = p.A, p.B[:, LIFT], 1.0
    right = np.append(-(p.B[:, LIFT] + p.B[:, CONTACT]) * force, force / contact_stiffness)
    try:
        preload = float(np.linalg.solve(matrix, right)[m])
    except np.linalg.LinAlgError:
        preload = math.inf
    if not abs(preload) < STRONGEST:
        raise ValueError("parameter 'pantograph_file': at rest no lift puts the head at its nominal height")
    return p._replace(preload=preload)


def equilibrium(p: Pantograph, lift: float, contact_stiffness: float, height: float = 0.0) -> Array:
    """Return the state x (m,) at rest under a drive that stands at height (m), the car body at 0.

    lift in N, contact_stiffness in N/m. If the lift does not suffice for a contact, the head hangs below the drive.
    Raises ValueError if nothing holds the pantograph within 10 m of its nominal height.
    """
    n = p.bodies
    if n == 0:
        touching = p.A.copy()
        touching[:, p.head] += contact_stiffness * p.B[:, CONTACT]
        push = p.B[:, LIFT] * (lift + p.frame.air + p.preload)
        x = np.linalg.solve(touching, p.B[:, CONTACT] * contact_stiffness * height - push)
        if x[p.head] < height:
            if np.linalg.matrix_rank(p.A) < p.states:
                raise ValueError(f"without contact nothing holds the pantograph under a lift of {lift:g} N")
            x = np.linalg.solve(p.A, -push)
        return np.asarray(x, dtype=np.float64)
    compliance = _compliance(p) + 1.0 / contact_stiffness

    def surplus(place: float) -> float:
        """Force on the frame's body that is not balanced with the frame at this place (m), N."""
        laws = frame_force(p.frame, place - p.frame.rest, 0.0, lift)
        return laws + p.preload - p.ground_stiffness * place - max(0.0, place - height) / compliance

    low = high = p.frame.rest
    while surplus(low) < 0.0 and p.frame.rest - low < REACH:
        low -= 0.05
    while surplus(high) > 0.0 and high - p.frame.rest < REACH:
        high += 0.05
    if surplus(low) < 0.0 or surplus(high) > 0.0:
        raise ValueError(f"pantograph finds no place to rest under a lift of {lift:g} N and a drive at {height:g} m")
    frame = float(brentq(surplus, low, high, xtol=1e-15, rtol=1e-14)) if high > low else low
    force = max(0.0, frame - height) / compliance
    x = np.zeros(2 * n)
    x[0] = frame
    for i in range(1, n):
        x[i] = x[i - 1] + force / p.stiffness[i, i - 1]
    return x


def _compliance(p: Pantograph) -> float:
    """Sum of the compliances between the frame's body and the head, m/N."""
    return -sum(1.0 / float(p.stiffness[i, i - 1]) for i in range(1, p.bodies))
