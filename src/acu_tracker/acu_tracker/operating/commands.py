"""Execution of the commands on acu/command: EXECUTORS has a function for each verb of command_table.ACU_COMMANDS.

A refusal changes nothing. A function raises ValueError for wrong arguments.
"""
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from acu_tracker import modes
from acu_tracker.geometry import direction
from acu_tracker.guidance import manual
from acu_tracker.operating.command_table import Arguments, points
from pedestal_common.graph.modes import MODES
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Radians, RadiansPerSecond
from pedestal_common.wire.commands import Command, Reply

if TYPE_CHECKING:
    from acu_tracker.unit import Acu

Executor: TypeAlias = Callable[['Acu', Command, Arguments], Reply]


def _rates(arguments: Arguments) -> list[RadiansPerSecond]:
    return [arguments[f'{axis}_rate'] for axis in AXES]


def _take_preset(unit: 'Acu', arguments: Arguments) -> None:
    """Set the direction of the mode preset: angles or a named point, and rates.

    Raise ValueError for an unknown point.
    """
    angles: Sequence[Radians] = [arguments[axis] for axis in AXES]
    if arguments['point']:
        named = points(unit.parameters.points)
        if arguments['point'] not in named:
            raise ValueError(f'point = {arguments["point"]}: must be one of {", ".join(named) or "none"}')
        angles = named[arguments['point']]
    state = unit.parts['state']
    preset = state['guidance']['preset']
    direction.set_moving(preset, state['stamp'], np.where(np.isfinite(angles), angles, preset['angle']),
                         _rates(arguments), arguments['moves'])


def _take_rate(unit: 'Acu', arguments: Arguments) -> None:
    """Set the rates of the mode rate."""
    state = unit.parts['state']
    manual.request_rates(state['guidance']['manual'], [arguments[axis] for axis in AXES], state['stamp'])


def _take_slave(unit: 'Acu', arguments: Arguments) -> None:
    """Set the direction of the mode slave. The refraction is added to a true elevation."""
    state = unit.parts['state']
    slave = state['guidance']['slave']
    direction.set_moving(slave, state['stamp'], [arguments[axis] for axis in AXES], _rates(arguments),
                         arguments['moves'], arguments['holds'])
    unit.followed.bend(unit.parts, slave.copy())


def _take_tle(unit: 'Acu', arguments: Arguments) -> None:
    """Take the elements of the mode tle, if the command has any; raise ValueError for invalid elements."""
    if any(arguments.values()):
        _predict_by(unit, *arguments.values())


def _predict_by(unit: 'Acu', line_1: str, line_2: str, omm: str) -> None:
    """Predict the satellite from other elements; raise ValueError for invalid elements.

    line_1, line_2: TLE, in which _ stands for a blank; omm: OMM in JSON.
    """
    followed = unit.followed
    followed.predict_by(followed.predictor.with_elements(line_1.replace('_', ' '), line_2.replace('_', ' '), omm))
    unit.update_tables()


ARGUMENT_SETTERS = {'preset': _take_preset, 'rate': _take_rate, 'slave': _take_slave, 'tle': _take_tle}
"""{mode: function (unit.Acu, arguments) that takes the arguments of its command}; each raises ValueError."""


def _enter_mode(unit: 'Acu', command: Command, arguments: Arguments) -> Reply:
    """Take the arguments of a mode and request it; a refusal restores what they have changed."""
    guidance, followed = unit.parts['state']['guidance'], unit.followed
    predictor, slave = followed.predictor, followed.slave
    before = {name: guidance[name].copy() for name in ('preset', 'manual', 'slave')}
    if command.verb in ARGUMENT_SETTERS:
        ARGUMENT_SETTERS[command.verb](unit, arguments)
    reply = unit.request(f'acu/{command.verb}')
    if not reply.granted:
        for name, value in before.items():
            guidance[name] = value
        followed.slave = slave
        if followed.predictor is not predictor:
            followed.predict_by(predictor)
            unit.update_tables()
    return reply


def _take_elements(unit: 'Acu', _: Command, arguments: Arguments) -> Reply:
    _predict_by(unit, *arguments.values())
    return Reply(True, f'elements of satellite {unit.followed.predictor.number}')


def _choose_fallback(unit: 'Acu', _: Command, arguments: Arguments) -> Reply:
    modes.choose(unit.parts['state']['mode'], arguments['mode'])
    return Reply(True, f'fallback is {arguments["mode"]}')


def _shift_tables(unit: 'Acu', _: Command, arguments: Arguments) -> Reply:
    offset = arguments['time'], arguments['azimuth'], arguments['elevation']
    unit.followed.shift(offset)
    unit.update_tables()
    return Reply(True, 'program track shifted by {:g} s, {:g} and {:g} rad'.format(*offset))


def _replace_model(unit: 'Acu', command: Command, arguments: Arguments) -> Reply:
    if not command.arguments:
        raise ValueError('pointing: no term is given; p1=0 requests a model whose terms are all 0')
    return unit.model.replace(unit.parts['state']['tracking']['pointing'], arguments, unit.now, unit.utc)


def _command_alarm(unit: 'Acu', command: Command, arguments: Arguments) -> Reply:
    """Call the method of the AlarmDesk that has the name of the command."""
    return getattr(unit.desk, command.verb)(unit.parts['state'], *arguments.values())


EXECUTORS: dict[str, Executor] = {
    **dict.fromkeys(MODES, _enter_mode),
    'elements': _take_elements,
    'fallback': _choose_fallback,
    'offset': _shift_tables,
    'pointing': _replace_model,
    'take': lambda unit, command, arguments: unit.authority.take(command.who, arguments['role']),
    'release': lambda unit, command, arguments: unit.authority.release(),
    **dict.fromkeys(('acknowledge', 'shelve', 'unshelve'), _command_alarm),
    'reset': lambda unit, command, arguments: unit.reset(),
}
"""{verb: function (unit.Acu, Command, its arguments by name) that returns the Reply}."""
