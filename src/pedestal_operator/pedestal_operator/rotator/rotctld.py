"""Requests and answers of the network protocol of rotctld, the rotator server of Hamlib. No sockets, no ROS here.

The module is written for Hamlib 4.5.4 and gpredict. rotctld itself reads word by word, this module reads line by line.
A command with too few arguments is refused at once and does not take the next line. An unknown command is answered.
Numbers must be finite.
"""
import re
from collections.abc import Sequence
from typing import NamedTuple

from pedestal_common.quantities import Degrees

MAX_LINE_BYTES = 256  # largest length of a line [bytes]

(RESULT_OK, RESULT_INVALID, RESULT_NOT_IMPLEMENTED, RESULT_TIMEOUT, RESULT_IO_ERROR, RESULT_REJECTED,
 RESULT_NOT_AVAILABLE, RESULT_BUSY) = (0, -1, -4, -5, -6, -9, -11, -14)  # n of `RPRT n` (hamlib/rig.h)

ERROR_REASONS = {RESULT_INVALID: 'invalid arguments', RESULT_NOT_IMPLEMENTED: 'unknown command',
                 RESULT_NOT_AVAILABLE: 'an antenna control unit has no such function'}


class Row(NamedTuple):
    """A command."""
    letter: str
    name: str
    arguments: int = 0      # number of its arguments
    sets: bool = False      # True if the answer is RPRT only


COMMANDS = (Row('p', 'get_pos'), Row('P', 'set_pos', 2, True), Row('S', 'stop', 0, True), Row('K', 'park', 0, True),
            Row('R', 'reset', 1, True), Row('M', 'move', 2, True), Row('_', 'get_info'), Row('s', 'get_status'),
            Row('1', 'dump_caps'), Row('', 'dump_state'), Row('q', 'quit'), Row('Q', 'quit'))

COMMAND_LIST_LINES = tuple(('', f'{row.letter}: {row.name}' if row.letter else f'\\{row.name}') for row in COMMANDS)

SET_COMMANDS = tuple(row.name for row in COMMANDS if row.sets)  # commands that are answered by RPRT only

UNAVAILABLE_COMMANDS = (*'wCUuXx3LlDdEeBAaVv', 'send_cmd', 'set_conf', 'set_func', 'get_func', 'set_parm', 'get_parm',
                        'dump_conf', 'lonlat2loc', 'loc2lonlat', 'dms2dec', 'dec2dms', 'dmmm2dec', 'dec2dmmm', 'qrb',
                        'a_sp2a_lp', 'd_sp2d_lp', 'set_level', 'get_level')  # without function here

MOVE_DIRECTIONS = {2: (0, 1), 4: (0, -1), 8: (-1, 0), 16: (1, 0), 32: (-1, 1), 64: (1, 1), 128: (-1, -1), 256: (1, -1)}
"""{number: direction (azimuth, elevation)} of `move`."""

_DIRECTION_NUMBERS = {'UP': 2, 'DOWN': 4, 'LEFT': 8, 'CCW': 8, 'RIGHT': 16, 'CW': 16, 'UP_LEFT': 32, 'UP_CCW': 32,
                      'UP_RIGHT': 64, 'UP_CW': 64, 'DOWN_LEFT': 128, 'DOWN_CCW': 128, 'DOWN_RIGHT': 256,
                      'DOWN_CW': 256}


class Limits(NamedTuple):
    """Limits (low, high) of the axes."""
    azimuth: tuple[Degrees, Degrees]
    elevation: tuple[Degrees, Degrees]


class Request(NamedTuple):
    """Content of a line."""
    name: str                       # of the command
    values: tuple[float, ...] = ()  # its arguments
    separator: str = ''             # between the lines of an extended response (see rotctld), '' for a plain response
    header: str = ''                # first line of an extended response
    error: int = RESULT_OK          # result of a refusal, RESULT_OK without one


def read(line: str) -> Request | None:
    """Return the content of a line (without its line end), None for a line that has no answer."""
    line = line.strip()
    if not line or line.startswith('#'):
        return None
    separator = ''
    if line == '?':
        return Request('help')
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


def number(text: str) -> float:
    """Return the number in a text, which is finite and has a decimal point or a decimal comma. Raises ValueError."""
    if not re.fullmatch(r'[+-]?([0-9]{1,9}([.,][0-9]*)?|[.,][0-9]+)(e[+-]?[0-9]{1,2})?', text, re.IGNORECASE):
        raise ValueError(f'{text!r} is not a number')
    return float(text.replace(',', '.'))


def _values(name: str, given: Sequence[str]) -> tuple[float, ...]:
    if name == 'move':
        direction = _DIRECTION_NUMBERS.get(given[0].upper()) or int(given[0])
        speed = int(given[1])
        if direction not in MOVE_DIRECTIONS or not (speed == -1 or 1 <= speed <= 100):
            raise ValueError
        return direction, speed
    return tuple(number(text) for text in given)


def is_complete(line: str) -> bool:
    """Return True if a line (without its line end) is a valid command with all its arguments."""
    request = read(line)
    return request is not None and request.error == RESULT_OK


def answer(request: Request, result: int, lines: Sequence[tuple[str, str]] = ()) -> bytes:
    """Return the answer to a request. lines: (name in extended responses, text) of its values."""
    if not request.separator:
        text = ''.join(f'{value}\n' for _, value in lines) if lines and result == RESULT_OK else f'RPRT {result}\n'
        return text.encode()
    parts = [request.header]
    if result == RESULT_OK:
        parts += [f'{name}: {value}' if name else value for name, value in lines]
    return (request.separator.join((*parts, f'RPRT {result}')) + '\n').encode()


def position(azimuth: Degrees, elevation: Degrees, raw: bool = False) -> list[tuple[str, str]]:
    """Return the lines of the answer to get_pos. The azimuth is from 0 to 360 deg, or unchanged if raw."""
    shown = azimuth if raw else round(azimuth % 360.0, 2) % 360.0
    return [('Azimuth', f'{shown:.2f}'), ('Elevation', f'{elevation:.2f}')]


def state(limits: Limits, extended: bool) -> list[tuple[str, str]]:
    """Return the lines of the answer to dump_state."""
    (low_az, high_az), (low_el, high_el) = limits
    if extended:
        return [('rotctld Protocol Ver', '1'), ('Rotor Model', '2'), ('Minimum Azimuth', f'{low_az:.6f}'),
                ('Maximum Azimuth', f'{high_az:.6f}'), ('Minimum Elevation', f'{low_el:.6f}'),
                ('Maximum Elevation', f'{high_el:.6f}'), ('South Zero', '0'), ('', 'rot_type=AzEl'), ('', 'done')]
    return [('', line) for line in ('1', '2', f'min_az={low_az:.6f}', f'max_az={high_az:.6f}', f'min_el={low_el:.6f}',
                                    f'max_el={high_el:.6f}', 'south_zero=0', 'rot_type=AzEl', 'done')]


def flags(rates: Sequence[float], angles: Sequence[Degrees], limits: Limits) -> str:
    """Return the status words of axes that move and of axes at a limit. rates [deg/s], angles: those of both axes."""
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


def turn(azimuth: Degrees, near: Degrees, limits: tuple[Degrees, Degrees]) -> Degrees | None:
    """Return the azimuth on the turn nearest to `near` inside the limits, None if no turn is inside."""
    low, high = limits
    candidates = [azimuth + 360.0 * k for k in range(-4, 5) if low <= azimuth + 360.0 * k <= high]
    return min(candidates, key=lambda candidate: abs(candidate - near), default=None)
