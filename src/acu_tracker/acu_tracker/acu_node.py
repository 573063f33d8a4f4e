"""ROS node of the antenna control unit: answers every receiver error with a rate command; modes by service."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node until it is stopped; args: of the command line, None for sys.argv."""
    return unit_node.main('acu_tracker.acu_node', args)


if __name__ == '__main__':
    sys.exit(main())
