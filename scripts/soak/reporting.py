"""The report of a long ride's bag: whether it comes, how long it takes, and how much memory."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from soak.judge import Verdict

SECONDS = 60.0
MEMORY = 1024.0
"""MiB."""
FILES = ("report.json", "report.html", "ride.png")
USABLE = (0, 1)
"""Exit codes of a report: every requirement of the ride holds, or one does not."""


@dataclass(frozen=True)
class Reported:
    """Exit code, time in s, most resident memory in MiB, size of the page in bytes, files that are not there."""

    code: int
    seconds: float
    mib: float
    page: int
    absent: list[str]


def report(bag: Path, out: Path, log: Path) -> Reported:
    """Make the report as scripts/analyze.sh does, in a process of its own."""
    began = time.monotonic()
    with log.open("wb") as output:
        child = subprocess.Popen(
            [sys.executable, "-m", "energy_monitor.report.cli", str(bag), "--out", str(out)],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        try:
            _, status, usage = os.wait4(child.pid, 0)
        except BaseException:
            child.kill()
            child.wait()
            raise
    child.returncode = code = os.waitstatus_to_exitcode(status)
    page = out / "report.html"
    return Reported(
        code=code,
        seconds=time.monotonic() - began,
        mib=usage.ru_maxrss / 1024.0,
        page=page.stat().st_size if page.is_file() else 0,
        absent=[name for name in FILES if not (out / name).is_file()],
    )


def judge_report(found: Reported) -> list[Verdict]:
    """Judge the report; what it says of the ride is another matter."""
    unusable = len(found.absent) + (found.code not in USABLE)
    said = "every requirement of the ride holds" if found.code == 0 else f"exit code {found.code}"
    return [
        Verdict("report: files that are not there", float(unusable), 0.0, "", ", ".join(found.absent) or said),
        Verdict("report: time", found.seconds, SECONDS, "s", f"page {found.page / 1e6:.2f} MB"),
        Verdict("report: most memory", found.mib, MEMORY, "MiB"),
    ]
