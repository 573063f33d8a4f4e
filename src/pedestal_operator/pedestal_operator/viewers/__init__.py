"""Data for viewers of ROS: frames on demand, and the files that the viewers open (`files`)."""
