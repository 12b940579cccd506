"""YAML files of our own formats: one reader, in which a number means the same in every file, and one writer.

Lines, tables of limits, pantographs and values of the command line are read by the core schema of YAML 1.2: 010 is ten,
0o10 eight, 1e-3 and .5 are numbers; 1:30, 1_000, yes and off are texts. A key that stands twice is an error. (Parameter
files are not ours: ROS says what they mean, see `phil_base.parameter_file`.)
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, ClassVar

import yaml

try:
    from yaml import CSafeLoader as SafeLoader
except ImportError:  # PyYAML without libyaml
    from yaml import SafeLoader  # type: ignore[assignment]

from phil_base.clear_words import ClearError
from phil_base.ros_scalar import ros_value

__all__ = ["TAG", "SafeLoader", "YamlError", "dump_yaml", "number_text", "parse_yaml", "plain_value", "read_yaml"]

TAG = "tag:yaml.org,2002:"
INTEGER_LIMIT = 2**63
MOST_ENTRIES = 1_000_000
"""Entries that a file may have with every alias written out: a few lines of them can stand for more than there is room
for."""

_NULL = re.compile(r"^(~|null|Null|NULL|)$")
_BOOL = re.compile(r"^(true|True|TRUE|false|False|FALSE)$")
_INT = re.compile(r"^([-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)$")
_FLOAT = re.compile(r"^([-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$")


class YamlError(ClearError):
    """A text is no YAML that can be used; the message is one line: source, line, reason."""


def read_yaml(path: Path | str) -> Any:
    """Read a YAML file of one document.

    Raises
    ------
    YamlError
        The file cannot be read, is not UTF-8, is no YAML, or has a key twice; file and line are named.
    """
    try:
        return parse_yaml(Path(path).read_bytes(), str(path))
    except OSError as error:
        raise YamlError(f"{path}: cannot be read: {error.strerror}") from None


def parse_yaml(text: str | bytes, source: str = "") -> Any:
    """Parse a YAML text of one document; ``source`` leads the message of an error. Raises YamlError.

    >>> parse_yaml("[010, 0o10, 1e-3, .5, 1:30, 1_000, yes]")
    [10, 8, 0.001, 0.5, '1:30', '1_000', 'yes']
    """
    named = f"{source}: " if source else ""
    lead = f"{named}is no YAML: "
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = error.object[: error.start].count(b"\n") + 1
            raise YamlError(f"{lead}line {line}: byte {error.object[error.start]:#04x} is not UTF-8 text") from None
    loader: Any = None
    try:
        loader = _Loader(text.removeprefix("\ufeff"))
        node = loader.get_single_node()
        if node is None:
            return None
        _check(node, {}, {})
        return loader.construct_document(node)
    except yaml.constructor.ConstructorError as error:
        raise YamlError(named + _said(error, text)) from None
    except yaml.MarkedYAMLError as error:
        raise YamlError(lead + _said(error, text)) from None
    except (yaml.YAMLError, UnicodeEncodeError) as error:
        raise YamlError(lead + " ".join(str(error).split())) from None
    except RecursionError:
        raise YamlError(f"{lead}nested too deeply") from None
    finally:
        if loader is not None:
            loader.dispose()


def plain_value(text: str) -> Any:
    """Return what an unquoted scalar means here: None, bool, int, float, or the text itself.

    >>> plain_value("010"), plain_value("1e3"), plain_value("0b1")
    (10, 1000.0, '0b1')
    """
    if _NULL.match(text):
        return None
    if _BOOL.match(text):
        return text[0] in "tT"
    if _INT.match(text):
        return _int(text)
    return _float(text) if _FLOAT.match(text) else text


def dump_yaml(tree: Any) -> str:
    """Write a tree of mappings, lists and scalars so that every reader takes each scalar for what it is.

    Numbers have a point and are numbers in YAML 1.1, in 1.2 and for ROS (1.0e-06); texts that one of them would take
    for something else are quoted.
    """
    return yaml.dump(tree, Dumper=_Dumper, sort_keys=False, width=10**6)


def number_text(value: float) -> str:
    """Write a floating-point number without loss so that every reader takes it for one.

    >>> number_text(1e-5), number_text(1e16), number_text(3)
    ('1.0e-05', '1.0e+16', '3.0')
    """
    text = repr(float(value))
    if "inf" in text or "nan" in text:
        return text.replace("inf", ".inf").replace("nan", ".nan")
    # YAML 1.1 wants a point and the exponent's sign, which Python always writes.
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _int(text: str) -> int | float:
    # As in ROS, what does not fit into 64 bits is a floating-point number.
    digits = text.lstrip("+-")
    base = {"0o": 8, "0x": 16}.get(digits[:2], 10)
    if len(digits) > 4000:
        return float(text) if base == 10 else float("inf")
    value = int(text, base)
    return value if -INTEGER_LIMIT <= value < INTEGER_LIMIT else _float(str(value))


def _float(text: str) -> float:
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


def _check(node: yaml.Node, above: dict[int, yaml.Node], done: dict[int, int]) -> int:
    """Refuse keys that stand twice, entries that contain themselves and aliases that stand for too much; count entries.

    Takes every key as the text that it is. ``done`` holds the counts of lists and mappings that were looked at.
    """
    if id(node) in above:
        raise yaml.constructor.ConstructorError(None, None, "an entry refers to itself", node.start_mark)
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) in done:
        return done[id(node)]
    count = 1
    inside = {**above, id(node): node}
    if isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.constructor.ConstructorError(None, None, "a key has to be a text", key.start_mark)
            if key.value in seen:
                twice = f"'{key.value}' is given twice, first in line {seen[key.value]}"
                raise yaml.constructor.ConstructorError(None, None, twice, key.start_mark)
            seen[key.value] = key.start_mark.line + 1
            if key.tag != f"{TAG}merge":
                key.tag = f"{TAG}str"
            count += _check(value, inside, done)
    else:
        for value in node.value:
            count += _check(value, inside, done)
    if count > MOST_ENTRIES:
        reason = f"more than {MOST_ENTRIES} entries, with every alias (*name) written out"
        raise yaml.constructor.ConstructorError(None, None, reason, node.start_mark)
    done[id(node)] = count
    return count


def _said(error: yaml.MarkedYAMLError, text: str) -> str:
    """Say an error in one line that begins with the number of the line."""
    mark = error.problem_mark or error.context_mark
    reason = " ".join(str(error.problem or error.context).split())
    if mark is None:
        return reason
    lines = text.splitlines()
    at = min(mark.line, max(len(lines) - 1, 0))
    if lines and "\t" in lines[at][: len(lines[at]) - len(lines[at].lstrip())]:
        reason += " (a tab: indent by spaces)"
    return f"line {at + 1}: {reason}"


class _Loader(SafeLoader):
    """The core schema of YAML 1.2, with merge keys (<<)."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012 - PyYAML's own way
    yaml_constructors: ClassVar[dict[Any, Any]] = {}

    def scalar(self, node: yaml.ScalarNode) -> Any:
        """Construct a number, a boolean or null, also where a tag asks for it."""
        kind = node.tag.removeprefix(TAG)
        value = plain_value(str(node.value))
        if kind == "float" and type(value) is int:
            value = float(value)
        if {"null": type(None), "bool": bool, "int": int, "float": float}[kind] is not type(value) and not (
            kind == "int" and isinstance(value, float)
        ):
            raise yaml.constructor.ConstructorError(None, None, f"'{node.value}' is no {kind}", node.start_mark)
        return value


