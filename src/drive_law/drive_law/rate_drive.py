"""Base of the units of drives that follow rates: link to the control unit, requests, state and diagnosis."""
import json
import math
import os
import pathlib
from collections.abc import Mapping
from typing import NamedTuple

from drive_law import drive_state, faults, stow_pins
from drive_law.params import AduNodeParameters
from pedestal_common.compiled import compiled
from pedestal_common.graph import topics
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis, Unit
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import AnyRecord, Bit, Floats, Message, Nanoseconds, Radians, Records, Seconds, Vector3
from pedestal_common.record import Record
from pedestal_common.wire.commands import Reply
from pedestal_common.wire.records import NO_STAMP

CLOCK_TOPIC, RATE_COMMAND_TOPIC, SHIP_TRUTH_TOPIC = 'clock', 'acu/rate_command', 'ship/truth'
JOINT_STATES_TOPIC, MOTOR_STATES_TOPIC, DRIVE_TRUTH_TOPIC = 'joint_states', 'adu/motor_states', 'adu/truth'
DRIVE_STATE_TOPIC, PIN_STATES_TOPIC, PIN_COMMAND_TOPIC = 'adu/state', 'adu/stow_pins', 'acu/stow_pins'

INVALID_INPUT_TOPICS = ('', RATE_COMMAND_TOPIC, SHIP_TRUTH_TOPIC)
"""Topics that can hold an invalid input; `invalid` of Link is an index of this tuple."""
INVALID_COMMAND, INVALID_TRUTH = 1, 2  # indices of these topics; index 0: no invalid input


class Link(Record, align=False):
    """State of the link to other nodes."""
    stamp: Nanoseconds          # of the last step
    command_stamp: Nanoseconds  # of the last command
    truth_stamp: Nanoseconds    # of the last message of ship/truth with a finite rate
    deck_rate: Vector3          # in this message, FLU [rad/s]
    timeout: Nanoseconds        # age at which a command is stale
    period: Nanoseconds         # T
    stale: Bit                  # 1 while the command is stale
    invalid: int                # index of INVALID_INPUT_TOPICS: topic with an invalid input since the last diagnosis


def initial_link(parameters: AduNodeParameters) -> Records:
    """Return the Link (1,) before the first step."""
    return Link.of(stamp=NO_STAMP, command_stamp=NO_STAMP, truth_stamp=NO_STAMP,
                   timeout=round(parameters.command_timeout * parameters.period * 1e9),
                   period=round(parameters.period * 1e9))


@compiled
def supervise(drive_inputs: drive_state.Inputs, link: Link) -> None:
    """Stop the axes if the command is stale at the stamp of the last step."""
    link.stale = link.command_stamp == NO_STAMP or link.stamp - link.command_stamp > link.timeout
    drive_inputs.enable = 0 if link.stale else 1


@compiled
def take_command(drive_inputs: drive_state.Inputs, link: Link, command: AnyRecord) -> None:
    """Write a record of acu/rate_command into the inputs of the drive, and stop the axes if the newest command is
    stale. The record has the stamp NO_STAMP if the step had no command."""
    if command.stamp != NO_STAMP:
        link.command_stamp = command.stamp
        drive_inputs.azimuth.rate, drive_inputs.elevation.rate = command.velocity[0], command.velocity[1]
        drive_inputs.azimuth.torque, drive_inputs.elevation.torque = command.effort[0], command.effort[1]
    supervise(drive_inputs, link)


