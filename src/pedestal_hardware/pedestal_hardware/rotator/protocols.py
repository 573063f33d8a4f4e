"""Protocols of rotators: the bytes of a request, and the answers in the bytes of the device. Angles are in degrees.

Sources: Hamlib 4.6 (rotators/gs232a, gs232b, easycomm, spid, and tests/rotctl_parse.c), the EasyComm standard, and the
manual of the SPID Rot2Prog. A protocol keeps an unfinished answer, so each connection needs its own object.
"""
import re
from collections.abc import Iterator
from typing import ClassVar, NamedTuple, TypeAlias

from pedestal_common.quantities import Degrees
from pedestal_common.stream import Overlong, Splitter

MAX_ANSWER_BYTES = 512  # largest length of a line; a longer one is refused
MAX_ANGLE_DEG = 1000.0  # largest angle that a device may report [deg]


class Position(NamedTuple):
    """Answer of a device."""
    azimuth: Degrees
    elevation: Degrees


class Refusal(NamedTuple):
    """Answer of a device that refuses a request, or bytes that are no answer."""
    reason: str     # one line


class Accepted(NamedTuple):
    """Answer of a device that accepts a set-point or a stop."""


Answer: TypeAlias = Position | Refusal | Accepted


class RotatorProtocol:
    """Base of the protocols."""
    ASK: ClassVar[bytes] = b''              # request of the position
    STOP: ClassVar[bytes] = b''             # request to stop both axes
    ANSWERS_SETS: ClassVar[bool] = False    # True if the device answers a set-point
    BAUD_RATE: ClassVar[int] = 9600         # usual speed of the serial line
    RESOLUTION: ClassVar[Degrees] = 0.01    # smallest step of a set-point

    def set_point(self, azimuth: Degrees, elevation: Degrees) -> bytes:
        """Return the request to move to these angles."""
        raise NotImplementedError

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        raise NotImplementedError


class LineProtocol(RotatorProtocol):
    """Base of the protocols of text lines."""

    def __init__(self) -> None:
        self._splitter = Splitter(b'\r\n', MAX_ANSWER_BYTES)

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        found: list[Answer] = []
        for line in self._splitter.take(received):
            if isinstance(line, Overlong):
                found.append(Refusal(f'{len(line)} bytes without an answer: {line[:20]!r} ...'))
            elif line.strip():
                found += self.answers_of(line.strip())
        return found

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the answers in one line."""
        raise NotImplementedError


def checked(azimuth: bytes, elevation: bytes) -> Position | Refusal:
    """Return the Position of the texts of two numbers, or the Refusal of other texts and impossible angles."""
    try:
        position = Position(float(azimuth), float(elevation))
    except ValueError:
        return Refusal(f'position {azimuth[:20]!r}, {elevation[:20]!r}: must be two numbers')
    return in_range(position)


def in_range(position: Position) -> Position | Refusal:
    """Return a position, or the Refusal of angles that no device has."""
    if not all(abs(angle) <= MAX_ANGLE_DEG for angle in position):
        return Refusal(f'position {position.azimuth:g}, {position.elevation:g} deg: must be within '
                       f'+-{MAX_ANGLE_DEG:g} deg')
    return position


class Rotctld(LineProtocol):
    """Client of Hamlib's rotctld, by which every rotator that Hamlib supports is reached."""
    ASK, STOP, ANSWERS_SETS, RESOLUTION = b'p\n', b'S\n', True, 0.01

    def __init__(self) -> None:
        super().__init__()
        self._azimuth: bytes | None = None     # first line of a position

    def set_point(self, azimuth: Degrees, elevation: Degrees) -> bytes:
        """Return the request to move to these angles."""
        return b'P %.2f %.2f\n' % (azimuth, elevation)

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the answer that a line completes: a position has two lines."""
        if line.startswith(b'RPRT'):
            self._azimuth = None
            code = line[4:].strip()
            yield Accepted() if code == b'0' else Refusal(f'rotctld error {code.decode(errors="replace")}')
        elif isinstance(checked(line, line), Refusal):
            self._azimuth = None
            yield checked(line, line)
        elif self._azimuth is None:
            self._azimuth = line
        else:
            azimuth, self._azimuth = self._azimuth, None
            yield checked(azimuth, line)


class Gs232(LineProtocol):
    """Yaesu GS-232A and GS-232B, whole degrees."""
    ASK, STOP, RESOLUTION = b'C2\r', b'S\r', 1.0
    _POSITION = re.compile(rb'AZ=(\d{3})\s+EL=(\d{3})|\+0(\d{3})\s*\+0(\d{3})')

    def set_point(self, azimuth: Degrees, elevation: Degrees) -> bytes:
        """Return the request to move to these angles."""
        return b'W%03d %03d\r' % (round(azimuth), round(elevation))

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the answer of a line."""
        match = self._POSITION.fullmatch(line)
        if match:
            yield checked(*filter(None, match.groups()))
        else:
            yield Refusal(f'answer {line.decode(errors="replace")!r}: must be AZ=aaa EL=eee, or +0aaa+0eee')


