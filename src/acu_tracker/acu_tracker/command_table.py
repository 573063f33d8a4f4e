"""The table of the commands that the control unit accepts on acu/command: modes with arguments, and other commands."""
import math
from collections.abc import Mapping
from typing import TypeAlias

from acu_tracker.alarms.annunciator import MAX_SHELVING_TIME_S
from acu_tracker.guidance import manual
from acu_tracker.modes import FALLBACK_MODES
from acu_tracker.pointing.params import PointingParameters
from acu_tracker.servo import excitation
from pedestal_common.graph.modes import MODE_ROWS, MODES
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import ParameterError, as_dict, flatten
from pedestal_common.quantities import Radians, Value
from pedestal_common.wire.commands import Argument, CommandDefinition

Arguments: TypeAlias = Mapping[str, Value]  # of a command, by name

CONTROL_ROLES = ('operator', 'supervisor', 'program')
"""Roles of a client. A supervisor may take control from another client; a program takes it only if it is free and the
antenna is not in a pass, or if an operator has allowed this program."""


def _of_axes(doc: str, low: float, high: float, unit: str, default: float | None = None,
             suffix: str = '') -> tuple[Argument, ...]:
    return tuple(Argument(f'{axis}{suffix}', doc, low, high, unit, default=default) for axis in AXES)


_MOTION_ARGUMENTS = (*_of_axes('rate of the angle', -10.0, 10.0, 'rad/s', 0.0, '_rate'),
                     Argument('moves', 'time for which the rates apply', 0.0, 3600.0, 's', default=1.0))

_ELEMENT_ARGUMENTS = (*(Argument(f'line_{i}', f'line {i} of the TLE, _ for blanks', default='') for i in (1, 2)),
                      Argument('omm', 'OMM in JSON, instead of the lines', default=''))

_MODEL_DEFAULTS = as_dict(PointingParameters())
_MODEL_ARGUMENTS = tuple(
    Argument(name, field.metadata['doc'], field.metadata.get('low', -math.inf), field.metadata.get('high', math.inf),
             field.metadata.get('unit', ''), default=_MODEL_DEFAULTS[name])
    for name, field in flatten(PointingParameters))

MODE_ARGUMENTS = {      # {mode: its Arguments}
    'preset': (*_of_axes('deck angle; default: unchanged', -20.0, 20.0, 'rad', math.nan), *_MOTION_ARGUMENTS,
               Argument('point', 'name of a point of the parameter `points`, instead of angles', default='')),
    'rate': _of_axes(f'rate of the axis, valid for {manual.RATE_REQUEST_TIMEOUT_S:g} s', -10.0, 10.0, 'rad/s', 0.0),
    'slave': (*_of_axes('earth angle', -20.0, 20.0, 'rad'), *_MOTION_ARGUMENTS,
              Argument('holds', 'time for which the direction is valid', 0.01, 86400.0, 's', default=1.0)),
    'tle': tuple(argument._replace(doc=f'{argument.doc}; default: unchanged') for argument in _ELEMENT_ARGUMENTS),
}

_ALARM_ARGUMENT = Argument('alarm', 'name of the alarm, with _ or blanks')

_ALARM_COMMANDS = (
    CommandDefinition('acknowledge', 'acknowledge an alarm and all alarms that are its consequences',
                      (_ALARM_ARGUMENT._replace(doc='name of the alarm; default: every alarm', default=''),)),
    CommandDefinition('shelve', 'shelve an alarm for a time', (
        _ALARM_ARGUMENT, Argument('seconds', 'time until the alarm returns', 1.0, MAX_SHELVING_TIME_S, 's'),
        Argument('reason', 'reason for shelving'))),
    CommandDefinition('unshelve', 'end the shelving of an alarm', (_ALARM_ARGUMENT,)),
    CommandDefinition('reset', 'reset latched alarms; also cancel the initial mode, or a mode to be resumed, that has '
                      'not been entered yet; refused while the cause of a latched alarm is still present; in realtime '
                      'the control unit also requests the reset of a drive in fault'))

ACU_COMMANDS = (
    *(CommandDefinition(mode, row.doc, MODE_ARGUMENTS.get(mode, ())) for mode, row in zip(MODES, MODE_ROWS)),
    CommandDefinition('elements', 'predict by these elements in mode `tle`', _ELEMENT_ARGUMENTS),
    CommandDefinition('fallback', 'choose the mode after the loss of the track', (
        Argument('mode', 'mode after the loss of the track', options=tuple(FALLBACK_MODES)),)),
    CommandDefinition('offset', 'shift the table of `program`, `tle` and `sun`, also while the antenna follows it', (
        Argument('time', 'delay of the table; positive: follow it later', -3600.0, 3600.0, 's', default=0.0),
        *_of_axes('offset of the angle', -1.0, 1.0, 'rad', 0.0))),
    CommandDefinition('pointing', 'take another pointing model, gradually; terms that are not given are 0',
                      _MODEL_ARGUMENTS),
    CommandDefinition('excite', 'add a multisine to the rate command of an axis, to measure its position loop; only '
                      f'in the modes {", ".join(excitation.EXCITED_MODES)}; ended by any mode, alarm or limit', (
        Argument('axis', 'excited axis', options=AXES),
        Argument('peak', 'peak of the multisine', 1e-6, excitation.MAX_PEAK_RAD_S, 'rad/s'),
        Argument('duration', 'duration', 1.0, excitation.MAX_DURATION_S, 's'),
        Argument('lowest', 'lowest frequency', 0.02, 500.0, 'Hz', default=0.25),
        Argument('highest', 'highest frequency', 0.02, 500.0, 'Hz', default=90.0),
        Argument('points', 'number of frequencies', 2.0, excitation.MAX_SINES, default=100.0),
        Argument('period', 'time after which the multisine repeats', 1.0, excitation.MAX_PERIOD_S, 's', default=8.0))),
    CommandDefinition('take', 'take control; other clients can then send only `stop` and `standby`', (
        Argument('role', 'role of the client; a supervisor takes control from any holder; a program takes it from '
                 'another client, or in a pass, only after `allow`', options=CONTROL_ROLES, default='operator'),)),
    CommandDefinition('release', 'release control'),
    CommandDefinition('allow', 'allow a program, such as a client of rotctld, to take control in a pass and from '
                      'another client; a mode by another client ends this', (
        Argument('client', 'program, without its TCP port; default: the last that requested it', default=''),)),
    *_ALARM_COMMANDS,
)

POINTS_DOC = "named points for `preset`: 'NAME azimuth elevation; ...' [rad], deck angles; empty: none"


def points(text: str) -> dict[str, tuple[Radians, Radians]]:
    """Return the points of a text as in POINTS_DOC by name; raise ParameterError for a wrong text."""
    named: dict[str, tuple[Radians, Radians]] = {}
    for part in filter(None, map(str.strip, text.split(';'))):
        name, *angles = part.split()
        try:
            azimuth, elevation = map(float, angles)
        except ValueError:
            raise ParameterError(f'points = {part!r}: must be NAME azimuth elevation [rad]') from None
        if name in named or not (abs(azimuth) <= 20.0 and abs(elevation) <= 20.0):
            raise ParameterError(f'points = {part!r}: each name must be unique, each angle -20 to 20 rad')
        named[name] = azimuth, elevation
    return named
