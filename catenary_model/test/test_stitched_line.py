"""Lines with stitch wires at rest and pushed: against a fine mesh, as laws, and what is refused."""

import dataclasses
from importlib import resources

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from catenary_model import elements, reference, statics
from catenary_model.build import Config
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm, StitchWire, Wire
from catenary_model.line_file import LineFileError, dump_line, load_line, parse_line
from catenary_model.statics import DROPPER, MAST, STEADY_ARM, Statics
from catenary_model.stiffness import PushedLine

Array = NDArray[np.float64]

CARRIER, CONTACT = Wire(1.06, 0.2, 130.0, 21e3), Wire(1.067, 0.2, 125.0, 27e3)
STITCH = StitchWire(18.0, 3500.0, 0.31, 5.0, 0.2)


def dropper(position: float, on: str = "carrier", **more: float) -> Dropper:
    return Dropper(position, hangs_from=on, **more)  # type: ignore[arg-type]


def two_spans() -> Line:
    """A span of 50 m between a stitched mast and a plain one, and one of 40 m back: nothing is symmetric."""
    first = Span(
        50.0,
        (
            dropper(3.0, "stitch_wire", mass=0.4),
            dropper(6.0, "stitch_wire"),
            dropper(15.0),
            dropper(30.0),
            dropper(44.0),
        ),
        0.02,
        Mast(5e5, 1.6),
        SteadyArm(300.0, 0.5),
        stitch_wire=STITCH,
    )
    second = Span(40.0, (dropper(5.0), dropper(15.0), dropper(25.0), dropper(34.5, "stitch_wire")), 0.0, Mast(4e5, 1.5))
    return Line(CARRIER, CONTACT, (first, second), name="two_spans")


LINES = {"two_spans": two_spans(), "re330_stitched": load_line("re330_stitched")}


