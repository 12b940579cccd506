"""Two pantographs: the measures of the study find what is known, and a shortened run gives all it promises."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from catenary_model.reference import Ride
from validate import line_waves, pantographs, pantographs_realtime
from validate.pantographs import FIRST, LAST, SPAN, force_of, strongest, tone_expected, turns_a_metre


def made_up(n: int, amplitude: complex, loss: bool = False) -> Ride:
    """A ride at 60 m/s over the stretch with one harmonic of the passing of spans in its force."""
    t = 1e-3 * np.arange(1, 26_001)
    zeta = 60.0 * t
    force = 120.0 + (amplitude * np.exp(2j * np.pi * n * zeta / SPAN)).real
    if loss:
        force[(zeta >= 900.0) & (zeta < 906.0)] = 0.0
    none = np.zeros(0)
    whole = np.zeros(t.size, dtype=np.int64)
    return Ride(
        t,
        zeta,
        t,
        t,
        force,
        t,
        whole,
        whole,
        none,
        none.reshape(0, 0),
        none,
        none.reshape(0, 2, 0),
        np.full(t.size, 60.0),
    )


def test_harmonics_of_a_known_force() -> None:
    """3 Hz at 60 m/s is the third harmonic; ten whole spans leave the others nothing but the ends' rounding."""
    found = force_of(made_up(3, 20.0 - 15.0j))
    assert found.harmonics.size == 20
    assert found.harmonics[2] == pytest.approx(20.0 - 15.0j, rel=1e-9)
    assert np.abs(np.delete(found.harmonics, 2)).max() < 0.1
    # 3 Hz passes a low-pass of 20 Hz
    assert found.statistics.sigma == pytest.approx(25.0 / np.sqrt(2.0), rel=1e-3)
    assert found.statistics.mean == pytest.approx(120.0, abs=0.05)
    assert found.statistics.losses == 0


def test_losses_are_counted_before_the_filter() -> None:
    """6 of 600 m without force; below 20 Hz the force never gets to 0."""
    found = force_of(made_up(3, 5.0, loss=True)).statistics
    assert (found.losses, found.loss_share) == (1, pytest.approx(6.0 / (LAST - FIRST), rel=0.01))


@pytest.mark.parametrize("rate", [0.0106, 0.055, -0.08, 0.1062])
def test_turning_of_a_known_phasor(rate: float) -> None:
    """One line over 200 m, found in either sense to a hundredth of the resolution; noise of a tenth moves it little."""
    d = np.array(pantographs.SWEPT)
    random = np.random.default_rng(4)
    noise = 0.1 * (random.standard_normal(d.size) + 1j * random.standard_normal(d.size))
    assert turns_a_metre(d, 3.0 * np.exp(2j * np.pi * (rate * d + 0.3)) + noise) == pytest.approx(rate, abs=3e-4)


def test_strongest_line_of_a_known_signal() -> None:
    t = 1e-3 * np.arange(2_000)
    signal = 5.0 + np.sin(2.0 * np.pi * 6.37 * t) + 0.3 * np.sin(2.0 * np.pi * 21.0 * t)
    assert strongest(signal, 1e-3) == pytest.approx(6.37, abs=0.01)


def test_tones_without_bending_are_those_of_the_textbook() -> None:
    """Long waves: f/(1 + v/c) behind and f/(1 - v/c) ahead; bending makes the shorter wave ahead a little faster."""
    c, v = pantographs.contact_wire(250)
    behind, ahead = tone_expected(250, 2.0)
    assert behind == pytest.approx(2.0 / (1.0 + v / c), rel=1e-4)
    assert ahead == pytest.approx(2.0 / (1.0 - v / c), rel=2e-3)
    assert tone_expected(250, 15.0)[1] < 15.0 / (1.0 - v / c)


def test_sigma_that_repeats_itself_is_found() -> None:
    d = np.array(pantographs.SWEPT)
    apart, alike = pantographs.repeats(d, 30.0 + 5.0 * np.cos(2.0 * np.pi * d / 80.0) + np.cos(2.0 * np.pi * d / 10.0))
    assert (apart, alike) == (80.0, pytest.approx(1.0, abs=1e-9))


