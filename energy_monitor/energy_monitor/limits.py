"""Limits of the contact force from a YAML table that names its sources, and the verdict over a ride."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from energy_monitor.contact_quality import ContactStatistics
from phil_base.clear_words import ClearError
from phil_base.parameters import config_file
from phil_base.yaml_file import YamlError, read_yaml

QUANTITIES = (
    "mean",
    "sigma",
    "minimum",
    "maximum",
    "statistical_minimum",
    "statistical_maximum",
    "loss_share",
    "losses",
)
"""What a table may limit: the figures of ContactStatistics."""


class LimitsError(ClearError):
    """The table of limits cannot be read or is not consistent; the text is one line."""


@dataclass(frozen=True)
class Bound:
    """A bound that depends on the speed v in km/h and the mean force Fm in N: constant + square v^2 + of_mean Fm."""

    constant: float = 0.0
    square: float = 0.0
    of_mean: float = 0.0

    def at(self, speed_kmh: float, mean: float) -> float:
        """Give the bound's value in the unit of its quantity."""
        return self.constant + self.square * speed_kmh**2 + self.of_mean * mean


@dataclass(frozen=True)
class Range:
    """Bounds that hold for ``above_kmh`` < v <= ``to_kmh``; a side without a bound is None."""

    above_kmh: float
    to_kmh: float
    low: Bound | None
    high: Bound | None


@dataclass(frozen=True)
class Rule:
    """Everything that a standard says of one quantity, with its source."""

    quantity: str
    name: str
    unit: str
    source: str
    ranges: tuple[Range, ...]

    def range_at(self, speed_kmh: float) -> Range | None:
        """Find the range of a speed; None when the table says nothing about it."""
        for found in self.ranges:
            if found.above_kmh < speed_kmh <= found.to_kmh:
                return found
        first = self.ranges[0]
        return first if speed_kmh == first.above_kmh else None


@dataclass(frozen=True)
class Standard:
    """A named set of rules."""

    key: str
    title: str
    rules: tuple[Rule, ...]


@dataclass(frozen=True)
class Check:
    """One row of a verdict: value and limits in ``unit``; ``ok`` is None where the table says nothing."""

    quantity: str
    name: str
    unit: str
    value: float
    low: float | None
    high: float | None
    ok: bool | None
    source: str


def load(path: Path | str | None = None) -> dict[str, Standard]:
    """Read a table of limits; without ``path`` the one that comes with the package.

    Raises
    ------
    LimitsError
        The file is missing, is no YAML, or breaks a rule of the table (unknown key, gap between ranges, ...).
    """
    own = config_file("energy_monitor", "contact_force_limits.yaml")
    file = Path(os.path.expanduser(path)) if path else own  # noqa: PTH111 - an unknown user's home stays as it is
    try:
        tree = read_yaml(file)
    except YamlError as error:
        raise LimitsError(str(error)) from None
    if not isinstance(tree, Mapping) or not tree:
        raise LimitsError(f"{file}: has to be a mapping of standards")
    try:
        return {str(key): _standard(str(key), value) for key, value in tree.items()}
    except LimitsError as error:
        raise LimitsError(f"{file}: {error}") from None


def chosen(file: str, name: str) -> Standard:
    """Read the standard ``name`` from the table that the parameter ``limits.file`` names, empty: the package's.

    Raises
    ------
    LimitsError
        The table cannot be used, or does not have the standard; the text names the parameter.
    """
    try:
        table = load(file or None)
    except LimitsError as error:
        raise LimitsError(f"parameter 'limits.file': {error}") from None
    if name not in table:
        raise LimitsError(f"parameter 'limits.standard' = {name!r} is not one of {', '.join(table)}")
    return table[name]


def evaluate(standard: Standard, statistics: ContactStatistics, speed_kmh: float) -> list[Check]:
    """Hold the statistics of a ride at ``speed_kmh`` against every rule; the limits themselves are allowed."""
    checks = []
    for rule in standard.rules:
        value = float(getattr(statistics, rule.quantity))
        found = rule.range_at(speed_kmh)
        low = found.low.at(speed_kmh, statistics.mean) if found and found.low else None
        high = found.high.at(speed_kmh, statistics.mean) if found and found.high else None
        ok: bool | None = None
        if found is not None and statistics.samples > 0:
            ok = (low is None or value >= low) and (high is None or value <= high)
        checks.append(Check(rule.quantity, rule.name, rule.unit, value, low, high, ok, rule.source))
    return checks


