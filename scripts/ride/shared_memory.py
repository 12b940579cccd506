"""Shared memory that the middleware leaves behind when a process is killed: what a ride removes before and after."""

from phil_node.shared_memory import litter, remove_litter, snapshot

__all__ = ["litter", "remove_litter", "snapshot"]
