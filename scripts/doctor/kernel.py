"""Kernel: preemption, time for real-time threads, clocks, memory management."""

from __future__ import annotations

import gzip
import platform
import re
import time
from collections.abc import Iterator

from doctor.finding import CHANGE, NOTE, OK, Finding, Machine

LEAST_SHARE = 0.5
"""Share of the processor that the system must leave to SCHED_FIFO: a ride takes less, with room for a backlog."""
COARSE = 1e-6
"""Resolution of timers in s beyond which they go by the scheduler's tick (1 to 10 ms), not by a clock of their own."""
GOOD_CLOCKS = ("tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter", "xen", "riscv_clocksource")
"""Read without a system call or a slow register: 20 to 60 ns. hpet and acpi_pm take 1 to 5 us, many times a cycle."""


def kernel(machine: Machine) -> Iterator[Finding]:
    """Preemption model: from the running kernel's files, its command line, or the configuration it was built with."""
    release = machine.text("/proc/sys/kernel/osrelease") or platform.release()
    model, source = _preemption(machine, release)
    value = f"{release}, preemption: {model}{source}"
    if model in ("PREEMPT_RT", "full"):
        yield Finding("kernel", value)
        return
    why = (
        "a system call of another process is interrupted only where it allows it"
        if model in ("voluntary", "none", "lazy")
        else "the kernel does not say how it is preempted"
    )
    do = (
        "add preempt=full to GRUB_CMDLINE_LINUX in /etc/default/grub, then: sudo update-grub && sudo reboot   (or a "
        "real-time kernel: sudo apt-get install linux-image-rt-amd64 on Debian, sudo pro enable realtime-kernel on "
        "Ubuntu)"
    )
    if "PREEMPT_DYNAMIC" in machine.text("/proc/sys/kernel/version"):
        do = f"echo full | sudo tee /sys/kernel/debug/sched/preempt   ; to last, {do}"
    yield Finding("kernel", value, NOTE, why, do)


def _preemption(machine: Machine, release: str) -> tuple[str, str]:
    if machine.number("/sys/kernel/realtime") == 1:
        return "PREEMPT_RT", ""
    version = machine.text("/proc/sys/kernel/version")
    if "PREEMPT_RT" in version:
        return "PREEMPT_RT", ""
    chosen = re.search(r"\((\w+)\)", machine.text("/sys/kernel/debug/sched/preempt"))
    if chosen:
        return chosen[1], ""
    asked = re.search(r"(?:^|\s)preempt=(\w+)", machine.text("/proc/cmdline"))
    if asked:
        return asked[1], " (command line)"
    built = _built_with(machine, release)
    for option, name in (("RT", "PREEMPT_RT"), ("NONE", "none"), ("VOLUNTARY", "voluntary"), ("LAZY", "lazy")):
        if f"CONFIG_PREEMPT_{option}=y" in built:
            return name, " (as built)"
    if "CONFIG_PREEMPT=y" in built or ("PREEMPT" in version and "DYNAMIC" not in version):
        return "full", ""
    return ("chosen at boot, unknown here", "") if "PREEMPT_DYNAMIC" in version else ("unknown", "")


def _built_with(machine: Machine, release: str) -> frozenset[str]:
    text = machine.text(f"/boot/config-{release}")
    packed = machine.root / "proc/config.gz"
    if not text and packed.exists():
        text = gzip.decompress(packed.read_bytes()).decode("utf-8", "replace")
    return frozenset(text.splitlines())


