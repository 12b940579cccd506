"""What a node answers to requests: it refuses unless it is configured, and no failure leaves it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

QUIET = 1.0
"""Time in s without a cycle after which a ride counts as over."""


def answer(node: Any, name: str, callback: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
    """Answer by ``callback``, with the node's lock held; say why not, if it cannot."""
    if not node.configured:
        return refused(response, f"{node.get_name()} is not configured")
    try:
        with node.lock:
            return callback(request, response)
    except Exception as error:
        node.log.error(f"{name}: {error}")
        return refused(response, str(error) or type(error).__name__)


def reset(node: Any, request: Any, response: Any) -> Any:
    """Bring a node back to its initial state, but not while a ride is going on."""
    if not node.configured:
        return refused(response, f"{node.get_name()} is not configured")
    if node.active and node.timing.idle < QUIET:
        reason = "a ride is going on: end it first (emergency stop, or deactivate test_rig_sim)"
        return refused(response, f"{node.get_name()} was not reset: {reason}")
    try:
        with node.lock:
            node.timing.finish()
            node.timing.clear()
            node.reset()
    except Exception as error:
        return refused(response, str(error))
    response.success, response.message = True, f"{node.get_name()} is back at its initial state"
    return response


def refused(response: Any, reason: str) -> Any:
    """Fill in an answer that says why nothing was done."""
    response.success, response.message = False, reason
    return response
