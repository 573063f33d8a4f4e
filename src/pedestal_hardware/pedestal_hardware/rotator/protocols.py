"""Protocols of rotators: the bytes of a request, and the answers in the bytes of the device. Angles are in degrees.

Sources: Hamlib 4.6 (rotators/gs232a, gs232b, easycomm, spid, and tests/rotctl_parse.c), the EasyComm standard, the
manual of the SPID Rot2Prog, and the firmware of the K3NG controller. A protocol keeps an unfinished answer, so each
connection needs its own object.
"""
import re
from collections.abc import Iterator
from typing import ClassVar, NamedTuple, TypeAlias

from pedestal_common.quantities import Degrees
from pedestal_common.stream import Overlong, Splitter

MAX_ANSWER_BYTES = 512  # largest length of a line; a longer one is refused
MAX_ANGLE_DEG = 1000.0  # largest angle that a device may report [deg]
NO_ELEVATION = ('the answer has no elevation; the parameter fixed_elevation is for a rotator of the azimuth alone')

Pulses: TypeAlias = tuple[int, int]     # per degree of azimuth and elevation


class Position(NamedTuple):
    """Answer of a device."""
    azimuth: Degrees
    elevation: Degrees              # 0 of a rotator of the azimuth alone
    pulses: Pulses | None = None    # of its set-points; None if the protocol has none


class Refusal(NamedTuple):
    """Answer of a device that refuses a request, or bytes that are no answer."""
    reason: str             # one line
    prompt: bool = False    # True for a prompt, which is a refusal only of a device that sends no prompts


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
    RANGE: ClassVar[tuple[Degrees, Degrees]] = (-720.0, 720.0)   # of the set-points that its digits can hold
    READS_PULSES: ClassVar[bool] = False    # True if the device reports the pulses of its set-points
    AZIMUTH_ONLY: ClassVar[bool] = False    # True for a protocol without elevation

    def __init__(self, azimuth_only: bool = False) -> None:
        self.azimuth_only = azimuth_only
        self.ask, self.stop = self.ASK, self.STOP

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to these angles. pulses: as the device reported them."""
        raise NotImplementedError

    def sent(self, request: bytes) -> None:
        """Note that a request has been sent."""

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        raise NotImplementedError


class LineProtocol(RotatorProtocol):
    """Base of the protocols of text lines. Some devices echo each request before they answer it."""

    def __init__(self, azimuth_only: bool = False) -> None:
        super().__init__(azimuth_only)
        self._splitter = Splitter(b'\r\n', MAX_ANSWER_BYTES)
        self._echoes, self._unechoed = False, b''   # after an echo; the set-point whose echo has not arrived

    def sent(self, request: bytes) -> None:
        """Note a set-point, because in EasyComm its echo looks like a position."""
        if request not in (self.ask, self.stop):
            self._unechoed = b' '.join(request.split())

    def _is_echo(self, line: bytes) -> bool:
        line = b' '.join(line.split())
        asked, set_point = line == b' '.join(self.ask.split()), self._echoes and line == self._unechoed
        self._echoes |= asked
        if set_point:
            self._unechoed = b''
        return asked or set_point or line == b' '.join(self.stop.split())

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        found: list[Answer] = []
        for line in self._splitter.take(received):
            if isinstance(line, Overlong):
                found.append(Refusal(f'{len(line)} bytes without an answer: {line[:20]!r} ...'))
            elif line.strip() and not self._is_echo(line):
                found += self.answers_of(line.strip())
        return found

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the answers in one line."""
        raise NotImplementedError


def checked(azimuth: bytes, elevation: bytes) -> Position | Refusal:
    """Return the Position of the texts of two numbers, or the Refusal of other texts and impossible angles. The
    numbers have a decimal point or a decimal comma."""
    try:
        position = Position(float(azimuth.replace(b',', b'.')), float(elevation.replace(b',', b'.')))
    except ValueError:
        return Refusal(f'position {azimuth[:20]!r}, {elevation[:20]!r}: must be two numbers')
    return in_range(position)


def in_range(position: Position) -> Position | Refusal:
    """Return a position, or the Refusal of angles that no device has."""
    if not all(abs(angle) <= MAX_ANGLE_DEG for angle in position[:2]):
        return Refusal(f'position {position.azimuth:g}, {position.elevation:g} deg: must be within '
                       f'+-{MAX_ANGLE_DEG:g} deg')
    return position


