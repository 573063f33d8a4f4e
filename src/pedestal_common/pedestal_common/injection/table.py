"""The faults that can be injected, as one table. No ROS here, nothing compiled.

A fault is a verb that a simulated node obeys on its topic `NODE/inject` and in its parameter `inject`, for example
'12 encoder_jump axis=azimuth size=0.01 duration=5'.
"""
import typing

from pedestal_common.parameters import ParameterError
from pedestal_common.wire.commands import Argument, CommandDefinition, schedule


class Fault(typing.NamedTuple):
    """A fault that a simulated node can be given: a commands.Verb.

    lockstep: whether a lockstep graph can have it; not where a message stays away or has another stamp, for which
    everybody would wait.
    """
    name: str
    doc: str
    arguments: tuple = ()
    lockstep: bool = True


MAX_FAULT_DURATION_S = 86400.0

_DURATION = Argument('duration', 'how long; left out: to the end', 1e-3, MAX_FAULT_DURATION_S, 's',
                     default=MAX_FAULT_DURATION_S)


def _fault(name, doc, *arguments, lockstep=True):
    """A Fault, of which every one has a duration."""
    return Fault(name, doc, (*arguments, _DURATION), lockstep)


def _option(name, doc, *options):
    return Argument(name, doc, options=options, default=options[0])


def _number(name, doc, default, high, unit='', low=None):
    """An Argument between -high and high, or low and high."""
    return Argument(name, doc, -high if low is None else low, high, unit, default=default)


def _noise(default, high, unit):
    return (_number('sigma', 'of each number', default, high, unit, low=0.0),
            _number('seed', 'of the noise', 1.0, 1e9, low=0.0))


_AXIS = _option('axis', 'of the pedestal', 'azimuth', 'elevation')
_MOTOR = _option('motor', 'of its axis', '1', '2')
_DECK_AXIS = _option('axis', 'of the deck, FLU', 'x', 'y', 'z')
_DELAY = _number('time', 'by which', 0.05, 0.1, 's', low=1e-3)
_CLOCK_OFFSET = _number('time', 'by which, positive ahead', 0.1, 10.0, 's')

