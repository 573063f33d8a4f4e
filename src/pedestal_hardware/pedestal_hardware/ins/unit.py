"""Attitudes of the graph from sentences or messages of an INS. No ROS, no clock: the caller gives the arrival."""
import math
import typing

import numpy as np

from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Degrees, Message, Nanoseconds, Quaternion, Radians, Radians2, Records, Vector3
from pedestal_common.stream import Drops
from pedestal_common.wire import messages
from pedestal_hardware.ins import frame_check, frames, input_law, sentences
from pedestal_hardware.ins.input_law import Outcome
from pedestal_hardware.ins.params import InsInputParameters

TURN_AGE_NS = 1_000_000_000  # age from which a rate of turn is not compared any more [ns]

DROP_KINDS = ('bad_checksum', 'unreadable', 'out_of_range', 'no_heading', 'no_time', 'no_orientation', 'stale',
              'future', *input_law.OUTCOMES[1:])

OUTCOME_TEXTS = {Outcome.NO_ATTITUDE: 'the orientation must have the length 1, and the rates must be finite',
                 Outcome.NOT_NEWER: 'the stamp is not later than the last one',
                 Outcome.TOO_FAST: f'the deck would turn faster than {math.degrees(input_law.MAX_RATE_RAD_S):.0f} '
                                     'deg/s',
                 Outcome.SETTLING: 'the rates settle'}  # {code: reason}, without those of a wrong frame

AXIS_NAMES = ('roll', 'pitch', 'yaw')

VERDICT_TEXTS = ('not enough motion so far', 'agrees', 'wrong')  # texts of the verdicts of frame_check


class Sample(typing.NamedTuple):
    """Attitude of the deck in the frames of the graph."""
    stamp: Nanoseconds      # time of the measurement, UTC
    q: Quaternion           # deck -> earth
    w: Vector3              # rate [rad/s]
    force: Vector3          # specific force [m/s2], NaN for none
    variances: tuple[Radians2, ...]     # of roll, pitch, heading, 0 for unknown


class Memory(typing.NamedTuple):
    """Memory of the law."""
    record: Records         # input_law.InputRecord (1,)


