"""ROS node of the antenna control unit: a rate command for each drive step, modes by service and by acu/command.

pedestal_common.node.unit_node runs the unit acu_tracker.unit.Acu, as row `acu` of pedestal_common.graph.nodes states.
To change the behaviour of the control unit, change the unit and its law control_unit.py.

The module imports `entry` before anything else, so that a signal during the other imports ends the process cleanly.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node until it is stopped; args: those of the command line, None for sys.argv."""
    return unit_node.main('acu_tracker.acu_node', args)


if __name__ == '__main__':
    sys.exit(main())
