"""What viewers of ROS read: frames on demand, and the files that they open (`files`)."""
