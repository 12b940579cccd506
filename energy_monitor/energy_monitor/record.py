"""Record any running ride: raw messages into an MCAP bag, message definitions inside."""

from __future__ import annotations

import argparse
import gc
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

from energy_monitor.listening import RideRecorder
from energy_monitor.topics import RECORDED
from energy_monitor.watch import Watch
from phil_base.atomic import write_text
from phil_base.clear_words import clear
from phil_base.command_line import UNUSABLE, Parser, path, seconds
from phil_base.memory import lean_heap, touch_objects
from phil_node.surroundings import leave_if_unusable

RESERVE = 8 << 20
"""Bytes for small objects that are there from the start: else memory grows with the largest burst of messages yet."""
EAGER = 30.0
"""s from the start in which new topics are looked for five times a second, then once a second."""
QUIET = 0.3
"""s without a message that end the recording once it was asked to end."""
LOOK = 0.05
"""s between two looks at signals, clock and graph; messages are taken as they come."""
STEADY_LOOK = 0.2
"""The same once messages come and nobody waits for the recorder."""
COUNT = 1.0
"""s between two looks at what gaps in the numbers of messages mean."""
DRAIN = 2.0
"""s after which the recording ends although messages still come."""

DISK_FULL = 3
"""Exit code for a disk that is full: there may be no room to write that down."""
HANGS = "receiving hangs, and was given up: the bag is whole, with what had come by then"
ROOM = "; make room: what was written up to then is kept, and scripts/analyze.sh reads it"

NODE = "ride_recorder"
MOST_LETTERS = 247
"""Of the name of a topic with its namespace, by rmw."""
_NAME = r"[A-Za-z_][A-Za-z0-9_]*"
_TOPIC = re.compile(rf"(~/|/)?{_NAME}(/{_NAME})*")
_NAMESPACE = re.compile(rf"/?{_NAME}(/{_NAME})*")


def arguments(argv: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = Parser(
        prog="scripts/record.sh",
        description="Record a running ride into an MCAP bag.",
        epilog="Lost messages are counted by the numbers that a publisher gives its messages: gaps between the first "
        "and the last that came, while the topic has one publisher. "
        "Exit code: 0 the bag is whole, 1 writing failed, messages were lost or receiving hung, 2 the command line is "
        "wrong or the folder cannot be made, 3 the disk is full.",
    )
    parser.add_argument("--out", type=path, help="folder of the bag, must not exist (default: ride_DATE_TIME)")
    parser.add_argument("--all", action="store_true", help="record every topic, also those that appear later")
    parser.add_argument(
        "--duration", type=seconds, default=0.0, metavar="S", help="end S seconds after the first message"
    )
    parser.add_argument(
        "--topics", nargs="+", type=topic, metavar="TOPIC", help="record these, not the topics of a ride"
    )
    parser.add_argument(
        "--namespace", type=namespace, default="", metavar="NS", help="namespace of the nodes (default: none)"
    )
    parser.add_argument(
        "--ready-file", type=path, metavar="FILE", help="create FILE once all expected topics are connected"
    )
    parser.add_argument(
        "--expect-topics",
        nargs="+",
        type=topic,
        metavar="TOPIC",
        help="topics that --ready-file waits for (default: all)",
    )
    parser.add_argument(
        "--recover",
        type=path,
        metavar="BAG",
        help="record nothing: write BAG, whose recorder was killed, anew with index and metadata, as mcap and rosbags "
        "want it (to --out, default: BAG_recovered)",
    )
    given = parser.parse_args(argv)
    for name in (*(given.topics or ()), *(given.expect_topics or ())):
        whole = name if name.startswith("/") else f"/{given.namespace}/{NODE}/{name}"
        if len(whole) > MOST_LETTERS:
            parser.error(f"a topic of {len(whole)} letters: ROS takes at most {MOST_LETTERS}: {name}")
    if given.ready_file is not None and (given.ready_file.is_dir() or not given.ready_file.absolute().parent.is_dir()):
        parser.error(f"--ready-file {given.ready_file} cannot be written: it has to be a file in a folder that exists")
    return given


def topic(text: str) -> str:
    """Check the name of a topic by ROS's rules, which need no ROS to be known.

    Raises
    ------
    argparse.ArgumentTypeError
        It is no name.
    """
    if not _TOPIC.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} is not the name of a topic")
    return text


