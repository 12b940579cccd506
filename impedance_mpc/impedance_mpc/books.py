"""Books of the conserved quantities, eqs. (3.46) and (3.47)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Books:
    """Sums of energy (J) and momentum (N s) exchanged on both sides of the emulation since cycle 0; ``ts`` in s.

    ``exchanged_energy`` = sum Ts |F_tr v_tr| and ``exchanged_momentum`` = sum Ts |F_tr| are what the errors are
    compared with. Sums at Ts are not the work done: between two samples force and velocity go on.
    """

    ts: float
    e_tr: float = 0.0
    e_cat: float = 0.0
    p_tr: float = 0.0
    p_cat: float = 0.0
    exchanged_energy: float = 0.0
    exchanged_momentum: float = 0.0

    @property
    def delta_e(self) -> float:
        """Energy error dE = E_tr - E_cat in J, eq. (3.46)."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> float:
        """Momentum error dp = p_tr - p_cat = -sum Ts F_cor in N s, eq. (3.47, sign corrected)."""
        return self.p_tr - self.p_cat

    def add(self, f_tr: float, v_tr: float, f_cor: float, v_cat: float) -> None:
        """Enter cycle k: forces in N, velocities in m/s."""
        ts = self.ts
        self.e_tr += ts * f_tr * v_tr
        self.e_cat += ts * (f_tr + f_cor) * v_cat
        self.p_tr += ts * f_tr
        self.p_cat += ts * (f_tr + f_cor)
        self.exchanged_energy += ts * abs(f_tr * v_tr)
        self.exchanged_momentum += ts * abs(f_tr)

    def clear(self) -> None:
        """Start at zero again."""
        self.e_tr = self.e_cat = self.p_tr = self.p_cat = 0.0
        self.exchanged_energy = self.exchanged_momentum = 0.0
