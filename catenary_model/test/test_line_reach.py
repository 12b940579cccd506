"""Lines that cannot be ridden, or not with this drive, are refused where they are read."""

import dataclasses

import numpy as np
import pytest
from odd_lines import uneven_line, with_lengths

from catenary_model import reach, statics
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm
from catenary_model.line_file import LineFileError, dump_line, parse_line, preset_names
from catenary_model.line_file import load_line as load
from catenary_model.stiffness import PushedLine

SPAN = Line().spans[0]
REST = statics.solve(Line())


def hung_lower(by: float, spans: int = 1, which: int = 0) -> Line:
    """Table 3.1's line, one span of which has droppers longer by so much (m)."""
    lengths = np.tile(REST.dropper_lengths, spans)
    lengths[9 * which : 9 * which + 9] += by
    return with_lengths(Line(spans=(SPAN,) * spans), lengths)


@pytest.mark.parametrize("name", preset_names())
def test_presets_are_within_reach(name: str) -> None:
    assert reach.beyond_reach(load(name), -0.2, 0.2, 120.0) == ""
    assert reach.far_from_nominal(statics.solve(load(name))) == ""


def test_long_droppers_are_named_with_height_and_reach() -> None:
    """All droppers 2.6 m longer: the whole contact wire lies 2.6 m lower, and 8 mm more between two droppers."""
    line = hung_lower(2.6)
    assert reach.beyond_reach(line, -0.2, 0.2, 120.0) == (
        "the contact wire hangs 2.61 m below its nominal height (at 0.0 m, span 1 of 1), the drive reaches 0.2 m"
    )
    assert reach.beyond_reach(line, -3.0, 0.2, 120.0) == ""
    assert "2.61 m below" in reach.far_from_nominal(statics.solve(line))


def test_one_odd_span_in_a_long_line_is_named() -> None:
    """A slip in one span of 200: its droppers hang slack and its wire, 55 m between the next two, 0.25 m low."""
    found = reach.beyond_reach(hung_lower(0.8, spans=200, which=137), -0.2, 0.2, 120.0)
    assert "span 138 of 200" in found
    low, _ = reach.lowest_and_highest(statics.solve(hung_lower(0.8, spans=200, which=137)))
    assert 137 * 60.0 < low.position < 138 * 60.0


def test_wire_that_is_pulled_up_is_named() -> None:
    found = reach.beyond_reach(hung_lower(-0.3), -0.2, 0.2, 120.0)
    assert "m above its nominal height" in found and "the drive reaches 0.2 m" in found


def test_lift_under_the_mean_force_counts() -> None:
    """Springs of 250 N/m at the masts alone: 120 N in mid-span lift by about F L/(4 T) and what the springs give."""
    line = Line(spans=(Span(60.0, (), steady_arm=SteadyArm(250.0)),))
    lift = reach.lifted(statics.solve(line), 120.0).height
    assert 0.2 < lift < 0.5
    assert f"120 N lift the contact wire to {lift:.3g} m" in reach.beyond_reach(line, -0.2, 0.2, 120.0)
    assert reach.beyond_reach(line, -0.2, 0.2, 0.3 * 120.0) == ""


def test_lift_of_a_long_line_is_that_of_the_spans_around() -> None:
    """A span of a long line is pushed among its neighbours only: equal to the whole line to what dies out over them."""
    line = Line(spans=(SPAN,) * 30 + uneven_line().spans)
    rest = statics.solve(line)
    place = reach.lifted(rest, 120.0)
    at = np.array(place.position)
    whole = rest.contact(at) + PushedLine(rest).push(place.position, 120.0).uplift
    assert place.height == pytest.approx(float(whole), abs=1e-5)


def test_line_that_nothing_holds_is_refused_when_read() -> None:
    text = dump_line(Line(spans=(Span(60.0, ()), Span(50.0, (), steady_arm=SteadyArm(0.0, 1.0)))))
    with pytest.raises(LineFileError, match="the contact wire hangs from nothing") as caught:
        parse_line(text, "bare.yaml")
    assert str(caught.value).startswith("bare.yaml: ") and "\n" not in str(caught.value)


def test_wire_without_weight_hangs_on_no_dropper() -> None:
    line = dataclasses.replace(load("en50318_2002"), gravity=0.0)
    assert reach.beyond_reach(line, -0.2, 0.2, 120.0).startswith("no dropper carries the contact wire (gravity = 0")


def test_carrier_that_hangs_through_the_contact_wire_is_refused_when_read() -> None:
    """Droppers near the masts only: between them the carrier sags by 0.3 m, the contact wire by half of it."""
    contact = dataclasses.replace(Line().contact, tension=40e3)
    line = Line(contact=contact, spans=(Span(60.0, (Dropper(1.0), Dropper(59.0)), mast=Mast(encumbrance=0.14)),))
    with pytest.raises(LineFileError, match=r"spans\[0\]: the carrier hangs 0.\d+ m below the contact wire at \d+"):
        parse_line(dump_line(line), "low.yaml")


def test_same_text_is_read_and_solved_once() -> None:
    text = dump_line(uneven_line())
    assert parse_line(text) is parse_line(text)
    assert statics.solve(parse_line(text)) is statics.solve(uneven_line())
    with pytest.raises(ValueError, match="read-only"):
        statics.solve(uneven_line()).sites.force[0] = 1.0
