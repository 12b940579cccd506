"""The kinds of topics and their quality of service."""

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

CYCLE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=5000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""One sample a cycle. Reliable: a lost cycle breaks the books and the wire's state. 5000 deep: a listener that the
machine holds up for seconds still gets every cycle, in lockstep at several times real time, too; its own queue has to
be as deep, and the writer keeps what it has not acknowledged."""

CYCLE_KEPT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=5000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Like CYCLE, and the last 5000 samples are kept for who is matched late: what the catenary and the controller offer.
The rig waits for its listeners before cycle 0, they cannot; a monitor or recorder that asks for it misses no cycle of
theirs. Nodes of the loop ask for CYCLE: they take what comes from now on."""

LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""Published once, kept for whoever comes later."""

VIEW = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=5,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Decimated, for people. Offered as reliable so that both kinds of viewers match; no node depends on it."""

NO_PUBLISHER_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)
NO_SUBSCRIPTION_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""No events of DDS, rclpy's own included: while one is taken and one more comes, rmw_fastrtps 8.4.3 may hang."""
