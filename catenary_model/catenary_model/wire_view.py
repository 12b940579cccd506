"""Shape of both wires, droppers and masts for viewing, in single precision; not used by any computation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from catenary_model import step
from catenary_model.moving_frame import Mesh
from catenary_model.statics import Statics

Array = NDArray[np.float64]
Singles = NDArray[np.float32]

_TABLE_STEP = 0.1


@njit(cache=True, fastmath=False)
def _fill(
    c: step.Constants, s: step.State, carrier_at_rest: Array, contact: Singles, carrier: Singles, droppers: Singles
) -> None:
    span, zeta, h = c.real[step.SPAN], s.point[step.ZETA], c.real[step.H]
    static = np.empty(6)
    samples = carrier_at_rest.size - 1
    for j in range(contact.size):
        at = zeta + j * h - c.real[step.HALF]
        step.static_at(c, at, static)
        contact[j] = static[0] + s.q[0, step.PAD + 4 * j + 2]
        r = (at / span - np.floor(at / span)) * samples
        i = min(int(r), samples - 1)
        rest = carrier_at_rest[i] + (r - i) * (carrier_at_rest[i + 1] - carrier_at_rest[i])
        carrier[j] = rest + s.q[0, step.PAD + 4 * j]
    for i in range(s.counter[step.DROPPERS]):
        droppers[0, i] = s.spring[i, step.POSITION]
        stretch = c.dropper[s.spring_at[i, 2], 1] + step.elongation(s, i, s.q[0])
        droppers[1, i] = max(0.0, c.real[step.K_DROPPER] * stretch)


@dataclass
class WireView:
    """Heights in m above the nominal contact wire, positions in m relative to the pantograph, forces in N."""

    x: Singles
    contact: Singles
    carrier: Singles
    mast_x: Singles
    _droppers: Singles
    _carrier_at_rest: Array
    _count: int = 0

    @classmethod
    def of(cls, mesh: Mesh, statics: Statics) -> WireView:
        """Allocate the arrays for this mesh and line."""
        line = statics.line
        samples = max(16, round(line.span_length / _TABLE_STEP))
        spans = math.ceil(2 * mesh.half_length / line.span_length) + 1
        return cls(
            x=mesh.x.astype(np.float32),
            contact=np.zeros(mesh.stations, dtype=np.float32),
            carrier=np.zeros(mesh.stations, dtype=np.float32),
            mast_x=np.zeros(0, dtype=np.float32),
            _droppers=np.zeros((2, max(1, spans * len(line.dropper_positions))), dtype=np.float32),
            _carrier_at_rest=statics.carrier(np.linspace(0.0, line.span_length, samples + 1)),
        )

    @property
    def dropper_x(self) -> Singles:
        """Droppers within the domain."""
        return self._droppers[0, : self._count]

    @property
    def dropper_force(self) -> Singles:
        """Their tension; 0 is slack."""
        return self._droppers[1, : self._count]

    def fill(self, constants: step.Constants, state: step.State) -> None:
        """Compute everything for the present state."""
        span = float(constants.real[step.SPAN])
        _fill(constants, state, self._carrier_at_rest, self.contact, self.carrier, self._droppers)
        self._count = int(state.counter[step.DROPPERS])
        zeta, half = float(state.point[step.ZETA]), float(constants.real[step.HALF])
        first, last = math.floor((zeta - half) / span) + 1, math.ceil((zeta + half) / span) - 1
        self.mast_x = (np.arange(first, last + 1) * span - zeta).astype(np.float32)
