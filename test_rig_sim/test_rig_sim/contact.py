"""One-sided contact between the pantograph's head and the drive."""

from typing import NamedTuple

from phil_base.kernels import njit


class Contact(NamedTuple):
    """Spring and dashpot of the contact; both act only while the head touches the drive."""

    stiffness: float  # N/m
    damping: float  # N s/m


@njit(cache=True, fastmath=False, forceinline=True)
def contact_force(contact: Contact, penetration: float, rate: float) -> float:
    """Contact force in N, never negative: max(0, k d + c d') while d = w_head - w_tr > 0, else 0.

    penetration d in m, rate d' in m/s.
    """
    if penetration <= 0.0:
        return 0.0
    return max(0.0, contact.stiffness * penetration + contact.damping * rate)
