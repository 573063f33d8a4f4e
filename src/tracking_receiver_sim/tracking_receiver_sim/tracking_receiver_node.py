"""ROS node of the tracking receiver: publishes the channels of the receiver for each direction of the beam.

pedestal_common.node.unit_node runs the unit tracking_receiver_sim.unit.TrackingReceiver, as row `tracking_receiver` of
pedestal_common.graph.nodes states. To change what the receiver measures, change the unit and its law receiver.py.

The module imports `entry` before anything else, so that a signal during the other imports ends the process cleanly.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args=None):
    """Run the node to its end; args: command line, None for sys.argv."""
    return unit_node.main('tracking_receiver_sim.tracking_receiver_node', args)


if __name__ == '__main__':
    sys.exit(main())
