"""Execution of the requests of services and of the commands on acu/command: for each verb a function in EXECUTORS.

A refusal states the reason and changes nothing. A function raises ValueError for wrong arguments.
"""
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from acu_tracker import control_unit, modes, signals
from acu_tracker.alarms import annunciator, machine, table
from acu_tracker.command_table import Arguments, points
from acu_tracker.geometry import direction
from acu_tracker.guidance import manual
from acu_tracker.operating import refusals
from acu_tracker.servo import excitation, position_loop
from acu_tracker.unit_law import DRIVE_STATE_TOPIC
from pedestal_common.graph.modes import MODE_ROWS, MODES
from pedestal_common.graph.topics import AXES
from pedestal_common.multisine import Sweep
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import AnyRecord, Nanoseconds, Radians, RadiansPerSecond, Seconds
from pedestal_common.wire.commands import ASK_REFUSAL, HELD_REFUSAL, Command, Reply, program_of

if TYPE_CHECKING:
    from acu_tracker.unit import Acu

# Commands and services that are open to every client at any time.
UNRESTRICTED_COMMANDS = ('standby', 'stop', 'acu/standby', 'acu/stop')


# Modes of a pass. `slave` is not one of them: a program that moves the antenna of a ship leaves it in this mode.
PASS_MODES = tuple(row.name for row in MODE_ROWS if row.follows and row.name != 'slave')

REQUEST_TIME_NS = 60_000_000_000  # time for which the diagnostics name a program that has requested control


class Authority:
    """Control of the antenna: it belongs to at most one client.

    While a client holds control, the control unit refuses the commands of other clients, except those that stop the
    antenna. While control is free, every client may send any command, except a program that has requested control
    in a pass, or while another client held it. An operator must allow this program.
    """
    holder = ''     # name of the client that holds control; '' while control is free

    def __init__(self) -> None:
        self._allowed = self._requester = ''    # programs: that may take control in a pass; of the last request
        self._refused: set[str] = set()         # programs whose request was refused, and that were not allowed since
        self._requested_at: Nanoseconds = 0

    def admit(self, command: Command) -> None:
        """Raise ValueError for a Command from a client that does not hold control. The command of a mode by another
        client ends what an operator has allowed a program."""
        program = program_of(command.who)
        if command.who != self.holder and command.verb not in (*UNRESTRICTED_COMMANDS, 'take'):
            if self.holder:
                raise ValueError(f'{HELD_REFUSAL} {self.holder}')
            if program in self._refused:
                raise ValueError(f'{ASK_REFUSAL} {program}')
        if command.verb.removeprefix('acu/') in MODES and program != self._allowed:
            self._allowed = ''

    def take(self, who: str, role: str, mode: str, now: Nanoseconds) -> Reply:
        """Give control to the client `who`; raise ValueError if another one holds it and `role` is not supervisor, or
        if `role` is program and the antenna is not free for this program."""
        if not who:
            raise ValueError('a client that takes control must have a name')
        program, held = program_of(who), self.holder not in ('', who)
        if role == 'program' and program != self._allowed and (held or mode in PASS_MODES):
            self._refused.add(program)
            self._requester, self._requested_at = program, now
            raise ValueError(f'{ASK_REFUSAL} {program}: ' + (f'{HELD_REFUSAL} {self.holder}' if held else
                                                             f'the antenna is in {mode}'))
        if held and role == 'operator':
            raise ValueError(f'{HELD_REFUSAL} {self.holder}')
        self._refused.discard(program)
        if program == self._requester:
            self._requester = ''
        before, self.holder = self.holder, who
        return Reply(True, f'control is with {who}' + (f', taken from {before}' if before not in ('', who) else ''))

    def requester(self, now: Nanoseconds) -> str:
        """Return the name of the program that has requested control within REQUEST_TIME_NS, '' for none."""
        return self._requester if now - self._requested_at < REQUEST_TIME_NS else ''

    def allow(self, program: str) -> Reply:
        """Allow a program to take control, in a pass and from another client; '': the last that requested it."""
        program = program or self._requester
        if not program:
            raise ValueError('no program has requested control; client must be its name, such as '
                             "'rotctld 4533 from 127.0.0.1'")
        self._allowed, self._requester = program, ''
        self._refused.discard(program)
        return Reply(True, f'{program} may take control')

    def release(self) -> Reply:
        """Release control."""
        before, self.holder = self.holder, ''
        return Reply(True, f'control released by {before}' if before else 'control was already free')


