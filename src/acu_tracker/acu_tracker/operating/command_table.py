"""What can be asked of the control unit on acu/command: the modes with their arguments, and what is beside them."""
import math

import numpy as np

from acu_tracker.alarms.annunciator import MAX_SHELVING_TIME_S
from acu_tracker.geometry import direction
from acu_tracker.guidance import manual
from acu_tracker.modes import FALLBACK_MODES
from acu_tracker.operating.authority import CONTROL_ROLES
from pedestal_common.graph.modes import MODE_ROWS, MODES
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import ParameterError
from pedestal_common.wire.commands import Argument, CommandDefinition


def _of_axes(doc, low, high, unit, default=None, suffix=''):
    return tuple(Argument(f'{axis}{suffix}', doc, low, high, unit, default=default) for axis in AXES)


_MOTION_ARGUMENTS = (*_of_axes('its rate', -10.0, 10.0, 'rad/s', 0.0, '_rate'),
                     Argument('moves', 'for so long it goes on at these rates', 0.0, 3600.0, 's', default=1.0))

MODE_ARGUMENTS = {
    'preset': (*_of_axes('deck angle; left out: as it was', -20.0, 20.0, 'rad', math.nan), *_MOTION_ARGUMENTS,
               Argument('point', 'one of those that the parameter `points` names, instead of angles', default='')),
    'rate': _of_axes(f'holds for {manual.RATE_REQUEST_TIMEOUT_S:g} s', -10.0, 10.0, 'rad/s', 0.0),
    'slave': (*_of_axes('earth angle', -20.0, 20.0, 'rad'), *_MOTION_ARGUMENTS,
              Argument('holds', 'for so long it is good', 0.01, 86400.0, 's', default=1.0)),
    'tle': tuple(Argument(f'line_{i}', f'line {i} of the elements, _ for blanks; left out: as they are', default='')
                 for i in (1, 2)),
}
"""{mode: its commands.Arguments}."""

_ALARM_ARGUMENT = Argument('alarm', 'name of an alarm, with _ or blanks')

ALARM_COMMANDS = (
    CommandDefinition('acknowledge', 'an alarm has been seen, with all that stands under it',
                      (_ALARM_ARGUMENT._replace(doc='name of an alarm; left out: every alarm', default=''),)),
    CommandDefinition('shelve', 'an alarm is put away for a time', (
        _ALARM_ARGUMENT, Argument('seconds', 'until it comes back', 1.0, MAX_SHELVING_TIME_S, 's'),
        Argument('reason', 'why'))),
    CommandDefinition('unshelve', 'an alarm is taken back', (_ALARM_ARGUMENT,)),
    CommandDefinition('reset',
                      'what is latched ends, unless its cause is still there; nothing moves until a mode is asked for'))
ALARM_COMMAND_NAMES = tuple(verb.name for verb in ALARM_COMMANDS)

ACU_COMMANDS = (
    *(CommandDefinition(mode, row.doc, MODE_ARGUMENTS.get(mode, ())) for mode, row in zip(MODES, MODE_ROWS)),
    CommandDefinition('elements', 'predict by these elements in mode `tle`', tuple(
        Argument(f'line_{i}', f'line {i} of the elements, _ for blanks') for i in (1, 2))),
    CommandDefinition('fallback', 'choose what follows the loss of the track', (
        Argument('mode', ', '.join(FALLBACK_MODES), options=tuple(FALLBACK_MODES)),)),
    CommandDefinition('offset', 'shift what `program`, `tle` and `sun` follow, as they run', (
        Argument('time', 'it comes later by this', -3600.0, 3600.0, 's', default=0.0),
        *_of_axes('added to its angle', -1.0, 1.0, 'rad', 0.0))),
    CommandDefinition('take', 'take control: nobody else is obeyed, but who stops', (
        Argument('role', 'a supervisor takes it away from others', options=CONTROL_ROLES, default='operator'),)),
    CommandDefinition('release', 'give control back'),
    *ALARM_COMMANDS,
)

POINTS_DOC = "named points for `preset`: 'NAME azimuth elevation; ...' [rad], deck angles; empty: none"


def points(text) -> dict:
    """{name: (azimuth, elevation) [rad]} of a text as in POINTS_DOC. Raises ParameterError."""
    named = {}
    for part in filter(None, map(str.strip, text.split(';'))):
        name, *angles = part.split()
        try:
            azimuth, elevation = map(float, angles)
        except ValueError:
            raise ParameterError(f'points = {part!r}: must be NAME azimuth elevation [rad]') from None
        if name in named or not (abs(azimuth) <= 20.0 and abs(elevation) <= 20.0):
            raise ParameterError(f'points = {part!r}: each name once, angles -20 to 20 rad')
        named[name] = azimuth, elevation
    return named


def _rates(arguments):
    """Return the rates (2,) [rad/s] among the arguments of a command."""
    return [arguments[f'{axis}_rate'] for axis in AXES]


def _take_preset(unit, arguments):
    angles = [arguments[axis] for axis in AXES]
    if arguments['point']:
        named = points(unit.parameters.points)
        if arguments['point'] not in named:
            raise ValueError(f'point = {arguments["point"]}: must be one of {", ".join(named) or "none"}')
        angles = named[arguments['point']]
    state = unit.parts['state']
    preset = state['guidance']['preset']
    angles = np.where(np.isfinite(angles), angles, preset['angle'])
    direction.set_moving(preset, state['stamp'], angles, _rates(arguments), arguments['moves'])


def _take_rate(unit, arguments):
    state = unit.parts['state']
    manual.request_rates(state['guidance']['manual'], [arguments[axis] for axis in AXES], state['stamp'])


def _take_slave(unit, arguments):
    state = unit.parts['state']
    direction.set_moving(state['guidance']['slave'], state['stamp'], [arguments[axis] for axis in AXES],
                         _rates(arguments), arguments['moves'], arguments['holds'])


def _take_tle(unit, arguments):
    if any(arguments.values()):
        unit.take_elements(*arguments.values())


ARGUMENT_SETTERS = {'preset': _take_preset, 'rate': _take_rate, 'slave': _take_slave, 'tle': _take_tle}
"""{mode: function (unit.Acu, its arguments) that takes what it is asked for with}; each raises ValueError."""
