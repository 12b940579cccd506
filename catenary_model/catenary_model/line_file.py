"""Descriptions of overhead lines in YAML: presets by name, own files by path, and back to text.

    name: my line
    gravity: 9.81               # m/s^2, may be left out
    carrier: {mass_per_length: 1.07, damping: 0.6, bending_stiffness: 100.0, tension: 16000.0}   # kg/m N s/m^2 N m^2 N
    contact: {mass_per_length: 1.35, damping: 0.2, bending_stiffness: 150.0, tension: 20000.0}
    defaults:                   # may be left out, as a whole or in part
      pre_sag: 0.0              # m
      dropper: {stiffness: 1.0e+5, mass: 0.0}         # N/m, kg
      mast: {stiffness: 5.0e+5, encumbrance: 1.05}    # N/m, m
      steady_arm: {stiffness: 250.0, mass: 0.5}       # N/m, kg; without this entry there are no arms
    spans:
      - repeat: 3               # so many equal spans in a row, 1 if left out
        length: 60.0            # m
        droppers: [5.0, 15.0, {position: 30.0, length: 0.9}, 45.0, 55.0]   # m from the mast at the span's beginning
      - length: 50.0
        pre_sag: 0.02           # m, in place of the default
        mast: {encumbrance: 1.2}                      # what is left out here comes from the defaults
        steady_arm: null        # none here, in spite of the default
        droppers: [5.0, 15.0, 25.0, 35.0, 45.0]

A wire may also have Rayleigh's damping D = a M + b K beside or in place of `damping` (which may be 0):

    mass_damping: 0.0125        # a, 1/s, the same as a damping of a rhoA
    stiffness_damping: 1.0e-4   # b, s; the catenary-fixed reference alone has it

A dropper (or `defaults.dropper`, but for position, length and sag) may also have

    sag: 0.024                  # m that its clamp hangs below the nominal height, in place of the span's parabola
    length: 0.9                 # m, unstressed, in place of either
    axial_stiffness: 2.0e+5     # EA of its rope, N, in place of stiffness: k_d = EA/length
    mass_per_length: 0.117      # kg/m of its rope, half of it on either wire
    carrier_clamp: 0.195        # kg on the carrier
    contact_clamp: 0.165        # kg on the contact wire; `mass` is what is left, half of it on either wire

    hangs_from: stitch_wire     # of the nearer mast, in place of carrier

A span (or `defaults`) may have `pre_sag_from: first_dropper` if its parabola reaches from the first dropper to the last
one, not from mast to mast, and a stitch wire over its mast, clamped to the carrier at half its length on either side:

    stitch_wire: {length: 18.0, tension: 3500.0, mass_per_length: 0.31, bending_stiffness: 5.0, clamp: 0.2}
                                # m, N, kg/m, N m^2 (5 if left out), kg for each of its two clamps (0 if left out)

A span may have point masses on either wire (m from the mast, kg):

    masses: [{position: 20.0, wire: contact, mass: 1.2}]

A line is described as it was built. Weather puts other tensions and masses on it, its droppers keep their lengths:

    temperature: {value: 40.0, reference: 10.0, tensioning: fixed, expansion: 1.7e-5}   # degC, degC, -, 1/K
    temperature: {value: 40.0, tensioning: weights, efficiency: 0.95}
    ice: {carrier: 0.5, contact: 0.7}   # kg/m

with `axial_stiffness` (EA, N) at either wire where the ends are fixed. `dump_line` writes the line that comes out.

Every mapping may have a `source`, a text: the document of its values, what was assumed.

Every number has a range; what is unknown, missing, of the wrong type or out of range is refused with its full path.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catenary_model import statics
from catenary_model.line import (
    PRE_SAG_FROM,
    Dropper,
    Line,
    LineError,
    Mast,
    PointMass,
    Span,
    SteadyArm,
    StitchWire,
    Wire,
)
from catenary_model.line_entries import (
    DropperDefault,
    DropperEntry,
    Entry,
    File,
    WireEntry,
    contradictions,
    names,
    problem,
)
from catenary_model.line_text import dump_line
from catenary_model.reach import refuse_unridable
from catenary_model.weather import Ice, Temperature, under
from phil_base.clear_words import ClearError
from phil_base.yaml_file import YamlError, parse_yaml

__all__ = ["SUFFIXES", "LineFileError", "dump_line", "load_line", "parse_line", "preset_names"]

SUFFIXES = (".yaml", ".yml")


class LineFileError(ClearError):
    """A description of a line is unusable; the text is one line a problem: file, entry, what is allowed."""


def preset_names() -> list[str]:
    """Return the names of the lines that come with the package."""
    folder = resources.files("catenary_model") / "lines"
    return sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml"))


def load_line(name_or_path: str | Path) -> Line:
    """Load a preset by its name, or a YAML file by its path (it ends in .yaml or .yml).

    Raises LineFileError naming file and entry, or listing the presets if there is none of that name.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and path.suffix.lower() not in SUFFIXES:
        names = preset_names()
        if name_or_path not in names:
            raise LineFileError(
                f"line '{name_or_path}' is unknown: presets are {', '.join(names)}; an own line is given by the path "
                "of its .yaml file"
            )
        preset = resources.files("catenary_model") / "lines" / f"{name_or_path}.yaml"
        return parse_line(preset.read_bytes(), f"{name_or_path}.yaml", name_or_path)
    try:
        text = path.read_bytes()
    except OSError as error:
        raise LineFileError(f"{path}: cannot be read: {error.strerror}") from None
    return parse_line(text, str(path), path.stem)


