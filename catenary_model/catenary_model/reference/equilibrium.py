"""Static equilibrium of the line as the mesh sees it: finite elements, gravity, one-sided droppers.

    K W = f_g - sum_d g_d F_d - constraints,     F_d = k_d (g_d . W - l_0)  if that is positive, else 0

with g_d . W = carrier minus contact wire at the clamps (shape functions), the droppers' weights at the clamps,
the carrier held at the encumbrance on every mast and, at the two ends only, the contact wire at the height and both
wires at the slope of the closed form (`statics`). Where the mesh rounds the kink at a clamp, so does W: it is the
shape about which the deviation has to be integrated, since a dropper that goes slack takes the mesh's kink away, not
the exact one.

`solve` finds F for the unstressed lengths l_0 of the closed form, independently of it. The two agree up to the mesh:
at a mast more than 1 kN hangs on a carrier that bends over 8 cm; elements of 1 m (0.25 m) get this 3 mm (0.13 mm) wrong
for the whole span, and 5 N (0.24 N) shift between the droppers. `carry` therefore gives the droppers the exact forces
and elongations of the closed form and solves for the shape alone, which leaves an error within some elements of each
clamp (0.15 mm, 0.006 mm); it amounts to droppers cut for this mesh. Rides start from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from catenary_model import elements
from catenary_model.line import Line
from catenary_model.reference.mesh import TrackMesh
from catenary_model.statics import DROPPER, MAST, POINT_MASS, Sites, Statics

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_MAX_PASSES = 200
_PATIENCE = 20


@dataclass(frozen=True)
class Equilibrium:
    """The line at rest on a mesh."""

    nodal: Array
    """w_ca (m), phi_ca (1), w_co, phi_co at the nodes, total heights, (4, nodes)."""
    force: Array
    """Tension of every dropper (N, 0 is slack), upward force of every mast (N), 0 for arms; by `sites`, (sites,)."""
    elongation: Array
    """Of every dropper against its unstressed length, m; negative is slack; 0 for others, (sites,)."""


def wire_matrices(line: Line, mesh: TrackMesh) -> tuple[sparse.csc_array, sparse.csc_array, sparse.csc_array]:
    """Return sparse M, D, K of both free wires at rest in the track's frame; degree of freedom 4 node + 2 wire + r."""
    rows, columns = [], []
    values: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    e = np.arange(mesh.elements)
    for which, wire in enumerate((line.carrier, line.contact)):
        m = elements.mass(mesh.h)
        k = wire.bending_stiffness * elements.bending(mesh.h) + wire.tension * elements.tension(mesh.h)
        own, b = 2 * which + np.array([0, 1, 4, 5]), wire.stiffness_damping
        for i in range(4):
            for j in range(4):
                rows.append(4 * e + own[i])
                columns.append(4 * e + own[j])
                for kept, block in zip(values, (wire.mass_per_length * m, wire.damping * m + b * k, k), strict=True):
                    kept.append(np.full(mesh.elements, block[i, j]))
    at = (np.concatenate(rows), np.concatenate(columns))
    n = 4 * mesh.nodes
    M, D, K = (sparse.coo_array((np.concatenate(kept), at), shape=(n, n)).tocsc() for kept in values)
    return M, D, K


