"""The EasyComm protocols I, II and III: what a line asks for. No sockets, no ROS here.

Words of two letters and a value, separated by spaces; what asks for something is answered with the same letters and
the value, what sets something is not answered (hamlib/rotators/easycomm, easycomm.txt).
"""
import re
import typing

LONGEST = 256
"""Bytes of a line at the most."""

VERBS = {'SA': 'stop', 'SE': 'stop', 'RESET': 'acu/reset_faults', 'PARK': 'stow'}
"""{word: verb of the control unit}."""

MOVES = {'ML': (-1, 0), 'MR': (1, 0), 'MU': (0, 1), 'MD': (0, -1)}
VELOCITIES = {'VL': (-1, 0), 'VR': (1, 0), 'VU': (0, 1), 'VD': (0, -1)}
"""{word: way (azimuth, elevation)}; the value of a velocity is in mdeg/s."""

IDLE, MOVING, POINTING, ERROR = 1, 2, 4, 8
"""Of GS."""


class Asked(typing.NamedTuple):
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


def read(line) -> Asked:
    """What a line asks for. What it does not understand, frequencies, modes and the time, is left out."""
    tells, angles, verb, rates, scaled = [], {}, '', None, True
    for word in line.replace(';', ' ').upper().split():
        name, value = word[:2], word[2:]
        if word in VERBS:
            verb = VERBS[word]
        elif name in ('AZ', 'EL'):
            if not value:
                tells.append(name)
            elif re.fullmatch(r'[+-]?\d{1,4}(\.\d{0,9})?', value):
                angles[name] = float(value)
        elif word in ('GS', 'GE', 'VE'):
            tells.append(word)
        elif word in MOVES:
            rates, scaled = MOVES[word], True
        elif name in VELOCITIES and re.fullmatch(r'\d{1,6}', value):
            rates, scaled = tuple(way * int(value) / 1000.0 for way in VELOCITIES[name]), False
    return Asked(tuple(tells), angles.get('AZ'), angles.get('EL'), verb, rates, scaled)


def told(asked, angles, status, errors, version) -> bytes:
    """The answer to what a line asks for: angles (azimuth 0 to 360, elevation) [deg], the numbers of GS and GE."""
    values = {'AZ': f'AZ{round(angles[0] % 360.0, 1) % 360.0:.1f}', 'EL': f'EL{angles[1]:.1f}', 'GS': f'GS{status}',
              'GE': f'GE{errors}', 'VE': f'VE{version}'}
    return f'{" ".join(values[word] for word in asked.tells)}\n'.encode() if asked.tells else b''
