"""What a node's process asks of the system for its ride in real time, and what it was granted.

Scheduling class and CPUs by role, memory that is there, timers that are not put off. Linux gives each of them by
thread or by process; none changes a number of a ride, all change when it comes. Nothing here imports rclpy.
"""

from __future__ import annotations

import ctypes
import os
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import field_validator

from phil_base import memory
from phil_base.parameters import Group, parameter
from phil_base.scheduling import (
    CYCLE,
    IN_CYCLE,
    IN_PYTHON,
    MIDDLE,
    Answer,
    cpus_of,
    highest_priority,
    own_threads,
    priority_of,
    schedule,
    schedule_as_others,
    stay_on,
)

FIFO, ORDINARY = "fifo", "ordinary"
TOGETHER = "together"
PR_SET_TIMERSLACK, PR_GET_TIMERSLACK = 29, 30
STACK = 256 * 1024
"""Bytes of stack that a thread with a role has at hand: several times what a cycle was seen to use."""

_libc = ctypes.CDLL(None, use_errno=True)


class RealTime(Group):
    """What the process asks of the system when its node is activated; what is refused is said, and the node goes on."""

    scheduling: str = parameter(
        "fifo: all threads before every ordinary process (SCHED_FIFO), where the system allows it; ordinary: as the "
        "process was started",
        choices=(FIFO, ORDINARY),
    )
    priority: int = parameter(
        f"Priority of the cycle's thread, the others' are some below; 0: {CYCLE}, below the kernel's interrupt threads "
        "at 50; in lockstep all threads have that of the transport",
        unit="1",
        low=0,
        high=98,
    )
    cpus: str = parameter("CPUs for all threads, as in 2,4-6; empty: those that the process has")
    cycle_cpus: str = parameter(
        f"CPUs for the cycle's thread; {TOGETHER}: the last one that the process has, for the cycles of all nodes of "
        "the loop, which follow one another, and the rest for all other threads (with fifo, in real time); "
        "empty: as cpus"
    )
    lock_memory: bool = parameter("Keep in memory what the process has touched (mlockall), swapped out by nobody")
    keep_heap: bool = parameter("Let malloc keep what is freed, instead of giving it back to the system")
    heap_reserve: float = parameter(
        "Heap that is touched at activation, so that the cycle finds it there: for each thread of the cycle so much, "
        "and for Python's small objects",
        unit="MiB",
        low=0.0,
        high=1024.0,
    )
    malloc_arenas: int = parameter(
        "Most arenas of malloc, whose locks threads share; 0: glibc's rule, 8 a CPU", unit="1", low=0, high=1024
    )
    timer_slack: float = parameter(
        "Delay of a timer that the kernel may add to wake up less often (ordinary class only); 0: as the process was "
        "started, 5e-5 s as a rule",
        unit="s",
        low=0.0,
        high=0.1,
    )

    @field_validator("cpus", "cycle_cpus")
    @classmethod
    def _is_list(cls, text: str) -> str:
        if text != TOGETHER:
            cpus_of(text)
        return text


@dataclass
class Granted:
    """What a process was granted: figures for /diagnostics, and a line for each thing that was refused."""

    figures: dict[str, str] = field(default_factory=dict)
    advice: list[str] = field(default_factory=list)

    def take(self, name: str, answer: Answer) -> None:
        """Add an answer; what was said before of the same thing is replaced."""
        self.figures[name] = answer.granted
        self.advice = [line for line in self.advice if not line.startswith(f"{name}: ")]
        if answer.advice:
            self.advice.append(f"{name}: {answer.granted}: {answer.advice}")


@dataclass
class _Standing:
    """What was asked for this process last; threads that come later are given the same."""

    wanted: RealTime | None = None
    level: bool = False
    granted: Granted = field(default_factory=Granted)
    roles: dict[int, str] = field(default_factory=dict)
    cpus: frozenset[int] = field(default_factory=lambda: frozenset(os.sched_getaffinity(0)))
    """What the process was started with."""
    lock: threading.Lock = field(default_factory=threading.Lock)


_STANDING = _Standing()
"""A process has one standing with the system, whatever objects are in it."""


def apply(wanted: RealTime, role: str = MIDDLE, level: bool = False) -> Granted:
    """Ask the system for what is wanted, for this process and all threads that it has now; never raises.

    Threads that are made later inherit class, priority, CPUs and timer slack from the thread that makes them.

    Args:
        wanted: the parameters
        role: of the threads that have not been given one by :func:`set_thread`, a key of ``scheduling.ROLES``
        level: one priority for all (lockstep)
    """
    with _STANDING.lock:
        granted = Granted()
        before, _STANDING.wanted = _STANDING.wanted, wanted
        _STANDING.level, _STANDING.granted = level, granted
        if wanted.scheduling == ORDINARY and before is not None and before.scheduling == FIFO:
            schedule_as_others(own_threads())
        threads = own_threads()
        _STANDING.roles = {thread: known for thread, known in _STANDING.roles.items() if thread in threads}
        others = [thread for thread in threads if thread not in _STANDING.roles]
        granted.take("scheduling", _scheduled(wanted, others, role, level))
        granted.take("CPUs", stay_on(others, _for_others(wanted, _first(wanted), level)))
        granted.take("timer slack", _slack(others, wanted.timer_slack))
        for thread, known in _STANDING.roles.items():
            _give(thread, known)
        granted.take("heap", _heap(wanted))
        granted.take("memory", memory.lock_memory() if wanted.lock_memory else Answer("not locked, as asked for"))
        memory.touch_stack(STACK)
        return granted


