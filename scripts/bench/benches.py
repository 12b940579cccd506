"""What is measured: the catenary's step, long lines, the controller's cycle, the whole loop in real time."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.distribution import distribution
from bench.outcome import Outcome


def catenary(quick: bool) -> Outcome:
    """Time the catenary's step: distribution, spans, phases, competitors."""
    from bench.catenary import run

    return run(quick)


def lines(quick: bool) -> Outcome:
    """Time and memory from the file of a long line to a model at rest; statics against the dense way."""
    from bench.lines import run

    return run(quick)


def mpc(quick: bool) -> Outcome:
    """Time a whole cycle of the controller over segment, horizon and moves; its parts; its solver against others."""
    from bench.mpc import run

    return run(quick)


def realtime(quick: bool) -> Outcome:
    """Ride in real time with the four nodes and the recorder; turnaround of each node, round trip of the rig."""
    from energy_monitor.bag import read_bag

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "ride"
        command = [sys.executable, "-m", "ride", "--mode", "realtime", "--duration", "5" if quick else "30"]
        done = subprocess.run([*command, "--no-report", "--out", str(out)], check=False)
        if done.returncode:
            raise SystemExit(done.returncode)
        tables = read_bag(out / "bag").tables
    rows, samples, late = [], {}, {}
    for node in ("test_rig_sim", "impedance_mpc", "catenary_model", "energy_monitor"):
        timing = tables[f"/{node}/timing"]
        name = "rig: state out to command in" if node == "test_rig_sim" else f"{node}: message in to message out"
        samples[name] = np.concatenate([np.asarray(entry, dtype=np.float64) for entry in timing.entries("turnaround")])
        late[node] = int(timing["late"].max())
        goal = (2.0, "p99", "one cycle") if node == "test_rig_sim" else (None, "median", "")
        rows.append(distribution(name, samples[name], *goal))
    title = f"real time, {rows[0].count} cycles of 2 ms, late commands: {late['test_rig_sim']}"
    return Outcome(title, rows, samples)


BENCHES: dict[str, Callable[[bool], Outcome]] = {"catenary": catenary, "lines": lines, "mpc": mpc, "realtime": realtime}
