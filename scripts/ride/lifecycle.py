"""Brings lifecycle nodes up and down from outside."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node

CONFIGURE = Transition.TRANSITION_CONFIGURE
ACTIVATE = Transition.TRANSITION_ACTIVATE
DEACTIVATE = Transition.TRANSITION_DEACTIVATE
CLEANUP = Transition.TRANSITION_CLEANUP
SHUTDOWN = {
    "unconfigured": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN,
    "inactive": Transition.TRANSITION_INACTIVE_SHUTDOWN,
    "active": Transition.TRANSITION_ACTIVE_SHUTDOWN,
}
NEXT = {CONFIGURE: "inactive", ACTIVATE: "active", DEACTIVATE: "inactive", CLEANUP: "unconfigured"}


class RideError(RuntimeError):
    """The ride cannot go on; the text says why and what to do."""


class Managed:
    """One lifecycle node; ``spin`` runs the caller's executor for a moment and raises if the ride is over."""

    def __init__(self, node: Node, name: str, spin: Callable[[], None]) -> None:
        self.name = name
        self.state = "unconfigured"
        self._client = node.create_client(ChangeState, f"{name}/change_state")
        self.spin = spin
        self._wanted = 0
        self._pending: Any = None

    def wait(self, seconds: float) -> None:
        """Wait until the node answers.

        Raises
        ------
        RideError
            It does not.
        """
        deadline = time.monotonic() + seconds
        while not self._client.service_is_ready():
            if time.monotonic() > deadline:
                raise RideError(f"{self.name} did not come up within {seconds:g} s")
            self.spin()

    def go(self, transition: int, seconds: float) -> None:
        """Make one transition.

        Raises
        ------
        RideError
            The node refused or did not answer in time.
        """
        self.begin(transition)
        self.end(seconds)

    def begin(self, transition: int) -> None:
        """Ask for one transition; `end` waits for it."""
        self._wanted, self._pending = transition, self._ask(transition)

    def end(self, seconds: float) -> None:
        """Wait for the transition that was begun.

        Raises
        ------
        RideError
            The node refused or did not answer in time.
        """
        if not self._answer(self._pending, seconds):
            raise RideError(f"{self.name} refused to {_VERBS[self._wanted]}")
        self.state = NEXT[self._wanted]

    def shut_down(self, seconds: float) -> None:
        """End the node's process from whatever state it is in."""
        if self._answer(self._ask(SHUTDOWN[self.state]), seconds):
            self.state = "finalized"

    def _ask(self, transition: int) -> Any:
        request = ChangeState.Request()
        request.transition.id = transition
        return self._client.call_async(request)

    def _answer(self, future: Any, seconds: float) -> bool:
        deadline = time.monotonic() + seconds
        while not future.done():
            if time.monotonic() > deadline:
                self._client.remove_pending_request(future)
                raise RideError(f"{self.name} did not answer within {seconds:g} s")
            self.spin()
        return bool(future.result().success)


_VERBS = {CONFIGURE: "configure", ACTIVATE: "activate", DEACTIVATE: "deactivate", CLEANUP: "clean up"}
