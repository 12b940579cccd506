"""The storage files behind a path: a bag's folder, a ride's, or a bare file, with or without metadata.yaml."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from energy_monitor.bag_channel import BagError, Source
from energy_monitor.bag_compression import codec_of, decompress, foreign, is_compressed, plain_name
from energy_monitor.bag_mcap import MAGIC
from phil_base.yaml_file import read_yaml

_ENDINGS = {".mcap": "mcap", ".db3": "sqlite3"}
_ARCHIVES = (".zip", ".7z", ".rar", ".tar", ".tgz", ".bz2", ".xz", ".bag")
METADATA = "metadata.yaml"


def open_source(path: Path) -> Source:
    """Find the storage files behind a path: a bag directory, a directory that holds one, or a bare file.

    Raises BagError if there is none, or several, and OSError if the path cannot be looked at.
    """
    if path.name in ("", ".."):  # `.` has neither a name nor a parent
        path = path.resolve()
    if not path.exists():
        raise BagError(f"{path}: no such file or directory")
    if path.is_file():
        return Source(path, (path,), storage_of(path))
    if not path.is_dir():
        raise BagError(f"{path}: neither a folder nor a regular file")
    if files := _files_in(path):
        return _source(path, files)
    bags = list(_bags_below(path))
    if len(bags) == 1:
        return _source(bags[0], _files_in(bags[0]))
    if bags:
        names = ", ".join(str(bag.relative_to(path)) for bag in bags)
        raise BagError(f"{path}: holds several bags ({names}), name one of them")
    packed = [child.name for child in sorted(path.iterdir()) if child.name.lower().endswith(_ARCHIVES)]
    hint = f"; {packed[0]} has to be unpacked or converted first" if packed else ""
    raise BagError(f"{path}: no bag here (neither *.mcap nor *.db3{hint})")


def storage_of(file: Path) -> str:
    """Tell by its first bytes, else by its name, whether a file is MCAP or sqlite3; raises BagError if neither."""
    with file.open("rb") as stream:
        head = stream.read(1 << 16)
    if (codec := codec_of(head[:4])) is not None:
        head = decompress(codec, head).data
    if head.startswith(MAGIC):
        return "mcap"
    if head.startswith(b"SQLite format 3\0"):
        return "sqlite3"
    if (what := foreign(head[:8])) is not None:
        raise BagError(f"{file}: {what}")
    found = _ENDINGS.get(Path(plain_name(file)).suffix)
    if found is None:
        raise BagError(f"{file}: not a bag (neither MCAP nor sqlite3)")
    return found


def natural(file: Path) -> tuple[tuple[int, int, str], ...]:
    """Key of an order of names in which numbers count as numbers: bag_2 before bag_10."""
    parts = re.findall(r"[0-9]+|[^0-9]+", file.name)
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)


def base_name(path: Path) -> tuple[Path, str]:
    """Give the folder that a bag lies in, and the bag's name without the endings of a storage file."""
    name = path.name
    if not path.is_dir():
        name = name[: len(Path(plain_name(path)).stem)]
    return path.parent, name or "bag"


def _bags_below(path: Path) -> Iterable[Path]:
    """Yield the folders with bags one level down, and those in a ride's folder (`bag`) there."""
    for child in sorted(path.iterdir(), key=natural):
        if not child.is_dir():
            continue
        if _files_in(child):
            yield child
        elif (child / "bag").is_dir() and _files_in(child / "bag"):
            yield child / "bag"


def _files_in(directory: Path) -> tuple[Path, ...]:
    """List storage files; of one that was decompressed beside its compressed form, the plain one."""
    found = sorted((file for file in directory.iterdir() if file.is_file() and _known(file)), key=natural)
    names = {file.name.lower() for file in found}
    return tuple(file for file in found if not is_compressed(file) or plain_name(file) not in names)


def _known(file: Path) -> bool:
    return not file.name.startswith(".") and Path(plain_name(file)).suffix in _ENDINGS


def _source(directory: Path, files: tuple[Path, ...]) -> Source:
    """Order split files as metadata.yaml lists them, then those that it does not list; without it by their numbers."""
    filled = tuple(file for file in files if file.stat().st_size)
    source = Source(directory, filled or files, storage_of((filled or files)[0]))
    for file in files:
        if filled and file not in filled:
            source.note(f"{file.name} is empty: nothing was recorded in it.")
            source.complete = False
    listed = [(name, _present(directory, name, source.files)) for name in _listed(directory / METADATA)]
    present = list(dict.fromkeys(file for _, file in listed if file is not None))
    unlisted = tuple(file for file in source.files if file not in present)
    absent = [name for name, file in listed if file is None and _present(directory, name, files) is None]
    source.listed = bool(present)
    source.files = (*present, *unlisted)
    source.unlisted = frozenset(unlisted if present else ())
    if len(absent) > len(unlisted):  # else they were renamed
        source.complete = False
        source.note(f"Files that {METADATA} names are not there: {', '.join(absent)}.")
    return source


def _listed(metadata: Path) -> list[str]:
    """Give the names in metadata.yaml; none if there is no such file or it makes no sense: the files tell as much."""
    try:
        information: Any = read_yaml(metadata)["rosbag2_bagfile_information"]
        names = information["relative_file_paths"]
        return [str(name) for name in ([names] if isinstance(names, str) else names)]
    except (ValueError, KeyError, TypeError):
        return []


def _present(directory: Path, name: str, files: Iterable[Path]) -> Path | None:
    """Find the file that metadata.yaml means: in the folder, packed or unpacked since, or where the entry says."""
    path = Path(name.replace("\\", "/"))
    wanted = plain_name(path)
    for file in files:
        if file.name == path.name or plain_name(file) == wanted:
            return file
    try:
        there = directory / path
        return there if path.name != name and _known(there) and there.is_file() else None
    except (OSError, ValueError):
        return None
