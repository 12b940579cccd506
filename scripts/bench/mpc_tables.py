"""Tables of the controller's bench: parts of a cycle, and the solvers side by side."""

from __future__ import annotations

import numpy as np

from bench import mpc_split
from bench.mpc_contest import Entry, accuracy
from bench.mpc_problems import Sequence
from bench.mpc_solvers import CONTROLLER, SOLVERS, version
from bench.mpc_split import Split
from phil_study.outcome import Sheet


def parts(split: Split, case: str) -> Sheet:
    """Show where the time of a cycle goes."""
    median, p99 = np.percentile(split.whole, [50.0, 99.0])
    rows: list[dict[str, object]] = []
    left = float(median)
    for part in mpc_split.PARTS:
        us, high = np.percentile(np.array(split.spent[part]) - 0.5 * split.clock, [50.0, 99.0])
        left -= float(us)
        rows.append({"part": part, "us": float(us), "p99_us": float(high), "percent": 100.0 * float(us / median)})
    rows.append({"part": mpc_split.REST, "us": left, "p99_us": None, "percent": 100.0 * left / float(median)})
    rows.append({"part": "whole cycle", "us": float(median), "p99_us": float(p99), "percent": 100.0})
    columns = {"part": "part", "us": "median us", "p99_us": "p99 us", "percent": "% of the whole"}
    return Sheet("parts", f"parts of a cycle: {case}", columns, rows)


def solvers(key: str, title: str, found: dict[str, Entry]) -> Sheet:
    """Show how long the solvers took on one sequence."""
    rows: list[dict[str, object]] = []
    for name, entry in found.items():
        times = entry.times * 1e3
        ratios = [
            float(np.median(theirs[1:]) / np.median(ours[1:]))
            for theirs, ours in zip(entry.rounds, found[CONTROLLER].rounds, strict=True)
        ]
        rows.append(
            {
                "solver": name,
                "version": version(name),
                "median_ms": float(np.median(times)),
                "best_round_ms": float(np.median(entry.best)) * 1e3,
                "p99_ms": float(np.percentile(times, 99.0)),
                "best_p99_ms": float(np.percentile(entry.best, 99.0)) * 1e3,
                "max_ms": float(times.max()),
                "first_ms": entry.first * 1e3,
                "ratio": float(np.median(ratios)),
                "failures": entry.failures,
            }
        )
    columns = {
        "solver": "solver",
        "version": "version",
        "median_ms": "median ms",
        "best_round_ms": "best round's",
        "p99_ms": "p99 ms",
        "best_p99_ms": "best round's",
        "max_ms": "max ms",
        "first_ms": "first ms",
        "ratio": "ratio",
        "failures": "unsolved",
    }
    return Sheet(f"solvers_{key}", f"{title}, {len(next(iter(found.values())).solved)} problems", columns, rows)


def agreement(key: str, title: str, sequence: Sequence, found: dict[str, Entry]) -> Sheet:
    """Show how good the solutions are on one sequence, and whether they are the same every time."""
    truth = found[CONTROLLER].solutions
    rows: list[dict[str, object]] = []
    for name, entry in found.items():
        good = accuracy(sequence, truth, entry)
        rows.append(
            {
                "solver": name,
                "u_um": good.reference,
                "f_n": good.correction,
                "violation": good.violation,
                "cost": good.gap,
                "same_again": "same" if entry.same_again else "differ",
                "same_elsewhere": "same" if entry.same_elsewhere else "differ",
            }
        )
    columns = {
        "solver": "solver",
        "u_um": "u_tr(k), um",
        "f_n": "F_cor(k), N",
        "violation": "beyond a hard bound",
        "cost": "cost",
        "same_again": "bits, again",
        "same_elsewhere": "bits, elsewhere",
    }
    return Sheet(f"agreement_{key}", title, columns, rows)


def kinds() -> Sheet:
    """List the solvers."""
    rows: list[dict[str, object]] = [
        {"solver": name, "package": known.package, "version": version(name) or "not installed", "kind": known.kind}
        for name, known in SOLVERS.items()
    ]
    columns = {"solver": "solver", "package": "package", "version": "version", "kind": "method; what it keeps"}
    return Sheet("solver_kinds", "the solvers", columns, rows)
