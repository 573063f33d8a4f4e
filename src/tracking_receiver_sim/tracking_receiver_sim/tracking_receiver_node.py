"""ROS node of the tracking receiver: publishes the channels of the receiver for each direction of the beam."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node to its end; args: command line, None for sys.argv."""
    return unit_node.main('tracking_receiver_sim.tracking_receiver_node', args)


if __name__ == '__main__':
    sys.exit(main())
