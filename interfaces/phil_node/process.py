"""A node's process from start to end: what a node module's ``main`` does."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation

from phil_node.executor import events_executor
from phil_node.parameters import ParameterError

if TYPE_CHECKING:
    from phil_node.base import PhilNode

RCLError = rclpy_implementation.RCLError


def run(kind: Callable[[], PhilNode[Any]], argv: list[str] | None = None) -> int:
    """Run one node until it is shut down or interrupted; give the exit code (2: wrong parameters)."""
    try:
        rclpy.init(args=argv)
        node = kind()
    except ParameterError as error:
        print(error, file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    except RCLError as error:
        # Arguments that ROS itself cannot read: a missing parameter file, a malformed remapping.
        print(str(error).splitlines()[0], file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    executor = events_executor()
    executor.add_node(node)
    try:
        # Not spin_once(): entering it costs 25 us a message. Not spin(): it ignores signals.
        while rclpy.ok() and not node.finished.done():
            executor.spin_until_future_complete(node.finished, timeout_sec=1.0)
        if node.finished.done():
            # The answer to the shutdown request is still to be sent.
            for _ in range(5):
                executor.spin_once(timeout_sec=0.02)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
        # A lifecycle node's state machine keeps the DDS participant, with its threads and its shared memory, until
        # the last reference to the node is gone; the nodes have switched the collector off.
        del node, executor
        gc.unfreeze()
        gc.collect()
    return 0


def leave(code: int) -> NoReturn:
    """End the process at once, after all its output.

    Fast DDS waits in its static destructors for the listeners of a participant that is still there, now and then for
    ever and at full load; what has to be taken down, `run` has taken down.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
