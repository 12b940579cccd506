"""Static equilibrium and uplift against an independent finite-element solution on a fine mesh."""

import dataclasses
import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from odd_lines import uneven_line, with_lengths
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from catenary_model import statics
from catenary_model.line import Line, Mast, SteadyArm
from catenary_model.statics import DROPPER, MAST, STEADY_ARM
from catenary_model.stiffness import PushedLine

Array = NDArray[np.float64]

SPAN = Line().spans[0]


class FineMesh:
    """Both wires of one domain that repeats itself, in Hermite elements of at most `h` with nodes at every site.

    Own matrices, dropper lengths instead of demanded heights, penalty-free masts: shares nothing with the closed form.
    """

    def __init__(self, line: Line, copies: int, h: float, also: tuple[float, ...] = ()) -> None:
        self.line, period = line, line.period
        self.length = copies * period
        self.sites = [
            (kind, start + c * period + at, entry)
            for c in range(copies)
            for start, span in zip(line.span_starts, line.spans, strict=True)
            for kind, at, entry in [
                (MAST, 0.0, span.mast),
                (STEADY_ARM, 0.0, span.steady_arm),
                *((DROPPER, d.position, d) for d in span.droppers),
            ]
            if entry is not None
        ]
        stops = sorted({0.0, self.length, *also, *(at for _, at, _ in self.sites)})
        pieces = [
            np.linspace(a, b, max(1, int(np.ceil((b - a) / h - 1e-9))), endpoint=False)
            for a, b in itertools.pairwise(stops)
        ]
        self.nodes = np.concatenate(pieces)
        self.n = self.nodes.size

    def node(self, at: float) -> int:
        i = int(np.abs(self.nodes - at).argmin())
        assert abs(self.nodes[i] - at) < 1e-9
        return i

    def solve(self, lengths: Array, *, springs: bool, height: Array, force: float = 0.0, at: float = 0.0) -> Array:
        """Displacements (wire, node): masts fixed at their encumbrance, or as springs about `height` of the carrier."""
        n, line = self.n, self.line
        rows, cols, data = [], [], []
        load = np.zeros(4 * n)
        h = np.diff(np.append(self.nodes, self.length))
        for w, wire in ((0, line.carrier), (1, line.contact)):
            EI, T, q = wire.bending_stiffness, wire.tension, -wire.mass_per_length * line.gravity
            o = np.ones_like(h)
            bend = np.array([[12 * o, 6 * h, -12 * o, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
            bend = np.concatenate((bend, [-bend[0], [6 * h, 2 * h**2, -6 * h, 4 * h**2]])) * EI / h**3
            pull = np.array([[36 * o, 3 * h, -36 * o, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)]])
            pull = np.concatenate((pull, [-pull[0], [3 * h, -(h**2), -3 * h, 4 * h**2]])) * T / (30 * h)
            left = np.arange(n)
            right = (left + 1) % n
            dofs = np.array([4 * left + 2 * w, 4 * left + 2 * w + 1, 4 * right + 2 * w, 4 * right + 2 * w + 1])
            for i, j in itertools.product(range(4), range(4)):
                rows.append(dofs[i])
                cols.append(dofs[j])
                data.append((bend + pull)[i, j])
            for i, share in enumerate((h / 2, h**2 / 12, h / 2, -(h**2) / 12)):
                np.add.at(load, dofs[i], q * share)
        K = coo_matrix((np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))), (4 * n, 4 * n)).tolil()
        if force:
            load[4 * self.node(at) + 2] += force
        fixed: dict[int, float] = {}
        droppers = []
        for kind, place, entry in self.sites:
            i = self.node(place)
            if isinstance(entry, Mast):
                if springs:
                    K[4 * i, 4 * i] += entry.stiffness
                    load[4 * i] += entry.stiffness * height[0, i] + height[2, i]
                else:
                    fixed[4 * i] = entry.encumbrance
            elif isinstance(entry, SteadyArm):
                if springs:
                    K[4 * i + 2, 4 * i + 2] += entry.stiffness
                    load[4 * i + 2] += entry.stiffness * height[1, i]
            else:
                assert kind == DROPPER
                load[[4 * i, 4 * i + 2]] -= 0.5 * entry.mass * line.gravity
                droppers.append((i, entry.stiffness))
        free = np.setdiff1d(np.arange(4 * n), list(fixed))
        x = np.zeros(4 * n)
        for dof, value in fixed.items():
            x[dof] = value
        taut = np.ones(len(droppers), dtype=np.bool_)
        for _ in range(20):
            stiff, f = K.copy(), load.copy()
            for on, (i, k_d), l_0 in zip(taut, droppers, lengths, strict=True):
                if on:
                    for a, b, sign in ((0, 0, 1), (0, 2, -1), (2, 0, -1), (2, 2, 1)):
                        stiff[4 * i + a, 4 * i + b] += sign * k_d
                    f[4 * i] += k_d * l_0
                    f[4 * i + 2] -= k_d * l_0
            matrix = stiff.tocsc()
            x[free] = spsolve(matrix[free][:, free], (f - matrix[:, list(fixed)] @ x[list(fixed)])[free])
            now = np.array([x[4 * i] - x[4 * i + 2] > l_0 for (i, _), l_0 in zip(droppers, lengths, strict=True)])
            if (now == taut).all():
                break
            taut = now
        self.dropper_forces = np.array(
            [max(0.0, k_d * (x[4 * i] - x[4 * i + 2] - l_0)) for (i, k_d), l_0 in zip(droppers, lengths, strict=True)]
        )
        reaction = K.tocsr() @ x - load
        for (i, _), F in zip(droppers, self.dropper_forces, strict=True):
            reaction[4 * i] += F
        return np.array([x[0::4], x[2::4], reaction[0::4]])


