"""Unit of the drive: its step between the messages of the graph, without ROS."""
import dataclasses
import functools
import math
import typing
from collections.abc import Iterable

from adu_drive import drive_unit, injected, lanes
from drive_law import drive_state, rate_drive
from drive_law.params import AduNodeParameters
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.quantities import AnyRecord, Bit, Nanoseconds, Records, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

MAX_CATCH_UP_NS = 2_000_000_000
"""Longest time of missed steps that the drive makes later [ns]. Axes without commands stop within this time."""


class DriveRecord(Record):
    """All data of a drive."""
    state: drive_unit.State
    constants: drive_unit.Constants
    inputs: drive_unit.Inputs
    outputs: drive_unit.Outputs
    link: rate_drive.Link
    schedule: schedule.Schedule         # of the injected faults
    injected: injected.DriveInjected    # those in force


class Memory(typing.NamedTuple):
    """Memory of the drive."""
    record: Records         # DriveRecord (1,)


@compiled
def deck_acceleration(drive_inputs: drive_unit.Inputs, link: rate_drive.Link, ship: AnyRecord) -> None:
    """Set rate and angular acceleration of the deck in the inputs of the drive. The acceleration is the difference of
    two successive messages of ship/truth, divided by that of their stamps."""
    w, last = ship.twist_angular, link.truth_stamp
    if last != NO_STAMP and ship.stamp > last:
        for i in range(3):
            drive_inputs.base_acceleration[i] = (w[i] - link.deck_rate[i]) / ((ship.stamp - last) * 1e-9)
    if math.isfinite(w[0]) and math.isfinite(w[1]) and math.isfinite(w[2]) and ship.stamp != last:
        link.truth_stamp = ship.stamp
        for i in range(3):
            link.deck_rate[i] = drive_inputs.base_rate[i] = w[i]


@compiled
def decode(drive_inputs: drive_unit.Inputs, link: rate_drive.Link, dropped: Bit, command: AnyRecord,
           ship: AnyRecord) -> None:
    """Write the messages of the last step into the inputs of the drive; one without a message has the stamp NO_STAMP.
    dropped: 1 if an injected fault removes the command."""
    if dropped == 0:
        rate_drive.take_command(drive_inputs, link, command)
    else:
        rate_drive.supervise(drive_inputs, link)
    if ship.stamp != NO_STAMP:
        deck_acceleration(drive_inputs, link, ship)


@compiled
def record_invalid_topic(drive_inputs: drive_unit.Inputs, link: rate_drive.Link) -> None:
    """Store the topic of an invalid input."""
    deck = drive_inputs.base_acceleration
    valid = drive_state.plausible(deck[0]) and drive_state.plausible(deck[1]) and drive_state.plausible(deck[2])
    link.invalid = rate_drive.INVALID_COMMAND if valid else rate_drive.INVALID_TRUTH


@compiled
def encode_truth(drive_outputs: drive_unit.Outputs, stamp: Nanoseconds, truth: AnyRecord) -> None:
    """Write the true angles and rates of the beam into the record of adu/truth."""
    truth.stamp = stamp
    for i in range(2):
        axis = drive_outputs.azimuth if i == 0 else drive_outputs.elevation
        truth.position[i], truth.velocity[i] = axis.load_position, axis.load_velocity


@compiled
def receive(drive: DriveRecord, stamp: Nanoseconds, inputs: AnyRecord) -> bool:
    """Take the messages of step k - 1. Return False in the first step, which has none."""
    if drive.link.stamp == NO_STAMP:
        drive.state.k = stamp // drive.link.period
        return False
    decode(drive.inputs, drive.link, drive.injected.message_fault.drop, inputs[rate_drive.RATE_COMMAND_TOPIC],
           inputs[rate_drive.SHIP_TRUTH_TOPIC])
    drive.inputs.pins = inputs[rate_drive.PIN_COMMAND_TOPIC]
    return True


@compiled
def report(drive: DriveRecord, stamp: Nanoseconds, moved: bool, outputs: AnyRecord) -> None:
    """Write the messages of the drive at t_k. moved: result of `receive`, False in the first step."""
    if moved and drive.outputs.invalid_command:
        record_invalid_topic(drive.inputs, drive.link)
    drive.link.stamp = stamp
    rate_drive.encode_measured(drive.outputs, stamp, outputs)
    encode_truth(drive.outputs, stamp, outputs[rate_drive.DRIVE_TRUTH_TOPIC])
    outputs[rate_drive.PIN_STATES_TOPIC] = drive.outputs.pins


@compiled
def advance_missed_steps(drive: DriveRecord, stamp: Nanoseconds) -> None:
    """Make the steps that a late node in realtime missed before a stamp, at most those of MAX_CATCH_UP_NS. Because a
    real antenna moves on while its simulation is late, these steps use the last command until it is stale."""
    missed = 0
    if drive.link.stamp != NO_STAMP:
        missed = min(stamp - drive.link.stamp, MAX_CATCH_UP_NS) // drive.link.period - 1
    for _ in range(missed):
        rate_drive.supervise(drive.inputs, drive.link)
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
    """Apply `law` to the first len(inputs) drives of DRIVE_LANES, which fit lanes and are all at the same step."""
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
    """Return the DriveRecord (1,) before the first step, cached for trials with the same drive."""
    record = DriveRecord.of(state=drive_unit.initial_state(parameters), constants=drive_unit.constants(parameters),
                            link=rate_drive.initial_link(parameters), schedule=schedule.empty())
    drive_unit.read(*(record[0][name] for name in ('state', 'constants', 'outputs')))
    return record


class Adu(rate_drive.RateDrive, Simulated):
    """Unit of the drive."""
    NODE, LAWS = nodes.row(nodes.DRIVE_NODE), {Memory: (law, laws)}
    VERBS = table.INJECT_COMMANDS[NODE.name]
    parameters: AduNodeParameters
    memory: Memory

    def __init__(self, parameters: AduNodeParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.memory = Memory(_initial(parameters).copy())

    @property
    def fits_lanes(self) -> bool:
        """True if the drive has the flags of LANE_FLAGS and no injected fault."""
        axes = [self.parts[part][axis] for part in ('state', 'constants') for axis in topics.AXES]
        flags = [flags[name] == value for name, value in LANE_FLAGS.items()
                 for flags in (*axes, *(c['encoder'] for c in axes[2:])) if name in flags.dtype.names]
        return all(flags) and not self.parameters.inject

    def resume(self, state: rate_drive.PlantState) -> None:
        """Restore the state of the plant before the first step: brakes on, then enabled if the state was enabled."""
        angles = {f'initial_{axis}': min(max(getattr(state, axis), limits.lower), limits.upper) for axis, limits in (
            (axis, getattr(self.parameters, axis).limits) for axis in topics.AXES)}
        pins = dataclasses.replace(self.parameters.pins, initially_in=state.pinned)
        parameters = dataclasses.replace(self.parameters, initially_enabled=False, **angles, pins=pins)
        self.memory.record['state'] = drive_unit.initial_state(parameters)
        self.parts['state']['wanted'] = state.enabled
        self.read()

    def read(self) -> None:
        """Write the present outputs, between two steps."""
        drive_unit.read(*(self.parts[name] for name in ('state', 'constants', 'outputs')))
