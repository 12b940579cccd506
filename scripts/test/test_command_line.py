"""Command lines: what is refused, in one line that can be read, and before any work is begun."""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.__main__ import arguments as bench
from doctor.__main__ import arguments as doctor
from faults.__main__ import arguments as faults
from fuzz.__main__ import arguments as fuzz
from phil_base.command_line import Parser, path, real, seconds, whole, write_json
from ride.options import parse as ride
from soak.options import parse as soak
from validate.__main__ import arguments as validate

SCRIPTS: dict[str, tuple[Callable[[list[str]], object], list[str]]] = {
    "bench": (bench, ["catenary"]),
    "validate": (validate, ["en50318"]),
    "faults": (faults, []),
    "soak": (soak, []),
    "doctor": (doctor, []),
    "fuzz": (fuzz, []),
    "run": (ride, []),
}
ODD = ["nan", "inf", "-inf", "1_0", "\u0663", "0x10", " 5", "5 ", "5s", "1,5", "", "1e400", "true", "1e", "."]


def refusal(capsys: pytest.CaptureFixture[str], run: Callable[[list[str]], object], argv: list[str]) -> str:
    """Give the one line with which a command line is refused."""
    with pytest.raises(SystemExit) as ended:
        run(argv)
    out, said = capsys.readouterr()
    assert ended.value.code == 2 and out == ""
    assert said.count("\n") == 1 and said.endswith("\n") and len(said) < 1000
    assert said[:-1].isprintable() and not said.startswith("usage")
    return said


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_finite_number_is_read(value: float) -> None:
    assert real(repr(value)) == value
    assert whole(str(int(math.fmod(value, 2.0**63)))) == int(math.fmod(value, 2.0**63))


@pytest.mark.parametrize("text", ODD)
def test_what_is_no_number_of_ours_is_refused(text: str) -> None:
    for read in (real, whole, seconds):
        with pytest.raises(argparse.ArgumentTypeError):
            read(text)


def test_a_whole_number_has_neither_a_point_nor_thousands_of_digits() -> None:
    for text in ("1.5", "1e3", "9" * 5000):
        with pytest.raises(argparse.ArgumentTypeError):
            whole(text)


def test_a_name_of_a_file_is_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert path("a b/\u00e4") == Path("a b/\u00e4")
    for name in ("", os.fsdecode(b"\xff\xfe")):
        with pytest.raises(argparse.ArgumentTypeError):
            path(name)
    below = tmp_path / os.fsdecode(b"\xff")
    below.mkdir()
    monkeypatch.chdir(below)  # a relative name is no text either then
    with pytest.raises(argparse.ArgumentTypeError):
        path("ride")


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("argv", [["--nonsense"], ["--nonsense=" + "x" * 5000], ["--\x1b[31m\nred"], ["--out"]])
def test_every_script_refuses_in_one_line(script: str, argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    run, needed = SCRIPTS[script]
    assert refusal(capsys, run, [*needed, *argv]).startswith(f"{script}: ")


@pytest.mark.parametrize("script", [name for name in SCRIPTS if name != "run"])
def test_a_folder_in_place_of_a_file_is_refused_before_the_work(
    script: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, needed = SCRIPTS[script]
    out = ["--out", str(tmp_path / "out")] if script == "soak" else []
    for file in (tmp_path, tmp_path / "none" / "x.json", Path("/dev/null/x.json")):
        said = refusal(capsys, run, [*needed, *out, "--json", str(file)])
        assert "--json" in said and str(file) in said


@pytest.mark.parametrize("script", ["bench", "validate", "faults", "soak", "fuzz"])
def test_a_file_in_place_of_a_folder_is_refused_before_the_work(
    script: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, needed = SCRIPTS[script]
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / ("a" * 300)):
        said = refusal(capsys, run, [*needed, "--out", str(folder)])
        assert "--out" in said


@pytest.mark.parametrize(("script", "needed"), [("bench", ["realtime"]), ("soak", [])])
@pytest.mark.parametrize("entry", ["test_rig_sim.speed_kmh=4000", "nobody.x=1"])
def test_a_parameter_that_a_ride_would_refuse_is_refused_before_it(
    script: str, needed: list[str], entry: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    said = refusal(capsys, SCRIPTS[script][0], [*needed, "--out", str(out), "--set", entry])
    assert entry.partition(".")[0] in said
    assert not out.exists()


@pytest.mark.parametrize("wrong", [["9" * 5000], ["--params-file", "\x1b[31mred"], ["-p", os.fsdecode(b"\xff:=1")]])
@pytest.mark.slow
def test_arguments_that_ros_cannot_take_end_a_node_with_a_line_that_can_be_read(wrong: list[str]) -> None:
    code = "import sys; from phil_node.process import run; sys.exit(run(lambda: None, sys.argv))"
    command = [sys.executable, "-c", code, "--ros-args", *wrong]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and len(done.stderr) < 1000 and done.stderr[:-1].isprintable()


def test_names_too_long_for_the_disk_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for option in ("--repeat", "--bag"):
        assert "File name too long" in refusal(capsys, fuzz, [option, "a" * 300])


def test_a_document_that_cannot_be_written_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert write_json(tmp_path / "good.json", {"a": 1})
    assert json.loads((tmp_path / "good.json").read_text()) == {"a": 1}
    assert not write_json(Path("/dev/full"), {"a": 1})
    said = capsys.readouterr().err
    assert said == "--json /dev/full cannot be written: No space left on device\n"


def test_what_is_there_is_left_by_the_check(tmp_path: Path) -> None:
    file = tmp_path / "old.json"
    file.write_text("old")
    Parser().check_places(file, tmp_path / "new" / "deep")
    assert file.read_text() == "old" and (tmp_path / "new" / "deep").is_dir()
