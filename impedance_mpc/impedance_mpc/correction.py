"""Bounds on the correction force F_cor that let the energy error decay, eq. (3.49), and their robustification.

Derivation. With dE(k-1) known and forces and velocities of cycle k measured, (3.46) reads

    dE(k) = dE(k-1) + Ts F_tr v_tr - Ts (F_tr + F_cor) v_cat.

Ask for dE(k) = theta dE(k-1) and solve for the force:

    F(theta) = (1 - theta) s + c,    s = dE(k-1) / (v_cat Ts),    c = F_tr (v_tr / v_cat - 1).

Every theta in [0, alpha], 0 < alpha < 1, brings dE(k) between 0 and alpha dE(k-1): it decays (3.48) and keeps its sign.
F falls with theta where s > 0 and rises where s < 0, so the theta of the lower and of the upper bound are

    v_cat > 0, dE > 0: alpha, 0      v_cat > 0, dE < 0: 0, alpha
    v_cat < 0, dE > 0: 0, alpha      v_cat < 0, dE < 0: alpha, 0

which is (3.49) in its first case. c is the instantaneous term: it cancels the whole error of this very cycle.
"""

from __future__ import annotations

from dataclasses import dataclass

from phil_base.enumerations import Correction


@dataclass(frozen=True)
class CorrectionRule:
    """How (3.49) is robustified.

    ``alpha`` is the slowest decay of dE a cycle, ``cap`` the largest |F_cor| in N, ``dead_zone`` the |v_cat| in m/s
    below which the bounds are not used, ``rate`` the largest change of F_cor a cycle in N. ``instantaneous_term``
    keeps c in the bounds; without it dE decays on average only, with it F_cor follows every sample's velocity error
    divided by a small velocity, and the wire follows F_cor. ``tolerance`` in J is the energy error that is left alone:
    what noise puts into the books must not be chased with forces.

    Raises
    ------
    ValueError
        alpha is not in (0, 1), or another number is not positive (dead zone: negative).
    """

    alpha: float
    cap: float
    dead_zone: float
    rate: float
    instantaneous_term: bool = False
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.alpha < 1.0:
            raise ValueError(f"correction_alpha {self.alpha} is not between 0 and 1")
        if not (self.cap > 0.0 and self.rate > 0.0 and self.dead_zone >= 0.0 and self.tolerance >= 0.0):
            raise ValueError("cap and rate of F_cor have to be positive, its dead zone and tolerance not negative")


def decay_interval(
    delta_e: float, v_cat: float, v_tr: float, f_tr: float, ts: float, alpha: float, instantaneous_term: bool = True
) -> tuple[float, float]:
    """Give the bounds (3.49) on F_cor(k) in N, between which (3.48) holds; v_cat must not be 0.

    ``delta_e`` is dE(k-1) in J, velocities in m/s, F_tr in N.
    """
    # One division by v_cat, so that a tiny velocity gives a huge bound but never infinity minus infinity.
    c = f_tr * (v_tr - v_cat) if instantaneous_term else 0.0
    slow, full = ((1.0 - alpha) * delta_e / ts + c) / v_cat, (delta_e / ts + c) / v_cat
    # v_cat > 0, dE > 0 and v_cat < 0, dE < 0 against the two other cases.
    return (slow, full) if (delta_e > 0.0) == (v_cat > 0.0) else (full, slow)


def bounds(
    rule: CorrectionRule, delta_e: float, v_cat: float, v_tr: float, f_tr: float, f_before: float, ts: float
) -> tuple[float, float, Correction]:
    """Give lower and upper bound on F_cor(k) in N and which case it is; lower <= upper, always inside the cap.

    ``delta_e`` is dE(k-1) in J, ``f_before`` is F_cor(k-1) in N. Cap and rate limit make a window that always has
    room, because the force before is inside the cap. Dead zone: the window. Else the window cut with (3.49); if they
    do not meet, the end of the window next to (3.49), from which dE at least moves the right way whenever the window
    reaches the sign that (3.49) asks for.
    """
    before = min(max(f_before, -rule.cap), rule.cap)
    low = max(-rule.cap, before - rule.rate)
    high = min(rule.cap, before + rule.rate)
    if abs(v_cat) < rule.dead_zone or v_cat == 0.0:
        return low, high, Correction.DEAD_ZONE
    if abs(delta_e) < rule.tolerance:
        return low, high, Correction.SETTLED
    lower, upper = decay_interval(delta_e, v_cat, v_tr, f_tr, ts, rule.alpha, rule.instantaneous_term)
    if lower > high:
        return high, high, Correction.PROJECTED
    if upper < low:
        return low, low, Correction.PROJECTED
    if lower >= low and upper <= high:
        return lower, upper, Correction.ACTIVE
    return max(lower, low), min(upper, high), Correction.CAPPED
