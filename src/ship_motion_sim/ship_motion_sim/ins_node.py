"""ROS node of the INS: hears the IMU, publishes attitude and deck rate as the INS knows them."""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common import unit_node


def main(args=None):
    return unit_node.main('ship_motion_sim.ins_node', args)


if __name__ == '__main__':
    sys.exit(main())
