"""The listening half of a recording: finds topics, and takes them by the links of their senders or by DDS."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from time import monotonic
from typing import Any

from energy_monitor.links import Followed, Links
from energy_monitor.losses import Numbers

DEPTH = 5000
"""Messages a topic that may wait for the recorder: 10 s at 500 Hz, so that a ride at full speed loses nothing."""
SETTLE = 0.3
"""s from the last match until the recorder calls itself ready: the publishers' side learns of it a little later."""

GRACE = 0.5
"""s that a link has to come again, before its topic is listened to by DDS."""


class RideRecorder:
    """Finds topics and hands every message to a sink, once.

    A topic whose only publisher is a node of a rig on this machine comes by that node's link. Every other one, and one
    of which a second publisher turns up, is subscribed to as the publishers offer it.
    """

    def __init__(self, node: Any, sink: Any, topics: Sequence[str], expected: Sequence[str], every_topic: bool) -> None:
        """Record ``topics`` (and all others if ``every_topic``) of the node's graph; be ready with the ``expected``."""
        self._node = node
        self._sink = sink
        self._wanted = {node.resolve_topic_name(name) for name in topics}
        self._expected = {node.resolve_topic_name(name) for name in expected}
        self._every_topic = every_topic
        self._subscriptions: dict[str, Any] = {}
        self._followed: dict[str, Followed] = {}
        self._alone_since: dict[str, float] = {}
        self._kinds: dict[str, Any] = {}
        self._channels: dict[str, Any] = {}
        self._links = Links()
        self.channels: list[Any] = []
        self._numbers: list[tuple[Any, Numbers]] = []
        self.refused: dict[str, str] = {}
        self.undefined: dict[str, str] = {}
        """Recorded topics whose messages the bag does not explain, and why."""
        self._matched_since: float | None = None

    def discover(self) -> None:
        """Begin with everything wanted that has a publisher by now; look whether links are enough for the rest.

        Raises
        ------
        OSError
            Nothing can be taken by links any more.
        """
        if self._links.error is not None:
            raise OSError(f"nothing comes by links any more: {self._links.error}") from self._links.error
        names = set(self._wanted)
        if self._every_topic:
            graph = self._node.get_topic_names_and_types()
            names |= {name for name, _ in graph if not any(part.startswith("_") for part in name.split("/"))}
        for name in sorted(names - self._followed.keys() - self.refused.keys()):
            publishers = self._node.get_publishers_info_by_topic(name)
            if publishers:
                self._add(name, publishers)
        for name in self._followed.keys() - self._subscriptions.keys():
            self._complete(name, monotonic())

    def count_losses(self) -> None:
        """Find out what the gaps are that showed since the last call: losses, or other publishers."""
        for channel, numbers in self._numbers:
            if numbers.unsettled:
                lost = numbers.settle(identities(self._node.get_publishers_info_by_topic(channel.topic)))
                # What the link's sender says came by the link; who publishes by DDS may then be behind.
                channel.lost += 0 if self._followed[channel.topic].linked else lost
            channel.counted = numbers.counted

    def ready(self, now: float) -> bool:
        """Tell whether every expected topic is subscribed and has had a publisher for a while (``now`` in s)."""
        matched = all(self._reached(name) for name in self._expected)
        if not matched:
            self._matched_since = None
            return False
        if self._matched_since is None:
            self._matched_since = now
        return now - self._matched_since >= SETTLE

    def _reached(self, name: str) -> bool:
        if name in self._subscriptions:
            return bool(self._subscriptions[name].get_publisher_count() > 0)
        return name in self._followed and self._followed[name].linked

    @property
    def complete(self) -> bool:
        """True when there is nothing left to be found."""
        return not self._every_topic and self._wanted <= self._followed.keys() | self.refused.keys()

    @property
    def absent(self) -> list[str]:
        """Wanted topics that nobody published."""
        return sorted(self._wanted - self._followed.keys() - self.refused.keys())

    def close(self) -> None:
        """Leave all senders."""
        self._links.close()

    def _add(self, name: str, publishers: Sequence[Any]) -> None:
        """Enter a topic into the bag, and take it one way or the other."""
        from energy_monitor.definitions import definition_of
        from energy_monitor.recorder import Channel

        kind = publishers[0].topic_type
        try:
            package, namespace, short = kind.split("/")
            self._kinds[name] = getattr(import_module(f"{package}.{namespace}"), short)
        except (ImportError, AttributeError, ValueError) as error:
            self.refused[name] = f"type {kind} is not installed ({error})"
            return
        definition = definition_of(kind, str(publishers[0].topic_type_hash))
        if definition.problem:
            self.undefined[name] = definition.problem
        channel = Channel(name, kind, definition, [offered(info.qos_profile) for info in publishers])

        def lost(count: int) -> None:
            channel.lost += count

        followed = Followed(self._node.context.get_domain_id(), name, self._sink.add(channel), lost)
        self._followed[name], self._channels[name] = followed, channel
        self.channels.append(channel)
        if not self._links.follow(followed):
            self._subscribe(name, publishers)

    def _complete(self, name: str, now: float) -> None:
        """Subscribe to a topic after all: its link does not come again, or somebody else publishes as well."""
        speakers = self._node.count_publishers(name)
        if not speakers or (self._followed[name].linked and speakers == 1):
            self._alone_since.pop(name, None)
        elif now - self._alone_since.setdefault(name, now) >= GRACE:
            self._subscribe(name, self._node.get_publishers_info_by_topic(name))

    def _subscribe(self, name: str, publishers: Sequence[Any]) -> None:
        from rclpy.event_handler import SubscriptionEventCallbacks

        from phil_node.executor import with_info

        channel = self._channels[name]
        numbers = Numbers(identities(publishers))
        self._subscriptions[name] = self._node.create_subscription(
            self._kinds[name],
            name,
            with_info(numbers.watch(self._followed[name].ways.by_topic)),
            matching(publishers, late=bool(channel.messages)),
            raw=True,
            # None, rclpy's own included: while an event is taken and one more comes, rmw_fastrtps locks for ever.
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._numbers.append((channel, numbers))


def matching(publishers: Sequence[Any], late: bool = False) -> Any:
    """Ask for what all publishers of a topic offer: reliable, transient local if every one of them is.

    Who is ``late``, and has had what was kept by another way, asks for what comes from now on.
    """
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    profiles = [info.qos_profile for info in publishers]
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in profiles)
    latched = not late and all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in profiles)
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


def identities(publishers: Sequence[Any]) -> frozenset[bytes]:
    """Give the identities of publishers as the graph knows them."""
    return frozenset(bytes(info.endpoint_gid) for info in publishers)