def namespace(text: str) -> str:
    """Check a namespace as `topic` checks a topic; empty or "/" is none."""
    if text not in ("", "/") and not (_NAMESPACE.fullmatch(text) and len(text) < MOST_LETTERS - 50):
        raise argparse.ArgumentTypeError(f"{text!r} is not a namespace")
    return text


def without_ros_arguments(argv: Sequence[str]) -> list[str]:
    """Leave out what stands between --ros-args and -- (or the end): that is for ROS."""
    kept, ours = [], True
    for argument in argv:
        if argument == "--ros-args":
            ours = False
        elif ours:
            kept.append(argument)
        elif argument == "--":
            ours = True
    return kept


def look_period(elapsed: float, waiting: bool) -> float:
    """Give the time in s between two looks for new topics, ``elapsed`` s after the start."""
    return 0.1 if waiting else 0.2 if elapsed < EAGER else 1.0


def announce(file: Path, topics: Sequence[str]) -> None:
    """Create the ready file at once and whole."""
    write_text(file, "".join(f"{topic}\n" for topic in topics))


def summary(recorder: RideRecorder, path: Path, seconds: float) -> str:
    """Say what was recorded, topic by topic."""
    rows = [f"{'messages':>10} {'kB':>10} {'lost':>6}  topic"]
    channels = sorted(recorder.channels, key=lambda channel: channel.topic)
    rows += [f"{c.messages:>10} {c.bytes / 1e3:>10.1f} {c.lost:>6}  {c.topic}  [{c.kind}]" for c in channels]
    rows += [f"{'-':>10} {'-':>10} {'-':>6}  {name}  refused: {why}" for name, why in sorted(recorder.refused.items())]
    rows += [f"{0:>10} {'-':>10} {'-':>6}  {name}  never published" for name in recorder.absent]
    rows += [f"{name} is recorded without its definition: {why}" for name, why in sorted(recorder.undefined.items())]
    if uncounted := [channel.topic for channel in channels if not channel.counted]:
        rows.append(
            f"lost messages were not counted while another publisher than one alone was there: {', '.join(uncounted)}"
        )
    total = sum(channel.messages for channel in channels)
    lost = sum(channel.lost for channel in channels)
    rows.append(f"{path}: {total} messages in {seconds:.1f} s, {lost} lost")
    return "\n".join(rows)


def complaint(channels: Sequence[Any]) -> str | None:
    """Say in one line how many messages the middleware lost, and of which topics; None if it lost none."""
    losers = sorted((channel.topic, channel.lost) for channel in channels if channel.lost)
    if not losers:
        return None
    total = sum(count for _, count in losers)
    return f"{total} messages were lost, the bag has gaps: " + ", ".join(f"{name} {count}" for name, count in losers)


