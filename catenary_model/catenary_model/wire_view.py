"""Shape of both wires, droppers and masts for viewing, in single precision; not used by any computation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary_model import layout, step
from catenary_model.layout import Constants, State
from catenary_model.moving_frame import Mesh
from catenary_model.statics import MAST, Statics
from phil_base.kernels import njit

Array = NDArray[np.float64]
Singles = NDArray[np.float32]

_TABLE_STEP = 0.1
_PIECE = 50_000


@njit(cache=True, fastmath=False)
def _fill(
    c: Constants,
    s: State,
    deviation: Array,
    behind: float,
    carrier_at_rest: Array,
    contact: Singles,
    carrier: Singles,
    droppers: Singles,
) -> None:
    period, zeta, h = c.real.period, s.point[layout.ZETA], c.real.h
    static = np.empty(6)
    samples = carrier_at_rest.size - 1
    for j in range(contact.size):
        at = zeta + j * h - behind
        step.static_at(c, at, static)
        contact[j] = static[0] + deviation[1, j]
        r = (at / period - np.floor(at / period)) * samples
        i = min(int(r), samples - 1)
        rest = carrier_at_rest[i] + (r - i) * (carrier_at_rest[i + 1] - carrier_at_rest[i])
        carrier[j] = rest + deviation[0, j]
    n = 0
    for i in range(s.counter[layout.SITES]):
        row = s.where[layout.ROW, i]
        if row < 0 or c.site[row, layout.ONE_SIDED] == 0.0:
            continue
        droppers[0, n] = s.here[layout.X, i]
        # a faded dropper keeps its static force and gives up what it does beyond it
        droppers[1, n] = max(0.0, c.site[row, layout.FORCE] + s.here[layout.PRESS, i])
        n += 1


@dataclass
class WireView:
    """Heights in m above the nominal contact wire, positions in m relative to the pantograph, forces in N."""

    x: Singles
    contact: Singles
    carrier: Singles
    mast_x: Singles
    _droppers: Singles
    _carrier_at_rest: Array
    _masts: Array
    _count: int = 0

    @classmethod
    def of(cls, mesh: Mesh, statics: Statics) -> WireView:
        """Allocate the arrays for this mesh and line."""
        period = statics.line.period
        samples = max(16, round(period / _TABLE_STEP))
        repeats = math.ceil((mesh.x[-1] - mesh.x[0]) / period) + 1
        # in pieces: of a long line the work would take ten times the memory of the result
        pieces = np.array_split(np.linspace(0.0, period, samples + 1), samples // _PIECE + 1)
        masts = statics.sites.position[statics.sites.kind == MAST]
        return cls(
            x=mesh.x.astype(np.float32),
            contact=np.zeros(mesh.stations, dtype=np.float32),
            carrier=np.zeros(mesh.stations, dtype=np.float32),
            mast_x=np.zeros(0, dtype=np.float32),
            _droppers=np.zeros((2, max(1, repeats * statics.dropper_forces.size)), dtype=np.float32),
            _carrier_at_rest=np.concatenate([statics.carrier(piece) for piece in pieces]),
            _masts=masts,
        )

    @property
    def dropper_x(self) -> Singles:
        """Droppers within the domain."""
        return self._droppers[0, : self._count]

    @property
    def dropper_force(self) -> Singles:
        """Their tension; 0 is slack."""
        return self._droppers[1, : self._count]

    def fill(self, constants: Any, state: Any, deviation: Array, behind: float) -> None:
        """Compute everything for the present state: any model's bundles, deviation (wire, node) of both wires in m.

        `behind` is the distance (m) from the pantograph back to the first node.
        """
        period = float(constants.real["period"])
        rest = self._carrier_at_rest
        _fill(constants, state, deviation, behind, rest, self.contact, self.carrier, self._droppers)
        self._count = int(state.counter[layout.DROPPERS])
        zeta, ahead = state.point[layout.ZETA], constants.real["ahead"]
        repeats = np.arange(math.floor((zeta - behind) / period), math.ceil((zeta + ahead) / period))
        x = (repeats[:, None] * period + self._masts[None, :]).ravel() - zeta
        self.mast_x = x[(x > -behind) & (x < ahead)].astype(np.float32)
