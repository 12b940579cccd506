"""Parameters of a node: one pydantic model names, types, bounds and explains them; a YAML file gives the defaults.

The model is the only place that knows a parameter's range and unit, ``config/NODE.yaml`` the only place that knows
its default. Nested groups become dotted ROS names (``weights.position``). Nothing here imports rclpy.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from phil_base.clear_words import ClearError
from phil_base.parameter_file import read_parameter_file
from phil_base.yaml_file import YamlError

G = TypeVar("G", bound="Group")


class ParameterError(ClearError):
    """A parameter is unknown, missing, of a wrong type or out of range; the text is one line a parameter."""


class Group(BaseModel):
    """Base of every set of parameters: no unknown keys, no silent conversion, no change after construction."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    def check_build(self) -> None:
        """Raise ValueError where a node with these parameters could not be built: files, designs; costly parts too."""


@dataclass(frozen=True)
class Info:
    """What is known of one parameter: ``kind`` is bool, int, float, str or list, ``unit`` is for people."""

    name: str
    kind: type
    description: str
    unit: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]
    live: bool

    def allowed(self) -> str:
        """Say in words what values are allowed."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.kind is bool:
            return "true or false"
        if self.kind is str:
            return "a text"
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        what = "one or more numbers" if self.kind is list else "an integer" if self.kind is int else "a number"
        return what + self.range() + unit

    def range(self) -> str:
        """Say the range, empty without one."""
        if self.low is None and self.high is None:
            return ""
        show = str if self.kind is int else "{:g}".format
        low = "-inf" if self.low is None else show(self.low)
        high = "inf" if self.high is None else show(self.high)
        return f" from {low} to {high}"


def parameter(
    description: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> Any:
    """Declare one parameter of a :class:`Group`: no default here, the YAML has it; ``live`` may change while active."""
    return Field(
        description=description,
        json_schema_extra={
            "unit": unit,
            "low": low,
            "high": high,
            "choices": list(choices),
            "live": live,
        },
    )


def infos(model: type[Group], prefix: str = "") -> Iterator[Info]:
    """Give every parameter of a model in its order, nested groups flattened to dotted names."""
    for name, field in model.model_fields.items():
        nested = _group_of(field)
        if nested is not None:
            yield from infos(nested, f"{prefix}{name}.")
            continue
        extra: dict[str, Any] = dict(field.json_schema_extra) if isinstance(field.json_schema_extra, dict) else {}
        yield Info(
            name=prefix + name,
            kind=_kind(field),
            description=field.description or "",
            unit=str(extra.get("unit", "")),
            low=extra.get("low"),
            high=extra.get("high"),
            choices=tuple(extra.get("choices", ())),
            live=bool(extra.get("live", False)),
        )


def build(model: type[G], values: Mapping[str, Any], node: str = "") -> G:
    """Make the parameter object from flat dotted names; an integer is taken where a number is wanted.

    Raises
    ------
    ParameterError
        One line for each unknown or missing key, wrong type or value out of range, with key, value and allowed range.
    """
    known = {info.name: info for info in infos(model)}
    lead = f"{node}: " if node else ""
    problems = []
    clean: dict[str, Any] = {}
    for name, value in values.items():
        info = known.get(name)
        if info is None:
            problems.append(f"{lead}parameter '{name}' = {value!r} is unknown{nearest(name, known)}")
            continue
        checked = _convert(info, value)
        if checked is None:
            problems.append(f"{lead}parameter '{name}' = {value!r} is not allowed: {info.allowed()}")
        else:
            clean[name] = checked
    problems += [
        f"{lead}parameter '{name}' is missing: {info.allowed()}" for name, info in known.items() if name not in values
    ]
    if problems:
        raise ParameterError("\n".join(problems))
    try:
        return model.model_validate(nest(clean))
    except ValidationError as error:
        lines = []
        for item in error.errors():
            where = ".".join(str(part) for part in item["loc"])
            for what in str(item["msg"]).removeprefix("Value error, ").splitlines():
                lines.append(f"{lead}parameter '{where}': {what}" if where else f"{lead}{what}")
        raise ParameterError("\n".join(lines)) from None


def flatten(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn nested mappings into one with dotted names."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat.update(flatten(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def nest(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Turn dotted names back into nested mappings."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *path, last = name.split(".")
        branch = tree
        for part in path:
            branch = branch.setdefault(part, {})
        branch[last] = value
    return tree


def values_of(group: Group) -> dict[str, Any]:
    """Give the flat dotted values of a parameter object."""
    return flatten(group.model_dump())


def read_file(path: Path | str) -> dict[str, dict[str, Any]]:
    """Read a ROS parameter file: node name (or pattern), without its leading slash, to flat dotted values.

    Raises
    ------
    ParameterError
        The file is missing, or ROS would refuse it.
    """
    try:
        file = read_parameter_file(path)
    except YamlError as error:
        raise ParameterError(str(error)) from None
    found: dict[str, dict[str, Any]] = {}
    for name, entries in file.nodes:
        values = {entry.name: entry.value for entry in entries}
        found.setdefault(name.strip("/"), {}).update(values)
    return found


def defaults(package: str) -> dict[str, Any]:
    """Read the flat default values of a node from its package's ``config/PACKAGE.yaml``."""
    return read_file(config_file(package, f"{package}.yaml"))[package]


def config_file(package: str, name: str) -> Path:
    """Find a file of a package's ``config`` folder, which lies beside its modules, installed or not.

    Raises
    ------
    ParameterError
        The package is not there, or has no such file.
    """
    spec = find_spec(package)
    for folder in (spec.submodule_search_locations or []) if spec else []:
        path = Path(folder) / "config" / name
        if path.is_file():
            return path
    raise ParameterError(f"{package}: config/{name} not found (is the workspace built and sourced?)")


def _group_of(field: FieldInfo) -> type[Group] | None:
    kind = field.annotation
    return kind if isinstance(kind, type) and issubclass(kind, Group) else None


def _kind(field: FieldInfo) -> type:
    kind = field.annotation
    if get_origin(kind) is list and get_args(kind) == (float,):
        return list
    if kind in (bool, int, float, str):
        return kind  # type: ignore[return-value]
    raise TypeError(f"a parameter cannot be of type {kind}")


def _convert(info: Info, value: Any) -> Any:
    """Check one value; give it in its exact type, or None when it is not allowed."""
    if info.kind is list:
        try:
            numbers = [_number(info, entry) for entry in value] if not isinstance(value, str) else [None]
        except TypeError:
            return None
        # An empty list has no type that ROS could keep.
        return None if not numbers or any(entry is None for entry in numbers) else numbers
    if info.kind is float:
        return _number(info, value)
    if type(value) is not info.kind:
        return None
    if isinstance(value, int) and info.kind is int and not _within(info, value):
        return None
    if info.choices and value not in info.choices:
        return None
    return value


def _number(info: Info, value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) and _within(info, value) else None


def _within(info: Info, value: float) -> bool:
    return (info.low is None or value >= info.low) and (info.high is None or value <= info.high)


def nearest(name: str, known: Iterable[str]) -> str:
    """Give the end of a message that names the known name most like an unknown one, empty if none is."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean '{close[0]}'?" if close else ""
