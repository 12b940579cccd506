"""Message definitions for bags: the original text with its comments (units!), and the type's hash.

The text comes from the ``.msg`` files that every interface package installs, so that a bag explains itself on a machine
that never had the packages. Types without such a file are asked of the table that rosbags brings along. A text that
rosbags' AnyReader cannot read, or that does not belong to the hash beside it, makes it refuse the whole bag: such a
text is not given.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

SEPARATOR = "=" * 80
UNKNOWN_DIGEST = "RIHS01_" + "0" * 64

_BUILT_IN = re.compile(r"bool|byte|char|w?string|float(32|64)|u?int(8|16|32|64)")
_FIELD = re.compile(r"^\s*([A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]")


_DIGEST = re.compile(r"RIHS01_(?!0{64})[0-9a-f]{64}")
_CHAR = re.compile(r"^(\s*)char(?=[\s\[])", re.MULTILINE)


@dataclass(frozen=True)
class Definition:
    """Text in the form of a bag (main type, then its parts behind separators) and hash.

    No text where none is known that fits; `problem` then says why.
    """

    text: str
    digest: str
    problem: str = ""


@lru_cache(maxsize=256)
def definition_of(kind: str, digest: str = "") -> Definition:
    """Find the definition of a type such as ``std_msgs/msg/Header`` whose hash is ``digest`` (empty: not known)."""
    found = _definition(kind, digest)
    if not found.text:
        return Definition("", found.digest, f"no definition of {kind} is installed")
    known = digest if _DIGEST.fullmatch(digest) else found.digest
    try:
        hashed = _hash(kind, found.text)
    except Exception as error:  # a parser's own errors, and its assertions
        reason = (str(error) or type(error).__name__).splitlines()[0]
        return Definition("", known, f"the definition of {kind} cannot be read by rosbags ({reason})")
    if _DIGEST.fullmatch(known) and hashed != known:
        return Definition("", known, f"the definition of {kind} that is installed is not the one of its publisher")
    return Definition(found.text, hashed)


def _hash(kind: str, text: str) -> str:
    """Hash a definition (REP 2016) as a reader of the bag will."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, kind))
    return store.hash_rihs01(kind)


def _definition(kind: str, digest: str) -> Definition:
    main = _message_file(kind)
    if main is None:
        return _from_table(kind, digest)
    parts = [_read(main)]
    seen = {kind}
    waiting = list(references(parts[0], kind.split("/")[0]))
    while waiting:
        part = waiting.pop(0)
        if part in seen:
            continue
        seen.add(part)
        file = _message_file(part)
        if file is None:
            return _from_table(kind, digest)
        text = _read(file)
        package, _, name = part.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{name}\n{text}")
        waiting.extend(references(text, package))
    text = "\n".join(part.rstrip("\n") for part in parts) + "\n"
    return Definition(text, _installed_digest(main) or digest or UNKNOWN_DIGEST)


def references(text: str, package: str) -> Iterator[str]:
    """Give the message types that a ``.msg`` text of ``package`` uses, as ``pkg/msg/Name``, in order."""
    for line in text.splitlines():
        found = _FIELD.match(line.split("#", 1)[0])
        if found is None or _BUILT_IN.fullmatch(found[1]):
            continue
        path = found[1].split("/")
        name = path[-1]
        yield f"{path[0] if len(path) > 1 else 'std_msgs' if name == 'Header' else package}/msg/{name}"


def _read(file: Path) -> str:
    """Read a ``.msg`` file; a ``char`` becomes what ROS 2 makes of it, the uint8 that its hash stands for."""
    return _CHAR.sub(r"\1uint8", file.read_text(encoding="utf-8"))


def _message_file(kind: str) -> Path | None:
    package, _, rest = kind.partition("/")
    # ROS from wheels lives in the environment's own prefix, sourced or not.
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)), sys.prefix]
    for prefix in prefixes:
        file = Path(prefix) / "share" / package / f"{rest}.msg"
        if file.is_file():
            return file
    return None


def _installed_digest(file: Path) -> str:
    """Read the type's hash from the description that is installed beside the ``.msg`` file."""
    description = file.with_suffix(".json")
    try:
        tree = json.loads(description.read_text(encoding="utf-8"))
        name = tree["type_description_msg"]["type_description"]["type_name"]
        return str(next(entry["hash_string"] for entry in tree["type_hashes"] if entry["type_name"] == name))
    except (OSError, ValueError, KeyError, StopIteration):
        return ""


def _from_table(kind: str, digest: str) -> Definition:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    if kind not in store.fielddefs:
        return Definition("", digest or UNKNOWN_DIGEST)
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return Definition(text, store.hash_rihs01(kind))
