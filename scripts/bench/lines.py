"""Long lines: time and memory from the text of a line to a model at rest, and its statics against the dense way."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from bench import dense_statics
from catenary_model import statics
from catenary_model.build import Config, build, check
from catenary_model.line import DROPPERS_3_1, Dropper, Line, Span
from catenary_model.line_file import dump_line, load_line
from phil_study.distribution import distribution
from phil_study.outcome import Outcome, Sheet

SPANS = (1, 10, 100, 400, 1000)
GOALS = {400: 2000.0, 1000: 5000.0}
"""ms until a line of so many spans is ready."""
DENSE_UP_TO = 200
"""Spans to which the dense way is tried: it takes 0.4 GB there, and the square of that for more."""
ROUNDS, QUICK_ROUNDS = 5, 2
MIB = 1024.0**2


def line_of(spans: int) -> Line:
    """A line no span of which is like another: lengths of 55 to 60 m, droppers at Table 3.1's shares of them."""
    length = 60.0 - 5.0 * np.random.default_rng(spans).random(spans)
    made = tuple(Span(float(x), tuple(Dropper(float(x / 60.0 * at)) for at in DROPPERS_3_1)) for x in length)
    return Line(spans=made, name=f"{spans} spans")


def ready(path: str) -> dict[str, float]:
    """Build the default line, so that code is loaded; then one from a file; times in s, memory in MiB."""
    build(Config())
    before = _peak()
    start = perf_counter()
    line = load_line(path)
    read = perf_counter()
    config = Config(line=line)
    check(config)
    build(config)
    return {"read": read - start, "ready": perf_counter() - start, "before": before, "peak": _peak()}


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0 / MIB


def run(quick: bool) -> Outcome:
    """Measure every length in processes of its own, then the statics alone, both ways in turn."""
    lengths = SPANS[:3] if quick else SPANS
    samples: dict[str, NDArray[np.float64]] = {}
    rows = []
    sheet: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        for spans in lengths:
            path = Path(folder) / f"line_{spans}.yaml"
            path.write_text(dump_line(line_of(spans)), encoding="utf-8")
            found = [_in_a_process(path) for _ in range(QUICK_ROUNDS if quick else ROUNDS)]
            name = f"{spans} spans: file to model at rest"
            samples[name] = np.array([one["ready"] for one in found])
            rows.append(distribution(name, samples[name], GOALS.get(spans), "median", "a start that nobody waits for"))
            read = float(np.median([one["read"] for one in found]))
            peak = max(one["peak"] for one in found)
            memory = {"peak_mib": peak, "before_mib": found[0]["before"]}
            sheet.append({"spans": spans, "read_s": read, **memory, **_statics(line_of(spans))})
    columns = {
        "spans": "spans",
        "read_s": "of it reading, s",
        "peak_mib": "peak of the process, MiB",
        "before_mib": "with the default line, MiB",
        "statics_ms": "statics, ms",
        "dense_ms": "dense statics, ms",
        "difference_m": "largest difference, m",
    }
    title = "long lines, no span like another, compiled code in numba's cache"
    return Outcome(
        title, rows, samples=samples, sheets=[Sheet("lines", "memory, and statics both ways", columns, sheet)]
    )


def _in_a_process(path: Path) -> dict[str, float]:
    code = "import json, sys; from bench.lines import ready; print(json.dumps(ready(sys.argv[1])))"
    done = subprocess.run([sys.executable, "-c", code, str(path)], check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def _statics(line: Line) -> dict[str, object]:
    """Solve a line at rest both ways; ms, and the largest difference of the contact wire in m."""
    statics.solve.cache_clear()
    start = perf_counter()
    rest = statics.solve(line)
    own = perf_counter()
    if len(line.spans) > DENSE_UP_TO:
        return {"statics_ms": 1e3 * (own - start), "dense_ms": None, "difference_m": None}
    dense = dense_statics.solve(line)
    end = perf_counter()
    zeta = np.linspace(0.0, line.period, 2003)
    difference = float(np.abs(rest.contact(zeta) - dense.contact(zeta)).max())
    return {"statics_ms": 1e3 * (own - start), "dense_ms": 1e3 * (end - own), "difference_m": difference}
