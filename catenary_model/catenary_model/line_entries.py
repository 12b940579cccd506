"""What a description of a line may hold: every entry with its unit and range, and what is wrong with one, in words."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.fields import FieldInfo


def _number(description: str, unit: str, low: float, high: float, **default: Any) -> Any:
    """Declare a number from low to high."""
    return Field(description=description, ge=low, le=high, json_schema_extra={"unit": unit}, **default)


class Entry(BaseModel):
    """Base of every mapping in the file: no unknown keys, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    source: str | None = None
    """Document that the values come from, or how they were had."""

    def given(self) -> dict[str, Any]:
        """Return the entries that the file gives and that are not null."""
        return {key: getattr(self, key) for key in self.model_fields_set if getattr(self, key) is not None}


class WireEntry(Entry):
    """A wire."""

    mass_per_length: float = _number("Mass per length rhoA", "kg/m", 0.05, 20.0)
    damping: float = _number("Damping per length beta", "N s/m^2", 0.0, 20.0)
    mass_damping: float = _number("Rayleigh's a, added to damping as a rhoA", "1/s", 0.0, 20.0, default=0.0)
    stiffness_damping: float = _number("Rayleigh's b", "s", 0.0, 0.01, default=0.0)
    bending_stiffness: float = _number("Bending stiffness EI", "N m^2", 1.0, 1e5)
    tension: float = _number("Axial tension T", "N", 1e3, 2e5)
    axial_stiffness: float | None = _number("EA, for temperature with fixed ends", "N", 1e5, 1e9, default=None)


class DropperDefault(Entry):
    """What droppers have in common."""

    stiffness: float | None = _number("Stiffness k_d of a taut dropper", "N/m", 1e3, 1e7, default=None)
    axial_stiffness: float | None = _number("EA of the rope, k_d = EA/l_0", "N", 1e3, 1e8, default=None)
    mass: float | None = _number("Mass of the dropper with its clamps", "kg", 0.0, 50.0, default=None)
    carrier_clamp: float | None = _number("Mass of the upper clamp", "kg", 0.0, 50.0, default=None)
    contact_clamp: float | None = _number("Mass of the lower clamp", "kg", 0.0, 50.0, default=None)
    mass_per_length: float | None = _number("Mass per length of the rope", "kg/m", 0.0, 20.0, default=None)


class DropperEntry(DropperDefault):
    """A dropper."""

    position: float = _number("Distance from the mast at the span's beginning", "m", 0.0, 150.0)
    length: float | None = _number("Unstressed length l_0; left out: computed", "m", 0.01, 10.0, default=None)
    hangs_from: Literal["carrier", "stitch_wire"] | None = None
    sag: float | None = _number("Clamp below the nominal height; left out: pre_sag", "m", -0.5, 0.5, default=None)


class MassEntry(Entry):
    """A point mass."""

    position: float = _number("Distance from the mast at the span's beginning", "m", 0.0, 150.0)
    wire: Literal["carrier", "contact"]
    mass: float = _number("Mass", "kg", 1e-3, 500.0)


class MastEntry(Entry):
    """A mast."""

    stiffness: float | None = _number("Stiffness k_m under the carrier", "N/m", 1e3, 1e8, default=None)
    encumbrance: float | None = _number("Carrier above the nominal contact wire", "m", 0.1, 10.0, default=None)


class StitchEntry(Entry):
    """A stitch wire over a mast."""

    length: float | None = _number("Distance of its clamps", "m", 1.0, 100.0, default=None)
    tension: float | None = _number("Tension S", "N", 100.0, 1e5, default=None)
    mass_per_length: float | None = _number("Mass per length", "kg/m", 0.01, 20.0, default=None)
    bending_stiffness: float | None = _number("Bending stiffness EI", "N m^2", 0.1, 1e5, default=None)
    clamp: float | None = _number("Mass of each of its clamps", "kg", 0.0, 50.0, default=None)


class ArmEntry(Entry):
    """A steady arm."""

    stiffness: float | None = _number("Vertical stiffness on the contact wire", "N/m", 0.0, 1e7, default=None)
    mass: float | None = _number("Mass that moves with the contact wire", "kg", 0.0, 50.0, default=None)


