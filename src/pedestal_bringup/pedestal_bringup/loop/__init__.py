"""Closed loop of a scenario in one process without ROS: one run, runs side by side, and the compilation of laws."""
