"""Unit of a rotator: reference in; measured angles, state and set-points out.

The node gives the newest measurement of the device to the unit before each step, and sends what the step decides.
"""
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from drive_law.angle_drive import DRIVE_STATE_TOPIC, EMERGENCY_STOP_TEXT, ENABLED_TEXT, REFERENCE_TOPIC, AngleDrive
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.modes import MODES
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import AnyRecord, Bit, Degrees, Nanoseconds, Pair, Records, Seconds, Stamps
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware.rotator import set_point

if TYPE_CHECKING:
    from pedestal_hardware.rotator.line import Measurement
    from pedestal_hardware.rotator_params import RotatorParameters

MODE_TOPIC, JOINT_STATES_TOPIC, CLOCK_TOPIC = 'acu/mode', 'joint_states', 'clock'

MODE_COUNT = len(MODES)  # number of the modes of the control unit; as a code an unknown mode

FAULT_TEXT = 'fault: rotator silent'
STATE_TEXTS = ENABLED_TEXT, 'disabled', EMERGENCY_STOP_TEXT, FAULT_TEXT  # texts of adu/state of a rotator
STATE_CODE_ENABLED, STATE_CODE_DISABLED, STATE_CODE_EMERGENCY_STOP, STATE_CODE_FAULT = range(len(STATE_TEXTS))

MODE_CODE_STANDBY, MODE_CODE_STOP, MODE_CODE_RATE = (MODES.index(mode) for mode in ('standby', 'stop', 'rate'))
"""Codes of modes of the control unit. In standby and stop the rotator stands still."""

STUCK_TIME_S = 5.0  # time without motion, away from the set-point, after which the rotator is reported as stuck [s]


class Device(Record):
    """State of the device."""
    angle: Pair     # newest measured angles [rad]
    rate: Pair      # between the last two measurements [rad/s]
    came: Bit       # 1 if a measurement has arrived since the last step
    silent: Bit     # 1 while the newest measurement is too old


class Switches(Record):
    """Switches of the drive."""
    wanted: Bit         # 1 after a request to enable
    emergency: Bit      # 1 while an emergency stop is latched


class RotatorRecord(Record):
    """All data of a rotator."""
    state: set_point.State
    constants: set_point.Constants
    inputs: set_point.Inputs
    outputs: set_point.Outputs
    switches: Switches
    device: Device


class Memory(NamedTuple):
    """Memory of a rotator."""
    record: Records     # RotatorRecord (1,)


