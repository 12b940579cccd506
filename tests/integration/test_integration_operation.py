"""What an operator does during a ride, with the real nodes: modes, environments, landing, emergency stop, reset."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from client import Client

pytestmark = pytest.mark.integration

NODES = ("catenary_model", "impedance_mpc", "test_rig_sim")
TS = 0.002


class Console(Client):
    """Catenary, controller and rig in processes of their own, and the operator's client in this one."""

    def __init__(self, environment: dict[str, str], *settings: str) -> None:
        from phil_interfaces.msg import ImpedanceCommand, RigState

        from phil_node.qos import CYCLE
        from ride.lifecycle import ACTIVATE, CONFIGURE, Managed

        words = ["--ros-args", *(word for entry in settings for word in ("-p", entry))]
        super().__init__(environment, "operator", {name: words if name == "test_rig_sim" else [] for name in NODES})
        self.states: list[Any] = []
        self.command: Any = None
        self.node.create_subscription(RigState, "test_rig_sim/state", self._take, CYCLE)
        self.node.create_subscription(ImpedanceCommand, "impedance_mpc/command", self._take_command, CYCLE)
        self.managed = {name: Managed(self.node, name, self.spin) for name in NODES}
        for transition in (CONFIGURE, ACTIVATE):
            for managed in self.managed.values():
                managed.wait(60.0)
                managed.go(transition, 180.0)

    def _take(self, message: Any) -> None:
        if not self.states or message.cycle != self.states[-1].cycle:
            self.states.append(message)

    def _take_command(self, message: Any) -> None:
        self.command = message

    def ask(self, name: str) -> Any:
        """Call a service that needs no more than its name."""
        from std_srvs.srv import Trigger

        return self.call(Trigger, name, Trigger.Request())

    def set(self, node: str, name: str, value: Any) -> bool:
        return bool(self.set_on(node, **{name: value}).successful)

    def wait(self, *modes: int) -> bool:
        """Wait until the rig has been in one of these modes for 50 states from now on."""
        begun = len(self.states)
        return self.until(lambda: len(self.states) >= begun + 50 and all(s.mode in modes for s in self.states[-50:]))


@pytest.fixture
def console(node_environment: dict[str, str]) -> Iterator[Console]:
    made = Console(node_environment, "duration:=0.0", "start:=apart", "touch.speed:=0.1", "touch.acceleration:=2.0")
    yield made
    made.close()


def test_an_operators_day(console: Console) -> None:
    """Two rides with the same nodes: everything in the first, an emergency stop in the second."""
    from phil_interfaces.msg import ImpedanceCommand, RigState

    from ride.lifecycle import ACTIVATE, DEACTIVATE, RideError

    following = (RigState.MODE_TRACKING, RigState.MODE_BRIDGING)
    assert console.wait(*following)
    modes = [s.mode for s in console.states]
    assert modes[0] == RigState.MODE_HOLD and RigState.MODE_APPROACHING in modes
    assert console.set("impedance_mpc", "environment", "mass_spring_damper")
    other = ImpedanceCommand.ENVIRONMENT_MASS_SPRING_DAMPER
    assert console.until(lambda: console.command.environment == other)
    assert console.set("impedance_mpc", "environment", "catenary")
    for name, mode in (("hold", RigState.MODE_HOLD), ("position", RigState.MODE_POSITION)):
        assert console.set("test_rig_sim", "operating_mode", name)
        assert console.wait(mode)
        assert console.until(lambda name=name: f"{name}" in console.status["test_rig_sim"].message)
    assert not console.set("test_rig_sim", "operating_mode", "dance")
    assert console.set("test_rig_sim", "operating_mode", "impedance")
    assert console.wait(*following, RigState.MODE_APPROACHING)
    assert console.ask("test_rig_sim/land").success
    assert console.until(lambda: console.states[-1].last)
    assert console.states[-1].mode == RigState.MODE_STOPPED
    assert console.states[-2].mode == RigState.MODE_LANDING
    assert console.until(lambda: console.status["test_rig_sim"].message.startswith("stopped: landed"))
    assert console.status["test_rig_sim"].level == b"\x00"
    # Own motions: no jump of speed beyond what was allowed (5 m/s^2; the first cycle of each is left out).
    own = (RigState.MODE_HOLD, RigState.MODE_POSITION, RigState.MODE_LANDING)
    compared = 0
    for a, b, c in zip(console.states, console.states[1:], console.states[2:], strict=False):
        if b.cycle == a.cycle + 1 == c.cycle - 1 and b.mode == c.mode and c.mode in own and a.mode == b.mode:
            assert abs(c.reference - 2.0 * b.reference + a.reference) < 5.0 * TS**2 + 1e-12
            compared += 1
    assert compared > 200

    # A landing is forgiven; the others are reset for a ride of their own.
    console.managed["test_rig_sim"].go(DEACTIVATE, 30.0)
    quiet = time.monotonic() + 1.1
    console.until(lambda: time.monotonic() > quiet)
    for name in ("catenary_model", "impedance_mpc"):
        assert console.ask(f"{name}/reset").success
    console.states = []
    console.managed["test_rig_sim"].go(ACTIVATE, 30.0)
    assert console.wait(*following)
    assert console.ask("test_rig_sim/emergency_stop").success
    assert console.until(lambda: console.states[-1].last)
    assert console.states[-1].mode == RigState.MODE_STOPPED
    assert console.states[-2].mode == RigState.MODE_RETRACTING
    # Clear of the pantograph at the safe position, and it says why.
    assert console.states[-1].w_tr == pytest.approx(0.2, abs=1e-3)
    assert console.until(lambda: console.status["test_rig_sim"].message == "stopped: emergency stop")
    assert not console.ask("test_rig_sim/land").success
    # Nothing re-arms: neither mode nor activation, only the reset.
    assert console.set("test_rig_sim", "operating_mode", "position")
    console.managed["test_rig_sim"].go(DEACTIVATE, 30.0)
    with pytest.raises(RideError, match="refused to activate"):
        console.managed["test_rig_sim"].go(ACTIVATE, 30.0)
    rest = len(console.states)
    assert console.ask("test_rig_sim/reset").success
    assert len(console.states) == rest
    console.managed["test_rig_sim"].go(ACTIVATE, 30.0)
    assert console.until(lambda: console.states[-1].cycle == 0)
