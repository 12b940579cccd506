"""The faults: what is done, how the ride has to end, and who has to say so."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from faults import actions
from faults.judge import RETRACTS, SILENT, TRACKS
from faults.relay import LINKS
from faults.stand import RECORDER, RELAYED, Stand
from ride.settings import NODES

Say = tuple[str, str]
Action = Callable[[Stand], list[str]]
"""Does the fault; gives what was reported elsewhere than on /diagnostics. Raises `actions.Wrong` if something is."""

LATE = "successive cycles without a usable command"
SILENT_RIDE = ("energy_monitor", "no complete cycle for|no .* for|age|silent|newest")


@dataclass(frozen=True)
class Fault:
    """One row; ``ends`` are the outcomes that are safe, ``says`` what has to be said (all of it)."""

    name: str
    title: str
    action: Action
    ends: tuple[str, ...] = (TRACKS,)
    within: float = 4.0
    """s from the fault's begin until the drive has to be safe."""
    says: Sequence[Say] = ()
    stand: str = "plain"
    """Kind of the stand (`faults.stand.KINDS`), "full" has its bag on a small disk; none: the run script."""
    kills: tuple[str, ...] = ()
    short: bool = False


def _stops() -> list[Fault]:
    found = []
    for name in (*NODES, RECORDER):
        for seconds in (0.005, 0.05, 0.5, 5.0):
            how_long = f"{seconds:g} s" if seconds >= 1.0 else f"{seconds * 1e3:g} ms"
            loop = name in ("impedance_mpc", "catenary_model")
            lost = loop and seconds >= 0.5
            says: list[Say] = [("test_rig_sim", LATE)] if lost else []
            if loop and seconds == 0.05:
                says = [("test_rig_sim", "commands late")]
            if name == "test_rig_sim" and seconds >= 0.05:
                says = [("test_rig_sim", "ticks skipped")]
            found.append(
                Fault(
                    f"stop-{name}-{seconds * 1e3:g}ms",
                    f"{name} stands still for {how_long} (SIGSTOP)",
                    partial(actions.stop, name=name, seconds=seconds),
                    (RETRACTS,) if lost else (TRACKS,),
                    seconds + 3.0,
                    says,
                    short=(name, seconds) == ("impedance_mpc", 0.05),
                )
            )
    return found


def _deaths() -> list[Fault]:
    found = []
    for word, number in (("kill", signal.SIGKILL), ("restart", signal.SIGINT)):
        for name in (*NODES, RECORDER):
            loop = name in ("impedance_mpc", "catenary_model")
            ends = (RETRACTS,) if loop else (SILENT,) if name == "test_rig_sim" else (TRACKS,)
            says: list[Say] = [("test_rig_sim", LATE)] if loop else []
            if name == "test_rig_sim":
                says = [("energy_monitor", "no state|no cycle|complete cycle|s old")]
            how = "killed (SIGKILL)" if word == "kill" else "ended in the ride (SIGINT)"
            found.append(
                Fault(
                    f"{word}-{name}",
                    f"{name} is {how}, then started again",
                    partial(actions.end, name=name, number=number),
                    ends,
                    3.0,
                    says,
                    kills=(name,),
                    short=word == "kill" and name in ("impedance_mpc", RECORDER),
                )
            )
    return found


def _topics() -> list[Fault]:
    """What is done to the processes by which the nodes speak to the rest of the world."""
    found = []
    for name in NODES:
        kill = partial(actions.topics, name=name, number=signal.SIGKILL)
        stop = partial(actions.topics, name=name, number=signal.SIGSTOP, pause=5.0)
        killed = f"the process for the topics of {name} is killed (SIGKILL)"
        found.append(Fault(f"kill-topics-{name}", killed, kill, within=8.0, short=name == "test_rig_sim"))
        stopped = f"the process for the topics of {name} stands still for 5 s (SIGSTOP)"
        found.append(Fault(f"stop-topics-{name}-5000ms", stopped, stop, within=8.0))
    return found


