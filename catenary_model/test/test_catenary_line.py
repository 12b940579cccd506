"""Descriptions of lines in YAML: presets, every refusal by the name of its entry, and the way back to text."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from catenary_model import statics
from catenary_model.build import Config
from catenary_model.line import Dropper, Line, Mast, PointMass, Span, SteadyArm, Wire
from catenary_model.line_file import LineFileError, dump_line, load_line, parse_line, preset_names

TEXT = """
carrier: {mass_per_length: 1.07, damping: 0.6, bending_stiffness: 100.0, tension: 16000}
contact: {mass_per_length: 1.35, damping: 0.2, bending_stiffness: 150.0, tension: 2e4}
defaults:
  pre_sag: 0.01
  dropper: {stiffness: 1e5, mass: 0.4}
  mast: {encumbrance: 1.3}
  steady_arm: {stiffness: 250.0, mass: 1.0}
spans:
  - repeat: 2
    length: 50
    droppers: [5.0, 15.0, 25.0, 35.0, 45]
  - length: 60.0
    pre_sag: 0.0
    mast: {stiffness: 4e5}
    steady_arm: null
    droppers: [5.0, {position: 17.0, stiffness: 2e4}, {position: 30.0, length: 0.72}, 43.0, {position: 55, mass: 0}]
