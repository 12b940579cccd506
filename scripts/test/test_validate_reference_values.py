"""Reference values from YAML: what comes with the package, what is judged, and what a wrong file is told."""

import copy
import sys
from pathlib import Path
from typing import Any

import pytest

from phil_base.yaml_file import dump_yaml, read_yaml
from validate import __main__ as command
from validate import en50318
from validate.reference_values import OWN, QUANTITIES, STATUS, ReferenceValuesError, load

MEASURED = dict.fromkeys(QUANTITIES, 1.0)
GOOD: dict[str, Any] = {
    "mine": {
        "edition": "a standard:2030",
        "in_force": True,
        "source": "my copy, table 7",
        "status": "read",
        "model": "ac_simple",
        "values": [
            {"quantity": "mean", "speed_kmh": 275, "low": 0.5, "high": 1.5},
            {
                "quantity": "sigma",
                "speed_kmh": 275,
                "low": 2.0,
                "high": 3.0,
                "status": "second-hand",
                "source": "a talk",
            },
            {"quantity": "loss", "speed_kmh": 275, "value": 1.0},
        ],
    }
}


def file_of(tmp_path: Path, tree: object) -> Path:
    path = tmp_path / "values.yaml"
    path.write_text(dump_yaml(tree))
    return path


def changed(*path: Any, to: object) -> dict[str, Any]:
    """Return `GOOD` with one entry of the set put otherwise; `None` takes it away."""
    tree = copy.deepcopy(GOOD)
    at: Any = tree["mine"]
    for key in path[:-1]:
        at = at[key]
    if to is None:
        del at[path[-1]]
    else:
        at[path[-1]] = to
    return tree


def test_the_file_that_comes_with_it() -> None:
    """Sixteen ranges and sixteen values of 2002; of what is in force nothing was read, so nothing is judged."""
    sets = {one.key: one for one in load()}
    ours, second = sets["en50318_2002"], sets["second_code"]
    assert len(ours.entries) == len(second.entries) == 16
    assert ours.judges and not second.judges
    assert all(entry.status == "read" for one in (ours, second) for entry in one.entries)
    assert [one.key for one in sets.values() if one.in_force] == ["en50318_2018_ac_simple"]
    assert {entry.status for entry in sets["en50318_2018_ac_simple"].entries} == {"unverified"}
    assert not ours.in_force and "withdrawn" in ours.about()
    assert {entry.quantity for one in sets.values() for entry in one.entries} == set(QUANTITIES) - {"loss_below_20_hz"}


def test_the_second_code_is_inside_the_ranges_of_2002() -> None:
    sets = {one.key: one for one in load()}
    ranges = {(entry.quantity, entry.speed_kmh): entry for entry in sets["en50318_2002"].entries}
    for entry in sets["second_code"].entries:
        known = ranges[entry.quantity, entry.speed_kmh]
        assert known.low <= entry.low <= known.high, entry


def test_only_a_range_that_was_read_is_judged(tmp_path: Path) -> None:
    sets = load(file_of(tmp_path, GOOD))
    found = {row.name: row for row in en50318.rows(sets, "ac_simple", 275.0, MEASURED, "ours", True)}
    assert (found["mean force"].holds, found["mean force"].goal) == (True, "0.5 .. 1.5")
    assert found["standard deviation"].holds is None and "2 .. 3 (second-hand)" in found["standard deviation"].note
    assert found["loss of contact"].holds is None and "1 (read)" in found["loss of contact"].note
    assert found["actual maximum"].note == "ours"
    lines = {row["quantity"]: row for row in en50318.sheet(sets, {("ac_simple", 275.0): MEASURED}).rows}
    assert [lines[name]["used"] for name in ("mean force", "standard deviation")] == ["verdict", "comparison"]
    assert [lines[name]["place"] for name in ("mean force", "standard deviation")] == ["inside", "outside"]
    assert lines["standard deviation"]["source"] == "a talk"


@pytest.mark.parametrize("status", STATUS)
def test_what_is_known_of_a_number_decides_over_the_verdict(status: str, tmp_path: Path) -> None:
    """A mean of 1 N is outside 5 .. 6: it fails where that was read, and nowhere else."""
    tree = changed("status", to=status)
    tree["mine"]["values"][0] |= {"low": 5.0, "high": 6.0}
    row = en50318.rows(load(file_of(tmp_path, tree)), "ac_simple", 275.0, MEASURED, "ours", True)[0]
    assert row.holds is (False if status == "read" else None)


