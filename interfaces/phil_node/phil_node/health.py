"""How a node is: what its own `diagnose` says, and what is the same for all nodes."""

from __future__ import annotations

import os
from typing import Any

from phil_node.diagnosis import ERROR, STALE, WARN, Diagnosis, Reporter


class Health:
    """Looks at a node and tells how it is, on /diagnostics and to who asks.

    ``failure`` is what went wrong in the last transition, empty if nothing did.
    """

    def __init__(self, node: Any) -> None:
        self.failure = ""
        self._node = node
        self._clock_missed = False
        self._reporter = Reporter(node.full_name, node.wires.say, self.diagnosis, self.signs, node.ride_time)
        self.look = self._reporter.look

    def signs(self) -> tuple[object, ...]:
        """Give what the level hangs on, cheaply: a change of it is told at once."""
        node = self._node
        timing, state = node.timing, (node.active, node.configured, self.failure)
        if not node.active:
            return state
        counted = bool(timing.late), bool(timing.missing), len(timing.refusals)
        return (*state, *counted, len(node.wires.contested()), node.stuck(), bool(node.silence()), *node.signs())

    def diagnosis(self) -> Diagnosis:
        """Say how the node is."""
        node, timing = self._node, self._node.timing
        if node.active:
            found: Diagnosis = node.diagnose()
            if node.stuck() and found.level != ERROR:
                found.level, found.message = ERROR, f"cannot go on: {'; '.join(timing.refusals)}"
            elif silence := node.silence():
                found.add(STALE, silence)
        else:
            found = Diagnosis(message="configured" if node.configured else "unconfigured")
        if self.failure:
            found.add(WARN, self.failure)
        for topic in node.wires.contested():
            found.add(WARN, f"{topic} has a second publisher: end it")
        if node.wires.namesakes() > 1:
            found.add(WARN, f"another node on this ROS domain is called {node.full_name}, too: end one of them")
        own = {
            "process": str(os.getpid()),
            "answers that nobody heard": str(node.answers.given_up),
            **node.granted.figures,
            **node.wires.figures(),
        }
        if self._misses_clock():
            own["clock"] = "the system's: use_sim_time is set, but nothing came on /clock"
        counts = {"late": timing.late, "missing": timing.missing, "stale": timing.stale, "refused": timing.refused}
        last = {"last incident s ago": self._reporter.since_last(**counts)}
        found.values = {**own, **timing.summary(), **last, **found.values}
        return found

    def _misses_clock(self) -> bool:
        """Tell whether use_sim_time is set without a /clock, and say it once in the log."""
        clock = self._node.get_clock()
        missing = bool(clock.ros_time_is_active) and clock.now().nanoseconds == 0
        if missing and not self._clock_missed and self._node.active:
            self._clock_missed = True
            self._node.log.warning("use_sim_time is set, but nothing came on /clock: going on by the system's clock")
        return missing
