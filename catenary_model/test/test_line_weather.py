"""Lines under temperature and ice: what changes, what stays, what is refused."""

import dataclasses

import numpy as np
import pytest

from catenary_model import statics
from catenary_model.line import Line, Mast, Span, Wire
from catenary_model.line_file import LineFileError, dump_line, load_line, parse_line
from catenary_model.statics import MAST
from catenary_model.weather import Ice, Temperature, under

DAY = statics.solve(Line())
NO_ICE = Ice()
EA = (120e-6 * 97e9, 150e-6 * 100e9)
"""Carrier 120 mm^2, contact wire 150 mm^2, N."""


def test_the_day_of_building_changes_nothing() -> None:
    """Droppers keep the lengths that were computed, so the clamps come back to them: 1e-9 m of rounding."""
    for temperature in (None, Temperature(10.0), Temperature(10.0, tensioning="fixed"), Temperature(35.0)):
        line = under(Line(), temperature, NO_ICE, EA)
        assert (line.carrier, line.contact) == (Line().carrier, Line().contact)
        rest = statics.solve(line)
        np.testing.assert_allclose(rest.contact(rest.dropper_positions), 0.0, atol=1e-9)
        np.testing.assert_array_equal(rest.dropper_lengths, DAY.dropper_lengths)


@pytest.mark.parametrize(("value", "share"), [(30.0, 0.95), (-10.0, 1.0 / 0.95), (10.0, 1.0)])
def test_weights_pull_through_friction(value: float, share: float) -> None:
    line = under(Line(), Temperature(value, efficiency=0.95), NO_ICE)
    assert line.carrier.tension == pytest.approx(share * 16e3, rel=1e-12)
    assert line.contact.tension == pytest.approx(share * 20e3, rel=1e-12)


def test_fixed_ends_lose_tension_and_the_line_sinks_by_the_sag() -> None:
    """A carrier alone hangs by rhoA g L^2/(8 T), bending aside: 40 K take EA alpha 40 = 7.9 kN of its 16 kN."""
    carrier = Wire(1.07, 0.6, 1e-6, 16e3)
    line = Line(carrier, spans=(Span(60.0, (), mast=Mast(encumbrance=1.5)),))
    hot = under(line, Temperature(50.0, tensioning="fixed"), NO_ICE, EA)
    assert hot.carrier.tension == pytest.approx(16e3 - 120e-6 * 97e9 * 1.7e-5 * 40.0, rel=1e-12)
    middle = np.array([30.0])
    sag = 1.5 - statics.solve(hot).carrier(middle)[0]
    assert sag == pytest.approx(1.07 * 9.81 * 60.0**2 / (8 * hot.carrier.tension), rel=1e-4)
    # with droppers of the same length the contact wire sinks with its carrier
    sunk = statics.solve(under(Line(), Temperature(30.0, tensioning="fixed"), NO_ICE, EA))
    assert sunk.contact(middle)[0] < DAY.contact(middle)[0] - 0.05
    assert statics.solve(under(Line(), Temperature(-10.0, tensioning="fixed"), NO_ICE, EA)).contact(middle)[0] > 0.02


def test_ice_weighs_and_is_carried() -> None:
    iced = statics.solve(under(Line(), None, Ice(0.5, 0.7)))
    (mast,) = iced.sites.force[iced.sites.kind == MAST]
    assert mast == pytest.approx(9.81 * 60.0 * (1.07 + 1.35 + 1.2), rel=1e-9)
    np.testing.assert_array_equal(iced.dropper_lengths, DAY.dropper_lengths)
    assert iced.contact(np.array([30.0]))[0] < -0.2


def test_a_stitch_wire_goes_with_its_carrier() -> None:
    line = load_line("re330_stitched")
    cold = under(line, Temperature(-20.0, efficiency=0.9), Ice(0.3, 0.0))
    (before,), (after,) = line.spans, cold.spans
    assert before.stitch_wire is not None and after.stitch_wire is not None
    assert after.stitch_wire.tension / before.stitch_wire.tension == pytest.approx(1.0 / 0.9, rel=1e-12)
    assert after.stitch_wire.mass_per_length == pytest.approx(0.61)
    statics.solve(cold)


TEXT = dump_line(Line())


def test_a_file_may_have_weather() -> None:
    text = TEXT.replace("  tension: 16000.0", "  tension: 16000.0\n  axial_stiffness: 1.164e+7")
    text = text.replace("  tension: 20000.0", "  tension: 20000.0\n  axial_stiffness: 1.5e+7")
    line = parse_line(text + "temperature: {value: 30.0, tensioning: fixed, source: a hot day}\nice: {contact: 0.1}\n")
    assert line == under(Line(), Temperature(30.0, tensioning="fixed"), Ice(0.0, 0.1), (1.164e7, 1.5e7))
    assert parse_line(dump_line(line)) == line
    assert parse_line(TEXT + "ice: {}\n").contact == Line().contact


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            "temperature: {value: 30.0, tensioning: fixed}",
            "carrier.axial_stiffness is missing; a wire whose ends are fixed",
        ),
        (
            "temperature: {tensioning: weights}",
            "temperature.value is missing; allowed is a number from -60 to 150 degC",
        ),
        ("temperature: {value: 200}", "temperature.value = 200: allowed is a number from -60 to 150 degC"),
        (
            "temperature: {value: 20, tensioning: springs}",
            "temperature.tensioning = 'springs': allowed is one of weights, fixed",
        ),
        (
            "temperature: {value: 20, efficiency: 0.0}",
            "temperature.efficiency = 0.0: allowed is a number from 0.5 to 1",
        ),
        ("ice: {contact: -1}", "ice.contact = -1: allowed is a number from 0 to 20 kg/m"),
    ],
)
def test_weather_that_cannot_be_is_refused_in_one_line(more: str, message: str) -> None:
    with pytest.raises(LineFileError) as found:
        parse_line(TEXT + more + "\n", "mine.yaml")
    assert str(found.value).startswith(f"mine.yaml: {message}")
    assert "\n" not in str(found.value)


def test_a_wire_too_hot_for_its_fixed_ends_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"temperature.value = 140: allowed is less than 90.9 degC, where carrier is slack"
    ):
        under(Line(), Temperature(140.0, tensioning="fixed"), NO_ICE, EA)
    for change in ({"tensioning": "springs"}, {"efficiency": 1.5}):
        with pytest.raises(ValueError, match="allowed is"):
            dataclasses.replace(Temperature(20.0), **change)
