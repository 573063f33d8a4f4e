"""Executable of the ROS node `acu`: `unit_node.UnitNode` runs the unit `acu_tracker.unit.Acu`.

`entry` is imported first, so that a signal of the operating system during the other imports ends the process without a
message.
"""
import pedestal_common.entry  # noqa: F401

# isort: split
import sys
from collections.abc import Sequence

from pedestal_common.node import unit_node


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped; args: arguments of the command line, None for sys.argv."""
    return unit_node.main('acu_tracker.acu_node', args)


if __name__ == '__main__':
    sys.exit(main())
