"""Recordings: rosbag2 directories with MCAP files, and programs that write, read, verify, recover and export them.

The package depends on pedestal_common only. Of its modules, only the recorder node needs ROS."""
