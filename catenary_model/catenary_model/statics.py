"""Static equilibrium of the endless periodic line in closed form, and the unstressed dropper lengths that give it.

A periodic load per span that is in balance, sum P_i = 0 (weight included), bends a tensioned beam T W'' - EI W''''
into W(zeta) = W_0 + sum P_i g(zeta - zeta_i) with the periodic Green's function of a unit point load

    g(r) = (1/T) (r^2/(2 L) - r/2 + L/12) - (lambda/(2 T)) sum_j exp(-|r + j L|/lambda),  0 <= r < L,  lambda^2 = EI/T.

The first term is the string, the second rounds its kink. A uniform load has no part in g: it is what balances the
points. Unknowns are the dropper forces and the heights W_0 of both wires; they follow from a small linear system, so
the static shape does not depend on any mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line, Wire

Array = NDArray[np.float64]

_MAX_PASSES = 200


def string_green(r: Array, span: float, tension: float) -> tuple[Array, Array]:
    """Periodic Green's function of a string (m/N) and its slope (1/N) at distance r (m) from the load."""
    s = np.mod(r, span)
    return (s * s / (2 * span) - s / 2 + span / 12) / tension, (s / span - 0.5) / tension


def green(r: Array, span: float, wire: Wire) -> tuple[Array, Array]:
    """Periodic Green's function g of a beam under tension (m/N) and its slope (1/N) at distance r (m) from the load."""
    value, slope = string_green(r, span, wire.tension)
    s = np.mod(r, span)
    lam = wire.bending_length
    for j in (-1, 0, 1):  # lambda is centimetres, spans are tens of metres
        d = s + j * span
        bump = np.exp(-np.abs(d) / lam) / (2 * wire.tension)
        value = value - lam * bump
        slope = slope + np.where(d >= 0, 1.0, -1.0) * bump
    return value, slope


@dataclass(frozen=True)
class Statics:
    """The line at rest under its own weight.

    Heights are measured from the nominal height of the contact wire, forces are tensions of the droppers.
    """

    line: Line
    dropper_forces: Array
    """F_s, N, shape (droppers per span,); 0 is slack."""
    dropper_elongations: Array
    """Static length minus unstressed length, m; negative is slack."""
    dropper_lengths: Array
    """Unstressed lengths l_0, m."""
    contact_height: float
    """W_0 of the contact wire, m."""
    carrier_height: float
    """W_0 of the carrier, m."""

    def contact(self, zeta: Array) -> Array:
        """Height of the contact wire at track positions zeta, m."""
        return self._shape(zeta, self.line.contact, self.contact_height, self._contact_loads())[0]

    def contact_slope(self, zeta: Array) -> Array:
        """Slope of the contact wire at track positions zeta, 1."""
        return self._shape(zeta, self.line.contact, self.contact_height, self._contact_loads())[1]

    def carrier(self, zeta: Array) -> Array:
        """Height of the carrier at track positions zeta, m."""
        return self._shape(zeta, self.line.carrier, self.carrier_height, self._carrier_loads())[0]

    def _contact_loads(self) -> tuple[Array, Array]:
        return np.array(self.line.dropper_positions), self.dropper_forces

    def _carrier_loads(self) -> tuple[Array, Array]:
        line = self.line
        mast = line.carrier.mass_per_length * line.gravity * line.span_length + self.dropper_forces.sum()
        return np.append(line.dropper_positions, 0.0), np.append(-self.dropper_forces, mast)

    def _shape(self, zeta: Array, wire: Wire, height: float, loads: tuple[Array, Array]) -> tuple[Array, Array]:
        value, slope = green(np.asarray(zeta, dtype=np.float64)[..., None] - loads[0], self.line.span_length, wire)
        return height + value @ loads[1], slope @ loads[1]


def clamp_heights(line: Line) -> Array:
    """Heights of the clamps on the contact wire that the lengths are computed for, m: level, or a parabola."""
    s = np.array(line.dropper_positions) / line.span_length
    return -4.0 * line.pre_sag * s * (1.0 - s)


