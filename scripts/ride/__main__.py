"""Entry point of ``scripts/run.sh``: reads the options before anything is imported, so that --help answers at once."""

from __future__ import annotations

import sys

from ride.options import parse

INTERRUPTED = 130


def main() -> int:
    """Read the options and ride; give the exit code."""
    options = parse()
    from ride.command import carry_out

    return carry_out(options)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        # Before the first node was started, or after the last one has ended: nothing is left running.
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
