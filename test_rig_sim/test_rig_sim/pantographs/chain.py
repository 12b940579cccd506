"""A pantograph as a chain of masses from the ground over the frame to the head."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MAX_BODIES = 4


class Pantograph(NamedTuple):
    """Chain of n <= 4 masses, frame first, head last: M q'' + D q' + K q = e_frame F_up - e_head F_contact.

    Displacements q in m from the position at which no spring of the chain is loaded.
    """

    mass: Array  # (n,), kg, diagonal of M
    damping: Array  # (n, n), N s/m, D
    stiffness: Array  # (n, n), N/m, K


class OperatingPoint(NamedTuple):
    """Static state in which the contact force is the uplift force and the contact point at nominal height."""

    preload: float  # N, constant force on the frame that stands for the frame spring's rest position
    rest: float  # m, that rest position
    displacement: Array  # (n,), m, the bodies with the drive at w_tr = 0


def chain(masses: list[float], springs: list[float], dashpots: list[float]) -> Pantograph:
    """Return the chain whose body i hangs on body i - 1 (body 0: on the ground) by spring and dashpot i.

    Lists from frame to head in kg, N/m and N s/m, equally long. Raises ValueError otherwise, and for masses
    or springs that are not positive.
    """
    n = len(masses)
    if not 1 <= n <= MAX_BODIES or len(springs) != n or len(dashpots) != n:
        raise ValueError(f"a pantograph needs 1 to {MAX_BODIES} masses and as many springs and dashpots")
    if min(masses) <= 0.0 or min(springs) <= 0.0 or min(dashpots) < 0.0:
        raise ValueError("masses and springs must be positive, dashpots not negative")
    return Pantograph(np.array(masses, dtype=np.float64), _tridiagonal(dashpots), _tridiagonal(springs))


def _tridiagonal(links: list[float]) -> Array:
    matrix = np.zeros((len(links), len(links)))
    for i, link in enumerate(links):
        matrix[i, i] += link
        if i > 0:
            matrix[i - 1, i - 1] += link
            matrix[i, i - 1] -= link
            matrix[i - 1, i] -= link
    return matrix


def operating_point(pantograph: Pantograph, uplift_force: float, contact_stiffness: float) -> OperatingPoint:
    """Return the frame spring's rest position for which the static contact force is uplift_force at w_tr = 0.

    With the frame's spring unloaded there, the whole uplift force (N) passes through the chain, so the head
    stands F / k_contact above the drive's surface and every body below it lower springs' deflection higher.
    contact_stiffness in N/m. Away from the nominal height the frame's spring adds to or takes from the force.
    """
    n = pantograph.mass.size
    q = np.empty(n)
    q[n - 1] = uplift_force / contact_stiffness
    for i in range(n - 1, 0, -1):
        q[i - 1] = q[i] - uplift_force / pantograph.stiffness[i, i - 1]
    ground_spring = float(pantograph.stiffness[0].sum())
    return OperatingPoint(ground_spring * float(q[0]), float(q[0]), q)


def static_displacement(pantograph: Pantograph, frame_force: float, contact_stiffness: float, height: float) -> Array:
    """Return the bodies' static displacement (n,) in m, touching a drive that stands at height (m).

    frame_force in N is all that acts on the frame (uplift force and preload), contact_stiffness in N/m.
    """
    stiffness = pantograph.stiffness.copy()
    force = np.zeros(pantograph.mass.size)
    stiffness[-1, -1] += contact_stiffness
    force[-1] += contact_stiffness * height
    force[0] += frame_force
    return np.asarray(np.linalg.solve(stiffness, force), dtype=np.float64)
