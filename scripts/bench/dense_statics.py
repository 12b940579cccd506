"""Statics by another way: the periodic Green's function of a tensioned beam, every load with every load, dense.

W(zeta) = W_0 + sum P_i g(zeta - zeta_i), with the mean height W_0 and

    g(r) = (1/T) (r^2/(2 L) - r/2 + L/12) - (lambda/(2 T)) sum_j exp(-|r + j L|/lambda),  0 <= r < L,  lambda^2 = EI/T.

The unknowns are all forces and both mean heights, the balance of forces closes the system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line, Wire

Array = NDArray[np.float64]


def green(r: Array, period: float, wire: Wire) -> Array:
    """Periodic Green's function g of a beam under tension (m/N) at distance r (m) ahead."""
    s = np.mod(r, period)
    s = np.where(s >= period, 0.0, s)
    lam = wire.bending_length
    images = 2 * wire.tension * -np.expm1(-period / lam)
    string = (s * s / (2 * period) - s / 2 + period / 12) / wire.tension
    return np.asarray(string - lam * (np.exp(-s / lam) + np.exp(-(period - s) / lam)) / images)


@dataclass(frozen=True)
class DenseStatics:
    """Dropper and mast forces (N), elongations (m), and both wires."""

    line: Line
    force: Array
    mast: Array
    elongation: Array
    carrier_at: Array
    carrier_load: Array
    contact_at: Array
    contact_load: Array
    heights: tuple[float, float]

    def carrier(self, zeta: Array) -> Array:
        """Height of the carrier, m."""
        G = green(zeta[:, None] - self.carrier_at, self.line.period, self.line.carrier)
        return np.asarray(self.heights[0] + G @ self.carrier_load)

    def contact(self, zeta: Array) -> Array:
        """Height of the contact wire, m."""
        G = green(zeta[:, None] - self.contact_at, self.line.period, self.line.contact)
        return np.asarray(self.heights[1] + G @ self.contact_load)


def solve(line: Line) -> DenseStatics:
    """Solve for a line with droppers; given lengths by flipping whatever disagrees."""
    rows = [
        (start + d.position, d.stiffness, d.carrier_mass, d.contact_mass, np.nan if d.length is None else d.length)
        for start, span in zip(line.span_starts, line.spans, strict=True)
        for d in span.droppers
    ]
    at, k, on_carrier, on_contact, length = np.array(rows).T
    wanted = np.array([s.clamp_height(d) for s in line.spans for d in s.droppers])
    masts = np.array(line.span_starts)
    n, m, P, gravity = at.size, masts.size, line.period, line.gravity
    carrier_at = np.concatenate((at, masts))
    G = green(carrier_at[:, None] - carrier_at, P, line.carrier)
    carrier = np.column_stack((-G[:, :n], G[:, n:], np.ones(n + m), np.zeros(n + m)))
    carrier_known = -G[:, :n] @ (gravity * on_carrier)
    G = green(at[:, None] - at, P, line.contact)
    contact = np.column_stack((G, np.zeros((n, m + 1)), np.ones(n)))
    contact_known = -G @ (gravity * on_contact)
    given = ~np.isnan(length)
    A, b = np.zeros((n + m + 2, n + m + 2)), np.zeros(n + m + 2)
    A[:n] = contact - np.where(given[:, None], carrier[:n], 0.0)
    A[:n, :n] += np.diag(np.where(given, 1.0 / k, 0.0))
    b[:n] = np.where(given, carrier_known[:n] - length, wanted) - contact_known
    A[n : n + m] = carrier[n:]
    b[n : n + m] = [span.mast.encumbrance for span in line.spans] - carrier_known[n:]
    A[n + m, :n], A[n + m, n : n + m], A[n + m + 1, :n] = -1.0, 1.0, 1.0
    b[n + m] = gravity * (line.carrier.mass_per_length * P + on_carrier.sum())
    b[n + m + 1] = gravity * (line.contact.mass_per_length * P + on_contact.sum())
    on = np.ones(b.size, dtype=np.bool_)
    for _ in range(100):
        x = np.zeros(b.size)
        x[on] = np.linalg.solve(A[np.ix_(on, on)], b[on])
        lacking = b - A @ x
        wrong = np.append(given, np.zeros(m + 2, dtype=np.bool_)) & np.where(on, x < 0.0, lacking > 0.0)
        if not wrong.any():
            break
        on ^= wrong
    else:
        raise AssertionError("did not settle")
    stretch = np.where(on[:n], x[:n] / k, lacking[:n])
    loads = np.concatenate((-x[:n] - gravity * on_carrier, x[n : n + m])), x[:n] - gravity * on_contact
    return DenseStatics(line, x[:n], x[n : n + m], stretch, carrier_at, loads[0], at, loads[1], (x[-2], x[-1]))
