"""The closed loop of a scenario without ROS: one run, several side by side, its laws made ready."""
