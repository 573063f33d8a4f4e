"""ROS node of a receiver with a level only: publishes each level on tracking_receiver/angle_error, with errors NaN.

The unit `unit.LevelUnit` reads the lines.
"""
import math

from pedestal_common.graph.nodes import Node
from pedestal_common.node.unit import Diagnosis
from pedestal_common.wire import messages
from pedestal_hardware.level.unit import LevelReceiverParameters, LevelUnit
from pedestal_hardware.lines.line_node import LineNode

ERROR_TOPIC = 'tracking_receiver/angle_error'


class LevelReceiverNode(LineNode):
    """Node of a LevelUnit. An error of 0 would state that the target is on the axis, so the errors are NaN."""
    parameters: LevelReceiverParameters

    def __init__(self, row: Node) -> None:
        super().__init__(row)
        self.unit, self.message = LevelUnit(self.parameters), messages.template(ERROR_TOPIC)
        self.message.vector.x = self.message.vector.y = math.nan
        self.publish = self.writer(ERROR_TOPIC)
        self.read_lines(self.parameters.url, self.parameters.baud_rate)

    @property
    def awaits(self) -> str:
        """Text that names the device for which the node waits."""
        return f'lines from {self.parameters.url}'

    def take_line(self, line: bytes) -> None:
        """Publish the level of a line."""
        level = self.unit.take(line, self.clock()[1])
        if level is None:
            return
        self.published(level.stamp)
        messages.put_stamp(self.message.header.stamp, level.stamp)
        self.message.vector.z = level.level
        self.publish(messages.serialize(self.message))

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the unit."""
        return self.unit.diagnose(self.clock()[1])
