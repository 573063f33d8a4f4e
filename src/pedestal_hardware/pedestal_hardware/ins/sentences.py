"""Attitudes in NMEA 0183 sentences: PASHR, PRDID, HDT, ROT.

The library pynmea2 splits a sentence and verifies its checksum; a sentence without checksum is refused. Fields:

    $PASHR,hhmmss.sss,heading,T,roll,pitch,heave,roll sigma,pitch sigma,heading sigma,GNSS quality[,INS status]
    $PRDID,pitch,roll,heading            pitch is the first angle
    $--HDT,heading,T                     $--ROT,rate of turn [deg/min], to port negative,A

`$PASHR,ATT,...` and `$PASHR,HPR,...` are other sentences under the same name. All angles are in degrees, the heading
clockwise from north.
"""
import math
import typing
from collections.abc import Callable, Sequence

from pedestal_common.graph.steps import NS_PER_SECOND, SECONDS_PER_DAY
from pedestal_common.quantities import Degrees, Nanoseconds

KINDS = ('pashr', 'prdid', 'hdt')  # sentences that give an attitude. hdt gives only the heading.
MAX_LEVEL_DEG = 90.0  # largest roll and pitch [deg]
MAX_TURN_DEG_MIN = 3600.0  # largest rate of turn [deg/min]


class SentenceError(ValueError):
    """Error of a sentence that is dropped; kind: bad_checksum, unreadable or out_of_range."""

    def __init__(self, kind: str, reason: str) -> None:
        super().__init__(reason)
        self.kind = kind


class Attitude(typing.NamedTuple):
    """Angles of a sentence."""
    kind: str                   # of KINDS
    heading: Degrees            # NaN for an empty field
    pitch: Degrees = 0.0        # as in the sentence; 0 in a sentence without
    roll: Degrees = 0.0         # likewise
    time_of_day: Nanoseconds | None = None      # since midnight UTC, None in a sentence without time
    sigmas: tuple[Degrees, ...] = (math.nan,) * 3   # 1-sigma of roll, pitch, heading, NaN where it is not stated
    status: int | None = None   # INS status, None where it is not stated


class Turn(typing.NamedTuple):
    """Rate of turn of the bow [deg/min], to starboard positive."""
    rate: float


def parse(line: bytes) -> Attitude | Turn | None:
    """Return what a line states; None for a sentence of another kind. Raises SentenceError."""
    import pynmea2
    try:
        sentence = pynmea2.parse(line.decode('ascii').strip(), check=True)
    except pynmea2.ChecksumError as error:
        raise SentenceError('bad_checksum', f'{line[:20]!r}: {error.args[0][0]}') from None
    except (ValueError, IndexError):     # ParseError is a ValueError; $PASHR without a comma causes the IndexError
        raise SentenceError('unreadable', f'{line[:20]!r}: no NMEA sentence') from None
    data, name = [str(word).strip() for word in sentence.data], line.strip()[1:6].decode()
    try:
        return _READERS[name[2:] if name[2:] in _READERS else name](data)
    except KeyError:
        return None
    except SentenceError as error:
        raise SentenceError(error.kind, f'{name}: {error}') from None


def _pashr(data: Sequence[str]) -> Attitude | None:
    data = data[1:]
    if data[:1] and data[0].isalpha():
        return None
    if len(data) < 10:
        raise SentenceError('unreadable', f'{len(data)} fields: must be at least 10')
    if data[2] not in ('T', ''):
        raise SentenceError('unreadable', f'heading {data[2]}: must be T, true')
    sigmas = tuple(_number(f'1-sigma of {name}', data, i, 0.0, 360.0) if data[i] else math.nan
                   for name, i in (('roll', 6), ('pitch', 7), ('heading', 8)))
    status = int(_number('INS status', data, 10, 0.0, 99.0)) if len(data) > 10 and data[10] else None
    return Attitude('pashr', _number('heading', data, 1, -360.0, 360.0), _level('pitch', data, 4),
                    _level('roll', data, 3), _time_of_day(data[0]), sigmas, status)


def _prdid(data: Sequence[str]) -> Attitude:
    data = data[1:]
    heading = _number('heading', data, 2, -360.0, 360.0) if len(data) > 2 and data[2] else math.nan
    return Attitude('prdid', heading, _level('pitch', data, 0), _level('roll', data, 1))


def _hdt(data: Sequence[str]) -> Attitude:
    """Raise SentenceError for a magnetic heading, and for a decimal comma."""
    if len(data) < 2 or data[1] != 'T':
        raise SentenceError('unreadable', f'heading {",".join(data):.20}: must be a number and T, true')
    return Attitude('hdt', _number('heading', data, 0, -360.0, 360.0))


def _rot(data: Sequence[str]) -> Turn:
    if len(data) > 1 and data[1] not in ('A', ''):
        raise SentenceError('unreadable', f'status {data[1]}: must be A')
    return Turn(_number('rate of turn', data, 0, -MAX_TURN_DEG_MIN, MAX_TURN_DEG_MIN))


_READERS: dict[str, Callable[[Sequence[str]], Attitude | Turn | None]] = {
    'PASHR': _pashr, 'PRDID': _prdid, 'HDT': _hdt, 'ROT': _rot}  # the first field of PASHR is R, of PRDID D


def _level(name: str, data: Sequence[str], i: int) -> Degrees:
    return _number(name, data, i, -MAX_LEVEL_DEG, MAX_LEVEL_DEG)


def _number(name: str, data: Sequence[str], i: int, lowest: float, highest: float) -> float:
    text = data[i] if i < len(data) else ''
    try:
        number = float(text)
    except ValueError:
        raise SentenceError('unreadable', f'{name} {text!r}: must be a number') from None
    if not lowest <= number <= highest:
        raise SentenceError('out_of_range', f'{name} {number:g}: must be {lowest:g} to {highest:g}')
    return number


def _time_of_day(text: str) -> Nanoseconds | None:
    """Return the time since midnight of hhmmss.sss; None for an empty field."""
    if not text:
        return None
    if not (text[:6].isdecimal() and len(text) >= 6 and text.isascii()):
        raise SentenceError('unreadable', f'time {text!r}: must be hhmmss.sss')
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), _number('seconds', [text[4:]], 0, 0.0, 61.0)
    if hours > 23 or minutes > 59:
        raise SentenceError('unreadable', f'time {text!r}: must be hhmmss.sss')
    return (hours * 3600 + minutes * 60) * NS_PER_SECOND + round(seconds * NS_PER_SECOND)


def stamp_at(time_of_day: Nanoseconds, arrival: Nanoseconds) -> Nanoseconds:
    """Return the stamp, UTC, of a time of day that is nearest to the time of arrival, UTC."""
    day = SECONDS_PER_DAY * NS_PER_SECOND
    return arrival + (time_of_day - arrival + day // 2) % day - day // 2
