"""The EasyComm protocols I, II and III: what a line asks for. No sockets, no ROS here.

Words of two letters and a value, separated by spaces; what asks for something is answered with the same letters and
the value, what sets something is not answered (hamlib/rotators/easycomm, easycomm.txt).
"""
import re
import typing

MAX_LINE_BYTES = 256
"""Bytes of a line at the most."""

VERB_BY_WORD = {'SA': 'stop', 'SE': 'stop', 'RESET': 'acu/reset_faults', 'PARK': 'stow'}
"""{word: verb of the control unit}."""

MOVE_DIRECTIONS = {'ML': (-1, 0), 'MR': (1, 0), 'MU': (0, 1), 'MD': (0, -1)}
VELOCITY_DIRECTIONS = {'VL': (-1, 0), 'VR': (1, 0), 'VU': (0, 1), 'VD': (0, -1)}
"""{word: way (azimuth, elevation)}; the value of a velocity is in mdeg/s."""

STATUS_IDLE, STATUS_MOVING, STATUS_POINTING, STATUS_ERROR = 1, 2, 4, 8
"""Of GS."""


class LineRequest(typing.NamedTuple):
    """What a line asks for.

    tells: words to be answered, in order; azimuth, elevation: of a set-point [deg], None where it is not in it; verb:
    of the control unit; rates: of a jog (azimuth, elevation), [deg/s] or, scaled, in jog rates.
    """
    tells: tuple = ()
    azimuth: float | None = None
    elevation: float | None = None
    verb: str = ''
    rates: tuple | None = None
    scaled: bool = True


def read(line) -> LineRequest:
    """What a line asks for. What it does not understand, frequencies, modes and the time, is left out."""
    tells, angles, verb, rates, scaled = [], {}, '', None, True
    for word in line.replace(';', ' ').upper().split():
        name, value = word[:2], word[2:]
        if word in VERB_BY_WORD:
            verb = VERB_BY_WORD[word]
        elif name in ('AZ', 'EL'):
            if not value:
                tells.append(name)
            elif re.fullmatch(r'[+-]?\d{1,4}(\.\d{0,9})?', value):
                angles[name] = float(value)
        elif word in ('GS', 'GE', 'VE'):
            tells.append(word)
        elif word in MOVE_DIRECTIONS:
            rates, scaled = MOVE_DIRECTIONS[word], True
        elif name in VELOCITY_DIRECTIONS and re.fullmatch(r'\d{1,6}', value):
            rates, scaled = tuple(way * int(value) / 1000.0 for way in VELOCITY_DIRECTIONS[name]), False
    return LineRequest(tuple(tells), angles.get('AZ'), angles.get('EL'), verb, rates, scaled)


def answer(asked, angles, status, errors, version) -> bytes:
    """The answer to what a line asks for: angles (azimuth 0 to 360, elevation) [deg], the numbers of GS and GE."""
    values = {'AZ': f'AZ{round(angles[0] % 360.0, 1) % 360.0:.1f}', 'EL': f'EL{angles[1]:.1f}', 'GS': f'GS{status}',
              'GE': f'GE{errors}', 'VE': f'VE{version}'}
    return f'{" ".join(values[word] for word in asked.tells)}\n'.encode() if asked.tells else b''