class AlarmDesk:
    """Commands of an operator to single alarms; each method has the name of its command.

    The argument `state` is the control_unit.State. An unknown alarm raises ValueError.
    """
    def __init__(self) -> None:
        self.reasons: dict[int, str] = {}   # {index of a shelved alarm: reason for shelving}

    def prepare(self, state: AnyRecord) -> None:
        """Compile the functions behind the commands. The state changes; the caller restores it."""
        self.acknowledge(state)
        self.shelve(state, table.ALARM_NAMES[0], 1.0, 'none')
        self.unshelve(state, table.ALARM_NAMES[0])
        self.reasons.clear()

    def acknowledge(self, state: AnyRecord, name: str = '') -> Reply:
        """Acknowledge an alarm and its consequences; name '': every alarm."""
        chosen = [_index(name)] if name else range(annunciator.ALARM_COUNT)
        done = sum([annunciator.acknowledge(state['supervision']['alarms'], i, state['stamp']) for i in chosen])
        return Reply(done > 0, 'acknowledged' if done else 'refused: no alarm waits for an acknowledgement')

    def shelve(self, state: AnyRecord, name: str, seconds: Seconds, reason: str) -> Reply:
        """Shelve an alarm for some seconds, for a reason."""
        i = _index(name)
        self.reasons[i] = reason
        annunciator.shelve(state['supervision']['alarms'], i, state['stamp'], seconds)
        return Reply(True, f'{table.ALARM_NAMES[i]} is shelved for {seconds:g} s: {reason}')

    def unshelve(self, state: AnyRecord, name: str) -> Reply:
        """End the shelving of an alarm."""
        i = _index(name)
        if annunciator.apply_event(state['supervision']['alarms'], i, machine.Event.UNSHELVE, state['stamp']):
            return Reply(True, f'{table.ALARM_NAMES[i]} is no longer shelved')
        return Reply(False, f'refused: {table.ALARM_NAMES[i]} is not shelved')


def _index(name: str) -> int:
    name = name.replace('_', ' ')
    if name not in table.ALARM_INDEX:
        raise ValueError(f'alarm = {name!r}:{did_you_mean(name, table.ALARM_NAMES)} must be one of '
                         f'{", ".join(table.ALARM_NAMES)}')
    return table.ALARM_INDEX[name]


def request(unit: 'Acu', name: str) -> Reply:
    """Return the Reply to a request of a service: the name of a mode, acknowledge or reset_faults."""
    if name == 'reset_faults':
        return reset(unit)
    if name == 'acknowledge':
        return unit.desk.acknowledge(unit.parts['state'])
    parts, outputs = unit.parts, unit.parts['outputs']
    if unit.silent and name != 'standby':
        return Reply(False, f'refused: {refusals.SILENCE_REFUSAL}; mode is {MODES[outputs["mode"]]}')
    parts['inputs']['drive_ready'] = unit.inputs[0][DRIVE_STATE_TOPIC] <= signals.DRIVE_READY
    code = MODES.index(name)
    granted = control_unit.request(parts['state'], parts['constants'], parts['inputs'], outputs, unit.memory.tables,
                                   code)
    refusal = '' if granted else f'refused: {refusals.of_mode(unit, code, outputs["reason"])}; '
    return Reply(bool(granted), f'{refusal}mode is {MODES[outputs["mode"]]}')


def reset(unit: 'Acu') -> Reply:
    """Reset the latched alarms and faults, and request the reset of a drive in fault; return the Reply.

    The reset is refused while the cause of one of them is present. The control unit does not reset an emergency stop
    of the drive: only an operator does, at adu/reset_faults.
    """
    cause = control_unit.reset(unit.parts['state'])
    if unit.drive_state.startswith('fault'):
        unit.reset_stamp = float(unit.parts['state']['stamp'])
    if cause != annunciator.NO_ALARM:
        return Reply(False, f'refused: the cause of {table.ALARM_NAMES[cause]} is still there')
    if not unit.drive_state.startswith(('fault', 'emergency stop')):
        return Reply(True, 'cleared')
    tripped = unit.drive_state.startswith('fault')
    return Reply(True, f'the ACU is reset, the drive is not yet: {unit.drive_state}; '
                 + ('its reset is requested, `pedestal drive reset_faults` shows its reply' if tripped else
                    'only `pedestal drive reset_faults` ends an emergency stop'))