def solve(line: Line) -> Statics:
    """Solve the static equilibrium; compute the unstressed lengths if the line does not give them.

    A contact wire without droppers hangs from nothing: it is taken as level, its weight is left out.

    Raises ValueError if lengths that were given leave no equilibrium, or if computed ones are not positive or not taut.
    """
    n = len(line.dropper_positions)
    if n == 0:
        none = np.zeros(0)
        height = _carrier_height(line, none)
        return Statics(line, none, none, none, 0.0, height)
    if line.dropper_lengths is not None:
        return _given_lengths(line, np.array(line.dropper_lengths))
    force, contact_height = _held_at(line, clamp_heights(line))
    if line.gravity > 0.0 and force.min() <= 0.0:
        i = int(force.argmin())
        raise ValueError(
            f"line.pre_sag = {line.pre_sag} m would need dropper {i + 1} to push ({force[i]:.1f} N): choose another "
            "line.pre_sag or line.dropper_positions"
        )
    carrier_height = _carrier_height(line, force)
    draft = Statics(line, force, force / line.dropper_stiffness, force, contact_height, carrier_height)
    at = np.array(line.dropper_positions)
    length = draft.carrier(at) - draft.contact(at) - force / line.dropper_stiffness
    if length.min() <= 0.0:
        raise ValueError(
            f"line.encumbrance = {line.encumbrance} m is too small: dropper {int(length.argmin()) + 1} would be "
            f"{length.min():.3f} m long"
        )
    return Statics(line, force, force / line.dropper_stiffness, length, contact_height, carrier_height)


def _green_matrix(line: Line, wire: Wire) -> Array:
    at = np.array(line.dropper_positions)
    return green(at[:, None] - at[None, :], line.span_length, wire)[0]


def _carrier_height(line: Line, force: Array) -> float:
    """W_0 of the carrier such that it passes the masts at the encumbrance, m."""
    draft = Statics(line, force, force, force, 0.0, 0.0)
    return line.encumbrance - float(draft.carrier(np.zeros(1))[0])


def _held_at(line: Line, height: Array) -> tuple[Array, float]:
    """Dropper forces (N) and W_0 (m) of a contact wire that is held at these heights (m)."""
    n = height.size
    system = np.ones((n + 1, n + 1))
    system[:n, :n] = _green_matrix(line, line.contact)
    system[n, n] = 0.0
    weight = line.contact.mass_per_length * line.gravity * line.span_length
    solution = np.linalg.solve(system, np.append(height, weight))
    return solution[:n], float(solution[n])


def _given_lengths(line: Line, length: Array) -> Statics:
    """Equilibrium for given unstressed lengths: active set over taut and slack droppers."""
    n = length.size
    at = np.array(line.dropper_positions)
    k_d = line.dropper_stiffness
    weight = line.contact.mass_per_length * line.gravity * line.span_length
    # carrier height at the clamps is affine in the dropper forces
    free = Statics(line, np.zeros(n), length, length, 0.0, _carrier_height(line, np.zeros(n))).carrier(at)
    pull = np.empty((n, n))
    for i in range(n):
        unit = np.eye(n)[i]
        pull[:, i] = Statics(line, unit, length, length, 0.0, _carrier_height(line, unit)).carrier(at) - free
    contact = _green_matrix(line, line.contact)
    taut = np.ones(n, dtype=np.bool_)
    for _ in range(_MAX_PASSES):
        index = np.flatnonzero(taut)
        m = index.size
        if m == 0:
            break
        system = np.ones((m + 1, m + 1))
        system[:m, :m] = (contact - pull)[np.ix_(index, index)] + np.eye(m) / k_d
        system[m, m] = 0.0
        solution = np.linalg.solve(system, np.append((free - length)[index], weight))
        force = np.zeros(n)
        force[index] = solution[:m]
        height = float(solution[m])
        carrier_height = _carrier_height(line, force)
        draft = Statics(line, force, force, length, height, carrier_height)
        elongation = draft.carrier(at) - draft.contact(at) - length
        # one change a pass, the worst offender first: cannot cycle in practice, is bounded anyway
        wrong = np.where(taut, -force / k_d, elongation)
        worst = int(wrong.argmax())
        if wrong[worst] <= 1e-12:
            return Statics(line, force, np.where(taut, force / k_d, elongation), length, height, carrier_height)
        taut[worst] = not taut[worst]
    raise ValueError(f"line.dropper_lengths = {[float(x) for x in length]} leave no static equilibrium")
