"""What acts on the wires at fixed track positions, as the kernels have it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from catenary_model import statics

Array = NDArray[np.float64]


def site_table(at_rest: statics.Statics, one_sided: bool = True) -> Array:
    """Rows of `layout.Constants.site` for one period: droppers, masts, arms and masses; a dropper's on either wire."""
    rows, law = [], 1.0 if one_sided else 2.0
    for i in range(at_rest.sites.position.size):
        x, kind = at_rest.sites.position[i], at_rest.sites.kind[i]
        k, masses = at_rest.sites.stiffness[i], (at_rest.sites.carrier_mass[i], at_rest.sites.contact_mass[i])
        if kind in (statics.DROPPER, statics.POINT_MASS):
            if kind == statics.DROPPER:
                rows.append((x, 1.0, -1.0, k, 0.0, at_rest.sites.force[i], at_rest.sites.elongation[i], law))
            for m, wire in zip(masses, ((1.0, 0.0), (0.0, 1.0)), strict=True):
                if m > 0.0:
                    rows.append((x, *wire, 0.0, m, 0.0, 0.0, 0.0))
        elif k > 0.0 or sum(masses) > 0.0:
            on_carrier = 1.0 if kind == statics.MAST else 0.0
            rows.append((x, on_carrier, 1.0 - on_carrier, k, masses[0] if on_carrier else masses[1], 0.0, 0.0, 0.0))
    return np.array(rows, dtype=np.float64).reshape(len(rows), 8)
