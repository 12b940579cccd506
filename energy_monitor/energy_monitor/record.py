"""Record any running ride: raw messages into an MCAP bag, message definitions inside."""

from __future__ import annotations

import argparse
import gc
import os
import re
import signal
import sys
from collections.abc import Sequence
from datetime import datetime
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any, TextIO

from energy_monitor.topics import RECORDED
from phil_node.clear_words import clear
from phil_node.command_line import UNUSABLE, Parser, path, seconds
from phil_node.surroundings import leave_if_unusable

DEPTH = 5000
"""Messages a topic that may wait for the recorder: 10 s at 500 Hz, so that a ride at full speed loses nothing."""
SETTLE = 0.3
"""s from the last match until the recorder calls itself ready: the publishers' side learns of it a little later."""
EAGER = 30.0
"""s from the start in which new topics are looked for five times a second, then once a second."""
QUIET = 0.3
"""s without a message that end the recording once it was asked to end."""
LOOK = 0.05
"""s between two looks at signals, clock and graph; messages are taken as they come."""
STEADY_LOOK = 0.2
"""The same once all topics are found: rclpy's events executor keeps 32 bytes of each such turn for good."""
DRAIN = 2.0
"""s after which the recording ends although messages still come."""

DISK_FULL = 3
"""Exit code for a disk that is full: there may be no room to write that down."""
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
        epilog="Exit code: 0 the bag is whole, 1 writing failed or messages were lost, 2 the command line is wrong "
        "or the folder cannot be made, 3 the disk is full.",
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


class RideRecorder:
    """Finds topics, subscribes to them as their publishers offer them, and hands every message to a sink."""

    def __init__(self, node: Any, sink: Any, topics: Sequence[str], expected: Sequence[str], every_topic: bool) -> None:
        """Record ``topics`` (and all others if ``every_topic``) of the node's graph; be ready with the ``expected``."""
        self._node = node
        self._sink = sink
        self._wanted = {node.resolve_topic_name(name) for name in topics}
        self._expected = {node.resolve_topic_name(name) for name in expected}
        self._every_topic = every_topic
        self._subscriptions: dict[str, Any] = {}
        self.channels: list[Any] = []
        self.refused: dict[str, str] = {}
        self.undefined: dict[str, str] = {}
        """Recorded topics whose messages the bag does not explain, and why."""
        self._matched_since: float | None = None

    def discover(self) -> None:
        """Subscribe to everything wanted that has a publisher by now."""
        names = set(self._wanted)
        if self._every_topic:
            graph = self._node.get_topic_names_and_types()
            names |= {name for name, _ in graph if not any(part.startswith("_") for part in name.split("/"))}
        for name in sorted(names - self._subscriptions.keys() - self.refused.keys()):
            publishers = self._node.get_publishers_info_by_topic(name)
            if publishers:
                self._subscribe(name, publishers)

    def ready(self, now: float) -> bool:
        """Tell whether every expected topic is subscribed and has had a publisher for a while (``now`` in s)."""
        matched = all(
            name in self._subscriptions and self._subscriptions[name].get_publisher_count() > 0
            for name in self._expected
        )
        if not matched:
            self._matched_since = None
            return False
        if self._matched_since is None:
            self._matched_since = now
        return now - self._matched_since >= SETTLE

    @property
    def complete(self) -> bool:
        """True when there is nothing left to be found."""
        return not self._every_topic and self._wanted <= self._subscriptions.keys() | self.refused.keys()

    @property
    def absent(self) -> list[str]:
        """Wanted topics that nobody published."""
        return sorted(self._wanted - self._subscriptions.keys() - self.refused.keys())

    def _subscribe(self, name: str, publishers: Sequence[Any]) -> None:
        from rclpy.event_handler import SubscriptionEventCallbacks

        from energy_monitor.definitions import definition_of
        from energy_monitor.recorder import Channel

        kind = publishers[0].topic_type
        try:
            package, namespace, short = kind.split("/")
            message = getattr(import_module(f"{package}.{namespace}"), short)
        except (ImportError, AttributeError, ValueError) as error:
            self.refused[name] = f"type {kind} is not installed ({error})"
            return
        definition = definition_of(kind, str(publishers[0].topic_type_hash))
        if definition.problem:
            self.undefined[name] = definition.problem
        channel = Channel(name, kind, definition, [offered(info.qos_profile) for info in publishers])

        def lost(status: Any) -> None:
            channel.lost += status.total_count_change

        self._subscriptions[name] = self._node.create_subscription(
            message,
            name,
            self._sink.add(channel),
            matching(publishers),
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(message_lost=lost),
        )
        self.channels.append(channel)