def incidence(mesh: TrackMesh, position: Array, carrier: Array, contact: Array) -> sparse.csr_array:
    """Return g as rows: carrier times the carrier's displacement plus contact times the contact wire's, at position."""
    g = sparse.lil_array((position.size, 4 * mesh.nodes))
    for i, (zeta, ca, co) in enumerate(zip(position, carrier, contact, strict=True)):
        e, psi = mesh.locate(float(zeta))
        for j in range(4):
            column = 4 * (e + j // 2) + j % 2
            if ca != 0.0:
                g[i, column] = ca * psi[j]
            if co != 0.0:
                g[i, column + 2] = co * psi[j]
    return g.tocsr()


def weight(line: Line, mesh: TrackMesh, sites: Sites) -> Array:
    """Nodal forces and moments of gravity, (4 nodes,): wires, droppers, point masses; steady arms carry themselves.

    Without any dropper the contact wire hangs from nothing, its weight is left out as in `statics`.
    """
    f = np.zeros((mesh.nodes, 4))
    consistent = mesh.h * np.array([1.0 / 2.0, mesh.h / 12.0, 1.0 / 2.0, -mesh.h / 12.0])
    droppers = sites.kind == DROPPER
    for which, wire in enumerate((line.carrier, line.contact)):
        if which == 1 and not droppers.any():
            continue
        load = -wire.mass_per_length * line.gravity * consistent
        f[:-1, 2 * which : 2 * which + 2] += load[:2]
        f[1:, 2 * which : 2 * which + 2] += load[2:]
    loaded = droppers | (sites.kind == POINT_MASS)
    ones, none = np.ones(int(loaded.sum())), np.zeros(int(loaded.sum()))
    total = f.ravel()
    for on_carrier, on_contact, mass in ((ones, none, sites.carrier_mass), (none, ones, sites.contact_mass)):
        clamps = incidence(mesh, sites.position[loaded], on_carrier, on_contact)
        total = total - clamps.T @ (line.gravity * mass[loaded])
    return np.asarray(total)


@dataclass(frozen=True)
class _System:
    """What both ways of solving share."""

    K: sparse.csc_array
    load: Array
    g: sparse.csr_array
    """Elongation of the droppers."""
    held: sparse.csr_array
    """Rows of what is held: the carrier at every mast; at both ends the contact wire, and the slopes of both wires."""
    height: Array
    """Heights (m) and slopes (1) at which it is held."""
    droppers: NDArray[np.int64]
    masts: NDArray[np.int64]

    @classmethod
    def of(cls, statics: Statics, mesh: TrackMesh, sites: Sites) -> _System:
        drop, mast = np.flatnonzero(sites.kind == DROPPER), np.flatnonzero(sites.kind == MAST)
        ends = np.array([mesh.start, mesh.end])
        rotations = np.array([1, 3, 4 * mesh.nodes - 3, 4 * mesh.nodes - 1])
        held = sparse.vstack(
            [
                incidence(mesh, sites.position[mast], np.ones(mast.size), np.zeros(mast.size)),
                incidence(mesh, ends, np.zeros(2), np.ones(2)),
                sparse.coo_array((np.ones(4), (np.arange(4), rotations)), shape=(4, 4 * mesh.nodes)),
            ]
        )
        contact, carrier = statics.contact_beam, statics.carrier_beam
        slope = np.array([beam.slope(ends) for beam in (carrier, contact)]).T.ravel()
        return cls(
            wire_matrices(statics.line, mesh)[2],
            weight(statics.line, mesh, sites),
            incidence(mesh, sites.position[drop], np.ones(drop.size), -np.ones(drop.size)),
            sparse.csr_array(held),
            np.concatenate([statics.carrier(sites.position[mast]), statics.contact(ends), slope]),
            drop,
            mast,
        )

    def displaced(self, springs: sparse.csc_array | None, load: Array) -> tuple[Array, Array]:
        """Return W, (4 nodes,), and the forces that hold the masts, N up."""
        n = self.K.shape[0]
        K = self.K if springs is None else self.K + springs
        zero = sparse.csc_array((self.height.size, self.height.size))
        system = sparse.block_array([[K, self.held.T], [self.held, zero]]).tocsc()
        solution = linalg.spsolve(system, np.concatenate([load, self.height]))
        return solution[:n], -solution[n : n + self.masts.size]

    def equilibrium(self, W: Array, tension: Array, stretch: Array, mast_force: Array, sites: Sites) -> Equilibrium:
        force, elongation = np.zeros(sites.kind.size), np.zeros(sites.kind.size)
        force[self.droppers], elongation[self.droppers] = tension, stretch
        force[self.masts] = mast_force
        return Equilibrium(np.ascontiguousarray(W.reshape(-1, 4).T), force, elongation)


def carry(statics: Statics, mesh: TrackMesh, sites: Sites) -> Equilibrium:
    """Solve for the shape under the exact dropper forces; elongations are the exact ones as well."""
    system = _System.of(statics, mesh, sites)
    force = sites.force[system.droppers]
    W, mast_force = system.displaced(None, system.load - system.g.T @ force)
    return system.equilibrium(W, force, sites.elongation[system.droppers], mast_force, sites)


def solve(statics: Statics, mesh: TrackMesh, sites: Sites) -> Equilibrium:
    """Solve for shape and forces with the unstressed lengths as they are, by Newton steps over the taut droppers.

    Raises ValueError if no set of taut droppers is consistent.
    """
    system = _System.of(statics, mesh, sites)
    k_d, length, g = sites.stiffness[system.droppers], sites.length[system.droppers], system.g
    taut: Flags = sites.force[system.droppers] > 0.0
    for attempt in range(_MAX_PASSES):
        pull = sparse.diags_array(k_d * taut)
        W, mast_force = system.displaced((g.T @ pull @ g).tocsc(), system.load + g.T @ (k_d * taut * length))
        stretch = g @ W - length
        wrong = np.flatnonzero(taut != (stretch > 0.0))
        if wrong.size == 0:
            return system.equilibrium(W, np.where(taut, k_d * stretch, 0.0), stretch, mast_force, sites)
        # all at once converges in a few passes; should it cycle, one at a time, the worst offender first
        flip = wrong if attempt < _PATIENCE else wrong[[np.abs(stretch[wrong]).argmax()]]
        taut[flip] = ~taut[flip]
    raise ValueError("the droppers' lengths leave no static equilibrium on this mesh")
