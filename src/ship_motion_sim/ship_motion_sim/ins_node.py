"""ROS node of the INS: subscribes to the IMU, publishes measured attitude and deck rate.

The unit ins_unit.Ins (ship_motion_sim/ins_unit.py) holds the laws; change the INS there. `entry` is imported first
because a signal during the other imports would end the process with a traceback.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args: list[str] | None = None) -> int:
    """Run the node to its end; args: command line, None for sys.argv."""
    return unit_node.main('ship_motion_sim.ins_node', args)


if __name__ == '__main__':
    sys.exit(main())