INJECTED_FAULTS = {
    'adu': (
        _fault('motor_loss', 'the inverter of a motor is off: no current, no torque', _AXIS, _MOTOR),
        _fault('encoder_jump', 'the load encoder reads more', _AXIS, _number('size', 'by which', 0.01, 3.2, 'rad')),
        _fault('encoder_stuck', 'the load encoder stays at what it read last', _AXIS),
        _fault('brake_stuck', 'the brakes of an axis stay on or off, whatever the drive orders', _AXIS,
               _option('state', 'in which they stay', 'on', 'off')),
        _fault('lost_tooth', 'a tooth of a pinion is gone: half a pitch of play where it was', _AXIS, _MOTOR,
               _number('teeth', 'that the pinion had', 17.0, 200.0, low=8.0)),
        _fault('gust', 'a torque on the load, at once', _AXIS, _number('torque', 'on the axis', 2000.0, 1e5, 'Nm')),
        _fault('pin_stuck', 'a stow pin stays where it is', _AXIS),
        _fault('drop', 'commands do not reach it'),
        _fault('delay', 'commands reach it late', _DELAY),
        _fault('freeze', '`joint_states` and `adu/motor_states` keep their numbers under new stamps'),
        _fault('bias', 'the rate on `joint_states` is wrong', _AXIS, _number('size', 'by which', 0.1, 3.0, 'rad/s')),
        _fault('nan', 'the numbers of `joint_states` are NaN'),
        _fault('noise', 'white noise on the angles of `joint_states`', *_noise(1e-3, 1.0, 'rad'))),
    'tracking_receiver': (
        _fault('drop', 'its results do not come', lockstep=False),
        _fault('delay', 'its results come late, their stamps are right', _DELAY, lockstep=False),
        _fault('freeze', 'its results keep their numbers under new stamps'),
        _fault('bias', 'its errors are wrong', _number('cross_elevation', 'by which', 0.002, 0.1, 'rad'),
               _number('elevation', 'by which', 0.0, 0.1, 'rad')),
        _fault('nan', 'the numbers of its results are NaN'),
        _fault('noise', 'white noise on its errors', *_noise(0.01, 1.0, 'rad')),
        _fault('fade', 'the carrier is weaker', _number('depth', 'by which', 30.0, 200.0, 'dB', low=0.0)),
        _fault('wrong_slope', 'difference channels have the wrong sign',
               _option('axis', 'which of them', 'both', 'cross_elevation', 'elevation')),
        _fault('phase_180', 'the difference channels are turned by 180 deg against the sum'),
        _fault('clock_step', 'its clock steps: the stamps of its results are wrong', _CLOCK_OFFSET, lockstep=False)),
    'ship_motion': (
        _fault('drop', 'the IMU is silent', lockstep=False),
        _fault('freeze', 'the IMU keeps its numbers under new stamps'),
        _fault('bias', 'rate and specific force of the IMU are wrong', _DECK_AXIS,
               _number('rate', 'by which', 0.01, 1.0, 'rad/s'), _number('force', 'by which', 0.0, 20.0, 'm/s2')),
        _fault('nan', 'the numbers of the IMU are NaN'),
        _fault('noise', 'white noise on the rates of the IMU', *_noise(0.05, 1.0, 'rad/s'))),
    'ins': (
        _fault('drop', 'its attitude does not come', lockstep=False),
        _fault('delay', 'its attitude comes late, its stamps are right', _DELAY, lockstep=False),
        _fault('freeze', 'attitude and rate keep their numbers under new stamps'),
        _fault('bias', 'its deck rate is wrong', _DECK_AXIS, _number('rate', 'by which', 0.01, 1.0, 'rad/s')),
        _fault('nan', 'its numbers are NaN'),
        _fault('noise', 'white noise on its attitude', *_noise(0.01, 0.5, 'rad')),
        _fault('ins_jump', 'its attitude jumps, and back at the end', _number('roll', 'by which', 0.0, 3.2, 'rad'),
               _number('pitch', 'by which', 0.0, 1.6, 'rad'),
               _number('heading', 'by which, clockwise', 0.02, 3.2, 'rad')),
        _fault('clock_step', 'its clock steps: the stamps of its attitude are wrong', _CLOCK_OFFSET, lockstep=False))}
"""{node: its Faults}, by the names of nodes.NODES."""

CLEAR_COMMAND = CommandDefinition('clear', 'ends all faults of the node')

INJECT_COMMANDS = {node: (*faults, CLEAR_COMMAND) for node, faults in INJECTED_FAULTS.items()}
"""{node: what it obeys on `NODE/inject`}."""

MAX_FAULT_VALUES = max(len(fault.arguments) for faults in INJECTED_FAULTS.values() for fault in faults) - 1
"""Arguments of a fault beside its duration."""

INJECT_DOC = "faults injected at times [s]: 'AT FAULT argument=value ... duration=s; ...'; empty: none"
"""Of the parameter `inject`."""


def code(node, name) -> int:
    """The number of a fault among those of its node, for compiled laws."""
    return [fault.name for fault in INJECTED_FAULTS[node]].index(name)


def due(node, text) -> list:
    """[(at [ns], Command)] of the parameter `inject` of a node, in order of time. Raises ParameterError."""
    return schedule('inject', text, INJECT_COMMANDS[node])


def check_pacing(node, text, lockstep):
    """Raise ParameterError where `inject` of a node says what its graph cannot have."""
    refusals = [refused_in_lockstep(node, command.verb) for _, command in due(node, text)] if lockstep else ()
    for refusal in filter(None, refusals):
        raise ParameterError(f'inject: {refusal}')


def refused_in_lockstep(node, name) -> str:
    """Why a lockstep graph cannot have a fault of a node, '' where it can."""
    fault = next((fault for fault in INJECTED_FAULTS[node] if fault.name == name), None)
    if fault is None or fault.lockstep:
        return ''
    return f'{name} of {node}: {fault.doc}; in lockstep everybody would wait, it takes pacing realtime'
