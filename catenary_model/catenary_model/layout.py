"""What the compiled kernels share: which number stands where, and the two bundles of arrays they work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# entries of Constants.real
TS, BETA, GAMMA, SPEED, START, BEHIND, AHEAD, H, FADING, PERIOD, COMPLIANCE = range(11)
# entries of Constants.whole
STATIONS, SUBSTEPS, MAX_ITERATIONS, SEGMENT_FIRST, SEGMENT_STATIONS = range(5)
GREEN_FIRST, GREEN_LAST, REACH = range(5, 8)
# columns of Constants.site
POSITION, ON_CARRIER, ON_CONTACT, STIFFNESS, INERTIA, FORCE, ELONGATION, ONE_SIDED = range(8)
# ONE_SIDED: 1 a dropper that slackens, 2 a linear one, 0 anything else
# entries of State.counter
STEPS, FIRST_SITE, NEXT_SITE, SITES, CONTACT, DROPPERS, SLACK, ITERATIONS, UNSETTLED, LISTED, PUSHED = range(11)
# entries of State.point
W_CAT, V_CAT, A_CAT, F_CAT, ZETA, WORK, IMPULSE = range(7)
# entries of State.contact
K_CONTACT, HEAD, TOUCH, GIVEN, LAST_FORCE, NEXT_CHANGE = range(6)
# columns of State.particle after displacement, velocity and acceleration
KNOWN = 3
# rows of State.here
X, FADE, FREE, PRESS, LAW_K, LAW_B, STRETCH, CARRIER, CONTACT_WIRE, LOCAL, PLACE, SOFT = range(12)
# rows of State.where
ELEMENT, SLOT, ROW, LOW = range(4)


class Constants(NamedTuple):
    """What does not change during a ride."""

    real: Array
    """Numbers, see TS (of one integration step), BETA, ..."""
    whole: Ints
    """Whole numbers, see STATIONS, ..."""
    sweep: Array
    """Factors of K_DM, see `wires.Factors`, (side, rows, wire, 8)."""
    middle: Array
    """The same of the middle station, (wire, 8)."""
    inner: Array
    """K and D of the wires, ready for the solve, for all but the first stations, (3, wire, row kind, 12)."""
    outer: Array
    """The same for the first stations, (side, wire, row kind, 12, stations)."""
    pivot: Array
    """What a nodal force is multiplied by beforehand, (wire, 4, stations)."""
    green: Array
    """K_DM^-1 near its diagonal, see `wires.green`, (rows, wire, column kind, row kind, 2 reach + 1)."""
    site: Array
    """What acts on the wires at fixed track positions in one period, by rising position, see POSITION, ..."""
    local: Array
    """What the mesh lacks in compliance at a site inside an element, m/N, (wire, samples + 1)."""
    static: Array
    """Static shape of the contact wire on a node, (samples + 1, 6), see `lattice.static_table`."""
    segment: Array
    """M, D, K of the reduced model as 2-station blocks, (3, 2 segment stations, 6), see `reduced`."""
    gain: Array
    """K_ABC transposed, (wire, end, states, inputs), see `boundary.Feedback`; no states: none."""


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    q: Array
    """Deviation, velocity, acceleration, (3, wire, w or phi, station with padding)."""
    taut: Ints
    """1 if the dropper is taut; ring over the sites' running number."""
    particle: Array
    """Displacement, velocity, acceleration of the masses on the wires, and whether they are known, (ring, 4)."""
    counter: Ints
    """Whole numbers, see STEPS, ..."""
    point: Array
    """Motion of the contact point, see W_CAT, ..."""
    contact: Array
    """Pantograph at the contact point, see K_CONTACT, ..."""
    segment: Array
    """q, q', q'' and f_held of the reduced model, (4, 2 segment stations)."""
    external: Array
    """Further nodal forces at the new instant, N and N m, (wire, w or phi, station); used if counter[PUSHED] is set."""
    layer: Array
    """Work: forces and torques of the controlled layers, (wire, end, inputs)."""
    rhs: Array
    """Work: right side, (wire, w or phi, station)."""
    here: Array
    """Work: sites in the domain, column by column, see X, ...; (columns, sites)."""
    where: Ints
    """Work: their element, slot in the rings, row in Constants.site (-1: contact), first they feel; (rows, sites)."""
    psi: Array
    """Work: their shape functions, (4, sites)."""
    compliance: Array
    """Work: elongation of a site for a unit force of another within one step, m/N; (sites, band), own in the middle."""
    system: Array
    """Work: matrix of the small system, likewise."""
    scratch: Array
    """Work: a few numbers."""
