"""Who gets the processor first: the ride, before everything else, where the system allows it; and on which CPUs."""

from __future__ import annotations

import os
import re
import resource
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

PRIORITY = 40
"""Of SCHED_FIFO (1 to 99): above every ordinary process, below the kernel's interrupt threads (50)."""
ROLES: Mapping[str, int] = {
    "rig": 45,
    "controller": 44,
    "environment": 43,
    "publish": 42,
    "serve": 41,
    "transport": PRIORITY,
    "listen": 35,
}
"""Priority by role in real time. rig, controller, environment: the threads of the cycle, each of which computes what
the next one waits for; they share a CPU, and whoever has to move the drive goes before who has sent what it waits for.
publish: hands over what the cycle has left. serve: services, parameters, timers. transport: middleware. listen: all
threads of monitor and recorder."""
IN_CYCLE = ("rig", "controller", "environment")
IN_PYTHON = (*IN_CYCLE, "publish", "serve")
"""Roles of the threads of a node of the loop that take turns with its cycle, by the interpreter's lock."""
CYCLE = ROLES["rig"]
MIDDLE = "transport"
TASKS = Path("/proc/self/task")


@dataclass(frozen=True)
class Answer:
    """What the system granted, in words, and what to do about what it refused (empty: nothing)."""

    granted: str
    advice: str = ""


def go_first(process_ids: Sequence[int]) -> bool:
    """Schedule all threads of these processes by SCHED_FIFO; tell whether the system allows it (else nothing changes).

    One priority for all: whoever has work gets the processor in turn, so that nobody waits for the time slice of
    another (1 to 3 ms), and a recorder below the loop would lose messages when the loop is fast.
    """
    threads = [thread for pid in process_ids for thread in threads_of(pid)]
    changed = []
    try:
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(PRIORITY))
            changed.append(thread)
    except (PermissionError, ProcessLookupError):
        for thread in changed:
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
        return False
    return True


def threads_of(process_id: int) -> list[int]:
    """Give the ids of a process's threads; none if it is over."""
    return [int(task.name) for task in Path(f"/proc/{process_id}/task").glob("*")]


def own_threads() -> dict[int, str]:
    """Give the ids of this process's threads with the names that they have in the kernel."""
    found = {}
    for task in TASKS.glob("*"):
        try:
            found[int(task.name)] = (task / "comm").read_text().strip()
        except OSError:  # it has just ended
            continue
    return found


def priority_of(role: str, top: int = CYCLE, level: bool = False) -> int:
    """Give the priority of a role if that of the cycle is ``top``: the others keep their distance below it.

    With ``level`` all have the one of the transport: in lockstep nobody has a deadline, and a cycle that never waits
    would leave nothing to those below it.
    """
    return max(1, top - CYCLE + (ROLES[MIDDLE] if level else ROLES[role]))


def highest_priority() -> int:
    """Give the highest priority of SCHED_FIFO that this process may have, 0 for none: found by trying it.

    A thread made for it tries, so that nothing changes. The soft limit is raised to the hard one first.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_RTPRIO, (hard, hard))
    found = [0]

    def look() -> None:
        for priority in (os.sched_get_priority_max(os.SCHED_FIFO), hard):
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            except (PermissionError, OSError):
                continue
            found[0] = priority
            return

    looker = threading.Thread(target=look)
    looker.start()
    looker.join()
    return found[0]


def schedule(threads: Iterable[int], priority: int) -> Answer:
    """Schedule threads by SCHED_FIFO with ``priority``, or the highest one below that the system allows."""
    allowed = min(priority, highest_priority())
    if allowed < 1:
        return Answer("ordinary: SCHED_FIFO was refused", why_not_first())
    try:
        _each(threads, lambda thread: os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(allowed)))
    except OSError as error:
        return Answer(f"ordinary: SCHED_FIFO was refused ({error.strerror})", why_not_first())
    advice = (
        f"{allowed} of {priority} is the most that is allowed here: {why_not_first()}" if allowed < priority else ""
    )
    return Answer(f"SCHED_FIFO {allowed}", advice)


def schedule_as_others(threads: Iterable[int]) -> None:
    """Give threads the ordinary class; needed before a child that is over is waited for, or threads end.

    Linux takes a child or a thread that is over off its list in a loop that waits for whoever looks at it in /proc at
    that moment (shrink_dcache_parent). One that comes before all others keeps that one from going on: on all CPUs that
    is for ever.
    """
    _each(threads, lambda thread: os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0)))


def why_not_first() -> str:
    """Say what to type so that this user may have the processor first."""
    if os.geteuid() == 0:
        return (
            "this container gives no real-time priority: start it with --cap-add=SYS_NICE --ulimit rtprio=49; if it "
            "has them, its control group has no time for SCHED_FIFO: on the host type sysctl -w "
            "kernel.sched_rt_runtime_us=-1"
        )
    return (
        'type: echo "$USER - rtprio 49" | sudo tee -a /etc/security/limits.d/90-rig.conf   and log in again (in a '
        "container: start it with --ulimit rtprio=49)"
    )


def cpus_of(text: str) -> frozenset[int]:
    """Read a list of CPUs as the kernel writes it, "2,4-6"; empty: none.

    Raises
    ------
    ValueError
        It is no such list; the text says what it has to be.
    """
    found: set[int] = set()
    for part in text.split(",") if text.strip() else []:
        numbers = re.fullmatch(r"\s*(\d{1,4})(?:-(\d{1,4}))?\s*", part)
        if numbers is None or int(numbers[2] or numbers[1]) < int(numbers[1]):
            raise ValueError(f"{text!r} is no list of CPUs: numbers and ranges with commas between them, as in 2,4-6")
        found.update(range(int(numbers[1]), int(numbers[2] or numbers[1]) + 1))
    return frozenset(found)


def cpus_in_words(cpus: Iterable[int]) -> str:
    """Write CPUs as the kernel does: "2,4-6"."""
    runs: list[list[int]] = []
    for cpu in sorted(cpus):
        if runs and cpu == runs[-1][1] + 1:
            runs[-1][1] = cpu
        else:
            runs.append([cpu, cpu])
    return ",".join(str(low) if low == high else f"{low}-{high}" for low, high in runs)


def stay_on(threads: Iterable[int], cpus: frozenset[int]) -> Answer:
    """Keep threads on these CPUs; none: on all that the process has."""
    if not cpus:
        return Answer(cpus_in_words(os.sched_getaffinity(0)))
    try:
        _each(threads, lambda thread: os.sched_setaffinity(thread, cpus))
    except OSError:
        online = cpus_of(Path("/sys/devices/system/cpu/online").read_text())
        return Answer(
            f"{cpus_in_words(os.sched_getaffinity(0))}: {cpus_in_words(cpus)} was refused",
            f"real_time.cpus and real_time.cycle_cpus have to be of the CPUs {cpus_in_words(online)}; a container may "
            "have fewer (start it with --cpuset-cpus)",
        )
    return Answer(cpus_in_words(cpus & os.sched_getaffinity(0) or cpus))


def _each(threads: Iterable[int], change: Callable[[int], None]) -> None:
    """Change each thread; one that has ended meanwhile does not matter."""
    for thread in threads:
        try:
            change(thread)
        except ProcessLookupError:
            continue
