"""Validation of the rig: its own measuring tools against closed forms."""

import math

import numpy as np
import pytest

from test_rig_sim import linear_loop
from validate import rig


def test_amplitude_of_a_sine_on_a_slow_motion():
    # A Hann window over half the record: the slow motion, 100 of its widths away, leaves 1e-6 of itself.
    t = 1e-3 * np.arange(8000)
    values = 3.0 + 0.5 * np.sin(2.0 * math.pi * 0.7 * t) + 0.02 * np.cos(2.0 * math.pi * 50.0 * t + 0.3)
    assert rig.wave_of(values, 50.0, 1e-3) == pytest.approx(0.02 * np.exp(0.3j), rel=1e-4)


@pytest.mark.parametrize("enters", rig.INPUTS)
def test_a_dwell_of_a_linear_rig_is_the_gain_of_its_matrices(enters, monkeypatch):
    # Rigid, without friction, cogging and steps; 2 s are 80 time constants of the loop. The reference's triangle
    # instead of a staircase costs (w T)^2 / 24 = 2.5e-4 of its amplitude.
    monkeypatch.setattr(rig, "DWELL", 2.0)
    p = rig.parameters("ideal", load_cell__plate_mass=0.0)
    matrices = linear_loop.linear_loop(p)
    expected = abs(matrices.response(np.array([62.0]), rig.INPUTS[enters], linear_loop.CURRENT)[0])
    assert rig.dwell(p, 62.0, enters) == pytest.approx(expected, rel=1e-3)


def test_chirp_has_its_amplitude_and_ends_at_twelve_hertz():
    u = rig.chirp(0.01, 5.0, 0.002)
    assert np.abs(u).max() == pytest.approx(0.01, rel=1e-3)
    crossings = np.flatnonzero(np.diff(np.sign(u[-500:])))
    # The last half periods of a chirp to 12 Hz, within the rounding of 2 ms.
    assert np.diff(crossings)[-4:].mean() * 0.002 == pytest.approx(1.0 / 24.0, rel=0.05)


def test_rigs_can_be_changed_by_name():
    changed = rig.parameters("harsh", imperfections__structure=False, drive__delay=7)
    assert not changed.imperfections.structure
    assert changed.drive.delay == 7
    assert changed.load_cell.bias == rig.parameters("harsh").load_cell.bias
