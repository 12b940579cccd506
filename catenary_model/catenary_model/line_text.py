"""A line as YAML text that `line_file.parse_line` reads back to an equal line."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, TypeVar

from catenary_model.line import Dropper, Line, Mast, PointMass, Span, SteadyArm, StitchWire, Wire
from phil_base.yaml_file import dump_yaml, number_text

T = TypeVar("T")

_NOTHING: dict[str, Any] = {
    "mass": 0.0,
    "carrier_clamp": 0.0,
    "contact_clamp": 0.0,
    "mass_per_length": 0.0,
    "source": "",
}
"""What a dropper has that is nothing but a spring."""


def dump_line(line: Line) -> str:
    """Write a line as YAML that `parse_line` reads back to an equal line, with the most frequent values as defaults.

    Of spans that are equal but for their `source` the first one's stays.
    """
    droppers = [dropper for span in line.spans for dropper in span.droppers]
    usual = _most([_rope(dropper) for dropper in droppers], _rope(Dropper(1.0)))
    pre_sag = _most([span.pre_sag for span in line.spans], 0.0)
    beginning = _most([span.pre_sag_from for span in line.spans], "mast")
    mast = _most([span.mast for span in line.spans], Mast())
    arm = _most([span.steady_arm for span in line.spans], None)
    stitch = _most([span.stitch_wire for span in line.spans], None)
    rows = [
        dump_yaml({"name": line.name}).rstrip(),
        *_source(line.source, ""),
        f"gravity: {number_text(line.gravity)}  # m/s^2",
        "",
    ]
    for what, wire in (("carrier", line.carrier), ("contact", line.contact)):
        rows += [f"{what}:  # kg/m, N s/m^2, N m^2, N"]
        rows += [f"  {key}: {_scalar(x)}" for key, x in _entries(wire)]
    rows += ["", "defaults:", f"  pre_sag: {number_text(pre_sag)}  # m"]
    rows += [f"  pre_sag_from: {beginning}"] if beginning != "mast" else []
    rows += [f"  dropper: {_mapping(_shown(dict(usual)))}  # {_units(usual)}"]
    rows += [f"  mast: {_flow(mast)}  # N/m, m"]
    rows += [f"  steady_arm: {_flow(arm)}  # N/m, kg"] if arm else []
    rows += [f"  stitch_wire: {_flow(stitch)}  # m, N, kg/m, N m^2, kg"] if stitch else []
    rows += ["", "spans:"]
    for span, equal in itertools.groupby(line.spans):
        rows += [f"  - length: {number_text(span.length)}  # m"]
        repeat = len(list(equal))
        rows += [f"    repeat: {repeat}"] if repeat > 1 else []
        rows += _source(span.source, "    ")
        rows += [f"    pre_sag: {number_text(span.pre_sag)}  # m"] if span.pre_sag != pre_sag else []
        rows += [f"    pre_sag_from: {span.pre_sag_from}"] if span.pre_sag_from != beginning else []
        rows += [f"    mast: {_flow(span.mast)}  # N/m, m"] if span.mast != mast else []
        rows += [f"    steady_arm: {_flow(span.steady_arm)}  # N/m, kg"] if span.steady_arm != arm else []
        other = span.stitch_wire != stitch
        rows += [f"    stitch_wire: {_flow(span.stitch_wire)}  # m, N, kg/m, N m^2, kg"] if other else []
        rows += _droppers(span, dict(usual))
        rows += ["    masses:  # m from the mast, kg"] if span.masses else []
        rows += [f"      - {_flow(mass)}" for mass in span.masses]
    return "\n".join(rows) + "\n"


def _droppers(span: Span, usual: dict[str, Any]) -> Iterable[str]:
    """Write the droppers of a span in one row if they differ in their positions only."""
    given = [{"position": d.position} | _differing(d, usual) for d in span.droppers]
    if all(len(one) == 1 for one in given):
        return [f"    droppers: [{', '.join(number_text(one['position']) for one in given)}]  # m from the mast"]
    return ["    droppers:  # m from the mast, N/m, N, kg, kg/m, m", *(f"      - {_mapping(one)}" for one in given)]


def _differing(dropper: Dropper, usual: dict[str, Any]) -> dict[str, Any]:
    """Return what a dropper has that is not usual."""
    own = dict(_rope(dropper))
    given = {key: own.get(key, _NOTHING.get(key)) for key in {**own, **usual} if own.get(key) != usual.get(key)}
    given = {key: x for key, x in given.items() if x is not None}
    given |= {"length": dropper.length} if dropper.length is not None else {}
    given |= {"hangs_from": dropper.hangs_from} if dropper.hangs_from != "carrier" else {}
    return given | ({"sag": dropper.sag} if dropper.sag is not None else {})


def _rope(dropper: Dropper) -> tuple[tuple[str, Any], ...]:
    """Return stiffness, masses and source of a dropper as the file has them."""
    axial = dropper.axial_stiffness
    stiff = ("stiffness", dropper.stiffness) if axial is None else ("axial_stiffness", axial)
    return (stiff, *((key, getattr(dropper, key)) for key in _NOTHING))


def _shown(rope: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is nothing, but for the mass."""
    return {key: x for key, x in rope.items() if x != _NOTHING.get(key) or key == "mass"}


def _units(rope: Iterable[tuple[str, Any]]) -> str:
    unit = {"stiffness": "N/m", "axial_stiffness": "N", "mass_per_length": "kg/m"}
    return ", ".join(unit.get(key, "kg") for key in _shown(dict(rope)) if key != "source")


def _most(values: list[T], otherwise: T) -> T:
    """Return the most frequent value, the first of them if several are."""
    return Counter(values).most_common(1)[0][0] if values else otherwise


def _source(text: str, indent: str) -> list[str]:
    return [f"{indent}source: {_quoted(text)}"] if text else []


def _quoted(text: str) -> str:
    """Write a text in double quotes on one line, which may stand within braces."""
    return '"' + "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in text) + '"'


def _scalar(x: Any) -> str:
    return _quoted(x) if isinstance(x, str) else number_text(x)


def _entries(element: Wire | Mast | SteadyArm | StitchWire | PointMass) -> list[tuple[str, Any]]:
    """Return names and values of an element, without what is empty or nothing."""
    every = [(field.name, getattr(element, field.name)) for field in fields(element)]
    return [(key, x) for key, x in every if x != "" and (key, x) != ("stiffness_damping", 0.0)]


def _mapping(entries: dict[str, Any]) -> str:
    return "{" + ", ".join(f"{key}: {_scalar(x)}" for key, x in entries.items()) + "}"


def _flow(entry: Mast | SteadyArm | StitchWire | PointMass | None) -> str:
    return "null" if entry is None else _mapping(dict(_entries(entry)))