class FineMesh:
    """Both wires and all stitch wires of one period by Hermite elements, 20 mm long around every kink.

    Places of elements: graded, h = 0.02 + d/20 with the distance d to the nearest load; a kink is rounded over 0.04 to
    0.08 m here, of which cubic elements leave an error well below 1e-5 m.
    """

    def __init__(self, rest: Statics) -> None:
        line, sites = rest.line, rest.sites
        self.period, self.fields = line.period, []
        pulled = [(start, span.stitch_wire) for start, span in zip(line.span_starts, line.spans, strict=True)]
        self.stitches = {i: (mast, wire) for i, (mast, wire) in enumerate(pulled) if wire is not None}
        ends = [mast + 0.5 * e * wire.length for mast, wire in self.stitches.values() for e in (-1, 1)]
        loads = np.mod(np.concatenate((sites.position, ends)), self.period)
        self.x = self.graded(np.unique(loads.round(9)), self.period)
        n = self.x.size
        count, self.offset = 4 * n, {}
        rows, columns, values = [], [], []
        self.f = np.zeros(4 * n + sum(2 * n for _ in self.stitches))

        def add(dofs: list[int], wire: Wire, tension: float, h: float) -> None:
            K = wire.bending_stiffness * elements.bending(h) + tension * elements.tension(h)
            rows.append(np.repeat(dofs, 4))
            columns.append(np.tile(dofs, 4))
            values.append(K.ravel())
            q = wire.mass_per_length * line.gravity
            np.add.at(self.f, dofs, -q * h * np.array([0.5, h / 12, 0.5, -h / 12]))

        h = np.diff(self.x, append=self.x[0] + self.period)
        for i in range(n):
            j = (i + 1) % n
            middle = self.x[i] + 0.5 * h[i]
            eased = sum(wire.tension for mast, wire in self.stitches.values() if self.near(middle - mast, wire.length))
            add([2 * i, 2 * i + 1, 2 * j, 2 * j + 1], line.carrier, line.carrier.tension - eased, h[i])
            add([2 * (n + i), 2 * (n + i) + 1, 2 * (n + j), 2 * (n + j) + 1], line.contact, line.contact.tension, h[i])
        for s, (mast, wire) in self.stitches.items():
            self.offset[s] = count
            for i in range(n):
                j = (i + 1) % n
                if self.near(self.x[i] + 0.5 * h[i] - mast, wire.length):
                    add(
                        [self.on(s, i), count + 2 * i + 1, self.on(s, j), count + 2 * j + 1],
                        wire.wire,
                        wire.tension,
                        h[i],
                    )
            for i in self.ends(s):
                self.f[2 * i] -= wire.clamp * line.gravity
            count += 2 * n
        shape = (count, count)
        self.K = sparse.coo_array(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
        )
        self.line, self.sites = line, sites

    @staticmethod
    def graded(loads: Array, period: float) -> Array:
        x = [float(loads[0])]
        for a, b in zip(loads, [*loads[1:], loads[0] + period], strict=True):
            steps, at = [], a
            while at < b - 1e-12:
                at = min(at + 0.02 + min(at - a, max(b - at, 0.0)) / 20.0, b)
                steps.append(at if b - at > 0.01 else b)
                at = steps[-1]
            x += steps
        return np.array(x[:-1])

    def near(self, distance: float, length: float) -> bool:
        return abs((distance + 0.5 * self.period) % self.period - 0.5 * self.period) < 0.5 * length

    def node(self, place: float) -> int:
        distance = np.abs((self.x - place + 0.5 * self.period) % self.period - 0.5 * self.period)
        assert distance.min() < 1e-8
        return int(distance.argmin())

    def ends(self, s: int) -> list[int]:
        mast, wire = self.stitches[s]
        return [self.node(mast + 0.5 * e * wire.length) for e in (-1, 1)]

    def on(self, s: int, node: int) -> int:
        """Height of a stitch wire: at its ends that of the carrier."""
        return 2 * node if node in self.ends(s) else self.offset[s] + 2 * node

    def solve(self, length: Array, push: tuple[float, float] | None = None) -> tuple[Array, Array]:
        """Dropper forces (N) and heights, all droppers taut; at rest on rigid masts, pushed on their springs."""
        sites, g, f = self.sites, [], self.f.copy() if push is None else np.zeros(self.f.size)
        k, drop = [], 0
        for i, at in enumerate(sites.position):
            node, row = self.node(at), np.zeros(self.f.size)
            above = 2 * node if sites.stitch[i] < 0 else self.on(int(sites.stitch[i]), node)
            below = 2 * (self.x.size + node)
            if sites.kind[i] == DROPPER:
                row[above], row[below] = 1.0, -1.0
                if push is None:
                    f[above] -= sites.carrier_mass[i] * self.line.gravity
                    f[below] -= sites.contact_mass[i] * self.line.gravity
                    f += sites.stiffness[i] * length[drop] * row
                drop += 1
            elif sites.kind[i] == MAST:
                row[above] = 1.0
            else:
                row[below] = 1.0
            held = push is None and sites.kind[i] == MAST
            stiffness = 1e9 if held else 0.0 if push is None and sites.kind[i] == STEADY_ARM else sites.stiffness[i]
            if held:
                f += stiffness * self.encumbrance(at) * row
            g.append(row)
            k.append(stiffness)
        if push is not None:
            f[2 * (self.x.size + self.node(push[0]))] += push[1]
        G = sparse.csr_array(np.array(g))
        K = sparse.csc_array(self.K + G.T @ sparse.diags_array(k) @ G)
        used = np.flatnonzero(np.abs(K).sum(axis=0) > 0.0)
        q = np.zeros(self.f.size)
        q[used] = linalg.spsolve(K[np.ix_(used, used)].tocsc(), f[used])
        drops = sites.kind == DROPPER
        stretch = (G @ q)[drops] - (length if push is None else 0.0)
        return sites.stiffness[drops] * stretch, q

    def encumbrance(self, at: float) -> float:
        return self.line.spans[int(np.searchsorted(self.line.span_starts, at + 1e-9)) - 1].mast.encumbrance


@pytest.mark.parametrize("name", LINES)
def test_hangs_as_a_fine_mesh_says(name: str) -> None:
    """Shapes to 0.05 mm and forces to 0.2 N: what elements of 20 mm leave of kinks, and masts of 1e9 N/m (1.5 um)."""
    rest = statics.solve(LINES[name])
    mesh = FineMesh(rest)
    force, q = mesh.solve(rest.dropper_lengths)
    np.testing.assert_allclose(force, rest.dropper_forces, atol=0.2)
    n = mesh.x.size
    np.testing.assert_allclose(q[: 2 * n : 2], rest.carrier(mesh.x), atol=5e-5)
    np.testing.assert_allclose(q[2 * n : 4 * n : 2], rest.contact(mesh.x), atol=5e-5)
    for s, (mast, wire) in mesh.stitches.items():
        inside = [i for i in range(n) if mesh.near(mesh.x[i] - mast, wire.length) or i in mesh.ends(s)]
        np.testing.assert_allclose([q[mesh.on(s, i)] for i in inside], rest.stitch(mesh.x[inside]), atol=5e-5)


