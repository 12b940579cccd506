"""The node between two made-up partners in one process: order, repetition, gaps, refusals, services."""

import array
import os
import time
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("phil_interfaces.msg")

from impedance_loop import TS, MassSpringDamper  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402
from phil_interfaces.msg import (  # noqa: E402
    CatenaryState,
    ConservedQuantities,
    ImpedanceCommand,
    ImpedanceModel,
    RigState,
)
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from impedance_mpc.asking import EAGER, LONGEST  # noqa: E402
from impedance_mpc.node import ImpedanceNode  # noqa: E402
from phil_node.qos import CYCLE, LATCHED  # noqa: E402


def doubles(values):
    return array.array("d", values)


def model_message(ts=TS):
    model = MassSpringDamper().impedance
    return ImpedanceModel(
        n=1,
        ts=ts,
        newmark_beta=0.25,
        newmark_gamma=0.5,
        mass=doubles(model.mass.ravel()),
        damping=doubles(model.damping.ravel()),
        stiffness=doubles(model.stiffness.ravel()),
        input=doubles(model.input),
        output=doubles(model.output),
    )


def rig_state(k, **changes):
    message = RigState(cycle=k, f_tr=50.0 + k, v_tr=0.1, **{"mode": RigState.MODE_TRACKING, **changes})
    message.header.stamp.nanosec = 2_000_000 * k
    return message


def catenary_state(k, n=1, w=0.0):
    zeros = doubles([0.0] * n)
    return CatenaryState(
        cycle=k,
        w_cat=w,
        segment_displacement=zeros,
        segment_velocity=zeros,
        segment_acceleration=zeros,
        segment_force=zeros,
    )


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(domain_id=int(os.environ["PHIL_TEST_DOMAIN_CONTROLLER"]))
    executor = SingleThreadedExecutor()
    partner = rclpy.create_node("partner")
    node = ImpedanceNode()
    executor.add_node(partner)
    executor.add_node(node)
    commands, books = [], []
    partner.create_subscription(ImpedanceCommand, "impedance_mpc/command", commands.append, CYCLE)
    partner.create_subscription(ConservedQuantities, "impedance_mpc/conserved_quantities", books.append, CYCLE)
    rig = partner.create_publisher(RigState, "test_rig_sim/state", CYCLE)
    catenary = partner.create_publisher(CatenaryState, "catenary_model/state", CYCLE)
    latched = partner.create_publisher(ImpedanceModel, "catenary_model/impedance_model", LATCHED)

    def spin(until=lambda: False, seconds=0.3):
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            executor.spin_once(timeout_sec=0.02)

    def go(configure=True):
        if configure:
            latched.publish(model_message())
        assert node.trigger_configure().value == Transition.TRANSITION_CALLBACK_SUCCESS
        assert node.trigger_activate().value == Transition.TRANSITION_CALLBACK_SUCCESS
        spin(lambda: rig.get_subscription_count() and catenary.get_subscription_count(), 5.0)
        spin(lambda: node.count_publishers("test_rig_sim/state") and node.commands.get_subscription_count(), 5.0)

    yield SimpleNamespace(
        node=node, partner=partner, rig=rig, catenary=catenary, latched=latched, commands=commands, books=books,
        spin=spin, go=go,
    )  # fmt: skip
    executor.shutdown()
    node.destroy_node()
    partner.destroy_node()
    rclpy.shutdown()


def ask(bench, kind, name, request):
    client = bench.partner.create_client(kind, name)
    future = client.call_async(request)
    bench.spin(future.done, 5.0)
    return future.result()


@pytest.mark.slow
def test_cycles_are_answered_in_order_and_the_last_one_again(bench):
    bench.go()
    for k in range(12):
        bench.rig.publish(rig_state(k, last=k == 11))
        bench.catenary.publish(catenary_state(k))
    bench.spin(lambda: len(bench.commands) == 12 and len(bench.books) == 2, 5.0)
    assert [c.cycle for c in bench.commands] == list(range(12))
    assert [c.f_tr for c in bench.commands] == [50.0 + k for k in range(12)]
    assert [c.header.stamp.nanosec for c in bench.commands] == [2_000_000 * k for k in range(12)]
    assert [b.cycle for b in bench.books] == [0, 10]
    assert bench.books[1].p_tr == pytest.approx(sum(TS * (50.0 + k) for k in range(11)))
    bench.rig.publish(rig_state(11))
    bench.rig.publish(rig_state(3))
    bench.spin(lambda: len(bench.commands) == 13, 5.0)
    bench.spin(seconds=0.1)
    assert len(bench.commands) == 13
    assert bench.commands[-1] == bench.commands[-2]
    assert bench.node.timing.stale == 1


