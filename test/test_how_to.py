"""The runnable file of docs/how-to: what a datagram says is published with the stamp of the drive."""
import math
import pathlib
import socket
import sys

import pytest

from pedestal_common.wire import messages

FILE = pathlib.Path(__file__).parents[1] / 'docs' / 'how-to' / 'receiver.py'


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
        return client.until(lambda: next((error for error in heard if messages.nanoseconds(error.header.stamp) ==
                                          k * 5_000_000), None)).vector

    assert math.isnan(step(1).x)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hardware:
        hardware.sendto(b'0.001 -0.002 46.5', ('127.0.0.1', port))
    measured = next(vector for vector in map(step, range(2, 200)) if not math.isnan(vector.x))
    assert (measured.x, measured.y, measured.z) == pytest.approx((0.001, -0.002, 46.5))
    assert math.isnan(step(200).x)
