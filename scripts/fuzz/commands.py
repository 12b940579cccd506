"""What every command does with its command line before it starts anything: the same functions, in the same order.

A command line is a file here: its words with a zero byte between them, as in ``/proc/PID/cmdline``, the command first.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

WRONG = 2
NEW = "made"
"""A folder for what would else go into the repository's `rides`; an ``--out`` of the case comes later and wins."""


def ride(argv: list[str]) -> int:
    """All that ``scripts/run.sh`` does before the first process."""
    from ride.command import prepared
    from ride.options import parse

    return WRONG if prepared(parse(["--out", NEW, *argv])) is None else 0


def record(argv: list[str]) -> int:
    """All that ``scripts/record.sh`` does before it joins the nodes, or a whole ``--recover``."""
    import rclpy

    from energy_monitor.record import arguments, opened, recovered, without_ros_arguments

    options = arguments(without_ros_arguments(argv))
    if options.recover is not None:
        return recovered(options.recover, options.out)
    found = opened(options.out or Path(NEW), argv)
    if isinstance(found, int):
        return found
    found.close()
    rclpy.try_shutdown()
    return 0


def analyze(argv: list[str]) -> int:
    """Make a whole report with ``scripts/analyze.sh``, without figures."""
    from energy_monitor.report.cli import main

    return main([*(["--no-html"] if "--" in argv else []), *argv, *([] if "--" in argv else ["--no-html"])])


def options_of(name: str) -> Callable[[list[str]], int]:
    """Give what reads the options of ``scripts/NAME.sh``, and does no more."""

    def read(argv: list[str]) -> int:
        import_module(f"{name}.__main__").arguments(argv)
        return 0

    return read


def soak(argv: list[str]) -> int:
    """Read the options of ``scripts/soak.sh``."""
    from soak.options import parse

    parse(["--out", NEW, *argv])
    return 0


class _Begun(Exception):  # noqa: N818 - not an error: ROS has taken the arguments
    pass


def node(argv: list[str]) -> int:
    """Let a node's process take its arguments, up to where it would make the node."""
    import rclpy

    from phil_node.process import run

    def begun() -> None:
        raise _Begun

    try:
        return run(begun, ["node", *argv])  # type: ignore[arg-type]
    except _Begun:
        rclpy.try_shutdown()
        return 0


COMMANDS: dict[str, Callable[[list[str]], int]] = {
    **{command.__name__: command for command in (ride, record, analyze, soak, node)},
    **{name: options_of(name) for name in ("bench", "validate", "faults", "doctor", "fuzz")},
}


def command(file: Path) -> int:
    """Carry out a command line in the folder of its file."""
    name, *argv = map(os.fsdecode, file.read_bytes().split(b"\0"))
    here, logs = Path.cwd(), os.environ.get("ROS_LOG_DIR")
    os.chdir(file.parent)
    os.environ["ROS_LOG_DIR"] = str(file.parent / "log")
    try:
        return COMMANDS[name](argv)
    finally:
        os.chdir(here)
        with suppress(KeyError):
            del os.environ["ROS_LOG_DIR"]
        if logs is not None:
            os.environ["ROS_LOG_DIR"] = logs
