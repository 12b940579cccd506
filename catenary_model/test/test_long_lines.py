"""Long lines: the sparse statics against dense ones, equal whatever the length, in little memory."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from odd_lines import uneven_line, with_lengths

from bench import dense_statics, lines
from catenary_model import statics
from catenary_model.build import Config, build
from catenary_model.line import Line, Span, Wire
from catenary_model.line_file import load_line, preset_names
from catenary_model.statics import DROPPER, MAST
from catenary_model.stiffness import PushedLine

SPAN = Line().spans[0]
MIB = 1024**2


def check_against_dense(line: Line) -> None:
    """1e-9 m and, at 1e5 N/m and more per metre, 1e-5 N: rounding of two ways to the same equations."""
    rest, dense = statics.solve(line), dense_statics.solve(line)
    zeta = np.linspace(-10.0, line.period + 10.0, 1201)
    np.testing.assert_allclose(rest.contact(zeta), dense.contact(zeta), atol=1e-9)
    np.testing.assert_allclose(rest.carrier(zeta), dense.carrier(zeta), atol=1e-9)
    np.testing.assert_allclose(rest.dropper_forces, dense.force, atol=1e-5)
    np.testing.assert_allclose(rest.sites.force[rest.sites.kind == MAST], dense.mast, atol=1e-5)
    of_given = np.array([d.length is not None for span in line.spans for d in span.droppers])
    np.testing.assert_allclose(rest.dropper_elongations[of_given], dense.elongation[of_given], atol=1e-9)


@pytest.mark.parametrize("name", [name for name in preset_names() if not load_line(name).stitched])
def test_presets_hang_as_the_dense_way_says(name: str) -> None:
    check_against_dense(statics.built(load_line(name)))


@given(
    extra=st.lists(st.one_of(st.none(), st.floats(-0.01, 0.1)), min_size=20, max_size=20),
    bending=st.floats(0.1, 2000.0),
)
@settings(max_examples=15, deadline=None)
def test_given_computed_and_slack_droppers_as_the_dense_way_says(extra: list[float | None], bending: float) -> None:
    """From nearly a string (2 mm over which a load rounds it) to 0.3 m; what cannot hang is not asked."""
    line = uneven_line()
    line = Line(line.carrier, Wire(1.35, 0.2, bending, 20e3), line.spans)
    lengths = statics.solve(line).dropper_lengths
    some = [None if more is None else float(own + more) for own, more in zip(lengths, extra, strict=True)]
    try:
        check_against_dense(with_lengths(line, some))
    except statics.StaticsError as error:
        assert error.dropper is not None


def test_odd_span_in_a_long_line_as_the_dense_way_says() -> None:
    check_against_dense(Line(spans=(SPAN,) * 11 + uneven_line().spans + (SPAN,) * 12))


def test_400_spans_hang_as_one() -> None:
    """Same line written 400 times: rounding of 24 km, 1e-11 m and 1e-7 N."""
    once, many = statics.solve(Line()), statics.solve(Line(spans=(SPAN,) * 400))
    np.testing.assert_allclose(many.dropper_forces, np.tile(once.dropper_forces, 400), atol=1e-7)
    zeta = np.linspace(13e3, 13e3 + 60.0, 200)
    np.testing.assert_allclose(many.contact(zeta), once.contact(zeta), atol=1e-11)
    np.testing.assert_allclose(many.carrier(zeta), once.carrier(zeta), atol=1e-11)


def test_push_on_400_spans_is_that_on_one() -> None:
    once = PushedLine(statics.solve(Line()))
    many = PushedLine(statics.solve(Line(spans=(SPAN,) * 400)))
    assert many.length == 400 * 60.0
    for at, force in ((30.0, 100.0), (5.0, 400.0)):
        assert many.push(12e3 + at, force).uplift == pytest.approx(once.push(at, force).uplift, rel=2e-5)


@pytest.mark.slow
def test_memory_of_a_long_line_is_that_of_its_table() -> None:
    """400 spans no two of which are alike: 40 MiB of table and little else; one dense matrix alone would be 120."""
    build(Config())  # code that is compiled and loaded is not meant
    line = lines.line_of(400)
    tracemalloc.start()
    try:
        rest = statics.solve(line)
        of_statics = tracemalloc.get_traced_memory()[1]
        build(Config(line=line))
        of_model = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (rest.sites.kind == DROPPER).sum() == 3600
    assert of_statics < 20 * MIB
    assert of_model < 80 * MIB


def test_work_grows_with_the_number_of_spans() -> None:
    """Entries of the factors per span are the same for 50 and for 200 spans: their count is the work, not a clock."""
    from catenary_model import suspension

    found, factor = [], suspension.Factor.__init__

    def counting(self: suspension.Factor, system: object) -> None:
        factor(self, system)  # type: ignore[arg-type]
        found.append(self._factors.nnz)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suspension.Factor, "__init__", counting)
        for spans in (50, 200):
            statics.solve(lines.line_of(spans))
    assert found[1] / found[0] < 1.15 * 4


def test_span_without_droppers_within_a_line() -> None:
    """Its wire hangs from the neighbours' droppers, 70 m apart, and sags by w L^2/(8 T) = 0.41 m."""
    rest = statics.solve(Line(spans=(SPAN, Span(60.0, ()), SPAN)))
    assert rest.contact(np.array([90.0]))[0] == pytest.approx(-1.35 * 9.81 * 70.0**2 / (8 * 20e3), rel=0.02)