def matching(publishers: Sequence[Any]) -> Any:
    """Ask for what all publishers of a topic offer: reliable, transient local if every one of them is."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    profiles = [info.qos_profile for info in publishers]
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    latched = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def offered(profile: Any) -> Any:
    """Translate a publisher's QoS for the bag, so that a player can offer the same."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    def duration(value: Any) -> QosTime:
        seconds, nanoseconds = divmod(value.nanoseconds, 10**9)
        return QosTime(seconds, nanoseconds)

    return Qos(
        history=getattr(QosHistory, profile.history.name, QosHistory.UNKNOWN),
        depth=profile.depth,
        reliability=getattr(QosReliability, profile.reliability.name, QosReliability.UNKNOWN),
        durability=getattr(QosDurability, profile.durability.name, QosDurability.UNKNOWN),
        deadline=duration(profile.deadline),
        lifespan=duration(profile.lifespan),
        liveliness=getattr(QosLiveliness, profile.liveliness.name, QosLiveliness.UNKNOWN),
        liveliness_lease_duration=duration(profile.liveliness_lease_duration),
        avoid_ros_namespace_conventions=profile.avoid_ros_namespace_conventions,
    )


def announce(file: Path, topics: Sequence[str]) -> None:
    """Create the ready file at once and whole."""
    draft = file.with_name(f".{file.name}.{os.getpid()}")
    draft.write_text("".join(f"{topic}\n" for topic in topics), encoding="utf-8")
    draft.replace(file)


def summary(recorder: RideRecorder, path: Path, seconds: float) -> str:
    """Say what was recorded, topic by topic."""
    rows = [f"{'messages':>10} {'kB':>10} {'lost':>6}  topic"]
    channels = sorted(recorder.channels, key=lambda channel: channel.topic)
    rows += [f"{c.messages:>10} {c.bytes / 1e3:>10.1f} {c.lost:>6}  {c.topic}  [{c.kind}]" for c in channels]
    rows += [f"{'-':>10} {'-':>10} {'-':>6}  {name}  refused: {why}" for name, why in sorted(recorder.refused.items())]
    rows += [f"{0:>10} {'-':>10} {'-':>6}  {name}  never published" for name in recorder.absent]
    rows += [f"{name} is recorded without its definition: {why}" for name, why in sorted(recorder.undefined.items())]
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
    # Loading ROS takes a while: the handlers above must already stand.
    import rclpy

    from energy_monitor.recorder import NO_ROOM

    path = options.out or Path(f"ride_{datetime.now():%Y%m%d_%H%M%S}")
    topics = options.topics or ([] if options.all and options.expect_topics else RECORDED)
    expected = options.expect_topics or topics
    sink = opened(path, argv)
    if isinstance(sink, int):
        return sink
    node = rclpy.create_node(NODE, namespace=options.namespace, enable_rosout=False, start_parameter_services=False)
    recorder = RideRecorder(node, sink, topics, expected, options.all)
    began = monotonic()
    unready: OSError | None = None
    try:
        _record(node, recorder, sink, options, asked)
    except OSError as error:  # the ready file
        unready = error
    finally:
        duration = monotonic() - began
        node.destroy_node()
        rclpy.try_shutdown()
        failure = closed(sink) or unready
    if failure is not None:
        full = failure.errno in NO_ROOM
        say(f"record: {failure.strerror or failure}{ROOM if full else ''}", sys.stderr)
        return DISK_FULL if full else 1
    say(summary(recorder, path, duration), sys.stdout)
    if gaps := complaint(recorder.channels):
        say(f"record: {gaps}", sys.stderr)
        return 1
    return 0


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
    from rclpy.task import Future

    from phil_node.executor import events_executor
    from phil_node.scheduling import go_first

    # A ride that was granted real-time scheduling would starve a recorder without it, and the bag would have gaps.
    go_first([os.getpid()])
    never = Future()
    executor = events_executor()
    executor.add_node(node)
    gc.collect()
    gc.freeze()
    gc.disable()
    began = looked = said = monotonic()
    looked -= 1.0
    before = 0
    first: float | None = None
    waiting = options.ready_file is not None
    show = sys.stdout.isatty()
    while not asked and sink.error is None:
        executor.spin_until_future_complete(never, timeout_sec=STEADY_LOOK if first and not waiting else LOOK)
        now = monotonic()
        if not recorder.complete and now - looked >= look_period(now - began, waiting):
            looked = now
            recorder.discover()
        if waiting and recorder.ready(now):
            announce(options.ready_file, [channel.topic for channel in recorder.channels])
            waiting = False
        if show and now - said >= 1.0:
            count = sink.received
            print(f"{now - began:7.1f} s  {count:>9} messages  {(count - before) / (now - said):8.0f} /s", flush=True)
            said, before = now, count
        if first is None and sink.received:
            first = now
        if first is not None and 0.0 < options.duration <= now - first:
            break
    else:
        _drain(executor, sink, asked)
    executor.shutdown()


def _drain(executor: Any, sink: Any, asked: list[int]) -> None:
    """Take what is still on its way: the recorder is often asked to end together with the nodes."""
    from rclpy.task import Future

    never = Future()
    deadline = monotonic() + DRAIN
    quiet_since, count = monotonic(), sink.received
    # A second signal ends it at once.
    while len(asked) < 2 and sink.error is None:
        executor.spin_until_future_complete(never, timeout_sec=LOOK)
        now = monotonic()
        if sink.received != count:
            quiet_since, count = now, sink.received
        if now - quiet_since >= QUIET or now >= deadline:
            break


if __name__ == "__main__":
    sys.exit(main())
