"""The files of a report: strict JSON, a page that needs nothing else, figures of a size to send."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from energy_monitor.analysis import Settings, analyse
from energy_monitor.bag import read_bag
from energy_monitor.report import ReportError, summary_table, write_report
from energy_monitor.report.cli import main
from energy_monitor.report.document import document, document_text
from energy_monitor.report.html import page
from energy_monitor.report.results import Report
from energy_monitor.report.verdicts import read_limits

pytestmark = pytest.mark.slow

VOID = {"meta", "img", "br", "hr", "link", "input"}
FIGURES = {"displacement", "contact_force", "spectrum", "conservation", "correction", "wires", "timing"}


class Strict(HTMLParser):
    """Checks that tags are balanced and collects what they refer to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.references: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        assert tag not in ("script", "iframe", "object", "link")
        self.references += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open and self.open.pop() == tag


@pytest.fixture(scope="module")
def written(ride_bag: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Report]:
    out = tmp_path_factory.mktemp("report")
    params = out / "params.yaml"
    params.write_text("test_rig_sim:\n  ros__parameters:\n    pantograph: <en50318>\n    drive:\n      mass: 8.0\n")
    return out, write_report(ride_bag, out, params)


def test_files(written: tuple[Path, Report]) -> None:
    out, report = written
    assert report.ok
    assert {file.stem for file in (out / "figures").iterdir()} == FIGURES
    for file in (*(out / "figures").iterdir(), out / "ride.png"):
        assert file.read_bytes().startswith(b"\x89PNG")
        assert file.stat().st_size < 200_000
    assert (out / "report.html").stat().st_size < 2_000_000


def test_document(written: tuple[Path, Report]) -> None:
    out, report = written
    text = (out / "report.json").read_text(encoding="utf-8")
    tree = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert tree["schema_version"] == 1 and tree["ok"] is True
    assert tree["tracking"]["position_error_rms"] == report.tracking.position_error_rms
    assert tree["units"]["tracking.position_error_rms"] == "m"
    assert tree["units"]["timing[].median"] == "s"
    assert tree["parameters"]["test_rig_sim"]["drive.mass"] == 8.0
    assert tree["versions"]["Python"]
    assert "series" not in tree


def test_nothing_is_nan_in_the_document(written: tuple[Path, Report]) -> None:
    _, report = written
    broken = replace(report, ride=replace(report.ride, speed_factor=math.nan, wall_time=math.inf))
    tree = document(broken)
    assert tree["ride"]["speed_factor"] is None and tree["ride"]["wall_time"] is None
    json.dumps(tree, allow_nan=False)


def test_page_is_whole_and_alone(written: tuple[Path, Report]) -> None:
    out, _ = written
    text = (out / "report.html").read_text(encoding="utf-8")
    assert re.sub(r"base64,[A-Za-z0-9+/=]+", "", text).lower().count("http") == 0
    reader = Strict()
    reader.feed(text)
    assert reader.open == []
    assert len(reader.references) == len(FIGURES) + 1
    assert all(reference.startswith("data:image/png;base64,") for reference in reader.references)
    assert "url(" not in text and "@import" not in text


def test_page_escapes_what_the_bag_says(written: tuple[Path, Report]) -> None:
    text = (written[0] / "report.html").read_text(encoding="utf-8")
    assert "<b>differs</b>" not in text and "dE &lt;b&gt;differs&lt;/b&gt; &amp; more" in text
    assert "&lt;en50318&gt;" in text


def test_page_names_what_fails(written: tuple[Path, Report]) -> None:
    _, report = written
    assert "Every requirement holds." in page(report, {})
    failing = replace(report, verdicts=[replace(v, ok=False) if v.key == "position" else v for v in report.verdicts])
    text = page(failing, {})
    assert "1 requirement fails: Position error" in text and "FAILS" in text