@compiled
def condition(switches: Switches, device: Device) -> int:
    """Return the code of STATE_TEXTS."""
    if switches.emergency:
        return STATE_CODE_EMERGENCY_STOP
    if device.silent:
        return STATE_CODE_FAULT
    return STATE_CODE_ENABLED if switches.wanted else STATE_CODE_DISABLED


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Make the step of a stamp. A step without a new measurement publishes no angles."""
    record = memory.record[0]
    own, device, reference = record.inputs, record.device, inputs[REFERENCE_TOPIC]
    own.stamp_ns, own.reference_stamp_ns = stamp, reference.stamp
    mode = inputs[MODE_TOPIC]
    moves = 0 <= mode < MODE_COUNT and mode != MODE_CODE_STANDBY and mode != MODE_CODE_STOP
    own.enabled = 1 if condition(record.switches, device) == STATE_CODE_ENABLED and moves else 0
    own.by_hand = 1 if mode == MODE_CODE_RATE else 0
    for i in range(2):
        own.angle[i], own.rate[i], own.measured[i] = reference.position[i], reference.velocity[i], device.angle[i]
    set_point.step(record.state, record.constants, own, record.outputs)
    joints = outputs[JOINT_STATES_TOPIC]
    joints.stamp = stamp if device.came else NO_STAMP
    outputs[CLOCK_TOPIC].stamp = stamp
    for i in range(2):
        joints.position[i], joints.velocity[i], joints.effort[i] = device.angle[i], device.rate[i], 0.0
    device.came = 0
    outputs[DRIVE_STATE_TOPIC] = condition(record.switches, device)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Apply `law` to each element of arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class Rotator(AngleDrive):
    """A rotator, of a RotatorParameters."""
    parameters: 'RotatorParameters'
    memory: Memory
    NODE, LAWS, STATE_TEXTS = nodes.ROTATOR_DRIVE, {Memory: (law, laws)}, STATE_TEXTS

    def __init__(self, parameters: 'RotatorParameters', reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        p = self.parameters
        constants = set_point.Constants.zeros()
        constants['timeout_ns'] = p.timeout_ns
        constants['dead_band'], constants['resolution'] = math.radians(p.dead_band), math.radians(p.step_deg)
        for i, axis in enumerate((p.azimuth, p.elevation)):
            constants['low'][0, i], constants['high'][0, i] = math.radians(axis.low), math.radians(axis.high)
        switches, device = Switches.zeros(), Device.zeros()
        switches['wanted'] = device['silent'] = 1
        self.memory = Memory(RotatorRecord.of(constants=constants, switches=switches, device=device,
                                              state=set_point.initial_state()))
        self.counts: dict[str, int] = {}
        self.fault = ''
        self.measured_at: Seconds | None = None     # times of the monotonic clock: of the newest measurement,
        self._moved_at = 0.0                        # of the last motion,
        self._away_since: Seconds | None = None     # and since when the rotator is away from the set-point
        self._stuck_s = 0.0

    def measure(self, measurement: 'Measurement | None', now: Seconds) -> None:
        """Take the newest measurement of the line. now: time of the monotonic clock."""
        device = self.parts['device']
        if measurement is not None and measurement.at != self.measured_at:
            angles = np.radians((measurement.azimuth, measurement.elevation))
            if self.measured_at is not None and not device['silent']:
                device['rate'] = (angles - device['angle']) / (measurement.at - self.measured_at)
            if np.abs(angles - device['angle']).max() > 0.25 * math.radians(self.parameters.step_deg):
                self._moved_at = now
            device['angle'], device['came'], self.measured_at = angles, 1, measurement.at
        device['silent'] = self.measured_at is None or now - self.measured_at > self.parameters.silence
        if device['silent']:
            device['rate'] = 0.0
        away = self.parts['inputs']['enabled'] and self._distance_deg > self.parameters.accuracy_deg + \
            self.parameters.step_deg
        since = now if self._away_since is None else self._away_since
        self._away_since = since if away else None
        self._stuck_s = now - max(self._moved_at, since) if away else 0.0

    @property
    def _distance_deg(self) -> Degrees:
        return math.degrees(np.abs(self.parts['state']['set_point'] - self.parts['device']['angle']).max())

    @property
    def decision(self) -> tuple[Degrees, Degrees] | Literal['stop'] | None:
        """The set-point (azimuth, elevation) to send after the last step, 'stop', or None."""
        outputs = self.parts['outputs']
        if outputs['send']:
            azimuth, elevation = np.degrees(outputs['set_point'])
            return azimuth, elevation
        return 'stop' if outputs['stop'] else None

    def take_text(self, topic: str, text: str) -> None:
        """Take the mode of the control unit; an unknown mode does not move the rotator."""
        self.inputs[topic] = MODES.index(text) if text in MODES else MODE_COUNT

    @property
    def condition_code(self) -> int:
        """Present code of STATE_TEXTS, also between two steps."""
        return condition(self.parts['switches'], self.parts['device'])

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: what the rotator can follow, and ERROR for a device that does not answer."""
        p, outputs, device, u = self.parameters, self.parts['outputs'], self.parts['device'], self.parts['inputs']
        switches = self.parts['switches']
        rate = math.degrees(max(abs(u['rate']))) if u['reference_stamp_ns'] != NO_STAMP else 0.0
        values = [*((f'{axis}_deg', f'{math.degrees(angle):.2f}')
                    for axis, angle in zip(topics.AXES, device['angle'])),
                  ('state', self.condition), ('accuracy_deg', f'{p.accuracy_deg:g}'),
                  ('rate_limit_deg_s', f'{p.rate:g}'), ('target_rate_deg_s', f'{rate:.3f}'),
                  *((name, str(count)) for name, count in self.counts.items())]
        if self.condition == FAULT_TEXT or self.fault:
            return Diagnosis(LEVEL_ERROR if device['silent'] else LEVEL_WARN, self.fault or self.condition, values)
        if self.condition != ENABLED_TEXT:
            return Diagnosis(LEVEL_ERROR if switches['emergency'] else LEVEL_WARN, self.condition, values)
        if outputs['invalid']:
            return Diagnosis(LEVEL_ERROR, f'{REFERENCE_TOPIC} holds NaN or infinity, is not within '
                             f'+-{set_point.MAX_REFERENCE_RAD:g} rad, or is not newer than the previous one: ignored',
                             values)
        if outputs['far']:
            return Diagnosis(LEVEL_WARN, 'mode rate would begin far from the measured angles: the rotator waits; '
                             'command a preset first', values)
        if self.inputs[MODE_TOPIC][0] in (MODE_CODE_STANDBY, MODE_CODE_STOP):
            return Diagnosis(LEVEL_OK, 'stands still', values)
        if outputs['stale']:
            return Diagnosis(LEVEL_ERROR, f'no new {REFERENCE_TOPIC} for {p.timeout_ns * 1e-9:g} s: the rotator is '
                             'stopped', values)
        if outputs['outside']:
            return Diagnosis(LEVEL_WARN, 'the target is outside the travel of the rotator: the axis waits at its end',
                             values)
        if self._stuck_s > STUCK_TIME_S:
            return Diagnosis(LEVEL_WARN, f'the rotator has not moved for {self._stuck_s:.0f} s, '
                             f'{self._distance_deg:.1f} deg away from its set-point', values)
        if rate > p.rate:
            return Diagnosis(LEVEL_WARN, f'the target moves at {rate:.2f} deg/s, the rotator at {p.rate:g} deg/s',
                             values)
        return Diagnosis(LEVEL_OK, f'follows within {p.accuracy_deg:g} deg, at most {p.rate:g} deg/s', values)
