"""Answers to service requests, sent again to a client that cannot hear them yet.

DDS tells a server of a client in two halves: who writes the requests, and who reads the answers. Where the second half
comes late (a node that has just started, a busy machine), or never (a client with a profile that does not fit), the
middleware waits for it, and rclpy keeps the interpreter's lock meanwhile: as long as the writer of answers may block,
100 ms unless a profile says otherwise, 50 cycles of the loop. Then it drops the answer. `this_machine.xml` has it wait
0.2 ms instead, and what was dropped is sent again from here.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterable
from time import monotonic
from typing import Any, NamedTuple

from rclpy.clock import Clock, ClockType

FIRST = 0.01
"""Time in s after which an answer is sent again; it doubles with each time, up to LAST."""
LAST = 0.5
LIMIT = 10.0
"""Time in s after which an answer is given up."""
MOST = 50
"""Answers that wait; an older one goes for each that is more."""
LOST = "failed to send response"
"""What rclpy warns of when a client cannot hear."""


class Waiting(NamedTuple):
    """An answer that its client could not hear."""

    name: str
    send: Callable[[], None]
    due: float
    pause: float
    until: float


class Answers:
    """Sends the answers of a node's services, each until its client has heard it.

    Everything is done by the executor's thread. ``given_up`` counts the answers that nobody heard.
    """

    def __init__(self, node: Any, lost: Callable[[str], None]) -> None:
        """Make ready for services of ``node``; ``lost`` is told of which one an answer was given up."""
        self.given_up = 0
        self._lost = lost
        self._waiting: deque[Waiting] = deque()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(FIRST, self._again, clock=steady, autostart=False)

    def take_over(self, services: Iterable[Any]) -> None:
        """Send what these services answer from here."""
        for service in services:
            # Executors look it up at each request; rclpy has no other way to be told that an answer was lost.
            service.send_response = _Sender(self, service)

    def __len__(self) -> int:
        """Give the number of answers that wait."""
        return len(self._waiting)

    def send(self, name: str, send: Callable[[], None]) -> None:
        """Send an answer of service ``name``, and again later if its client cannot hear it."""
        if not heard(send):
            now = monotonic()
            self._keep(Waiting(name, send, now + FIRST, FIRST, now + LIMIT))

    def _again(self) -> None:
        """Send what is due; in vain once at most: each wait has the interpreter's lock, and many may be due."""
        now = monotonic()
        for _ in range(len(self._waiting)):
            one = self._waiting.popleft()
            if now < one.due:
                self._waiting.append(one)
            elif not heard(one.send):
                if now > one.until:
                    self._give_up(one)
                else:
                    pause = min(2.0 * one.pause, LAST)
                    self._waiting.append(one._replace(due=now + pause, pause=pause))
                break
        if not self._waiting:
            self._timer.cancel()

    def _keep(self, one: Waiting) -> None:
        if len(self._waiting) >= MOST:
            self._give_up(self._waiting.popleft())
        self._waiting.append(one)
        self._timer.reset()

    def _give_up(self, one: Waiting) -> None:
        self.given_up += 1
        self._lost(one.name)


class _Sender:
    """Stands for the `send_response` of one service."""

    def __init__(self, answers: Answers, service: Any) -> None:
        self._answers, self._service, self._plain = answers, service, service.send_response

    def __call__(self, response: Any, header: Any) -> None:
        self._answers.send(self._service.service_name, lambda: self._plain(response, header))


def heard(send: Callable[[], None]) -> bool:
    """Send an answer; tell whether its client could hear it (or had heard this service before, and left)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        send()
    return not any(issubclass(one.category, RuntimeWarning) and LOST in str(one.message) for one in caught)
