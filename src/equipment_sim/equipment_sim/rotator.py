"""Simulated rotator on a pseudo terminal, to rehearse before the device arrives.

    pedestal simulate rotator --protocol gs232 --rate 6

It prints the path of its terminal. Both axes move to their set-point at a constant rate. The answer to a request
comes after the delay of a real controller.
"""
import os
import pty
import re
import select
import time
import tty
from collections.abc import Callable
from typing import TypeAlias

from pedestal_common.quantities import Seconds
from pedestal_hardware.rotator.protocols import Rot2prog

PULSES_PER_DEG = Rot2prog.PULSES_PER_DEG

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


def gs232(axes: Axes, buffer: bytes) -> tuple[bytes, bytes]:
    """Return (answer, rest of the buffer) to the requests of a GS-232B."""
    *requests, rest = buffer.split(b'\r')
    answer = b''
    for request in requests:
        target = re.fullmatch(rb'W(\d{3}) (\d{3})', request.strip())
        if request.strip() == b'C2':
            answer += b'AZ=%03d  EL=%03d\r\n' % tuple(round(angle) for angle in axes.angles)
        elif request.strip() == b'S':
            axes.stop()
        elif target:
            axes.set_points = [float(target[1]), float(target[2])]
        else:
            answer += b'?>\r\n'
    return answer, rest


def easycomm(axes: Axes, buffer: bytes) -> tuple[bytes, bytes]:
    """Return (answer, rest of the buffer) to the requests of an EasyComm device."""
    *requests, rest = buffer.split(b'\n')
    answer = b''
    for request in requests:
        words = request.split()
        if words == [b'AZ', b'EL']:
            answer += b'AZ%.1f EL%.1f\n' % tuple(axes.angles)
        elif words == [b'SA', b'SE']:
            axes.stop()
        else:
            for found in filter(None, map(ANGLE.fullmatch, words)):
                axes.set_points[found[1] == b'EL'] = float(found[2])
    return answer, rest


def rot2prog(axes: Axes, buffer: bytes) -> tuple[bytes, bytes]:
    """Return (answer, rest of the buffer) to the frames of a Rot2Prog."""
    answer = b''
    while len(buffer) >= 13:
        frame, buffer = buffer[:13], buffer[13:]
        if frame[11] == 0x2F:
            axes.set_points = [int(digits) / PULSES_PER_DEG - 360.0 for digits in (frame[1:5], frame[6:10])]
        elif frame[11] == 0x0F:
            axes.stop()
        if frame[11] != 0x2F:
            digits = [b'%04d' % round(10.0 * (360.0 + angle)) for angle in axes.angles]
            azimuth, elevation = (bytes(digit - 48 for digit in number) for number in digits)
            answer += b'W' + azimuth + bytes([PULSES_PER_DEG]) + elevation + bytes([PULSES_PER_DEG]) + b' '
    return answer, buffer


Device: TypeAlias = Callable[[Axes, bytes], tuple[bytes, bytes]]

DEVICES: dict[str, Device] = {'gs232': gs232, 'easycomm': easycomm, 'rot2prog': rot2prog}
"""Answers of the simulated devices, by the name of the protocol. Hamlib's `rotctld -m 1` is the device of rotctld."""


def run(device: Device, axes: Axes, descriptor: int, delay: Seconds) -> None:
    """Answer the requests on a descriptor until it closes; delay: time until an answer."""
    buffer = b''
    while True:
        select.select([descriptor], [], [], 0.1)
        axes.advance(time.monotonic())
        try:
            received = os.read(descriptor, 4096) if select.select([descriptor], [], [], 0.0)[0] else b''
        except OSError:
            time.sleep(0.1)      # no program has the terminal open
            continue
        answer, buffer = device(axes, buffer + received)
        if answer:
            time.sleep(delay)
            os.write(descriptor, answer)


def serve(protocol: str, rate: float, delay: Seconds) -> None:
    """Open a pseudo terminal, print its path, and answer as a rotator until Ctrl-C.

    protocol: one of DEVICES; rate: of both axes [deg/s]; delay: time until an answer.
    """
    end, device = pty.openpty()
    tty.setraw(device)
    print(os.ttyname(device), flush=True)
    run(DEVICES[protocol], Axes(rate, time.monotonic()), end, delay)
