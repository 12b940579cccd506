"""A node's process from start to end: what a node module's ``main`` does."""

from __future__ import annotations

import gc
import os
import re
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from phil_base.clear_words import clear
from phil_base.parameters import ParameterError
from phil_node.executor import LONG, events_executor
from phil_node.instance import AlreadyRunning, claim
from phil_node.shared_memory import remove_litter
from phil_node.signals import Ending
from phil_node.topics import TopicsProcess

if TYPE_CHECKING:
    from phil_node.base import PhilNode

RCLError = rclpy_implementation.RCLError
UnknownROSArgsError = rclpy_implementation.UnknownROSArgsError
WRONG = 2
SIGNAL_SECONDS = 0.2
"""Time in s after which an idle node looks for signals."""
PLACES = re.compile(r", at \S+:\d+")
"""Where in its sources ROS found an error: of no use to who typed the command."""


def run(kind: Callable[[], PhilNode[Any]], argv: list[str] | None = None) -> int:
    """Run one node until it is shut down or asked to end by a signal.

    Give the exit code: 0 it ended in order; 2 for wrong parameters or arguments, or if this machine has that node on
    that domain already.
    """
    with Ending() as ending:
        return _run(kind, argv, ending)


def _run(kind: Callable[[], PhilNode[Any]], argv: list[str] | None, ending: Ending) -> int:
    remove_litter()
    try:
        set_logger_level("rcl", LoggingSeverity.FATAL)  # what it cannot read is said below, in one line
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        # It logs each transition that does not exist, without a bound; the node says so itself.
        set_logger_level("rcl_lifecycle", LoggingSeverity.ERROR)
        set_logger_level("rcl", LoggingSeverity.UNSET)
        node = kind()
        held = claim(node.full_name, node.context.get_domain_id())
    except (ParameterError, AlreadyRunning) as error:
        return _refuse(str(error))
    except UnknownROSArgsError as error:
        return _refuse(f"ROS does not know these arguments: {error}")
    except UnicodeEncodeError:
        return _refuse("ROS cannot take its arguments: they have letters that are no UTF-8")
    except RCLError as error:
        # Arguments that ROS itself cannot read: a missing parameter file, a malformed remapping.
        return _refuse(PLACES.sub("", str(error).splitlines()[0]))
    node.has_process = True
    node.wires.use(TopicsProcess())
    node.answers.take_over(node.services)
    executor = events_executor()
    executor.add_node(node)
    try:
        _spin(node, executor, ending)
        if node.failure is not None:
            raise node.failure
        if ending.asked and not node.finished.done():
            node.trigger_shutdown()
        elif rclpy.ok():
            # The answer to the shutdown request is still to be sent.
            for _ in range(5):
                executor.spin_once(timeout_sec=0.02)
    except ExternalShutdownException:
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
        held.close()
    return 0


def _spin(node: PhilNode[Any], executor: Any, ending: Ending) -> None:
    """Let a node work until it has finished or failed, or the process is asked to end."""
    over = Future()

    def finish(_: object = None) -> None:
        if not over.done():
            over.set_result(None)

    def look() -> None:
        # The handlers of signals run when the main thread does something in Python: here at the latest.
        if ending.asked or node.failure is not None or not rclpy.ok():
            finish()

    node.finished.add_done_callback(finish)
    node.create_timer(SIGNAL_SECONDS, look, clock=node.steady)
    # One long turn: entering the executor costs 25 us, and each wait leaves a callback with the future for good.
    # Not spin(): it waits for messages in a busy loop.
    while rclpy.ok() and not over.done():
        executor.spin_until_future_complete(over, timeout_sec=LONG)


def _refuse(text: str) -> int:
    print(clear(text), file=sys.stderr)
    rclpy.try_shutdown()
    return WRONG


def leave(code: int) -> NoReturn:
    """End the process at once, after all its output.

    Fast DDS waits in its static destructors for the listeners of a participant that is still there, now and then for
    ever and at full load; what has to be taken down, `run` has taken down.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
