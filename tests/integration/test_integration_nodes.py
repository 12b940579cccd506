"""Single nodes over real DDS: lifecycle, parameters, services, and what they do with bad messages."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from client import Client

from phil_base.scheduling import ROLES, highest_priority

pytestmark = pytest.mark.integration


class Bench(Client):
    """One node in a process of its own, and a client node in this one."""

    def __init__(self, package: str, environment: dict[str, str], *parameters: str) -> None:
        from ride.lifecycle import Managed

        settings = [word for entry in parameters for word in ("-p", entry)]
        super().__init__(environment, "bench", {package: ["--ros-args", *settings]})
        self.name = package
        self.managed = Managed(self.node, package, self.spin)
        self.managed.wait(60.0)

    def set(self, **values: Any) -> Any:
        return self.set_on(self.name, **values)

    def value(self, key: str) -> str:
        """Give a figure of the node's diagnostics."""
        status = self.status.get(self.name)
        return next((entry.value for entry in status.values if entry.key == key), "") if status else ""


@pytest.fixture
def bench(node_environment) -> Iterator[Callable[..., Bench]]:
    """Start a node alone."""
    made: list[Bench] = []

    def make(package: str, *parameters: str) -> Bench:
        made.append(Bench(package, node_environment, *parameters))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def catenary(bench) -> tuple[Bench, Any, list[Any]]:
    """An active catenary with a publisher of commands and the list of its states."""
    from phil_interfaces.msg import CatenaryState, ImpedanceCommand

    from phil_node.qos import CYCLE
    from ride.lifecycle import ACTIVATE, CONFIGURE

    one = bench("catenary_model")
    states: list[Any] = []
    one.node.create_subscription(CatenaryState, "catenary_model/state", states.append, CYCLE)
    publisher = one.node.create_publisher(ImpedanceCommand, "impedance_mpc/command", CYCLE)
    one.managed.go(CONFIGURE, 180.0)
    one.managed.go(ACTIVATE, 30.0)
    assert one.until(lambda: bool(states) and publisher.get_subscription_count() > 0)
    return one, publisher, states


def command(cycle: int, f_cat: float) -> Any:
    from phil_interfaces.msg import ImpedanceCommand

    return ImpedanceCommand(cycle=cycle, f_tr=f_cat, f_cat=f_cat)


def test_the_catenary_answers_each_command_with_the_next_state(catenary):
    one, publisher, states = catenary
    for cycle in range(5):
        publisher.publish(command(cycle, 100.0))
        assert one.until(lambda wanted=cycle + 1: states[-1].cycle == wanted)
    assert states[-1].w_cat > states[0].w_cat


def test_nan_and_stale_commands_are_refused_counted_and_shown(catenary):
    one, publisher, states = catenary
    for cycle in range(2):
        publisher.publish(command(cycle, 100.0))
        assert one.until(lambda wanted=cycle + 1: states[-1].cycle == wanted)
    publisher.publish(command(2, float("nan")))
    publisher.publish(command(2, float("inf")))
    publisher.publish(command(0, 100.0))
    publisher.publish(command(1, 100.0))  # the last one again: somebody asks for the state once more, not stale
    assert one.until(lambda: one.value("refused") == "2" and one.value("stale") == "1")
    assert max(state.cycle for state in states) == 2
    publisher.publish(command(2, 100.0))
    assert one.until(lambda: states[-1].cycle == 3)


def test_who_kills_the_process_for_topics_costs_viewers_a_gap_and_the_node_nothing(catenary):
    """It is started again with all that it had: the topics are back both ways, and the node has forgotten nothing."""
    one, publisher, states = catenary
    publisher.publish(command(0, 100.0))
    assert one.until(lambda: states[-1].cycle == 1 and one.value("process for topics") != "")
    killed = int(one.value("process for topics"))
    os.kill(killed, signal.SIGKILL)
    assert one.until(lambda: one.value("restarts of it") == "1")
    assert one.value("process for topics") not in ("", str(killed))
    assert one.until(lambda: publisher.get_subscription_count() > 0)
    # The killed one is still counted for a while; the command is sent until the new one hears it.
    assert one.until(lambda: publisher.publish(command(1, 100.0)) or states[-1].cycle == 2)


def test_a_node_that_is_not_active_sees_another_one_of_its_name(bench):
    """What the process for topics counts is read then, too; left unread, it would stand still for want of room."""
    from std_srvs.srv import Trigger

    one = bench("energy_monitor")
    assert one.until(lambda: one.value("process") != "")
    one.node.create_service(Trigger, "energy_monitor/reset", lambda request, response: response)
    assert one.until(lambda: "another node" in one.status["energy_monitor"].message)