def _messages() -> list[Fault]:
    found = []
    for link, where in LINKS.items():
        what, stand = f"{where.topic} to {where.listener}", f"{RELAYED}{link}"
        for kind, words in (("lost", "lost"), ("delayed", "10 ms late")):
            for share in (0.01, 0.1):
                action = partial(actions.damage, kind=kind, share=share, seconds=2.0, delay=0.01)
                found.append(
                    Fault(
                        f"{kind}-{share * 100:g}-{link}",
                        f"{share:.0%} of {what} {words}, for 2 s",
                        action,
                        (TRACKS,),
                        5.0,
                        stand=stand,
                    )
                )
        for kind, words in (
            ("doubled", "twice"),
            ("swapped", "in the wrong order"),
            ("old_stamp", "stamped an hour ago"),
            ("future_stamp", "stamped an hour ahead"),
        ):
            action = partial(actions.damage, kind=kind, share=0.1, seconds=1.0)
            found.append(Fault(f"{kind}-{link}", f"a tenth of {what} {words}", action, stand=stand))
        kinds = [("nan", "not a number"), ("infinity", "infinite"), ("absurd", "1e15")]
        if link == "catenary-controller":
            kinds.append(("sizes", "with arrays of the wrong size"))
        for kind, words in kinds:
            says = ((where.listener, "refused"),)
            action = partial(actions.damage, kind=kind, share=0.1, seconds=1.0)
            found.append(Fault(f"{kind}-{link}", f"a tenth of {what} {words}", action, says=says, stand=stand))
            action = partial(actions.damage, kind=kind, share=1.0, seconds=1.0)
            found.append(
                Fault(f"{kind}-all-{link}", f"all of {what} {words}", action, (RETRACTS,), says=says, stand=stand)
            )
    return found


def _others() -> list[Fault]:
    return [
        Fault("none", "nothing: the ride to compare with", actions.nothing, short=True),
        Fault(
            "second-command",
            "a second publisher of commands with the ride's cycle numbers",
            partial(actions.beside, module="faults.rival", words=("command",), seconds=2.0),
            (RETRACTS, TRACKS),
            says=(("test_rig_sim", "a second publisher|sender"),),
        ),
        Fault(
            "second-state",
            "a second publisher of rig states with the ride's cycle numbers",
            partial(actions.beside, module="faults.rival", words=("state",), seconds=2.0),
            (RETRACTS, TRACKS),
            6.0,
            says=(("impedance_mpc", "a second publisher|sender|refused|strays|cannot be used"),),
        ),
        Fault("second-ride", "a second ride on the same domain", actions.second_ride, within=30.0),
        Fault(
            "viewer-slow",
            "a viewer that takes 20 ms for each message",
            partial(actions.beside, module="faults.viewer", words=("0.02", "reliable"), seconds=4.0),
            within=6.0,
        ),
        Fault(
            "viewer-killed",
            "a viewer that is killed while it reads",
            partial(
                actions.beside, module="faults.viewer", words=("0", "reliable"), seconds=3.0, number=signal.SIGKILL
            ),
            within=5.0,
        ),
        Fault(
            "viewer-stopped",
            "a viewer that is stopped while it reads (SIGSTOP), for 5 s",
            partial(actions.beside, module="faults.viewer", words=("0", "reliable"), seconds=2.0, pause=5.0),
            within=9.0,
        ),
        Fault(
            "client-deaf",
            "a client that asks all nodes 20 times a second and cannot hear their answers",
            partial(actions.beside, module="faults.deaf", words=("20",), seconds=4.0),
            within=8.0,
            short=True,
        ),
        *(
            Fault(
                f"clock-{name}",
                f"the wall clock is set {words} by an hour",
                partial(actions.clock, seconds=hour),
                stand="clock",
            )
            for name, words, hour in (("back", "back", -3600.0), ("ahead", "forward", 3600.0))
        ),
        Fault(
            "solver-fails",
            "the solver fails in nearly every cycle (qp_max_iterations = 1)",
            actions.nothing,
            (TRACKS, RETRACTS),
            says=(("impedance_mpc", "solver failed"),),
            stand="solver",
        ),
        Fault(
            "disk-full",
            "the disk is full while the recorder writes",
            actions.fill,
            kills=(RECORDER,),
            within=30.0,
            stand="full",
        ),
    ]


def _run_script() -> list[Fault]:
    return [
        Fault(
            f"run-kill-{name}",
            f"scripts/run.sh whose {name} is killed",
            partial(actions.run_script, name=name),
            stand="none",
        )
        for name in (*NODES, RECORDER)
    ]


FAULTS: tuple[Fault, ...] = (*_others(), *_deaths(), *_stops(), *_topics(), *_messages(), *_run_script())