for _kind, _pattern in (("null", _NULL), ("bool", _BOOL), ("int", _INT), ("float", _FLOAT)):
    _Loader.add_implicit_resolver(TAG + _kind, _pattern, None)
    _Loader.add_constructor(TAG + _kind, _Loader.scalar)
_Loader.add_implicit_resolver(f"{TAG}merge", re.compile("^<<$"), None)
for _kind, _method in (("str", "construct_yaml_str"), ("seq", "construct_yaml_seq"), ("map", "construct_yaml_map")):
    _Loader.add_constructor(TAG + _kind, getattr(SafeLoader, _method))
_Loader.yaml_constructors[None] = SafeLoader.construct_undefined


class _Dumper(yaml.SafeDumper):
    """Floating-point numbers with a point, no anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write what occurs twice twice: ROS knows no aliases."""
        return True


def _write_float(dumper: yaml.SafeDumper, value: float) -> yaml.Node:
    return dumper.represent_scalar(f"{TAG}float", number_text(value))


def _write_text(dumper: yaml.SafeDumper, value: str) -> yaml.Node:
    plain = isinstance(plain_value(value), str) and isinstance(ros_value(value), str)
    return dumper.represent_scalar(f"{TAG}str", value, style=None if plain else '"')


_Dumper.add_representer(float, _write_float)
_Dumper.add_representer(str, _write_text)
