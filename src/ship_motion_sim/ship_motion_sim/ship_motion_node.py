"""ROS node of the ship: its truth and the data of its IMU at every step of the drive; NMEA for other equipment.

The unit ship_unit.ShipMotion holds the law. The NMEA datagrams contain the true attitude, because they stand for an
instrument of the ship whose errors are not modelled.
"""
import socket
from collections.abc import Mapping

from pedestal_common.node import unit_node
from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Nanoseconds
from pedestal_common.wire.records import Decoded
from ship_motion_sim import nmea
from ship_motion_sim.params import NmeaParameters, ShipMotionParameters
from ship_motion_sim.ship_unit import ShipMotion


class ShipMotionNode(unit_node.UnitNode):
    """The node of the unit of the ship, which also sends NMEA datagrams if nmea.port is set."""
    parameters: ShipMotionParameters
    unit: ShipMotion

    def begin(self) -> None:
        """Open the socket, then begin like every unit. Raises ParameterError for a host without an address."""
        self.send_failure = ''          # reason why a datagram was not sent since the last diagnosis
        self.next_datagram_ns = 0       # stamp from which the next datagram is due
        if self.parameters.nmea.port:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.socket.setblocking(False)
            self.connect(self.parameters.nmea)
        super().begin()

    def connect(self, equipment: NmeaParameters) -> None:
        """Resolve the host of the equipment once. Raises ParameterError if it is not the name of one host."""
        try:
            self.socket.connect((equipment.host, equipment.port))
        except OSError as error:
            raise ParameterError(f"nmea.host = '{equipment.host}': must be the name or IPv4 address of one host: "
                                 f'{error.strerror}') from None

    def answer(self, stamp: Nanoseconds, values: Mapping[str, Decoded | None]) -> None:
        """Publish the step at a stamp; then send the attitude if the next datagram is due."""
        super().answer(stamp, values)
        if self.parameters.nmea.port and stamp >= self.next_datagram_ns:
            self.send_attitude(stamp)

    def send_attitude(self, stamp: Nanoseconds) -> None:
        """Send one datagram; missing equipment only causes a warning in the next diagnostics. Linux reports a datagram
        without a receiver when the next one is sent, so every second datagram to it succeeds."""
        period_ns = round(1e9 / self.parameters.nmea.rate)
        # Datagrams are due at whole multiples of the period: the next multiple after this stamp.
        self.next_datagram_ns = stamp - stamp % period_ns + period_ns
        truth = self.unit.parts['truth']
        try:
            self.socket.send(nmea.attitude(stamp, truth['roll'], truth['pitch'], truth['yaw'], truth['position'][2]))
        except OSError as error:
            to = self.parameters.nmea
            self.send_failure = f'NMEA to {to.host}:{to.port}: {error.strerror}'

    def diagnose(self) -> Diagnosis:
        """Return the diagnosis of the unit, with WARN instead of OK if a datagram could not be sent."""
        diagnosis = super().diagnose()
        failure, self.send_failure = self.send_failure, ''
        if failure and diagnosis.level == LEVEL_OK:
            return diagnosis._replace(level=LEVEL_WARN, message=failure)
        return diagnosis
