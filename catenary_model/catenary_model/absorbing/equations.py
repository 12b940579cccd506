"""PDEs as stencils: a further one is a few lines of terms, as here."""

from __future__ import annotations

from catenary_model.absorbing.stencil import Stencil, Term, from_terms


def wave_1d(c: float, dx: float, dt: float, damping: float = 0.0) -> Stencil:
    """1-D wave equation w_tt + damping w_t = c^2 w_xx, second order in space and time.

    Args:
        c: wave speed, m/s.
        dx: grid spacing, m.
        dt: time step, s; at c dt = dx the scheme is exact: w_j moves by one node a step.
        damping: 1/s.
    """
    terms = [Term(1.0, time=2), Term(damping, time=1), Term(-(c**2), space=(2,))]
    return from_terms(terms, dx, dt, "wave_1d", c=c, damping=damping)


def wave_2d(c: float, dx: float, dt: float, dy: float | None = None) -> Stencil:
    """2-D wave equation w_tt = c^2 (w_xx + w_yy), five points in space, three levels in time.

    Args:
        c: wave speed, m/s.
        dx: grid spacing, m.
        dt: time step, s.
        dy: spacing along y; dx if not given.
    """
    terms = [Term(1.0, time=2), Term(-(c**2), space=(2, 0)), Term(-(c**2), space=(0, 2))]
    return from_terms(terms, (dx, dx if dy is None else dy), dt, "wave_2d", c=c)


def beam(
    rhoA: float, beta: float, EI: float, T: float, dx: float, dt: float, accuracy: int = 2, k: float = 0.0
) -> Stencil:
    """Euler-Bernoulli beam under tension (3.1): rhoA w_tt + beta w_t + EI w_xxxx - T w_xx + k w = 0.

    Args:
        rhoA: mass per length, kg/m.
        beta: viscous damping, Ns/m^2.
        EI: bending stiffness, Nm^2.
        T: tension, N.
        dx: grid spacing, m.
        dt: time step, s.
        accuracy: order of the differences in space; the fourth derivative sets how far the stencil reaches.
        k: stiffness of an elastic foundation, N/m^2.
    """
    terms = [
        Term(rhoA, time=2),
        Term(beta, time=1),
        Term(EI, space=(4,), accuracy=accuracy),
        Term(-T, space=(2,), accuracy=accuracy),
        Term(k),
    ]
    return from_terms(terms, dx, dt, "beam", rhoA=rhoA, beta=beta, EI=EI, T=T, k=k)
