"""Does one fault after the other and keeps the rows."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from energy_monitor.bag import read_bag
from energy_monitor.bag_channel import BagError
from faults import actions, judge
from faults.catalogue import Fault
from faults.disk import SmallDisk
from faults.judge import RETRACTS, SILENT, TRACKS, Limits, Row
from faults.stand import RECORDER, Stand
from phil_base.enumerations import Mode
from ride.lifecycle import RideError

TRIES = 3
"""Rides that a fault is done to before it counts against it that the machine held the loop up by itself."""
UNWRITTEN = 0.5
"""s before its death that a killed recorder may not have written."""
SETTLED = 0.3
"""s for which the end of a fault has to last."""
SPEAKS = 1.5
"""s for which a report is waited for: nodes speak once a second."""
RIG_STATE = "/test_rig_sim/state"


class Runner:
    """Holds the stand of the rows that go on with the same nodes; ``say`` gets a line for each step."""

    def __init__(self, out: Path, rate: float, say: Callable[[str], None]) -> None:
        self._out = out
        self._rate = rate
        self._say = say
        self._stand: Stand | None = None
        self._disk: SmallDisk | None = None
        self._number = 0
        self._armed_for = ""

    def run(self, faults: Iterable[Fault]) -> Iterable[Row]:
        """Do the faults; a row comes as soon as it is judged."""
        wanted = list(faults)
        try:
            for number, fault in enumerate(wanted):
                following = wanted[number + 1] if number + 1 < len(wanted) else None
                row = self._row(fault, following)
                # The table stands in the documentation: no folder of this machine.
                row.reported = [text.replace(str(self._out), "DIR") for text in row.reported]
                row.failures = [text.replace(str(self._out), "DIR") for text in row.failures]
                yield row
        finally:
            self.close()

    def close(self) -> None:
        """End everything."""
        if self._stand is not None:
            self._stand.close()
            self._stand = None
        self._armed_for = ""
        self._free_disk()

    def _free_disk(self) -> None:
        if self._disk is not None:
            self._disk.close()
            self._disk = None

    def _row(self, fault: Fault, following: Fault | None) -> Row:
        if fault.stand == "none":
            self.close()
            return self._without_stand(fault)
        row = Row(fault.name, fault.title)
        for attempt in range(TRIES):
            self._say(f"{fault.name}: {fault.title}" + (f" (again, {attempt + 1} of {TRIES})" if attempt else ""))
            row = Row(fault.name, fault.title, tries=attempt + 1)
            try:
                held_up = self._once(fault, row)
                same = following is not None and following.stand == fault.stand
                again = fault if held_up and attempt + 1 < TRIES else following if same and following else fault
                self._rejoin(row, fault, again)
            except RideError as error:
                row.failures.append(str(error))
                held_up = True
                self.close()
            if row.ok or not held_up:
                break
            self._say(f"    {'; '.join(row.failures)}")
        if row.failures:
            self.close()  # what went wrong here is not to be held against the next row
        return row

    def _bring_up(self, fault: Fault) -> Stand:
        if self._stand is not None and (self._stand.kind != fault.stand or fault.stand == "full"):
            self.close()
        if self._stand is None:
            self._stand = Stand(self._out / fault.stand, self._rate, fault.stand)
        if self._armed_for != fault.name:
            self._arm(fault, small=fault.stand == "full")
        return self._stand

    def _arm(self, fault: Fault, small: bool = False) -> None:
        assert self._stand is not None
        stand, self._armed_for = self._stand, ""
        stand.mend()
        self._number += 1
        folder = stand.folder / f"{self._number:03d}-{fault.name}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        if small:
            self._disk = SmallDisk(folder)
        self._bag = folder / "bag"
        stand.record(self._bag)
        if self._disk is not None:
            self._disk.limit(stand.processes[RECORDER].pid)
        stand.arm()
        self._armed_for = fault.name

    def _once(self, fault: Fault, row: Row) -> bool:
        """Do it and judge; tell whether what went wrong may be the machine's doing."""
        stand = self._bring_up(fault)
        self._armed_for = ""
        stand.wait(0.3)
        newest = stand.observer.newest
        assert newest is not None
        stand.begin()
        try:
            row.reported += fault.action(stand)
        except actions.Wrong as wrong:
            row.failures.append(str(wrong))
        acted = time.monotonic()
        while time.monotonic() < stand.begun + fault.within and not self._ended(stand, fault, acted):
            stand.wait(0.1)
        stand.wait(SETTLED)
        self._judge_drive(stand, fault, row, newest.late)
        reports = self._judge_reports(stand, fault, row)
        row.failures += [
            f"{name} died too (code {stand.processes[name].code})" for name in stand.dead if name not in fault.kills
        ]
        self._check_bag(stand, fault, row, newest.cycle)
        reason = " ".join(reports.get("test_rig_sim", []))
        if row.ended in fault.ends:
            return row.ended == TRACKS and row.safe_after is None
        # Without a word of the rig although it lives, it is this process or the middleware that was held up.
        return row.ended == SILENT or (row.ended == RETRACTS and ", 0 refused" in reason)

    def _judge_drive(self, stand: Stand, fault: Fault, row: Row, late: int) -> None:
        sights = stand.observer.sights()
        row.ended, row.safe_after = judge.outcome(sights, stand.begun, time.monotonic(), 1.0 / self._rate)
        row.late = max((sight.late for sight in sights), default=late) - late
        row.peaks = judge.peaks(sights)
        row.failures += row.peaks.beyond(self._limits(stand))
        if row.ended not in fault.ends:
            row.failures.append(f"the drive {row.ended}, which is not how this has to end ({' or '.join(fault.ends)})")
        elif row.safe_after is None or row.safe_after > fault.within:
            row.failures.append(f"the drive was not safe within {fault.within:g} s")

    def _judge_reports(self, stand: Stand, fault: Fault, row: Row) -> dict[str, list[str]]:
        heard = time.monotonic() + SPEAKS
        while True:
            reports = judge.said(stand.observer.remarks, stand.begun)
            found, missing = judge.answers(reports, fault.says)
            if not missing or time.monotonic() > heard:
                break
            stand.wait(0.1)
        row.reported += found or [f"{node}: {texts[-1]}" for node, texts in reports.items()]
        row.failures += missing
        return reports

    def _ended(self, stand: Stand, fault: Fault, acted: float) -> bool:
        sights = stand.observer.sights()
        if SILENT in fault.ends and time.monotonic() - acted > judge.SILENCE:
            return True
        if fault.ends == (RETRACTS,) and (not sights or sights[-1].mode != Mode.STOPPED):
            return False
        return judge.steady(sights, acted)

    def _limits(self, stand: Stand) -> Limits:
        rig = stand.settings["test_rig_sim"]
        names = ("limits.position", "limits.speed", "limits.force", "drive.current_limit")
        return Limits(*(rig[name] for name in names))

    def _check_bag(self, stand: Stand, fault: Fault, row: Row, cycle: int) -> None:
        """Nothing that was recorded before the fault may be lost."""
        stand.rest()
        dead = stand.processes[RECORDER].ended
        code = stand.stop_recording()
        words = stand.processes[RECORDER].last_words(1)
        # What the middleware lost on a machine that is held up, the recorder has told; what it wrote is judged below.
        gaps = code == 1 and "messages were lost" in words
        if not dead and code != 0 and not gaps:
            row.failures.append(f"the recorder ended with code {code}: {words}")
        through = cycle
        if fault.name == f"kill-{RECORDER}":
            through -= round(UNWRITTEN / stand.period)
        if fault.stand == "full":
            through = 1
            assert self._disk is not None
            row.reported.append(self._disk.kind)
        row.bag = self._read(row, self._bag, through) + ("; " + words.removeprefix("record: ") if gaps else "")
        self._free_disk()

    @staticmethod
    def _read(row: Row, bag: Path, through: int) -> str:
        try:
            cycles = read_bag(bag).tables[RIG_STATE]["cycle"].tolist()
        except (BagError, KeyError, OSError) as error:
            row.failures.append(f"the bag cannot be read: {error}")
            return "unreadable"
        if gaps := judge.bag_gaps(cycles, through):
            row.failures.append(gaps)
        return f"{len(set(cycles))} cycles, to {max(cycles, default=-1)}"

    def _rejoin(self, row: Row, fault: Fault, following: Fault) -> None:
        """Start what is dead again, re-arm, and see the drive follow; the next row goes on from there."""
        assert self._stand is not None
        dead = ", ".join(name for name in self._stand.dead if name in fault.kills)
        begun = time.monotonic()
        for attempt in range(TRIES):
            try:
                self._arm(following)
                break
            except RideError as error:
                if attempt + 1 == TRIES:
                    row.failures.append(f"after the re-arm: {error}")
                    return
                self._stand.stop_recording()
                self._free_disk()
        what = f"{dead} started again" if dead else "re-arm"
        row.rejoined = f"follows {time.monotonic() - begun:.1f} s after {what}"

    def _without_stand(self, fault: Fault) -> Row:
        self._say(f"{fault.name}: {fault.title}")
        row = Row(fault.name, fault.title, ended="ended")
        folder = self._out / "run"
        folder.mkdir(parents=True, exist_ok=True)
        try:
            row.reported += actions.run_script(folder, fault.name.removeprefix("run-kill-"))
        except actions.Wrong as wrong:
            row.failures.append(str(wrong))
        else:
            row.bag = self._read(row, folder / fault.name.removeprefix("run-kill-").join(("run-", "/bag")), 100)
        return row
