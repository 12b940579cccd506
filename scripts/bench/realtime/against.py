"""Another revision of this repository, built beside it by its own scripts."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from bench.realtime.options import WrongUse
from bench.realtime.session import Build
from phil_base.cache import folder
from phil_base.workspace import workspace

ROOT = workspace()
ENVIRONMENTS = (".venv", ".venv-ros")
PATHS = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH")
MARKS = ("VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""What says that an environment is set up: the wheels of ROS 2 add their libraries only where they have not done so."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What ends the bench with all that it started; SIGINT too: a shell's background process would ignore it."""
SET_UP = '. scripts/lib/environment.sh && phil_environment run && env -0 >"$1"'


class AgainstError(Exception):
    """The revision cannot be had or built."""


def revision(text: str) -> str:
    """Give the full hash of a revision of this repository.

    Raises
    ------
    WrongUse
        There is none of that name, or this is no repository.
    AgainstError
        git is not installed.
    """
    command = ["git", "-C", str(ROOT), "rev-parse", "--verify", "--quiet", "--end-of-options", f"{text}^{{commit}}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        raise AgainstError("--against needs git, which is not installed") from None
    if done.returncode or not re.fullmatch("[0-9a-f]{40,64}", done.stdout.strip()):
        raise WrongUse(f"--against {text!r}: no such revision of {ROOT}")
    return done.stdout.strip()


def cache() -> Path:
    """Give the folder in which such builds are kept, beside the compiled kernels."""
    return folder("against")


def checked_out(sha: str) -> Path:
    """Check the revision out once; virtual environments are shared where both want the same packages.

    Raises
    ------
    AgainstError
        git failed.
    """
    folder = cache() / sha
    if not (folder / ".git").exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        raw = folder.with_name(f"{sha}.{os.getpid()}")
        shutil.rmtree(raw, ignore_errors=True)
        for command in (
            ["git", "clone", "--quiet", "--no-checkout", str(ROOT), str(raw)],
            ["git", "-C", str(raw), "-c", "advice.detachedHead=false", "checkout", "--quiet", sha],
        ):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise AgainstError(f"git: {done.stderr.strip()}")
        raw.rename(folder)
    shared = (folder / "pyproject.toml").read_bytes() == (ROOT / "pyproject.toml").read_bytes()
    for name in ENVIRONMENTS:
        if (folder / name).is_symlink() and not shared:
            (folder / name).unlink()  # it was, when this revision wanted the same
        if shared and (ROOT / name).is_dir() and not (folder / name).exists():
            (folder / name).symlink_to((ROOT / name).resolve())
    return folder


def before(environment: Mapping[str, str], root: Path = ROOT) -> dict[str, str]:
    """Give the environment without what the scripts of ``root`` have put into it: as the user's shell was."""
    ours = {str(root), *(str((root / name).resolve()) for name in ENVIRONMENTS)}

    def mine(entry: str) -> bool:
        return any(entry == own or entry.startswith(f"{own}/") for own in ours)

    found = dict(environment)
    for name in MARKS:
        found.pop(name, None)
    for name in PATHS:
        if name in found:
            kept = [entry for entry in found.pop(name).split(os.pathsep) if entry and not mine(entry)]
            if kept:
                found[name] = os.pathsep.join(kept)
    return found


def build(text: str, folder: Path) -> Build:
    """Check a revision out, build it, and give it with its environment; ``folder`` is for what is written meanwhile.

    Raises
    ------
    WrongUse
        There is none of that name.
    AgainstError
        It cannot be had, or its own scripts cannot build it.
    """
    sha = revision(text)
    root = checked_out(sha)
    folder.mkdir(parents=True, exist_ok=True)
    written = folder / "environment"
    command = ["bash", "-u", "-c", SET_UP, "bash", str(written)]
    done = subprocess.run(command, cwd=root, env=before(os.environ), stdin=subprocess.DEVNULL, check=False)
    if done.returncode or not written.exists():
        raise AgainstError(f"{text}: its own scripts cannot build it in {root}")
    pairs = (entry.partition(b"=") for entry in written.read_bytes().split(b"\0") if entry)
    return Build(sha[:10], root, {os.fsdecode(name): os.fsdecode(value) for name, _, value in pairs})


def present() -> Build:
    """Give the build that this process belongs to."""
    return Build("this build", ROOT, dict(os.environ))


@contextmanager
def measuring(against: str | None) -> Iterator[tuple[list[Build], Path]]:
    """Give the builds to measure, the present one first, and a folder that goes with the bench, however it ends.

    Every signal of SIGNALS ends it as Ctrl-C does, so that nothing is left running. Raises AgainstError.
    """
    before = {number: signal.signal(number, _interrupt) for number in SIGNALS}
    try:
        with tempfile.TemporaryDirectory(prefix="phil-bench-", ignore_cleanup_errors=True) as name:
            builds = [present()]
            if against is not None:
                say(f"building {against}")
                builds.append(build(against, Path(name) / "against"))
            yield builds, Path(name)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def say(text: str) -> None:
    """Tell how far the bench is, beside its output."""
    print(text, file=sys.stderr, flush=True)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
