"""A node's process from start to end: what a node module's ``main`` does."""

from __future__ import annotations

import gc
import os
import re
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from phil_base.clear_words import clear
from phil_base.parameters import ParameterError
from phil_base.scheduling import own_threads, schedule_as_others
from phil_node.composition import Composition
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
    return run_together([kind], argv)


def run_together(kinds: Sequence[Callable[[], PhilNode[Any]]], argv: list[str] | None = None) -> int:
    """Run nodes in one process until all are shut down, or it is asked to end by a signal, or one of them fails.

    Give the exit code: 0 they ended in order; 1 one has failed, or was shut down beside an active one; 2 for wrong
    parameters or arguments, or if this machine has one of the nodes on that domain already.
    """
    with Ending() as ending:
        return _run(kinds, argv, ending)


def _run(kinds: Sequence[Callable[[], PhilNode[Any]]], argv: list[str] | None, ending: Ending) -> int:
    remove_litter()
    topics = TopicsProcess(forked=threading.active_count() == 1)  # ROS has no threads yet
    made = _made(kinds, argv)
    if isinstance(made, int):
        topics.close()
        return made
    nodes, held = made
    executor = events_executor()
    together = Composition(topics) if len(nodes) > 1 else None
    for node in nodes:
        node.has_process = True
        if together is None:
            node.wires.use(topics)
        else:
            node.wires.share(together)
        node.answers.take_over(node.services)
        executor.add_node(node)
    code = 0
    try:
        _spin(nodes, executor, ending)
        code = _outcome(nodes)
        for node in reversed(nodes):  # the last one moves the drive
            if (ending.asked or code) and not node.finished.done():
                node.trigger_shutdown()
        if not ending.asked and rclpy.ok():
            # The answer to the shutdown request is still to be sent.
            for _ in range(5):
                executor.spin_once(timeout_sec=0.02)
    except ExternalShutdownException:
        pass
    finally:
        schedule_as_others(own_threads())  # threads end, and a child is waited for
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        if together is not None:
            topics.close()
        rclpy.try_shutdown()
        # A lifecycle node's state machine keeps the DDS participant, with its threads and its shared memory, until
        # the last reference to the node is gone; the nodes have switched the collector off.
        del node, nodes, made, executor
        gc.unfreeze()
        gc.collect()
        for claimed in held:
            claimed.close()
    return code


def _made(
    kinds: Sequence[Callable[[], PhilNode[Any]]], argv: list[str] | None
) -> tuple[list[PhilNode[Any]], list[Any]] | int:
    """Initialise ROS, and make the nodes, with what claims their names; give the exit code, once said why, if not."""
    try:
        set_logger_level("rcl", LoggingSeverity.FATAL)  # what it cannot read is said below, in one line
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        # It logs each transition that does not exist, without a bound; the node says so itself.
        set_logger_level("rcl_lifecycle", LoggingSeverity.ERROR)
        set_logger_level("rcl", LoggingSeverity.UNSET)
        nodes = [kind() for kind in kinds]
        return nodes, [claim(node.full_name, node.context.get_domain_id()) for node in nodes]
    except (ParameterError, AlreadyRunning) as error:
        return _refuse(str(error))
    except UnknownROSArgsError as error:
        return _refuse(f"ROS does not know these arguments: {error}")
    except UnicodeEncodeError:
        return _refuse("ROS cannot take its arguments: they have letters that are no UTF-8")
    except RCLError as error:
        # Arguments that ROS itself cannot read: a missing parameter file, a malformed remapping.
        return _refuse(PLACES.sub("", str(error).splitlines()[0]))


def _outcome(nodes: Sequence[PhilNode[Any]]) -> int:
    """Give the exit code when nothing goes on any more; say of nodes in one process which one ended all of them.

    Raises
    ------
    BaseException
        What went wrong in the cycle of a node that is alone in its process.
    """
    failed = [node for node in nodes if node.failure is not None]
    for node in failed:
        assert node.failure is not None
        if len(nodes) == 1:
            raise node.failure
        traceback.print_exception(node.failure)
        what = f"{type(node.failure).__name__}: {node.failure}"
        print(f"{node.full_name} failed, and with it all nodes of its process: {what}", file=sys.stderr)
    if failed:
        return 1
    left = [node.full_name for node in nodes if node.finished.done()]
    if any(node.active for node in nodes) and left:
        print(f"{', '.join(left)} was shut down, and with it the other nodes of its process", file=sys.stderr)
        return 1
    return 0


def _spin(nodes: Sequence[PhilNode[Any]], executor: Any, ending: Ending) -> None:
    """Let nodes work until all have finished, or one has failed, or the process is asked to end."""
    over = Future()

    def finish(_: object = None) -> None:
        done = [node.finished.done() for node in nodes]
        if not over.done() and (all(done) or (any(done) and any(node.active for node in nodes))):
            over.set_result(None)

    def look() -> None:
        # The handlers of signals run when the main thread does something in Python: here at the latest.
        stops = ending.asked or any(node.failure is not None for node in nodes) or not rclpy.ok()
        if stops and not over.done():
            over.set_result(None)

    for node in nodes:
        node.finished.add_done_callback(finish)
    nodes[0].create_timer(SIGNAL_SECONDS, look, clock=nodes[0].steady)
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
