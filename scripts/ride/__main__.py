"""Entry point of ``scripts/run.sh``: reads the options before anything is imported, so that --help answers at once."""

from __future__ import annotations

import sys

from ride.options import parse

WRONG, INTERRUPTED = 2, 130


def main() -> int:
    """Read the options and ride; give the exit code."""
    options = parse()
    from phil_node.surroundings import leave_if_unusable

    leave_if_unusable()
    from ride.command import carry_out

    try:
        return carry_out(options)
    except Exception as error:
        if type(error).__name__ != "RCLError":  # its type is at home in rclpy, which is loaded when it is needed
            raise
        print(f"ROS cannot start: {str(error).splitlines()[0]}", file=sys.stderr)
        return WRONG


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        # Before the first node was started, or after the last one has ended: nothing is left running.
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
