"""ROS node of the antenna control unit: a rate command for each drive step, modes by service and by acu/command."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node until it is stopped; args: those of the command line, None for sys.argv."""
    return unit_node.main('acu_tracker.acu_node', args)


if __name__ == '__main__':
    sys.exit(main())
