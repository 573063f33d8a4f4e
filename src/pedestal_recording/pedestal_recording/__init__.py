"""Recordings: a rosbag2 directory with MCAP files, written, read, proved complete, repaired, exported.

Knows pedestal_common alone, and no ROS."""
