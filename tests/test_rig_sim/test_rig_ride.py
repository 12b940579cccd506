"""The rig as a whole: static contact, run-in, load cell, determinism."""

import math
from typing import Any

import numpy as np
import pytest

from test_rig_sim.load_cell import encode, filter_step, group_delay, load_cell, settle
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.rig import Rig, RigSample


def samples(rig: Rig, cycles: int) -> list[RigSample]:
    found = [rig.state]
    for _ in range(cycles):
        rig.advance(0.0, 0.0)
        found.append(rig.state)
    return found


@pytest.mark.parametrize("name", PANTOGRAPHS)
@pytest.mark.parametrize("force", [70.0, 120.0, 180.0])
def test_mean_contact_force_of_a_resting_drive_is_the_uplift_force(
    rig_parameters: Any, name: str, force: float
) -> None:
    # 0.5 N of noise, low-passed, over 500 correlated samples: 0.02 N; 0.2 N leaves room for the hardly damped
    # upper modes of the three-mass pantograph.
    rig = Rig(rig_parameters({"pantograph": name, "uplift_force": force}))
    for _ in range(1500):
        rig.advance(0.0, 0.0)
    f = np.array([s.f_tr for s in samples(rig, 1000)])
    assert f.mean() == pytest.approx(force, abs=0.2)
    assert abs(rig.state.w_tr) < 5e-6


def test_contact_comes_in_softly(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({"load_cell.noise": 0.0, "pantograph": "en50318"}))
    f = np.array([s.f_tr for s in samples(rig, 600)])
    # 10 % of the uplift force, and what the frame's spring adds below its rest position (50 N/m times 28 mm).
    assert f[0] == pytest.approx(12.0 + 1.4, abs=0.2)
    # The drive does not jump: start in equilibrium, no overshoot above 5 %.
    assert np.abs(np.diff(f)).max() < 1.0
    assert f.max() < 1.05 * 120.0


def test_two_rides_with_one_seed_are_equal_to_the_last_bit(rig_parameters: Any) -> None:
    def ride(seed: int) -> list[RigSample]:
        rig = Rig(rig_parameters({"seed": seed}))
        found = []
        for k in range(200):
            rig.advance(0.01 * math.sin(0.03 * k), 0.01 * math.sin(0.03 * (k + 1)))
            found.append(rig.state)
        return found

    assert ride(3) == ride(3)
    assert ride(3) != ride(4)


def test_reset_goes_back_to_cycle_zero(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters())
    first = samples(rig, 100)
    rig.reset()
    assert samples(rig, 100) == first


def test_low_pass_has_unit_gain_and_the_stated_cut_off() -> None:
    cell = load_cell(0.0, 500.0, math.sqrt(0.5), 5000.0)
    z = np.exp(1j * 2.0 * np.pi * np.array([1e-6, 500.0]) / 5000.0)
    gain = np.abs((cell.b0 + cell.b1 / z + cell.b2 / z**2) / (1.0 + cell.a1 / z + cell.a2 / z**2))
    assert gain == pytest.approx([1.0, math.sqrt(0.5)], rel=1e-9)


def test_low_pass_delays_a_ramp_by_its_group_delay() -> None:
    cell = load_cell(0.0, 500.0, 0.7071, 5000.0)
    memory = np.zeros(2)
    y = [filter_step(cell, memory, 100.0 * 2e-4 * k) for k in range(500)]
    delay = (499 * 2e-4) - y[-1] / 100.0
    # The bilinear transform with the cut-off kept shortens slow delays by (w T / 2) / tan(w T / 2): 3 % here.
    assert delay == pytest.approx(group_delay(500.0, 0.7071), rel=0.05)
    assert delay < 0.25 * 0.002


def test_settled_low_pass_stays_settled() -> None:
    cell = load_cell(0.0, 500.0, 0.7071, 5000.0)
    memory = np.zeros(2)
    settle(cell, memory, 120.0)
    assert [filter_step(cell, memory, 120.0) for _ in range(20)] == pytest.approx([120.0] * 20, rel=1e-12)


def test_noise_and_bias_of_the_load_cell(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({"load_cell.bias": 5.0, "load_cell.noise": 0.5, "run_in": 0.0}))
    for _ in range(1000):
        rig.advance(0.0, 0.0)
    found = samples(rig, 4000)
    error = np.array([s.f_raw - s.f_contact for s in found])
    # 4000 independent samples: mean to 0.008 N, deviation to 1.1 %; four of these.
    assert error.mean() == pytest.approx(5.0, abs=0.032)
    assert error.std() == pytest.approx(0.5, rel=0.045)
    # The low-pass takes away more than half of it (bandwidth 555 Hz of 2500).
    assert np.std([s.f_tr - s.f_contact for s in found]) < 0.3


def test_encoder_rounds_to_its_step() -> None:
    assert encode(1.26e-6, 1e-6) == pytest.approx(1e-6)
    assert encode(-1.6e-6, 1e-6) == pytest.approx(-2e-6)
    assert encode(1.26e-6, 0.0) == 1.26e-6


def test_after_a_cycle_the_reference_is_the_one_at_its_end(rig_parameters: Any) -> None:
    # The controller weighs the step from this reference to its next one: the start would be one cycle old.
    rig = Rig(rig_parameters({}))
    rig.advance(0.0005, 0.001)
    assert rig.state.reference == pytest.approx(0.001, abs=1e-12)
