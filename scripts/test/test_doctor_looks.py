"""What the doctor says of machines that are described by their files."""

import os
import subprocess
from collections import Counter

import pytest

from doctor import kernel, limits, processor, transport
from doctor.domain import MEET, discovery, environment, judged
from doctor.finding import CHANGE, NOTE, OK, Finding, Machine, looked
from phil_base.scheduling import highest_priority


def write(machine, files):
    for path, text in files.items():
        place = machine.root / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    return machine


VERSION = "proc/sys/kernel/version"
RELEASE = {"proc/sys/kernel/osrelease": "6.1.0"}


@pytest.mark.parametrize(
    ("files", "model", "verdict"),
    [
        ({"sys/kernel/realtime": "1"}, "PREEMPT_RT", OK),
        ({VERSION: "#1 SMP PREEMPT_RT Debian"}, "PREEMPT_RT", OK),
        ({VERSION: "#1 SMP PREEMPT Fri"}, "full", OK),
        ({"sys/kernel/debug/sched/preempt": "none voluntary (full) lazy"}, "full", OK),
        ({"sys/kernel/debug/sched/preempt": "none (voluntary) full"}, "voluntary", NOTE),
        ({VERSION: "#1 SMP PREEMPT_DYNAMIC", "proc/cmdline": "quiet preempt=full ro"}, "full", OK),
        ({VERSION: "#1 SMP PREEMPT_DYNAMIC", "boot/config-6.1.0": "CONFIG_PREEMPT_VOLUNTARY=y\n"}, "voluntary", NOTE),
        ({VERSION: "#1 SMP PREEMPT_DYNAMIC", "boot/config-6.1.0": "# no\nCONFIG_PREEMPT_NONE=y"}, "none", NOTE),
        ({VERSION: "#1 SMP PREEMPT_DYNAMIC"}, "chosen at boot", NOTE),
        ({VERSION: "#1 SMP"}, "unknown", NOTE),
    ],
)
def test_preemption_is_read_wherever_it_stands(tmp_path, files, model, verdict):
    (found,) = kernel.kernel(write(Machine(tmp_path), RELEASE | files))
    assert f"preemption: {model}" in found.value
    assert found.verdict == verdict
    assert bool(found.do) == (verdict != OK)


@pytest.mark.parametrize(
    ("runtime", "verdict"), [("950000", OK), ("-1", OK), ("500000", OK), ("100000", CHANGE), ("0", CHANGE)]
)
def test_time_for_real_time_threads(tmp_path, runtime, verdict):
    files = {"proc/sys/kernel/sched_rt_runtime_us": runtime, "proc/sys/kernel/sched_rt_period_us": "1000000"}
    (found,) = kernel.time_for_fifo(write(Machine(tmp_path), files))
    assert found.verdict == verdict


def test_a_slow_clock_is_named_with_the_better_one(tmp_path):
    folder = "sys/devices/system/clocksource/clocksource0"
    files = {f"{folder}/current_clocksource": "hpet", f"{folder}/available_clocksource": "hpet kvm-clock acpi_pm"}
    source, _ = kernel.clocks(write(Machine(tmp_path), files))
    assert source.verdict == NOTE and source.do.startswith("echo kvm-clock | sudo tee /sys/devices")


def test_huge_pages_and_swap(tmp_path):
    files = {
        "sys/kernel/mm/transparent_hugepage/enabled": "[always] madvise never",
        "proc/swaps": "Filename Type Size Used Priority\n/dev/sda2 partition 2097152 524288 -2",
    }
    pages, swap = kernel.memory_management(write(Machine(tmp_path), files))
    assert (pages.verdict, swap.verdict) == (NOTE, NOTE)
    assert swap.value == "512 of 2048 MiB used"


def test_who_walks_through_the_memory_of_all_is_named_with_the_switch(tmp_path):
    admin, module = "sys/kernel/mm/damon/admin/kdamonds", "sys/module/damon_reclaim/parameters/enabled"
    (found,) = kernel.memory_walkers(write(Machine(tmp_path), {f"{admin}/0/state": "off", module: "N"}))
    assert found.verdict == OK
    (found,) = kernel.memory_walkers(write(Machine(tmp_path), {f"{admin}/1/state": "on\n", module: "Y"}))
    assert found.verdict == NOTE
    assert found.do == f"echo off | sudo tee /{admin}/1/state; echo N | sudo tee /{module}"


