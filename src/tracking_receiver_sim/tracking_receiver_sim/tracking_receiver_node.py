"""ROS node of the tracking receiver: publishes the channels of the receiver for each direction of the beam.

The unit unit.TrackingReceiver (tracking_receiver_sim/unit.py) runs the law receiver.step
(tracking_receiver_sim/receiver.py); change the receiver there. `entry` is imported first because a signal during the
other imports would end the process with a traceback.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys

from pedestal_common.node import unit_node


def main(args: list[str] | None = None) -> int:
    """Run the node to its end; args: command line, None for sys.argv."""
    return unit_node.main('tracking_receiver_sim.tracking_receiver_node', args)


if __name__ == '__main__':
    sys.exit(main())