def test_summary_table(written: tuple[Path, Report]) -> None:
    console = Console(width=90, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(summary_table(written[1]))
    text = console.export_text()
    assert "Position error" in text and "holds" in text and "0.142 mm" in text


def summary(report: Report) -> str:
    console = Console(width=120, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    console.print(summary_table(report))
    return console.export_text()


def test_summary_names_what_was_late_and_refused(written: tuple[Path, Report]) -> None:
    # The synthetic nodes count two late cycles each and refuse nothing.
    report = written[1]
    text = summary(report)
    assert "Late commands " in text and "Cycles over 2 ms, catenary_model" in text
    assert "Late cycles" not in text and "over 2 ms, test_rig_sim" not in text and "refused" not in text
    lockstep = replace(report, parameters={"test_rig_sim": {"mode": "lockstep"}})
    assert "Late commands" not in summary(lockstep) and "over 2 ms" not in summary(lockstep)
    refusing = replace(report, timing=[replace(entry, refused=3) for entry in report.timing])
    assert re.search(r"Messages refused +12", summary(refusing))


@pytest.mark.parametrize("cycles", [1, 8, 50])
def test_very_short_rides_are_drawn_without_warnings(
    synthetic: Callable[..., Path], tmp_path: Path, cycles: int
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        report = write_report(synthetic(tmp_path / "bag", cycles=cycles), tmp_path / "out")
    assert report.ok


def test_page_of_a_poor_bag(synthetic: Callable[..., Path], tmp_path: Path) -> None:
    # Two cycles, and none of the topics that are not needed.
    more = ("catenary_model/wire_shape", "energy_monitor/conserved_quantities", "impedance_mpc/conserved_quantities")
    bag = synthetic(tmp_path / "bag", cycles=2, without=more)
    write_report(bag, tmp_path / "out")
    assert (tmp_path / "out" / "report.html").is_file()
    assert not (tmp_path / "out" / "figures" / "wires.png").exists()


def run(*arguments: Any) -> int:
    return main([str(argument) for argument in arguments])


def test_exit_codes(synthetic: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = synthetic(tmp_path / "good"), synthetic(tmp_path / "bad", lag=4e-3)
    assert run(good, "--no-html", "--json", tmp_path / "numbers.json") == 0
    assert json.loads((tmp_path / "numbers.json").read_text())["ok"] is True
    assert run(bad, "--no-html", "--out", tmp_path / "out") == 1
    assert "FAILS" in capsys.readouterr().out
    limits = tmp_path / "limits.yaml"
    limits.write_text("position_error_rms: 0.01\n")
    assert run(bad, "--no-html", "--out", tmp_path / "out", "--limits", limits) == 0
    assert not (tmp_path / "out" / "report.html").exists()


def test_unusable_input_is_one_line(tmp_path: Path, ride_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "no.mcap").write_bytes(b"no bag")
    (tmp_path / "bad.yaml").write_text("a: b: c")
    for arguments in (
        (tmp_path / "absent",),
        (tmp_path / "no.mcap",),
        (ride_bag, "--params", tmp_path / "absent.yaml", "--out", tmp_path),
        (ride_bag, "--params", tmp_path / "bad.yaml", "--out", tmp_path),
        (ride_bag, "--limits", tmp_path / "bad.yaml", "--out", tmp_path),
        (ride_bag, "--out", tmp_path / "no.mcap" / "below"),
    ):
        assert run(*arguments) == 2
        error = capsys.readouterr().err
        assert error.startswith("analyze: ") and error.count("\n") == 1


@pytest.mark.parametrize(
    "lacking",
    [
        ("CatenaryState.work", "CatenaryState.impulse"),
        ("ImpedanceCommand.f_predicted",),
        ("ConservedQuantities.work_cat", "ConservedQuantities.delta_work"),
    ],
)
def test_a_bag_of_an_earlier_version_is_refused_in_one_line(
    synthetic: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], lacking: tuple[str, ...]
) -> None:
    # Its force on the wire belongs to another instant: numbers from it would be wrong and not only fewer.
    assert run(synthetic(tmp_path / "bag", cycles=20, lacking=lacking), "--out", tmp_path / "out") == 2
    error = capsys.readouterr().err
    fields = ", ".join(name.split(".")[1] for name in lacking)
    assert f"{lacking[0].split('.')[0]} in this bag has no field {fields}: it was recorded by another version" in error
    assert error.startswith("analyze: ") and error.count("\n") == 1


COUNTS = tuple(f"CycleTiming.messages_{kind}" for kind in ("late", "lost", "doubled", "swapped"))


@pytest.mark.parametrize("lacking", [COUNTS, ()], ids=["before they were counted", "counted"])
def test_what_was_late_lost_doubled_and_swapped_is_told_or_not_known(
    synthetic: Callable[..., Path], tmp_path: Path, lacking: tuple[str, ...]
) -> None:
    bag = read_bag(synthetic(tmp_path / "bag", cycles=550, lacking=lacking))
    report = analyse(bag, Settings(run_in=0.3), read_limits())
    timing = json.loads(document_text(report))["timing"]
    assert [entry["late"] for entry in timing] == [1] * 4
    names = [name.split(".")[1] for name in COUNTS]
    found = [[entry[name] for name in names] for entry in timing]
    assert found == ([[None] * 4] * 4 if lacking else [[0, 1, len(entry["node"]), 0] for entry in timing])
    section = page(report, {}).split("<h3>Late, lost, doubled, swapped</h3>")[1].split("<h2>")[0]
    assert ("Not known: this bag was recorded before" in section) is bool(lacking)
    rows = re.findall(r"<code>(\w+)</code></td>(.*)</tr>", section)
    assert len(rows) == (0 if lacking else 4)
    for node, cells in rows:
        assert re.findall(r">(\d+)<", cells) == ["0", "1", str(len(node)), "0"]


def test_parts_of_a_bag_of_before_and_after_have_what_both_have(synthetic: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "both").mkdir()
    for name, first, lacking in (("a", 0, ()), ("b", 300, COUNTS)):
        (file,) = synthetic(tmp_path / name, cycles=300, first=first, lacking=lacking).glob("*.mcap")
        file.rename(tmp_path / "both" / f"{name}.mcap")
    timing = read_bag(tmp_path / "both").tables["/test_rig_sim/timing"]
    assert len(timing) == 12 and timing["late"][-1] == 1 and "messages_lost" not in timing.columns


@pytest.mark.parametrize("name", ["tiny", "tiny.mcap", "tiny.db3", "/dev/null"])
def test_what_is_no_bag_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    file = tmp_path / name
    if not file.exists():
        file.write_text("hi\n")
    assert run(file) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"analyze: {file}: ") and error.count("\n") == 1
    assert "nothing was recorded" not in error


def test_numbers_on_standard_output(ride_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(ride_bag, "--no-html", "--out", tmp_path / "out", "--json", "-") == 0
    text, error = capsys.readouterr()
    assert json.loads(text)["ok"] is True
    assert "Position error" in error
    assert not (tmp_path / "out").exists() and not Path("-").exists()


def test_a_device_is_written_to_and_not_replaced(ride_bag: Path, tmp_path: Path) -> None:
    assert run(ride_bag, "--no-html", "--out", tmp_path, "--json", "/dev/null") == 0
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("place", ["report.html.write_page", "report.document.document_text", "bag.read_bag"])
def test_an_interruption_leaves_nothing_half(
    ride_bag: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    place: str,
) -> None:
    def stop(*_: Any, **__: Any) -> None:
        for file in tmp_path.rglob("*"):
            assert file.name not in ("report.html", "report.json") or place.endswith("text")
        raise KeyboardInterrupt

    for module in (place.rpartition(".")[0], "report.write"):
        monkeypatch.setattr(f"energy_monitor.{module}.{place.rpartition('.')[2]}", stop, raising=False)
    assert run(ride_bag, "--out", tmp_path / "out") == 130
    assert capsys.readouterr().err == "analyze: interrupted\n"
    left = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*") if file.is_file()}
    assert not any(name.startswith("out/.") or name == "out/report.json" for name in left)
    assert place.endswith("text") or left == set()


def test_help_needs_nothing_but_python() -> None:
    blocker = (
        "import sys\n"
        "for name in ('rclpy', 'numpy', 'matplotlib', 'rosbags', 'rich', 'yaml', 'scipy'): sys.modules[name] = None\n"
        "from energy_monitor.{module} import main\n"
        "main(['--help'])\n"
    )
    for module, prog in (("report.cli", "scripts/analyze.sh"), ("record", "scripts/record.sh")):
        code = blocker.format(module=module)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"usage: {prog} ")


def test_default_place(synthetic: Callable[..., Path], tmp_path: Path) -> None:
    bag = synthetic(tmp_path / "ride" / "bag", cycles=20)
    run(bag, "--no-html")
    assert (tmp_path / "ride" / "bag_report" / "report.json").is_file()
    (tmp_path / "ride" / "params.yaml").write_text("test_rig_sim:\n  ros__parameters:\n    seed: 7\n")
    run(tmp_path / "ride" / "bag", "--no-html")
    tree = json.loads((tmp_path / "ride" / "report.json").read_text())
    assert tree["parameters"] == {"test_rig_sim": {"seed": 7}}


def test_report_of_a_cut_recording(synthetic: Callable[..., Path], tmp_path: Path) -> None:
    file = next(synthetic(tmp_path / "bag").glob("*.mcap"))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size * 7 // 10])
    with pytest.raises(ReportError):
        write_report(tmp_path / "absent", tmp_path)
    report = write_report(cut, tmp_path / "out", html=False)
    assert not report.ride.recording_whole and not report.ok
    assert report.conservation.delta_p == pytest.approx(-0.5 * 0.002 * report.ride.cycles, rel=1e-9)