def main(argv: Sequence[str] | None = None) -> int:
    """Record until the duration is over or SIGINT or SIGTERM comes; 0 if the bag is whole, else 1."""
    options = arguments(without_ros_arguments(sys.argv[1:] if argv is None else argv))
    if options.recover is not None:
        return recovered(options.recover, options.out)
    asked: list[int] = []
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL else []  # ignored: nohup
    for number in (signal.SIGINT, signal.SIGTERM, *hang_up):
        signal.signal(number, lambda got, _frame: asked.append(got))

    leave_if_unusable()
    lean_heap()
    touch_objects(RESERVE)
    # Loading ROS takes a while: the handlers above must already stand.
    import rclpy

    from energy_monitor.recorder import NO_ROOM

    path = options.out or Path(f"ride_{datetime.now():%Y%m%d_%H%M%S}")
    topics = options.topics or ([] if options.all and options.expect_topics else RECORDED)
    expected = options.expect_topics or topics
    sink = opened(path, argv)
    if isinstance(sink, int):
        return sink
    began = monotonic()
    recorder: RideRecorder | None = None
    unready: OSError | None = None

    def outcome(hangs: str = "") -> int:
        """Close the bag, and say what is in it."""
        duration = monotonic() - began
        failure = closed(sink) or unready
        if failure is not None:
            full = failure.errno in NO_ROOM
            say(f"record: {failure.strerror or failure}{ROOM if full else ''}", sys.stderr)
            return DISK_FULL if full else 1
        if recorder is not None:
            say(summary(recorder, path, duration), sys.stdout)
            if gaps := complaint(recorder.channels):
                hangs = hangs or gaps
        if hangs:
            say(f"record: {hangs}", sys.stderr)
        return 1 if hangs else 0

    code: int | None = None

    def rescue() -> None:
        os._exit(outcome(HANGS) if code is None else code)

    with Watch(rescue) as watch:
        node = rclpy.create_node(NODE, namespace=options.namespace, enable_rosout=False, start_parameter_services=False)
        for publisher in list(node.publishers):  # of parameters, with events of DDS
            node.destroy_publisher(publisher)
        recorder = RideRecorder(node, sink, topics, expected, options.all)
        try:
            _record(node, recorder, sink, options, asked)
        except OSError as error:  # the ready file
            unready = error
        finally:
            watch.calm()  # the bag takes the time that it needs
            code = outcome()
            watch.arm()
            recorder.close()
            node.destroy_node()
            rclpy.try_shutdown()
    return code


def opened(path: Path, argv: Sequence[str] | None) -> Any:
    """Let ROS take its arguments and begin a bag; give its sink, or, once said why, the exit code."""
    import rclpy
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.logging import LoggingSeverity, set_logger_level
    from rclpy.signals import SignalHandlerOptions
    from rosbags.rosbag2 import WriterError

    from energy_monitor.recorder import NO_ROOM, BagSink

    set_logger_level("rcl", LoggingSeverity.FATAL)  # what it cannot read is said below, in one line
    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except (rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError) as error:
        said = " ".join(str(error).partition(", at /")[0].split())
        say(clear(f"record: ROS cannot take its arguments: {said}"), sys.stderr)
        return UNUSABLE
    except UnicodeEncodeError:
        say("record: ROS cannot take its arguments: they have letters that are no UTF-8", sys.stderr)
        return UNUSABLE
    set_logger_level("rcl", LoggingSeverity.UNSET)
    try:
        return BagSink(path)
    except (WriterError, OSError) as error:
        rclpy.try_shutdown()
        reason = f"{path}: {error.strerror or error}" if isinstance(error, OSError) else str(error)
        say(clear(f"record: {reason}"), sys.stderr)
        return DISK_FULL if getattr(error, "errno", None) in NO_ROOM else UNUSABLE


def recovered(bag: Path, out: Path | None) -> int:
    """Write a bag anew; 0 if there is something in it, else 2."""
    from energy_monitor.bag_channel import BagError
    from energy_monitor.recover import recover

    try:
        found = recover(bag, out)
    except BagError as error:
        print(f"record: {' '.join(str(error).split())}", file=sys.stderr)
        return UNUSABLE
    for note in found.notes:
        print(note)
    print(f"{found.path}: {found.messages} messages on {found.topics} topics")
    return 0


def closed(sink: Any) -> OSError | None:
    """Close the bag; give what went wrong, now or earlier."""
    try:
        sink.close()
    except OSError as error:
        return error
    return None


