"""The hunt: damaged files by hypothesis, each read by a process of its own kind, the smallest of each fault kept."""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import HypothesisWarning

from fuzz.judge import REFUSED, Outcome, fault_of
from fuzz.kinds import Example, Kind
from fuzz.mutations import mutants

PATIENCE = 20.0
"""s that a case may take."""
START_PATIENCE = 300.0
"""s for the first case of a process, which imports and compiles."""
SHRINK_SECONDS = 60.0
"""s in which smaller cases of the faults of a kind are looked for."""
ROOM = 2.0
"""Address space that a process may take beyond that of a good case, over the memory that is judged."""


class Reader:
    """A process that reads cases by one entry; begun anew when it hangs or dies."""

    def __init__(self, entry: str, most_mib: float, good: Path) -> None:
        self.entry = entry
        self._command = [sys.executable, "-m", "fuzz.worker", entry, str(round(ROOM * most_mib + 64)), str(good)]
        self._child: subprocess.Popen[bytes] | None = None

    def read(self, case: Path) -> Outcome:
        """Let the process read a case, one that hangs a second time in a new process: the machine may have been busy.

        Raises RuntimeError if it cannot even read a good one.
        """
        found = self._read(case)
        return self._read(case) if found.seconds >= PATIENCE and found.ended else found

    def _read(self, case: Path) -> Outcome:
        if self._child is None:
            self._begin()
        assert self._child is not None and self._child.stdin is not None
        self._child.stdin.write(json.dumps(str(case)).encode() + b"\n")
        self._child.stdin.flush()
        return self._outcome(PATIENCE)

    def end(self) -> None:
        """End the process."""
        if self._child is not None:
            self._child.kill()
            self._child.communicate()
            self._child = None

    def _begin(self) -> None:
        self._child = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        first = self._outcome(START_PATIENCE)
        if first.code not in (0, 1) or first.fault:
            raise RuntimeError(f"{self.entry} does not read a good example: {first}")

    def _outcome(self, patience: float) -> Outcome:
        assert self._child is not None and self._child.stdout is not None
        begin = time.monotonic()
        line = b""
        while not line.endswith(b"\n"):
            left = begin + patience - time.monotonic()
            ready = select.select([self._child.stdout], [], [], max(0.0, left))[0]
            if not ready:
                self.end()
                return Outcome(ended=f"no answer within {patience:g} s", seconds=patience)
            part = os.read(self._child.stdout.fileno(), 1 << 20)
            if not part:
                code = self._child.wait()
                self.end()
                return Outcome(ended=f"the process ended with code {code}", seconds=time.monotonic() - begin)
            line += part
        return replace(Outcome(**json.loads(line)), seconds=time.monotonic() - begin)


@dataclass
class Fault:
    """A fault: what it is, which entry has it, the smallest case that shows it."""

    what: str
    entry: str
    example: Example
    content: bytes
    outcome: Outcome
    folder: Path | None = None

    def keep(self, folder: Path) -> None:
        """Write case and a note how to repeat it."""
        shutil.rmtree(folder, ignore_errors=True)
        place = self.example.lay(folder / "case", self.content)
        said = self.outcome.said[:2000]
        note = f"{self.what}\nrepeat: scripts/fuzz.sh --repeat {folder}\nentry: {self.entry}\nread: {place.name}\n"
        note += f"\n{said}\n"
        (folder / "note.txt").write_text(note + self.outcome.trace, encoding="utf-8", errors="replace")
        self.folder = folder


@dataclass
class Row:
    """What came of one kind of file: counts of cases, the slowest (s), the largest (MiB), the faults."""

    kind: str
    cases: int = 0
    refused: int = 0
    read: int = 0
    seconds: float = 0.0
    mib: float = 0.0
    faults: dict[tuple[str, str], Fault] = field(default_factory=dict)


@contextmanager
def readers(kind: Kind, examples: list[Example], folder: Path) -> Iterator[Callable[[Example, bytes], list[Fault]]]:
    """Give a function that judges a content of an example, by every entry of its kind."""
    good = examples[0].lay(folder / "good")
    processes = [Reader(entry, kind.most_mib, good) for entry in kind.entries]

    def judged(example: Example, content: bytes) -> list[Fault]:
        place = folder / "case"
        shutil.rmtree(place, ignore_errors=True)
        case = example.lay(place, content)
        found = []
        for reader in processes:
            outcome = reader.read(case)
            what = fault_of(outcome, case.name, kind.most_mib, several=kind.several, naming=kind.naming)
            found.append(Fault(what, reader.entry, example, content, outcome))
        return found

    try:
        yield judged
    finally:
        for reader in processes:
            reader.end()


def hunt(kind: Kind, examples: list[Example], mutations: int, number: int | None, folder: Path) -> Row:
    """Damage the examples ``mutations`` times and judge each; ``number`` seeds the damages, None: always the same."""
    row = Row(kind.name)
    shrinking: list[float] = []  # the time at which that ends
    kinds_of_fault: dict[tuple[str, str], type[Exception]] = {}
    with readers(kind, examples, folder) as judged:

        def case(drawn: tuple[Example, bytes]) -> None:
            if shrinking and time.monotonic() > shrinking[0]:
                return
            found = judged(*drawn)
            row.cases += not shrinking
            row.seconds = max(row.seconds, *(fault.outcome.seconds for fault in found))
            row.mib = max(row.mib, *(fault.outcome.mib for fault in found))
            bad = [fault for fault in found if fault.what]
            row.refused += not bad and not shrinking and any(fault.outcome.code == REFUSED for fault in found)
            row.read += not bad and not shrinking and all(fault.outcome.code != REFUSED for fault in found)
            for fault in bad:
                key = (fault.entry, fault.what)
                if key not in row.faults or len(fault.content) < len(row.faults[key].content):
                    row.faults[key] = fault
            for fault in bad if shrinking else ():
                # Hypothesis tells faults by their type and shrinks each of them.
                key = (fault.entry, fault.what)
                raise kinds_of_fault.setdefault(key, type("FaultError", (Exception,), {}))(fault.what)

        drawn = st.sampled_from(examples).flatmap(
            lambda example: mutants(example.content, example.form).map(lambda content: (example, content))
        )
        test = settings(
            max_examples=mutations,
            derandomize=number is None,
            database=None,
            deadline=None,
            phases=(Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
            verbosity=Verbosity.quiet,
            print_blob=False,
        )(given(drawn)(case))
        if number is not None:
            test = seed(number)(test)
        warnings.simplefilter("ignore", HypothesisWarning)  # large cases are meant
        test()
        if row.faults:  # all cases were read: once more, to look for the smallest of each
            shrinking.append(time.monotonic() + SHRINK_SECONDS)
            with suppress(Exception):  # the faults, alone or in a group: they are in the row
                test()
    return row
