"""Step track with level_receiver_node: a receiver with a level only, by UDP and by a serial line."""
import math
import os
import pty
import socket
import time
import tty

import numpy as np
import pytest
from shared import NODE

from pedestal_common.wire import commands

pytestmark = pytest.mark.thorough

TARGET, BEAMWIDTH = np.array((0.506, 0.6)), 0.0175
GRAPH = ('graph.pacing:=realtime', 'graph.nodes:=acu,adu')
MODULES = {'adu_node': (*GRAPH, 'period:=0.02', 'initial_azimuth:=0.7', 'initial_elevation:=0.6'),
           'acu_node': (*GRAPH, 'period:=0.02', 'steptrack.cycle:=2.0', 'steptrack.dwell:=0.3',
                                    'azimuth.feedforward.bandwidth:=4.0', 'elevation.feedforward.bandwidth:=4.0')}


class UdpReceiver:
    """A receiver that sends datagrams of one line."""

    def __init__(self):
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.port = self.socket.getsockname()[1]
        self.socket.close()
        self.socket = socket.socket(type=socket.SOCK_DGRAM)
        self.url, self.form = f'udp://127.0.0.1:{self.port}', '{level}'

    def send(self, level):
        self.socket.sendto(b'%.2f\0' % level, ('127.0.0.1', self.port))

    def close(self):
        self.socket.close()


class SerialReceiver:
    """A receiver on a serial line, with a unit and in two pieces."""

    def __init__(self):
        self.ends = pty.openpty()
        tty.setraw(self.ends[1])
        self.url, self.form = os.ttyname(self.ends[1]), 'L {level} dBm'

    def send(self, level):
        os.write(self.ends[0], b'L %.2f ' % level)
        os.write(self.ends[0], b'dBm\r\n')

    def close(self):
        for end in self.ends:
            os.close(end)


@pytest.fixture(params=(UdpReceiver, SerialReceiver))
def receiver(request):
    made = request.param()
    yield made
    made.close()


def test_step_track_by_a_level(receiver, start_process, connect, reserve_domain):
    """Step track climbs to the target by a level, 20 times a second. First the ACU learns the noise off target. A
    half line and a level out of range are named, and the node continues."""
    domain, noise, last = reserve_domain(), np.random.default_rng(1), [-math.inf]
    node = {'level_receiver_node': (
        *GRAPH, f'url:={receiver.url}', f"format:='{receiver.form}'", 'lowest:=0.0', 'highest:=90.0')}
    for module, changes in {**MODULES, **node}.items():
        start_process([*NODE, module, '--ros-args',
                       *(part for change in changes for part in ('-p', change))], ROS_DOMAIN_ID=str(domain))
    client = connect(domain, 'level')

    def send(joints):
        if time.monotonic() - last[0] > 0.05:
            last[0] = time.monotonic()
            off = (np.array(joints.position) - TARGET) * (math.cos(TARGET[1]), 1.0) / BEAMWIDTH
            receiver.send(max(50.0 - 12.0 * float(off @ off), 20.0) + 0.02 * noise.standard_normal())

    def error():
        return abs(client.heard['joint_states'][-1].position[0] - TARGET[0]) / BEAMWIDTH

    client.read('joint_states', send)
    client.read('acu/mode')
    client.read('diagnostics')
    client.read('tracking_receiver/angle_error')
    client.write('acu/command')
    client.diagnosed('receives levels', 60.0)
    client.spin(3.0)
    client.publish('acu/command', commands.message(commands.Command('preset', 'client', '1', {
        'azimuth': 0.5, 'elevation': 0.6})))
    client.until(lambda: error() < 0.4)
    receiver.send(999.0)
    client.diagnosed('level 999 dB: must be 0 to 90 dB')
    client.publish('acu/command', commands.message(commands.Command('steptrack', 'client', '2')))
    client.until(lambda: error() < 0.03, told=lambda: f'{error():.3f} beamwidths off')
    assert client.heard['acu/mode'][-1].data == 'steptrack'
    vector = client.heard['tracking_receiver/angle_error'][-1].vector
    assert math.isnan(vector.x) and math.isnan(vector.y) and vector.z > 45.0
