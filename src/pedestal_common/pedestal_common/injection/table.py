"""Table of the faults that can be injected into simulated nodes. A fault is a command that a node accepts on its topic
`NODE/inject` and in its parameter `inject`, for example '12 encoder_jump axis=azimuth size=0.01 duration=5'."""
import typing

from pedestal_common.graph import nodes
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Nanoseconds
from pedestal_common.wire.commands import Argument, Command, CommandDefinition, schedule


class Fault(typing.NamedTuple):
    """Fault that can be injected into a simulated node; the first three fields define its command.

    A fault that deletes a message or changes its stamp would stop a lockstep graph. The faults `drop` and `delay` of
    the drive are allowed: each command arrives in its step, and the law of the drive then ignores or delays its
    content.
    """
    name: str
    doc: str
    arguments: tuple[Argument, ...] = ()
    lockstep: bool = True       # a lockstep graph can have the fault


MAX_FAULT_DURATION_S = 86400.0  # longest duration of a fault [s]; it also stands for a fault without an end

_DURATION = Argument('duration', 'duration; left out: to the end of the run', 1e-3, MAX_FAULT_DURATION_S, 's',
                     default=MAX_FAULT_DURATION_S)


def _fault(name: str, doc: str, *arguments: Argument, lockstep: bool = True) -> Fault:
    """Return a Fault with an argument `duration` added."""
    return Fault(name, doc, (*arguments, _DURATION), lockstep)


def _option(name: str, doc: str, *options: str) -> Argument:
    return Argument(name, doc, options=options, default=options[0])


def _number(name: str, doc: str, default: float, high: float, unit: str = '', low: float | None = None) -> Argument:
    """Return an Argument between -high and high, or between low and high."""
    return Argument(name, doc, -high if low is None else low, high, unit, default=default)


def _noise(default: float, high: float, unit: str) -> tuple[Argument, Argument]:
    return (_number('sigma', '1-sigma of each number', default, high, unit, low=0.0),
            _number('seed', 'seed of the noise', 1.0, 1e9, low=0.0))


_AXIS = _option('axis', 'axis of the pedestal', 'azimuth', 'elevation')
_MOTOR = _option('motor', 'motor of the axis', '1', '2')
_DECK_AXIS = _option('axis', 'axis of the deck, FLU', 'x', 'y', 'z')
_DELAY = _number('time', 'delay', 0.05, 0.1, 's', low=1e-3)
_CLOCK_OFFSET = _number('time', 'size of the clock step, positive: ahead', 0.1, 10.0, 's')

