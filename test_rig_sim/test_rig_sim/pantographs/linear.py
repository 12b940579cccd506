"""Linear pantographs x' = A x + B (lift, base, base_rate, f), head c x: realisation and checks."""

import numpy as np
import numpy.typing as npt
from scipy.linalg import matrix_balance

from test_rig_sim.pantographs.motion import BASE, BASE_RATE, CONTACT, LIFT, Pantograph, of_linear

Array = npt.NDArray[np.float64]

MAX_STATES = 40
ROUNDING = 1e-6
"""Share of the terms of a sum below which it counts as zero; files have few digits."""
TINY = float(np.finfo(np.float64).tiny)
AT_REST = 1e-10
"""A pole counts as zero below this share of the fastest pole."""


def linear_pantograph(A: Array, B: Array, c: Array) -> Pantograph:
    """Return the pantograph of A (m, m), B (m, 4) (columns LIFT, BASE, BASE_RATE, CONTACT) and c (m,).

    Raises ValueError if the head has no velocity of its own (c B not zero), if nothing moves it, or if A is not stable.
    """
    if np.any(np.abs(c @ B) > ROUNDING * (np.abs(c) @ np.abs(B))):
        raise ValueError("C B must be 0 (relative degree of at least 2), so that the head has a velocity")
    check_stable(A)
    # Balanced by powers of two, which changes no digit; then place c x and velocity c A x become the first two states.
    with np.errstate(invalid="ignore"):  # scipy casts large scales to integers, for a permutation that is not asked for
        balanced, (scale, _) = matrix_balance(A, permute=False, separate=True)
    rows = np.vstack([c * scale, (c * scale) @ balanced])
    unit = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), TINY)
    if np.linalg.svd(unit, compute_uv=False)[-1] < ROUNDING:
        raise ValueError("the head does not move: C and C A are not independent")
    rest = np.linalg.svd(unit)[2][2:]
    coordinates = np.vstack([rows, rest])
    back = np.linalg.inv(coordinates)
    A_head = coordinates @ balanced @ back
    B_head = coordinates @ (B / scale[:, None])
    A_head[0], B_head[0] = np.eye(c.size)[1], 0.0
    return of_linear(np.asarray(A_head, dtype=np.float64), B_head)


def check_stable(A: Array) -> None:
    """Raise ValueError unless all poles decay; one pole at s = 0 is allowed (a frame that no spring holds)."""
    poles = np.linalg.eigvals(A)
    fastest = float(np.abs(poles).max())
    moving = poles[np.abs(poles) > AT_REST * fastest]
    if poles.size - moving.size > 1:
        raise ValueError("is not stable: more than one pole at s = 0")
    if moving.size and moving.real.max() >= -1e-12 * fastest:
        worst = moving[int(np.argmax(moving.real))]
        raise ValueError(f"is not stable: pole at s = {worst.real:.4g} {worst.imag:+.4g}j 1/s")


def realise(denominator: Array, contact: Array, lift: Array, base: Array) -> tuple[Array, Array, Array]:
    """Return A, B, c of head = (-contact f + lift F_lift + base w_base) / denominator, in observable form.

    Polynomials in s, highest power first, the denominator's first entry not zero; contact and lift at least two degrees
    below it, base at least one: what of base goes with s acts through base_rate, so the head keeps its velocity.
    """
    n = denominator.size - 1
    A = np.zeros((n, n))
    A[:, 0] = -denominator[1:] / denominator[0]
    A[np.arange(n - 1), np.arange(1, n)] = 1.0
    B = np.zeros((n, 4))
    for column, numerator in ((CONTACT, -contact), (LIFT, lift), (BASE, base[-1:]), (BASE_RATE, base[:-1])):
        if numerator.size:
            B[n - numerator.size :, column] = numerator / denominator[0]
    c = np.zeros(n)
    c[0] = 1.0
    return A, B, c
