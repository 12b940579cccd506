"""Compiled kernels that are kept between runs, and never stale: ``njit`` in the place of numba's own.

numba keeps a kernel by a hash of the file in which it stands, so that it does not notice a changed callee or constant
of another file, trusts whatever the file on disk holds, and lets two processes that compile two signatures of one
kernel at once mix them up. Here a kernel is kept

- in a folder whose name is a digest of all sources of its package and of the packages that its module uses, of the
  versions of numba, LLVM, numpy and Python and of numba's settings: with any change the kernels are compiled anew, and
  two copies of the same sources (installed or not) share theirs;
- in a file for each signature and processor, whole or absent, with a checksum in front: one that is cut off, damaged or
  unreadable is removed and made again.

The folders lie in $NUMBA_CACHE_DIR, else in $PHIL_CACHE/kernels, else in $XDG_CACHE_HOME/phil-catenary/kernels or
~/.cache/phil-catenary/kernels, else, where that cannot be written, in the folder for temporary files. Nothing of this
needs ROS.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite  # type: ignore[import-untyped]
import numba
import numpy as np
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps
from numba.extending import is_jitted

from phil_base import cache as places
from phil_base.atomic import whole

KEPT = 12
"""Folders of a package that are kept: so many states of its sources, the last ones used."""
IN_USE = 3600.0
"""Time in s since its last use in which no folder is removed."""
CHECKSUM = 32
"""Bytes of the checksum in front of a kernel."""

_packages: set[str] = set()
"""Top-level packages that have kernels."""
_seen: dict[tuple[Path, ...], tuple[str, dict[Path, tuple[int, int]]]] = {}
"""Sources to their digest, and to each file's time and size when it was made."""


def njit(function: Callable[..., Any] | None = None, *, cache: bool = False, **options: Any) -> Any:
    """Compile a function as `numba.njit` does; with `cache` keep it as this module describes.

    Args:
        function: that is compiled; None for use as a decorator with options.
        cache: keep the result between runs.
        options: of `numba.njit`.
    """
    if function is None:
        return functools.partial(njit, cache=cache, **options)
    dispatcher = numba.njit(**options)(function)
    if cache and hasattr(dispatcher, "enable_caching"):  # else numba is switched off
        _packages.add(_root(function.__module__))
        dispatcher._cache = KernelCache(function)
    return dispatcher


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The results of one kernel on disk, one file each."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = repr(function)
        self._py_func = function
        self._impl = _Results(function)
        self._sources = _sources_of(function)
        self._digest = _digest(self._sources, Path(function.__code__.co_filename))
        self._folder = _place() / f"{_root(function.__module__)}-{self._digest}"
        code = function.__code__
        self._stem = f"{function.__module__}.{function.__qualname__}-{code.co_firstlineno}".replace("<locals>", "")
        self._cache_path = str(self._folder)
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Give the kernel for a signature, None if it has to be compiled; what cannot be used is removed."""
        target_context.refresh()
        if not self._enabled:
            return None
        key = self._index_key(sig, target_context.codegen())
        path = self._path(key)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError:
            _remove(path)
            return None
        _used(self._folder)
        try:
            kept_for, result = _unpack(content)
            return self._impl.rebuild(target_context, result) if kept_for == key else None
        except Exception:  # whatever it is: the kernel is compiled again
            _remove(path)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a kernel; where that is not possible say so once."""
        if not self._enabled or not self._impl.check_cachable(data):
            return
        if _digest_now(self._sources) != self._digest:
            return  # a source was changed after it was read: this kernel belongs to neither state
        key = self._index_key(sig, data.codegen)
        content = _pack(key, self._impl.reduce(data))
        try:
            if not self._folder.is_dir():
                self._folder.mkdir(parents=True, exist_ok=True)
                _prune(self._folder)
            _write(self._path(key), content)
        except OSError as error:
            _complain(self._folder.parent, error.strerror or str(error))

    def flush(self) -> None:
        """Remove all results of this kernel."""
        for path in self._folder.glob(f"{self._stem}.*.nbc"):
            _remove(path)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        # numba's own key of a function that was made in another one has a random number for each kernel that it calls.
        return sig, codegen.magic_tuple(), hashlib.sha256(repr(_identity(self._py_func)).encode()).hexdigest()

    def _path(self, key: Any) -> Path:
        # Addresses in the name of a type say nothing; what the file is for stands in it.
        name = re.sub("0x[0-9a-f]+", "", str(key))
        return self._folder / f"{self._stem}.{hashlib.sha256(name.encode()).hexdigest()[:16]}.nbc"


