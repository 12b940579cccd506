"""The node's callbacks with messages that have to be refused; no executor, no middleware traffic."""

from importlib.util import find_spec

import pytest

if find_spec("rclpy") is None or find_spec("phil_interfaces") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

from phil_interfaces.msg import CatenaryState, ConservedQuantities, CycleTiming, ImpedanceCommand, RigState
from rclpy.serialization import deserialize_message

from energy_monitor.audit import Audit
from energy_monitor.listening import DEPTH
from energy_monitor.node import DEEP, INPUTS, MonitorNode
from energy_monitor.parameters import Parameters
from phil_base.parameters import build, defaults
from phil_node.cdr import Plan
from phil_node.qos import CYCLE, CYCLE_KEPT
from phil_node.timing import Timing

NAN, INF = float("nan"), float("inf")


class Wired(MonitorNode):
    """The node's own code without the ROS node below it."""

    active = True

    def __init__(self):
        self.__dict__["timing"] = Timing()
        self.__dict__["parameters"] = build(Parameters, defaults("energy_monitor"))
        self._audit = Audit(self.parameters, self.timing.refuse)
        self.timing.inputs = dict(zip(INPUTS, self._audit.matcher.counts, strict=True))
        self._initial = None
        self._books = []
        self._clear()

    parameters = None

    def _publish_books(self, cycle, header):
        self._books.append(cycle)

    def _publish_quality(self, cycle, header):
        pass


def cycle(node, k):
    node._on_catenary(CatenaryState(cycle=k, v_cat=0.1, f_cat=99.0, work=0.5 * k, impulse=0.25 * k, speed=50.0))
    node._on_rig(RigState(cycle=k, mode=int(k > 0), f_tr=100.0, v_tr=0.1, work=0.75 * k, impulse=0.125 * k))
    node._on_command(ImpedanceCommand(cycle=k, f_tr=100.0, f_predicted=98.0, f_cor=1.0, f_cat=99.0))


BAD = [
    *(("_on_catenary", CatenaryState, {name: NAN}) for name in ("w_cat", "v_cat", "f_cat", "work", "impulse", "speed")),
    ("_on_catenary", CatenaryState, {"w_cat": INF}),
    *(("_on_rig", RigState, {name: NAN}) for name in ("w_tr", "v_tr", "f_tr", "work", "impulse")),
    *(("_on_command", ImpedanceCommand, {name: NAN}) for name in ("f_tr", "f_predicted", "f_cor", "f_cat")),
    *(
        ("_on_believed", ConservedQuantities, {name: NAN})
        for name in ("delta_e", "delta_work", "work_cat", "exchanged_energy")
    ),
]


@pytest.mark.parametrize(("callback", "kind", "values"), BAD)
@pytest.mark.parametrize("at", [0, 3])
def test_what_is_not_finite_is_refused_and_leaves_its_place_free(callback, kind, values, at):
    node = Wired()
    for k in range(6):
        if k == at:
            getattr(node, callback)(kind(cycle=k, **values))
            assert node.timing.refused == 1
        cycle(node, k)
    assert node._audit.matcher.complete == 6
    assert node._audit.matcher.duplicates == 0
    assert node._audit.refused == node.timing.refused == 1
    (said,) = node.timing.refusals
    assert f" {at} " in f"{said} " and said.endswith(f" was refused: {next(iter(values))} is not finite")
    assert node._audit.trace.broken == 0
    # Five of six cycles: the rig does not follow in cycle 0.
    assert node._audit.books.e_tr == pytest.approx(5 * 0.002 * 100.0 * 0.1, rel=1e-12)
    assert node._audit.books.e_cat == pytest.approx(5 * 0.002 * 99.0 * 0.1, rel=1e-12)
    assert node._audit.books.accumulated == (5 * 0.75, 5 * 0.5, 5 * 0.125, 5 * 0.25)
    assert node._initial.v_cat == 0.1  # the refused initial state is not kept for the next ride


def test_a_message_far_ahead_is_refused_with_the_limit_and_ends_no_ride():
    node = Wired()
    cycle(node, 0)
    for k in (5000, 9000):
        cycle(node, k)
        node._on_believed(ConservedQuantities(cycle=k))
    assert node.timing.refusals == [
        "state 5000 of the catenary was refused: more than 1000 cycles ahead of 1",
        "state 5000 of the rig was refused: more than 1000 cycles ahead of 1",
        "command 5000 was refused: more than 1000 cycles ahead of 1",
        "the controller's entry 5000 was refused: more than 1000 cycles ahead of 1",
    ]
    node.timing._ended -= 2 * 10**11  # that long ago
    node.timing._refused_since -= 10**11
    assert node.timing.stuck and not node.stuck()


