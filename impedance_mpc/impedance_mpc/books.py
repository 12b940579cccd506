"""Books of the conserved quantities: the sums (3.46) and (3.47), and the work that was really done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Books:
    """Energy (J) and momentum (N s) exchanged on both sides of the emulation while the rig follows; ``ts`` in s.

    Two books. The sums at Ts of (3.46) and (3.47), where F_cat(k) = F_tr(k) + F_cor(k) is the force that acts on the
    wire at t_k. And ``work_tr``, ``work_cat``, ``impulse_tr``, ``impulse_cat``, which both sides accumulated themselves
    between their samples: sums at Ts are not the work done, because force and velocity go on between two samples.
    ``exchanged_energy`` = sum Ts |F_tr v_tr| and ``exchanged_momentum`` = sum Ts |F_tr| are what errors compare with.
    """

    ts: float
    e_tr: float = 0.0
    e_cat: float = 0.0
    p_tr: float = 0.0
    p_cat: float = 0.0
    work_tr: float = 0.0
    work_cat: float = 0.0
    impulse_tr: float = 0.0
    impulse_cat: float = 0.0
    exchanged_energy: float = 0.0
    exchanged_momentum: float = 0.0
    _last: tuple[float, float, float, float] | None = None

    @property
    def totals(self) -> tuple[float, ...]:
        """All that was summed up, in the order of the fields."""
        return (
            self.e_tr,
            self.e_cat,
            self.p_tr,
            self.p_cat,
            self.work_tr,
            self.work_cat,
            self.impulse_tr,
            self.impulse_cat,
            self.exchanged_energy,
            self.exchanged_momentum,
        )

    @property
    def delta_e(self) -> float:
        """Energy error dE = E_tr - E_cat in J, eq. (3.46)."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> float:
        """Momentum error dp = p_tr - p_cat = -sum Ts F_cor in N s, eq. (3.47, sign corrected)."""
        return self.p_tr - self.p_cat

    @property
    def delta_work(self) -> float:
        """Energy error by the accumulated work, J."""
        return self.work_tr - self.work_cat

    @property
    def delta_impulse(self) -> float:
        """Momentum error by the accumulated impulse, N s."""
        return self.impulse_tr - self.impulse_cat

    def add(self, f_tr: float, v_tr: float, f_cat: float, v_cat: float) -> None:
        """Enter the instant t_k into the sums: forces in N, velocities in m/s."""
        ts = self.ts
        self.e_tr += ts * f_tr * v_tr
        self.e_cat += ts * f_cat * v_cat
        self.p_tr += ts * f_tr
        self.p_cat += ts * f_cat
        self.exchanged_energy += ts * abs(f_tr * v_tr)
        self.exchanged_momentum += ts * abs(f_tr)

    def accumulate(
        self, work_tr: float, work_cat: float, impulse_tr: float, impulse_cat: float, counted: bool = True
    ) -> None:
        """Enter what both sides have accumulated (J, N s) since the call before; uncounted, it is only noted."""
        last, self._last = self._last, (work_tr, work_cat, impulse_tr, impulse_cat)
        if last is not None and counted:
            self.work_tr += work_tr - last[0]
            self.work_cat += work_cat - last[1]
            self.impulse_tr += impulse_tr - last[2]
            self.impulse_cat += impulse_cat - last[3]

    def forget(self) -> None:
        """Take the next readings of what was accumulated as new beginnings (another environment)."""
        self._last = None

    def clear(self) -> None:
        """Start at zero again."""
        self.__init__(self.ts)  # type: ignore[misc]
