"""The low-pass of the contact force as scipy.signal designs it, number for number, without half a second of import.

The poles of the analog prototype s_k = -exp(i pi m / 2N), m = -N + 1, -N + 3, ..., N - 1, go through the bilinear
transform z = (2 fs + s) / (2 fs - s) with the cut-off frequency warped to w = 2 fs tan(pi fc / fs); all zeros are at
-1. A real pole makes the first section, and the last one has a zero less then.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sections_of(order: int, cutoff: float, rate: float) -> Array:
    """Give the second-order sections (b0, b1, b2, 1, a1, a2) of a Butterworth low-pass, the least damped one last.

    Args:
        order: N, at least 1.
        cutoff: Hz, below half of the rate.
        rate: samples a second.

    Raises:
    ------
    ValueError
        The order is below 1.
    """
    if order < 1:
        raise ValueError(f"order {order} of a low-pass has to be 1 at least")
    prototype = -np.exp(1j * np.pi * np.arange(-order + 1, order, 2, dtype=np.float64) / (2 * order))
    warped = 4.0 * np.tan(np.pi * (cutoff / (rate / 2.0)) / 2.0)  # at a rate of 2, as scipy does
    poles, gain = warped * prototype, warped**order
    z = (4.0 + poles) / (4.0 - poles)
    gain = float(gain * np.real(1.0 / np.prod(4.0 - poles)))
    found = np.tile((1.0, 2.0, 1.0, 1.0, 0.0, 0.0), ((order + 1) // 2, 1))
    pairs = sorted((pole for pole in z if pole.imag > 0.0), key=abs)
    for section, pole in zip(found[order % 2 :], pairs, strict=True):
        section[4:] = -2.0 * pole.real, (pole * pole.conjugate()).real
    if order % 2:
        found[0, 4] = -z[order // 2].real
        found[-1, :3] = 1.0, 1.0, 0.0
    found[0, :3] *= gain
    return found


def steady_state(sections: Array) -> Array:
    """Give the state (n, 2) of each section in which a constant input of 1 gives its constant output.

    Of a section in transposed direct form II it is the solution of (1 + a_1) z_1 - z_2 = c_1, a_2 z_1 + z_2 = c_2, with
    c_k = b_k - a_k b_0, times the gain of the sections before it.
    """
    found = np.empty((len(sections), 2))
    scale = 1.0
    for state, section in zip(found, sections, strict=True):
        b, a = section[:3], section[3:]
        matrix = np.array([[1.0 + a[1], -1.0], [a[2], 1.0]])
        state[:] = scale * np.linalg.solve(matrix, b[1:] - a[1:] * b[0])
        scale *= b.sum() / a.sum()
    return found