INJECTED_FAULTS = {
    'adu': (
        _fault('motor_loss', 'the inverter of a motor is off: no current, no torque', _AXIS, _MOTOR),
        _fault('encoder_jump', 'the angle of the load encoder jumps', _AXIS,
               _number('size', 'size of the jump', 0.01, 3.2, 'rad')),
        _fault('encoder_stuck', 'the load encoder repeats its last angle', _AXIS),
        _fault('brake_stuck', 'the brakes of an axis stay on or off, whatever the drive commands', _AXIS,
               _option('state', 'state of the brakes', 'on', 'off')),
        _fault('lost_tooth',
               'a tooth of a pinion is missing; at its place the mesh has half a pitch of play', _AXIS, _MOTOR,
               _number('teeth', 'teeth of the pinion', 17.0, 200.0, low=8.0)),
        _fault('gust', 'a torque on the load, without a ramp', _AXIS,
               _number('torque', 'torque on the axis', 2000.0, 1e5, 'Nm')),
        _fault('pin_stuck', 'a stow pin stays at its place', _AXIS),
        _fault('drop', 'the drive receives no commands'),
        _fault('delay', 'the drive receives commands late', _DELAY),
        _fault('freeze', '`joint_states` and `adu/motor_states` repeat their numbers with new stamps'),
        _fault('bias', 'the rate on `joint_states` is offset', _AXIS,
               _number('size', 'offset of the rate', 0.1, 3.0, 'rad/s')),
        _fault('nan', 'the numbers of `joint_states` are NaN'),
        _fault('noise', 'white noise on the angles of `joint_states`', *_noise(1e-3, 1.0, 'rad'))),
    'tracking_receiver': (
        _fault('drop', 'the receiver publishes no measurements', lockstep=False),
        _fault('delay', 'measurements are published late, with correct stamps', _DELAY, lockstep=False),
        _fault('freeze', 'measurements repeat their numbers with new stamps'),
        _fault('bias', 'the measured errors are offset',
               _number('cross_elevation', 'offset of the cross-elevation error', 0.002, 0.1, 'rad'),
               _number('elevation', 'offset of the elevation error', 0.0, 0.1, 'rad')),
        _fault('nan', 'the numbers of the measurements are NaN'),
        _fault('noise', 'white noise on the measured errors', *_noise(0.01, 1.0, 'rad')),
        _fault('fade', 'the carrier is weaker', _number('depth', 'loss of level', 30.0, 200.0, 'dB', low=0.0)),
        _fault('wrong_slope', 'the chosen difference channels have the wrong sign or slope, or both are turned',
               _option('axis', 'channel', 'both', 'cross_elevation', 'elevation'),
               _number('factor', 'slope of the chosen channels over their slope without the fault', -1.0, 5.0),
               _number('turn', 'angle by which the axes of the errors are turned', 0.0, 3.2, 'rad')),
        _fault('phase_180',
               'the phase of both difference channels against the sum channel is shifted by 180 deg, so both errors '
               'change their sign'),
        _fault('clock_step', 'the clock of the receiver steps: the stamps of the measurements are wrong',
               _CLOCK_OFFSET, lockstep=False)),
    'ship_motion': (
        _fault('drop', 'the IMU is silent', lockstep=False),
        _fault('freeze', 'the IMU repeats its numbers with new stamps'),
        _fault('bias', 'rate and specific force of the IMU are offset', _DECK_AXIS,
               _number('rate', 'offset of the rate', 0.01, 1.0, 'rad/s'),
               _number('force', 'offset of the specific force', 0.0, 20.0, 'm/s2')),
        _fault('nan', 'the numbers of the IMU are NaN, so that the INS publishes no attitude', lockstep=False),
        _fault('noise', 'white noise on the rates of the IMU', *_noise(0.05, 1.0, 'rad/s'))),
    'ins': (
        _fault('drop', 'the INS publishes no attitude', lockstep=False),
        _fault('delay', 'the attitude is published late, with correct stamps', _DELAY, lockstep=False),
        _fault('freeze', 'attitude and rate repeat their numbers with new stamps'),
        _fault('bias', 'the deck rate is offset', _DECK_AXIS,
               _number('rate', 'offset of the rate', 0.01, 1.0, 'rad/s')),
        _fault('nan', 'the numbers of the INS are NaN'),
        _fault('noise', 'white noise on the attitude', *_noise(0.01, 0.5, 'rad')),
        _fault('ins_jump', 'the attitude jumps, and jumps back at the end',
               _number('roll', 'jump of the roll', 0.0, 3.2, 'rad'),
               _number('pitch', 'jump of the pitch', 0.0, 1.6, 'rad'),
               _number('heading', 'jump of the heading, clockwise', 0.02, 3.2, 'rad')),
        _fault('clock_step', 'the clock of the INS steps: the stamps of the attitude are wrong', _CLOCK_OFFSET,
               lockstep=False))}
"""{node: its Faults}, by the names of nodes.NODES."""

CLEAR_COMMAND = CommandDefinition('clear', 'end all injected faults of the node')

INJECT_COMMANDS: dict[str, tuple[Fault | CommandDefinition, ...]] = {
    node: (*faults, CLEAR_COMMAND) for node, faults in INJECTED_FAULTS.items()}
"""{node: its commands on `NODE/inject`}."""

DRIVE_REQUESTS = tuple(CommandDefinition(row.service, row.doc) for row in nodes.DRIVE_REQUESTS)

MAX_FAULT_VALUES = max(len(fault.arguments) - 1 for faults in INJECTED_FAULTS.values() for fault in faults)
"""Largest number of arguments of a fault, without its last argument `duration`."""

INJECT_DOC = "faults injected at times [s]: 'AT FAULT argument=value ... duration=s; ...'; empty: none"
"""Meaning of the parameter `inject`."""


def code(node: str, name: str) -> int:
    """Return the code of a fault for compiled laws: its index among the faults of its node."""
    return [fault.name for fault in INJECTED_FAULTS[node]].index(name)


def scheduled_commands(node: str, text: str) -> list[tuple[Nanoseconds, Command]]:
    """Return the commands of the parameter `inject` of a node with their times, in order. Raises ParameterError."""
    requests = DRIVE_REQUESTS if node == nodes.DRIVE_NODE else ()
    return schedule('inject', text, (*INJECT_COMMANDS[node], *requests))


def check_pacing(node: str, text: str, lockstep: bool) -> None:
    """Raise ParameterError where `inject` of a node contains a fault that a lockstep graph cannot have."""
    for _, command in scheduled_commands(node, text) if lockstep else ():
        refusal = refused_in_lockstep(node, command.verb)
        if refusal:
            raise ParameterError(f'inject: {refusal}')


def refused_in_lockstep(node: str, name: str) -> str:
    """Return why a lockstep graph cannot have a fault of a node, '' for a fault that it can have."""
    fault = next((fault for fault in INJECTED_FAULTS[node] if fault.name == name), None)
    if fault is None or fault.lockstep:
        return ''
    return f'{name} of {node}: {fault.doc}; every lockstep node would wait, so this fault needs pacing realtime'
