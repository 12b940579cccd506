"""The operator changes the pantograph's pressure during a ride."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")
pytest.importorskip("rclpy")

from rclpy.parameter import Parameter
from rig_ride import rides_of_a_node  # noqa: F401

pytestmark = pytest.mark.integration
LOWERED_AT = 50


def test_uplift_force_is_changed_during_a_ride(ride: Any) -> None:
    found = ride(
        lambda k: (0.0, 0.0),
        **{
            "duration": 0.8,
            "run_in": 0.0,
            "initial_force_share": 1.0,
            "load_cell.noise": 0.0,
            "load_cell.bias": 0.0,
            "contact.damping": 200.0,
        },
    )

    def answer(k: int) -> tuple[float, float]:
        if k == LOWERED_AT:
            assert found.rig.set_parameters([Parameter("uplift_force", value=90.0)])[0].successful
            assert not found.rig.set_parameters([Parameter("uplift_force", value=-1.0)])[0].successful
        return 0.0, 0.0

    found.answer = answer
    found.run()
    force = np.array([s[6] for s in found.states])
    assert force.size == 400
    assert force[: LOWERED_AT + 1] == pytest.approx(120.0, abs=0.1)
    # 30 N in 0.2 s, and the frame's own motion on its springs: no jump, and 90 N less what still swings in the end.
    assert np.abs(np.diff(force)).max() < 3.0 * 30.0 * 0.002 / 0.2
    assert force[-50:].mean() == pytest.approx(90.0, abs=4.0)