WRONG = {
    "status": (changed("status", to="heard"), "mine.status = 'heard': allowed is one of read, second-hand, unverified"),
    "status of an entry": (
        changed("values", 0, "status", to="sure"),
        "mine.values[0].status = 'sure': allowed is one of read, second-hand, unverified",
    ),
    "no status": (changed("status", to=None), "mine.status is missing; allowed is read, second-hand, unverified"),
    "no source": (changed("source", to=None), "mine.source is missing; allowed is a text"),
    "empty source": (changed("source", to=" "), "mine.source = ' ': allowed is a text"),
    "no edition": (changed("edition", to=None), "mine.edition is missing; allowed is a text"),
    "year alone": (changed("edition", to=2018), "mine.edition = 2018: allowed is a text"),
    "no number": (
        changed("values", 0, "low", to="about 1"),
        "mine.values[0].low = 'about 1': allowed is a finite number",
    ),
    "not finite": (changed("values", 2, "value", to=float("nan")), "mine.values[2].value = nan: allowed is a finite"),
    "truth": (changed("values", 0, "high", to=True), "mine.values[0].high = True: allowed is a finite number"),
    "upside down": (changed("values", 0, "low", to=9.0), "mine.values[0].low = 9: allowed is at most high = 1.5"),
    "half a range": (changed("values", 0, "high", to=None), "mine.values[0]: has low; allowed is low and high, or"),
    "both": (
        changed("values", 0, "value", to=1.0),
        "mine.values[0]: has high, low, value; allowed is low and high, or",
    ),
    "quantity": (
        changed("values", 0, "quantity", to="medium"),
        "mine.values[0].quantity = 'medium': allowed is one of",
    ),
    "speed": (changed("values", 0, "speed_kmh", to=700), "mine.values[0].speed_kmh = 700: allowed is 50 to 400 km/h"),
    "twice": (changed("values", 1, "quantity", to="mean"), "mine.values[1]: mean at 275 km/h is given twice; allowed"),
    "key": (changed("editon", to="x"), "mine.editon: unknown key; did you mean edition? allowed are edition, in_force"),
    "model": (changed("model", to="mine"), "mine.model = 'mine': allowed is one of en50318_2002, ac_simple"),
    "force": (changed("in_force", to="2018"), "mine.in_force = '2018': allowed is true or false"),
    "no entries": (changed("values", to=[]), "mine.values: allowed is a list of at least one entry"),
    "entry": (changed("values", 0, to=5.0), "mine.values[0] = 5.0: allowed is a mapping of quantity, speed_kmh"),
    "two verdicts": (
        GOOD | {"other": GOOD["mine"]},
        "other: mean at 275 km/h has a range that was read in mine as well",
    ),
    "list": ([1, 2], "allowed is a mapping of sets"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_file_is_refused_in_one_line(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Read and on the command line, where nothing was ridden yet."""
    tree, said = WRONG[what]
    path = file_of(tmp_path, tree)
    with pytest.raises(ReferenceValuesError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: {said}")
    assert "\n" not in str(caught.value)
    monkeypatch.setattr(sys, "argv", ["validate", "en50318", "--values", str(path)])
    with pytest.raises(SystemExit) as left:
        command.arguments()
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_no_file_and_no_yaml(tmp_path: Path) -> None:
    with pytest.raises(ReferenceValuesError, match="cannot be read"):
        load(tmp_path / "none.yaml")
    (tmp_path / "no.yaml").write_text("a: [1")
    with pytest.raises(ReferenceValuesError, match=r"no\.yaml: is no YAML: line 1"):
        load(tmp_path / "no.yaml")


def test_values_are_for_one_study(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        command.arguments(["rig", "--values", "x.yaml"])
    assert "--values is for en50318 only" in capsys.readouterr().err


def test_a_copy_of_the_file_is_taken(tmp_path: Path) -> None:
    assert load(file_of(tmp_path, read_yaml(OWN))) == load()
    assert command.arguments(["en50318", "--values", str(OWN)]).values == OWN
