"""Reference values of `en50318` from YAML: which edition, from where, and whether anybody has read them."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phil_base.clear_words import ClearError
from phil_base.yaml_file import YamlError, read_yaml

OWN = Path(__file__).with_name("reference_values.yaml")
"""The file that comes with the package."""
STATUS = ("read", "second-hand", "unverified")
"""What is known of a number; only on a range that was `read` a verdict is given."""
QUANTITIES: dict[str, tuple[str, str]] = {
    "mean": ("mean force", "N"),
    "sigma": ("standard deviation", "N"),
    "sigma_0_5": ("standard deviation, 0 to 5 Hz", "N"),
    "sigma_5_20": ("standard deviation, 5 to 20 Hz", "N"),
    "statistical_maximum": ("statistical maximum", "N"),
    "statistical_minimum": ("statistical minimum", "N"),
    "maximum": ("actual maximum", "N"),
    "minimum": ("actual minimum", "N"),
    "uplift": ("maximum uplift at support", "mm"),
    "height_range": ("range of height of the contact point", "mm"),
    "loss": ("loss of contact", "%"),
    "loss_below_20_hz": ("loss of contact, force below 20 Hz", "%"),
}
"""Name and unit of what a ride is asked for, by its key in the file; `loss` is that of the force before any filter."""
MODELS = ("en50318_2002", "ac_simple")
"""What can be ridden for a set."""
SPEED = (50.0, 400.0)
"""Least and largest speed of an entry, km/h."""
_SET = ("edition", "in_force", "source", "status", "model", "values")
_ENTRY = ("quantity", "speed_kmh", "low", "high", "value", "status", "source")


class ReferenceValuesError(ClearError):
    """A file of reference values cannot be used; the text is one line: file, key, value, what is allowed."""


@dataclass(frozen=True)
class Reference:
    """One entry: an accepted range, or what another one got (then `low` and `high` are equal)."""

    quantity: str
    """Key of `QUANTITIES`."""
    speed_kmh: float
    low: float
    high: float
    is_range: bool
    """Whether it is an accepted range."""
    status: str
    source: str

    @property
    def judges(self) -> bool:
        """Tell whether a verdict may be given on it."""
        return self.is_range and self.status == "read"

    @property
    def words(self) -> str:
        """Say the range or the value."""
        return f"{self.low:g} .. {self.high:g}" if self.is_range else f"{self.low:g}"


@dataclass(frozen=True)
class ReferenceSet:
    """What one edition, or one other code, says."""

    key: str
    edition: str
    in_force: bool
    model: str
    """What is ridden for it, one of `MODELS`."""
    entries: tuple[Reference, ...]

    @property
    def judges(self) -> bool:
        """Tell whether a verdict is given on any of it."""
        return any(entry.judges for entry in self.entries)

    def about(self) -> str:
        """Say in one line what the set is, where it is from and what it is used for."""
        kinds = {(entry.status, entry.source): entry for entry in self.entries}
        told = "; ".join(f"{status}: {source}" for status, source in kinds)
        force = "in force" if self.in_force else "withdrawn"
        use = "verdicts on the ranges that were read" if self.judges else "for comparison only, no verdict"
        return f"{self.edition} ({force}): {use}; {told}."


def load(path: Path | None = None) -> tuple[ReferenceSet, ...]:
    """Read a file of reference values; without `path` the one that comes with the package.

    Raises ReferenceValuesError, one line that names file, key, value and what is allowed.
    """
    file = OWN if path is None else path
    try:
        tree = read_yaml(file)
    except YamlError as error:
        raise ReferenceValuesError(str(error)) from None
    try:
        if not isinstance(tree, Mapping) or not tree:
            raise ReferenceValuesError("allowed is a mapping of sets of values")
        sets = tuple(_set(str(key), value) for key, value in tree.items())
        _refuse_two_verdicts(sets)
    except ReferenceValuesError as error:
        raise ReferenceValuesError(f"{file}: {error}") from None
    return sets


def _set(key: str, tree: Any) -> ReferenceSet:
    _keys(key, tree, _SET, _SET)
    source, status = _text(key, tree, "source"), _one_of(key, tree, "status", STATUS)
    if not isinstance(tree["in_force"], bool):
        raise ReferenceValuesError(f"{key}.in_force = {tree['in_force']!r}: allowed is true or false")
    if not isinstance(tree["values"], list) or not tree["values"]:
        raise ReferenceValuesError(f"{key}.values: allowed is a list of at least one entry of {', '.join(_ENTRY)}")
    entries = tuple(_entry(f"{key}.values[{i}]", one, status, source) for i, one in enumerate(tree["values"]))
    seen: set[tuple[str, float]] = set()
    for i, entry in enumerate(entries):
        if (entry.quantity, entry.speed_kmh) in seen:
            raise ReferenceValuesError(
                f"{key}.values[{i}]: {entry.quantity} at {entry.speed_kmh:g} km/h is given twice; allowed is once"
            )
        seen.add((entry.quantity, entry.speed_kmh))
    return ReferenceSet(
        key, _text(key, tree, "edition"), tree["in_force"], _one_of(key, tree, "model", MODELS), entries
    )


def _entry(where: str, tree: Any, status: str, source: str) -> Reference:
    _keys(where, tree, _ENTRY, _ENTRY[:2])
    quantity = _one_of(where, tree, "quantity", QUANTITIES)
    speed = _number(where, tree, "speed_kmh")
    if not SPEED[0] <= speed <= SPEED[1]:
        raise ReferenceValuesError(f"{where}.speed_kmh = {speed:g}: allowed is {SPEED[0]:g} to {SPEED[1]:g} km/h")
    given = {name for name in ("low", "high", "value") if name in tree}
    if given not in ({"low", "high"}, {"value"}):
        has = ", ".join(sorted(given)) or "none of them"
        raise ReferenceValuesError(f"{where}: has {has}; allowed is low and high, or value alone")
    low, high = (_number(where, tree, name) for name in (("value", "value") if "value" in given else ("low", "high")))
    if low > high:
        raise ReferenceValuesError(f"{where}.low = {low:g}: allowed is at most high = {high:g}")
    return Reference(
        quantity,
        speed,
        low,
        high,
        "value" not in given,
        _one_of(where, tree, "status", STATUS) if "status" in tree else status,
        _text(where, tree, "source") if "source" in tree else source,
    )


def _refuse_two_verdicts(sets: Iterable[ReferenceSet]) -> None:
    """One quantity of one ride has one verdict."""
    seen: dict[tuple[str, str, float], str] = {}
    for one in sets:
        for entry in one.entries:
            if not entry.judges:
                continue
            what = one.model, entry.quantity, entry.speed_kmh
            if what in seen:
                raise ReferenceValuesError(
                    f"{one.key}: {entry.quantity} at {entry.speed_kmh:g} km/h has a range that was read in "
                    f"{seen[what]} as well; allowed is one verdict for model {one.model}"
                )
            seen[what] = one.key


def _keys(where: str, tree: Any, known: tuple[str, ...], needed: tuple[str, ...]) -> None:
    if not isinstance(tree, Mapping):
        raise ReferenceValuesError(f"{where} = {tree!r}: allowed is a mapping of {', '.join(known)}")
    for key in tree:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1)
            meant = f"did you mean {near[0]}? " if near else ""
            raise ReferenceValuesError(f"{where}.{key}: unknown key; {meant}allowed are {', '.join(known)}")
    for key in needed:
        if key not in tree:
            allowed = {"status": ", ".join(STATUS), "model": ", ".join(MODELS), "quantity": ", ".join(QUANTITIES)}
            other = {"speed_kmh": "a number", "in_force": "true or false", "values": "a list of entries"}
            said = allowed.get(key, other.get(key, "a text"))
            raise ReferenceValuesError(f"{where}.{key} is missing; allowed is {said}")


def _text(where: str, tree: Mapping[str, Any], key: str) -> str:
    value = tree[key]
    if not isinstance(value, str) or not value.strip():
        raise ReferenceValuesError(f"{where}.{key} = {value!r}: allowed is a text")
    return value.strip()


def _one_of(where: str, tree: Mapping[str, Any], key: str, allowed: Iterable[str]) -> str:
    value, names = tree[key], tuple(allowed)
    if not isinstance(value, str) or value not in names:
        raise ReferenceValuesError(f"{where}.{key} = {value!r}: allowed is one of {', '.join(names)}")
    return value


def _number(where: str, tree: Mapping[str, Any], key: str) -> float:
    value = tree[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ReferenceValuesError(f"{where}.{key} = {value!r}: allowed is a finite number")
    return float(value)
