"""The four nodes of a ride in one process: ``python -m ride.composed --ros-args ...``."""

import phil_node.before_rclpy  # noqa: F401  # isort: skip

from catenary_model.node import CatenaryNode
from energy_monitor.node import MonitorNode
from impedance_mpc.node import ImpedanceNode
from phil_node.process import leave, run_together
from test_rig_sim.node import RigNode

KINDS = (CatenaryNode, ImpedanceNode, MonitorNode, RigNode)
"""In the order in which they are brought up."""


def main() -> None:
    """Run the nodes."""
    leave(run_together(KINDS))


if __name__ == "__main__":
    main()
