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
from pedestal_common.wire.commands import Reply
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware.rotator import motion_watch, set_point
from pedestal_hardware.rotator.line import Measurement, SetPoint
from pedestal_hardware.rotator.protocols import PROTOCOLS, Pulses

if TYPE_CHECKING:
    from pedestal_hardware.rotator_params import RotatorParameters

MODE_TOPIC, JOINT_STATES_TOPIC, CLOCK_TOPIC = 'acu/mode', 'joint_states', 'clock'

MODE_COUNT = len(MODES)  # number of the modes of the control unit; as a code an unknown mode

SILENT_TEXT, RECOUNTS_TEXT = 'fault: rotator silent', 'fault: rotator counts differently'
RUNS_AWAY_TEXTS = tuple(f'fault: {axis} runs away' for axis in topics.AXES)
STATE_TEXTS = ENABLED_TEXT, 'disabled', EMERGENCY_STOP_TEXT, SILENT_TEXT, RECOUNTS_TEXT, *RUNS_AWAY_TEXTS
"""Texts of adu/state of a rotator. The last faults are latched, and the node stops the device in them."""

(STATE_CODE_ENABLED, STATE_CODE_DISABLED, STATE_CODE_EMERGENCY_STOP, STATE_CODE_SILENT, STATE_CODE_RECOUNTS,
 STATE_CODE_AZIMUTH_RUNS_AWAY, STATE_CODE_ELEVATION_RUNS_AWAY) = range(len(STATE_TEXTS))

MODE_CODE_STANDBY, MODE_CODE_STOP, MODE_CODE_RATE = (MODES.index(mode) for mode in ('standby', 'stop', 'rate'))
"""Codes of modes of the control unit. In standby and stop the rotator stands still."""

REST_TIME_S = 1.0  # time without motion after which a latched fault may be reset [s]
RECOUNT_COUNT = 2  # number of answers in a row with other pulses that count: a line may garble one
MAX_JUMP_RAD = math.pi  # largest change of an azimuth between two measurements that is no new turn [rad]

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
    counts: Bit         # 1 if the resolution of the device is known
    recounts: Bit       # 1 from the change of this resolution until a reset


class RotatorRecord(Record):
    """All data of a rotator."""
    state: set_point.State
    constants: set_point.Constants
    inputs: set_point.Inputs
    outputs: set_point.Outputs
    watch: motion_watch.State
    limits: motion_watch.Limits
    switches: Switches
    device: Device


class Memory(NamedTuple):
    """Memory of a rotator."""
    record: Records     # RotatorRecord (1,)