def verdict(checks: Sequence[Check]) -> bool | None:
    """Sum up: False if any check failed, None if none could be made, else True."""
    made = [check.ok for check in checks if check.ok is not None]
    return all(made) if made else None


def _standard(key: str, tree: Any) -> Standard:
    _expect(tree, key, {"title", "checks"}, {"title", "checks"})
    if not isinstance(tree["title"], str):
        raise LimitsError(f"{key}: title = {tree['title']!r} has to be a text")
    if not isinstance(tree["checks"], list) or not tree["checks"]:
        raise LimitsError(f"{key}: checks has to be a list")
    rules = tuple(_rule(f"{key}.checks[{i}]", rule) for i, rule in enumerate(tree["checks"]))
    return Standard(key, str(tree["title"]), rules)


def _rule(where: str, tree: Any) -> Rule:
    names = {"quantity", "name", "unit", "source", "ranges"}
    _expect(tree, where, names, names)
    quantity = tree["quantity"]
    if quantity not in QUANTITIES:
        raise LimitsError(f"{where}: quantity {quantity!r} is not one of {', '.join(QUANTITIES)}")
    if not isinstance(tree["ranges"], list) or not tree["ranges"]:
        raise LimitsError(f"{where}: ranges has to be a list")
    ranges = tuple(_range(f"{where}.ranges[{i}]", entry) for i, entry in enumerate(tree["ranges"]))
    for before, after in pairwise(ranges):
        if before.to_kmh != after.above_kmh:
            raise LimitsError(f"{where}: gap or overlap of the ranges at {before.to_kmh:g} km/h")
    return Rule(quantity, str(tree["name"]), str(tree["unit"]), str(tree["source"]), ranges)


def _range(where: str, tree: Any) -> Range:
    _expect(tree, where, {"above_kmh", "to_kmh", "low", "high"}, {"above_kmh", "to_kmh"})
    above, to = _number(where, tree, "above_kmh"), _number(where, tree, "to_kmh")
    if above >= to:
        raise LimitsError(f"{where}: above_kmh {above:g} has to be below to_kmh {to:g}")
    bounds = {side: _bound(f"{where}.{side}", tree[side]) if side in tree else None for side in ("low", "high")}
    if bounds["low"] is None and bounds["high"] is None:
        raise LimitsError(f"{where}: needs low or high")
    low, high = bounds["low"], bounds["high"]
    # Both are linear in v^2 and Fm; at Fm = 0 and at any Fm with equal factors their order is known.
    if (
        low
        and high
        and low.of_mean >= high.of_mean
        and min(high.at(v, 0.0) - low.at(v, 0.0) for v in (above, to)) < 0.0
    ):
        raise LimitsError(f"{where}: low is above high, so that nothing could fulfil it")
    return Range(above, to, low, high)


def _bound(where: str, tree: Any) -> Bound:
    names = {"constant", "square", "of_mean"}
    _expect(tree, where, names, set())
    if not tree:
        raise LimitsError(f"{where}: needs one of constant, square, of_mean")
    return Bound(**{name: _number(where, tree, name) for name in tree})


def _expect(tree: Any, where: str, known: set[str], needed: set[str]) -> None:
    if not isinstance(tree, Mapping):
        raise LimitsError(f"{where}: has to be a mapping")
    unknown, absent = set(tree) - known, needed - set(tree)
    if unknown or absent:
        problem = f"unknown key {sorted(map(str, unknown))[0]!r}" if unknown else f"{sorted(absent)[0]!r} is missing"
        raise LimitsError(f"{where}: {problem}")


def _number(where: str, tree: Mapping[str, Any], name: str) -> float:
    value = tree[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise LimitsError(f"{where}: {name} = {value!r} has to be a number")
    return float(value)
