"""ROS node of the antenna drive unit: owns the time, publishes the encoders, executes rate commands.

The node runs the unit `adu_drive.unit.Adu`, whose law is `drive_unit.step`; change the drive there. The clock and the
steps are in drive_law.timekeeper_node, the state file is in drive_law.rate_drive_node. `entry` is imported first, so
that a signal during the other imports ends the process without a message.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from drive_law.rate_drive_node import RateDriveNode
from pedestal_common.node import shell


class AduNode(RateDriveNode):
    """Node of the simulated drive."""

    def __init__(self) -> None:
        super().__init__('adu_drive.adu_node')


def main(args: list[str] | None = None) -> int:
    """Run the node to its end. Return the exit code."""
    return shell.main(AduNode, args)


if __name__ == '__main__':
    sys.exit(main())
