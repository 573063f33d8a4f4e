"""ROS node of the tracking receiver: answers every direction of the beam with the receiver's channels."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node until it is stopped; args: of the command line, None for sys.argv."""
    return unit_node.main('tracking_receiver_sim.tracking_receiver_node', args)


if __name__ == '__main__':
    sys.exit(main())