@lru_cache(maxsize=4)
def parse_line(text: str | bytes, source: str = "line", name: str = "unnamed") -> Line:
    """Make a line from YAML text; `source` leads every message, `name` is for a description without one.

    The line is solved at rest, so that what cannot hang is refused here. The same text gives the same object, so a long
    line is read once a process. Raises LineFileError.
    """
    try:
        content = parse_yaml(text, source)
    except YamlError as error:
        raise LineFileError(str(error)) from None
    if not isinstance(content, dict):
        raise LineFileError(f"{source}: must be a mapping with the entries {', '.join(names(File))}")
    try:
        file = File.model_validate(content)
    except ValidationError as error:
        raise LineFileError("\n".join(f"{source}: {problem(item)}" for item in error.errors())) from None
    problems = [f"{source}: {one}" for one in contradictions(file)]
    if problems:
        raise LineFileError("\n".join(problems))
    line = _line(file, source, name)
    try:
        line = _weathered(line, file)
        refuse_unridable(statics.solve(line))
    except statics.StaticsError as error:
        origin = [i for i, span in enumerate(file.spans) for _ in range(span.repeat)]
        span = None if error.span is None else origin[error.span]
        raise LineFileError(f"{source}: {statics.StaticsError(error.problem, span, error.dropper)}") from None
    except ValueError as error:
        raise LineFileError(f"{source}: {error}") from None
    return line


def _weathered(line: Line, file: File) -> Line:
    """Put a line under the file's weather. Raises ValueError."""
    if file.temperature is None and file.ice is None:
        return line
    warm = None if file.temperature is None else Temperature(**_but_source(file.temperature))
    ice = Ice() if file.ice is None else Ice(**_but_source(file.ice))
    return under(line, warm, ice, (file.carrier.axial_stiffness, file.contact.axial_stiffness))


def _but_source(entry: Entry) -> dict[str, Any]:
    return {key: value for key, value in entry.given().items() if key != "source"}


def _line(file: File, source: str, name: str) -> Line:
    """Fill in the defaults and repeat the spans; file and entry are put before what the data classes refuse."""
    where = "spans"
    try:
        spans: list[Span] = []
        for i, entry in enumerate(file.spans):
            droppers = []
            for j, dropper in enumerate(entry.droppers):
                where = f"spans[{i}].droppers[{j}]"
                droppers.append(Dropper(**_rope(file.defaults.dropper, dropper)))
            where = f"spans[{i}]"
            arm = entry.steady_arm if "steady_arm" in entry.model_fields_set else file.defaults.steady_arm
            stitch = entry.stitch_wire if "stitch_wire" in entry.model_fields_set else file.defaults.stitch_wire
            pre_sag = file.defaults.pre_sag if entry.pre_sag is None else entry.pre_sag
            span = Span(
                length=entry.length,
                droppers=tuple(droppers),
                pre_sag=0.0 if pre_sag is None else pre_sag,
                mast=Mast(**_merged(file.defaults.mast, entry.mast)),
                steady_arm=None if arm is None else SteadyArm(**_merged(file.defaults.steady_arm, arm)),
                stitch_wire=None if stitch is None else StitchWire(**_merged(file.defaults.stitch_wire, stitch)),
                pre_sag_from=entry.pre_sag_from or file.defaults.pre_sag_from or PRE_SAG_FROM[0],
                masses=tuple(PointMass(**mass.given()) for mass in entry.masses),
                source=entry.source or "",
            )
            spans += [span] * entry.repeat
        where = "line"
        carrier, contact = _wire(file.carrier), _wire(file.contact)
        name = name if file.name is None else file.name
        return Line(carrier, contact, tuple(spans), file.gravity, name, source=file.source or "")
    except LineError as error:
        origin = [i for i, entry in enumerate(file.spans) for _ in range(entry.repeat)]
        raise LineFileError(f"{source}: {LineError(error.problem, origin[error.span], error.dropper)}") from None
    except ValueError as error:
        raise LineFileError(f"{source}: {where}: {error}") from None


def _wire(entry: WireEntry) -> Wire:
    """Make a wire: damping in proportion to mass is viscous damping."""
    given = entry.given()
    given.pop("axial_stiffness", None)
    more = given.pop("mass_damping", 0.0) * entry.mass_per_length
    return Wire(**given | ({"damping": entry.damping + more} if more else {}))


def _merged(default: Entry | None, entry: Entry | None) -> dict[str, Any]:
    return (default.given() if default else {}) | (entry.given() if entry else {})


def _rope(default: DropperDefault | None, entry: DropperEntry) -> dict[str, Any]:
    """Merge a dropper with the defaults: of the two ways to give its stiffness, its own one counts."""
    merged = _merged(default, entry)
    if entry.axial_stiffness is not None:
        merged.pop("stiffness", None)
    if entry.stiffness is not None:
        merged.pop("axial_stiffness", None)
    return merged
