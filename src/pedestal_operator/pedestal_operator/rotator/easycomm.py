"""Requests and answers of the rotator protocols EasyComm I, II and III. No sockets, no ROS here.

A word of a line is mostly two letters and a value, such as AZ123.4. A query, such as AZ, is answered with the same
letters and the value. All other words are settings, which are not answered (hamlib/rotators/easycomm, easycomm.txt).
"""
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

from pedestal_common.quantities import Degrees
from pedestal_operator.rotator.rotctld import number

MAX_LINE_BYTES = 256  # largest length of a line [bytes]
QUERY_WORDS = 'AZ', 'EL', 'GS', 'GE', 'VE'  # words that are answered: azimuth, elevation, status, errors, version
VERB_BY_WORD = {'SA': 'stop', 'SE': 'stop', 'RESET': 'acu/reset_faults', 'PARK': 'stow'}  # of the control unit

RATE_DIRECTIONS = {'L': (0, -1), 'R': (0, 1), 'U': (1, 1), 'D': (1, -1)}
"""{second letter of a move at the jog rate (ML), or of a velocity [mdeg/s] (VL0500): (axis, sign)}."""

IGNORED_WORDS = 'UP', 'DN', 'UM', 'DM', 'UR', 'DR', 'AO', 'LO', 'OP', 'IP', 'AN', 'ST', 'CR', 'CW'
"""Words of radios, which an antenna control unit ignores; the word after one of them may be the mode of a radio."""

RADIO_MODE_PATTERN = '[A-Z]{1,6}(-[A-Z]{1,3})?'  # pattern of the mode of a radio: FM, USB, FM-N, or XXX from Hamlib
STATUS_IDLE, STATUS_MOVING, STATUS_POINTING, STATUS_ERROR = 1, 2, 4, 8  # status numbers in the answer to GS


class LineRequest(NamedTuple):
    """Content of a line."""
    queries: tuple[str, ...] = ()           # words to answer, in order
    azimuth: Degrees | None = None          # of a set-point
    elevation: Degrees | None = None
    verb: str = ''                          # command of the control unit
    rates: tuple[float, float] | None = None    # of a jog (azimuth, elevation) [deg/s], None for no jog
    scaled: bool = True     # True if the rates are not in deg/s, but multiples of the jog rate of the server


_K = TypeVar('_K', int, str)


def read(line: str) -> LineRequest:
    """Return the content of a line. Raises ValueError with the word that cannot be read, for the whole line."""
    queries: list[str] = []
    verbs: set[str] = set()
    before = ''
    angles: dict[str, Degrees] = {}
    moves: dict[int, float] = {}
    velocities: dict[int, float] = {}
    for word in line.replace(';', ' ').upper().split():
        name = word[:2]
        if word in QUERY_WORDS:
            queries.append(word)
        elif word in VERB_BY_WORD:
            verbs.add(VERB_BY_WORD[word])
        elif name in ('AZ', 'EL'):
            _put(angles, name, word, number)
        elif name[:1] == 'V' and name[1:] in RATE_DIRECTIONS:
            axis, sign = RATE_DIRECTIONS[name[1]]
            _put(velocities, axis, word, _speed, sign)
        elif word[:1] == 'M' and word[1:] in RATE_DIRECTIONS:
            axis, sign = RATE_DIRECTIONS[word[1]]
            _put(moves, axis, word, lambda _: 1, sign)
        elif name not in IGNORED_WORDS and not (before in IGNORED_WORDS and re.fullmatch(RADIO_MODE_PATTERN, word)):
            raise ValueError(f'{word!r} is unknown')
        before = name
    if len(verbs) + bool(angles) + bool(moves) + bool(velocities) > 1:
        raise ValueError('more than one of: set-point, move, velocity, stop, reset, park')
    rates = moves or velocities
    return LineRequest(tuple(queries), angles.get('AZ'), angles.get('EL'), ''.join(verbs),
                       (rates.get(0, 0), rates.get(1, 0)) if rates else None, not velocities)


def _put(values: dict[_K, float], key: _K, word: str, convert: Callable[[str], float],
         sign: int = 1) -> None:
    """Raise ValueError for a wrong value, and for a second value of an axis."""
    if key in values:
        raise ValueError(f'{word!r} is the second value of its axis')
    try:
        values[key] = sign * convert(word[2:])
    except ValueError as error:
        raise ValueError(f'{word!r}: {error}') from None


def _speed(text: str) -> float:
    if not re.fullmatch('[0-9]{1,6}', text):
        raise ValueError(f'{text!r} is not a whole number of mdeg/s')
    return int(text) / 1000.0


def answer(request: LineRequest, angles: Sequence[Degrees] | None, status: int, errors: int, version: str) -> bytes:
    """Return the answer to a line. angles: None if unknown, then AZ and EL are not answered; status, errors, version:
    answers to GS, GE and VE."""
    values = {'GS': f'GS{status}', 'GE': f'GE{errors}', 'VE': f'VE{version}'}
    if angles is not None:
        values |= {'AZ': f'AZ{round(angles[0] % 360.0, 1) % 360.0:.1f}', 'EL': f'EL{angles[1]:.1f}'}
    words = [values[word] for word in request.queries if word in values]
    return f'{" ".join(words)}\n'.encode() if words else b''