def test_a_dynamic_kernel_can_be_told_while_it_runs(tmp_path):
    told, built = ({VERSION: f"#1 SMP PREEMPT{end}"} for end in ("_DYNAMIC", "_LAZY"))
    assert "sched/preempt   ;" in next(kernel.kernel(write(Machine(tmp_path), RELEASE | told))).do
    assert "debug" not in next(kernel.kernel(write(Machine(tmp_path), RELEASE | built))).do


def test_a_machine_that_tells_nothing_is_no_reason_to_stop(tmp_path):
    found = list(looked((*kernel.LOOKS, *processor.LOOKS, *transport.LOOKS), Machine(tmp_path)))
    assert len(found) > 12
    assert not [
        line for line in found if line.verdict == CHANGE and "cores" not in line.name and "memory" not in line.name
    ]


def test_what_cannot_be_read_is_said(tmp_path):
    *_, found = looked([kernel.memory_management], write(Machine(tmp_path), {"proc/swaps": "head\na b c d e"}))
    assert (found.value, found.verdict) == ("unknown", NOTE)


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({"proc/self/cgroup": "0::/a/b", "sys/fs/cgroup/a/b/cpu.max": "max 100000"}, None),
        ({"proc/self/cgroup": "0::/a/b", "sys/fs/cgroup/a/cpu.max": "150000 100000"}, 1.5),
        ({"proc/self/cgroup": "0::/", "sys/fs/cgroup/cpu.max": "50000 100000"}, 0.5),
        (
            {
                "proc/self/cgroup": "5:cpu,cpuacct:/x\n0::/",
                "sys/fs/cgroup/cpu/x/cpu.cfs_quota_us": "300000",
                "sys/fs/cgroup/cpu/x/cpu.cfs_period_us": "100000",
            },
            3.0,
        ),
        ({"proc/self/cgroup": "5:cpu:/x", "sys/fs/cgroup/cpu/x/cpu.cfs_quota_us": "-1"}, None),
    ],
)
def test_the_processor_quota_is_the_least_of_all_groups_above(tmp_path, files, cores):
    machine = write(Machine(tmp_path), files)
    assert processor.cpu_quota(machine) == cores
    (found,) = [line for line in processor.surroundings(machine) if line.name == "processor quota"]
    assert found.verdict == (CHANGE if cores is not None and cores < 2 else OK)


def test_governor_turbo_and_idle_states(tmp_path):
    cpu = "sys/devices/system/cpu"
    files = {
        f"{cpu}/cpu0/cpufreq/scaling_governor": "powersave",
        f"{cpu}/cpu1/cpufreq/scaling_governor": "performance",
        f"{cpu}/intel_pstate/no_turbo": "0",
        f"{cpu}/cpu0/cpuidle/state0/name": "C1",
        f"{cpu}/cpu0/cpuidle/state0/latency": "2",
        f"{cpu}/cpu0/cpuidle/state1/name": "C6",
        f"{cpu}/cpu0/cpuidle/state1/latency": "133",
    }
    machine = write(Machine(tmp_path), files)
    governor, turbo, idle = processor.frequency(machine)
    assert (governor.verdict, turbo.value, idle.verdict) == (NOTE, "on", NOTE)
    assert idle.value == "deepest: C6, 133 us to wake up"
    write(machine, {f"{cpu}/cpu0/cpuidle/state1/disable": "1"})
    assert list(processor.frequency(machine))[-1].verdict == OK


@pytest.mark.parametrize(("stolen", "verdict"), [(0, OK), (5, NOTE), (20, CHANGE)])
def test_stolen_time_counts_by_its_share_of_the_measurement(tmp_path, stolen, verdict):
    machine = Machine(tmp_path)
    write(machine, {"proc/stat": "cpu  100 0 100 1000 0 0 0 900 0 0\n"})
    before = processor.Spent.now(machine)
    write(machine, {"proc/stat": f"cpu  110 0 100 {1990 - stolen} 0 0 0 {900 + stolen} 0 0\n"})
    shares = processor.Spent.now(machine).shares_since(before)
    assert sum(shares.values()) == pytest.approx(1.0)
    (found,) = [line for line in processor.spent(machine, shares, True) if line.name == "stolen time"]
    assert found.verdict == verdict


def test_a_busy_machine_is_a_note_only_for_who_goes_first(tmp_path):
    shares = {"idle": 0.05}
    assert [next(processor.spent(Machine(tmp_path), shares, first)).verdict for first in (True, False)] == [
        NOTE,
        CHANGE,
    ]


