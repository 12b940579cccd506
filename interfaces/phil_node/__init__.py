"""What every node of the test rig shares: parameters, QoS profiles, message guards, timing, kernels, the lifecycle base."""