def _position_alone(value: object) -> object:
    """Read a bare number in the list of droppers as a position."""
    return {"position": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


class Common(Entry):
    """What a span has of its own or from the defaults."""

    pre_sag: float | None = _number("Sag of the clamps in mid-span", "m", -0.5, 0.5, default=None)
    pre_sag_from: Literal["mast", "first_dropper"] | None = None
    mast: MastEntry | None = None
    steady_arm: ArmEntry | None = None
    stitch_wire: StitchEntry | None = None


class SpanEntry(Common):
    """A span, or several equal ones."""

    length: float = _number("Distance to the next mast", "m", 5.0, 150.0)
    droppers: list[Annotated[DropperEntry, BeforeValidator(_position_alone)]]
    masses: list[MassEntry] = Field(default=[])
    repeat: int = _number("Number of equal spans in a row", "", 1, 1000, default=1)


class Defaults(Common):
    """What spans and droppers have that do not say otherwise."""

    dropper: DropperDefault | None = None


class TemperatureEntry(Entry):
    """Temperature of the wires."""

    value: float = _number("Temperature of the wires", "degC", -60.0, 150.0)
    reference: float = _number("Temperature of the tensions above", "degC", -60.0, 150.0, default=10.0)
    tensioning: Literal["weights", "fixed"] = "weights"
    efficiency: float = _number("Of the weights' wheels", "", 0.5, 1.0, default=1.0)
    expansion: float = _number("Thermal expansion", "1/K", 1e-6, 1e-4, default=1.7e-5)


class IceEntry(Entry):
    """Ice on the wires."""

    carrier: float = _number("On the carrier and stitch wires", "kg/m", 0.0, 20.0, default=0.0)
    contact: float = _number("On the contact wire", "kg/m", 0.0, 20.0, default=0.0)


class File(Entry):
    """A description as a whole."""

    carrier: WireEntry
    contact: WireEntry
    spans: Annotated[list[SpanEntry], Field(min_length=1)]
    name: str | None = None
    gravity: float = _number("Acceleration of gravity", "m/s^2", 0.0, 20.0, default=9.81)
    defaults: Defaults = Defaults()
    temperature: TemperatureEntry | None = None
    ice: IceEntry | None = None


def contradictions(file: File) -> Iterable[str]:
    """Tell what each entry allows by itself and the others do not."""
    yield from _misplaced(file)
    yield from _incomplete(file)
    droppers = [
        (f"spans[{i}].droppers[{j}]", d) for i, span in enumerate(file.spans) for j, d in enumerate(span.droppers)
    ]
    ropes: list[tuple[str, DropperDefault | None]] = [("defaults.dropper", file.defaults.dropper), *droppers]
    for where, rope in ropes:
        if rope is not None and rope.stiffness is not None and rope.axial_stiffness is not None:
            yield (
                f"{where}.axial_stiffness = {rope.axial_stiffness:g}: allowed without stiffness only "
                f"(stiffness = {rope.stiffness:g} N/m says the same in another way)"
            )
    for where, dropper in droppers:
        if dropper.sag is not None and dropper.length is not None:
            yield (
                f"{where}.sag = {dropper.sag:g}: allowed without length only (length = {dropper.length:g} m decides "
                "by itself where the clamp hangs)"
            )


def _incomplete(file: File) -> Iterable[str]:
    """Tell every stitch wire that lacks something, and every dropper without one."""
    needed = ("length", "tension", "mass_per_length")
    for i, span in enumerate(file.spans):
        stitch = span.stitch_wire if "stitch_wire" in span.model_fields_set else file.defaults.stitch_wire
        if stitch is None:
            continue
        given = (file.defaults.stitch_wire.given() if file.defaults.stitch_wire else {}) | stitch.given()
        for key in needed:
            if key not in given:
                low, high, unit = _range(StitchEntry.model_fields[key])
                yield f"spans[{i}].stitch_wire.{key} is missing; allowed is a number from {low:g} to {high:g} {unit}"


def _misplaced(file: File) -> Iterable[str]:
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
        for j, mass in enumerate(span.masses):
            if not 0.0 < mass.position < span.length:
                yield (
                    f"spans[{i}].masses[{j}].position = {mass.position:g}: allowed is more than 0 m (the mast) and "
                    f"less than {span.length:g} m (length of the span)"
                )


def problem(item: Any) -> str:
    """Say one pydantic error with the path of its entry and what is allowed."""
    model: type[Entry] | None = File
    where, field, keys = "", None, names(File)
    for part in item["loc"]:
        if isinstance(part, int):
            where += f"[{part}]"
            continue
        where += f".{part}" if where else str(part)
        if model is not None:
            keys, field = names(model), model.model_fields.get(str(part))
            model = None if field is None else _model_of(field)
    if field is None:
        near = difflib.get_close_matches(str(item["loc"][-1]), keys, 1)
        return f"{where}: unknown entry; {f'did you mean {near[0]}? ' if near else ''}allowed are {', '.join(keys)}"
    is_list = get_origin(field.annotation) is list and isinstance(item["loc"][-1], str)
    value = " is missing;" if item["type"] == "missing" else ":" if is_list else f" = {item['input']!r}:"
    return f"{where}{value} allowed is {_allowed(field, is_list)}"


def names(model: type[Entry]) -> list[str]:
    """Entries of a mapping in the order of their declaration, `source` last."""
    return sorted(model.model_fields, key=lambda key: key == "source")


def _model_of(field: FieldInfo) -> type[Entry] | None:
    """Return the model behind a field: alone, optional, or in a list."""
    pending: list[Any] = [field.annotation]
    while pending:
        kind = pending.pop()
        if isinstance(kind, type) and issubclass(kind, Entry):
            return kind
        pending += get_args(kind)
    return None


def _allowed(field: FieldInfo, is_list: bool) -> str:
    """Say in words what a field may be."""
    model = _model_of(field)
    if model is not None:
        keys = ", ".join(names(model))
        each = f"a position (m) or a mapping of {keys}" if model is DropperEntry else f"a mapping of {keys}"
        least = " of at least one" if model is SpanEntry else ""
        return f"a list{least}, each entry {each}" if is_list else each
    if not isinstance(field.json_schema_extra, dict):
        kinds = (field.annotation, *get_args(field.annotation))
        choices = [c for kind in kinds if get_origin(kind) is Literal for c in get_args(kind)]
        return f"one of {', '.join(choices)}" if choices else "a text"
    low, high, unit = _range(field)
    kind = "an integer" if field.annotation is int else "a number"
    return f"{kind} from {low:g} to {high:g} {unit}".rstrip()


def _range(field: FieldInfo) -> tuple[float, float, str]:
    """Return the limits of a number and its unit."""
    low, high = (next(getattr(m, key) for m in field.metadata if hasattr(m, key)) for key in ("ge", "le"))
    unit = field.json_schema_extra["unit"] if isinstance(field.json_schema_extra, dict) else ""
    return low, high, str(unit)
