"""Simulated rotator on a pseudo terminal, to rehearse before the device arrives: `pedestal simulate rotator`.

Both axes move to their set-point at a constant rate. An answer comes after the delay of a real controller. Habits say
what this device does otherwise than the usual one of its protocol.
"""
import dataclasses
import math
import os
import pty
import re
import select
import time
import tty
from collections.abc import Callable
from typing import NamedTuple

from pedestal_common.parameters import Parameters, choice, flag, parameter
from pedestal_common.quantities import Degrees, Seconds
from pedestal_common.stream import Splitter

MAX_REQUEST_BYTES = 512  # largest length of a request
FRAME_BYTES = 12  # length of a frame to a SPID controller, without its last byte
ANGLE = re.compile(rb'(AZ|EL)(-?[0-9]+(?:\.[0-9]*)?)')  # set-point of an axis in EasyComm
LINE_ENDS = {'crlf': b'\r\n', 'lf': b'\n', 'cr': b'\r', 'lfcr': b'\n\r'}


@dataclasses.dataclass(frozen=True)
class Habits(Parameters):
    """What a device does otherwise than the usual one of its protocol."""
    azimuth: float = parameter(0.0, -720.0, 720.0, 'deg', 'azimuth at the start')
    elevation: float = parameter(0.0, -90.0, 180.0, 'deg', 'elevation at the start')
    low: float = parameter(-720.0, -720.0, 720.0, 'deg', 'end of travel of the azimuth')
    high: float = parameter(720.0, -720.0, 720.0, 'deg', 'other end of travel of the azimuth')
    circle: str = choice('travel', ('travel', '0..360', '-180..180'), 'azimuths in answers and set-points')
    pulses: int = parameter(10, 0, 255, '', 'pulses per degree of a Rot2Prog')
    decimals: int = parameter(-1, -1, 3, '', 'decimals of an answer in text; -1: as usual')
    decimal_comma: bool = flag(False, 'decimal comma in answers')
    signs: bool = flag(False, 'GS-232A: +0aaa+0eee; EasyComm: numbers with a sign, one a line, without names (K3NG)')
    two_lines: bool = flag(False, 'EasyComm: each axis in a line of its own')
    line_end: str = choice('crlf', tuple(LINE_ENDS), 'end of an answer')
    echo: bool = flag(False, 'each request is echoed')
    prompt: bool = flag(False, 'an empty line before each answer, and the prompt ?> behind it (K3NG)')
    answers_sets: bool = flag(False, 'SPID: a set-point is answered (MD-01)')
    azimuth_only: bool = flag(False, 'no elevation')
    turned: bool = flag(False, 'the motors turn the wrong way')
    deaf: bool = flag(False, 'stops are ignored')


class Axes:
    """Azimuth and elevation [deg] of a rotator that moves at a rate [deg/s]."""

    def __init__(self, rate: float, now: Seconds, habits: Habits = Habits()) -> None:  # noqa: B008  frozen
        self.rate, self.now, self.habits = rate, now, habits
        self.angles = [habits.azimuth, habits.elevation]
        self.set_points = list(self.angles)

    def advance(self, now: Seconds) -> None:
        """Move until a time."""
        reach, self.now = self.rate * (now - self.now), now
        sense = -1.0 if self.habits.turned else 1.0
        self.angles = [angle + sense * min(max(goal - angle, -reach), reach)
                       for angle, goal in zip(self.angles, self.set_points)]
        self.angles[0] = min(max(self.angles[0], self.habits.low), self.habits.high)

    def go(self, azimuth: Degrees | None, elevation: Degrees | None) -> None:
        """Take a set-point; an axis without one keeps its own."""
        if azimuth is not None:
            self.set_points[0] = azimuth
            if self.habits.circle != 'travel':
                self.set_points[0] = _on_circle(azimuth, self.habits.low)
        if elevation is not None and not self.habits.azimuth_only:
            self.set_points[1] = elevation

    def stop(self) -> None:
        """Stop where the axes are."""
        if not self.habits.deaf:
            self.set_points = list(self.angles)

    @property
    def reported(self) -> tuple[Degrees, Degrees]:
        """Angles of an answer."""
        low = {'travel': -math.inf, '0..360': 0.0, '-180..180': -180.0}[self.habits.circle]
        azimuth, elevation = self.angles
        return azimuth if math.isinf(low) else _on_circle(azimuth, low), elevation

    def number(self, angle: Degrees, decimals: int, digits: int = 1) -> bytes:
        """Return the text of an angle with decimals and digits before them, as usual or by the habits."""
        own = self.habits.decimals
        decimals = decimals if own < 0 else own
        width = digits + (decimals + 1 if decimals else 0)
        text = f'{angle:0{width}.{decimals}f}'
        return text.replace('.', ',' if self.habits.decimal_comma else '.').encode()

    def line(self, text: bytes) -> bytes:
        """Return a line of an answer."""
        return text + LINE_ENDS[self.habits.line_end]


def _on_circle(azimuth: Degrees, low: Degrees) -> Degrees:
    return low + (azimuth - low) % 360.0


