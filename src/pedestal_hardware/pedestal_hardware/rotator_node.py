"""ROS node of a rotator: a drive that takes set-points, by rotctld, GS-232, EasyComm, Rot1Prog or Rot2Prog.

The node owns the time of its graph, which is a graph in realtime with the angles of an array (`graph.beams` 1). It
runs the unit `rotator.unit.Rotator`; change the law in `rotator.set_point`.
"""
import functools
import time
from collections.abc import Mapping

from drive_law.timekeeper_node import Timekeeper
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Nanoseconds
from pedestal_common.wire.records import Decoded
from pedestal_hardware.rotator.line import Line
from pedestal_hardware.rotator.protocols import PROTOCOLS
from pedestal_hardware.rotator.unit import Rotator
from pedestal_hardware.rotator_params import RotatorParameters


class RotatorNode(Timekeeper):
    """A drive whose steps exchange angles with the Line of a rotator."""

    parameters: RotatorParameters
    unit: Rotator

    def __init__(self, row: Node) -> None:
        self.line: Line | None = None
        super().__init__(row)

    def begin(self) -> None:
        """Connect to the device and begin the steps."""
        p = self.parameters
        protocol = functools.partial(PROTOCOLS[p.protocol], p.azimuth_only)
        self.line = Line(p.url, protocol, p.period, p.answer_timeout, p.baud_rate)
        self.line.start()
        super().begin()

    def _make(self, stamp: Nanoseconds, values: Mapping[str, Decoded | None]) -> None:
        unit, line = self.unit, self.line
        assert line is not None
        unit.measure(line.newest, time.monotonic())
        unit.counts, unit.fault = dict(line.counts), line.fault
        super()._make(stamp, values)
        decision = unit.decision
        if decision is not None:
            line.send(decision)

    def close(self) -> None:
        """Stop the device and end."""
        if self.line is not None:
            self.line.close()
        super().close()
