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

Every number has a range; what is unknown, missing, of the wrong type or out of range is refused with its full path.
"""

from __future__ import annotations

import difflib
import itertools
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from catenary_model import statics
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm, Wire
from catenary_model.reach import refuse_unridable
from phil_base.clear_words import ClearError
from phil_base.yaml_file import YamlError, dump_yaml, number_text, parse_yaml

T = TypeVar("T")

SUFFIXES = (".yaml", ".yml")


class LineFileError(ClearError):
    """A description of a line is unusable; the text is one line a problem: file, entry, what is allowed."""


def _number(description: str, unit: str, low: float, high: float, **default: Any) -> Any:
    """Declare a number from low to high."""
    return Field(description=description, ge=low, le=high, json_schema_extra={"unit": unit}, **default)


class _Entry(BaseModel):
    """Base of every mapping in the file: no unknown keys, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    def given(self) -> dict[str, Any]:
        """Return the entries that the file gives and that are not null."""
        return {key: getattr(self, key) for key in self.model_fields_set if getattr(self, key) is not None}


class _Wire(_Entry):
    mass_per_length: float = _number("Mass per length rhoA", "kg/m", 0.05, 20.0)
    damping: float = _number("Damping per length beta", "N s/m^2", 0.0, 20.0)
    bending_stiffness: float = _number("Bending stiffness EI", "N m^2", 1.0, 1e5)
    tension: float = _number("Axial tension T", "N", 1e3, 2e5)


class _DropperDefault(_Entry):
    stiffness: float | None = _number("Stiffness k_d of a taut dropper", "N/m", 1e3, 1e7, default=None)
    mass: float | None = _number("Mass of the dropper with its clamps", "kg", 0.0, 50.0, default=None)


class _Dropper(_DropperDefault):
    position: float = _number("Distance from the mast at the span's beginning", "m", 0.0, 150.0)
    length: float | None = _number("Unstressed length l_0; left out: computed", "m", 0.01, 10.0, default=None)


class _Mast(_Entry):
    stiffness: float | None = _number("Stiffness k_m under the carrier", "N/m", 1e3, 1e8, default=None)
    encumbrance: float | None = _number("Carrier above the nominal contact wire", "m", 0.1, 10.0, default=None)


class _SteadyArm(_Entry):
    stiffness: float | None = _number("Vertical stiffness on the contact wire", "N/m", 0.0, 1e7, default=None)
    mass: float | None = _number("Mass that moves with the contact wire", "kg", 0.0, 50.0, default=None)


