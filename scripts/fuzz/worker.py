"""A process that reads one case after the other: ``python -m fuzz.worker ENTRY MIB GOOD``, cases on standard input.

What a case prints goes to files, what became of it to the standard output that the process was started with. Memory
beyond MIB more than after the first good case is refused by the system; who waits for an answer kills a process that
hangs.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import traceback
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from fuzz.entries import ENTRIES, Entry

MIB = 1 << 20


def main() -> None:
    """Read a good case first, so that what is imported and compiled does not count; then whatever comes."""
    name, mib, good = sys.argv[1:]
    entry = ENTRIES[name]
    answers = os.fdopen(os.dup(1), "w")
    # Without a name: who waits for an answer kills this process, and nothing may be left of it.
    with TemporaryFile(buffering=0) as out, TemporaryFile(buffering=0) as errors:
        said = {1: out, 2: errors}
        for number, stream in said.items():
            os.dup2(stream.fileno(), number)
        _answer(answers, _tried(entry, Path(good), said))
        limit = _pages("VmSize") + int(mib) * MIB
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        for line in sys.stdin:
            _answer(answers, _tried(entry, Path(json.loads(line)), said))


def _answer(answers: IO[str], found: dict[str, Any]) -> None:
    answers.write(json.dumps(found) + "\n")
    answers.flush()


def _tried(entry: Entry, case: Path, said: Mapping[int, IO[bytes]]) -> dict[str, Any]:
    """Read a case; give exit code, standard error, MiB, and where an exception came from, innermost place of ours."""
    for stream in said.values():
        stream.truncate(0)
        stream.seek(0)
    before = _reset_peak()
    code: Any = None
    fault = trace = ""
    try:
        code = entry(case)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException as error:
        trace = traceback.format_exc()
        here = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
        fault = f"{type(error).__name__} from {Path(here[-1].filename).name}, {here[-1].name}"
    sys.stdout.flush()
    sys.stderr.flush()
    peak = _pages("VmHWM")
    said[2].seek(0)
    words = said[2].read(10**6).decode(errors="replace")
    return {"code": code, "said": words, "fault": fault, "trace": trace[-4000:], "mib": max(0, peak - before) / MIB}


def _reset_peak() -> int:
    """Begin a new measurement of the largest resident memory; give what it is now, in bytes."""
    with suppress(OSError):  # then the peak is that of all cases so far
        Path("/proc/self/clear_refs").write_text("5")
    return _pages("VmRSS")


def _pages(name: str) -> int:
    text = Path("/proc/self/status").read_text()
    return int(text.split(f"{name}:")[1].split()[0]) * 1024


if __name__ == "__main__":
    main()
