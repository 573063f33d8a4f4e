"""ROS node of the tracking receiver: answers every joint state with the receiver's channels."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common import unit_node


def main(args=None):
    return unit_node.main('tracking_receiver_sim.tracking_receiver_node', args)


if __name__ == '__main__':
    sys.exit(main())