class Rotctld(LineProtocol):
    """Client of Hamlib's rotctld, by which every rotator that Hamlib supports is reached. Hamlib accepts the elevation
    0 alone for a rotator of the azimuth alone."""
    ASK, STOP, ANSWERS_SETS, RESOLUTION = b'p\n', b'S\n', True, 0.01

    def __init__(self, azimuth_only: bool = False) -> None:
        super().__init__(azimuth_only)
        self._azimuth: bytes | None = None     # first line of a position

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to these angles."""
        return b'P %.2f %.2f\n' % (azimuth, 0.0 if self.azimuth_only else elevation)

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
    """Yaesu GS-232A and GS-232B, whole degrees. A set-point cannot be negative, a position can. `?>` is the answer to
    a request that the device does not understand, and the prompt of some controllers (K3NG) behind each answer. The
    elevation may have a line of its own."""
    ASK, STOP, RESOLUTION, RANGE = b'C2\r', b'S\r', 1.0, (0.0, 720.0)
    _ANGLE = rb'([-+]?\d{2,4}(?:[.,]\d+)?)'     # below three digits only behind a sign: a line loses bytes
    _POSITION = re.compile(rb'AZ=(?=[-+]|\d{3})' + _ANGLE + rb'(?:\s*,?\s*EL=(?=[-+]|\d{3})' + _ANGLE + rb')?|'
                           rb'([-+]0\d{3}(?:[.,]\d+)?)\s*([-+]0\d{3}(?:[.,]\d+)?)?')
    _ELEVATION = re.compile(rb'(?:EL=)?(?=[-+]|(?<==)\d{3})' + _ANGLE)
    _PROMPT = re.compile(rb'\s*\??>')

    def __init__(self, azimuth_only: bool = False) -> None:
        super().__init__(azimuth_only)
        self._azimuth: bytes | None = None  # of a line without elevation, until the next request
        self._half = False      # True if an earlier request was answered without elevation

    def sent(self, request: bytes) -> None:
        """Forget half an answer to an earlier request."""
        super().sent(request)
        self._half |= self._azimuth is not None
        self._azimuth = None

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to these angles."""
        return b'W%03d %03d\r' % (round(azimuth), 0 if self.azimuth_only else round(elevation))

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes. A prompt is complete without a line end."""
        found = super().answers(received)
        if self._PROMPT.fullmatch(self._splitter.rest):
            found.append(self._prompt(self._splitter.rest))
            self._splitter.restart()
        return found

    @staticmethod
    def _prompt(text: bytes) -> Refusal:
        return Refusal(f'answer {text.decode(errors="replace")!r}', True)

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the answer of a line, behind the prompt with which it may begin."""
        prompt = self._PROMPT.match(line)
        if prompt:
            yield self._prompt(prompt[0])
            line = line[prompt.end():].strip()
        match, second = (pattern.fullmatch(line.upper()) for pattern in (self._POSITION, self._ELEVATION))
        if second and self._azimuth is not None:
            azimuth, self._azimuth, self._half = self._azimuth, None, False
            if not self.azimuth_only:
                yield checked(azimuth, second[1])
        elif match:
            azimuth, elevation = match[1] or match[3], match[2] or match[4]
            if elevation is None:
                self._azimuth = azimuth
            if self.azimuth_only or elevation is not None:
                yield checked(azimuth, b'0' if self.azimuth_only else elevation)
            elif self._half:
                yield Refusal(NO_ELEVATION)
        elif line and not self._is_echo(line):
            yield Refusal(f'answer {line.decode(errors="replace")!r}: must be AZ=aaa EL=eee, or +0aaa+0eee')


class Gs232Azimuth(Gs232):
    """Controller that knows the requests of the azimuth alone, such as a K3NG without elevation."""
    ASK, AZIMUTH_ONLY = b'C\r', True

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to an azimuth."""
        return b'M%03d\r' % round(azimuth)


class Easycomm(LineProtocol):
    """EasyComm II and III. The device answers the two angles in one line or in two; K3NG answers numbers with a sign,
    without the names of the axes."""
    ASK, STOP, RESOLUTION = b'AZ EL \n', b'SA SE \n', 0.1
    _WORD = re.compile(rb'(AZ|EL|(?=[-+]))=?([-+]?\d+(?:[.,]\d*)?)')
    _BETWEEN_WORDS = re.compile(rb'[\s;]+|,(?=[A-Z\s+-]|$)')
    _RADIO = re.compile(rb'\b(?:UP|DN)\d+(?:\s+[A-Z]+)?')     # frequency and kind of modulation

    def __init__(self, azimuth_only: bool = False) -> None:
        super().__init__(azimuth_only)
        self._angles: dict[bytes, bytes] = {}
        if azimuth_only:
            self.ask, self.stop = b'AZ \n', b'SA \n'

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to these angles."""
        return b'AZ%.1f\n' % azimuth if self.azimuth_only else b'AZ%.1f EL%.1f\n' % (azimuth, elevation)

    def sent(self, request: bytes) -> None:
        """Forget half an answer to an earlier request."""
        super().sent(request)
        self._angles.clear()

    def answers_of(self, line: bytes) -> Iterator[Answer]:
        """Yield the position once both angles have arrived; other words, such as alarms, are refused."""
        for word in filter(None, self._BETWEEN_WORDS.split(self._RADIO.sub(b'', line))):
            match = self._WORD.fullmatch(word.upper())
            if not match:
                if word not in self.ask.split():
                    yield Refusal(f'answer {word.decode(errors="replace")!r}: must be AZaaa.a or ELeee.e')
                continue
            self._angles[match[1] or (b'EL' if b'AZ' in self._angles else b'AZ')] = match[2]
            if self.azimuth_only:
                self._angles[b'EL'] = b'0'
            if len(self._angles) == 2:
                yield checked(self._angles.pop(b'AZ'), self._angles.pop(b'EL'))