@pytest.mark.parametrize("slack", [False, True])
@pytest.mark.parametrize("line", [Line(), uneven_line()], ids=["table 3.1", "uneven"])
@pytest.mark.slow
def test_equilibrium_against_a_fine_mesh(line: Line, slack: bool) -> None:
    """Elements of 0.05 m with nodes at the clamps, given the computed lengths (and one dropper 60 mm too long).

    Such a mesh lacks 2.6e-10 m/N under a point load (`lattice.local_compliance`), a mast carries 1.4 kN: 0.4 um.
    """
    lengths = statics.solve(line).dropper_lengths
    lengths[4] += 0.06 * slack
    rest = statics.solve(with_lengths(line, lengths))
    mesh = FineMesh(line, 1, 0.05)
    carrier, contact, reaction = mesh.solve(lengths, springs=False, height=np.zeros(0))
    np.testing.assert_allclose(contact, rest.contact(mesh.nodes), atol=1e-6)
    np.testing.assert_allclose(carrier, rest.carrier(mesh.nodes), atol=1e-6)
    np.testing.assert_allclose(mesh.dropper_forces, rest.dropper_forces, atol=1e-3)
    assert (rest.dropper_forces == 0.0).sum() == slack
    masts = [mesh.node(at) for at in line.span_starts]
    np.testing.assert_allclose(reaction[masts], rest.sites.force[rest.sites.kind == MAST], atol=1e-3)


@pytest.mark.parametrize(("at", "force"), [(30.0, 100.0), (26.0, 100.0), (60.0, 250.0), (55.0, 250.0)])
@pytest.mark.slow
def test_uplift_against_a_fine_mesh(at: float, force: float) -> None:
    """Seven spans with soft masts and arms, 0.1 m elements; 250 N make droppers slack.

    Such a mesh lacks 4e-9 m/N under a point load of the 4e-4 m/N that it should have: 1e-5; seven spans are as good as
    an endless line to 1e-6.
    """
    span = dataclasses.replace(SPAN, mast=Mast(stiffness=5e4), steady_arm=SteadyArm(stiffness=300.0))
    line = Line(spans=(span,))
    rest = statics.solve(line)
    mesh = FineMesh(line, 7, 0.1, also=(at,))
    lengths = np.tile(rest.dropper_lengths, 7)
    height = mesh.solve(lengths, springs=False, height=np.zeros(0))
    pushed = mesh.solve(lengths, springs=True, height=height, force=force, at=at)
    line_pushed = PushedLine(rest).push(at, force)
    i = mesh.node(at)
    assert line_pushed.uplift == pytest.approx(pushed[1, i] - height[1, i], rel=5e-5)
    near = np.abs(mesh.nodes - at) < 40.0
    np.testing.assert_allclose(line_pushed.contact(mesh.nodes[near]), (pushed - height)[1, near], atol=5e-6)
    slack = np.count_nonzero(line_pushed.dropper_forces == 0.0)
    assert slack == np.count_nonzero(mesh.dropper_forces == 0.0)
    assert (slack > 0) == (force > 200.0)
