"""A soak from the ride to the verdicts: tables for people, a document for programs, a picture."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from bench.realtime.tables import PROCESSES
from energy_monitor.bag_channel import BagError
from phil_base.atomic import together
from phil_base.command_line import write_json
from soak.judge import Verdict, judge_lists, judge_samples, quantity, times, trends
from soak.looks import QUANTITIES, Sample
from soak.options import Options
from soak.picture import draw
from soak.records import Records, judge_records, records
from soak.reporting import Reported, judge_report, report
from soak.session import Soaked, soak

GOOD, BAD, UNWRITTEN = 0, 1, 3
WIDTH = 132
"""Columns of the tables where there is no terminal."""


def carry_out(options: Options) -> int:
    """Ride, judge, print, write; 0 if everything holds, 1 if something does not.

    Raises
    ------
    SoakError
        The ride did not come to its first cycle.
    KeyboardInterrupt
        Ctrl-C or a signal.
    """
    _say(f"{options.minutes:g} min at {options.rate:g} Hz, {options.mode}, {options.viewers} viewers -> {options.out}")
    soaked = soak(options, _say)
    _say("the ride has ended; looking at its bag")
    bag = options.out / "ride" / "bag"
    verdicts = _ride(soaked)
    verdicts += judge_samples(soaked.samples, PROCESSES)
    verdicts += judge_lists({"/dev/shm: files that nobody holds and nobody removed": soaked.left})
    found: Records | None = None
    try:
        found = records(bag, options.cycles, options.mode == "lockstep")
        verdicts += judge_records(found, options.cycle_time, options.mode == "lockstep")
    except BagError as error:
        verdicts.append(Verdict("bag: cannot be read", 1.0, 0.0, "", str(error)))
    reported = report(bag, options.out / "report", options.out / "report.log")
    verdicts += judge_report(reported)
    _print(options, soaked, verdicts)
    if not _write(options, soaked, verdicts, found, reported):
        return UNWRITTEN
    return GOOD if all(one.ok for one in verdicts) else BAD


def _ride(soaked: Soaked) -> list[Verdict]:
    words = [line for line in soaked.said.strip().splitlines() if line.startswith("the ride failed")]
    code = None if soaked.code is None else float(abs(soaked.code))
    return [Verdict("ride: exit code", code, 0.0, "", words[0] if words else "")]


def _print(options: Options, soaked: Soaked, verdicts: Sequence[Verdict]) -> None:
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(_use(soaked.samples))
    table = Table(title="What must hold", title_justify="left")
    for head in ("", "found", "at most", "", "", "remark"):
        table.add_column(head, justify="right" if head in ("found", "at most") else "left")
    for one in verdicts:
        shown = "-" if one.found is None else f"{one.found:.4g}"
        table.add_row(one.name, shown, f"{one.limit:.4g}", one.unit, "holds" if one.ok else "FAILS", one.remark)
    console.print(table)
    if soaked.work is not None:
        work = soaked.work
        console.print(
            f"- viewers: {work.visits} visits, {work.messages} messages, {work.topics} topics", highlight=False
        )
    console.print(f"- picture: {options.out / 'memory.png'}", highlight=False, soft_wrap=True)


def _use(samples: Sequence[Sample]) -> Table:
    table = Table(title="Processes", title_justify="left")
    for head in ("", "resident MiB", "anonymous", "file", "shared", "processor, cores", "threads", "open files"):
        table.add_column(head, justify="right" if head else "left")
    for process in PROCESSES:
        looks = [one.looks[process] for one in samples if process in one.looks]
        if not looks:
            continue
        last, time = looks[-1], times([one for one in samples if process in one.looks])
        cores = (last.seconds - looks[0].seconds) / max(float(time[-1]), 1e-9)
        memory = (f"{kib / 1024.0:.1f}" for kib in (last.resident, last.anonymous, last.file, last.shared))
        table.add_row(process, *memory, f"{cores:.3f}", str(last.threads), str(last.files))
    return table


def _write(
    options: Options, soaked: Soaked, verdicts: Sequence[Verdict], found: Records | None, reported: Reported
) -> bool:
    if soaked.samples:
        with together(options.out) as drafts:
            draw(soaked.samples, PROCESSES, drafts / "memory.png")
    if not options.json:
        return True
    document = {
        "minutes": options.minutes,
        "rate": options.rate,
        "mode": options.mode,
        "parameters": list(options.parameters),
        "machine": platform.machine(),
        "python": platform.python_version(),
        "cores": len(os.sched_getaffinity(0)),
        "load average": os.getloadavg()[0],
        "ok": all(one.ok for one in verdicts),
        "verdicts": [asdict(one) | {"ok": one.ok} for one in verdicts],
        "processes": {name: _process(soaked.samples, name) for name in PROCESSES},
        "streams": [asdict(one) for one in found.streams] if found else [],
        "behind the rig s": {topic: asdict(one) for topic, one in found.behind.items()} if found else {},
        "report": asdict(reported),
        "viewers": asdict(soaked.work) if soaked.work else None,
        "time s": times(soaked.samples).tolist() if soaked.samples else [],
        "logs bytes": [one.logs for one in soaked.samples],
    }
    return write_json(options.json, _finite(document))


def _process(samples: Sequence[Sample], name: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "trends": {key: asdict(one) for key, one in trends(samples, name, QUANTITIES).items()},
        "proportional kiB": [one.deep[name].proportional for one in samples if name in one.deep],
    }
    return found | {key: quantity(samples, name, key)[1].tolist() for key in QUANTITIES}


def _finite(entry: Any) -> Any:
    """Replace numbers that JSON does not know."""
    if isinstance(entry, dict):
        return {key: _finite(value) for key, value in entry.items()}
    if isinstance(entry, list):
        return [_finite(value) for value in entry]
    return None if isinstance(entry, float) and not math.isfinite(entry) else entry


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