def test_a_wires_state_that_cannot_be_used_is_asked_for_again_at_once_and_once(bench):
    bench.go()
    bench.rig.publish(rig_state(0))
    bench.catenary.publish(catenary_state(0))
    bench.spin(lambda: len(bench.commands) == 1, 5.0)
    for _ in range(3):
        bench.catenary.publish(catenary_state(1, w=float("inf")))
    bench.catenary.publish(catenary_state(5, w=float("nan")))
    bench.spin(lambda: bench.node.timing.refused == 4, 5.0)
    bench.spin(seconds=0.1)
    assert [c.cycle for c in bench.commands] == [0, 0]
    assert bench.commands[0] == bench.commands[1]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_a_command_is_sent_again_once_the_rig_goes_on_without_it(bench, mode):
    """In real time alone: in lockstep the rig waits, and a machine that is slow is no reason to say anything twice."""
    bench.node.set_parameters([Parameter("mode", value=mode)])
    bench.go()
    bench.rig.publish(rig_state(0))
    bench.catenary.publish(catenary_state(0))
    bench.spin(lambda: len(bench.commands) == 1, 5.0)
    bench.spin(seconds=0.1)
    assert len(bench.commands) == 1  # the rig's next state is to come first
    begun = time.monotonic()
    for k in range(1, 61):
        bench.rig.publish(rig_state(k))
        bench.spin(seconds=0.01)
    bench.spin(seconds=0.3)
    again = bench.commands[1:]
    assert all(command == bench.commands[0] for command in again)
    if mode == "lockstep":
        assert not again
    else:
        # With each state of the rig, then after 3, 6, 12, ... 192 ms, then each 250 ms.
        assert EAGER < len(again) <= EAGER + 8 + (time.monotonic() - begun) / LONGEST
    bench.spin(seconds=0.6)
    assert len(bench.commands) == 1 + len(again)  # the rig rests: who comes back now hears nothing of this ride
    bench.catenary.publish(catenary_state(1))
    bench.spin(lambda: bench.commands[-1].cycle == 1, 5.0)
    number = len(bench.commands)
    bench.spin(seconds=0.1)
    assert len(bench.commands) == number


def test_bad_numbers_are_refused_and_a_gap_is_bridged(bench):
    bench.go()
    bench.catenary.publish(catenary_state(0, n=3))
    bench.rig.publish(rig_state(0, w_tr=float("nan")))
    bench.catenary.publish(catenary_state(0, w=float("inf")))
    bench.spin(lambda: bench.node.timing.refused == 3, 5.0)
    assert bench.node.timing.refused == 3
    assert bench.commands == []
    bench.catenary.publish(catenary_state(0))
    bench.rig.publish(rig_state(0))
    bench.spin(lambda: len(bench.commands) == 1, 5.0)
    bench.catenary.publish(catenary_state(1))
    bench.rig.publish(rig_state(4))
    bench.rig.publish(rig_state(5))  # the rig has gone on: what lies between is lost
    bench.spin(lambda: len(bench.commands) == 2, 5.0)
    assert [c.cycle for c in bench.commands] == [0, 4]
    assert bench.node.timing.missing == 3


def test_late_lost_doubled_and_swapped_states_are_counted(bench):
    """The policy of each: lost and late cycles have no command, doubled ones the same again, swapped ones in order."""
    bench.go()
    node, sent = bench.node, []
    node.commands = SimpleNamespace(publish=lambda command: sent.append(command.cycle))

    def take(states):
        del sent[:]
        for sender, *number in states.split():
            k = int("".join(number))
            node._take_rig(rig_state(k)) if sender == "r" else node._take_catenary(catenary_state(k))
        return list(sent)

    assert take("r0 c0 r1 c1 r2 c2") == [0, 1, 2]
    assert take("r2 c2 r1 c1") == [2]
    assert take("r4 c3 r3 c4 r5 c5") == [3, 4, 5]
    assert take("r8 r9 c6") == [8]  # 6 and 7 are lost: the wire's next state is all there is
    assert take("r7 c7 c8 c9") == [9]  # what the wire bridged comes behind
    found = node.health.diagnosis().values
    assert found["input test_rig_sim/state"] == "late 1, lost 1, doubled 2, swapped 2"
    assert found["input catenary_model/state"] == "late 2, lost 0, doubled 2, swapped 0"
    kinds = ("late", "lost", "doubled", "swapped")
    assert [found[f"messages {kind}"] for kind in kinds] == ["3", "1", "4", "2"]
    node.reset()
    assert node.health.diagnosis().values["input test_rig_sim/state"] == "late 0, lost 0, doubled 0, swapped 0"


