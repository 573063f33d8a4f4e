"""The network protocol of Hamlib's rotctld, line by line: what a line asks for, and how it is answered. No sockets, no
ROS here.

Written against Hamlib 4.5.4 (rotctl -m 2, rotctld -m 1) and gpredict. Other than in the reference, which reads words
instead of lines, a command with too few arguments is refused at once and does not take the next line, an unknown one
is answered, and numbers must be finite.
"""
import math
import re
import typing

MAX_LINE_BYTES = 256
"""Bytes of a line at the most."""

(RESULT_OK, RESULT_INVALID, RESULT_NOT_IMPLEMENTED, RESULT_TIMEOUT, RESULT_REJECTED, RESULT_NOT_AVAILABLE,
 RESULT_BUSY) = (0, -1, -4, -5, -9, -11, -14)
"""Results `RPRT n` (hamlib/rig.h)."""


class Row(typing.NamedTuple):
    """A command: letter, long name, number of arguments; sets: answered by RPRT alone."""
    letter: str
    name: str
    arguments: int = 0
    sets: bool = False


COMMANDS = (Row('p', 'get_pos'), Row('P', 'set_pos', 2, True), Row('S', 'stop', 0, True), Row('K', 'park', 0, True),
            Row('R', 'reset', 1, True), Row('M', 'move', 2, True), Row('_', 'get_info'), Row('s', 'get_status'),
            Row('1', 'dump_caps'), Row('', 'dump_state'), Row('q', 'quit'), Row('Q', 'quit'))

SET_COMMANDS = tuple(row.name for row in COMMANDS if row.sets)

UNAVAILABLE_COMMANDS = (*'wCUuXx3LlDdEeBAaVv', 'send_cmd', 'set_conf', 'set_func', 'get_func', 'set_parm', 'get_parm',
                        'dump_conf', 'lonlat2loc', 'loc2lonlat', 'dms2dec', 'dec2dms', 'dmmm2dec', 'dec2dmmm', 'qrb',
                        'a_sp2a_lp', 'd_sp2d_lp', 'set_level', 'get_level')
"""Commands of the reference that an antenna control unit has no use for."""

MOVE_DIRECTIONS = {2: (0, 1), 4: (0, -1), 8: (-1, 0), 16: (1, 0), 32: (-1, 1), 64: (1, 1), 128: (-1, -1), 256: (1, -1)}
"""{number: way (azimuth, elevation)} of `move`."""

_DIRECTION_NUMBERS = {'UP': 2, 'DOWN': 4, 'LEFT': 8, 'CCW': 8, 'RIGHT': 16, 'CW': 16, 'UP_LEFT': 32, 'UP_CCW': 32,
                      'UP_RIGHT': 64,
                      'UP_CW': 64, 'DOWN_LEFT': 128, 'DOWN_CCW': 128, 'DOWN_RIGHT': 256, 'DOWN_CW': 256}


class Limits(typing.NamedTuple):
    """Ends of the travel [deg]."""
    azimuth: tuple = (-180.0, 360.0)
    elevation: tuple = (0.0, 90.0)


class Request(typing.NamedTuple):
    """A line understood: the name of its command, its arguments, its separator ('\\n' in plain, else the character
    of an extended response), the header of that response. error: what it is refused with, OK for none."""
    name: str
    values: tuple = ()
    separator: str = ''
    header: str = ''
    error: int = RESULT_OK


def read(line) -> Request | None:
    """The Request of a line without its end; None where there is nothing to answer."""
    line = line.strip()
    if not line or line.startswith('#'):
        return None
    separator = ''
    if not (line[0].isalnum() or line[0] in '\\_'):
        separator, line = ('\n' if line[0] == '+' else line[0]), line[1:].strip()
    words = line.split()
    if not words:
        return None
    called = words[0]
    name = called[1:] if called.startswith('\\') else called
    row = next((row for row in COMMANDS if name == (row.name if name != called else row.letter)), None)
    if row is None:
        known = name in UNAVAILABLE_COMMANDS
        return Request(name, (), separator, f'{name}:', RESULT_NOT_AVAILABLE if known else RESULT_NOT_IMPLEMENTED)
    given = words[1:]
    header = f'{row.name}: {" ".join(given)}' if given else f'{row.name}:'
    if len(given) != row.arguments:
        return Request(row.name, (), separator, header, RESULT_INVALID)
    try:
        values = _values(row.name, given)
    except ValueError:
        return Request(row.name, (), separator, header, RESULT_INVALID)
    return Request(row.name, values, separator, header)