@compiled
def encode_measured(drive_outputs: drive_state.Outputs, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Write the measured outputs of the drive into the records of its messages."""
    joints, motors = outputs[JOINT_STATES_TOPIC], outputs[MOTOR_STATES_TOPIC]
    joints.stamp = motors.stamp = outputs[CLOCK_TOPIC].stamp = stamp
    for i in range(2):
        axis = drive_outputs.azimuth if i == 0 else drive_outputs.elevation
        joints.position[i], joints.velocity[i], joints.effort[i] = axis.position, axis.velocity, axis.torque
        for j in range(2):
            motors.position[2 * i + j] = axis.motor_position[j]
            motors.velocity[2 * i + j] = axis.motor_velocity[j]
            motors.effort[2 * i + j] = axis.motor_torque[j]
    outputs[DRIVE_STATE_TOPIC] = drive_outputs.condition


class PlantState(NamedTuple):
    """State of the plant that a restart keeps in a file: a drive resumes there instead of at its initial angles."""
    azimuth: Radians        # of the load, whole turns included
    elevation: Radians
    enabled: bool           # True if the drive followed commands, or was about to follow them
    pinned: bool = False    # True if a stow pin was not out


def read_plant_state(path: str) -> PlantState | None:
    """Return the state in a file, or None if there is no file. Raises ParameterError for invalid content."""
    try:
        values = json.loads(pathlib.Path(path).read_text())
        state = PlantState(float(values['azimuth']), float(values['elevation']), values['enabled'] is True,
                           values.get('pinned') is True)
        if not math.isfinite(state.azimuth + state.elevation):
            raise ValueError('an angle is not finite')
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ParameterError(f"state_file = '{path}': holds no state of a drive ({error}); move it away to start at "
                             'initial_azimuth and initial_elevation') from None
    return state


def write_plant_state(path: str, state: PlantState) -> None:
    """Replace a file by one with a state, in one operation. Raises OSError if the disk refuses it."""
    new = f'{path}.new'
    with open(new, 'w') as file:
        json.dump(state._asdict(), file)
    os.replace(new, path)


class RateDrive(Unit):
    """Unit of a drive. Its record has the parts of drive_state and a Link."""
    COMMAND, REQUESTS = RATE_COMMAND_TOPIC, tuple(drive_state.REQUEST_CODES)
    parameters: AduNodeParameters

    def read(self) -> None:
        """Write the present outputs, between two steps."""
        raise NotImplementedError

    def resume(self, state: PlantState) -> None:
        """Restore the state before a restart, before the first step."""
        raise NotImplementedError

    def latency(self, topic: str) -> Seconds:
        """Return the age of the command in a step: one period."""
        return self.parameters.period

    @property
    def rests(self) -> bool:
        """True if the brakes hold the axes and the motors make no torque."""
        return bool(self.parts['outputs']['phase'] == drive_state.PHASE_DISABLED)

    def plant_state(self) -> PlantState:
        """Return the state of the plant for `resume`."""
        o = self.parts['outputs']
        enabled = o['wanted'] and not (o['emergency'] or self.tripped)
        pinned = not stow_pins.pins_out(self.parts['state']['pins'])
        azimuth, elevation = (float(o[axis]['position']) for axis in topics.AXES)
        return PlantState(azimuth, elevation, bool(enabled), pinned)

    def encode(self, topic: str, code: int) -> str | Message:
        """Return the text of a code of adu/state, or of another topic as in Unit."""
        return drive_state.state_text(code) if topic == DRIVE_STATE_TOPIC else super().encode(topic, code)

    @property
    def tripped(self) -> bool:
        """True if an axis has a fault that stops the drive."""
        return any(faults.stops(int(self.parts['outputs'][axis]['faults'])) for axis in topics.AXES)

    @property
    def condition(self) -> str:
        """Present text of adu/state, also between two steps."""
        return drive_state.state_text(int(self.parts['outputs']['condition']))

    def request(self, name: str) -> Reply:
        """Execute one of REQUESTS. Return the Reply with the resulting state, and the reason for a refusal."""
        answer = drive_state.request(self.parts['state'], self.parts['constants'], drive_state.REQUEST_CODES[name])
        self.read()
        granted = answer == drive_state.REPLY_ACCEPTED
        refusal = '' if granted else f'refused: {drive_state.REFUSAL_REASONS[answer]}; '
        return Reply(granted, f'{refusal}drive is {self.condition}')

    def requests_for(self, topic: str, text: str) -> list[str]:
        """Return the services that bring the drive to a text of adu/state, in the order of their calls."""
        o = self.parts['outputs']
        tripped, stopped = 'fault' in text, 'emergency stop' in text
        latched = o['emergency'] or self.tripped
        wanted = {'adu/emergency_stop': stopped and not o['emergency'],
                  'adu/reset_faults': latched and not tripped and not stopped,
                  'adu/disable': text in ('stopping', 'disabled') and o['wanted'],
                  'adu/enable': text in ('releasing brakes', *topics.ENABLED_STATES) and not o['wanted']}
        return [service for service, due in wanted.items() if due]

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis; an invalid input appears once."""
        outputs, link = self.parts['outputs'], self.parts['link']
        invalid, link['invalid'] = INVALID_INPUT_TOPICS[link['invalid']], 0
        axes = {axis: outputs[axis] for axis in topics.AXES}
        values = [(f'{name} {mark}', '1' if axis[mark] else '0') for name, axis in axes.items()
                  for mark in ('torque_limited', 'voltage_limited', 'end_stop', 'stopping')]
        values += [(f'{name} faults', ', '.join(faults.names(axis['faults']))) for name, axis in axes.items()]
        values += [(f'{name}_motor_{i} thermal_load', f'{load:.3f}') for name, axis in axes.items()
                   for i, load in enumerate(axis['thermal_load'], 1)]
        values += [('state', self.condition), ('phase', drive_state.PHASES[outputs['phase']]),
                   ('brakes', 'on' if outputs['braked'] else 'off')]
        if self.parameters.stow_pins:
            values.append(('stow_pins', self.encode(PIN_STATES_TOPIC, int(outputs['pins']))))
        if outputs['emergency'] or self.tripped:
            return Diagnosis(LEVEL_ERROR, self.condition, values)
        if invalid:
            rate, torque = drive_state.MAX_PLAUSIBLE_INPUT, drive_state.MAX_PLAUSIBLE_TORQUE_NM
            return Diagnosis(LEVEL_ERROR, f'{invalid} holds NaN or infinity, or is not within +-{rate:g} rad/s or '
                             f'+-{torque:g} Nm: stopping', values)
        if link['stale']:
            return Diagnosis(LEVEL_ERROR, f'no new {RATE_COMMAND_TOPIC} for {link["timeout"] / 1e9:g} s: stopping',
                             values)
        if self.condition != 'enabled':
            return Diagnosis(LEVEL_WARN, self.condition, values)
        if any(axis['end_stop'] for axis in axes.values()):
            return Diagnosis(LEVEL_WARN, 'at an end stop', values)
        hottest = max(axis['thermal_load'].max() for axis in axes.values())
        if hottest > faults.WARNING_THERMAL_LOAD:
            return Diagnosis(LEVEL_WARN, f'a motor is at {100.0 * hottest:.0f} % of its thermal load', values)
        return Diagnosis(LEVEL_OK, 'following', values)

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once."""
        outputs, link = self.parts['outputs'], self.parts['link']
        return (outputs['emergency'], link['stale'], link['invalid'], outputs['azimuth']['faults'],
                outputs['elevation']['faults'])

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return the reason why a recording does not exercise the drive, '' if it does."""
        rates = numbers[RATE_COMMAND_TOPIC][:, 2:4]     # The rates stand after the two positions.
        return '' if (rates != 0.0).any() else 'no rate was ever commanded'
