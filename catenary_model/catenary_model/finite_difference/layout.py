"""What the compiled kernels of the finite differences share, and their two bundles of arrays.

Where a number has the same meaning as in the finite elements' bundles (`catenary_model.layout`) it has the same place,
so that what both need (`sites.enlist`, the view of the wires) is written once.
"""

from __future__ import annotations

from typing import NamedTuple

from catenary_model.arena import five, one, three, two
from catenary_model.layout import Array, Ints
from phil_base.kernels import njit

# entries of Constants.real beyond those of `catenary_model.layout`; BEHIND and AHEAD are where sites begin and end
ORIGIN = 11
"""Distance from the pantograph back to node 0, m."""
DX, PER_MASS = 12, 13
"""Spacing, m, and (13, 14) dt^2 / (rhoA dx) of either wire, 1/(N/m)."""
# entries of Constants.whole beyond SEGMENT_STATIONS
MIDDLE, REACH, PER_ELEMENT = 5, 6, 8
"""Node of the pantograph; (6, 7) nodes to either side that the interior scheme of a wire reads; spacings an element."""
# entries of State.counter beyond PUSHED
NOW = 11


class Constants(NamedTuple):
    """What does not change during a ride."""

    real: Array
    """Numbers, see `catenary_model.layout` and ORIGIN, ..."""
    whole: Ints
    """Whole numbers, see `catenary_model.layout` and MIDDLE, ..."""
    inner: Array
    """Weights of the interior scheme, padded with zeros to a multiple of seven, (wire, level, weights)."""
    edge: Array
    """Boundary stencils, all of old values, (wire, side, level, N_x, node), nodes counted inwards."""
    carry: Array
    """Weights I of the shift by v dt: where a force that stands on a node goes, (2 reach + 1,)."""
    site: Array
    """What acts on the wires at fixed track positions in one period, see `catenary_model.layout`."""
    local: Array
    """What the grid lacks in compliance at a site between two nodes, m/N, (wire, samples + 1)."""
    static: Array
    """Static shape of the contact wire on a node: w, w', w'', (samples + 1, 6), see `grid.static_table`."""
    rest: Array
    """Static shape as the elements of the reduced model have it, likewise, see `lattice.static_table`."""
    project: Array
    """Weights of nodes around an element's node that give its w and phi, see `grid.projection`, (2, nodes)."""
    segment: Array
    """M, D, K of the reduced model, (3, 2 segment stations, 6)."""


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    w: Array
    """Deviation from the static shape: time levels in a ring, (levels, wire, node)."""
    taut: Ints
    """1 if the dropper is taut; ring over the sites' running number."""
    particle: Array
    """Places of the masses on the wires at the last two instants, whether they are known, nothing, (ring, 4)."""
    counter: Ints
    """Whole numbers, see `catenary_model.layout` and NOW."""
    point: Array
    """Motion of the contact point, see W_CAT, ..."""
    contact: Array
    """Pantograph at the contact point, see GIVEN, ..."""
    segment: Array
    """q, q', q'' and f_held of the reduced model, (4, 2 segment stations)."""
    external: Array
    """Further forces on the nodes at the present instant, N, (wire, node); used if counter[PUSHED] is set."""
    here: Array
    """Work: sites in the domain, column by column; (columns, sites)."""
    where: Ints
    """Work: their node behind, slot in the rings, row in Constants.site (-1: contact), nothing; (rows, sites)."""
    psi: Array
    """Work: their weights, (4, sites)."""
    ends: Array
    """Work: new values of the boundary nodes, (side, node)."""


@njit(cache=True)
def unpack(floats: Array, whole: Ints, table: Ints) -> tuple[Constants, State]:
    """Put the bundles together again, in compiled code."""
    c = Constants(
        real=one(floats, table[0]),
        whole=one(whole, table[1]),
        inner=three(floats, table[2]),
        edge=five(floats, table[3]),
        carry=one(floats, table[4]),
        site=two(floats, table[5]),
        local=two(floats, table[6]),
        static=two(floats, table[7]),
        rest=two(floats, table[8]),
        project=two(floats, table[9]),
        segment=three(floats, table[10]),
    )
    s = State(
        w=three(floats, table[11]),
        taut=one(whole, table[12]),
        particle=two(floats, table[13]),
        counter=one(whole, table[14]),
        point=one(floats, table[15]),
        contact=one(floats, table[16]),
        segment=two(floats, table[17]),
        external=two(floats, table[18]),
        here=two(floats, table[19]),
        where=two(whole, table[20]),
        psi=two(floats, table[21]),
        ends=two(floats, table[22]),
    )
    return c, s