@pytest.mark.parametrize("at", [0.0, 3.0, 15.0, 84.5])
def test_is_lifted_as_a_fine_mesh_says(at: float) -> None:
    """The mesh is one period that repeats itself, so the same is pushed here: one period, uplift to 0.1 %."""
    line = two_spans()
    rest = statics.solve(line)
    pushed = PushedLine(rest)
    pushed._build(1)
    _, q = FineMesh(rest).solve(rest.dropper_lengths, (at, 20.0))
    mesh = FineMesh(rest)
    assert pushed.push(at, 20.0).uplift == pytest.approx(q[2 * (mesh.x.size + mesh.node(at))], rel=1e-3)


@pytest.mark.parametrize("name", LINES)
def test_masts_carry_everything(name: str) -> None:
    line = LINES[name]
    rest = statics.solve(line)
    sites = rest.sites
    weight = line.period * (line.carrier.mass_per_length + line.contact.mass_per_length)
    weight += (sites.carrier_mass + sites.contact_mass)[sites.kind == DROPPER].sum()
    for span in line.spans:
        weight += (
            span.stitch_wire.length * span.stitch_wire.mass_per_length + 2 * span.stitch_wire.clamp
            if span.stitch_wire
            else 0.0
        )
    assert sites.force[sites.kind == MAST].sum() == pytest.approx(line.gravity * weight, rel=1e-9)


def test_a_stitch_wire_of_nothing_changes_nothing() -> None:
    """1 mN in a wire of 1 ug/m: a share of 5e-8 of the carrier's tension, so the same share of a sag of 0.4 m."""
    plain = dataclasses.replace(Line(), spans=(dataclasses.replace(Line().spans[0], mast=Mast(encumbrance=1.3)),))
    nothing = StitchWire(16.0, 1e-3, 1e-9, 1e-9)
    with_it = dataclasses.replace(plain, spans=(dataclasses.replace(plain.spans[0], stitch_wire=nothing),))
    rest, same = statics.solve(plain), statics.solve(with_it)
    zeta = np.linspace(-40.0, 100.0, 999)
    np.testing.assert_allclose(same.carrier(zeta), rest.carrier(zeta), atol=1e-7)
    np.testing.assert_allclose(same.carrier_beam.slope(zeta), rest.carrier_beam.slope(zeta), atol=1e-7)
    np.testing.assert_allclose(same.dropper_lengths, rest.dropper_lengths, atol=1e-7)
    at = np.array([0.0, 5.0, 26.75])
    np.testing.assert_allclose(PushedLine(same).uplift(at, 100.0), PushedLine(rest).uplift(at, 100.0), rtol=1e-6)


def test_slope_is_the_derivative_and_the_wire_ends() -> None:
    rest = statics.solve(two_spans())
    zeta, d = np.linspace(-100.0, 200.0, 1501), 1e-5
    numeric = (rest.carrier(zeta + d) - rest.carrier(zeta - d)) / (2 * d)
    np.testing.assert_allclose(rest.carrier_beam.slope(zeta), numeric, atol=1e-7)
    (strand,) = rest.stitch_wires
    inside = np.linspace(-8.99, 8.99, 301)
    numeric = (strand.value(inside + d) - strand.value(inside - d)) / (2 * d)
    np.testing.assert_allclose(strand.slope(inside), numeric, atol=1e-7)
    ends = np.array([-9.0, 9.0, 81.0, 99.0])
    np.testing.assert_allclose(rest.stitch(ends), rest.carrier(ends), atol=1e-12)
    assert np.isnan(rest.stitch(np.array([-9.1, 9.1, 45.0]))).all()


def test_a_push_there_lifts_here_as_a_push_here_lifts_there() -> None:
    """Maxwell: a linear elastic line, all droppers taut; 1e-9 is rounding."""
    pushed = PushedLine(statics.solve(two_spans()))
    places = (1.0, 4.5, 12.0, 50.0, 86.0)
    for a in places:
        for b in places:
            there = float(pushed.push(a, 10.0).contact(np.array(b)))
            assert there == pytest.approx(float(pushed.push(b, 10.0).contact(np.array(a))), rel=1e-9)


