"""Requests and answers of the EasyComm protocols I, II and III. No sockets, no ROS here.

A line has words of two letters and a value, separated by spaces. A query is answered with the same letters and the
value (azimuth 0 to 360 deg), a setting is not answered (hamlib/rotators/easycomm, easycomm.txt).
"""
import re
import typing

MAX_LINE_BYTES = 256
"""Largest length of a line [bytes]."""

VERB_BY_WORD = {'SA': 'stop', 'SE': 'stop', 'RESET': 'acu/reset_faults', 'PARK': 'stow'}
"""{word: command of the control unit}."""

MOVE_DIRECTIONS: dict[str, tuple] = {'ML': (-1, 0), 'MR': (1, 0), 'MU': (0, 1), 'MD': (0, -1)}
"""{word of a move at the jog rate: direction (azimuth, elevation)}."""

VELOCITY_DIRECTIONS = {'VL': (-1, 0), 'VR': (1, 0), 'VU': (0, 1), 'VD': (0, -1)}
"""{word of a velocity: direction (azimuth, elevation)}; its value is in mdeg/s."""

STATUS_IDLE, STATUS_MOVING, STATUS_POINTING, STATUS_ERROR = 1, 2, 4, 8
"""Status numbers in the answer to GS."""


class LineRequest(typing.NamedTuple):
    """Content of a line.

    queries              words to answer, in order
    azimuth, elevation   of a set-point [deg], None if missing
    verb                 command of the control unit
    rates                of a jog (azimuth, elevation) [deg/s], or, if scaled, in jog rates
    """
    queries: tuple = ()
    azimuth: float | None = None
    elevation: float | None = None
    verb: str = ''
    rates: tuple | None = None
    scaled: bool = True


def read(line) -> LineRequest:
    """Return the LineRequest of a line; all other words (frequencies, modes, time) are ignored."""
    queries, angles, verb, rates, scaled = [], {}, '', None, True
    for word in line.replace(';', ' ').upper().split():
        name, value = word[:2], word[2:]
        if word in VERB_BY_WORD:
            verb = VERB_BY_WORD[word]
        elif name in ('AZ', 'EL'):
            if not value:
                queries.append(name)
            elif re.fullmatch(r'[+-]?\d{1,4}(\.\d{0,9})?', value):
                angles[name] = float(value)
        elif word in ('GS', 'GE', 'VE'):
            queries.append(word)
        elif word in MOVE_DIRECTIONS:
            rates, scaled = MOVE_DIRECTIONS[word], True
        elif name in VELOCITY_DIRECTIONS and re.fullmatch(r'\d{1,6}', value):
            rates, scaled = tuple(part * int(value) / 1000.0 for part in VELOCITY_DIRECTIONS[name]), False
    return LineRequest(tuple(queries), angles.get('AZ'), angles.get('EL'), verb, rates, scaled)


def answer(request, angles, status, errors, version) -> bytes:
    """Return the answer to a LineRequest. angles: (azimuth, elevation) [deg]; status, errors: of GS and GE."""
    values = {'AZ': f'AZ{round(angles[0] % 360.0, 1) % 360.0:.1f}', 'EL': f'EL{angles[1]:.1f}', 'GS': f'GS{status}',
              'GE': f'GE{errors}', 'VE': f'VE{version}'}
    return f'{" ".join(values[word] for word in request.queries)}\n'.encode() if request.queries else b''
