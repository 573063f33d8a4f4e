"""ROS shell of the ship: answers every tick of the drive's clock with the ship's truth and what its IMU feels."""
import socket
import sys

import numpy as np

from pedestal_common import records, shell
from pedestal_common.parameters import ParameterError
from ship_motion_sim import imu, motion, nmea
from ship_motion_sim.params import ShipMotionParameters
from ship_motion_sim.ship_unit import CLOCK, RAW, TRUTH, ShipMotion


class ShipMotionNode(shell.Shell):

    def __init__(self):
        super().__init__('ship_motion', ShipMotionParameters)
        self.unit = ShipMotion(self.parameters)
        self.prepare(self.unit)
        self.clock = records.only(self.unit.heard, CLOCK)
        self.says = [(self.unit.messages[name], records.only(self.unit.said, name), self.writer(name))
                     for name in (TRUTH, RAW)]
        self.unsent = ''
        self.next_datagram = 0
        if self.parameters.nmea.port:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.socket.setblocking(False)
            self.connect(self.parameters.nmea)
        self.diagnose_with(self.diagnose)
        self.follow(CLOCK, self.unit.followers, self.step)

    def connect(self, equipment):
        """Look the host up, once; what cannot be reached from here is said at the start."""
        try:
            self.socket.connect((equipment.host, equipment.port))
        except OSError as error:
            raise ParameterError(f"nmea.host = '{equipment.host}': must be the name or IPv4 address of one host: "
                                 f'{error.strerror}') from None

    def step(self, stamp, _clock, _followers):
        self.clock.stamp[0] = stamp
        self.unit.answer()
        self.begin_step(stamp)
        for message, place, send in self.says:
            records.put(message, place)
            send(message)
        if self.parameters.nmea.port and stamp >= self.next_datagram:
            self.send_attitude(stamp)

    def send_attitude(self, stamp):
        """One datagram; equipment that is not there costs nothing but a word in the next diagnostics. The system tells
        of a datagram that nobody took when the next is sent, which then is not, so that every other one succeeds."""
        period = round(1e9 / self.parameters.nmea.rate)
        self.next_datagram = stamp - stamp % period + period
        o = self.unit.truth[0]
        try:
            self.socket.send(nmea.attitude(stamp, o['roll'], o['pitch'], o['yaw'], o['position'][2]))
        except OSError as error:
            self.unsent = f'NMEA to {self.parameters.nmea.host}:{self.parameters.nmea.port}: {error.strerror}'

    def diagnose(self):
        truth = self.unit.truth[0]
        unsent, self.unsent = self.unsent, ''
        values = [(f'{name}_deg', f'{np.degrees(truth[name]):.3f}') for name in ('roll', 'pitch')]
        for status, names in ((truth['status'], motion.STATUS), (self.unit.felt[0]['status'], imu.STATUS)):
            if status:
                return shell.ERROR, names[status], values
        if self.steps.refused:
            return shell.WARN, self.steps.refusal, values
        if self.unit.over():
            return shell.WARN, 'the recorded motion is over, the deck is at rest', values
        if unsent:
            return shell.WARN, unsent, values
        return shell.OK, 'under way', values


def main(args=None):
    return shell.main(ShipMotionNode, args)


if __name__ == '__main__':
    sys.exit(main())
