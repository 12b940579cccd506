"""Processors: how many, how fast, whose; what others take of them while it is measured."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from doctor.finding import CHANGE, NOTE, OK, Finding, Machine
from phil_base.scheduling import cpus_in_words, cpus_of

LEAST_CORES = 2
"""Rig, catenary and controller follow one upon the other; middleware, monitor and recorder need a second core."""
RIDE = 1.2
"""Cores that a ride at 500 Hz with monitor, recorder and run script keeps busy: 17.5 s of processor in 15 s."""
STEAL_NOTE, STEAL_CHANGE = 0.001, 0.01
"""Shares of the time in which the host ran somebody else: 0.1 % is what a ride may have late altogether; from 1 % on
about every hundredth cycle is hit."""
DEEP = 100e-6
"""Time in s to leave an idle state that counts: three wake-ups a cycle make it a sixth of 2 ms."""
FIELDS = ("user", "nice", "system", "idle", "iowait", "irq", "softirq", "steal")


@dataclass(frozen=True)
class Spent:
    """What all processors together have done since the start of the system, in ticks, by FIELDS."""

    ticks: Mapping[str, int]

    @classmethod
    def now(cls, machine: Machine) -> Spent:
        """Read /proc/stat."""
        numbers = [int(word) for word in machine.text("/proc/stat").partition("\n")[0].split()[1:]]
        return cls(dict(zip(FIELDS, numbers, strict=False)))

    def shares_since(self, before: Spent) -> dict[str, float]:
        """Give the share of the time for each of FIELDS; empty if no time has passed."""
        spent = {name: self.ticks[name] - before.ticks.get(name, 0) for name in self.ticks}
        total = sum(spent.values())
        return {name: value / total for name, value in spent.items()} if total > 0 else {}


def cores(machine: Machine) -> Iterator[Finding]:
    """The CPUs that this process may use, and those that the kernel keeps free of others."""
    usable = os.sched_getaffinity(0)
    online = cpus_of(machine.text("/sys/devices/system/cpu/online")) or usable
    value = f"{len(usable)} usable ({cpus_in_words(usable)}) of {len(online)}"
    if len(usable) >= LEAST_CORES:
        yield Finding("cores", value)
    else:
        yield Finding(
            "cores", value, CHANGE, f"a ride needs {LEAST_CORES}", "give the machine or the container more CPUs"
        )
    isolated = machine.text("/sys/devices/system/cpu/isolated")
    if isolated:
        why = "the scheduler puts nothing there by itself: name them in real_time.cycle_cpus of the nodes"
        yield Finding("isolated cores", isolated, OK, why)
    else:
        yield Finding(
            "isolated cores", "none", OK, "" if len(online) < 4 else "isolcpus= at boot keeps some for the loop"
        )


def frequency(machine: Machine) -> Iterator[Finding]:
    """Governor, turbo and idle states: how long a core takes until it computes at full speed."""
    governors = {
        path.read_text().strip() for path in machine.all("/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")
    }
    if not governors:
        yield Finding("governor", "none here (the firmware's or the host's business)")
    elif governors == {"performance"}:
        yield Finding("governor", "performance")
    else:
        do = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
        why = "a core that sleeps between two cycles is run slowly at first"
        yield Finding("governor", ", ".join(sorted(governors)), NOTE, why, do)
    no_turbo, boost = (
        machine.number("/sys/devices/system/cpu/intel_pstate/no_turbo"),
        machine.number("/sys/devices/system/cpu/cpufreq/boost"),
    )
    if no_turbo is not None or boost is not None:
        on = no_turbo == 0 if no_turbo is not None else boost == 1
        yield Finding("turbo", "on" if on else "off", OK, "the speed depends on heat and neighbours" if on else "")
    yield from _idle_states(machine)


def _idle_states(machine: Machine) -> Iterator[Finding]:
    latencies = {}
    for path in machine.all("/sys/devices/system/cpu/cpu*/cpuidle/state*"):
        # POLL and halt of a guest are on the list as well; a state may be switched off.
        if _number(path / "disable") != 1 and (found := _number(path / "latency")) is not None:
            latencies[(path / "name").read_text().strip()] = found * 1e-6
    if not latencies:
        return
    name, slowest = max(latencies.items(), key=lambda item: item[1])
    value = f"deepest: {name}, {slowest * 1e6:g} us to wake up"
    if slowest <= DEEP:
        yield Finding("idle states", value)
    else:
        do = "sudo cpupower idle-set -D 100   (package linux-cpupower; Ubuntu: linux-tools-common)"
        yield Finding("idle states", value, NOTE, "each of the three wake-ups of a cycle may take that long", do)


def _number(path: Path) -> int | None:
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return None


def surroundings(machine: Machine) -> Iterator[Finding]:
    """Whether this is a virtual machine or a container, and what it may use of the processors."""
    virtual = "hypervisor" in machine.text("/proc/cpuinfo").split()
    # ARM has no such flag; the firmware's tables name the maker.
    maker = " ".join(
        filter(None, (machine.text(f"/sys/class/dmi/id/{name}") for name in ("sys_vendor", "product_name")))
    )
    virtual = virtual or any(
        word in maker for word in ("QEMU", "KVM", "VMware", "VirtualBox", "Virtual Machine", "Xen")
    )
    if virtual:
        why = "the host decides when it runs: see the stolen time, and the wake-ups"
        do = "for measurements at a rig: run on the bare machine"
        yield Finding("virtualisation", f"a virtual machine{f' ({maker})' if maker else ''}", NOTE, why, do)
    else:
        yield Finding("virtualisation", f"none seen, {platform.machine()}")
    inside = (
        machine.there("/.dockerenv")
        or machine.there("/run/.containerenv")
        or "container=" in machine.text("/proc/1/environ")
    )
    yield Finding("container", "yes" if inside else "none seen")
    quota = cpu_quota(machine)
    if quota is None:
        yield Finding("processor quota", "none")
    elif quota >= LEAST_CORES:
        yield Finding("processor quota", f"{quota:g} cores")
    else:
        why = "whoever has used it up stands still for the rest of 100 ms (threads of SCHED_FIFO do not)"
        do = f"start the container with --cpus={LEAST_CORES} or more, or systemctl set-property UNIT CPUQuota="
        yield Finding("processor quota", f"{quota:g} cores", CHANGE, why, do)


def cpu_quota(machine: Machine) -> float | None:
    """Give the cores that the control group of this process, and those above it, may use; None without a limit."""
    limits = []
    for line in machine.text("/proc/self/cgroup").splitlines():
        _, controllers, group = line.split(":", 2)
        folder = group.strip("/")
        if controllers == "":
            limits += [_quota_v2(machine.text(f"/sys/fs/cgroup/{above}/cpu.max")) for above in _up(folder)]
        elif "cpu" in controllers.split(","):
            for above in _up(folder):
                at = f"/sys/fs/cgroup/cpu/{above}"
                quota, period = (machine.number(f"{at}/cpu.cfs_{name}_us") for name in ("quota", "period"))
                limits.append(quota / period if quota and period and quota > 0 else math.inf)
    least = min(limits, default=math.inf)
    return None if math.isinf(least) else least


def _up(folder: str) -> Iterator[str]:
    """Give a folder and all above it, the root as ".": a limit holds for what is below it."""
    parts = folder.split("/") if folder else []
    for length in range(len(parts), -1, -1):
        yield "/".join(parts[:length]) or "."


def _quota_v2(text: str) -> float:
    words = text.split()
    return int(words[0]) / int(words[1]) if len(words) == 2 and words[0] != "max" else math.inf


def spent(machine: Machine, shares: Mapping[str, float], may_go_first: bool) -> Iterator[Finding]:
    """Judge what was left of the processors, and what the host took, over the measurement."""
    count = len(os.sched_getaffinity(0))
    free = (shares.get("idle", 0.0) + shares.get("iowait", 0.0)) * count
    load = machine.text("/proc/loadavg").split()[:1]
    value = f"{free:.1f} of {count} over the measurement, load {load[0] if load else '?'}"
    if free >= RIDE:
        yield Finding("free cores", value)
    else:
        verdict = NOTE if may_go_first else CHANGE
        why = f"a ride keeps about {RIDE:g} busy" + (", and comes first by SCHED_FIFO" if may_go_first else "")
        yield Finding("free cores", value, verdict, why, "look for who works and end it: top -o %CPU")
    stolen = shares.get("steal", 0.0)
    value = f"{stolen:.2%} over the measurement"
    if stolen < STEAL_NOTE:
        yield Finding("stolen time", value)
        return
    why = "the host ran somebody else in that time; nothing in here can go before it"
    do = "on the host: pin the virtual CPUs to cores that nobody else has, or take a machine of its own"
    yield Finding("stolen time", value, CHANGE if stolen >= STEAL_CHANGE else NOTE, why, do)


LOOKS = (cores, frequency, surroundings)
