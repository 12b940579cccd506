"""The closed loop as a library: catenary, controller and rig of one ride, without ROS."""