@pytest.mark.parametrize(("priority", "verdict"), [(0, OK), (39, OK), (40, NOTE), (99, NOTE)])
def test_other_real_time_processes_are_named(tmp_path, priority, verdict):
    stat = f"7 (odd) name) S {'0 ' * 36}{priority} 1 0"
    files = {"proc/7/cmdline": "odd", "proc/7/comm": "odd) name", "proc/7/task/7/stat": stat}
    kernels = {"proc/8/cmdline": "", "proc/8/comm": "migration/0", "proc/8/task/8/stat": f"8 (m) S {'0 ' * 36}99 1"}
    (found,) = limits.rivals(write(Machine(tmp_path), files | kernels))
    assert found.verdict == verdict
    assert found.value == ("odd) name" if verdict == NOTE else "none")


def test_the_field_of_the_priority_is_that_of_this_system():
    """Held against what the system says itself of a process with real-time priority, where it gives one."""
    allowed = highest_priority()
    with subprocess.Popen(["sleep", "30"]) as child:
        if allowed:
            os.sched_setscheduler(child.pid, os.SCHED_FIFO, os.sched_param(min(41, allowed)))
        (found,) = limits.rivals(Machine())
        child.kill()
    assert ("sleep" in found.value) == (allowed >= 40)


def test_small_buffers_are_named_with_what_to_type(tmp_path):
    files = {"proc/sys/net/core/rmem_max": "65536", "proc/sys/net/unix/max_dgram_qlen": "5"}
    found = {line.name: line for line in transport.sockets(write(Machine(tmp_path), files))}
    assert found["net.core.rmem_max"].do == "sudo sysctl -w net.core.rmem_max=4259840"
    assert found["net.core.wmem_max"].verdict == OK
    assert found["net.unix.max_dgram_qlen"].verdict == NOTE


def test_a_folder_that_does_not_exist_yet_is_judged_by_the_disk_it_will_be_on(tmp_path):
    room, speed = transport.disk(Machine(), tmp_path / "rides" / "new")
    assert str(tmp_path) in room.value
    assert "MiB/s" in speed.value
    assert not list(tmp_path.iterdir())


def test_what_dead_processes_left_in_shared_memory_is_counted(tmp_path):
    (tmp_path / "fastrtps_0123456789abcdef").write_bytes(b"")
    (tmp_path / "somebody_elses").write_bytes(b"")
    for path in tmp_path.iterdir():
        os.utime(path, (0, 0))
    found = {line.name: line for line in transport.shared_memory(Machine(), tmp_path)}
    assert found["left shared memory"].value == "1 files of dead processes"
    (tmp_path / "fastrtps_0123456789abcdef").unlink()
    assert list(transport.shared_memory(Machine(), tmp_path))[-1].verdict == OK


def test_a_shared_memory_that_is_not_there_stands_against_a_ride(tmp_path):
    (found,) = transport.shared_memory(Machine(), tmp_path / "none")
    assert found.verdict == CHANGE


@pytest.mark.parametrize(
    ("names", "verdict"),
    [
        ({}, OK),
        ({"/plotjuggler": 1}, NOTE),
        ({"/test_rig_sim": 1}, CHANGE),
        ({"/left/test_rig_sim": 1}, NOTE),
        ({"/viewer": MEET}, CHANGE),
    ],
)
def test_who_else_is_on_the_domain(names, verdict):
    found = judged(Counter(names), "7")
    assert found.verdict == verdict
    assert all(name in found.value for name in names)


def test_how_far_the_nodes_are_heard():
    assert discovery({}).verdict == NOTE
    assert discovery({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}).verdict == OK
    assert discovery({"ROS_LOCALHOST_ONLY": "1"}).verdict == OK


def test_what_a_start_would_fail_on_is_said_word_for_word(tmp_path):
    (found,) = environment({"ROS_DOMAIN_ID": "233", "ROS_LOG_DIR": str(tmp_path)})
    assert found.verdict == CHANGE and "ROS_DOMAIN_ID=233" in found.why
    assert environment({"ROS_LOG_DIR": str(tmp_path)})[0].verdict == OK


def test_a_row_holds_all_of_a_finding():
    assert Finding("a", "b", NOTE, "c", "d").row() == {
        "name": "a",
        "value": "b",
        "verdict": NOTE,
        "why": "c",
        "do": "d",
    }
