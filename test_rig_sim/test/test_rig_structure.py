"""The supporting structure: closed forms of its modes, what encoder, contact and load cell see of them."""

import math
from typing import Any

import numpy as np
import pytest

from test_rig_sim.rig import Rig
from test_rig_sim.structure import mode_acceleration, structure


def test_a_mode_rings_at_its_frequency_and_damping(rig_parameters: Any) -> None:
    # A free mode of 62 Hz and 2 % beside a slider that floats without friction: its deflection after n periods is that
    # of the closed form. The slider's motor is off and weightless.
    changes = {
        "drive.gravity": 0.0,
        "imperfections.friction": False,
        "imperfections.cogging": False,
        "structure.frequencies_hz": [62.0],
        "structure.damping_ratios": [0.02],
        "structure.modal_masses": [400.0],
    }
    rig = Rig(rig_parameters(changes), contact=False)
    rig.plant = rig.plant._replace(structure=rig.plant.structure._replace(rest_force=0.0))
    rig.plant = rig.plant._replace(loop=rig.plant.loop._replace(current_limit=0.0))
    rig.memory.state[2] = 1e-3
    omega, damping = 2.0 * math.pi * 62.0, 0.02
    root = omega * math.sqrt(1.0 - damping**2)
    for k in range(1, 51):
        rig.advance(0.0, 0.0)
        t = 0.002 * k
        exact = math.exp(-damping * omega * t) * (math.cos(root * t) + damping * omega / root * math.sin(root * t))
        # Runge-Kutta of fourth order, omega h = 0.04: (omega h)^5 / 120 a step, 1000 steps.
        assert rig.memory.state[2] == pytest.approx(1e-3 * exact, abs=1e-8)


def test_encoder_measures_against_the_stator_and_contact_feels_the_absolute_motion(rig_parameters: Any) -> None:
    changes = {"imperfections.encoder": False, "structure.modal_masses": [40.0, 30.0]}
    rig = Rig(rig_parameters(changes))
    worst = 0.0
    for k in range(500):
        rig.advance(0.005 * math.sin(0.3 * k), 0.005 * math.sin(0.3 * (k + 1)))
        state, head = rig.state, rig.pantograph_state()[0][-1]
        stator = float(rig.memory.state[2:4].sum())
        worst = max(worst, abs(stator))
        assert state.w_true - state.w_tr == pytest.approx(stator, abs=1e-15)
        assert state.f_contact == pytest.approx(max(0.0, 5e4 * (head - state.w_true)), abs=1e-9)
    assert worst > 1e-5


def test_static_deflection_is_the_change_of_the_stator_s_force_over_the_stiffness(rig_parameters: Any) -> None:
    # The uplift force grows from 12 to 120 N: the stator carries as much less of the weight, and moves by that over
    # m omega^2 of either mode.
    noisy = ("friction", "load_cell_noise", "encoder")
    quiet = {f"imperfections.{name}": False for name in noisy}
    rig = Rig(rig_parameters({**quiet, "run_in": 1.0}))
    start = rig.state.f_contact
    for _ in range(3000):
        rig.advance(0.0, 0.0)
    stiffness = np.array([400.0, 300.0]) * (2.0 * math.pi * np.array([62.0, 110.0])) ** 2
    assert rig.memory.state[2:4] == pytest.approx((rig.state.f_contact - start) / stiffness, rel=1e-3)


def test_reaction_of_the_stator_moves_the_modes() -> None:
    body = structure([62.0, 110.0], [0.02, 0.02], [400.0, 300.0], 78.0)
    assert mode_acceleration(body, 1, 0.0, 0.0, 78.0 + 30.0) == pytest.approx(-30.0 / 300.0)
    omega = 2.0 * math.pi * 62.0
    assert mode_acceleration(body, 0, 1e-3, 0.1, 78.0) == pytest.approx(-(omega**2) * 1e-3 - 2.0 * 0.02 * omega * 0.1)


def test_without_structure_the_encoder_shows_the_absolute_place(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({"imperfections.structure": False, "imperfections.encoder": False}))
    for k in range(50):
        rig.advance(0.001 * k, 0.001 * (k + 1))
    assert rig.plant.structure.modes == 0
    assert rig.state.w_true == rig.state.w_tr


@pytest.mark.parametrize("masses", [[1.0], [1.0, 2.0, 3.0]])
def test_incomplete_or_too_many_modes_are_refused(masses: list[float]) -> None:
    with pytest.raises(ValueError, match="up to 2 modes"):
        structure([10.0] * (2 if len(masses) == 1 else 3), [0.1] * len(masses), masses, 0.0)


def test_weighting_keeps_a_busy_reference_from_shaking_the_structure(rig_named: Any) -> None:
    # In the time domain, in contact, with all that is not linear: a reference that wanders in every cycle, which asks
    # for currents at all frequencies. Within 3 % of either resonance the weighting takes off at least half (6 dB).
    def current(weighting: bool) -> list[float]:
        rig = Rig(rig_named("nominal", {"inner_loop.frequency_weighting": weighting, "run_in": 0.1}))
        steps, before, found = 6e-4 * np.random.default_rng(2).standard_normal(2500), 0.0, []
        for k in range(2500):
            after = 0.98 * before + float(steps[k])
            rig.advance(before, after)
            before = after
            found.append(rig.state.current)
        spectrum = np.abs(np.fft.rfft(np.array(found[500:]) * np.hanning(2000)))
        f = np.fft.rfftfreq(2000, 0.002)
        return [float(np.sqrt((spectrum[np.abs(f / wanted - 1.0) < 0.03] ** 2).mean())) for wanted in (62.0, 110.0)]

    weighted, plain = current(True), current(False)
    assert all(one < 0.5 * other for one, other in zip(weighted, plain, strict=True))
