"""What touches the wires between the first and the last mast of a mesh: one period's sites, repeated."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from catenary_model.reference.mesh import TrackMesh
from catenary_model.statics import Sites, Statics

_ON_THE_MAST = 1e-6
"""Distance (m) within which a site belongs to the end of the mesh: rounding of the repeated period."""
_COLUMNS = tuple(field.name for field in fields(Sites) if field.name != "position")


def repeated(statics: Statics, mesh: TrackMesh) -> Sites:
    """Return the sites from the start to the end of the mesh, both masts included, by rising track position (m)."""
    one, period = statics.sites, statics.line.period
    first = int(np.floor(mesh.start / period)) - 1
    copies = int(np.ceil((mesh.end - mesh.start) / period)) + 3
    shift = np.repeat((first + np.arange(copies)) * period, one.position.size)
    position = np.tile(one.position, copies) + shift
    inside = (position > mesh.start - _ON_THE_MAST) & (position < mesh.end + _ON_THE_MAST)
    position = np.clip(position[inside], mesh.start, mesh.end)
    return Sites(position, *(np.tile(getattr(one, name), copies)[inside] for name in _COLUMNS))
