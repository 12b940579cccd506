"""What the compiled kernels share: which number stands where, and the two bundles of arrays they work on."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Kind(NamedTuple):
    """What an array of a bundle is, beside its shape: `arena` puts bundles together by it."""

    kind: type[np.generic]
    """Of its entries: float64 or int64."""
    dimensions: int
    """From 1 to 5."""


def numbers(kind: type[np.generic], *names: str) -> np.dtype[np.void]:
    """Describe a record of numbers of one kind, float64 or int64, that compiled code reads by their names."""
    return np.dtype([(name, kind) for name in names])


Array1 = Annotated[Array, Kind(np.float64, 1)]
Array2 = Annotated[Array, Kind(np.float64, 2)]
Array3 = Annotated[Array, Kind(np.float64, 3)]
Array4 = Annotated[Array, Kind(np.float64, 4)]
Array5 = Annotated[Array, Kind(np.float64, 5)]
Ints1 = Annotated[Ints, Kind(np.int64, 1)]
Ints2 = Annotated[Ints, Kind(np.int64, 2)]

MOVING = "ts", "speed", "start", "behind", "ahead", "h", "fading", "period", "compliance"
"""Numbers of every scheme: integration step (s), v (m/s), zeta_0 (m), distances from the pantograph to where sites end
behind and ahead (m), spacing of nodes (m), stretch of fading (m), period of the line (m), what the mesh lacks in
compliance under the contact (m/N)."""
REAL = numbers(np.float64, *MOVING, "beta", "gamma")
"""`Constants.real`: MOVING and Newmark's parameters."""
WHOLE = numbers(
    np.int64,
    *("stations", "substeps", "max_iterations", "segment_first", "segment_stations"),
    *("green_first", "green_last", "reach"),
)
"""`Constants.whole`."""
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

    real: Annotated[Any, REAL]
    """Numbers by name; in Python `real["ts"]`."""
    whole: Annotated[Any, WHOLE]
    """Whole numbers, likewise."""
    sweep: Array4
    """Factors of K_DM, see `wires.Factors`, (side, rows, wire, 8)."""
    middle: Array2
    """The same of the middle station, (wire, 8)."""
    inner: Array4
    """K and D of the wires, ready for the solve, for all but the first stations, (3, wire, row kind, 12)."""
    outer: Array5
    """The same for the first stations, (side, wire, row kind, 12, stations)."""
    pivot: Array3
    """What a nodal force is multiplied by beforehand, (wire, 4, stations)."""
    green: Array5
    """K_DM^-1 near its diagonal, see `wires.green`, (rows, wire, column kind, row kind, 2 reach + 1)."""
    site: Array2
    """What acts on the wires at fixed track positions in one period, by rising position, see POSITION, ..."""
    local: Array2
    """What the mesh lacks in compliance at a site inside an element, m/N, (wire, samples + 1)."""
    static: Array2
    """Static shape of the contact wire on a node, (samples + 1, 6), see `lattice.static_table`."""
    segment: Array3
    """M, D, K of the reduced model as 2-station blocks, (3, 2 segment stations, 6), see `reduced`."""
    gain: Array4
    """K_ABC transposed, (wire, end, states, inputs), see `boundary.Feedback`; no states: none."""
    beside: Array2
    """Companions, see `companions.AT`, ..., (companions, columns)."""
    riders: Array2
    """Places x of all pantographs, rising (m), and what stands for them in `State.where`: -1 at x = 0, -2 - r companion
    r, (2, pantographs)."""


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    q: Array4
    """Deviation, velocity, acceleration, (3, wire, w or phi, station with padding)."""
    taut: Ints1
    """1 if the dropper is taut; ring over the sites' running number."""
    particle: Array2
    """Displacement, velocity, acceleration of the masses on the wires, and whether they are known, (ring, 4)."""
    counter: Ints1
    """Whole numbers, see STEPS, ..."""
    point: Array1
    """Motion of the contact point, see W_CAT, ..."""
    contact: Array1
    """Pantograph at the contact point, see K_CONTACT, ..."""
    segment: Array2
    """q, q', q'' and f_held of the reduced model, (4, 2 segment stations)."""
    external: Array3
    """Further nodal forces at the new instant, N and N m, (wire, w or phi, station); used if counter[PUSHED] is set."""
    layer: Array3
    """Work: forces and torques of the controlled layers, (wire, end, inputs)."""
    rhs: Array3
    """Work: right side, (wire, w or phi, station)."""
    here: Array2
    """Work: sites in the domain, column by column, see X, ...; (columns, sites)."""
    where: Ints2
    """Work: their element, slot in the rings, row in `Constants.site` (< 0: a pantograph), first they feel."""
    psi: Array2
    """Work: their shape functions, (4, sites)."""
    compliance: Array2
    """Work: elongation of a site for a unit force of another within one step, m/N; (sites, band), own in the middle."""
    system: Array2
    """Work: matrix of the small system, likewise."""
    scratch: Array1
    """Work: a few numbers."""
    aside: Array2
    """Companions, see `companions.PLACE`, ..., (companions, columns)."""
