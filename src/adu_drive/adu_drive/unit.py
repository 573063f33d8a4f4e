"""Unit of the drive: its step between the messages of the graph, without ROS. `adu_node` runs it.

Inputs are rate commands and the motion of the ship. Outputs are encoders, motor states, and the state with its faults.
"""
import dataclasses
import functools
import math
import typing
from collections.abc import Iterable, Mapping

from adu_drive import drive_state, drive_unit, injected, lanes, state_file, stow_pins
from adu_drive.controller import faults
from adu_drive.params import AduNodeParameters
from adu_drive.plant.motors import WARNING_THERMAL_LOAD
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Bit, Floats, Message, Nanoseconds, Records, Seconds, Stamps, Vector3
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


MAX_CATCH_UP_NS = 2_000_000_000
"""Longest time of missed steps that the drive makes later [ns]. Axes without commands stop within this time."""


class DriveRecord(Record):
    """All data of a drive."""
    state: drive_unit.State
    constants: drive_unit.Constants
    inputs: drive_unit.Inputs
    outputs: drive_unit.Outputs
    link: Link
    schedule: schedule.Schedule         # of the injected faults
    injected: injected.DriveInjected    # those in force


class Memory(typing.NamedTuple):
    """Memory of the drive."""
    record: Records         # DriveRecord (1,)


@compiled
def deck_acceleration(drive_inputs: drive_unit.Inputs, link: Link, ship: AnyRecord) -> None:
    """Set rate and angular acceleration of the deck in the inputs of the drive.

    The acceleration is the difference of two successive messages of ship/truth, divided by that of their stamps.
    """
    w, last = ship.twist_angular, link.truth_stamp
    if last != NO_STAMP and ship.stamp > last:
        for i in range(3):
            drive_inputs.base_acceleration[i] = (w[i] - link.deck_rate[i]) / ((ship.stamp - last) * 1e-9)
    if math.isfinite(w[0]) and math.isfinite(w[1]) and math.isfinite(w[2]) and ship.stamp != last:
        link.truth_stamp = ship.stamp
        for i in range(3):
            link.deck_rate[i] = drive_inputs.base_rate[i] = w[i]


@compiled
def supervise(drive_inputs: drive_unit.Inputs, link: Link) -> None:
    """Stop the axes if the command is stale at the stamp of the last step."""
    link.stale = link.command_stamp == NO_STAMP or link.stamp - link.command_stamp > link.timeout
    drive_inputs.enable = 0 if link.stale else 1


@compiled
def take_command(drive_inputs: drive_unit.Inputs, link: Link, command: AnyRecord) -> None:
    """Write a command into the inputs of the drive, and stop the axes if the newest command is stale.

    command: record of acu/rate_command, with stamp NO_STAMP if the step had no command.
    """
    if command.stamp != NO_STAMP:
        link.command_stamp = command.stamp
        drive_inputs.azimuth.rate, drive_inputs.elevation.rate = command.velocity[0], command.velocity[1]
        drive_inputs.azimuth.torque, drive_inputs.elevation.torque = command.effort[0], command.effort[1]
    supervise(drive_inputs, link)


@compiled
def decode(drive_inputs: drive_unit.Inputs, link: Link, dropped: Bit, command: AnyRecord, ship: AnyRecord) -> None:
    """Write the messages of the last step into the inputs of the drive.

    dropped: 1 if an injected fault removes the command; command, ship: records of acu/rate_command and ship/truth,
    with stamp NO_STAMP if the step had no such message.
    """
    if dropped == 0:
        take_command(drive_inputs, link, command)
    else:
        supervise(drive_inputs, link)
    if ship.stamp != NO_STAMP:
        deck_acceleration(drive_inputs, link, ship)


@compiled
def record_invalid_topic(drive_inputs: drive_unit.Inputs, link: Link) -> None:
    """Store the topic of an invalid input: ship/truth if the deck acceleration is invalid, else the command."""
    deck = drive_inputs.base_acceleration
    valid = max(abs(deck[0]), abs(deck[1]), abs(deck[2])) <= drive_unit.MAX_PLAUSIBLE_INPUT
    link.invalid = INVALID_COMMAND if valid else INVALID_TRUTH


@compiled
def encode_truth(drive_outputs: drive_unit.Outputs, stamp: Nanoseconds, truth: AnyRecord) -> None:
    """Write the true angles and rates of the beam into the record of adu/truth, with a stamp."""
    truth.stamp = stamp
    for i in range(2):
        axis = drive_outputs.azimuth if i == 0 else drive_outputs.elevation
        truth.position[i], truth.velocity[i] = axis.load_position, axis.load_velocity


