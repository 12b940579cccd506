"""Faults done to a ride for real, by the script."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.integration


@pytest.mark.alone
def test_a_killed_controller_retracts_the_drive_and_joins_again(tmp_path: Path, node_environment) -> None:
    table = tmp_path / "faults.json"
    command = [sys.executable, "-m", "faults", "kill-impedance_mpc", "--json", str(table)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, env=node_environment)
    assert done.returncode == 0, done.stdout + done.stderr
    (row,) = json.loads(table.read_text())["rows"]
    assert row["ok"] and row["ended"] == "retracts" and 0.1 < row["safe_after"] < 3.0
    assert 0.19 < row["peaks"]["position"] < 0.3  # where it retracts to
    assert any("50 late" in text for text in row["reported"]) and "impedance_mpc started again" in row["rejoined"]


@pytest.mark.parametrize(
    ("words", "said"),
    [(["no-such-fault"], "no-such-fault"), (["--rate", "1"], "--rate"), (["none", "--update-docs"], "--update-docs")],
)
def test_wrong_use_is_one_line_and_2(words: list[str], said: str, node_environment) -> None:
    command = [sys.executable, "-m", "faults", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=node_environment)
    assert done.returncode == 2 and said in done.stderr.splitlines()[-1] and "Traceback" not in done.stderr