def test_the_process_for_topics_ends_with_a_node_that_is_killed(bench):
    one = bench("energy_monitor")
    assert one.until(lambda: one.value("process") != "")
    children = [
        int(word)
        for word in Path(f"/proc/{one.value('process')}/task/{one.value('process')}/children").read_text().split()
    ]
    assert len(children) == 1
    one.processes[0].kill()
    one.processes[0].wait(10.0)
    assert one.until(
        lambda: (
            not Path(f"/proc/{children[0]}/cmdline").exists() or not Path(f"/proc/{children[0]}/cmdline").read_bytes()
        )
    )


def test_parameters_cannot_change_while_active_and_say_so(catenary):
    one, _, _ = catenary
    refused = one.set(spans=5)
    assert not refused.successful
    assert "spans" in refused.reason and "active" in refused.reason


def test_a_transition_that_does_not_exist_is_refused_and_the_node_lives(catenary):
    from ride.lifecycle import CONFIGURE, RideError

    one, publisher, states = catenary
    with pytest.raises(RideError, match="refused to configure"):
        one.managed.go(CONFIGURE, 20.0)
    publisher.publish(command(0, 100.0))
    assert one.until(lambda: states[-1].cycle == 1)


def test_reset_brings_the_catenary_back_to_cycle_0(catenary):
    from std_srvs.srv import Trigger

    one, publisher, states = catenary
    first = states[0]
    for cycle in range(3):
        publisher.publish(command(cycle, 200.0))
        assert one.until(lambda wanted=cycle + 1: states[-1].cycle == wanted)
    refused = one.call(Trigger, "catenary_model/reset", Trigger.Request())
    assert not refused.success and "a ride is going on" in refused.message
    quiet = time.monotonic() + 1.1
    one.until(lambda: time.monotonic() > quiet)
    assert one.call(Trigger, "catenary_model/reset", Trigger.Request()).success
    assert one.until(lambda: states[-1].cycle == 0)
    assert (states[-1].w_cat, states[-1].track_position) == (first.w_cat, first.track_position)


def test_out_of_range_is_refused_in_any_state(bench):
    one = bench("catenary_model")
    assert not one.set(spans=4000).successful
    assert not one.set(boundary="open").successful
    assert one.set(spans=3).successful


def test_emergency_stop_retracts_and_nothing_rearms(bench):
    from phil_interfaces.msg import RigState
    from std_srvs.srv import Trigger

    from phil_node.qos import CYCLE
    from ride.lifecycle import ACTIVATE, CONFIGURE

    one = bench("test_rig_sim", "wait_for_subscribers:=1", "mode:=realtime", "duration:=0.0")
    states: list[Any] = []
    one.node.create_subscription(RigState, "test_rig_sim/state", states.append, CYCLE)
    one.managed.go(CONFIGURE, 180.0)
    one.managed.go(ACTIVATE, 30.0)
    assert one.until(lambda: bool(states))
    assert one.call(Trigger, "test_rig_sim/emergency_stop", Trigger.Request()).success
    assert one.until(lambda: states[-1].mode in (RigState.MODE_RETRACTING, RigState.MODE_STOPPED))
    assert one.until(lambda: "test_rig_sim" in one.status and one.status["test_rig_sim"].level == b"\x02")
    assert "emergency stop" in one.status["test_rig_sim"].message


@pytest.mark.skipif(highest_priority() < ROLES["rig"], reason="SCHED_FIFO is not granted here")
def test_what_takes_turns_with_the_cycle_is_on_its_cpu_and_behind_it(bench):
    """Cycle, publishing and the executor need one lock of Python's: elsewhere they would keep the cycle waiting."""
    from ride.lifecycle import ACTIVATE, CONFIGURE

    one = bench("test_rig_sim", "wait_for_subscribers:=1", "mode:=realtime", "duration:=0.0")
    assert one.set(**{"real_time.scheduling": "fifo"}).successful
    one.managed.go(CONFIGURE, 180.0)
    one.managed.go(ACTIVATE, 30.0)
    (process,) = one.processes
    allowed = os.sched_getaffinity(0)
    last = {max(allowed)}
    wanted = dict.fromkeys((ROLES[role] for role in ("rig", "publish", "serve")), last)
    wanted[ROLES["transport"]] = allowed - last or last
    cpus: dict[int, set[int]] = {}

    def arranged() -> bool:
        """Each thread arranges itself, when it has begun."""
        cpus.clear()
        for task in Path(f"/proc/{process.pid}/task").iterdir():
            with suppress(ProcessLookupError):
                thread = int(task.name)
                cpus.setdefault(os.sched_getparam(thread).sched_priority, set()).update(os.sched_getaffinity(thread))
        return wanted.items() <= cpus.items()

    assert one.until(arranged), (cpus, wanted)
    assert os.sched_getparam(process.pid).sched_priority == ROLES["serve"]  # the executor's thread