def test_waves_of_a_line_without_droppers_are_those_of_its_wires() -> None:
    """Masts hold the carrier alone: the contact wire is free, f = frequency(k), k = mu/L + 2 pi j/L.

    A load feeds those with f(k) + v k/(2 pi) = N v/L, k running backwards.
    """
    preset = pantographs.COARSE.line()
    bare = dataclasses.replace(preset, spans=(dataclasses.replace(preset.spans[0], droppers=()),))
    mu, found = line_waves.bands(bare, 1.0, 6)
    wire = bare.contact
    for row, phase in ((found[30], mu[30]), (found[200], mu[200])):
        own = [wire.frequency((phase + 2.0 * np.pi * j) / 60.0 if j or phase else 0.0) for j in (-1, 0, 1)]
        for omega in own:
            # 1 m elements are exact to 1e-5 for waves of 30 m and longer
            assert np.abs(row - abs(omega) / (2.0 * np.pi)).min() < 1e-4
    left = line_waves.left_behind(bare, 250.0 / 3.6, 1.0, 6)
    c, v = wire.wave_speed, 250.0 / 3.6
    for n in (1, 2):
        assert np.abs(left - n * v / 60.0 * c / (c + v)).min() < 2e-3


def test_waves_of_the_line_begin_above_a_lowest_frequency() -> None:
    """The carrier hangs on masts that hardly give: below half a wave in a span, c/(2 L) = 1 Hz or little less, none."""
    _, found = line_waves.bands(pantographs.COARSE.line(), 1.0, 3)
    assert 0.6 < found[:, 0].min() < found[:, 0].max() < 1.05
    # stop bands between the first three
    assert (found[:, 1:].min(axis=0) > found[:, :-1].max(axis=0) + 0.3).all()


@pytest.mark.slow
def test_a_push_comes_back_with_the_speed_of_the_wire() -> None:
    c, v = pantographs.contact_wire(250)
    assert pantographs.heard_speed(250) == pytest.approx(c + v, rel=0.03)


@pytest.mark.slow
def test_a_shortened_sweep_gives_rows_and_a_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two distances, judged over three spans instead of ten, of a line that ends soon behind them."""
    for name, value in (("FIRST", 540.0), ("LAST", 720.0), ("SPANS", 17)):
        monkeypatch.setattr(pantographs, name, value)
    monkeypatch.setattr(line_waves, "PHASES", 41)
    said: list[str] = []
    found = pantographs.sweep(300, [60.0, 120.0], said.append)
    rows = pantographs.sweep_rows(found)
    assert len(said) == 2
    assert {row.name for row in rows} >= {"sigma alone", "largest sigma of the trailing one"}
    assert found.trailing.max() > 1.05 * found.alone
    json.dumps([row.row() for row in rows])
    pantographs.draw([found], tmp_path / "distance.png")
    assert (tmp_path / "distance.png").stat().st_size > 10_000


@pytest.mark.slow
def test_real_time_models_are_held_against_the_reference_force_by_force(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short ride at 250 km/h with 85 m: the finer grid is nearer than the elements, for either pantograph.

    The reference is a coarser one here, good for 2 % of sigma.
    """
    monkeypatch.setattr(pantographs_realtime, "ELEMENT", 0.25)
    monkeypatch.setattr(pantographs_realtime, "STEP", 4e-4)
    found = pantographs_realtime.rows((250,), (85.0,), True, lambda text: None)
    assert len(found) == 2 * len(pantographs_realtime.MODELS)
    by_case = {row.case.partition(" m, ")[2]: row.value for row in found}
    for which in ("leading", "trailing"):
        assert by_case[f"{which}, fd, 0.2 m, 3 steps"] < by_case[f"{which}, fe"] < 0.5
    assert all((row.high is None) is ("3 steps" not in row.case) for row in found)