@compiled
def encode_measured(drive_outputs: drive_unit.Outputs, stamp: Nanoseconds, outputs: AnyRecord) -> None:
    """Write the measured outputs of the drive into the records of its messages, with a stamp."""
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


@compiled
def receive(drive: DriveRecord, stamp: Nanoseconds, inputs: AnyRecord) -> bool:
    """Take the messages of step k - 1. Return False in the first step, which has none. stamp: t_k."""
    if drive.link.stamp == NO_STAMP:
        drive.state.k = stamp // drive.link.period
        return False
    decode(drive.inputs, drive.link, drive.injected.message_fault.drop, inputs[RATE_COMMAND_TOPIC],
           inputs[SHIP_TRUTH_TOPIC])
    drive.inputs.pins = inputs[PIN_COMMAND_TOPIC]
    return True


@compiled
def report(drive: DriveRecord, stamp: Nanoseconds, moved: bool, outputs: AnyRecord) -> None:
    """Write the messages of the drive at t_k. moved: result of `receive`, False in the first step."""
    if moved and drive.outputs.invalid_command:
        record_invalid_topic(drive.inputs, drive.link)
    drive.link.stamp = stamp
    encode_measured(drive.outputs, stamp, outputs)
    encode_truth(drive.outputs, stamp, outputs[DRIVE_TRUTH_TOPIC])
    outputs[PIN_STATES_TOPIC] = drive.outputs.pins


@compiled
def advance_missed_steps(drive: DriveRecord, stamp: Nanoseconds) -> None:
    """Make the steps that a late node in realtime missed before a stamp, at most those of MAX_CATCH_UP_NS.

    Because a real antenna moves on while its simulation is late, these steps use the last command until it is stale.
    """
    missed = 0
    if drive.link.stamp != NO_STAMP:
        missed = min(stamp - drive.link.stamp, MAX_CATCH_UP_NS) // drive.link.period - 1
    for _ in range(missed):
        supervise(drive.inputs, drive.link)
        drive_unit.step(drive.state, drive.constants, drive.inputs, drive.outputs)
        drive.link.stamp += drive.link.period


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Advance from t_k-1 to t_k with the messages of step k - 1."""
    drive = memory.record[0]
    advance_missed_steps(drive, stamp)
    if schedule.pending(drive.schedule, stamp):
        injected.apply_due_faults(drive, stamp)
    moved = receive(drive, stamp, inputs)
    if moved:
        drive_unit.step(drive.state, drive.constants, drive.inputs, drive.outputs)
    report(drive, stamp, moved, outputs)
    if drive.schedule.pending != 0:
        injected.corrupt_messages(drive.injected, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Apply `law` to each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


LANE_FLAGS = {'uneven': 0, 'toothless': 0, 'stuck': 0, 'exact': 1}
"""Flags of DriveRecord that a drive needs on lanes (lanes.py): its law then contains no sine.