def test_the_controller_s_books_are_held_against_both_of_the_monitor():
    for field, value, agrees in (("delta_work", 1.25, True), ("delta_work", 1.24, False), ("delta_e", 0.01, False)):
        node = Wired()
        for k in range(6):
            cycle(node, k)
        own = node._audit.entry(5)
        node._audit.agreement.ours(own)
        believed = ConservedQuantities(
            cycle=5, delta_e=own.delta_e, delta_p=own.delta_p, work_tr=3.75, work_cat=2.5, delta_work=own.delta_work,
            impulse_tr=0.625, impulse_cat=1.25, exchanged_energy=own.exchanged_energy,
            exchanged_momentum=own.exchanged_momentum,
        )  # fmt: skip
        setattr(believed, field, value)
        node._on_believed(believed)
        assert node._audit.agreement.compared == 1
        assert node._audit.agreement.agrees is agrees


def test_both_books_are_published():
    node, sent = Wired(), []
    node._books_out = type("Sink", (), {"publish": staticmethod(sent.append)})
    node._books_message = Plan(ConservedQuantities, "rig").writer().message
    for k in range(3):
        cycle(node, k)
    MonitorNode._publish_books(node, 2, RigState().header)
    message = deserialize_message(sent[0].writer.bytes(), ConservedQuantities)
    assert (message.cycle, message.work_tr, message.work_cat, message.delta_work) == (2, 1.5, 1.0, 0.5)
    assert (message.impulse_tr, message.impulse_cat) == (0.25, 0.5)
    assert message.delta_p == pytest.approx(2 * 0.002 * 1.0, rel=1e-12)


def test_an_absurd_cycle_number_is_refused_on_every_topic():
    node = Wired()
    for k in range(20):
        if k == 10:
            node._on_rig(RigState(cycle=10**9, f_tr=1.0, last=True))
            node._on_catenary(CatenaryState(cycle=2**64 - 1, speed=1.0))
            node._on_command(ImpedanceCommand(cycle=10**9))
            node._on_believed(ConservedQuantities(cycle=10**9))
        cycle(node, k)
    assert node.timing.refused == 4
    assert node._audit.matcher.complete == 20 and not node._audit.matcher.finished
    assert node._audit.matcher.missing == [0, 0, 0]
    assert node._speed == 50.0


def test_the_queues_are_deep():
    """On both sides: a writer forgets what is older than its own queue, acknowledged or not."""
    assert DEEP.depth == CYCLE.depth == CYCLE_KEPT.depth == DEPTH == 5000


def test_a_node_that_was_held_up_loses_nothing():
    """All that waited comes topic by topic, the controller's books first."""
    node, late = Wired(), 2000
    node.timing.connect(CycleTiming(), lambda message: None, 0.002)
    for k in range(10, late, 10):
        node._on_believed(ConservedQuantities(cycle=k))
    for k in range(late):
        node._on_rig(RigState(cycle=k, mode=0, f_tr=100.0))
    for k in range(late):
        node._on_command(ImpedanceCommand(cycle=k, f_tr=100.0, f_predicted=98.0, f_cor=1.0, f_cat=99.0))
    for k in range(late):
        node._on_catenary(CatenaryState(cycle=k, f_cat=99.0 if k else 0.0, speed=50.0))
    matcher = node._audit.matcher
    assert (matcher.complete, matcher.missing, node._audit.refused) == (late, [0, 0, 0], 0)
    assert node._books == list(range(0, late, 10))
    assert node._audit.agreement.compared == late // 10 - 1
    assert node._audit.complaints(0.0, 1.0) == []


def test_late_lost_doubled_and_swapped_messages_are_counted_by_topic():
    node, window = Wired(), build(Parameters, defaults("energy_monitor")).window
    node.timing.connect(CycleTiming(), lambda message: None, 0.002)
    count = window + 40
    for k in range(count):
        node._on_catenary(CatenaryState(cycle=k, speed=50.0))
        if k not in (10, 20):
            node._on_command(ImpedanceCommand(cycle=k))
        node._on_rig(RigState(cycle={30: 31, 31: 30}.get(k, k), f_tr=100.0))
    assert node._audit.matcher.missing == [0, 2, 0]
    node._on_command(ImpedanceCommand(cycle=10))  # given up: the books are beyond it
    node._on_command(ImpedanceCommand(cycle=5))
    node._on_catenary(CatenaryState(cycle=count - 1, speed=50.0))
    figures = node.timing.summary()
    assert {key: value for key, value in figures.items() if key.startswith("input")} == {
        "input test_rig_sim/state": "late 0, lost 0, doubled 0, swapped 1",
        "input impedance_mpc/command": "late 1, lost 1, doubled 1, swapped 1",
        "input catenary_model/state": "late 0, lost 0, doubled 1, swapped 0",
    }
    matcher = node._audit.matcher
    assert (matcher.duplicates, matcher.out_of_order, matcher.stale) == (2, 1, 1)
    node.start()
    assert node.timing.summary()["input impedance_mpc/command"] == "late 0, lost 0, doubled 0, swapped 0"