def _values(name, given):
    """The numbers of a command's arguments. Raises ValueError."""
    if name == 'move':
        way = _DIRECTION_NUMBERS.get(given[0].upper()) or int(given[0])
        speed = int(given[1])
        if way not in MOVE_DIRECTIONS or not (speed == -1 or 1 <= speed <= 100):
            raise ValueError
        return way, speed
    values = tuple(_number(text) for text in given)
    return values


def _number(text):
    if not re.fullmatch(r'[+-]?(\d{1,9}([.,]\d*)?|[.,]\d+)([eE][+-]?\d{1,2})?', text):
        raise ValueError(text)
    number = float(text.replace(',', '.'))
    if not math.isfinite(number):
        raise ValueError(text)
    return number


def answer(request, result, lines=()) -> bytes:
    """The answer to a Request: its result, and lines of what was asked for, [(name in extended responses, text)]."""
    if not request.separator:
        text = ''.join(f'{value}\n' for _, value in lines) if lines and result == RESULT_OK else f'RPRT {result}\n'
        return text.encode()
    parts = [request.header]
    if result == RESULT_OK:
        parts += [f'{name}: {value}' if name else value for name, value in lines]
    return (request.separator.join((*parts, f'RPRT {result}')) + '\n').encode()


def position(azimuth, elevation, raw=False):
    """Lines of get_pos [deg], the azimuth 0 to 360, or raw as it is."""
    told = azimuth if raw else round(azimuth % 360.0, 2) % 360.0
    return [('Azimuth', f'{told:.2f}'), ('Elevation', f'{elevation:.2f}')]


def state(limits, extended):
    """Lines of dump_state."""
    (low_az, high_az), (low_el, high_el) = limits
    if extended:
        return [('rotctld Protocol Ver', '1'), ('Rotor Model', '2'), ('Minimum Azimuth', f'{low_az:.6f}'),
                ('Maximum Azimuth', f'{high_az:.6f}'), ('Minimum Elevation', f'{low_el:.6f}'),
                ('Maximum Elevation', f'{high_el:.6f}'), ('South Zero', '0'), ('', 'rot_type=AzEl'), ('', 'done')]
    return [('', line) for line in ('1', '2', f'min_az={low_az:.6f}', f'max_az={high_az:.6f}', f'min_el={low_el:.6f}',
                                    f'max_el={high_el:.6f}', 'south_zero=0', 'rot_type=AzEl', 'done')]


def flags(rates, angles, limits):
    """Status words: what moves [deg/s], what stands at an end of its travel."""
    words, moving = [], [abs(rate) > 0.01 for rate in rates]
    if any(moving):
        words.append('MOVING')
    if moving[0]:
        words += ['MOVING_AZ', 'MOVING_RIGHT' if rates[0] > 0.0 else 'MOVING_LEFT']
    if moving[1]:
        words += ['MOVING_EL', 'MOVING_UP' if rates[1] > 0.0 else 'MOVING_DOWN']
    for (low, high), angle, below, above in zip(limits, angles, ('LIMIT_LEFT', 'LIMIT_DOWN'),
                                                ('LIMIT_RIGHT', 'LIMIT_UP')):
        words += [below] if angle < low + 0.05 else [above] if angle > high - 0.05 else []
    return ' '.join(words)


def turn(azimuth, near, limits):
    """The azimuth [deg] on the turn nearest to `near` that lies inside the limits; None where none does."""
    low, high = limits
    candidates = [azimuth + 360.0 * k for k in range(-4, 5) if low <= azimuth + 360.0 * k <= high]
    return min(candidates, key=lambda candidate: abs(candidate - near), default=None)

