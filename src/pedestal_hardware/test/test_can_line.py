"""Frames over socketcand and by python-can: parts of frames, foreign texts, and a server that ends."""
import socket
import threading
import time

import can
import numpy as np
import pytest

from pedestal_common import parameters
from pedestal_hardware import canopen_bus, pdo
from pedestal_hardware.bus import BusError
from pedestal_hardware.can_line import PythonCanLine, SocketcandLine
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.unit import DRIVE_LABELS

FRAMES = [(0x181, bytes(range(8))), (0x80, b''), (0x77F, b'\x05')]


class Server:
    """Server that lets a client begin like socketcand, then is scripted by the test."""

    def __init__(self, answers=('hi', 'ok', 'ok')):
        self.listener, self.answers = socket.create_server(('127.0.0.1', 0)), answers
        self.begin = threading.Thread(target=self._begin)
        self.begin.start()

    def _begin(self):
        self.client, _ = self.listener.accept()
        self.client.settimeout(5.0)
        for k, answer in enumerate(self.answers):
            if k:
                self.client.recv(100)
            self.client.sendall(f'< {answer} >'.encode())

    def line(self):
        made = SocketcandLine('127.0.0.1', self.listener.getsockname()[1], 'can0', 5.0)
        self.begin.join()
        return made


def test_frames_of_a_period_are_one_write():
    server = Server()
    line = server.line()
    line.send(FRAMES)
    expected = b'< send 181 8 00 01 02 03 04 05 06 07 >< send 80 0  >< send 77F 1 05 >'
    assert server.client.recv(1000) == expected
    line.close()


def test_frames_that_are_cut_are_joined():
    server = Server()
    line = server.line()
    text = b'< frame 181 1.5 0001020304050607 >< frame 080 1.5 >< frame 77F 1.5 05 >'
    received = []
    for first in range(0, len(text), 7):
        server.client.sendall(text[first:first + 7])
        received += line.receive(0.2)
    assert received == FRAMES
    assert line.receive(0.0) == []
    line.close()


def test_other_texts_and_extended_frames_are_ignored():
    server = Server()
    line = server.line()
    server.client.sendall(b'< error unknown >< ok >< frame 12345678 1.5 00 >< >< frame 182 1.5 xy >'
                          b'< frame 181 1.5 11 22 >')
    assert line.receive(1.0) == [(0x181, b'\x11\x22')]
    line.close()


@pytest.mark.parametrize('text', [b'', b'x' * 5000])
def test_a_server_that_ends_or_sends_no_frames_is_an_error(text):
    server = Server()
    line = server.line()
    server.client.sendall(text)
    if not text:
        server.client.close()
    with pytest.raises(ConnectionError, match='closed the connection|5000 bytes without'):
        line.receive(1.0)
    line.close()


def test_a_server_that_refuses_the_bus_is_named():
    server = Server(('hi', 'error could not open bus'))
    with pytest.raises(ConnectionError, match='the server answers < error could not open bus >'):
        server.line()
    server.begin.join()


def test_the_same_frames_by_python_can():
    line = PythonCanLine(interface='virtual', channel='test_can_line')
    other = can.Bus(interface='virtual', channel='test_can_line')
    line.send(FRAMES)
    sent = [other.recv(1.0) for _ in FRAMES]
    assert [(message.arbitration_id, bytes(message.data)) for message in sent] == FRAMES
    other.send(can.Message(arbitration_id=0x18123, is_extended_id=True, data=b'1'))
    other.send(can.Message(arbitration_id=0x81, is_extended_id=False, is_error_frame=True, data=bytes(8)))
    for cob, data in FRAMES:
        other.send(can.Message(arbitration_id=cob, is_extended_id=False, data=data))
    received = []
    while len(received) < len(FRAMES):
        received += line.receive(1.0)
    assert received == FRAMES
    line.close()
    other.shutdown()


SHORT_FRAMES = {'frame 0x081 of 0 bytes': '< frame 081 0.0 >', 'frame 0x081 of 2 bytes': '< frame 081 0.0 1020 >',
                'frame 0x701 of 0 bytes': '< frame 701 0.0 >'}


def test_short_frames_end_neither_the_thread_nor_an_exchange():
    """An emergency (081) and a heartbeat (701) that are cut, received by the thread and by the exchange."""
    server = Server()
    p = parameters.build(ServoDriveParameters, {'bus.port': server.listener.getsockname()[1], 'bus.sdo_time': 0.05})
    bus = canopen_bus.CanopenBus(p.bus, p.drives.nodes, DRIVE_LABELS, p.period)
    with pytest.raises(BusError, match='object 1000:0: no answer'):     # no drive answers, but the thread receives
        bus.start(0)
    server.client.sendall(''.join(SHORT_FRAMES.values()).encode())
    end = time.monotonic() + 5.0
    while len(bus.notes) < len(SHORT_FRAMES) and time.monotonic() < end:
        time.sleep(0.01)
    assert [note.partition(' is refused')[0] for note in bus.notes] == list(SHORT_FRAMES)
    bus.notes.clear()
    server.client.sendall(b'< frame 701 0.0 >< frame 082 0.0 01 >')     # the first of them was noted before
    reports = np.zeros(pdo.DRIVE_COUNT, pdo.REPORT_DTYPE)
    while not bus.notes and time.monotonic() < end:
        bus.exchange(np.zeros(pdo.DRIVE_COUNT, pdo.COMMAND_DTYPE), reports)
    assert [note.partition(' is refused')[0] for note in bus.notes] == ['frame 0x082 of 1 bytes']
    # Whole emergencies are not kept. The cut frame behind them shows that the bus has taken them.
    server.client.sendall(b'< frame 081 0.0 1020010000000000 >' * 50 + b'< frame 083 0.0 01 >')
    while len(bus.notes) < 2 and time.monotonic() < end:
        bus.exchange(np.zeros(pdo.DRIVE_COUNT, pdo.COMMAND_DTYPE), reports)
    assert len(bus.notes) == 2 and [drive.emcy.log for drive in bus._drives] == [[]] * pdo.DRIVE_COUNT
    bus.stop()
