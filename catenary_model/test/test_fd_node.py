"""The node with finite differences: parameters, messages equal to the model's bits, repeated rides."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("phil_interfaces.msg")

from rclpy.parameter import Parameter  # noqa: E402
from test_catenary_node import Partner, partner  # noqa: E402, F401

from catenary_model.build import build  # noqa: E402
from catenary_model.finite_difference import Catenary  # noqa: E402
from catenary_model.parameters import Parameters  # noqa: E402
from phil_base.parameters import ParameterError, defaults  # noqa: E402
from phil_base.parameters import build as read  # noqa: E402

FD = {"discretisation": "fd", "grid_boundary": "one_way"}


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("PHIL_CACHE", str(tmp_path))
    yield


@pytest.mark.slow
def test_the_node_sends_the_bits_of_the_model(partner: Partner) -> None:  # noqa: F811
    node = partner.node
    assert all(r.successful for r in node.set_parameters([Parameter(name, value=given) for name, given in FD.items()]))
    partner.activate()
    assert isinstance(node.catenary, Catenary)
    model = build(node.parameters.config())
    for k in range(40):
        force = 100.0 + 2.0 * k
        partner.command(k, force)
        partner.until(lambda k=k: partner.states[-1].cycle == k + 1)  # type: ignore[misc]
        model.step(force)
        state = partner.states[-1]
        assert (state.w_cat, state.v_cat, state.a_cat, state.f_cat) == (model.w_cat, model.v_cat, model.a_cat, force)
        assert (state.work, state.impulse) == (model.work, model.impulse)
        np.testing.assert_array_equal(state.segment_force, model.segment_force)
        np.testing.assert_array_equal(state.segment_acceleration, model.segment_acceleration)
    assert state.droppers == model.droppers > 36
    partner.until(lambda: bool(partner.models))
    assert partner.models[0].local_compliance == model.local_compliance > 0.0
    partner.until(lambda: len(partner.shapes) == 3)
    np.testing.assert_array_equal(partner.shapes[-1].contact, model.wire_shape().contact)
    found = node.diagnose()
    assert found.level == b"\x00"
    assert found.values["discretisation"] == "fd"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"discretisation": "fd", "boundary": "controlled"}, "boundary = controlled belongs to discretisation 'fe'"),
        ({"grid_substeps": 3}, "grid_substeps = 3 belongs to discretisation 'fd'"),
        ({"discretisation": "fd", "cycle_time": 0.004}, "grid_substeps = 2 ms.*unstable"),
        ({"discretisation": "spectral"}, "discretisation"),
    ],
)
def test_parameters_that_do_not_fit_together_are_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        read(Parameters, defaults("catenary_model") | given)
