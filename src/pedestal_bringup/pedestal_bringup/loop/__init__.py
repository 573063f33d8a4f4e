"""Closed loop of a scenario without ROS: one run, several side by side, the compilation of its laws."""