def time_for_fifo(machine: Machine) -> Iterator[Finding]:
    """The share of each second that the system leaves to real-time threads."""
    runtime = machine.number("/proc/sys/kernel/sched_rt_runtime_us")
    period = machine.number("/proc/sys/kernel/sched_rt_period_us")
    if runtime is None or not period:
        yield Finding("time for SCHED_FIFO", "unknown")
        return
    if runtime < 0:
        yield Finding("time for SCHED_FIFO", "all", OK, "a thread that runs away takes a core for good")
        return
    share = runtime / period
    value = f"{share:.0%} of every {period * 1e-6:g} s"
    if share >= LEAST_SHARE:
        yield Finding("time for SCHED_FIFO", value)
    else:
        do = "sudo sysctl -w kernel.sched_rt_runtime_us=950000"
        yield Finding("time for SCHED_FIFO", value, CHANGE, "the loop is stopped for the rest of each period", do)


def clocks(machine: Machine) -> Iterator[Finding]:
    """Where the time comes from, and how fine timers are."""
    folder = "/sys/devices/system/clocksource/clocksource0"
    source = machine.text(f"{folder}/current_clocksource") or "unknown"
    if source in GOOD_CLOCKS or source == "unknown":
        yield Finding("clock source", source)
    else:
        others = machine.text(f"{folder}/available_clocksource").split()
        better = next((name for name in GOOD_CLOCKS if name in others), None)
        do = (
            f"echo {better} | sudo tee {folder}/current_clocksource"
            if better
            else "look for the reason: sudo dmesg | grep -i tsc"
        )
        yield Finding("clock source", source, NOTE, "each look at the clock takes microseconds", do)
    resolution = time.clock_getres(time.CLOCK_MONOTONIC)
    if resolution <= COARSE:
        yield Finding("timer resolution", f"{resolution * 1e9:g} ns")
    else:
        why = "timers go by the tick: a cycle of 2 ms cannot be kept"
        do = "boot without highres=off, with a kernel that has CONFIG_HIGH_RES_TIMERS=y"
        yield Finding("timer resolution", f"{resolution * 1e3:g} ms", CHANGE, why, do)


def memory_management(machine: Machine) -> Iterator[Finding]:
    """Transparent huge pages and swap: both make a process wait for its memory."""
    pages = re.search(r"\[(\w+)\]", machine.text("/sys/kernel/mm/transparent_hugepage/enabled"))
    if pages is None or pages[1] != "always":
        yield Finding("huge pages", pages[1] if pages else "none")
    else:
        do = "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled"
        why = "the kernel moves pages of a running process together, which stops it for up to a millisecond"
        yield Finding("huge pages", "always", NOTE, why, do)
    lines = [line.split() for line in machine.text("/proc/swaps").splitlines()[1:]]
    size, used = (sum(int(line[column]) for line in lines) / 1024 for column in (2, 3))
    if not lines:
        yield Finding("swap", "none")
    elif used < 1:
        yield Finding("swap", f"{size:.0f} MiB, not used")
    else:
        why = "memory that was never locked comes back from the disk, which takes milliseconds"
        yield Finding(
            "swap", f"{used:.0f} of {size:.0f} MiB used", NOTE, why, "sudo swapoff -a   (if the memory is enough)"
        )


def memory_walkers(machine: Machine) -> Iterator[Finding]:
    """DAMON: an ordinary thread of the kernel walks the memory of all processes, with a lock that mmap needs."""
    folder = "/sys/kernel/mm/damon/admin/kdamonds"
    going = [each for each in machine.all(f"{folder}/*/state") if each.read_text().strip() == "on"]
    modules = [
        each for each in machine.all("/sys/module/damon_*/parameters/enabled") if each.read_text().strip() == "Y"
    ]
    if not going and not modules:
        yield Finding("memory walkers", "none")
        return
    do = [f"echo off | sudo tee {folder}/{each.parent.name}/state" for each in going]
    do += [f"echo N | sudo tee /sys/module/{each.parts[-3]}/parameters/enabled" for each in modules]
    why = "who maps memory waits for it, 1 to 20 ms were seen: recorder, viewers, a cycle with too little heap"
    yield Finding("memory walkers", "DAMON", NOTE, why, "; ".join(do))


LOOKS = (kernel, time_for_fifo, clocks, memory_management, memory_walkers)