def say(text: str, stream: TextIO) -> None:
    """Print, and go on where there is no room for that either: the exit code tells."""
    try:
        print(text, file=stream, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _record(node: Any, recorder: RideRecorder, sink: Any, options: argparse.Namespace, asked: list[int]) -> None:
    from rclpy.clock import Clock, ClockType

    from phil_base.scheduling import go_first
    from phil_node.executor import LONG, events_executor

    # A ride that was granted real-time scheduling would starve a recorder without it, and the bag would have gaps.
    go_first([os.getpid()])
    executor = events_executor()
    executor.add_node(node)
    gc.collect()
    gc.freeze()
    gc.disable()
    turns = Turns(recorder, sink, options, asked)
    # A timer, and one long turn of the executor: each wait leaves a callback with the future for good.
    timer = node.create_timer(LOOK, turns.take, clock=Clock(clock_type=ClockType.STEADY_TIME))
    turns.pace = partial(setattr, timer, "timer_period_ns")
    while not turns.done.done():
        executor.spin_until_future_complete(turns.done, timeout_sec=LONG)
    executor.shutdown()
    recorder.count_losses()
    if turns.failure is not None:
        raise turns.failure


class Turns:
    """What a recorder does beside taking messages, from time to time: `take` is called by a timer, until `done`."""

    def __init__(self, recorder: Any, sink: Any, options: argparse.Namespace, asked: list[int]) -> None:
        from rclpy.task import Future

        self.done = Future()
        self.failure: Exception | None = None
        self.pace: Callable[[int], None] = lambda period: None
        """Sets the time in ns between two turns."""
        self._recorder, self._sink, self._options, self._asked = recorder, sink, options, asked
        self._began = self._said = self._counted = monotonic()
        self._looked = self._began - 1.0
        self._before = 0
        self._first: float | None = None
        self._waiting = options.ready_file is not None
        self._show = sys.stdout.isatty()
        self._drain: Drain | None = None

    def take(self) -> None:
        """Do what is due; complete `done` when the recording is over or has failed."""
        if self.done.done():
            return
        try:
            over = self._look(monotonic())
        except Exception as error:  # rclpy would lose what it was
            self.failure, over = error, True
        if over:
            self.done.set_result(None)

    def _look(self, now: float) -> bool:
        """Give whether the recording is over."""
        if self._sink.error is not None:
            return True
        if self._asked:
            if self._drain is None:
                self._drain = Drain(now, self._sink.received)
                self.pace(round(LOOK * 1e9))
            return self._drain.over(now, self._sink.received, len(self._asked))
        recorder = self._recorder
        period = COUNT if recorder.complete else look_period(now - self._began, self._waiting)
        if now - self._looked >= period:
            self._looked = now
            recorder.discover()
        if self._waiting and recorder.ready(now):
            announce(self._options.ready_file, [channel.topic for channel in recorder.channels])
            self._waiting = False
        if now - self._counted >= COUNT:
            self._counted = now
            recorder.count_losses()
        if self._show and now - self._said >= 1.0:
            count = self._sink.received
            rate = (count - self._before) / (now - self._said)
            print(f"{now - self._began:7.1f} s  {count:>9} messages  {rate:8.0f} /s", flush=True)
            self._said, self._before = now, count
        if self._first is None and self._sink.received:
            self._first = now
        if self._first is not None and not self._waiting:
            self.pace(round(STEADY_LOOK * 1e9))
        return self._first is not None and 0.0 < self._options.duration <= now - self._first


class Drain:
    """Tells how long to take what is still on its way: the recorder is often asked to end together with the nodes."""

    def __init__(self, now: float, received: int) -> None:
        """Begin at ``now`` in s, when so many messages had come."""
        self._deadline = now + DRAIN
        self._quiet_since, self._received = now, received

    def over(self, now: float, received: int, asked: int) -> bool:
        """Tell whether it is enough, at ``now`` with so many messages; a second signal ends it at once."""
        if received != self._received:
            self._quiet_since, self._received = now, received
        return asked > 1 or now - self._quiet_since >= QUIET or now >= self._deadline


if __name__ == "__main__":
    sys.exit(main())