These drives have gears and motors without unevenness, whole pinions, and encoders without errors. The processor has no
vector instruction for a sine.
"""

DRIVE_LANES = lanes.view(DriveRecord.dtype, LANE_FLAGS)
"""Function for compiled code that gives the drives in a flat array of lanes.to_lanes."""


@compiled
def law_of_lanes(drives: DriveRecord, stamp: Nanoseconds, inputs: Records, outputs: Records) -> None:
    """Apply `law` to the first len(inputs) drives of DRIVE_LANES.

    Each drive fits lanes (Adu.fits_lanes), and all drives are at the same step.
    """
    moved = False
    for i in range(len(inputs)):
        drive = lanes.at(drives, i)
        drive.schedule.stamp = stamp
        moved = receive(drive, stamp, inputs[i])
    if moved:
        drive_unit.step(drives.state, drives.constants, drives.inputs, drives.outputs)
    for i in range(len(inputs)):
        report(lanes.at(drives, i), stamp, moved, outputs[i])


@functools.lru_cache(1)
def _initial(parameters: AduNodeParameters) -> Records:
    """Return the DriveRecord (1,) of a drive before its first step, cached for trials with the same drive."""
    link = Link.of(stamp=NO_STAMP, command_stamp=NO_STAMP, truth_stamp=NO_STAMP,
                   timeout=round(parameters.command_timeout * parameters.period * 1e9),
                   period=round(parameters.period * 1e9))
    record = DriveRecord.of(state=drive_unit.initial_state(parameters), constants=drive_unit.constants(parameters),
                            link=link, schedule=schedule.empty())
    drive_unit.read(*(record[0][name] for name in ('state', 'constants', 'outputs')))
    return record


class Adu(Simulated):
    """Unit of the drive, from AduNodeParameters."""
    NODE, COMMAND, LAWS = nodes.row(nodes.DRIVE_NODE), RATE_COMMAND_TOPIC, {Memory: (law, laws)}
    REQUESTS, VERBS = tuple(drive_state.REQUEST_CODES), table.INJECT_COMMANDS[NODE.name]
    parameters: AduNodeParameters
    memory: Memory

    def __init__(self, parameters: AduNodeParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.memory = Memory(_initial(parameters).copy())

    def latency(self, topic: str) -> Seconds:
        """Return the age of the command in a step: one period."""
        return self.parameters.period

    @property
    def fits_lanes(self) -> bool:
        """True if the drive can run on lanes: it has the flags of LANE_FLAGS and no injected fault."""
        axes = [self.parts[part][axis] for part in ('state', 'constants') for axis in topics.AXES]
        flags = [flags[name] == value for name, value in LANE_FLAGS.items()
                 for flags in (*axes, *(c['encoder'] for c in axes[2:])) if name in flags.dtype.names]
        return all(flags) and not self.parameters.inject

    @property
    def rests(self) -> bool:
        """True if the brakes hold the axes and the motors make no torque."""
        return bool(self.parts['outputs']['phase'] == drive_state.PHASE_DISABLED)

    def resume(self, state: state_file.PlantState) -> None:
        """Restore the state of the plant before the first step: brakes on, then enabled if the state was enabled."""
        angles = {f'initial_{axis}': min(max(getattr(state, axis), limits.lower), limits.upper) for axis, limits in (
            (axis, getattr(self.parameters, axis).limits) for axis in topics.AXES)}
        pins = dataclasses.replace(self.parameters.pins, initially_in=state.pinned)
        parameters = dataclasses.replace(self.parameters, initially_enabled=False, **angles, pins=pins)
        self.memory.record['state'] = drive_unit.initial_state(parameters)
        self.parts['state']['wanted'] = state.enabled
        drive_unit.read(*(self.parts[name] for name in ('state', 'constants', 'outputs')))

    def plant_state(self) -> state_file.PlantState:
        """Return the state of the plant for `resume`."""
        o = self.parts['outputs']
        enabled = o['wanted'] and not (o['emergency'] or self.tripped)
        pinned = not stow_pins.pins_out(self.parts['state']['pins'])
        azimuth, elevation = (float(o[axis]['position']) for axis in topics.AXES)
        return state_file.PlantState(azimuth, elevation, bool(enabled), pinned)

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
        m = self.parts
        answer = drive_unit.request(m['state'], m['constants'], m['outputs'], drive_state.REQUEST_CODES[name])
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
        """Return the Diagnosis with limits, faults and thermal load of both axes; an invalid input appears once."""
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
            largest = f'{drive_unit.MAX_PLAUSIBLE_INPUT:g}'
            return Diagnosis(LEVEL_ERROR, f'{invalid} holds NaN or infinity, or is not within +-{largest}: stopping',
                             values)
        if link['stale']:
            return Diagnosis(LEVEL_ERROR, f'no new {RATE_COMMAND_TOPIC} for {link["timeout"] / 1e9:g} s: stopping',
                             values)
        if self.condition != 'enabled':
            return Diagnosis(LEVEL_WARN, self.condition, values)
        if any(axis['end_stop'] for axis in axes.values()):
            return Diagnosis(LEVEL_WARN, 'at an end stop', values)
        hottest = max(axis['thermal_load'].max() for axis in axes.values())
        if hottest > WARNING_THERMAL_LOAD:
            return Diagnosis(LEVEL_WARN, f'a motor is at {100.0 * hottest:.0f} % of its thermal load', values)
        return Diagnosis(LEVEL_OK, 'following', values)

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once: emergency stop, stale or invalid inputs, faults."""
        outputs, link = self.parts['outputs'], self.parts['link']
        return (outputs['emergency'], link['stale'], link['invalid'], outputs['azimuth']['faults'],
                outputs['elevation']['faults'])

    @staticmethod
    def idle(numbers: Mapping[str, Floats]) -> str:
        """Return the reason why a recording does not exercise the drive, '' if it does."""
        rates = numbers[RATE_COMMAND_TOPIC][:, 2:4]     # The rates stand after the two positions.
        return '' if (rates != 0.0).any() else 'no rate was ever commanded'