"""


def changed(old: str, new: str) -> str:
    """The text with its first `old` replaced."""
    assert old in TEXT
    return TEXT.replace(old, new, 1)


# ---- presets ------------------------------------------------------------------------------------------------------


def test_default_preset_is_the_default_line() -> None:
    assert load_line("en50318_2002") == Line()


def test_presets_are_there() -> None:
    assert set(preset_names()) >= {"en50318_2002", "pre_sag_steady_arm", "alternating_spans"}


@pytest.mark.parametrize("name", preset_names())
def test_preset_hangs_as_it_says(name: str) -> None:
    """Every dropper of a preset is taut with a length that can be made, and clamps are where they are wanted."""
    line = load_line(name)
    rest = statics.solve(line)
    assert line.name == name
    assert rest.dropper_forces.min() > 40.0
    assert 0.25 < rest.dropper_lengths.min() < rest.dropper_lengths.max() < line.spans[0].mast.encumbrance
    wanted = [(d, span.clamp_height(d)) for span in line.spans for d in span.droppers]
    for found, (dropper, height) in zip(rest.contact(rest.dropper_positions), wanted, strict=True):
        assert dropper.length is not None or found == pytest.approx(height, abs=1e-9)


def test_benchmark_line_hangs_on_the_published_lengths_at_the_published_sags() -> None:
    """Lengths and sags are printed to the millimetre, so each may be half of one off, and so is the encumbrance."""
    line = load_line("benchmark_ac_simple")
    rest = statics.solve(line)
    published = [0.0, 0.024, 0.041, 0.052, 0.055, 0.052, 0.041, 0.024, 0.0]
    np.testing.assert_allclose(-rest.contact(rest.dropper_positions), published, atol=1e-3)
    # the other way round: what the parabola of the standard makes of the lengths
    (span,) = line.spans
    lengths = [d.length for d in span.droppers]
    free = tuple(dataclasses.replace(d, length=None) for d in span.droppers)
    hung = statics.solve(dataclasses.replace(line, spans=(dataclasses.replace(span, droppers=free),)))
    np.testing.assert_allclose(hung.dropper_lengths, lengths, atol=1e-3)
    np.testing.assert_allclose(-hung.contact(hung.dropper_positions), published, atol=1e-3)
    # the support gives way by what the file says, so its unloaded spring stands where the source has it
    (mast,) = rest.sites.force[rest.sites.kind == statics.MAST]
    assert span.mast.encumbrance + mast / span.mast.stiffness == pytest.approx(1.2, abs=5e-4)


def test_chinese_line_has_what_its_source_publishes() -> None:
    line = load_line("china_27_21")
    rest = statics.solve(line)
    assert (line.contact.tension, line.carrier.tension) == (27e3, 21e3)
    assert (line.contact.mass_per_length, line.carrier.mass_per_length) == (1.082, 1.068)
    assert 10 * line.period == 480.0
    assert rest.carrier(np.array([0.0])) == pytest.approx(1.6, abs=1e-12)


@pytest.mark.parametrize("name", ["benchmark_ac_simple", "china_27_21", "re330_stitched"])
def test_presets_from_documents_say_so(name: str) -> None:
    line = load_line(name)
    (span,) = line.spans
    assert span.steady_arm is not None
    sources = (line, line.carrier, line.contact, span, span.mast, span.steady_arm, *span.droppers)
    assert all(element.source for element in sources)


@pytest.mark.parametrize("name", preset_names())
def test_preset_survives_the_way_to_text_and_back(name: str) -> None:
    assert parse_line(dump_line(load_line(name))) == load_line(name)


def test_second_preset_has_pre_sag_arms_and_masses() -> None:
    (span,) = load_line("pre_sag_steady_arm").spans
    assert span.pre_sag / span.length == pytest.approx(0.5e-3)
    assert span.steady_arm is not None and span.steady_arm.stiffness > 0.0 and span.steady_arm.mass > 0.0
    assert all(dropper.mass > 0.0 for dropper in span.droppers)


def test_third_preset_alternates() -> None:
    assert [span.length for span in load_line("alternating_spans").spans] == [50.0, 60.0]


# ---- what a text means --------------------------------------------------------------------------------------------


def test_text_becomes_the_line_it_describes() -> None:
    mast, arm = Mast(5e5, 1.3), SteadyArm(250.0, 1.0)
    short = Span(50.0, tuple(Dropper(at, 1e5, 0.4) for at in (5.0, 15.0, 25.0, 35.0, 45.0)), 0.01, mast, arm)
    droppers = (
        Dropper(5.0, 1e5, 0.4),
        Dropper(17.0, 2e4, 0.4),
        Dropper(30.0, 1e5, 0.4, 0.72),
        Dropper(43.0, 1e5, 0.4),
        Dropper(55.0, 1e5, 0.0),
    )
    long = Span(60.0, droppers, 0.0, Mast(4e5, 1.3), None)
    assert parse_line(TEXT, name="mine") == Line(spans=(short, short, long), name="mine")


def test_elements_as_they_are_built_and_where_they_come_from() -> None:
    text = changed("  dropper: {stiffness: 1e5, mass: 0.4}", "  dropper: {axial_stiffness: 2e5, contact_clamp: 0.1}")
    text = text.replace("length: 0.72", "sag: 0.01, source: 'a drawing, B'").replace(
        "pre_sag: 0.01", "pre_sag_from: first_dropper"
    )
    line = parse_line(text + "source: 'several: see there'\n", name="mine")
    droppers = line.spans[2].droppers
    assert droppers[0] == Dropper(5.0, axial_stiffness=2e5, contact_clamp=0.1)
    assert droppers[1] == Dropper(17.0, 2e4, contact_clamp=0.1)  # its own stiffness counts, not the default's rope
    assert (droppers[2].sag, droppers[2].source, line.source) == (0.01, "a drawing, B", "several: see there")
    assert {span.pre_sag_from for span in line.spans} == {"first_dropper"}
    again = parse_line(dump_line(line))
    assert again == line
    assert (again.source, again.spans[2].droppers[2].source) == (line.source, "a drawing, B")


def test_point_masses_come_and_go() -> None:
    text = changed(
        "pre_sag: 0.0\n", "pre_sag: 0.0\n    masses: [{position: 9, wire: carrier, mass: 1.5, source: weighed}]\n"
    )
    line = parse_line(text)
    assert line.spans[2].masses == (PointMass(9.0, "carrier", 1.5),)
    again = parse_line(dump_line(line))
    assert again == dataclasses.replace(line) and again.spans[2].masses[0].source == "weighed"
    with pytest.raises(ValueError, match=r"masses\[0\]\.position = 60: allowed is less than length = 60 m"):
        Span(60.0, (Dropper(30.0),), masses=(PointMass(60.0, "carrier", 1.0),))
    with pytest.raises(ValueError, match=r"masses\[0\]\.wire = contact: allowed in a span with droppers only"):
        Span(60.0, (), masses=(PointMass(30.0, "contact", 1.0),))
    with pytest.raises(ValueError, match="wire = 'stitch': allowed is one of carrier, contact"):
        PointMass(30.0, "stitch", 1.0)


def test_rayleigh_damping_in_proportion_to_mass_is_viscous() -> None:
    text = changed("damping: 0.6", "damping: 0.5, mass_damping: 0.0125, stiffness_damping: 1e-4")
    line = parse_line(text)
    assert line.carrier == Wire(1.07, 0.5 + 0.0125 * 1.07, 100.0, 16e3, 1e-4)
    assert line.contact.stiffness_damping == 0.0
    assert parse_line(dump_line(line)) == dataclasses.replace(line)
    with pytest.raises(ValueError, match=r"line '.*', carrier\.stiffness_damping = 0.0001: .* allows 0 s only"):
        Config(line=line)


def test_a_source_makes_no_other_line() -> None:
    assert dataclasses.replace(Line(), source="elsewhere") == Line()
    assert hash(Mast(source="drawing")) == hash(Mast())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sag": 0.01, "length": 0.9}, "one follows from the other"),
        ({"stiffness": 2e4, "axial_stiffness": 2e5}, "one follows from the other"),
        ({"contact_clamp": -0.1}, "contact_clamp = -0.1 must be at least 0"),
        ({"axial_stiffness": 0.0}, "axial_stiffness = 0.0 must be above 0"),
    ],
)
def test_a_dropper_that_contradicts_itself_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Dropper(5.0, **change)


def test_a_clamp_above_the_carrier_is_refused() -> None:
    with pytest.raises(ValueError, match=r"droppers\[1\]\.sag = -1.3: allowed is less than .* encumbrance, 1.2 m"):
        Span(50.0, (Dropper(5.0), Dropper(20.0, sag=-1.3)), mast=Mast(encumbrance=1.2))
    with pytest.raises(ValueError, match="pre_sag_from = 'arm': allowed is one of mast, first_dropper"):
        Span(50.0, (Dropper(5.0),), pre_sag_from="arm")


def test_what_is_left_out_is_the_default_of_the_data_model() -> None:
    wires = "".join(TEXT.splitlines(keepends=True)[1:3])
    line = parse_line(wires + "spans: [{length: 60, droppers: [5, 10.5, 17, 23.5, 30, 36.5, 43, 49.5, 55]}]")
    assert line == dataclasses.replace(Line(), name="unnamed")


def test_own_file_is_loaded_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "my_line.yaml"
    path.write_text(TEXT, encoding="utf-8")
    assert load_line(path) == load_line(str(path)) == parse_line(TEXT, name="my_line")


# ---- refusals -----------------------------------------------------------------------------------------------------

REFUSALS = [
    (
        "mass_per_length: 1.07",
        "mass_per_length: 0",
        r"carrier\.mass_per_length = 0: allowed is a number from 0.05 to 20",
    ),
    ("tension: 16000", "tension: high", r"carrier\.tension = 'high': allowed is a number from 1000 to 200000 N"),
    ("tension: 2e4", "tention: 2e4", r"contact\.tention: unknown entry; did you mean tension\?"),
    (", tension: 2e4", "", r"contact\.tension is missing; allowed is a number"),
    ("contact:", "kontact:", r"contact is missing"),
    ("contact:", "kontact:", r"kontact: unknown entry; did you mean contact\?"),
    ("mass: 0.4", "mass: -0.4", r"defaults\.dropper\.mass = -0.4: allowed is a number from 0 to 50 kg"),
    ("stiffness: 1e5", "stiffness: .inf", r"defaults\.dropper\.stiffness = inf: allowed"),
    (
        "encumbrance: 1.3",
        "encumbrance: '1.3'",
        r"defaults\.mast\.encumbrance = '1.3': allowed is a number from 0.1 to 10 m",
    ),
    ("stiffness: 250.0", "stiffness: true", r"defaults\.steady_arm\.stiffness = True: allowed"),
    ("pre_sag: 0.01", "pre_sag: .nan", r"defaults\.pre_sag = nan: allowed is a number from -0.5 to 0.5 m"),
    ("repeat: 2", "repeat: 2.5", r"spans\[0\]\.repeat = 2.5: allowed is an integer from 1 to 1000"),
    ("repeat: 2", "repeat: 0", r"spans\[0\]\.repeat = 0: allowed"),
    ("length: 50", "length: 500", r"spans\[0\]\.length = 500: allowed is a number from 5 to 150 m"),
    ("    length: 50\n", "", r"spans\[0\]\.length is missing"),
    ("35.0, 45]", "35.0, x]", r"spans\[0\]\.droppers\[4\] = 'x': allowed is a position \(m\) or a mapping"),
    ("35.0, 45]", "35.0, 50]", r"spans\[0\]\.droppers\[4\]\.position = 50: allowed is .* less than 50 m"),
    ("[5.0, 15.0", "[0.0, 15.0", r"spans\[0\]\.droppers\[0\]\.position = 0: allowed is more than 0 m \(the mast\)"),
    ("43.0,", "23.0,", r"spans\[1\]\.droppers\[3\]\.position = 23: allowed is more than 30 m"),
    ("length: 0.72", "length: 0", r"spans\[1\]\.droppers\[2\]\.length = 0: allowed is a number from 0.01 to 10 m"),
    ("length: 0.72", "lenght: 0.72", r"spans\[1\]\.droppers\[2\]\.lenght: unknown entry; did you mean length\?"),
    ("{position: 30.0, ", "{", r"spans\[1\]\.droppers\[2\]\.position is missing"),
    (
        "mast: {stiffness: 4e5}",
        "mast: 4e5",
        r"spans\[1\]\.mast = 400000.0: allowed is a mapping of stiffness, encumbrance",
    ),
    ("mast: {stiffness: 4e5}", "mast: {stiffness: 4}", r"spans\[1\]\.mast\.stiffness = 4: allowed"),
    ("steady_arm: null", "steady_arm: {mas: 1}", r"spans\[1\]\.steady_arm\.mas: unknown entry; did you mean mass\?"),
    (
        "pre_sag: 0.0\n",
        "pre_sag: 0.0\n    pre_sag_from: arm\n",
        r"spans\[1\]\.pre_sag_from = 'arm': allowed is one of mast, first_dropper",
    ),
    (
        "stiffness: 2e4}",
        "stiffness: 2e4, axial_stiffness: 2e5}",
        r"spans\[1\]\.droppers\[1\]\.axial_stiffness = 200000: allowed without stiffness only",
    ),
    (
        "length: 0.72",
        "length: 0.72, sag: 0.02",
        r"spans\[1\]\.droppers\[2\]\.sag = 0.02: allowed without length only \(length = 0.72 m",
    ),
    ("length: 0.72", "sag: 0.7", r"spans\[1\]\.droppers\[2\]\.sag = 0.7: allowed is a number from -0.5 to 0.5 m"),
    (
        "length: 0.72",
        "sag: 0.4",
        r"spans\[1\]\.droppers\[2\]: would have to push .* sag = 0.4 m demands: .*another sag",
    ),
    ("mass: 0}", "contact_clamp: -1}", r"spans\[1\]\.droppers\[4\]\.contact_clamp = -1: allowed is .* 0 to 50 kg"),
    ("stiffness: 4e5}", "source: 7}", r"spans\[1\]\.mast\.source = 7: allowed is a text"),
    (
        "pre_sag: 0.0\n",
        "pre_sag: 0.0\n    masses: [{position: 61, wire: contact, mass: 1}]\n",
        r"spans\[1\]\.masses\[0\]\.position = 61: allowed is more than 0 m \(the mast\) and less than 60 m",
    ),
    (
        "pre_sag: 0.0\n",
        "pre_sag: 0.0\n    masses: [{position: 9, wire: stitch, mass: 1}]\n",
        r"spans\[1\]\.masses\[0\]\.wire = 'stitch': allowed is one of carrier, contact",
    ),
    ("spans:", "spans: []\nspan:", r"spans: allowed is a list of at least one"),
    ("spans:", "name: 7\nspans:", r"name = 7: allowed is a text"),
    ("spans:", "gravity: 30\nspans:", r"gravity = 30: allowed is a number from 0 to 20 m/s\^2"),
    # what only the statics can tell: the index is that of the file, repetitions do not count
    ("pre_sag: 0.0\n", "pre_sag: 0.5\n", r"spans\[1\]\.droppers\[\d\]: would have to push .* pre_sag = 0.5 m"),
    ("encumbrance: 1.3", "encumbrance: 0.3", r"spans\[\d\]\.droppers\[\d\]: would be -\d\.\d+ m long"),
]


@pytest.mark.parametrize(("old", "new", "message"), REFUSALS)
def test_refusal_names_file_and_entry(old: str, new: str, message: str) -> None:
    with pytest.raises(LineFileError) as caught:
        parse_line(changed(old, new), "my.yaml")
    lines = str(caught.value).splitlines()
    assert all(line.startswith("my.yaml: ") for line in lines)
    assert any(re.match(f"my\\.yaml: {message}", line) for line in lines), str(caught.value)


def test_several_problems_are_told_at_once() -> None:
    text = changed("repeat: 2", "repeat: none").replace("damping: 0.2", "damping: -1")
    with pytest.raises(LineFileError) as caught:
        parse_line(text)
    assert len(str(caught.value).splitlines()) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a mapping"),
        ("- 1", "must be a mapping"),
        ("{", "is no YAML: line 1"),
        ("gravity: 9.81\ngravity: 1.62", "'gravity' is given twice"),
        ("1: 2", "unknown entry"),
    ],
)
def test_what_is_no_description_is_refused(text: str, message: str) -> None:
    with pytest.raises(LineFileError, match=message):
        parse_line(text)


def test_unknown_preset_lists_the_presets() -> None:
    with pytest.raises(LineFileError, match=r"en50318_2003.*alternating_spans, benchmark_.*, pre_sag_steady_arm"):
        load_line("en50318_2003")


def test_missing_and_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LineFileError, match=r"nowhere\.yaml: cannot be read"):
        load_line(tmp_path / "nowhere.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(LineFileError, match="not UTF-8"):
        load_line(tmp_path / "bytes.yaml")
    with pytest.raises(LineFileError, match="cannot be read"):
        load_line(tmp_path)


def test_error_is_a_value_error() -> None:
    assert issubclass(LineFileError, ValueError)


# ---- there and back -----------------------------------------------------------------------------------------------

wires = st.builds(
    Wire,
    mass_per_length=st.floats(0.5, 3.0),
    damping=st.floats(0.0, 2.0),
    bending_stiffness=st.floats(1.0, 500.0),
    tension=st.floats(1e4, 4e4),
)
masts = st.builds(Mast, stiffness=st.floats(1e4, 1e7), encumbrance=st.just(9.0))
arms = st.none() | st.builds(SteadyArm, stiffness=st.floats(0.0, 1e4), mass=st.floats(0.0, 5.0))


@st.composite
def spans(draw: st.DrawFn) -> Span:
    gaps = draw(st.lists(st.floats(4.0, 9.0), min_size=2, max_size=8))
    same = draw(st.booleans())
    droppers = tuple(
        Dropper(
            float(at),
            1e5 if same else draw(st.floats(1e4, 1e6)),
            0.3 if same else draw(st.floats(0.0, 2.0)),
            None if same else draw(st.none() | st.floats(5.0, 9.5)),
            carrier_clamp=draw(st.sampled_from([0.0, 0.2])),
            contact_clamp=0.1 if same else draw(st.floats(0.0, 1.0)),
            mass_per_length=0.0 if same else draw(st.sampled_from([0.0, 0.117])),
            source=draw(st.text(max_size=9)),
        )
        for at in np.cumsum(gaps)[:-1]
    )
    roped = draw(st.sampled_from([None, 2e5]))
    if roped:
        droppers = tuple(dataclasses.replace(d, stiffness=1e5, axial_stiffness=roped) for d in droppers)
    droppers = tuple(
        dataclasses.replace(d, sag=draw(st.sampled_from([None, 0.004]))) if d.length is None else d for d in droppers
    )
    sag = draw(st.sampled_from([0.0, 0.005, 1e-5]))
    beginning = draw(st.sampled_from(["mast", "first_dropper"]))
    return Span(float(np.sum(gaps)), droppers, sag, draw(masts), draw(arms), beginning)


@given(
    line=st.builds(
        Line,
        carrier=wires,
        contact=wires,
        spans=st.lists(spans(), min_size=1, max_size=4).map(lambda some: tuple(s for s in some for _ in range(2))),
        gravity=st.floats(1.0, 12.0),
        name=st.text(),
    )
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
@pytest.mark.slow
def test_round_trip(line: Line) -> None:
    try:
        statics.solve(line)
    except statics.StaticsError:
        assume(False)
    text = dump_line(line)
    assert parse_line(text) == line
    plain = yaml.safe_load(text)  # any YAML reader takes the numbers as numbers and the name as a text
    assert isinstance(plain["gravity"], float) and plain["name"] == line.name


def test_dump_is_short_where_spans_repeat() -> None:
    line = dataclasses.replace(Line(), spans=Line().spans * 28)
    text = dump_line(line)
    assert "repeat: 28" in text
    assert len(text.splitlines()) < 25
    assert parse_line(text) == line


def test_numbers_filled_up_with_zeros_are_decimal() -> None:
    text = re.sub(r"droppers: \[.*?\]", "droppers: [005, 010, 017, 030, 045]", dump_line(Line()))
    assert [d.position for d in parse_line(text).spans[0].droppers] == [5.0, 10.0, 17.0, 30.0, 45.0]


@pytest.mark.parametrize("number", ["1:00", "6_0.0", "yes", "'60.0'", ".nan", ".inf"])
def test_what_is_no_number_is_refused_with_its_entry(number: str) -> None:
    text = dump_line(Line()).replace("length: 60.0", f"length: {number}")
    with pytest.raises(LineFileError, match=r"spans\[0\]\.length = .*allowed is a number from 5 to 150 m"):
        parse_line(text, "mine.yaml")


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"name: \xe4\n", "line 1: byte 0xe4 is not UTF-8"), (b"gravity: 1\n---\ngravity: 2\n", "line 2: .*document")],
)
def test_odd_files_are_one_line(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(content)
    with pytest.raises(LineFileError, match=f"mine.yaml: .*{words}"):
        load_line(path)


def test_a_byte_order_mark_and_line_ends_of_dos_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + dump_line(Line()).replace("\n", "\r\n").encode())
    assert load_line(path) == Line()
