"""ROS node of a real INS: publishes its attitude and rates on ship/imu/data, and its alignment on ins/state.

The unit `unit.InsInputUnit` reads the device.
"""
import numpy as np
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from pedestal_common.graph.nodes import Node
from pedestal_common.node import middleware
from pedestal_common.node.unit import Diagnosis
from pedestal_common.parameters import ParameterError
from pedestal_common.wire import messages
from pedestal_hardware.ins.params import InsInputParameters
from pedestal_hardware.ins.unit import InsInputUnit, Sample
from pedestal_hardware.lines.line_node import LineNode

ATTITUDE_TOPIC, STATE_TOPIC, IMU_TYPE = 'ship/imu/data', 'ins/state', 'sensor_msgs/msg/Imu'

DRIVER_QUEUE_DEPTH = 10  # number of messages of a driver that wait while the node is busy


class InsInputNode(LineNode):
    """Node of an InsInputUnit."""
    parameters: InsInputParameters

    def __init__(self, row: Node) -> None:
        super().__init__(row)
        p, self.unit = self.parameters, InsInputUnit(self.parameters)
        self.prepare(self.unit)
        self.message, self.state = messages.template(ATTITUDE_TOPIC), ''
        self.publish, self.publish_state = self.writer(ATTITUDE_TOPIC), self.writer(STATE_TOPIC)
        self.announce_state()
        if p.source == 'nmea':
            try:
                import pynmea2  # noqa: F401    an extra of this package, which the thread of the reader needs
            except ImportError as error:
                raise ParameterError(f"source = nmea: {error}: pip install 'pedestal_hardware[nmea]'") from None
            self.read_lines(p.nmea.url, p.nmea.baud_rate)
        else:
            # Drivers publish with either reliability; a best-effort subscriber receives both.
            profile = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=DRIVER_QUEUE_DEPTH,
                                 reliability=ReliabilityPolicy.BEST_EFFORT)
            self.create_subscription(middleware.message_class(IMU_TYPE), p.imu.topic, self._guarded(self.take_imu),
                                     profile, raw=True)

    @property
    def awaits(self) -> str:
        """Text that names the device for which the node waits."""
        p = self.parameters
        return f'{p.nmea.sentence.upper()} from {p.nmea.url}' if p.source == 'nmea' else p.imu.topic

    @property
    def quiet_reason(self) -> str:
        """Text for a device that sends nothing that can be used."""
        return f'no {self.awaits}'

    def take_line(self, line: bytes) -> None:
        """Publish the attitude of a sentence."""
        self.send(self.unit.take_line(line, self.clock()[1]))

    def take_imu(self, data: bytes) -> None:
        """Publish the attitude of a message of a driver, CDR bytes."""
        try:
            message = messages.deserialize(bytes(data), IMU_TYPE)
        except ValueError:
            self.unit.drops.counts['unreadable'] += 1
            return
        with self.lock:
            self.send(self.unit.take_imu(message, self.clock()[1]))

    def send(self, sample: Sample | None) -> None:
        """Publish a sample, or nothing without one; then ins/state after a change."""
        if sample is not None:
            self.published(sample.stamp)
            m = self.message
            messages.put_stamp(m.header.stamp, sample.stamp)
            for target, names, numbers in ((m.orientation, 'xyzw', sample.q), (m.angular_velocity, 'xyz', sample.w),
                                           (m.linear_acceleration, 'xyz', sample.force)):
                for name, number in zip(names, numbers):
                    setattr(target, name, float(number))
            m.orientation_covariance = np.diag(sample.variances).ravel()
            m.linear_acceleration_covariance[0] = -1.0 if np.isnan(sample.force[0]) else 0.0
            self.publish(messages.serialize(m))
        self.announce_state()

    def announce_state(self) -> None:
        """Publish ins/state after a change."""
        if self.unit.state != self.state:
            self.state = self.unit.state
            self.publish_state(messages.serialize(messages.String(data=self.state)))

    def diagnosed(self) -> Diagnosis:
        """Return the Diagnosis of the unit."""
        return self.unit.diagnose(self.clock()[1])
