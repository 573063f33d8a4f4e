"""Starts a scenario of the tracking antenna: as a graph of nodes, by ros2 launch, or as a closed loop without ROS."""
