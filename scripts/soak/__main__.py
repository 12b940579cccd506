"""Entry point of ``scripts/soak.sh``: reads the options before anything is imported, so that --help answers at once."""

from __future__ import annotations

import signal
import sys
from types import FrameType

from soak.options import parse

FAILED, INTERRUPTED = 3, 130
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What ends the soak with all that it started; SIGINT too: a shell's background process would ignore it."""


def main() -> int:
    """Ride, judge, print, write; give the exit code."""
    options = parse()
    from soak.outcome import carry_out
    from soak.session import SoakError

    for number in SIGNALS:
        signal.signal(number, _interrupt)
    try:
        return carry_out(options)
    except SoakError as error:
        print(f"soak: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
