"""The node's callbacks with messages that have to be refused; no executor, no middleware traffic."""

from importlib.util import find_spec

import pytest

if find_spec("rclpy") is None or find_spec("phil_interfaces") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

from phil_interfaces.msg import CatenaryState, ConservedQuantities, ImpedanceCommand, RigState

from energy_monitor.audit import Audit
from energy_monitor.node import DEEP, MonitorNode
from energy_monitor.parameters import Parameters
from phil_node.parameters import build, defaults
from phil_node.timing import Timing

NAN, INF = float("nan"), float("inf")


class Wired(MonitorNode):
    """The node's own code without the ROS node below it."""

    active = True

    def __init__(self):
        self.__dict__["timing"] = Timing()
        self.__dict__["parameters"] = build(Parameters, defaults("energy_monitor"))
        self._audit = Audit(self.parameters)
        self._initial = None
        self._books = []
        self._clear()

    parameters = None

    def _publish_books(self, cycle, header):
        self._books.append(cycle)

    def _publish_quality(self, cycle, header):
        pass


def cycle(node, k):
    node._on_catenary(CatenaryState(cycle=k, v_cat=0.1, f_cat=100.0 if k else 0.0, speed=50.0))
    node._on_rig(RigState(cycle=k, f_tr=100.0, v_tr=0.1))
    node._on_command(ImpedanceCommand(cycle=k, f_tr=100.0, f_cat=100.0))


BAD = [
    *(("_on_catenary", CatenaryState, {name: NAN}) for name in ("w_cat", "v_cat", "f_cat", "speed")),
    ("_on_catenary", CatenaryState, {"w_cat": INF}),
    *(("_on_rig", RigState, {name: NAN}) for name in ("w_tr", "v_tr", "f_tr", "work")),
    *(("_on_command", ImpedanceCommand, {name: NAN}) for name in ("f_tr", "f_cor", "f_cat")),
    *(("_on_believed", ConservedQuantities, {name: NAN}) for name in ("delta_e", "exchanged_energy")),
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
    assert node._audit.books.e_tr == pytest.approx(6 * 0.002 * 100.0 * 0.1, rel=1e-12)
    assert node._initial.v_cat == 0.1  # the refused initial state is not kept for the next ride


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
    assert DEEP.depth == 5000