def set_thread(role: str) -> Answer:
    """Give the calling thread a role: its class, priority and CPUs, now and at each later :func:`apply`.

    Call it at the thread's start. Before the process was given anything, only the role is remembered.
    """
    priority_of(role)  # a KeyError for a slip of the pen, whoever runs this
    with _STANDING.lock:
        thread = threading.get_native_id()
        _STANDING.roles[thread] = role
        memory.touch_stack(STACK)
        if _STANDING.wanted is not None and _STANDING.wanted.keep_heap:
            memory.touch_heap(_reserve(_STANDING.wanted))
        return _give(thread, role)


def let_go(process: int) -> None:
    """Give a process that was started by this one the ordinary class, and the CPUs that this one was started with."""
    with suppress(OSError):
        os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(process, _STANDING.cpus)


def _give(thread: int, role: str) -> Answer:
    wanted, granted = _STANDING.wanted, _STANDING.granted
    if wanted is None:
        return Answer("nothing yet")
    answer = _scheduled(wanted, [thread], role, _STANDING.level)
    name = "cycle" if role in IN_CYCLE else role
    granted.take(f"scheduling of {name}", answer)
    first = answer.granted.startswith("SCHED_FIFO")
    choose = _for_cycle if role in IN_PYTHON else _for_others
    granted.take(f"CPUs of {name}", stay_on([thread], choose(wanted, first, _STANDING.level)))
    _slack([thread], wanted.timer_slack)
    return answer


def _first(wanted: RealTime) -> bool:
    return wanted.scheduling == FIFO and highest_priority() > 0


def _for_cycle(wanted: RealTime, first: bool, level: bool) -> frozenset[int]:
    """Give the CPUs for the cycle's thread.

    On one CPU the next node of the loop has what it needs in its caches, and wakes without a signal from CPU to CPU.
    Without SCHED_FIFO whatever else runs there would be in its way.
    """
    all_of_them = _all(wanted)
    if wanted.cycle_cpus != TOGETHER:
        return cpus_of(wanted.cycle_cpus) or all_of_them
    return frozenset((max(all_of_them),)) if first and not level else all_of_them


def _for_others(wanted: RealTime, first: bool, level: bool) -> frozenset[int]:
    """Give the CPUs for all other threads.

    Not the one of the cycles: if SCHED_FIFO takes nearly all of a CPU, the kernel gives a twentieth of each second of
    it to ordinary processes, 50 ms at a stretch.
    """
    all_of_them = _all(wanted)
    if wanted.cycle_cpus != TOGETHER or not first or level:
        return all_of_them
    return all_of_them - {max(all_of_them)} or all_of_them


def _all(wanted: RealTime) -> frozenset[int]:
    return cpus_of(wanted.cpus) or _STANDING.cpus


def _scheduled(wanted: RealTime, threads: list[int], role: str, level: bool) -> Answer:
    if wanted.scheduling == FIFO:
        return schedule(threads, priority_of(role, wanted.priority or CYCLE, level))
    return Answer("as the process was started, as asked for")


def _slack(threads: list[int], seconds: float) -> Answer:
    """Set the timer slack; of threads other than the calling one only a process with CAP_SYS_NICE may."""
    nanoseconds = round(seconds * 1e9)
    if not nanoseconds:
        return Answer(f"{_libc.prctl(PR_GET_TIMERSLACK) * 1e-3:g} us, as the process was started")
    refused = 0
    for thread in threads:
        if thread == threading.get_native_id():
            _libc.prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(nanoseconds))
            continue
        try:
            Path(f"/proc/{thread}/timerslack_ns").write_text(str(nanoseconds))
        except FileNotFoundError:
            continue
        except OSError:
            refused += 1
    return Answer(f"{nanoseconds * 1e-3:g} us" + (f", not for {refused} threads of the middleware" if refused else ""))


def _heap(wanted: RealTime) -> Answer:
    answer = memory.keep_heap(wanted.malloc_arenas) if wanted.keep_heap else Answer("as the C library does")
    reserve = memory.touch_heap(_reserve(wanted)) if wanted.keep_heap else 0
    if wanted.keep_heap:
        memory.touch_objects(_reserve(wanted))
    return Answer(f"{answer.granted}, {reserve / memory.MIB:g} MiB touched", answer.advice)


def _reserve(wanted: RealTime) -> int:
    return round(wanted.heap_reserve * memory.MIB)