def _rates(arguments: Arguments) -> list[RadiansPerSecond]:
    return [arguments[f'{axis}_rate'] for axis in AXES]


def _take_preset(unit: 'Acu', arguments: Arguments) -> None:
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
    state = unit.parts['state']
    manual.request_rates(state['guidance']['manual'], [arguments[axis] for axis in AXES], state['stamp'])


def _take_slave(unit: 'Acu', arguments: Arguments) -> None:
    state = unit.parts['state']
    slave = state['guidance']['slave']
    direction.set_moving(slave, state['stamp'], [arguments[axis] for axis in AXES], _rates(arguments),
                         arguments['moves'], arguments['holds'])
    unit.followed.bend(unit.parts, slave.copy())


def _take_tle(unit: 'Acu', arguments: Arguments) -> None:
    if any(arguments.values()):
        _predict_by(unit, *arguments.values())


def _predict_by(unit: 'Acu', line_1: str, line_2: str, omm: str) -> None:
    # In the lines of a TLE _ stands for a blank.
    followed = unit.followed
    followed.predict_by(followed.predictor.with_elements(line_1.replace('_', ' '), line_2.replace('_', ' '), omm))
    unit.update_tables()


# {mode: function that takes the arguments of its command}
ARGUMENT_SETTERS = {'preset': _take_preset, 'rate': _take_rate, 'slave': _take_slave, 'tle': _take_tle}


def _enter_mode(unit: 'Acu', command: Command, arguments: Arguments) -> Reply:
    # The request needs the new arguments, because it judges the direction to which the mode would point. A refusal
    # restores them.
    guidance, followed = unit.parts['state']['guidance'], unit.followed
    predictor, slave = followed.predictor, followed.slave
    before = {name: guidance[name].copy() for name in ('preset', 'manual', 'slave')}
    if command.verb in ARGUMENT_SETTERS:
        ARGUMENT_SETTERS[command.verb](unit, arguments)
    reply = request(unit, command.verb)
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


def _excite(unit: 'Acu', _: Command, arguments: Arguments) -> Reply:
    state, name, peak = unit.parts['state'], arguments['axis'], arguments['peak']
    axis, mode = getattr(unit.parameters, name), MODES[unit.parts['outputs']['mode']]
    if mode not in excitation.EXCITED_MODES or axis.controller == position_loop.CONTROLLERS[-1]:
        return Reply(False, f'refused: mode is {mode}, must be one of {", ".join(excitation.EXCITED_MODES)}, and the '
                     'axis must have motors')
    if state['excitation']['count']:
        return Reply(False, 'refused: an excitation is running; a mode ends it')
    if peak > excitation.MAX_PEAK_SHARE * axis.limits.rate:
        raise ValueError(f'excite: peak = {peak:g} rad/s: must be at most {excitation.MAX_PEAK_SHARE:g} of '
                         f'{name}.limits.rate, {excitation.MAX_PEAK_SHARE * axis.limits.rate:g} rad/s')
    period, lowest, highest, points = (arguments[key] for key in ('period', 'lowest', 'highest', 'points'))
    sweep = Sweep(period, lowest, highest, round(points), 0, 1, peak)
    excitation.begin(state['excitation'], AXES.index(name), sweep, unit.parameters.period, arguments['duration'],
                     float(state['stamp']))
    return Reply(True, f'{name} is excited with {peak:g} rad/s for {arguments["duration"]:g} s')


def _command_alarm(unit: 'Acu', command: Command, arguments: Arguments) -> Reply:
    return getattr(unit.desk, command.verb)(unit.parts['state'], *arguments.values())


Executor: TypeAlias = Callable[['Acu', Command, Arguments], Reply]

EXECUTORS: dict[str, Executor] = {      # by verb of command_table.ACU_COMMANDS
    **dict.fromkeys(MODES, _enter_mode),
    'elements': _take_elements,
    'fallback': _choose_fallback,
    'offset': _shift_tables,
    'pointing': _replace_model,
    'excite': _excite,
    'take': lambda unit, command, arguments: unit.authority.take(
        command.who, arguments['role'], MODES[unit.parts['outputs']['mode']], unit.now),
    'allow': lambda unit, command, arguments: unit.authority.allow(arguments['client']),
    'release': lambda unit, command, arguments: unit.authority.release(),
    **dict.fromkeys(('acknowledge', 'shelve', 'unshelve'), _command_alarm),
    'reset': lambda unit, command, arguments: reset(unit),
}
