"""The analysis gives the numbers of rides that are known in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from energy_monitor.analysis import Settings, analyse, correlation_lag, spectrum
from energy_monitor.bag import BagError, read_bag
from energy_monitor.report.alignment import ranges
from energy_monitor.report.results import Report
from energy_monitor.report.verdicts import Limits, LimitsError, read_limits

Make = Callable[..., Report]
TS = 0.002
UPLIFT = {"test_rig_sim": {"uplift_force": 120.0}}


@pytest.fixture
def make(synthetic: Callable[..., Path], tmp_path: Path) -> Make:
    """Analyse a synthetic ride of given properties."""
    numbers = count()

    def analysed(
        settings: Settings | None = None,
        limits: Limits | None = None,
        parameters: dict[str, dict[str, Any]] | None = None,
        **ride: Any,
    ) -> Report:
        bag = read_bag(synthetic(tmp_path / f"bag{next(numbers)}", **ride))
        return analyse(bag, settings or Settings(), limits or read_limits(), parameters=parameters)

    return analysed


@pytest.fixture(scope="module")
def report(ride_bag: Path) -> Report:
    return analyse(read_bag(ride_bag), Settings(), read_limits())


def verdict(report: Report, key: str) -> Any:
    return next(entry for entry in report.verdicts if entry.key == key)


def test_position_error_and_lag(report: Report) -> None:
    # w_tr(t) = w_cat(t - d), sine of amplitude A: rms error sqrt(2) A sin(omega d / 2) over whole periods.
    track = report.tracking
    assert track.position_error_rms == pytest.approx(math.sqrt(2.0) * 0.02 * math.sin(2.0 * math.pi * 0.8e-3), rel=1e-9)
    assert track.lag == pytest.approx(0.8e-3, abs=1e-6)  # a parabola through a cosine: error well below 1 % of Ts
    assert track.velocity_error_rms == pytest.approx(1e-4, rel=1e-9)
    assert track.displacement_mean == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("seconds", [-0.0113, -0.002, 0.0, 0.0004, 0.0471])
def test_lag_of_a_broad_band_signal(seconds: float) -> None:
    t = np.arange(3000) * TS
    rng = np.random.default_rng(1)
    waves = [(f, rng.uniform(0.0, 2.0 * np.pi)) for f in (0.7, 1.9, 3.1, 7.3)]

    def signal(time: Any) -> Any:
        return sum(np.sin(2.0 * np.pi * f * time + p) / f for f, p in waves)

    found, likeness = correlation_lag(signal(t), signal(t - seconds), TS)
    assert found == pytest.approx(seconds, abs=0.05 * TS)  # parabola through a peak that is no parabola
    assert likeness == pytest.approx(1.0, abs=1e-3)


def test_no_lag_of_what_does_not_move() -> None:
    assert correlation_lag(np.zeros(2000), np.zeros(2000), TS) == (None, None)
    assert correlation_lag(np.arange(50.0), np.arange(50.0), TS) == (None, None)


def test_contact_force(report: Report) -> None:
    # 5 Hz sine passes the 20 Hz filter of order 6 with gain 1 - 3e-8; the rest is the sampling of its extremes.
    force = report.contact_force
    assert force.samples == 500
    assert force.mean == pytest.approx(120.0, abs=1e-3)
    assert force.sigma == pytest.approx(30.0 / math.sqrt(2.0), rel=1e-3)
    assert force.statistical_maximum == pytest.approx(120.0 + 90.0 / math.sqrt(2.0), rel=1e-3)
    assert force.minimum == pytest.approx(90.0, abs=0.1)
    assert force.loss_share == 0.0 and force.losses == 0


def test_energy_and_momentum(report: Report) -> None:
    # f = F + a sin, v_tr = V sin, v_cat = v_tr + e, F_cor = c over 15 whole periods of 3 s:
    # E_tr = a V T / 2, E_cat = E_tr + (F + c) e T, sum of Ts |f v| = 2 F V T / pi up to the sampling of |sin|.
    # The meters count from the first cycle on, one cycle less than the sums; v_tr(0) = 0.
    books = report.conservation
    assert books.e_tr == pytest.approx(30.0 * 0.1 * 3.0 / 2.0, rel=1e-12)
    assert books.delta_e == pytest.approx(-120.5 * 1e-4 * 3.0, rel=1e-9)
    assert (books.work_tr, books.delta_work) == pytest.approx((4.5, 1e-3 * 2.998), rel=1e-12)
    assert books.delta_work == pytest.approx(books.work_tr - books.work_cat, abs=1e-15)
    assert books.exchanged_energy == pytest.approx(120.0 * 0.1 * 3.0 * 2.0 / math.pi, rel=1e-3)
    assert books.delta_p == pytest.approx(-0.5 * 3.0, rel=1e-12)
    assert books.delta_impulse == pytest.approx(-0.5 * 2.998, rel=1e-12)
    assert books.impulse_tr == pytest.approx(120.0 * 2.998, rel=1e-6)
    assert books.exchanged_momentum == pytest.approx(360.0, rel=1e-12)
    assert books.work_difference == pytest.approx(0.0, abs=1e-12)  # the synthetic rig sums as the report does


def test_the_run_in_is_not_in_the_tracking_error(report: Report, make: Make) -> None:
    # 10 mm and 10 mm/s in the first two of three seconds, which are the run-in.
    track = make(start_error=0.01).tracking
    assert track.position_error_rms == report.tracking.position_error_rms
    assert track.position_error_max == report.tracking.position_error_max
    assert track.position_error_mean == report.tracking.position_error_mean
    assert track.velocity_error_rms == report.tracking.velocity_error_rms
    assert track.velocity_error_max == report.tracking.velocity_error_max
    assert track.position_error_rms_ride == pytest.approx(0.01 * math.sqrt(2.0 / 3.0), rel=1e-3)


def test_the_largest_error_counts_and_not_the_last(make: Make) -> None:
    # Energy and work run off for half the ride and come back: after seven of fourteen periods twice what is allowed, at
    # the end next to none. The meters count one cycle less than the sums.
    report = make(cycles=1400, velocity_error=1.2e-3, leak=0.15, push=2.4, correction=0.0, turn=700)
    books = report.conservation
    assert books.delta_e_max == pytest.approx(120.0 * 1.2e-3 * 1.4, rel=1e-3)
    assert books.delta_work_max == pytest.approx(0.15 * 699 * TS, rel=1e-9)
    assert books.delta_impulse_max == pytest.approx(2.4 * 699 * TS, rel=1e-9)
    assert max(abs(books.delta_e), abs(books.delta_work)) < 5e-4
    for key, share in (
        ("energy", books.delta_e_max / books.exchanged_energy),
        ("work", books.delta_work_max / books.exchanged_energy),
        ("impulse", books.delta_impulse_max / books.exchanged_momentum),
    ):
        assert verdict(report, key).value == pytest.approx(100.0 * share, rel=1e-12)
        assert verdict(report, key).ok is False
    # When the run-in of 2 s ends, the error is over its peak and five sevenths of all energy are exchanged.
    shares = (books.delta_work_running_share, books.delta_work_max_share)
    assert shares[0] == pytest.approx(0.15 * 398 * TS / (books.exchanged_energy * 5.0 / 7.0), rel=1e-2)
    assert shares[1] == pytest.approx(0.15 * 699 * TS / books.exchanged_energy, rel=1e-9)


def test_only_what_the_rig_did_as_the_catenary_is_in_the_books(make: Make) -> None:
    # Held for the first 0.5 s, as a mass on a spring from 2.5 s on: 2 s are left, with ten whole periods.
    report = make(modes={0: 0, 250: 1}, environments={1250: 2})
    books = report.conservation
    assert books.exchanged_momentum == pytest.approx(120.0 * 2.0, rel=1e-9)
    assert books.delta_p == pytest.approx(-0.5 * 2.0, rel=1e-9)
    assert books.delta_impulse == pytest.approx(-0.5 * 2.0, rel=1e-9)
    assert books.delta_work == pytest.approx(1e-3 * 2.0, rel=1e-9)
    monitor, controller, _ = report.agreement
    assert monitor.compared == controller.compared == 125
    assert max(monitor.share, controller.share) < 1e-12
    assert [change.mode for change in report.modes] == ["hold", "tracking"]
    assert verdict(report, "mismatches").value == 0.0


def test_error_of_the_forecast(report: Report, make: Make) -> None:
    assert report.contact_force.prediction_error == pytest.approx(0.0, abs=1e-12)
    late = make(forecast_error=-3.0)
    assert late.contact_force.prediction_error == pytest.approx(3.0, rel=1e-12)
    assert verdict(late, "mismatches").ok is True  # F_cat is the forecast and F_cor, whatever they are
    assert make(cycles=1).contact_force.prediction_error is None


@pytest.mark.slow
def test_books_agree_and_disagree(report: Report, make: Make) -> None:
    monitor, controller, quality = report.agreement
    assert (monitor.source, controller.source) == ("energy_monitor", "impedance_mpc")
    assert monitor.compared == controller.compared == 150
    # The same sums, in another order of additions for the statistics.
    assert max(entry.share for entry in report.agreement) < 1e-12
    assert quality.differences["loss_share"] == 0.0 and verdict(report, "monitor_force").ok is True
    assert verdict(make(quality_error=0.01), "monitor_force").ok is False
    slipped = make(books_error=0.01)
    assert verdict(slipped, "monitor_books").ok is False
    assert verdict(slipped, "controller_books").ok is True
    assert slipped.agreement[0].differences["delta_e"] == pytest.approx(0.01, abs=1e-12)
    assert slipped.agreement[0].differences["delta_work"] == pytest.approx(0.01, abs=1e-12)


def test_spectrum_has_the_power_of_the_force() -> None:
    # Parseval: the density of a sine of amplitude 30 sums up to 30^2 / 2; Hann leakage is far below 1 %.
    t = np.arange(4096) * TS
    frequency, density = spectrum(30.0 * np.sin(2.0 * np.pi * 5.0 * t) + 120.0, TS)
    assert float(density.sum() * (frequency[1] - frequency[0])) == pytest.approx(450.0, rel=1e-2)
    assert frequency[density.argmax()] == pytest.approx(5.0, abs=0.25)


def test_counts(report: Report, make: Make) -> None:
    assert report.solver.status == {"solved": 1500}
    assert make(fallbacks=(100, 101)).solver.status == {"solved": 1498, "fallback": 2}
    assert report.solver.iterations_max == 4
    assert report.correction.rms == pytest.approx(0.5)
    assert report.correction.modes == {"active": 1500}
    assert report.catenary.slack_share == pytest.approx(0.25)
    assert report.catenary.iterations_max == 2
    assert report.ride.speed_factor == pytest.approx(2.0, rel=1e-3)  # first to last message is one cycle short
    assert report.ride.speed == pytest.approx(250.0 / 3.6)


def test_timing(report: Report) -> None:
    assert [entry.node for entry in report.timing] == [
        "catenary_model",
        "energy_monitor",
        "impedance_mpc",
        "test_rig_sim",
    ]
    entry = report.timing[0]
    assert entry.cycles == 1500 and entry.late == 2 and entry.over_budget == 0
    assert entry.largest == pytest.approx(2.99e-4, rel=1e-6)  # float32
    assert entry.median == pytest.approx(2.495e-4, rel=1e-6)
    counted = (entry.messages_late, entry.messages_lost, entry.messages_doubled, entry.messages_swapped)
    assert counted == (1, 3, len("catenary_model"), 0)


def test_warnings_are_said_once(report: Report) -> None:
    (warned,) = report.warnings
    assert (warned.level, warned.count) == ("WARN", 3)
    assert warned.last - warned.first == pytest.approx(2.0)  # 1000 cycles, by the clock of the ride


def test_correction_at_its_bound(make: Make) -> None:
    assert make(correction=10.0).correction.at_bounds_share == 1.0


def test_good_ride_passes(report: Report) -> None:
    assert report.ok
    assert all(entry.ok is not False for entry in report.verdicts)
    assert verdict(report, "en50367_ac_mean").high == pytest.approx(0.00097 * 250.0**2 + 70.0)
    assert verdict(report, "en50367_ac_loss_share").high == pytest.approx(0.1)  # 250 km/h is not above 250 km/h


@pytest.mark.parametrize(
    ("ride", "key"),
    [
        ({"lag": 4e-3}, "position"),
        ({"velocity_error": 1e-3}, "energy"),
        ({"leak": 0.1}, "work"),
        ({"correction": 0.8}, "momentum"),
        ({"push": 0.8}, "impulse"),
        ({"no_contact": (1200, 1201)}, "contact"),
        ({"missing": (700, 701, 900)}, "cycles"),
        ({"modes": {1300: 4}}, "retracted"),
        ({"mean_force": 160.0, "parameters": UPLIFT}, "mean_force"),
        ({"mean_force": 100.0, "parameters": UPLIFT}, "mean_force"),
        ({"last": False}, "ended"),
        ({"mismatches": (50,)}, "mismatches"),
        ({"fallbacks": (50, 60)}, "fallbacks"),
        ({"first": 5, "parameters": UPLIFT}, "cycles"),
        ({"without": ("energy_monitor/conserved_quantities",), "parameters": UPLIFT}, "monitor_books"),
        ({"without": ("impedance_mpc/conserved_quantities",), "parameters": UPLIFT}, "controller_books"),
    ],
)
@pytest.mark.slow
def test_bad_ride_fails(make: Make, ride: dict[str, Any], key: str) -> None:
    report = make(**ride)
    assert verdict(report, key).ok is False
    assert not report.ok


def test_information_does_not_decide(make: Make) -> None:
    report = make(amplitude=70.0)  # sigma 49 N, more than 0.3 of 120 N
    assert verdict(report, "en50367_ac_sigma").ok is False
    assert report.ok


def test_bridged_cycles_are_told_and_do_not_decide(make: Make) -> None:
    report = make(modes={800: 2, 802: 3, 805: 1})
    bridged = verdict(report, "bridged")
    assert (bridged.value, bridged.ok, bridged.binding) == (5.0, False, False)
    assert report.ok


def test_a_missed_norm_is_a_result_and_no_failure(make: Make) -> None:
    # EN 50367 at 160 km/h allows up to 0.00047 * 160^2 + 90 = 102 N.
    report = make(speed_kmh=160.0, parameters=UPLIFT)
    norm = verdict(report, "en50367_ac_mean")
    assert norm.ok is False and not norm.binding
    assert verdict(report, "mean_force").value == pytest.approx(1.0, abs=1e-3)
    assert report.ok
    binding = read_limits().model_copy(update={"standard_binding": ["mean"]})
    assert not make(speed_kmh=160.0, parameters=UPLIFT, limits=binding).ok


def test_mean_force_is_open_without_parameters(report: Report) -> None:
    assert verdict(report, "mean_force").ok is None
    assert (verdict(report, "mean_force").low, verdict(report, "mean_force").high) == (0.85, 1.15)


@pytest.mark.parametrize(("cycles", "judged"), [(1000, False), (1001, True)])
def test_a_run_in_is_not_judged(make: Make, cycles: int, judged: bool) -> None:
    # Run-in 2 s: cycles 0 to 999. The ride would fail in everything that is steady.
    report = make(
        cycles=cycles, lag=4e-3, velocity_error=1e-2, leak=1.0, correction=9.0, mean_force=200.0,
        no_contact=tuple(range(900, 1001)), parameters=UPLIFT,
    )  # fmt: skip
    keys = ("position", "energy", "work", "momentum", "impulse", "mean_force", "contact")
    keys += ("en50367_ac_mean", "en50367_ac_loss_share")
    found = [verdict(report, key).ok for key in keys]
    assert found == ([False] * len(keys) if judged else [None] * len(keys))
    assert report.ok is not judged


def test_missing_and_double_cycles(make: Make) -> None:
    report = make(missing=(700, 701, 900), repeated=(5, 1499))
    rig = report.streams[0]
    assert (rig.missing, rig.missing_ranges, rig.duplicates) == (3, ["700..701", "900"], 2)
    assert report.ride.cycles == 1497
    assert verdict(report, "cycles").value == 3.0
    assert verdict(report, "monitor_books").ok is None  # sums with gaps cannot be compared


def test_losses_are_counted(make: Make) -> None:
    force = make(no_contact=(1100, 1101, 1102, 1300)).contact_force
    assert force.losses == 2
    assert force.loss_share == pytest.approx(4 / 500)


def test_losses_are_listed_with_place_and_length(make: Make) -> None:
    """Masts of the synthetic line stand every 60 m; 250 km/h are 0.1389 m a cycle."""
    report = make(no_contact=(1100, 1101, 1102, 1300), settings=Settings(loss_duration=0.005))
    force, (long, short) = report.contact_force, report.losses
    assert (force.losses, force.shorter_losses, force.loss_duration) == (1, 1, 0.005)
    assert force.loss_share == pytest.approx(3 / 500)
    assert verdict(report, "contact").value == pytest.approx(0.6)
    assert "at least 5 ms; 1 shorter" in verdict(report, "contact").source
    assert (long.cycle, long.cycles, long.counted, short.cycle, short.cycles, short.counted) == (
        1100, 3, True, 1300, 1, False,
    )  # fmt: skip
    assert (long.time, long.length, long.lowest_force) == pytest.approx((2.2, 0.006, 0.0))
    for loss in (long, short):
        place = loss.cycle * TS * 250.0 / 3.6
        assert loss.track_position == pytest.approx(place)
        assert loss.mast_before == pytest.approx(60.0 * math.floor(place / 60.0), abs=1e-4)
        assert loss.mast_behind == pytest.approx(60.0 * math.ceil(place / 60.0), abs=1e-4)
    assert make(no_contact=(1300,), without=("catenary_model/wire_shape",)).losses[0].mast_before is None


@pytest.mark.slow
def test_shorter_losses_than_count_do_not_fail_a_ride(make: Make) -> None:
    for duration, ok in ((0.0, False), (0.005, True)):
        report = make(no_contact=(1100, 1102), settings=Settings(loss_duration=duration))
        assert verdict(report, "contact").ok is ok
        assert len(report.losses) == 2


def test_a_loss_goes_on_over_a_missing_cycle_and_not_over_a_landing(make: Make) -> None:
    (one,) = make(no_contact=(1200, 1201, 1202), missing=(1201,)).losses
    assert one.cycles == 2
    apart = make(no_contact=tuple(range(1190, 1210)), modes={0: 0, 10: 1, 1195: 4}).losses
    assert [(loss.cycle, loss.cycles) for loss in apart] == [(1190, 5)]


def test_mode_changes(make: Make) -> None:
    changes = [(change.cycle, change.mode) for change in make(modes={0: 0, 10: 1, 800: 2, 801: 1}).modes]
    assert changes == [(0, "hold"), (10, "tracking"), (800, "bridging"), (801, "tracking")]


def test_recording_that_began_late(make: Make) -> None:
    report = make(first=1000)
    assert report.ride.cycles == 1500
    assert any("cycle 1000" in note for note in report.notes)
    assert verdict(report, "monitor_books").ok is True


def test_ride_shorter_than_its_run_in(make: Make) -> None:
    report = make(cycles=400)
    assert report.contact_force.samples == 400
    assert any("not longer than its run-in of 2 s" in note for note in report.notes)


def test_shortest_rides_do_not_crash(make: Make) -> None:
    report = make(cycles=2)
    assert report.tracking.lag is None
    assert report.ride.cycles == 2


def test_bag_without_monitor_is_open(make: Make) -> None:
    own = (
        "energy_monitor/conserved_quantities",
        "impedance_mpc/conserved_quantities",
        "catenary_model/impedance_model",
    )
    report = make(without=(*own, "catenary_model/wire_shape"))
    assert report.ride.ts == TS
    assert verdict(report, "monitor_books").ok is None
    assert report.ok


def test_what_the_nodes_refuse_is_left_out(ride_bag: Path, report: Report) -> None:
    bag = read_bag(ride_bag)
    states = bag.table("test_rig_sim/state", "RigState")
    double = states.take(np.sort(np.concatenate([np.arange(len(states)), [700, 701, 702]])))
    double["cycle"][700] = 10**9
    double["last"][700] = True
    double["w_tr"][702] = math.nan  # before the good one of cycle 701
    books = bag.table("energy_monitor/conserved_quantities", "ConservedQuantities")
    books["cycle"][30] = 10**9
    tables = {**bag.tables, states.topic: double}
    found = analyse(replace(bag, tables=tables), Settings(), read_limits())
    assert found.tracking == report.tracking and found.conservation == report.conservation
    assert found.ride.ended and found.streams[0].restarts == 0 and found.streams[0].missing == 0
    assert found.agreement[0].compared == 149
    assert any(note.startswith("2 messages on /test_rig_sim/state are left out") for note in found.notes)


def test_missing_topic(make: Make) -> None:
    with pytest.raises(BagError, match="no CatenaryState"):
        make(without=("catenary_model/state",))


def test_namespace_changes_nothing(make: Make, report: Report) -> None:
    other = make(namespace="/lab")
    assert other.tracking == report.tracking and other.conservation == report.conservation


def test_limits(tmp_path: Path) -> None:
    assert read_limits().position_error_rms == 0.0005
    file = tmp_path / "limits.yaml"
    file.write_text("position_error_rms: 0.001\n")
    assert read_limits(file).position_error_rms == 0.001
    for text, message in (
        ("position: 1.0", "position"),
        ("missing_cycles: -1", "missing_cycles"),
        ("- 1", "mapping"),
        ("a: [", "no YAML"),
    ):
        file.write_text(text)
        with pytest.raises(LimitsError, match=message):
            read_limits(file)


def test_ranges() -> None:
    assert ranges([]) == []
    assert ranges([1, 2, 3, 7, 9, 10]) == ["1..3", "7", "9..10"]
    assert ranges(list(range(0, 60, 2)), most=2) == ["0", "2", "and 28 more"]


def test_further_pantographs_are_evaluated_as_the_first_one(make: Make) -> None:
    """A sine of 2 Hz passes the filter: sigma = amplitude / sqrt 2 over whole periods; to 0.1 % for filter and run-in.

    One that pulls off (100 N less 120 N) is lost by its unfiltered force for the share of the sine below the threshold.
    """
    report = make(cycles=3000, beside=((-200.0, 20.0), (85.0, 120.0)))
    behind, ahead = report.companions
    assert (behind.place, ahead.place) == (-200.0, 85.0)
    assert behind.mean == pytest.approx(100.0, abs=0.1)
    assert behind.sigma == pytest.approx(20.0 / math.sqrt(2.0), rel=1e-3)
    assert behind.statistical_minimum == pytest.approx(behind.mean - 3.0 * behind.sigma)
    assert (behind.losses, behind.loss_share) == (0, 0.0)
    below = math.acos((100.0 - 2.0) / 120.0) / math.pi
    assert ahead.loss_share == pytest.approx(below, abs=1.0 / 250.0)  # a period is 250 cycles
    assert ahead.losses == 8  # of 2 Hz in the 4 s behind the run-in


def test_a_bag_of_before_has_no_further_pantographs(make: Make) -> None:
    fields = ("place", "force", "height", "loss")
    assert make(lacking=tuple(f"CatenaryState.companion_{name}" for name in fields)).companions == []
    assert make().companions == []