@compiled
def condition(switches: Switches, device: Device, watch: motion_watch.State) -> int:
    """Return the code of STATE_TEXTS."""
    if switches.emergency:
        return STATE_CODE_EMERGENCY_STOP
    for i in range(2):
        if watch.axis[i].runs_away:
            return STATE_CODE_AZIMUTH_RUNS_AWAY + i
    if switches.recounts:
        return STATE_CODE_RECOUNTS
    if device.silent:
        return STATE_CODE_SILENT
    return STATE_CODE_ENABLED if switches.wanted else STATE_CODE_DISABLED


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Make the step of a stamp. A step without a new measurement publishes no angles."""
    record = memory.record[0]
    own, device, reference = record.inputs, record.device, inputs[REFERENCE_TOPIC]
    own.stamp_ns, own.reference_stamp_ns = stamp, reference.stamp
    mode = inputs[MODE_TOPIC]
    moves = 0 <= mode < MODE_COUNT and mode != MODE_CODE_STANDBY and mode != MODE_CODE_STOP
    if device.silent:
        record.watch.last_ns = NO_STAMP
    elif device.came:
        motion_watch.step(record.watch, record.limits, stamp, device.angle, record.state.set_point,
                          record.state.moving)
    code = condition(record.switches, device, record.watch)
    own.enabled = 1 if code == STATE_CODE_ENABLED and moves and record.switches.counts else 0
    own.by_hand = 1 if mode == MODE_CODE_RATE else 0
    for i in range(2):
        own.angle[i], own.rate[i], own.measured[i] = reference.position[i], reference.velocity[i], device.angle[i]
    set_point.step(record.state, record.constants, own, record.outputs)
    if code > STATE_CODE_SILENT and motion_watch.stops_again(record.watch, stamp):
        record.outputs.stop = 1
    joints = outputs[JOINT_STATES_TOPIC]
    joints.stamp = stamp if device.came else NO_STAMP
    outputs[CLOCK_TOPIC].stamp = stamp
    for i in range(2):
        joints.position[i], joints.velocity[i], joints.effort[i] = device.angle[i], device.rate[i], 0.0
    device.came = 0
    outputs[DRIVE_STATE_TOPIC] = code


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
        constants, limits = set_point.Constants.zeros(), motion_watch.Limits.zeros()
        constants['timeout_ns'], limits['reaction_ns'] = p.timeout_ns, round((2.0 + p.period) * 1e9)
        limits['rate'] = math.radians(p.rate)
        constants['dead_band'] = math.radians(p.dead_band)
        for part in (constants, limits):
            part['low'], part['high'] = np.radians(p.travel).T
        switches, device, watch = Switches.zeros(), Device.zeros(), motion_watch.State.zeros()
        switches['wanted'] = device['silent'] = 1
        motion_watch.initialise(watch)
        self.memory = Memory(RotatorRecord.of(constants=constants, limits=limits, switches=switches, device=device,
                                              watch=watch, state=set_point.initial_state()))
        self.counts: dict[str, int] = {}
        self.fault = ''
        self.pulses: Pulses | None = None           # per degree of the set-points, None before the first answer
        self._other_pulses: list[Pulses | None] = []    # of the last answers, which differ
        self.measured_at: Seconds | None = None     # times of the monotonic clock: of the newest measurement,
        self._moved_at = self._now = 0.0            # of the last motion, of the last step,
        self._away_since: Seconds | None = None     # and since when the rotator is away from the set-point
        self._stuck_s = 0.0
        if not PROTOCOLS[p.protocol].READS_PULSES:
            self._adopt(None)

    def _adopt(self, pulses: Pulses | None) -> None:
        """Count as the device does."""
        self.pulses = pulses
        self._other_pulses.clear()
        steps = [max(self.parameters.step_deg, 1.0 / count) for count in pulses or (math.inf, math.inf)]
        self.parts['constants']['resolution'] = np.radians(steps)
        limits = self.parts['limits']
        for i, step in enumerate(steps):
            limits['most'][i], limits['least'][i] = np.radians(self.parameters.most_away_deg(step))
            limits['leak'][i] = math.radians(0.2 * step)
        self.parts['switches']['counts'] = 1

    def _take_pulses(self, pulses: Pulses | None) -> None:
        """Adopt the first pulses of the device; others trip the drive, which then adopts them at its reset."""
        if pulses == self.pulses and self.parts['switches']['counts']:
            self._other_pulses.clear()
            return
        if pulses not in self._other_pulses:
            self._other_pulses.clear()
        self._other_pulses.append(pulses)
        if len(self._other_pulses) >= RECOUNT_COUNT:
            if self.parts['switches']['counts']:
                self.parts['switches']['recounts'] = 1
            else:
                self._adopt(pulses)

    @property
    def step_deg(self) -> Degrees:
        """Smallest step of a set-point, the larger one of both axes."""
        return math.degrees(self.parts['constants']['resolution'].max())

    @property
    def accuracy_deg(self) -> Degrees:
        """Largest distance of the rotator from a target that stands still: dead band and half a step."""
        return self.parameters.dead_band + 0.5 * self.step_deg

    def _angles(self, measurement: Measurement) -> Pair:
        """Return the angles [rad] of a measurement. The azimuth is on the turn next to the last one or, at first, to
        the middle of the travel."""
        p = self.parameters
        azimuth, elevation = measurement.azimuth, measurement.elevation
        if p.azimuth_only:
            elevation = p.fixed_elevation
        if p.circle is not None:
            near = 0.5 * (p.azimuth.low + p.azimuth.high)
            if self.measured_at is not None:
                near = math.degrees(self.parts['device']['angle'][0])
            azimuth += 360.0 * round((near - azimuth) / 360.0)
        return np.radians((azimuth, elevation))

    def measure(self, measurement: Measurement | None, now: Seconds) -> None:
        """Take the newest measurement of the line. now: time of the monotonic clock."""
        device, self._now = self.parts['device'], now
        if measurement is not None and measurement.at != self.measured_at:
            angles = self._angles(measurement)
            self._take_pulses(measurement.pulses)
            if self.measured_at is not None and not device['silent']:
                device['rate'] = (angles - device['angle']) / (measurement.at - self.measured_at)
            if np.abs(angles - device['angle']).max() > 0.25 * math.radians(self.step_deg):
                self._moved_at = now
            device['angle'], device['came'], self.measured_at = angles, 1, measurement.at
        device['silent'] = self.measured_at is None or now - self.measured_at > self.parameters.silence
        if device['silent']:
            device['rate'] = 0.0
        away = self.parts['inputs']['enabled'] and self._distance_deg > self.accuracy_deg + self.step_deg
        since = now if self._away_since is None else self._away_since
        self._away_since = since if away else None
        self._stuck_s = now - max(self._moved_at, since) if away else 0.0

    @property
    def _distance_deg(self) -> Degrees:
        return math.degrees(np.abs(self.parts['state']['set_point'] - self.parts['device']['angle']).max())

    @property
    def decision(self) -> SetPoint | Literal['stop'] | None:
        """The set-point to send after the last step, 'stop', or None. Its azimuth is on the circle of the device."""
        outputs, circle = self.parts['outputs'], self.parameters.circle
        if outputs['send']:
            azimuth, elevation = np.degrees(outputs['set_point'])
            if circle is not None:
                azimuth = circle + (round(azimuth, 6) - circle) % 360.0
            return SetPoint(azimuth, elevation, self.pulses)
        return 'stop' if outputs['stop'] else None

    def request(self, name: str) -> Reply:
        """Execute one of REQUESTS. A reset also ends the latched faults, once the axes are at rest."""
        watch, switches = self.parts['watch'], self.parts['switches']
        if name == 'adu/reset_faults' and self.condition_code > STATE_CODE_SILENT:
            if self._now - self._moved_at < REST_TIME_S:
                return Reply(False, f'refused: an axis moves; drive is {self.condition}')
            motion_watch.reset(watch)
            if switches['recounts']:
                switches['recounts'] = 0
                self._adopt(self._other_pulses[-1] if self._other_pulses else self.pulses)
        return super().request(name)

    def take_text(self, topic: str, text: str) -> None:
        """Take the mode of the control unit; an unknown mode does not move the rotator."""
        self.inputs[topic] = MODES.index(text) if text in MODES else MODE_COUNT

    @property
    def condition_code(self) -> int:
        """Present code of STATE_TEXTS, also between two steps."""
        return condition(self.parts['switches'], self.parts['device'], self.parts['watch'])

    def _latched(self) -> str:
        """Return what a latched fault means, '' without one."""
        if self.condition == RECOUNTS_TEXT:
            return (f'the device counted {_pulses_text(self.pulses)} and now counts '
                    f'{_pulses_text(self._other_pulses[-1] if self._other_pulses else self.pulses)}: stopped; check '
                    'its setup, then call adu/reset_faults')
        for name, axis, fault in zip(topics.AXES, self.parts['watch']['axis'], RUNS_AWAY_TEXTS):
            if self.condition == fault:
                angle, allowed, jump = (math.degrees(axis[field]) for field in ('angle', 'allowed', 'jump'))
                turn = (f'; it jumped by {jump:.0f} deg: see the parameter azimuth_circle'
                        if name == 'azimuth' and abs(axis['jump']) > MAX_JUMP_RAD else '')
                return (f'{name} went away from {allowed:.1f} deg to {angle:.1f} deg: stopped{turn}; find the cause, '
                        'then call adu/reset_faults')
        return ''

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis: what the rotator can follow, and ERROR for a device that does not answer."""
        p, outputs, device, u = self.parameters, self.parts['outputs'], self.parts['device'], self.parts['inputs']
        switches = self.parts['switches']
        rate = math.degrees(max(abs(u['rate']))) if u['reference_stamp_ns'] != NO_STAMP else 0.0
        values = [*((f'{axis}_deg', f'{math.degrees(angle):.2f}')
                    for axis, angle in zip(topics.AXES, device['angle'])),
                  ('state', self.condition), ('accuracy_deg', f'{self.accuracy_deg:g}'),
                  *((('pulses_per_degree', _pulses_text(self.pulses)),) if self.pulses else ()),
                  ('rate_limit_deg_s', f'{p.rate:g}'), ('target_rate_deg_s', f'{rate:.3f}'),
                  *((name, str(count)) for name, count in self.counts.items())]
        if latched := self._latched():
            return Diagnosis(LEVEL_ERROR, latched, values)
        if self.condition == SILENT_TEXT or self.fault:
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
        if not switches['counts']:
            return Diagnosis(LEVEL_WARN, 'waits for two equal answers with the pulses of a set-point', values)
        beyond = np.degrees(device['angle']) - np.clip(np.degrees(device['angle']), *np.transpose(p.travel))
        if np.abs(beyond).max() > self.accuracy_deg + self.step_deg:
            return Diagnosis(LEVEL_WARN, 'an axis is outside the travel of the parameters: it moves only towards it',
                             values)
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
        return Diagnosis(LEVEL_OK, f'follows within {self.accuracy_deg:g} deg, at most {p.rate:g} deg/s', values)


def _pulses_text(pulses: Pulses | None) -> str:
    return 'no pulses' if pulses is None else f'{pulses[0]} and {pulses[1]} pulses per degree'