class _Results(CompileResultCacheImpl):  # type: ignore[misc]
    """How numba turns a result into bytes and back, without its search for a place."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = SimpleNamespace(_py_file=function.__code__.co_filename)


def _pack(key: Any, result: Any) -> bytes:
    content: bytes = dumps((key, result))
    return hashlib.sha256(content).digest() + content


def _unpack(content: bytes) -> Any:
    if hashlib.sha256(content[CHECKSUM:]).digest() != content[:CHECKSUM]:
        raise ValueError("damaged")
    return pickle.loads(content[CHECKSUM:])


def _write(path: Path, content: bytes) -> None:
    if path.is_dir():
        _remove(path)
    with whole(path) as draft:
        draft.write_bytes(content)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


@functools.cache
def _used(folder: Path) -> None:
    """Note, once in a process, that a folder is in use."""
    with contextlib.suppress(OSError):
        os.utime(folder)


def _prune(folder: Path) -> None:
    """Remove the folders of the same package that were not used for longest."""
    package = folder.name.rpartition("-")[0]
    found = []
    for other in folder.parent.glob(f"{package}-*"):
        with contextlib.suppress(OSError):
            found.append((other.stat().st_mtime, other))
    for used, other in sorted(found, reverse=True)[KEPT:]:
        if time.time() - used > IN_USE:
            shutil.rmtree(other, ignore_errors=True)


@functools.cache
def _complain(folder: Path, reason: str) -> None:
    """Say, once in a process, that kernels are not kept."""
    print(f"compiled kernels cannot be kept in {folder} ({reason}): every start compiles them again", file=sys.stderr)


# Which sources --------------------------------------------------------------------------------------------------


def _root(module: str) -> str:
    return module.partition(".")[0]


def _cells(function: Callable[..., Any]) -> list[Any]:
    """Give what a function that was made in another one has from there; a kernel as the function that it was."""
    values = [cell.cell_contents for cell in function.__closure__ or ()]
    return [value.py_func if is_jitted(value) else value for value in values]


def _identity(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Tell a function from others made of the same sources: its place in them, and all that it was made with."""
    code = function.__code__
    made_with = [_identity(value) if isfunction(value) else dumps(value) for value in _cells(function)]
    return function.__module__, function.__qualname__, code.co_firstlineno, code.co_code, made_with


def _sources_of(function: Callable[..., Any]) -> tuple[Path, ...]:
    """Give the folders (or the file) whose sources a function can depend on."""
    return tuple(_place_of(root, function) for root in sorted(_roots(function)))


def _roots(function: Callable[..., Any]) -> set[str]:
    """Give the top-level packages that a function can depend on."""
    found = {_root(function.__module__)} | (_used_by(function.__module__) & _packages)
    return found.union(*(_roots(value) for value in _cells(function) if isfunction(value)))


def _used_by(module: str) -> set[str]:
    """Give the top-level packages of what a module has imported so far."""
    values = list(vars(sys.modules[module]).values()) if module in sys.modules else []
    names = (getattr(value, "__module__", None) or getattr(value, "__name__", None) for value in values)
    return {_root(name) for name in names if isinstance(name, str)}


def _place_of(root: str, function: Callable[..., Any]) -> Path:
    paths = list(getattr(sys.modules.get(root), "__path__", []))
    return Path(paths[0]) if paths else Path(function.__code__.co_filename)


def _digest(sources: tuple[Path, ...], own: Path) -> str:
    """Give the digest of sources and tools as this process met them; anew if the module was changed and read again."""
    if sources not in _seen or _seen[sources][1].get(own) != _stamp(own):
        stamps = {path: _stamp(path) for place in sources for path in _files(place)}
        stamps.setdefault(own, _stamp(own))
        _seen[sources] = (_digest_now(sources), stamps)
    return _seen[sources][0]


def _digest_now(sources: tuple[Path, ...]) -> str:
    """Give the digest of tools and of what the sources hold at this moment."""
    found = hashlib.sha256(_tools().encode())
    for place in sources:
        for path in _files(place):
            content = path.read_bytes()
            found.update(f"{place.name}/{path.relative_to(place)} {len(content)}\n".encode())
            found.update(content)
    return found.hexdigest()[:24]


def _stamp(path: Path) -> tuple[int, int]:
    try:
        status = path.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def _files(place: Path) -> list[Path]:
    return sorted(place.rglob("*.py")) if place.is_dir() else [place] if place.is_file() else []


@functools.cache
def _tools() -> str:
    """Name all beside the sources that a kernel depends on; its processor is part of each kernel's key."""
    settings = sorted(f"{key}={value}" for key, value in os.environ.items() if key.startswith("NUMBA_"))
    settings = [text for text in settings if not text.startswith(("NUMBA_CACHE", "NUMBA_DEBUG_CACHE"))]
    versions = [numba.__version__, llvmlite.__version__, np.__version__, sys.version, sys.platform]
    return "\n".join([*versions, *settings])


# Where ----------------------------------------------------------------------------------------------------------


@functools.cache
def _place() -> Path:
    """Give the folder of all kernels."""
    for choose in (_wanted, _home):
        with contextlib.suppress(OSError, RuntimeError):
            folder = choose()
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                if os.access(folder, os.W_OK | os.X_OK):
                    return folder
    return _temporary()


def _wanted() -> Path | None:
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR).absolute()
    given = places.given()
    return given / "kernels" if given else None


def _home() -> Path:
    return places.user_cache() / places.OURS / "kernels"


def _temporary() -> Path:
    """Give a folder of ours among the temporary files: kernels run, so nobody else may have put any there."""
    try:
        folder = Path(tempfile.gettempdir()) / f"phil-catenary-kernels-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022:
            return folder
        return Path(tempfile.mkdtemp(prefix="phil-catenary-kernels-"))
    except OSError:
        return Path(os.devnull) / "kernels"  # nothing is kept, and said so at the first kernel
