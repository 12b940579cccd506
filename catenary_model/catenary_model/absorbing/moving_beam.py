"""The beam under tension in the frame of a train (3.6), explicit in time: a leapfrog along the beam's material points.

    rhoA w_tt + beta w_t = -EI w_xxxx + (T - rhoA v^2) w_xx + beta v w_x + 2 v rhoA w_tx + f             (3.6)

The mixed derivative w_tx makes the centred scheme implicit, and one-sided differences of it in time are unstable at any
speed. But (3.6) is the beam at rest, seen from the train: a harmonic wave exp(i k x) gains in one step the factor

    g = exp(-beta dt / (2 rhoA)) exp(i k v dt) exp(+-i Omega dt),   Omega^2 = (EI k^4 + T k^2)/rhoA - (beta/(2 rhoA))^2

and satisfies g^2 - A g + B = 0 with A the sum and B the product of the two factors. So

    w(n+1) = d I C w(n) - d^2 I^2 w(n-1) + dt^2/rhoA I f(n),     d = exp(-beta dt / (2 rhoA))

is exact if I shifts by v dt and C multiplies by 2 cos(Omega dt). Both are given 2 R + 1 points and as many Taylor terms
in k as these can have: I is Lagrange's interpolation, C is even. As |I| <= 1 for |v| dt <= dx (Lagrange, an odd number
of points) and |C| <= 2 for moderate steps, |g| <= 1: von Neumann stable by construction, without parasitic roots. The
scheme is of order 2 R in space *and* time for a string, since C contains the time step; one less where bending counts.
"""

from __future__ import annotations

import math

import numpy as np

from catenary_model.absorbing.stencil import Array, Stencil

_WAVE_NUMBERS = 2001
_ROUNDING = 1e-11


def shift(distance: float, reach: int) -> Array:
    """Weights of nodes -R .. R that give a field at `distance` (in grid spacings), Lagrange, shape (2 R + 1,)."""
    at = np.arange(-reach, reach + 1, dtype=np.float64)
    return np.array([np.prod([(distance - b) / (a - b) for b in at if b != a]) for a in at])


def leap(rhoA: float, beta: float, EI: float, T: float, dx: float, dt: float, reach: int) -> Array:
    """Weights of nodes -R .. R of the even operator nearest to 2 cos(Omega dt), shape (2 R + 1,).

    Equal Taylor coefficients in the wave number up to k^(2 R). SI units; Omega as in the module's description.
    """
    terms = reach + 1  # in powers of theta^2
    z = np.zeros(terms)
    z[0] = -((0.5 * beta / rhoA * dt) ** 2)
    z[1] = T / rhoA * (dt / dx) ** 2
    if terms > 2:
        z[2] = EI / rhoA * (dt / dx**2) ** 2
    wanted, power = np.zeros(terms), np.eye(terms)[0]
    for m in range(20):  # cos(sqrt(z)) as a series in z
        wanted += (-1.0) ** m / math.factorial(2 * m) * power
        power = np.convolve(power, z)[:terms]
    node = np.arange(reach + 1, dtype=np.float64)
    system = np.zeros((terms, reach + 1))
    for p in range(terms):  # sum_j c_j cos(j theta), coefficient of theta^(2 p)
        system[p] = (-1.0) ** p * node ** (2 * p) / math.factorial(2 * p)
    c = np.linalg.solve(system, 2.0 * wanted)
    return np.concatenate([0.5 * c[:0:-1], c[:1], 0.5 * c[1:]])


def moving_beam(
    rhoA: float, beta: float, EI: float, T: float, v: float, dx: float, dt: float, reach: int = 3
) -> Stencil:
    """Explicit interior stencil of (3.6): two old levels, 2 `reach` nodes to either side, order 2 `reach` (see above).

    The coefficients are those of the PDE's left side: a load f (N/m) at time n that acts where the node's material
    point was then adds f / new_coefficient = dt^2/rhoA f to the new value.

    Args:
        rhoA: mass per length, kg/m.
        beta: viscous damping, N s/m^2.
        EI: bending stiffness, N m^2.
        T: tension, N.
        v: speed of the frame along +x, m/s; 0 is the beam at rest.
        dx: grid spacing, m.
        dt: time step, s.
        reach: R, nodes to either side of each of the two factors.

    Raises:
        ValueError: there is no such scheme or it is not stable; says what to change.
    """
    if reach < 1:
        raise ValueError(f"reach = {reach} must be at least 1")
    if min(rhoA, T, dx, dt) <= 0.0 or min(beta, EI) < 0.0:
        raise ValueError("rhoA, T, dx and dt must be above 0, beta and EI at least 0")
    if EI > 0.0 and reach < 2:
        raise ValueError(f"reach = {reach} must be at least 2 for a beam, whose bending has a fourth derivative")
    decay = math.exp(-0.5 * beta / rhoA * dt)
    I = shift(v * dt / dx, reach)  # noqa: E741 - the operator's name
    C = leap(rhoA, beta, EI, T, dx, dt, reach)
    worst = radius(I, C, decay)
    if worst > 1.0 + _ROUNDING:
        raise ValueError(
            f"a step of {dt * 1e3:.4g} ms on a grid of {dx:.4g} m at {v:.4g} m/s is unstable (a wave grows by "
            f"{worst:.4g} a step): choose a shorter step or a wider grid"
        )
    a, b = decay * np.convolve(I, C), decay**2 * np.convolve(I, I)
    node = np.arange(-2 * reach, 2 * reach + 1)
    offsets = np.concatenate([[[0, 1]], np.stack([node, 0 * node], axis=1), np.stack([node, 0 * node - 1], axis=1)])
    coefficients = rhoA / dt**2 * np.concatenate([[1.0], -a, b])
    return Stencil(
        offsets,
        coefficients,
        (dx,),
        dt,
        "moving_beam",
        (("rhoA", rhoA), ("beta", beta), ("EI", EI), ("T", T), ("v", v)),
    )


def radius(shifting: Array, leaping: Array, decay: float) -> float:
    """Largest growth of any wave in one step of the endless grid, 1: the von Neumann condition asks for at most 1."""
    theta = np.linspace(0.0, np.pi, _WAVE_NUMBERS)
    symbol_i = np.exp(1j * np.outer(theta, np.arange(shifting.size) - shifting.size // 2)) @ shifting
    # By sines: the two roots meet at C = 2, where a last digit of C would become its root in the growth. C of the
    # longest wave is decay + 1/decay.
    half = leaping.size // 2
    lack = 4.0 * np.sin(0.5 * np.outer(theta, np.arange(1, half + 1))) ** 2 @ leaping[half + 1 :]
    above = (1.0 - decay) ** 2 / decay - lack  # C - 2
    beyond = np.maximum(np.maximum(above, -4.0 - above), 0.0)  # |C| - 2
    h = 1.0 + 0.5 * beyond + np.sqrt(beyond + 0.25 * beyond * beyond)
    return float((decay * np.abs(symbol_i) * h).max())
