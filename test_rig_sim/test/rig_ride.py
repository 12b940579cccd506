"""A rig node in this process and a partner that plays the impedance controller."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")
rclpy = pytest.importorskip("rclpy")

from phil_interfaces.msg import ImpedanceCommand, RigState  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402

from phil_node.qos import CYCLE  # noqa: E402
from test_rig_sim.node import ENDED, RigNode  # noqa: E402

CYCLES = 60
Answer = Callable[[int], tuple[float, float] | None]


def sine(k: int) -> tuple[float, float]:
    return 0.01 * math.sin(0.02 * k), 0.01 * math.sin(0.02 * (k + 1))


def after(seconds: float) -> Callable[[], bool]:
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


class Ride:
    """A rig node and its partner; `answer(k)` gives the command of cycle k or None for silence."""

    def __init__(self, answer: Answer) -> None:
        self.answer = answer
        self.states: list[tuple[Any, ...]] = []
        self.rig = RigNode()
        self.partner = Node("partner")
        self.commands = self.partner.create_publisher(ImpedanceCommand, "impedance_mpc/command", CYCLE)
        self.partner.create_subscription(RigState, "test_rig_sim/state", self._take, CYCLE)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.rig)
        self.executor.add_node(self.partner)

    def _take(self, m: RigState) -> None:
        stamp = (m.header.stamp.sec, m.header.stamp.nanosec)
        if not self.states or m.cycle != self.states[-1][0]:
            w, v, f = m.w_tr, m.v_tr, m.f_tr
            self.states.append((m.cycle, m.mode, m.last, stamp, w, v, f, m.work, m.late_commands, m.reference))
        self.send(m.cycle, m.header)

    def send(self, k: int, header: Any) -> None:
        u = self.answer(k)
        if u is not None:
            command = ImpedanceCommand(cycle=k, u_tr=u[0], u_tr_next=u[1])
            command.header = header
            self.commands.publish(command)

    def run(self, spins: int = 4000, until: Callable[[], bool] | None = None) -> None:
        self.rig.trigger_configure()
        self.rig.trigger_activate()
        self.spin(spins, until)

    def spin(self, spins: int = 4000, until: Callable[[], bool] | None = None) -> None:
        for _ in range(spins):
            self.executor.spin_once(timeout_sec=0.05)
            if self._over() if until is None else until():
                break

    def _over(self) -> bool:
        """Tell whether the ride has ended, and the partner has heard so: it may hear later."""
        return bool(self.rig._phase == ENDED and self.states and self.states[-1][2])

    def close(self) -> None:
        self.rig.trigger_deactivate()
        self.rig.trigger_cleanup()
        self.executor.shutdown()
        self.rig.destroy_node()
        self.partner.destroy_node()


@pytest.fixture(name="ride")
def rides_of_a_node(request: pytest.FixtureRequest) -> Iterator[Callable[..., Ride]]:
    rides: list[Ride] = []

    def make(answer: Answer, **parameters: Any) -> Ride:
        if rclpy.ok():
            rclpy.shutdown()
        values = {"duration": CYCLES * 0.002, "wait_for_subscribers": 1, **parameters}
        arguments = [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]
        rclpy.init(args=["--ros-args", *arguments])
        rides.append(Ride(answer))
        return rides[-1]

    yield make
    for found in rides:
        if found.rig.context.ok():
            found.close()
    rclpy.try_shutdown()
