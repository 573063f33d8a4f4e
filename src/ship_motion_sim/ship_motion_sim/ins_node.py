"""ROS node of the INS: subscribes to the IMU, publishes measured attitude and deck rate.

pedestal_common.node.unit_node runs the unit ship_motion_sim.ins_unit.Ins, as row `ins` of pedestal_common.graph.nodes
states. To change what the INS measures, change the unit and its laws in the folder navigation.

The module imports `entry` before anything else, so that a signal during the other imports ends the process cleanly.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node to its end; args: command line, None for sys.argv."""
    return unit_node.main('ship_motion_sim.ins_node', args)


if __name__ == '__main__':
    sys.exit(main())
