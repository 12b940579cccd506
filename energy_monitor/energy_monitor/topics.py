"""The topics of a ride, relative to the nodes' namespace (absolute where ROS fixes the name)."""

RIG_STATE = "test_rig_sim/state"
COMMAND = "impedance_mpc/command"
CATENARY_STATE = "catenary_model/state"
BELIEVED = "impedance_mpc/conserved_quantities"
AUDITED = "energy_monitor/conserved_quantities"
CONTACT_QUALITY = "energy_monitor/contact_quality"

NODES = ("test_rig_sim", "impedance_mpc", "catenary_model", "energy_monitor")

RECORDED = (
    RIG_STATE,
    COMMAND,
    CATENARY_STATE,
    "catenary_model/impedance_model",
    "catenary_model/wire_shape",
    BELIEVED,
    AUDITED,
    CONTACT_QUALITY,
    "test_rig_sim/joint_states",
    "test_rig_sim/contact_force",
    *(f"{node}/timing" for node in NODES),
    "/diagnostics",
)
"""What a recording of a ride holds unless it is told otherwise."""