class InsInputUnit:
    """Attitudes of a device."""
    published: int          # number of the published samples
    drops: Drops            # dropped samples
    other_sentences: int    # number of the unused sentences
    state: str              # text of ins/state

    def __init__(self, parameters: InsInputParameters) -> None:
        p = self.parameters = parameters
        frame = (p.imu.earth, p.imu.body, p.imu.rate_body) if p.source == 'imu' else ('enu', 'flu', 'flu')
        self._declared, self._case = frame, frames.mounting_matrix(*p.mounting.radians)
        self.memory = Memory(input_law.InputRecord.zeros())
        self.record = self.memory.record
        constants = self.record['constants'][0]
        constants['frame'] = frames.constants(*frame, p.mounting.radians, math.radians(p.heading_zero))[0]
        constants['bandwidth'], constants['max_gap_ns'] = p.rate_bandwidth, round(p.max_gap * 1e9)
        constants['oldest_ns'] = round(p.oldest * 1e9)
        constants['checked'] = p.frame_check
        self.published, self.drops, self.other_sentences = 0, Drops(DROP_KINDS), 0
        self.state, self._blocking = 'aligning', ''
        self._turn, self._age_ns = (0.0, 0), 0

    def prepare(self) -> None:
        """Compile the law, without a change of the unit."""
        before = self.record.copy()
        self.record['inputs']['yaw_rate'] = math.nan
        input_law.take_heading(self.record, 0, 0.0)
        input_law.predict_yaw(self.record, 0, math.nan)
        input_law.step(self.record)
        self.record['inputs']['q'], self.record['inputs']['axes'] = (0.0, 0.0, 0.0, 1.0), frame_check.ALL_AXES
        input_law.step(self.record)
        self.record[...] = before

    def take_line(self, line: bytes, arrival: Nanoseconds) -> Sample | None:
        """Return the sample of a line; None without one. arrival: UTC at which the line arrived."""
        p = self.parameters
        try:
            found = sentences.parse(line)
        except sentences.SentenceError as error:
            return self._drop(error.kind, str(error), arrival)
        if isinstance(found, sentences.Turn):
            self._turn = -math.radians(found.rate) / 60.0, arrival
            return None
        if found is not None and found.kind == 'hdt':
            input_law.take_heading(self.record, arrival, -math.radians(found.heading))
        if found is None or found.kind != p.nmea.sentence:
            self.other_sentences += 1
            return None
        device = None if found.time_of_day is None else sentences.stamp_at(found.time_of_day, arrival)
        u = self.record['inputs'][0]
        rate, at = self._turn
        turns = at and arrival - at <= TURN_AGE_NS
        yaw, u['yaw_rate'] = -math.radians(found.heading), math.nan
        if math.isnan(yaw):     # The heading of HDT goes on until this sentence, so that a slow HDT makes no steps.
            course = self.record['state'][0]['course']
            if not course['runs'] or arrival - course['last'] > round(p.oldest * 1e9):
                return self._drop('no_heading', f'{found.kind} without heading, and no HDT in the last {p.oldest:g} s',
                                  arrival)
            yaw, u['yaw_rate'], settled = input_law.predict_yaw(self.record, arrival, rate if turns else math.nan)
            if not settled:
                return self._drop('settling', OUTCOME_TEXTS[Outcome.SETTLING], arrival)
        u['q'], u['yaw'] = frames.of_angles(-yaw, *self._level_angles(found)), yaw
        u['w'], u['axes'] = (0.0, 0.0, rate), frame_check.TURN_AXIS if turns else 0
        u['force'] = math.nan
        aligned = not found.sigmas[2] > p.aligned_sigma and (
            not p.nmea.aligned_status or (found.status or 0) >= p.nmea.aligned_status)
        variances = tuple(0.0 if math.isnan(sigma) else math.radians(sigma)**2 for sigma in found.sigmas)
        return self._sample(device, arrival, variances, aligned)

    def _level_angles(self, found: sentences.Attitude) -> tuple[Radians, Radians]:
        """Return (pitch, roll) of a sentence with the bow up and the starboard side down."""
        p = self.parameters.nmea
        pitch = math.radians(found.pitch) * (1.0 if p.pitch_positive == 'bow_up' else -1.0)
        roll = math.radians(found.roll) * (1.0 if p.roll_positive == 'starboard_down' else -1.0)
        if p.roll_angle == 'tss':
            roll = math.asin(min(max(math.sin(roll) / max(math.cos(pitch), 1e-9), -1.0), 1.0))
        return pitch, roll

    def take_imu(self, message: Message, arrival: Nanoseconds) -> Sample | None:
        """Return the sample of a sensor_msgs/Imu; None without one. arrival: UTC at which the message arrived."""
        p, u = self.parameters, self.record['inputs'][0]
        if message.orientation_covariance[0] < 0.0:
            return self._drop('no_orientation', f'{p.imu.topic}: orientation_covariance[0] < 0 declares no '
                              'orientation (REP 145)', arrival)
        q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
        has_rates = message.angular_velocity_covariance[0] >= 0.0 or p.imu.undeclared_rates
        u['yaw_rate'] = math.nan
        u['q'], u['w'], u['force'] = (q.x, q.y, q.z, q.w), (w.x, w.y, w.z), (f.x, f.y, f.z)
        u['axes'] = frame_check.ALL_AXES if has_rates else 0
        if message.linear_acceleration_covariance[0] < 0.0 or not np.isfinite(u['force']).all():
            u['force'] = math.nan
        variances = tuple(float(message.orientation_covariance[i]) for i in (0, 4, 8))
        variances = tuple(variance if 0.0 < variance < math.inf else 0.0 for variance in variances)
        aligned = not math.sqrt(variances[2]) > math.radians(p.aligned_sigma)
        return self._sample(messages.nanoseconds(message.header.stamp), arrival, variances, aligned)

    def _sample(self, device: Nanoseconds | None, arrival: Nanoseconds, variances: tuple[Radians2, ...],
                aligned: bool) -> Sample | None:
        p, u = self.parameters, self.record['inputs'][0]
        stamp = arrival if p.stamp == 'arrival' else device
        if stamp is None:
            return self._drop('no_time', 'a sentence without time', arrival)
        self._age_ns = arrival - stamp
        if self._age_ns > round(p.oldest * 1e9):
            return self._drop('stale', f'the stamp is {self._age_ns * 1e-9:.3f} s old', arrival)
        if -self._age_ns > round(p.future * 1e9):
            return self._drop('future', f'the stamp is {-self._age_ns * 1e-9:.3f} s in the future', arrival)
        u['stamp'] = stamp - round(p.latency * 1e9)
        outcome = input_law.step(self.record)
        blocked = outcome in (Outcome.TILTED, Outcome.WRONG_FRAME)
        self._blocking = self._wrong_frame(outcome) if blocked else ''
        if outcome != Outcome.PUBLISHED:
            self.state = 'aligning' if outcome == Outcome.WRONG_FRAME else self.state
            return self._drop(input_law.OUTCOMES[outcome], self._blocking or OUTCOME_TEXTS[outcome], arrival)
        self.published += 1
        self.state = 'aligned' if aligned else 'aligning'
        outputs = self.record['outputs'][0]
        return Sample(int(u['stamp']), outputs['q'], outputs['w'], outputs['force'], variances)

    def _wrong_frame(self, outcome: int) -> str:
        check, u, o = (self.record[name][0] for name in ('state', 'inputs', 'outputs'))
        check = check['check']
        if outcome == Outcome.TILTED:
            x, y = o['q'][:2]
            tilt = math.degrees(math.acos(max(1.0 - 2.0 * (x * x + y * y), -1.0)))
            reason = f'the deck would be tilted by {tilt:.0f} deg'
        elif check['verdict'] != frame_check.FRAME_WRONG:
            reason = 'linear_acceleration would point downwards'
        else:
            axes = u['axes']
            reason = 'the attitude does not turn with its rates: ' + ', '.join(
                f'{name} {frame_check.slope(check, i):.2g} times its rate' for i, name in enumerate(AXIS_NAMES)
                if axes & (1 << i) and check['moved'][i] > 0.0 and not frame_check.agrees(check, i, axes))
        if self.parameters.source == 'nmea':
            return f'wrong frame: {reason}; compare the signs of heading, rate of turn, roll and pitch'
        fitting = frame_check.fitting_conventions(check, self._declared, self._case, u['q'])
        return f'wrong frame: {reason}; {frame_check.text_of(fitting)}'

    def _drop(self, kind: str, reason: str, arrival: Nanoseconds) -> Sample | None:
        if kind == 'settling':
            self.drops.counts[kind] += 1
        else:
            self.drops.drop(kind, reason, arrival)
        return None

    @property
    def verdict(self) -> str:
        """Text of the verdict of the check of the frames."""
        return VERDICT_TEXTS[self.record['state'][0]['check']['verdict']]

    def diagnose(self, now: Nanoseconds) -> Diagnosis:
        """Return the Diagnosis at a UTC: ERROR for a wrong frame, WARN while Drops reports a sample."""
        state, o = self.record['state'][0], self.record['outputs'][0]
        values = [*((f'{name}_deg', f'{angle:.2f}') for name, angle in self._angles(o['q'])),
                  *((f'{name}_rate_deg_s', f'{math.degrees(rate):.2f}') for name, rate in zip(AXIS_NAMES, o['w'])),
                  ('frame_check', self.verdict),
                  *((f'{name}_slope', f'{frame_check.slope(state["check"], i):.2f}')
                    for i, name in enumerate(AXIS_NAMES) if state['check']['moved'][i] > 0.0),
                  ('age_s', f'{self._age_ns * 1e-9:.3f}'), ('gaps', str(state['gaps'])),
                  ('jumps', str(state['check']['jumps'])),
                  ('published', str(self.published)),
                  *((name, str(count)) for name, count in self.drops.counts.items()),
                  ('other_sentences', str(self.other_sentences))]
        if self._blocking:
            return Diagnosis(LEVEL_ERROR, self._blocking, values)
        if self.drops.reported(now):
            return Diagnosis(LEVEL_WARN, f'dropped a sample: {self.drops.reason}', values)
        if not self.published:
            if not self.drops.counts['settling']:
                return Diagnosis(LEVEL_OK, 'no attitude so far', values)
            return Diagnosis(LEVEL_WARN, 'the rates settle: two samples must be at most max_gap = '
                             f'{self.parameters.max_gap:g} s apart', values)
        if self.state == 'aligning':
            return Diagnosis(LEVEL_WARN, 'the INS aligns', values)
        return Diagnosis(LEVEL_OK, 'receives attitudes', values)

    def _angles(self, q: Quaternion) -> tuple[tuple[str, Degrees], ...]:
        """Return (name, angle) of heading, pitch (bow up) and roll (starboard down) of a quaternion."""
        x, y, z, w = q
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        pitch = -math.asin(min(max(2.0 * (w * y - x * z), -1.0), 1.0))
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        return (('heading', (90.0 - math.degrees(yaw)) % 360.0), ('pitch', math.degrees(pitch)),
                ('roll', math.degrees(roll)))
