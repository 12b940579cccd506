"""A pantograph as a chain of masses from the car body over the frame to the head."""

import numpy as np

from phil_base.lumped import Lumped, tridiagonal
from test_rig_sim.pantographs.frame import Frame
from test_rig_sim.pantographs.motion import Pantograph, of_chain

MAX_BODIES = 4


def chain(masses: list[float], springs: list[float], dashpots: list[float], frame: Frame | None = None) -> Pantograph:
    """Return the chain whose body i hangs on body i - 1 (body 0: on the car body) by spring and dashpot i.

    Lists from frame to head in kg, N/m and N s/m, equally long; frame: laws beyond them that act on body 0. Raises
    ValueError for lists that do not fit, and for masses or springs that are not positive; the lowest spring may be
    zero.
    """
    n = len(masses)
    if not 1 <= n <= MAX_BODIES or len(springs) != n or len(dashpots) != n:
        raise ValueError(f"a pantograph needs 1 to {MAX_BODIES} masses and as many springs and dashpots")
    if min(masses) <= 0.0 or min([*springs[1:], 1.0]) <= 0.0 or springs[0] < 0.0 or min(dashpots) < 0.0:
        raise ValueError("masses and springs must be positive (the lowest spring may be 0), dashpots not negative")
    mass = np.array(masses, dtype=np.float64)
    return of_chain(mass, np.array(tridiagonal(dashpots)), np.array(tridiagonal(springs)), frame or Frame())


def lumped(data: Lumped) -> Pantograph:
    """Return the chain of published masses."""
    return chain(list(data.masses), list(data.springs), list(data.dashpots))
