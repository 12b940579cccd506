"""Everything that touches the wires at fixed places, as links: droppers, masts, steady arms, lumped masses, ends.

A link has the elongation e = g . q (of the deviation q) and pulls the wires back with -g lambda,

    lambda = k (e - r) + d e' + m e''    if it acts, else (a slack dropper) -F_s, its lost static force,  (3.2, 3.3)

which at Newmark's new instant is K (e - ref), K = k + d gamma/(beta Ts) + m/(beta Ts^2). The wires without links answer
a unit force with a column h = beta Ts^2 A^-1 g that has died away to the last bit within some dozen nodes and never
changes. So the links see each other through a small symmetric band matrix C_jk = g_j . h_k, and a step of everything
is a step of the free wires, one solve with C + 1/K (a few hundred unknowns) and one sum over the columns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line, Wire
from catenary_model.reference.equilibrium import Equilibrium
from catenary_model.reference.mesh import TrackMesh
from catenary_model.reference.wires import BETA, GAMMA, TS, Wires, solve
from catenary_model.statics import DROPPER, MAST, POINT_MASS, STEADY_ARM, Sites

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_DIED_AWAY = 1e-17
"""Share of a column's peak below which it counts as zero: a tenth of the rounding of the peak itself."""

ENDS = ("matched_dashpot", "clamped")
"""Kinds of ends: dashpots of the wires' own impedance rhoA c, or held displacement and rotation (3.7)."""


class Links(NamedTuple):
    """Constants of all links, by rising position; arrays over the links unless stated."""

    element: Ints
    """Element that the link sits in."""
    g: Array
    """Elongation by the fields of the element's two nodes, (links, 4, 2)."""
    one_sided: Ints
    """1 for a dropper."""
    rest: Array
    """Of a dropper: elongation at rest (m), static force (N), r (m), (links, 3)."""
    flexibility: Array
    """1/K at the new instant, m/N; 0 for what is held."""
    memory: Array
    """ref = r + memory[0] e_p + memory[1] e'_p with the predictors e_p, e'_p; (links, 2)."""
    has_memory: Ints
    """1 where `memory` is not zero."""
    first: Ints
    """First node of the column's window."""
    fields: Ints
    """First field and one past the last that the column touches, (links, 2)."""
    column: Array
    """h in the window, m/N, (links, 4, width)."""
    coupling: Array
    """C, lower band: coupling[j, band - (j - k)] = C_jk, (links, band + 1)."""
    influence: Array
    """Answer of the contact wire, far from its ends, to a unit force (0) and a unit moment (1) on a node: its w and phi
    at the nodes around, times beta Ts^2, (2, 2, 2 reach + 1)."""


class _Draft(NamedTuple):
    zeta: float
    carrier: float
    contact: float
    stiffness: float
    damping: float
    mass: float
    dropper: tuple[float, float] | None
    rotation: bool


def links(line: Line, mesh: TrackMesh, sites: Sites, rest: Equilibrium, ends: str, constants: Wires) -> Links:
    """List all links of a mesh and prepare them for the time step of `constants`.

    Raises ValueError for an unknown kind of ends, and if the mesh is shorter than one column.
    """
    return _prepare(_drafts(line, mesh, sites, rest, ends), mesh, constants)


def _drafts(line: Line, mesh: TrackMesh, sites: Sites, rest: Equilibrium, ends: str) -> list[_Draft]:
    drafts = _ends(line, mesh, ends)
    for i, zeta in enumerate(map(float, sites.position)):
        k, masses = float(sites.stiffness[i]), (float(sites.carrier_mass[i]), float(sites.contact_mass[i]))
        if sites.kind[i] == DROPPER:
            at_rest = (float(rest.elongation[i]), float(rest.force[i]))
            drafts.append(_Draft(zeta, 1.0, -1.0, k, 0.0, 0.0, at_rest, False))
        if sites.kind[i] in (DROPPER, POINT_MASS):
            for m, ca in zip(masses, (1.0, 0.0), strict=True):
                if m > 0.0:
                    drafts.append(_Draft(zeta, ca, 1.0 - ca, 0.0, 0.0, m, None, False))
        elif sites.kind[i] == MAST:
            drafts.append(_Draft(zeta, 1.0, 0.0, k, 0.0, masses[0], None, False))
        elif sites.kind[i] == STEADY_ARM and (k > 0.0 or masses[1] > 0.0):
            drafts.append(_Draft(zeta, 0.0, 1.0, k, 0.0, masses[1], None, False))
    return sorted(drafts, key=lambda draft: draft.zeta)


