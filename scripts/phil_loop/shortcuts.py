"""What the command line and `settings` call by a short name. Imports nothing, so that --help answers at once."""

SHORTCUTS = {
    "speed_kmh": ("catenary_model", "speed_kmh"),
    "line": ("catenary_model", "line"),
    "discretisation": ("catenary_model", "discretisation"),
    "duration": ("test_rig_sim", "duration"),
    "mode": ("test_rig_sim", "mode"),
    "pantograph": ("test_rig_sim", "pantograph"),
    "seed": ("test_rig_sim", "seed"),
}
"""Short names of what is nothing but a parameter of a node."""
