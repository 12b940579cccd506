"""Base of every node of the rig: lifecycle, links between nodes, topics, QoS profiles, timing, diagnostics."""
