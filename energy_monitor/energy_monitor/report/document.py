"""The report as a JSON document: every number in SI units, what cannot be computed as null, units beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from energy_monitor.report import results
from energy_monitor.report.results import Report

SCHEMA = "phil-catenary/ride-report"
SCHEMA_VERSION = 1


def document(report: Report) -> dict[str, Any]:
    """Turn a report into plain data: the sections of `Report`, and `units` by dotted path (1 is left out)."""
    head = {"schema": SCHEMA, "schema_version": SCHEMA_VERSION, "ok": report.ok}
    body = {entry.name: _plain(getattr(report, entry.name)) for entry in fields(report) if entry.name != "series"}
    return head | body | {"units": dict(_units(Report, ""))}


def document_text(report: Report) -> str:
    """Give the document as strict JSON (no NaN)."""
    return json.dumps(document(report), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _units(kind: Any, path: str) -> Iterator[tuple[str, str]]:
    """Walk the types of a report for declared units; `[]` stands for any entry of a list."""
    hints = get_type_hints(kind, vars(results))
    for entry in fields(kind):
        if entry.name == "series":
            continue
        hint = hints[entry.name]
        name = path + entry.name
        unit = entry.metadata.get("unit", "1")
        if unit != "1":
            yield name, unit
        if is_dataclass(hint):
            yield from _units(hint, f"{name}.")
        elif get_origin(hint) is list and is_dataclass(get_args(hint)[0]):
            yield from _units(get_args(hint)[0], f"{name}[].")