def test_reset_starts_at_cycle_zero_and_correction_is_switched_by_service(bench):
    bench.go()

    def cycle(k, count):
        bench.rig.publish(rig_state(k))
        bench.catenary.publish(catenary_state(k))
        bench.spin(lambda: len(bench.commands) == count, 5.0)

    cycle(0, 1)
    cycle(1, 2)
    answer = ask(bench, SetBool, "impedance_mpc/set_correction", SetBool.Request(data=False))
    assert answer.success
    assert bench.node.get_parameter("control").value == "integrated"
    cycle(2, 3)
    assert bench.commands[-1].correction == ImpedanceCommand.CORRECTION_OFF
    assert ask(bench, SetBool, "impedance_mpc/set_correction", SetBool.Request(data=True)).success
    refused = ask(bench, Trigger, "impedance_mpc/reset", Trigger.Request())
    assert not refused.success and "a ride is going on" in refused.message
    bench.spin(seconds=1.1)
    assert ask(bench, Trigger, "impedance_mpc/reset", Trigger.Request()).success
    cycle(0, 4)
    assert bench.commands[-1].cycle == 0
    assert bench.commands[-1].u_tr == bench.commands[0].u_tr


def test_without_a_model_configure_fails_and_a_later_one_is_taken(bench):
    bench.node.set_parameters([rclpy.Parameter("model_timeout", value=0.3)])
    assert bench.node.trigger_configure().value == Transition.TRANSITION_CALLBACK_FAILURE
    bench.latched.publish(model_message(ts=0.004))
    bench.spin(seconds=0.1)
    bench.node.set_parameters([rclpy.Parameter("model_timeout", value=5.0)])
    assert bench.node.trigger_configure().value == Transition.TRANSITION_CALLBACK_FAILURE
    bench.latched.publish(model_message())
    bench.spin(seconds=0.1)
    bench.go(configure=False)


def test_environment_is_switched_by_parameter_and_the_catenary_keeps_the_contact_force(bench):
    bench.go()

    def cycle(k, **changes):
        bench.rig.publish(rig_state(k, **changes))
        bench.catenary.publish(catenary_state(k, w=0.03))
        bench.spin(lambda: len(bench.commands) == k + 1, 5.0)
        return bench.commands[-1]

    assert cycle(0).environment == ImpedanceCommand.ENVIRONMENT_CATENARY
    assert bench.commands[-1].w_env == 0.03
    refused = bench.node.set_parameters([rclpy.Parameter("environment", value="jelly")])[0]
    assert not refused.successful and "mass_spring_damper" in refused.reason
    chosen = rclpy.Parameter("environment", value="mass_spring_damper")
    assert bench.node.set_parameters([chosen])[0].successful
    first = cycle(1)
    assert first.environment == ImpedanceCommand.ENVIRONMENT_MASS_SPRING_DAMPER
    assert (first.w_env, first.v_env) == (0.03, 0.0)  # it begins where the wire is
    for k in range(2, 20):
        last = cycle(k)
    assert abs(last.w_env - 0.03) > 1e-5  # and goes on by itself: the wire stands at 0.03
    assert last.f_cat == last.f_predicted
    assert bench.node.diagnose().values["environment"] == "mass_spring_damper"


def test_a_rig_that_does_not_follow_is_not_booked(bench):
    bench.go()
    modes = [RigState.MODE_HOLD, RigState.MODE_TRACKING, RigState.MODE_BRIDGING, RigState.MODE_HOLDING]
    modes += [RigState.MODE_POSITION, RigState.MODE_APPROACHING, RigState.MODE_LANDING, RigState.MODE_RETRACTING]
    for k, mode in enumerate([*modes, RigState.MODE_STOPPED, RigState.MODE_TRACKING, RigState.MODE_HOLD]):
        bench.rig.publish(rig_state(k, mode=mode))
        bench.catenary.publish(catenary_state(k))
    bench.spin(lambda: len(bench.commands) == 11 and len(bench.books) == 2, 5.0)
    assert bench.books[1].p_tr == pytest.approx(sum(TS * (50.0 + k) for k in (1, 2, 3, 9)))
    assert all(c.f_cor == 0.0 for c, k in zip(bench.commands, range(11), strict=True) if k not in (1, 2, 3, 9))
