"""What a validation says: verdicts, evaluation of the reference model, the entry point's exit code."""

import io
import json
import math
import sys
import types

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from catenary_model.reference import Ride
from phil_study.outcome import Outcome, Row, table
from validate import __main__ as entry
from validate import en50318
from validate.reference_values import QUANTITIES


@pytest.mark.parametrize(
    ("value", "low", "high", "holds"),
    [
        (1.0, None, None, None),
        (1.0, 1.0, 2.0, True),
        (2.0, 1.0, 2.0, True),
        (0.99, 1.0, 2.0, False),
        (2.01, 1.0, 2.0, False),
        (5.0, 1.0, None, True),
        (5.0, None, 1.0, False),
        (math.nan, None, 1.0, False),
        (math.inf, 1.0, None, False),
    ],
)
def test_verdict_of_a_row(value: float, low: float | None, high: float | None, holds: bool | None) -> None:
    assert Row("", "", value, "", low, high).holds is holds


def test_outcome_holds_only_if_every_goal_is_met() -> None:
    good, bad, told = Row("", "", 1.0, "", 0.0), Row("", "", 1.0, "", 2.0), Row("", "", 1.0, "")
    assert Outcome("", [good, told]).holds
    assert not Outcome("", [good, bad, told]).holds


def test_details_count_as_well() -> None:
    good, bad = Row("", "", 1.0, "", 0.0), Row("", "", 1.0, "", 2.0)
    assert Outcome("", [good], details=[good]).holds
    assert not Outcome("", [good], details=[bad]).holds


def test_a_grouped_table_names_a_case_once() -> None:
    rows = [Row("mass", "first case", 1.0, "kg"), Row("force", "first case", 2.0, "N"), Row("mass", "other", 3.0, "kg")]
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(table("", rows))
    assert console.export_text().count("first case") == 2
    console.print(table("", rows, grouped=True))
    said = console.export_text()
    assert said.count("first case") == said.count("other") == 1
    assert said.count("mass") == 2
    assert said.index("first case") < said.index("force") < said.index("other")


def made_up_ride() -> Ride:
    """Two minutes of line at 60 m/s with a force of known mean, sigma and extremes, one loss, one uplift a support."""
    ts = 1e-3
    t = ts * np.arange(1, 9_001)
    force = 100.0 + 20.0 * np.sqrt(2.0) * np.sin(2.0 * np.pi * t)
    supports = 60.0 * np.arange(11)
    uplift = 1e-3 * np.exp(-((t[:, None] - supports / 60.0) ** 2)) * (40.0 + np.arange(11))
    none = np.zeros(0)
    return Ride(
        t,
        60.0 * t,
        t,
        t,
        force,
        t,
        t.astype(np.int64),
        t.astype(np.int64),
        supports,
        uplift,
        none,
        none.reshape(0, 2, 0),
        np.full(t.size, 60.0),
    )


def test_values_of_a_known_force() -> None:
    """1 Hz passes the 20 Hz filter (0.1 %); spans 5 and 6 are 4 to 6 s; supports 4, 5, 6 count, at most 46 mm."""
    found = en50318.values(made_up_ride())
    assert list(found) == list(QUANTITIES)
    assert (found["mean"], found["sigma"]) == pytest.approx((100.0, 20.0), rel=2e-3)
    assert (found["statistical_maximum"], found["statistical_minimum"]) == pytest.approx((160.0, 40.0), rel=5e-3)
    assert (found["maximum"], found["minimum"]) == pytest.approx((100.0 + 28.28, 100.0 - 28.28), rel=2e-3)
    assert found["uplift"] == pytest.approx(46.0, rel=1e-6)
    assert found["height_range"] == pytest.approx(2000.0, abs=2.0)  # its contact point rises by 1 m/s
    assert found["loss"] == 0.0


def test_bands_of_a_force_of_two_frequencies() -> None:
    """30 N at 2, 12 N at 11, 50 N at 100 Hz: each in its band, the last in none; 1 % for the flanks of the filters."""
    record = made_up_ride()
    for frequency, amplitude in ((2.0, 30.0), (11.0, 12.0), (100.0, 50.0)):
        record.F[:] += amplitude * np.sin(2.0 * np.pi * frequency * record.t)
    record.F[:] -= 20.0 * np.sqrt(2.0) * np.sin(2.0 * np.pi * record.t)
    found = en50318.values(record)
    assert found["sigma_0_5"] == pytest.approx(30.0 / np.sqrt(2.0), rel=1e-2)
    assert found["sigma_5_20"] == pytest.approx(12.0 / np.sqrt(2.0), rel=1e-2)
    assert found["sigma"] == pytest.approx(math.hypot(found["sigma_0_5"], found["sigma_5_20"]), rel=1e-2)


def test_loss_of_contact_is_counted_before_the_filter() -> None:
    record = made_up_ride()
    record.F[5_000:5_002] = 0.0
    assert en50318.values(record)["loss"] == pytest.approx(100.0 * 2 / 2000)
    assert en50318.values(record)["loss_below_20_hz"] == 0.0
    record.F[4_900:5_900] -= 200.0
    found = en50318.values(record)
    assert found["loss"] == pytest.approx(50.0, abs=0.3) and found["loss_below_20_hz"] == pytest.approx(50.0, abs=3.0)


@pytest.mark.slow
def test_quick_run_of_the_reference_model() -> None:
    """All 16 rows with their ranges; they hold at the shortened run's coarser mesh as well. 2018 is not judged."""
    outcome = en50318.run(True, None, lambda _: None)
    judged = [row for row in outcome.rows if row.holds is not None]
    assert len(judged) == 16
    assert {row.case for row in judged} == {"250 km/h", "300 km/h"}
    assert [row.name for row in judged if not row.holds] == []
    (sheet,) = outcome.sheets
    used = {(row["set"], row["used"]) for row in sheet.rows}
    assert used == {
        ("en50318_2002", "verdict"),
        ("second_code", "comparison"),
        ("en50318_2018_ac_simple", "comparison"),
    }
    modern = [row for row in outcome.rows if row.case == "320 km/h"]
    assert "unverified" in next(row.note for row in modern if row.name == "mean force")
    notes = "\n".join(outcome.notes)
    assert "for comparison only, no verdict" in notes and "withdrawn" in notes and "before any filter" in notes


@pytest.mark.parametrize(("value", "code"), [(1.0, 0), (3.0, 1)])
def test_exit_code_and_json(
    value: float, code: int, monkeypatch: pytest.MonkeyPatch, tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    made_up = types.ModuleType("made_up_validation")
    sheet = Table("seen on a sheet")
    made_up.run = lambda quick, out, say: Outcome(
        "Made up",
        [Row("x", "c", value, "N", None, 2.0)],
        [f"quick {quick}"],
        details=[Row("only in the file", "c", 5.0, "N")],
        overviews=[sheet],
    )
    monkeypatch.setitem(sys.modules, "made_up_validation", made_up)
    monkeypatch.setitem(entry.NAMES, "made-up", ("made_up_validation", "nothing"))
    target = tmp_path / "figures.json"
    monkeypatch.setattr(sys, "argv", ["validate", "made-up", "--quick", "--json", str(target)])
    assert entry.main() == code
    said = capsys.readouterr().out
    assert ("holds" if code == 0 else "FAILS") in said
    assert "verdicts are given on full runs" in said
    assert "seen on a sheet" in said and "only in the file" not in said
    document = json.loads(target.read_text())
    assert document["holds"] is (code == 0)
    assert document["rows"][0]["value"] == value
    assert document["rows"][1]["name"] == "only in the file"
