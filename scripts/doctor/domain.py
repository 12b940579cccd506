"""Who else is on the ROS domain, and how far its messages go."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator, Mapping

from doctor.finding import CHANGE, NOTE, Finding
from phil_node.surroundings import complaints

NODES = ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim")
MEET = 32
"""Participants of a domain that are told of a new one where discovery stays on the machine (Fast DDS)."""
OWN = "doctor"
SECONDS = 2.0
"""Time in which a neighbour on the same machine or network is seen, several announcements long."""


def environment(given: Mapping[str, str]) -> list[Finding]:
    """Say what of the environment variables of ROS cannot work."""
    wrong = list(complaints(given))
    if not wrong:
        return [Finding("ROS environment", f"in order, domain {given.get('ROS_DOMAIN_ID') or 0}")]
    return [Finding("ROS environment", "wrong", CHANGE, line, "as said; then look again") for line in wrong]


def discovery(given: Mapping[str, str]) -> Finding:
    """Say how far the nodes are heard."""
    if given.get("ROS_LOCALHOST_ONLY") == "1":
        return Finding("discovery", "this machine (ROS_LOCALHOST_ONLY)")
    range_ = given.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    peers = given.get("ROS_STATIC_PEERS", "")
    if range_ == "LOCALHOST":
        return Finding("discovery", f"this machine{f', and {peers}' if peers else ''}")
    why = "everybody on the network hears the rig and may command it, and announces himself to it"
    return Finding("discovery", range_, NOTE, why, "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST")


def participants(seconds: float = SECONDS) -> Iterator[Finding]:
    """Look who is there, with a node of our own that is gone afterwards."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(f"{OWN}_{os.getpid()}", start_parameter_services=False, enable_rosout=False)
        own = node.get_name()
        time.sleep(seconds)  # the middleware's threads listen
        names = [f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces() if name != own]
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
    yield judged(Counter(names), domain)


def judged(names: Counter[str], domain: str) -> Finding:
    """Judge the nodes that were seen, by their full names."""
    what = "other nodes on the domain"
    listed = ", ".join(f"{name} ({count})" if count > 1 else name for name, count in sorted(names.items()))
    value = f"{names.total()} on domain {domain}{f': {listed}' if listed else ''}"
    ours = [name for name in names if name.rpartition("/")[2] in NODES and name.count("/") == 1]
    free = next(str(number) for number in range(1, 102) if str(number) != domain)
    if ours:
        why = f"a ride is refused while {', '.join(sorted(ours))} is there"
        return Finding(what, value, CHANGE, why, f"end it, or: export ROS_DOMAIN_ID={free}")
    if names.total() >= MEET:
        why = f"from {MEET} participants on some do not meet"
        return Finding(what, value, CHANGE, why, f"export ROS_DOMAIN_ID={free}")
    if names:
        return Finding(
            what,
            value,
            NOTE,
            "each that comes or goes is work for all others",
            f"if unwanted: export ROS_DOMAIN_ID={free}",
        )
    return Finding(what, value)