class Easycomm(LineProtocol):
    """EasyComm II and III. The device answers the two angles in one line or in two."""
    ASK, STOP, RESOLUTION = b'AZ EL \n', b'SA SE \n', 0.1
    _WORD = re.compile(rb'(AZ|EL)([-+]?[\d.]+)')

    def __init__(self) -> None:
        super().__init__()
        self._angles: dict[bytes, bytes] = {}

    def set_point(self, azimuth: Degrees, elevation: Degrees) -> bytes:
        """Return the request to move to these angles."""
        return b'AZ%.1f EL%.1f\n' % (azimuth, elevation)

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the position once both angles have arrived; other words, such as alarms, are refused."""
        for word in line.split():
            match = self._WORD.fullmatch(word)
            if not match:
                yield Refusal(f'answer {word.decode(errors="replace")!r}: must be AZaaa.a or ELeee.e')
                continue
            self._angles[match[1]] = match[2]
            if len(self._angles) == 2:
                yield checked(self._angles.pop(b'AZ'), self._angles.pop(b'EL'))


class Rot2prog(RotatorProtocol):
    """SPID Rot2Prog, frames of 13 bytes to the device and 12 bytes from it. An angle is sent as pulses, PH (360 +
    angle), PH pulses for each degree, and received as digits of 0.1 deg. MD-01 also answers a set-point, with the same
    frame, and may send text between the frames."""
    ASK, STOP = (b'W' + 10 * b'\0' + bytes([command]) + b' ' for command in (0x1F, 0x0F))
    BAUD_RATE, RESOLUTION = 600, 0.1
    PULSES_PER_DEG = 10
    FRAME_BYTES = 12

    def __init__(self) -> None:
        self._begun = b''   # of a frame

    def set_point(self, azimuth: Degrees, elevation: Degrees) -> bytes:
        """Return the request to move to these angles."""
        pulses = self.PULSES_PER_DEG
        return b'W%04d%c%04d%c\x2f ' % (round(pulses * (360.0 + azimuth)), pulses,
                                        round(pulses * (360.0 + elevation)), pulses)

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        found: list[Answer] = []
        data = self._begun + received
        while True:
            begin = data.find(b'W')
            data = data[begin:] if begin >= 0 else b''
            if len(data) < self.FRAME_BYTES:
                self._begun = data
                return found
            frame = data[:self.FRAME_BYTES]
            digits = frame[1:5] + frame[6:10]
            if frame[-1:] != b' ' or max(digits) > 9:     # the W of a text, or a damaged frame
                data = data[1:]
                found.append(Refusal(f'frame {frame.hex(" ")}: must be W, eight digits with their pulses, and a '
                                     'space'))
                continue
            data = data[self.FRAME_BYTES:]
            found.append(in_range(Position(*(100 * d[0] + 10 * d[1] + d[2] + 0.1 * d[3] - 360
                                             for d in (digits[:4], digits[4:])))))


PROTOCOLS: dict[str, type[RotatorProtocol]] = {
    'rotctld': Rotctld,
    'gs232': Gs232,
    'easycomm': Easycomm,
    'rot2prog': Rot2prog,
}
