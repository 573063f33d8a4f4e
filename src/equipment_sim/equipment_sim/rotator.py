"""Simulated rotator on a pseudo terminal, to rehearse before the device arrives: `pedestal simulate rotator`.

Both axes move to their set-point at a constant rate. An answer comes after the delay of a real controller.
"""
import os
import pty
import re
import select
import time
import tty
from collections.abc import Callable
from typing import NamedTuple

from pedestal_common.quantities import Seconds
from pedestal_common.stream import Splitter
from pedestal_hardware.rotator.protocols import Rot2prog

PULSES_PER_DEG = Rot2prog.PULSES_PER_DEG
MAX_REQUEST_BYTES = 512  # largest length of a request
FRAME_BYTES = 12  # length of a frame to a Rot2Prog, without its last byte
ANGLE = re.compile(rb'(AZ|EL)(-?[0-9]+(?:\.[0-9]*)?)')  # set-point of an axis in EasyComm


class Axes:
    """Azimuth and elevation [deg] of a rotator that moves at a rate [deg/s]."""

    def __init__(self, rate: float, now: Seconds) -> None:
        self.rate, self.now = rate, now
        self.angles, self.set_points = [0.0, 0.0], [0.0, 0.0]

    def advance(self, now: Seconds) -> None:
        """Move until a time."""
        reach, self.now = self.rate * (now - self.now), now
        self.angles = [angle + min(max(goal - angle, -reach), reach)
                       for angle, goal in zip(self.angles, self.set_points)]

    def stop(self) -> None:
        """Stop where the axes are."""
        self.set_points = list(self.angles)


def gs232(axes: Axes, request: bytes) -> bytes:
    """Return the answer of a GS-232B to a line."""
    target = re.fullmatch(rb'W(\d{3}) (\d{3})', request.strip())
    if request.strip() == b'C2':
        return b'AZ=%03d  EL=%03d\r\n' % tuple(round(angle) for angle in axes.angles)
    if request.strip() == b'S':
        axes.stop()
    elif target:
        axes.set_points = [float(target[1]), float(target[2])]
    else:
        return b'?>\r\n'
    return b''


def easycomm(axes: Axes, request: bytes) -> bytes:
    """Return the answer of an EasyComm device to a line."""
    words = request.split()
    if words == [b'AZ', b'EL']:
        return b'AZ%.1f EL%.1f\n' % tuple(axes.angles)
    if words == [b'SA', b'SE']:
        axes.stop()
    for found in filter(None, map(ANGLE.fullmatch, words)):
        axes.set_points[found[1] == b'EL'] = float(found[2])
    return b''


def rot2prog(axes: Axes, frame: bytes) -> bytes:
    """Return the answer of a Rot2Prog to a frame, of whose bytes only the last one is a space."""
    if len(frame) != FRAME_BYTES:
        return b''
    if frame[11] == 0x2F:
        axes.set_points = [int(digits) / PULSES_PER_DEG - 360.0 for digits in (frame[1:5], frame[6:10])]
        return b''
    if frame[11] == 0x0F:
        axes.stop()
    digits = [b'%04d' % round(10.0 * (360.0 + angle)) for angle in axes.angles]
    azimuth, elevation = (bytes(digit - 48 for digit in number) for number in digits)
    return b'W' + azimuth + bytes([PULSES_PER_DEG]) + elevation + bytes([PULSES_PER_DEG]) + b' '


class Device(NamedTuple):
    """Simulated device of a protocol."""
    end: bytes                                  # last byte of a request
    answer: Callable[[Axes, bytes], bytes]      # to a request without this byte


DEVICES = {'gs232': Device(b'\r', gs232), 'easycomm': Device(b'\n', easycomm), 'rot2prog': Device(b' ', rot2prog)}
"""{protocol: its device}. Hamlib's `rotctld -m 1` is the device of rotctld."""


def run(device: Device, axes: Axes, descriptor: int, delay: Seconds) -> None:
    """Answer the requests on a descriptor until it closes; delay: time until an answer."""
    splitter = Splitter(device.end, MAX_REQUEST_BYTES)
    while True:
        select.select([descriptor], [], [], 0.1)
        axes.advance(time.monotonic())
        try:
            received = os.read(descriptor, 4096) if select.select([descriptor], [], [], 0.0)[0] else b''
        except OSError:
            time.sleep(0.1)      # no program has the terminal open
            continue
        answer = b''.join(device.answer(axes, request) for request in splitter.take(received))
        if answer:
            time.sleep(delay)
            os.write(descriptor, answer)


def serve(protocol: str, rate: float, delay: Seconds) -> None:
    """Open a pseudo terminal, print its path, and answer as a rotator until Ctrl-C. rate: of both axes [deg/s]."""
    end, device = pty.openpty()
    tty.setraw(device)
    print(os.ttyname(device), flush=True)
    run(DEVICES[protocol], Axes(rate, time.monotonic()), end, delay)