def test_re_330_hangs_as_its_source_draws_it() -> None:
    """Five regular droppers, evenly; the stitch wire at 64 % of the encumbrance, a figure of two digits."""
    line = load_line("re330_stitched")
    (span,) = line.spans
    assert span.stitch_wire is not None and (span.length, span.stitch_wire.length) == (65.0, 18.0)
    at = [d.position for d in span.droppers]
    np.testing.assert_allclose(np.diff(at), 55.0 / 6.0, atol=1e-6)
    assert [d.hangs_from for d in span.droppers] == ["stitch_wire", *["carrier"] * 5, "stitch_wire"]
    rest = statics.solve(line)
    assert float(rest.stitch(np.array(0.0))) / span.mast.encumbrance == pytest.approx(0.64, abs=0.005)


def test_stitch_wires_even_the_elasticity_out() -> None:
    """What they are for: the support is about as soft as mid-span, without them it is less than half as soft."""
    line = load_line("re330_stitched")
    (span,) = line.spans
    plain = tuple(dataclasses.replace(d, hangs_from="carrier") for d in span.droppers)
    without = dataclasses.replace(line, spans=(dataclasses.replace(span, stitch_wire=None, droppers=plain),))
    at = np.array([0.0, 32.5])
    support, middle = PushedLine(statics.solve(line)).uplift(at, 100.0)
    stiff, soft = PushedLine(statics.solve(without)).uplift(at, 100.0)
    assert 0.85 < support / middle < 1.15
    assert stiff / soft < 0.6


def test_given_lengths_hang_where_they_were_computed_for() -> None:
    line = two_spans()
    rest = statics.solve(line)
    lengths = iter(rest.dropper_lengths)
    spans = tuple(
        dataclasses.replace(s, droppers=tuple(dataclasses.replace(d, length=float(next(lengths))) for d in s.droppers))
        for s in line.spans
    )
    hung = statics.solve(dataclasses.replace(line, spans=spans))
    np.testing.assert_allclose(hung.contact(hung.dropper_positions), rest.contact(rest.dropper_positions), atol=1e-9)


def test_comes_back_from_text() -> None:
    line = two_spans()
    assert parse_line(dump_line(line)) == line


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "position: 5.0,",
            "position: 9.5,",
            r"spans\[0\]\.droppers\[0\]\.position = 9.5: allowed for .* 9 m from the mast",
        ),
        (
            "tension: 3500.0",
            "tension: 21000.0",
            r"spans\[0\]\.stitch_wire\.tension = 21000: allowed is less than .* 21000 N",
        ),
        (
            "length: 18.0",
            "length: 66.0",
            r"spans\[0\]\.stitch_wire\.length: 33 m and 33 m .* less than its length, 65 m",
        ),
        (
            "length: 18.0",
            "length: 180.0",
            r"defaults\.stitch_wire\.length = 180.0: allowed is a number from 1 to 100 m",
        ),
        ("    tension: 3500.0", "    #", r"spans\[0\]\.stitch_wire\.tension is missing; allowed is a number from 100"),
        (
            "hangs_from: stitch_wire",
            "hangs_from: mast",
            r"spans\[0\].* = 'mast': allowed is one of carrier, stitch_wire",
        ),
        (
            "spans:\n",
            "spans:\n  - {length: 20.0, repeat: 2, droppers: [10.0], stitch_wire: null}\n",
            r"spans\[1\]\.droppers\[6\]",
        ),
    ],
)
def test_a_stitch_wire_that_does_not_fit_is_refused(old: str, new: str, message: str) -> None:
    text = (resources.files("catenary_model") / "lines" / "re330_stitched.yaml").read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(LineFileError, match=f"^mine.yaml: {message}") as found:
        parse_line(text.replace(old, new, 1), "mine.yaml")
    assert "\n" not in str(found.value)


def test_models_without_stitch_wires_refuse_them() -> None:
    line = two_spans()
    for make in (lambda: Config(line=line), lambda: reference.Config(line=line)):
        with pytest.raises(ValueError, match=r"line 'two_spans', spans\[0\]\.stitch_wire: the .* has no stitch wires"):
            make()
