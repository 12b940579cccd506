"""What every node of the rig shares: parameters, QoS profiles, message guards, timing, kernels, the lifecycle base."""
