"""ROS node of the simulated drive, whose law is `drive_unit.step`."""
from drive_law.rate_drive_node import RateDriveNode


class AduNode(RateDriveNode):
    """Node of the unit `adu_drive.unit.Adu`."""