def _position_alone(value: object) -> object:
    """Read a bare number in the list of droppers as a position."""
    return {"position": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


class _Span(_Entry):
    length: float = _number("Distance to the next mast", "m", 5.0, 150.0)
    droppers: list[Annotated[_Dropper, BeforeValidator(_position_alone)]]
    repeat: int = _number("Number of equal spans in a row", "", 1, 1000, default=1)
    pre_sag: float | None = _number("Sag of the clamps in mid-span", "m", -0.5, 0.5, default=None)
    mast: _Mast | None = None
    steady_arm: _SteadyArm | None = None


class _Defaults(_Entry):
    pre_sag: float | None = _number("Sag of the clamps in mid-span", "m", -0.5, 0.5, default=None)
    dropper: _DropperDefault | None = None
    mast: _Mast | None = None
    steady_arm: _SteadyArm | None = None


class _File(_Entry):
    carrier: _Wire
    contact: _Wire
    spans: Annotated[list[_Span], Field(min_length=1)]
    name: str | None = None
    gravity: float = _number("Acceleration of gravity", "m/s^2", 0.0, 20.0, default=9.81)
    defaults: _Defaults = _Defaults()


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
        raise LineFileError(f"{source}: must be a mapping with the entries {', '.join(_File.model_fields)}")
    try:
        file = _File.model_validate(content)
    except ValidationError as error:
        raise LineFileError("\n".join(f"{source}: {_problem(item)}" for item in error.errors())) from None
    problems = [f"{source}: {problem}" for problem in _misplaced(file)]
    if problems:
        raise LineFileError("\n".join(problems))
    line = _line(file, source, name)
    try:
        refuse_unridable(statics.solve(line))
    except statics.StaticsError as error:
        origin = [i for i, span in enumerate(file.spans) for _ in range(span.repeat)]
        span = None if error.span is None else origin[error.span]
        raise LineFileError(f"{source}: {statics.StaticsError(error.problem, span, error.dropper)}") from None
    return line


def _line(file: _File, source: str, name: str) -> Line:
    """Fill in the defaults and repeat the spans; file and entry are put before what the data classes refuse."""
    where = "spans"
    try:
        spans: list[Span] = []
        for i, entry in enumerate(file.spans):
            droppers = []
            for j, dropper in enumerate(entry.droppers):
                where = f"spans[{i}].droppers[{j}]"
                droppers.append(Dropper(**_merged(file.defaults.dropper, dropper)))
            where = f"spans[{i}]"
            arm = entry.steady_arm if "steady_arm" in entry.model_fields_set else file.defaults.steady_arm
            pre_sag = file.defaults.pre_sag if entry.pre_sag is None else entry.pre_sag
            span = Span(
                length=entry.length,
                droppers=tuple(droppers),
                pre_sag=0.0 if pre_sag is None else pre_sag,
                mast=Mast(**_merged(file.defaults.mast, entry.mast)),
                steady_arm=None if arm is None else SteadyArm(**_merged(file.defaults.steady_arm, arm)),
            )
            spans += [span] * entry.repeat
        where = "line"
        carrier, contact = Wire(**file.carrier.given()), Wire(**file.contact.given())
        return Line(carrier, contact, tuple(spans), file.gravity, name if file.name is None else file.name)
    except ValueError as error:
        raise LineFileError(f"{source}: {where}: {error}") from None


def _merged(default: _Entry | None, entry: _Entry | None) -> dict[str, Any]:
    return (default.given() if default else {}) | (entry.given() if entry else {})


def _misplaced(file: _File) -> Iterable[str]:
    """Tell every dropper that is not between the one before it and the end of its span."""
    for i, span in enumerate(file.spans):
        before = 0.0
        for j, dropper in enumerate(span.droppers):
            if not before < dropper.position < span.length:
                after = "the mast" if j == 0 else "the dropper before it"
                yield (
                    f"spans[{i}].droppers[{j}].position = {dropper.position:g}: allowed is more than {before:g} m "
                    f"({after}) and less than {span.length:g} m (length of the span)"
                )
            before = max(before, dropper.position)


def _problem(item: Any) -> str:
    """Say one pydantic error with the path of its entry and what is allowed."""
    model: type[_Entry] | None = _File
    where, field, keys = "", None, list(_File.model_fields)
    for part in item["loc"]:
        if isinstance(part, int):
            where += f"[{part}]"
            continue
        where += f".{part}" if where else str(part)
        if model is not None:
            keys, field = list(model.model_fields), model.model_fields.get(str(part))
            model = None if field is None else _model_of(field)
    if field is None:
        near = difflib.get_close_matches(str(item["loc"][-1]), keys, 1)
        return f"{where}: unknown entry; {f'did you mean {near[0]}? ' if near else ''}allowed are {', '.join(keys)}"
    is_list = get_origin(field.annotation) is list and isinstance(item["loc"][-1], str)
    value = " is missing;" if item["type"] == "missing" else ":" if is_list else f" = {item['input']!r}:"
    return f"{where}{value} allowed is {_allowed(field, is_list)}"


def _model_of(field: FieldInfo) -> type[_Entry] | None:
    """Return the model behind a field: alone, optional, or in a list."""
    pending: list[Any] = [field.annotation]
    while pending:
        kind = pending.pop()
        if isinstance(kind, type) and issubclass(kind, _Entry):
            return kind
        pending += get_args(kind)
    return None


def _allowed(field: FieldInfo, is_list: bool) -> str:
    """Say in words what a field may be."""
    model = _model_of(field)
    if model is not None:
        keys = ", ".join(model.model_fields)
        each = f"a position (m) or a mapping of {keys}" if model is _Dropper else f"a mapping of {keys}"
        least = " of at least one" if model is _Span else ""
        return f"a list{least}, each entry {each}" if is_list else each
    if not isinstance(field.json_schema_extra, dict):
        return "a text"
    low, high = (next(getattr(m, key) for m in field.metadata if hasattr(m, key)) for key in ("ge", "le"))
    kind = "an integer" if field.annotation is int else "a number"
    return f"{kind} from {low:g} to {high:g} {field.json_schema_extra['unit']}".rstrip()


def dump_line(line: Line) -> str:
    """Write a line as YAML that `parse_line` reads back to an equal line, with the most frequent values as defaults."""
    droppers = [dropper for span in line.spans for dropper in span.droppers]
    k_d, m_d = _most([(d.stiffness, d.mass) for d in droppers], (Dropper.stiffness, Dropper.mass))
    pre_sag = _most([span.pre_sag for span in line.spans], 0.0)
    mast = _most([span.mast for span in line.spans], Mast())
    arm = _most([span.steady_arm for span in line.spans], None)
    rows = [
        dump_yaml({"name": line.name}).rstrip(),
        f"gravity: {number_text(line.gravity)}  # m/s^2",
        "",
    ]
    for what, wire in (("carrier", line.carrier), ("contact", line.contact)):
        rows += [
            f"{what}:  # kg/m, N s/m^2, N m^2, N",
            *(f"  {key}: {number_text(x)}" for key, x in asdict(wire).items()),
        ]
    rows += ["", "defaults:", f"  pre_sag: {number_text(pre_sag)}  # m"]
    rows += [f"  dropper: {{stiffness: {number_text(k_d)}, mass: {number_text(m_d)}}}  # N/m, kg"]
    rows += [f"  mast: {_flow(mast)}  # N/m, m"]
    rows += [f"  steady_arm: {_flow(arm)}  # N/m, kg"] if arm else []
    rows += ["", "spans:"]
    for span, equal in itertools.groupby(line.spans):
        rows += [f"  - length: {number_text(span.length)}  # m"]
        repeat = len(list(equal))
        rows += [f"    repeat: {repeat}"] if repeat > 1 else []
        rows += [f"    pre_sag: {number_text(span.pre_sag)}  # m"] if span.pre_sag != pre_sag else []
        rows += [f"    mast: {_flow(span.mast)}  # N/m, m"] if span.mast != mast else []
        rows += [f"    steady_arm: {_flow(span.steady_arm)}  # N/m, kg"] if span.steady_arm != arm else []
        if all(d == Dropper(d.position, k_d, m_d) for d in span.droppers):
            rows += [f"    droppers: [{', '.join(number_text(d.position) for d in span.droppers)}]  # m from the mast"]
            continue
        rows += ["    droppers:  # m from the mast, N/m, kg, m"]
        for d in span.droppers:
            given = {"position": d.position}
            given |= {"stiffness": d.stiffness} if d.stiffness != k_d else {}
            given |= {"mass": d.mass} if d.mass != m_d else {}
            given |= {"length": d.length} if d.length is not None else {}
            rows += ["      - {" + ", ".join(f"{key}: {number_text(x)}" for key, x in given.items()) + "}"]
    return "\n".join(rows) + "\n"


def _most(values: list[T], otherwise: T) -> T:
    """Return the most frequent value, the first of them if several are."""
    return Counter(values).most_common(1)[0][0] if values else otherwise


def _flow(entry: Mast | SteadyArm | None) -> str:
    if entry is None:
        return "null"
    return "{" + ", ".join(f"{key}: {number_text(x)}" for key, x in asdict(entry).items()) + "}"