def _ends(line: Line, mesh: TrackMesh, kind: str) -> list[_Draft]:
    if kind not in ENDS:
        raise ValueError(f"ends = {kind!r} is not one of {', '.join(ENDS)}")
    drafts = []
    for zeta in (mesh.start, mesh.end):
        for ca, wire in ((1.0, line.carrier), (0.0, line.contact)):
            if kind == "clamped":
                drafts += [_Draft(zeta, ca, 1.0 - ca, np.inf, 0.0, 0.0, None, phi) for phi in (False, True)]
            else:
                k, d = matched(wire)
                drafts.append(_Draft(zeta, ca, 1.0 - ca, k, d, 0.0, None, False))
    return drafts


def matched(wire: Wire) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) of what replaces an endless damped string, rhoA c (w_t + beta/(2 rhoA) w)."""
    return 0.5 * wire.damping * wire.wave_speed, wire.mass_per_length * wire.wave_speed


def _prepare(drafts: list[_Draft], mesh: TrackMesh, c: Wires) -> Links:
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    scale = beta * ts**2
    n = len(drafts)
    influence = _influence(mesh, c)
    reach = influence.shape[2] // 2
    width = 2 * reach + 2
    if width > mesh.nodes:
        raise ValueError(f"the mesh has {mesh.nodes} nodes, fewer than the {width} over which a force dies away")
    element, first, one_sided, has_memory = (np.zeros(n, dtype=np.int64) for _ in range(4))
    fields, g, column = np.zeros((n, 2), dtype=np.int64), np.zeros((n, 4, 2)), np.zeros((n, 4, width))
    rest, flexibility, memory = np.zeros((n, 3)), np.zeros(n), np.zeros((n, 2))
    coupling: list[list[float]] = []
    for j, draft in enumerate(drafts):
        e, psi = mesh.locate(draft.zeta)
        if draft.rotation:
            psi = np.array([0.0, 1.0, 0.0, 0.0] if draft.zeta == mesh.start else [0.0, 0.0, 0.0, 1.0])
        for wire, sign in ((0, draft.carrier), (2, draft.contact)):
            g[j, wire : wire + 2] = sign * psi.reshape(2, 2).T
        element[j] = e
        fields[j] = 0 if draft.carrier else 2, 4 if draft.contact else 2
        K = draft.stiffness + draft.damping * gamma / (beta * ts) + draft.mass / scale
        flexibility[j] = 1.0 / K  # 0 if held
        if draft.damping or draft.mass:
            has_memory[j] = 1
            memory[j] = (draft.damping * gamma / (beta * ts) + draft.mass / scale) / K, -draft.damping / K
        if draft.dropper is not None:
            one_sided[j] = 1
            rest[j] = *draft.dropper, draft.dropper[1] / draft.stiffness - draft.dropper[0]
        y = np.zeros((4, mesh.nodes))
        y[:, e : e + 2] = scale * g[j]
        solve(c, y)
        first[j] = min(max(e - reach, 0), mesh.nodes - width)
        column[j] = y[:, first[j] : first[j] + width]
        # towards the start, until two links' columns no longer overlap
        row: list[float] = []
        for k in range(j, -1, -1):
            if element[j] - element[k] > reach:
                break
            row.append(float((g[k] * y[:, element[k] : element[k] + 2]).sum()))
        coupling.append(row)
    band = max((len(row) for row in coupling), default=1) - 1
    C = np.zeros((n, band + 1))
    for j, row in enumerate(coupling):
        C[j, band - len(row) + 1 :] = row[::-1]
    return Links(element, g, one_sided, rest, flexibility, memory, has_memory, first, fields, column, C, influence)


def _influence(mesh: TrackMesh, c: Wires) -> Array:
    """See `Links.influence`; the reach is where both wires' answers have died away."""
    middle = mesh.nodes // 2
    answers = []
    for moment in range(2):
        y = np.zeros((4, mesh.nodes))
        y[moment, middle] = y[2 + moment, middle] = c.real[BETA] * c.real[TS] ** 2
        solve(c, y)
        answers.append(y)
    reach = 1
    for y in answers:
        for f in range(4):
            large = np.abs(y[f]) > _DIED_AWAY * np.abs(y[f]).max()
            reach = max(reach, int(np.abs(np.flatnonzero(large) - middle).max()) + 1)
    reach = min(reach, middle, mesh.nodes - 1 - middle)
    return np.array([[y[2 + r, middle - reach : middle + reach + 1] for r in range(2)] for y in answers])
