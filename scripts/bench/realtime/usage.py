"""What processes and the machine use, read from /proc twice a second by a process of ordinary priority."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

TICKS = float(os.sysconf("SC_CLK_TCK"))
PROC = Path("/proc")
POLICIES = {os.SCHED_OTHER: "ordinary", os.SCHED_FIFO: "SCHED_FIFO", os.SCHED_RR: "SCHED_RR"}


@dataclass(frozen=True)
class Usage:
    """Processor time in s and context switches of all threads of a process since its start."""

    seconds: float
    switches: int


@dataclass(frozen=True)
class Machine:
    """Processor time in s of all cores together since boot: in use, taken by the host, and in all."""

    busy: float
    stolen: float
    total: float


@dataclass(frozen=True)
class Sample:
    """What was seen at one time; ``wall`` in ns as a bag's log times, ``disturbers`` in s of processor time."""

    wall: int
    processes: Mapping[str, Usage]
    own: float
    machine: Machine


@dataclass(frozen=True)
class Share:
    """What a process used of the processor within a cycle, in the mean: time in us, context switches."""

    microseconds: float
    switches: float


@dataclass(frozen=True)
class Load:
    """What the machine did meanwhile, in cores: in use at all, by others than the bench, and taken by the host."""

    busy: float
    others: float
    stolen: float


def fields_of_stat(text: str) -> list[str]:
    """Give the fields of /proc/PID/stat behind the name, which may hold blanks and brackets: the first is the state."""
    return text.rpartition(")")[2].split()


def processor_seconds(pid: int) -> float:
    """Give the processor time in s of all threads of a process; 0 for one that is gone."""
    try:
        fields = fields_of_stat((PROC / str(pid) / "stat").read_text())
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS


def usage(pid: int) -> Usage:
    """Read a process; zeros for one that is gone."""
    switches = 0
    for task in (PROC / str(pid) / "task").glob("*"):
        try:
            lines = (task / "status").read_text().splitlines()
        except OSError:
            continue
        switches += sum(int(line.split()[1]) for line in lines if "ctxt_switches" in line)
    return Usage(processor_seconds(pid), switches)


def machine_of(line: str) -> Machine:
    """Read the first line of /proc/stat; time of guests is within that of the user."""
    user, nice, system, idle, waiting, interrupts, soft, stolen = (int(entry) / TICKS for entry in line.split()[1:9])
    busy = user + nice + system + interrupts + soft
    return Machine(busy, stolen, busy + idle + waiting + stolen)


def sample(processes: Mapping[str, int], own: Iterable[int]) -> Sample:
    """Look at processes (name to process number), at the sum of ``own`` ones, and at the machine."""
    with (PROC / "stat").open() as lines:
        machine = machine_of(lines.readline())
    found = {name: usage(pid) for name, pid in processes.items()}
    mine = sum(map(processor_seconds, own))
    return Sample(time.time_ns(), found, mine + sum(one.seconds for one in found.values()), machine)


def within(samples: Sequence[Sample], begin: int, end: int) -> tuple[Sample, Sample] | None:
    """Give the first and the last sample between two times in ns that know the same processes; None without."""
    inside = [one for one in samples if begin <= one.wall <= end and one.processes]
    return (inside[0], inside[-1]) if len(inside) > 1 else None


def shares(first: Sample, last: Sample, cycle_time: float) -> dict[str, Share]:
    """Give what each process used in a cycle of ``cycle_time`` in s."""
    cycles = (last.wall - first.wall) * 1e-9 / cycle_time
    found = {}
    for name, before in first.processes.items():
        after = last.processes[name]
        spent, switches = after.seconds - before.seconds, after.switches - before.switches
        found[name] = Share(1e6 * spent / cycles, switches / cycles)
    return found


def load(first: Sample, last: Sample) -> Load:
    """Give what the machine did between two samples, in cores."""
    seconds = (last.wall - first.wall) * 1e-9
    busy = last.machine.busy - first.machine.busy
    stolen = last.machine.stolen - first.machine.stolen
    others = max(0.0, busy - (last.own - first.own))
    return Load(busy / seconds, others / seconds, stolen / seconds)


def scheduling(pid: int) -> str:
    """Say how the threads of a process are scheduled: "SCHED_FIFO 40", or how many each way."""
    counts: dict[str, int] = {}
    for task in (PROC / str(pid) / "task").glob("*"):
        try:
            policy, priority = os.sched_getscheduler(int(task.name)), os.sched_getparam(int(task.name)).sched_priority
        except ProcessLookupError:
            continue
        name = POLICIES.get(policy & ~os.SCHED_RESET_ON_FORK, f"policy {policy}")
        text = f"{name} {priority}" if priority else name
        counts[text] = counts.get(text, 0) + 1
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{text}: {count} threads" for text, count in sorted(counts.items(), key=lambda entry: -entry[1]))


def children(parent: int) -> dict[int, list[str]]:
    """Give the children of a process: process number to command line."""
    found = {}
    for entry in PROC.iterdir():
        if not entry.name.isdigit():
            continue
        try:
            if int(fields_of_stat((entry / "stat").read_text())[1]) == parent:
                found[int(entry.name)] = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:
            continue
    return found
