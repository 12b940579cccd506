"""What other scripts ask before they start a ride that takes long."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from phil_base.parameters import ParameterError
from ride.options import overrides_of
from ride.settings import NODES, resolve


def refusal(parser: argparse.ArgumentParser, entries: Sequence[str], mode: str, cycle_time: float) -> str:
    """Say why a ride with these parameters would not start, a line each; empty if it would.

    Args:
        parser: of the command line, which leaves with its own line for what is no NODE.KEY=VALUE.
        entries: texts NODE.KEY=VALUE, as ``scripts/run.sh --set`` takes them.
        mode: lockstep or realtime, for the whole ride.
        cycle_time: Ts in s of all nodes.
    """
    overrides = overrides_of([f"{node}.cycle_time={cycle_time:.9g}" for node in NODES] + list(entries), parser)
    overrides["test_rig_sim"].setdefault("mode", mode)
    try:
        resolve(None, overrides)
    except ParameterError as error:
        return str(error)
    return ""
