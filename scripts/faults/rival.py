"""A second publisher on a topic of the loop, in a process of its own: ``python -m faults.rival command | state``.

Both answer as somebody would who was started beside the real one by accident: with the cycle numbers of the ride that
is going on, as soon as they are known, and with numbers of their own.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import Any

import rclpy
from phil_interfaces.msg import ImpedanceCommand, RigState
from rclpy.executors import ExternalShutdownException

from faults.begun import announce
from faults.observer import RIVAL
from phil_node.qos import CYCLE, CYCLE_KEPT

OFFSET = 0.02
"""m, by which its drive, or the one that it commands, stands elsewhere."""
FORCE = 200.0
"""N, contact force that its rig reports."""


def main() -> None:
    """Publish until the process is ended."""
    what = sys.argv[1]
    rclpy.init()
    node = rclpy.create_node("rival", start_parameter_services=False, enable_rosout=False)
    if what == "command":
        out = node.create_publisher(ImpedanceCommand, "impedance_mpc/command", CYCLE_KEPT)

        def answer(state: Any) -> None:
            announce()
            goal = state.w_tr + OFFSET
            force = state.f_tr + 50.0
            header = state.header
            out.publish(
                ImpedanceCommand(header=header, cycle=state.cycle, u_tr=goal, u_tr_next=goal, f_tr=force, f_cat=force)
            )

        node.create_subscription(RigState, "test_rig_sim/state", answer, CYCLE)
    else:
        states = node.create_publisher(RigState, "test_rig_sim/state", CYCLE)

        def tick(command: Any) -> None:
            announce()
            # The command of cycle k is there: the real rig's state k + 1 is still to come.
            command.header.frame_id = RIVAL
            states.publish(
                RigState(
                    header=command.header,
                    cycle=command.cycle + 1,
                    mode=RigState.MODE_TRACKING,
                    w_tr=command.u_tr + OFFSET,
                    f_tr=FORCE,
                    reference=command.u_tr + OFFSET,
                )
            )

        node.create_subscription(ImpedanceCommand, "impedance_mpc/command", tick, CYCLE)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
