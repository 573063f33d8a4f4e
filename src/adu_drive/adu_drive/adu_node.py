"""ROS node of the antenna drive unit: owns the drive's time, publishes the encoders, obeys rate commands."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from adu_drive.timekeeper_node import Timekeeper
from pedestal_common import shell


def main(args=None):
    return shell.main(lambda: Timekeeper('adu_drive.adu_node'), args)


if __name__ == '__main__':
    sys.exit(main())
