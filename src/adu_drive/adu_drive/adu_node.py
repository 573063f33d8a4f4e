"""ROS node of the simulated drive, whose law is `drive_unit.step`."""
import pedestal_common.entry  # noqa: F401  # first, for signals during the other imports

# isort: split
import sys

from drive_law.rate_drive_node import RateDriveNode
from pedestal_common.node import shell


class AduNode(RateDriveNode):
    """Node of the unit `adu_drive.unit.Adu`."""

    def __init__(self) -> None:
        super().__init__('adu_drive.adu_node')


def main(args: list[str] | None = None) -> int:
    """Run the node to its end. Return the exit code."""
    return shell.main(AduNode, args)


if __name__ == '__main__':
    sys.exit(main())