class Spid(RotatorProtocol):
    """Base of the protocols of SPID: frames of 13 bytes to the device, which begin with W and end with a space."""
    ASK, STOP = (b'W' + 10 * b'\0' + bytes([command]) + b' ' for command in (0x1F, 0x0F))
    FRAME_BYTES: ClassVar[int]      # of an answer
    FORM: ClassVar[str]             # of an answer, for people

    def __init__(self, azimuth_only: bool = False) -> None:
        super().__init__(azimuth_only)
        self._begun = b''   # of a frame
        self._set_point = self.ask  # the last set-point, before the first one any request

    def sent(self, request: bytes) -> None:
        """Note a set-point, because an adapter of a line with two wires echoes each request."""
        if request not in (self.ask, self.stop):
            self._set_point = request

    def answers(self, received: bytes) -> list[Answer]:
        """Return the complete answers in the received bytes."""
        found: list[Answer] = []
        data, requests = self._begun + received, (self.ask, self.stop, self._set_point)
        while True:
            begin = data.find(b'W')
            data = data[begin:] if begin >= 0 else b''
            if data[:len(self.ask)] in requests:
                data = data[len(self.ask):]     # an echo
                continue
            if len(data) < self.FRAME_BYTES or any(request.startswith(data) for request in requests):
                self._begun = data
                return found
            frame = data[:self.FRAME_BYTES]
            answer = self.answer_of(frame)
            # The next frame may begin within the W of a text, or within a damaged frame.
            data = data[1 if answer is None else self.FRAME_BYTES:]
            found.append(answer or Refusal(f'frame {frame.hex(" ")}: must be {self.FORM}'))

    def answer_of(self, frame: bytes) -> Answer | None:
        """Return the answer in a frame, None for bytes that are no frame."""
        raise NotImplementedError


class Rot1prog(Spid):
    """SPID Rot1Prog: azimuth alone, whole degrees, sent and received as 360 + azimuth."""
    BAUD_RATE, RESOLUTION, RANGE, AZIMUTH_ONLY = 1200, 1.0, (-360.0, 639.0), True
    FRAME_BYTES, FORM = 5, 'W, three digits, and a space'

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to an azimuth."""
        return b'W%03d0' % round(360.0 + azimuth) + bytes(6) + b'\x2f '

    def answer_of(self, frame: bytes) -> Answer | None:
        """Return the answer in a frame, None for bytes that are no frame."""
        digits = frame[1:4]
        if frame[-1:] != b' ' or max(digits) > 9:
            return None
        return in_range(Position(100.0 * digits[0] + 10 * digits[1] + digits[2] - 360, 0.0))


class Rot2prog(Spid):
    """SPID Rot2Prog. An angle is sent as pulses, PH (360 + angle), and received as digits of 0.1 deg. The device
    ignores the PH of a set-point; its own PH (azimuth) and PV (elevation) are in each answer. MD-01 also answers a
    set-point, with the same frame, and may send text between the frames."""
    BAUD_RATE, RESOLUTION, RANGE = 600, 0.1, (-360.0, 639.9)
    FRAME_BYTES, FORM, READS_PULSES = 12, 'W, eight digits with their pulses, and a space', True
    MAX_PULSES_PER_DEG = 10     # 1, 2 or 4 of a Rot2Prog, 10 of an MD-01; with more, RANGE has five digits

    def set_point(self, azimuth: Degrees, elevation: Degrees, pulses: Pulses | None) -> bytes:
        """Return the request to move to these angles."""
        assert pulses is not None   # no set-point is sent before the first answer
        numbers = (round(count * (360.0 + angle)) for count, angle in zip(pulses, (azimuth, elevation)))
        return b'W%04d%c%04d%c\x2f ' % tuple(part for pair in zip(numbers, pulses) for part in pair)

    def answer_of(self, frame: bytes) -> Answer | None:
        """Return the answer in a frame, None for bytes that are no frame."""
        digits, pulses = frame[1:5] + frame[6:10], (frame[5], frame[10])
        if frame[-1:] != b' ' or max(digits) > 9:
            return None
        if not all(1 <= count <= self.MAX_PULSES_PER_DEG for count in pulses):
            return Refusal(f'{pulses[0]} and {pulses[1]} pulses per degree: must be 1 to {self.MAX_PULSES_PER_DEG}')
        azimuth, elevation = (100 * d[0] + 10 * d[1] + d[2] + 0.1 * d[3] - 360 for d in (digits[:4], digits[4:]))
        return in_range(Position(azimuth, elevation, pulses))


PROTOCOLS: dict[str, type[RotatorProtocol]] = {
    'rotctld': Rotctld,
    'gs232': Gs232,
    'gs232_azimuth': Gs232Azimuth,
    'easycomm': Easycomm,
    'rot1prog': Rot1prog,
    'rot2prog': Rot2prog,
}
