"""What the packages share without ROS: parameters and their files, compiled kernels, command lines, the machine."""
