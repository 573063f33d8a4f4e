"""Simulated INS of a ship that sends NMEA sentences in real time, by UDP or on a pseudo terminal, to rehearse with.

The ship is that of `ship_motion_sim`, at the same times and with the same seed. A graph whose parameter graph.start
is the start of this program therefore has the same ship.
"""
import math
import os
import pty
import socket
import time
import tty
from typing import Protocol

from pedestal_common.quantities import AnyRecord, Hertz, Nanoseconds, RadiansPerSecond
from ship_motion_sim import motion, nmea
from ship_motion_sim.params import ShipParameters


class Sink(Protocol):
    """Connection to a receiver."""
    name: str       # url or path that the receiver opens

    def send(self, data: bytes) -> None:
        """Send bytes."""


class UdpSink:
    """Datagrams to a UDP port of a host."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f'udp://{host}:{port}'
        self._socket, self._to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), (host, port)

    def send(self, data: bytes) -> None:
        """Send bytes as a datagram. A port without a receiver loses it."""
        self._socket.sendto(data, self._to)


class SerialSink:
    """Pseudo terminal; `name` is the path that a receiver opens."""

    def __init__(self) -> None:
        self._end, self._device = pty.openpty()
        tty.setraw(self._device)
        os.set_blocking(self._end, False)
        self.name = os.ttyname(self._device)

    def send(self, data: bytes) -> None:
        """Send bytes; a line that no receiver reads is lost."""
        try:
            os.write(self._end, data)
        except BlockingIOError:
            return


def yaw_rate(truth: AnyRecord) -> RadiansPerSecond:
    """Return the rate of the yaw angle of a motion.Truth."""
    _, w_y, w_z = truth['angular_velocity']
    return float((w_y * math.sin(truth['roll']) + w_z * math.cos(truth['roll'])) / math.cos(truth['pitch']))


def sentences(kind: str, truth: AnyRecord, stamp: Nanoseconds) -> bytes:
    """Return the bytes of one sample: a sentence behind HDT and ROT. kind: one of
    pedestal_hardware.ins.sentences.KINDS; truth: a motion.Truth; stamp: UTC."""
    roll, pitch, yaw = float(truth['roll']), float(truth['pitch']), float(truth['yaw'])
    turn = nmea.turn(yaw_rate(truth))
    heading_and_attitude = nmea.attitude(stamp, roll, pitch, yaw, float(truth['position'][2]))
    if kind == 'pashr':
        return turn + heading_and_attitude
    heading = heading_and_attitude.splitlines(keepends=True)[0]
    return turn + heading + (nmea.angles(roll, pitch, yaw) if kind == 'prdid' else b'')


def run(ship: ShipParameters, sink: Sink, kind: str, rate: Hertz, start: Nanoseconds) -> None:
    """Send samples until the process is interrupted. start: UTC at which the time of the ship is 0."""
    [constants], [truth] = motion.constants(ship), motion.Truth.zeros()
    motion.truth(constants, 0.0, truth)      # compiles the law before the first sample is due
    period = round(1e9 / rate)
    due = time.time_ns() // period * period
    while True:
        due = max(due + period, time.time_ns() // period * period)
        time.sleep(max(due - time.time_ns(), 0) * 1e-9)
        motion.truth(constants, (due - start) * 1e-9, truth)
        sink.send(sentences(kind, truth, due))
