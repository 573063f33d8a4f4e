"""The runnable files of docs/how-to: a receiver publishes what a datagram says with the stamp of the drive, and two
drives move their axes to where the control unit commands them."""
import ast
import itertools
import math
import pathlib
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from shared import NODE

from pedestal_common.wire import commands, messages

pytestmark = pytest.mark.thorough

DOCS = pathlib.Path(__file__).parents[1] / 'docs'
FILE = DOCS / 'how-to' / 'receiver.py'


def test_a_receiver_of_ones_own(start_process, connect, domain_id):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    start_process([sys.executable, FILE, port])
    client = connect(domain_id)
    client.write('joint_states')
    client.read('tracking_receiver/angle_error')
    heard = client.heard['tracking_receiver/angle_error']

    def step(k):
        joints = messages.template('joint_states')
        messages.put_stamp(joints.header.stamp, k * 5_000_000)
        client.publish('joint_states', joints)
        return k

    # A step without a datagram, or with one of other contents, is a step without a measurement and without a message.
    steps = itertools.count(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hardware:
        for text, expected in ((b'0.001 -0.002 46.5', (0.001, -0.002, 46.5)), (b'beep', None),
                               (b'nan nan 20', (math.nan, math.nan, 20.0))):
            del heard[:]
            last = step(next(steps))
            hardware.sendto(text, ('127.0.0.1', port))
            if expected:
                client.until(lambda: (step(next(steps)), heard)[1])
            for _ in range(5):
                step(next(steps))
                client.executor.spin_once(timeout_sec=0.05)
            assert len(heard) == (expected is not None)
            for error in heard:
                assert messages.nanoseconds(error.header.stamp) >= last * 5_000_000
                assert (error.vector.x, error.vector.y, error.vector.z) == pytest.approx(expected, nan_ok=True)


@pytest.mark.every_case
@pytest.mark.parametrize('file', sorted(
    str(path.relative_to(DOCS)) for path in DOCS.rglob('*.py') if '__main__' in path.read_text()))
def test_each_program_of_the_documentation_describes_itself(file):
    done = subprocess.run([sys.executable, DOCS / file, '--help'], capture_output=True, text=True, cwd=DOCS.parent)
    described = ast.get_docstring(ast.parse((DOCS / file).read_text())).splitlines()[0]
    assert done.returncode == 0 and described in done.stdout, done.stderr


class Amplifiers(threading.Thread):
    """Amplifiers of two axes at a UDP port: of first order in rate, or in angle where they close the position loop."""

    RATE_LOOP, POSITION_LOOP, LARGEST_RATE = 30.0, 10.0, 0.35
    """Bandwidths [rad/s] and largest rate [rad/s]."""

    def __init__(self, angles):
        super().__init__(daemon=True)
        self.angles, self.rates, self.commands = list(angles), [0.0, 0.0], []
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.port = self.socket.getsockname()[1]

    def move(self, axis, command, dt):
        """One step of an axis that follows rates."""
        self.rates[axis] += (command - self.rates[axis]) * min(self.RATE_LOOP * dt, 1.0)

    def run(self):
        before = time.monotonic()
        while True:
            text, client = self.socket.recvfrom(200)
            now = time.monotonic()
            for axis, command in enumerate(map(float, text.split())):
                if not math.isnan(command):
                    self.move(axis, command, now - before)
                    self.rates[axis] = min(max(self.rates[axis], -self.LARGEST_RATE), self.LARGEST_RATE)
                self.angles[axis] += self.rates[axis] * (now - before)
            before = now
            self.socket.sendto(' '.join(map(str, (*self.angles, *self.rates))).encode(), client)


class PositionAmplifiers(Amplifiers):
    def move(self, axis, command, dt):
        self.rates[axis] = (command - self.angles[axis]) * self.POSITION_LOOP


@pytest.mark.parametrize('file, amplifiers, delay', [('rate_drive.py', Amplifiers, 0.05),
                                                     ('position_drive.py', PositionAmplifiers, 0.12)])
def test_a_drive_of_ones_own(file, amplifiers, delay, start_process, connect, reserve_domain):
    """Both axes go where a preset says, and the control unit keeps its mode; without amplifiers there is a fault."""
    domain, motors = reserve_domain(), amplifiers((0.1, 0.4))
    start_process([sys.executable, FILE.with_name(file), motors.port], ROS_DOMAIN_ID=str(domain))
    client = connect(domain, file.partition('.')[0])
    for name in ('adu/state', 'joint_states'):
        client.read(name)
    client.until(lambda: [state.data for state in client.heard['adu/state']] == ['fault: amplifiers silent'])
    motors.start()
    start_process([*NODE, 'acu_node', '--ros-args', '--params-file',
                   FILE.with_name('drive.yaml'), '-p', f'command_delay:={delay}'], ROS_DOMAIN_ID=str(domain))
    for name in ('acu/mode', 'acu/alarms', 'acu/command_result'):
        client.read(name)
    client.write('acu/command')
    client.until(lambda: client.heard['adu/state'][-1].data == 'enabled' and client.heard['joint_states'])
    client.publish('acu/command', commands.message(commands.Command(
        'preset', 'client', '1', {'azimuth': 0.5, 'elevation': 0.8})))
    assert commands.of_reply(client.until(lambda: client.heard['acu/command_result'])[-1])[1].granted
    client.until(lambda: np.allclose(client.heard['joint_states'][-1].position, (0.5, 0.8), rtol=0.0, atol=5e-4),
                 told=lambda: str((client.heard['joint_states'][-1].position, client.heard['acu/alarms'][-1:])))
    assert client.heard['acu/mode'][-1].data == 'preset'
    raised = {status.name for array in client.heard['acu/alarms'] for status in array.status}
    assert not raised & {'drive frozen', 'uncommanded motion', 'azimuth runaway', 'elevation runaway'}
