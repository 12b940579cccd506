"""What the compiled kernels of the finite differences share, and their two bundles of arrays.

Where a number has the same meaning as in the finite elements' bundles (`catenary_model.layout`) it has the same name or
place, so that what both need (`sites.enlist`, the view of the wires) is written once.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from catenary_model.layout import MOVING, Array1, Array2, Array3, Array5, Ints1, Ints2, numbers

REAL = numbers(np.float64, *MOVING, "origin", "dx")
"""`Constants.real`: MOVING, distance from the pantograph back to node 0 (m), spacing of nodes (m)."""
WHOLE = numbers(np.int64, "stations", "substeps", "segment_stations", "middle", "per_element")
"""`Constants.whole`: ..., node of the pantograph, spacings an element of the reduced model."""
# entries of State.counter beyond PUSHED
NOW = 11


class Constants(NamedTuple):
    """What does not change during a ride."""

    real: Annotated[Any, REAL]
    """Numbers by name, see `catenary_model.layout`."""
    whole: Annotated[Any, WHOLE]
    """Whole numbers, likewise."""
    per_mass: Array1
    """dt^2 / (rhoA dx) of either wire, 1/(N/m), (wire,)."""
    reach: Ints1
    """Nodes to either side that the interior scheme of a wire reads, (wire,)."""
    inner: Array3
    """Factors of the interior scheme, padded with zeros, (wire, 3, weights), see `wires.factors`."""
    edge: Array5
    """Boundary stencils, all of old values, (wire, side, level, N_x, node), nodes counted inwards."""
    carry: Array1
    """Weights I of the shift by v dt: where a force that stands on a node goes, (2 reach + 1,)."""
    site: Array2
    """What acts on the wires at fixed track positions in one period, see `catenary_model.layout`."""
    local: Array2
    """What the grid lacks in compliance at a site between two nodes, m/N, (wire, samples + 1)."""
    static: Array2
    """Static shape of the contact wire on a node: w, w', w'', (samples + 1, 6), see `grid.static_table`."""
    rest: Array2
    """Static shape as the elements of the reduced model have it, likewise, see `lattice.static_table`."""
    project: Array2
    """Weights of nodes around an element's node that give its w and phi, see `grid.projection`, (2, nodes)."""
    segment: Array3
    """M, D, K of the reduced model, (3, 2 segment stations, 6)."""


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    w: Array3
    """Deviation from the static shape: time levels in a ring, (levels, wire, node)."""
    taut: Ints1
    """1 if the dropper is taut; ring over the sites' running number."""
    particle: Array2
    """Places of the masses on the wires at the last two instants, whether they are known, nothing, (ring, 4)."""
    counter: Ints1
    """Whole numbers, see `catenary_model.layout` and NOW."""
    point: Array1
    """Motion of the contact point, see W_CAT, ..."""
    contact: Array1
    """Pantograph at the contact point, see GIVEN, ..."""
    segment: Array2
    """q, q', q'' and f_held of the reduced model, (4, 2 segment stations)."""
    external: Array2
    """Further forces on the nodes at the present instant, N, (wire, node); used if counter[PUSHED] is set."""
    here: Array2
    """Work: sites in the domain, column by column; (columns, sites)."""
    where: Ints2
    """Work: their node behind, slot in the rings, row in Constants.site (-1: contact), nothing; (rows, sites)."""
    psi: Array2
    """Work: their weights, (4, sites)."""
    between: Array1
    """Work: what the interior scheme carries on by v dt, (nodes,)."""
    ends: Array2
    """Work: new values of the boundary nodes, (side, node)."""


def _with(bundle: Any, name: str) -> Any:
    """Make the bundle with one more array at its end, of which each row is a companion."""
    fields = [*get_type_hints(bundle, include_extras=True).items(), (name, Array2)]
    return NamedTuple(f"{bundle.__name__}Together", fields)  # type: ignore[misc]


# Bundles of their own: an array more in those of one alone takes 4 % of its cycle, whether it is used or not.
ConstantsTogether = _with(Constants, "beside")
"""With companions, see `companions.AT`, ..., (companions, columns)."""
StateTogether = _with(State, "aside")
"""With companions, see `companions.PLACE`, ..., (companions, columns)."""
