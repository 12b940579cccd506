"""ROS parameter files, read as ROS reads them: rcl_yaml_param_parser and rclpy of Jazzy, without either.

A parameter file is a format of ROS, and its reader is not YAML's: it follows the events of libyaml by a small state
machine, merges what stands twice, and takes scalars by strtoll and strtod (010 is eight, yes is true, a quoted number
a text). Which of several entries holds, whose wildcards reach a node, and what is refused is as there; a test hands
the same files to both.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from phil_base.ros_scalar import ros_value
from phil_base.yaml_file import TAG, SafeLoader, YamlError, plain_value

KEY = "ros__parameters"
SCALARS, LISTS = ("bool", "int", "float", "str"), ("bools", "ints", "floats", "strs")
_TOKEN = re.compile(r"^[A-Za-z_][A-Za-z0-9_]*$")
LONGEST_NAME, LONGEST_NAMESPACE = 255, 245


@dataclass
class Entry:
    """A parameter as rcl keeps it: one place for each type, the last value and line of each."""

    name: str
    values: dict[str, Any] = field(default_factory=dict)
    given: dict[str, tuple[str, str]] = field(default_factory=dict)
    """The text of each value, and where it stands, the last one last; empty for a list or what is quoted."""

    @property
    def kind(self) -> str | None:
        """The type that ROS takes where several were given, None without a value."""
        return next((kind for kind in (*SCALARS, *LISTS) if kind in self.values), None)

    @property
    def value(self) -> Any:
        """The value that ROS takes, None without one (an empty list has no type that ROS could keep)."""
        return self.values[self.kind] if self.kind else None


@dataclass(frozen=True)
class ParameterFile:
    """The nodes of a file, or of several, in the order of their first mention, each with its parameters in theirs."""

    nodes: tuple[tuple[str, tuple[Entry, ...]], ...]

    def entries(self, node: str) -> dict[str, Entry]:
        """Give the entries that reach the node of that fully qualified name; of equal ones the last in the file."""
        found: dict[str, Entry] = {}
        for name, entries in self.nodes:
            if reaches("/" + name.lstrip("/"), node):
                found.update({entry.name: entry for entry in entries})
        return found

    def values(self, node: str) -> dict[str, Any]:
        """Give the flat dotted values that reach the node of that fully qualified name."""
        return {name: entry.value for name, entry in self.entries(node).items()}

    def readings(self) -> Iterator[str]:
        """Say which numbers mean something else to ROS than to YAML 1.2, and which last word ROS does not take."""
        for node, entries in self.nodes:
            for entry in entries:
                text, place = entry.given.get(entry.kind or "", ("", ""))
                last = next(reversed(entry.given), entry.kind)
                if last is not None and last != entry.kind:
                    yield (
                        f"{entry.given[last][1]}: {node}.{entry.name}: {entry.values.get(last, [])!r} is not taken, "
                        f"but {entry.value!r} of another type, given before, as ROS does"
                    )
                here, there = entry.value, plain_value(text)
                numbers = [isinstance(value, int | float) and not isinstance(value, bool) for value in (here, there)]
                if text and any(numbers) and here != there and not (isinstance(here, float) and math.isnan(here)):
                    taken = f"as the text '{here}'" if isinstance(here, str) else f"as {here:g}"
                    yield f"{place}: {node}.{entry.name}: {text} is read {taken}, as ROS does"


def reaches(pattern: str, node: str) -> bool:
    """Tell whether a name of a parameter file, with * and **, is for a node of that fully qualified name.

    >>> reaches("/**/rig", "/rig"), reaches("/*/rig", "/rig"), reaches("/*", "/rig"), reaches("/ns/rig", "/rig")
    (True, False, True, False)
    """
    return re.fullmatch(pattern.replace("/*", r"(/\w+)"), node, re.ASCII) is not None


def is_rclpys(name: str) -> bool:
    """Tell whether rclpy itself declares a parameter of that name on every node."""
    return name in ("use_sim_time", "start_type_description_service") or name.startswith("qos_overrides")


def read_parameter_file(path: Path | str, *more: Path | str) -> ParameterFile:
    """Read a ROS parameter file, or several, one after the other, as those that ROS is given together.

    Raises
    ------
    YamlError
        A file cannot be read, or ROS would refuse it; one line that names file and line.
    """
    nodes: dict[str, list[Entry]] = {}
    for each in (path, *more):
        _read_into(nodes, each)
    return ParameterFile(tuple((name, tuple(entries)) for name, entries in nodes.items()))


def _read_into(nodes: dict[str, list[Entry]], path: Path | str) -> None:
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise YamlError(f"{path}: cannot be read: {error.strerror}") from None
    reader = _Reader(nodes, str(path))
    try:
        for event in yaml.parse(content, Loader=SafeLoader):
            reader.take(event)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise YamlError(f"{path}: is no YAML: {where}{' '.join(str(error.problem or error.context).split())}") from None
    except yaml.reader.ReaderError as error:
        line = content[: error.position].count(b"\n") + 1
        raise YamlError(f"{path}: is no YAML: line {line}: a byte or character that is no text in UTF-8") from None
    except _RefusedError as error:
        raise YamlError(f"{path}: line {reader.line}: {error}") from None


class _RefusedError(ValueError):
    """ROS refuses the file here."""


class _Reader:
    """The state machine of rcl_yaml_param_parser over the events of a file."""

    def __init__(self, nodes: dict[str, list[Entry]], path: str) -> None:
        self.nodes = nodes
        self.line = 1
        self._path = path
        self._entries: list[Entry] | None = None  # of the node that is read
        self._at = 0  # entry that is read
        self._in_parameters = False
        self._depth = 0
        self._key_next, self._new_map = True, False
        self._list, self._list_kind = False, ""
        # rcl counts the names, and cuts the joined name at its last separator.
        self._node = ""
        self._node_depth = 0
        self._group: str | None = None
        self._group_depth = 0

    def take(self, event: yaml.Event) -> None:
        """Take the next event; raises _RefusedError."""
        if event.start_mark is not None:
            self.line = event.start_mark.line + 1
        if isinstance(event, yaml.DocumentStartEvent) and event.version not in (None, (1, 1)):
            raise _RefusedError("a %YAML directive other than 1.1, which ROS refuses: leave it out")
        if isinstance(event, yaml.ScalarEvent):
            text = event.value.split("\0")[0]
            if self._key_next:
                self._take_key(text, empty=not event.value)
                self._key_next = False
            else:
                self._take_value(event, text)
                self._key_next = not self._list
        elif isinstance(event, yaml.SequenceStartEvent):
            self._open_list()
        elif isinstance(event, yaml.SequenceEndEvent):
            self._list, self._key_next = False, True
        elif isinstance(event, yaml.MappingStartEvent):
            self._depth += 1
            self._key_next = True
            self._new_map = not (self._in_parameters and self._depth - (self._node_depth + 1) == 2)
        elif isinstance(event, yaml.MappingEndEvent):
            self._close_map()
        elif isinstance(event, yaml.AliasEvent):
            raise _RefusedError("ROS knows no aliases (*name): write the value out")

    def _open_list(self) -> None:
        if self._key_next:
            raise _RefusedError("a list cannot stand here: a name is expected (ROS knows no lists of lists)")
        if not self._in_parameters:
            raise _RefusedError(f"a list cannot stand before '{KEY}'")
        self._list, self._list_kind = True, ""

    def _close_map(self) -> None:
        if self._in_parameters:
            if self._group_depth > 0:
                self._group = _cut(self._group or "", ".") if self._group_depth > 1 else None
                self._group_depth -= 1
            else:
                self._in_parameters = False
        elif self._depth == self._node_depth + 1:
            self._leave_node()
        self._depth -= 1

    def _leave_node(self) -> None:
        if self._node_depth > 0:
            self._node = _cut(self._node, "/") if self._node_depth > 1 else ""
            self._node_depth -= 1

    def _take_key(self, text: str, empty: bool) -> None:
        if empty:
            raise _RefusedError("a name is empty")
        if self._in_parameters:
            self._take_parameter(text)
        elif text.startswith(KEY):
            if self._node_depth == 0:
                raise _RefusedError(f"'{KEY}' without the name of a node before it")
            _check_name(self._node)
            self._entries = self.nodes.setdefault(self._node, [])
            self._leave_node()
            self._in_parameters = True
        else:
            if not text:
                raise _RefusedError("a name is empty")
            joined = self._node + ("" if self._node.endswith("/") else "/") + text
            self._node = joined if self._node_depth > 0 else text
            self._node_depth += 1

    def _take_parameter(self, text: str) -> None:
        assert self._entries is not None
        if self._new_map:
            # The key before was no parameter: it is the group of those that follow.
            if self._at >= len(self._entries):
                raise _RefusedError("a group of parameters without a name")
            self._group = self._entries[self._at].name
            self._group_depth += 1
            self._new_map = False
        if self._group is None:
            self._at = self._find(text)
        else:
            self._at = self._find(self._group)
            self._entries[self._at].name = f"{self._group}.{text}"

    def _find(self, name: str) -> int:
        assert self._entries is not None
        for i, entry in enumerate(self._entries):
            if entry.name == name:
                return i
        self._entries.append(Entry(name))
        return len(self._entries) - 1

    def _take_value(self, event: yaml.ScalarEvent, text: str) -> None:
        if not self._in_parameters or not self._entries:
            raise _RefusedError(self._misplaced(text))
        quoted = event.style in ("'", '"')
        entry = self._entries[self._at]
        if not quoted and not event.value:
            raise _RefusedError(f"'{entry.name}' has no value")
        value = text if quoted or event.tag == f"{TAG}str" else ros_value(text)
        kind = type(value).__name__
        if not self._list:
            entry.values[kind] = value
            self._note(entry, kind, "" if quoted or event.tag == f"{TAG}str" else text)
            return
        if not self._list_kind:
            self._list_kind = kind
            entry.values[f"{kind}s"] = []
            self._note(entry, f"{kind}s", "")
        elif kind != self._list_kind:
            raise _RefusedError(
                f"'{entry.name}' mixes types in a list, which ROS refuses: {text} is {kind}, "
                f"those before it are {self._list_kind}"
            )
        entry.values.setdefault(f"{kind}s", []).append(value)

    def _note(self, entry: Entry, kind: str, text: str) -> None:
        """Remember text and place of a value, behind those of other types."""
        entry.given.pop(kind, None)
        entry.given[kind] = (text, f"{self._path}, line {self.line}")

    def _misplaced(self, text: str) -> str:
        """Say why a value cannot stand where it does."""
        if self._in_parameters and not text:
            return f"'{KEY}' without any parameter: leave its node out, or write '{KEY}: {{}}'"
        meant = difflib.get_close_matches(KEY, [part for part in self._node.split("/") if part != KEY], 1, 0.8)
        hint = f"; did you mean it by '{meant[0]}'?" if meant else ""
        return f"'{text}' cannot stand before '{KEY}' and the name of a parameter{hint}"


def _cut(name: str, separator: str) -> str:
    """Take the last part off a joined name."""
    return name.rpartition(separator)[0] if separator in name else name


def _check_name(name: str) -> None:
    """Refuse a name of a node that ROS refuses."""
    if name in ("/**", "/*"):
        return
    space, slash, node = name.rpartition("/")
    if slash:
        parts = space.removeprefix("/").split("/") if space.removeprefix("/") else []
        if name.startswith("//") or (space and not all(parts)):
            raise _RefusedError(f"'{name}' contains repeated slashes")
        for part in parts:
            if part not in ("*", "**") and not (_TOKEN.match(part) and len(part) < LONGEST_NAMESPACE):
                raise _RefusedError(f"'{name}' is no namespace and name of a node: letters, digits and _ only")
    if node not in ("*", "**") and not (_TOKEN.match(node) and len(node) <= LONGEST_NAME):
        raise _RefusedError(f"'{name}' is no name of a node: letters, digits and _ only, or the wildcards /*, /**")