def gs232(axes: Axes, request: bytes) -> bytes:
    """Return the answer of a GS-232A or GS-232B to a line."""
    target = re.fullmatch(rb'W(\d{3}) (\d{3})|M(\d{3})', request.strip())
    habits, answer = axes.habits, b''
    if request.strip() in (b'C2', b'C'):
        parts = [(b'+' if habits.signs and angle >= 0.0 else b'') + axes.number(angle, 0, 4 if habits.signs else 3)
                 for angle in axes.reported]
        if habits.signs:
            parts = [part.replace(b'-', b'-0', 1) if len(part) < 5 else part for part in parts]
        else:
            parts = [b'AZ=' + parts[0], b'EL=' + parts[1]]
        alone = habits.azimuth_only or request.strip() == b'C'
        answer = axes.line(parts[0] if alone else (b'' if habits.signs else b'  ').join(parts))
    elif request.strip() == b'S':
        axes.stop()
    elif target:
        axes.go(float(target[1] or target[3]), None if target[3] else float(target[2]))
    else:
        answer = b'?>\r\n'
    if habits.prompt:
        answer = axes.line(b'') + answer + (b'?>' if answer else b'')
    return answer


def easycomm(axes: Axes, request: bytes) -> bytes:
    """Return the answer of an EasyComm device to a line."""
    words, habits = request.split(), axes.habits
    if b'SA' in words:
        axes.stop()
    for found in filter(None, map(ANGLE.fullmatch, words)):
        goal = float(found[2])
        axes.go(*((goal, None) if found[1] == b'AZ' else (None, goal)))
    asked = [i for i, name in enumerate((b'AZ', b'EL')) if name in words and not (i and habits.azimuth_only)]
    texts = [(b'+' if axes.reported[i] >= 0.0 else b'') + axes.number(axes.reported[i], 1) if habits.signs
             else (b'AZ', b'EL')[i] + axes.number(axes.reported[i], 1) for i in asked]
    if habits.signs or habits.two_lines:
        return b''.join(axes.line(text) for text in texts)
    return axes.line(b' '.join(texts)) if texts else b''


def rotctld(axes: Axes, request: bytes) -> bytes:
    """Return the answer of rotctld to a line."""
    word, *given = request.split() or [b'']
    if word == b'p':
        return b''.join(axes.line(axes.number(angle, 2)) for angle in axes.reported)
    if word == b'S':
        axes.stop()
    elif word == b'P' and len(given) == 2 and not (axes.habits.azimuth_only and float(given[1])):
        axes.go(float(given[0]), float(given[1]))
    else:
        return axes.line(b'RPRT -1')
    return axes.line(b'RPRT 0')


def rot1prog(axes: Axes, frame: bytes) -> bytes:
    """Return the answer of a Rot1Prog to a frame."""
    if len(frame) != FRAME_BYTES:
        return b''
    if frame[11] == 0x2F:
        axes.go(int(frame[1:4]) - 360.0, None)
        return b''
    if frame[11] == 0x0F:
        axes.stop()
    return b'W' + bytes(digit - 48 for digit in b'%03d' % round(360.0 + axes.reported[0])) + b' '


def rot2prog(axes: Axes, frame: bytes) -> bytes:
    """Return the answer of a Rot2Prog to a frame, of whose bytes only the last one is a space. It ignores the pulses
    of a set-point."""
    pulses = axes.habits.pulses
    if len(frame) != FRAME_BYTES:
        return b''
    if frame[11] == 0x2F:
        axes.go(*(int(digits) / max(pulses, 1) - 360.0 for digits in (frame[1:5], frame[6:10])))
        if not axes.habits.answers_sets:
            return b''
    if frame[11] == 0x0F:
        axes.stop()
    digits = [b'%04d' % round(10.0 * (360.0 + angle)) for angle in axes.reported]
    azimuth, elevation = (bytes(digit - 48 for digit in number) for number in digits)
    return b'W' + azimuth + bytes([pulses]) + elevation + bytes([pulses]) + b' '


class Device(NamedTuple):
    """Simulated device of a protocol."""
    end: bytes                                  # last byte of a request
    answer: Callable[[Axes, bytes], bytes]      # to a request without this byte

    def reply(self, axes: Axes, request: bytes) -> bytes:
        """Return the answer to a request without its last byte, behind the echo of this request."""
        return (request + self.end if axes.habits.echo else b'') + self.answer(axes, request)


def gs232_azimuth(axes: Axes, request: bytes) -> bytes:
    """Return the answer of a GS-232 that knows the requests of the azimuth alone."""
    return b'?>\r\n' if request.strip()[:1] == b'W' or request.strip() == b'C2' else gs232(axes, request)


DEVICES = {'gs232': Device(b'\r', gs232), 'gs232_azimuth': Device(b'\r', gs232_azimuth),
           'easycomm': Device(b'\n', easycomm), 'rotctld': Device(b'\n', rotctld), 'rot1prog': Device(b' ', rot1prog),
           'rot2prog': Device(b' ', rot2prog)}
"""{protocol: its device}. For rotctld Hamlib's `rotctld -m 1` is another one."""


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
        answer = b''.join(device.reply(axes, request) for request in splitter.take(received))
        if answer:
            time.sleep(delay)
            os.write(descriptor, answer)


def serve(protocol: str, rate: float, delay: Seconds, habits: Habits) -> None:
    """Open a pseudo terminal, print its path, and answer as a rotator until Ctrl-C. rate: largest rate of both axes
    [deg/s]."""
    end, device = pty.openpty()
    tty.setraw(device)
    print(os.ttyname(device), flush=True)
    run(DEVICES[protocol], Axes(rate, time.monotonic(), habits), end, delay)
