"""The unit of the control unit: encoders, receiver and attitude in, rate command, estimate and mode out."""
import math
import typing

import numpy as np

from acu_tracker import announcement, control_unit, faults, modes, signals
from acu_tracker.program import program_track
from pedestal_common import messages, nodes, topics
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER
from pedestal_common.unit import ERROR, OK, WARN, Diagnosis, Reply, Unit, joined

JOINTS, ERRORS, ATTITUDE = 'joint_states', 'tracking_receiver/angle_error', 'ship/imu/data'
RATE, RANGE = 'tracking_receiver/angle_rate', 'tracking_receiver/range'
COMMAND, ESTIMATE, REFERENCE, FILTER = 'acu/rate_command', 'acu/estimate', 'acu/reference', 'acu/filter'
MODE, KEYHOLE, BLOCKAGE = 'acu/mode', 'acu/keyhole', 'acu/blockage'
PROGRAM, DRIVE, INS = 'acu/program_track', 'adu/state', 'ins/state'

FILTER_SIZE, MODELS = len(topics.FILTER), len(topics.MOTION_MODELS)
"""Numbers of an axis on acu/filter; the last of them are the probabilities of the motion models."""

READY = topics.BY_NAME[DRIVE].texts.index('enabled')
ALIGNING = topics.BY_NAME[INS].texts.index('aligning')
"""Codes of these states; a drive or an INS that has not sent one, topics.SILENT, counts as ready or aligned."""


RECORD = np.dtype([('state', control_unit.STATE), ('constants', control_unit.CONSTANTS),
                   ('inputs', signals.INPUTS), ('outputs', signals.OUTPUTS), ('invalid', 'i8')], align=True)
"""invalid: the bits of signals.INVALID_INPUTS that were set since the last diagnosis."""


class Memory(typing.NamedTuple):
    """All the control unit works on."""
    record: np.ndarray
    program: program_track.ProgramTrack


@compiled
def decode(u, stamp, inputs):
    """Records of the messages of a step -> inputs of the control unit; an attitude stays until the next. A rate or a
    range is used only with the error of its own stamp."""
    joints, error, attitude = inputs[JOINTS], inputs[ERRORS], inputs[ATTITUDE]
    rate, distance = inputs[RATE], inputs[RANGE]
    u.stamp = stamp * 1e-9
    for i in range(2):
        u.position[i], u.velocity[i] = joints.position[i], joints.velocity[i]
    u.encoder_valid = 1
    u.error_valid = 0
    if error.stamp != NEVER:
        x, y, cn0_dbhz = error.vector[0], error.vector[1], error.vector[2]
        u.error_valid = 1 if x == x else 0
        u.error_stamp = error.stamp * 1e-9
        u.cross_elevation, u.elevation, u.cn0_dbhz = x, y, cn0_dbhz
    u.error_rate[0] = u.error_rate[1] = u.range = math.nan
    if rate.stamp != NEVER and rate.stamp == error.stamp:
        u.error_rate[0], u.error_rate[1], u.error_rate_sigma = rate.vector[0], rate.vector[1], rate.vector[2]
    if distance.stamp != NEVER and distance.stamp == error.stamp:
        u.range, u.range_variance = distance.range[0], distance.variance[0]
    if attitude.stamp != NEVER:
        u.attitude_stamp = attitude.stamp * 1e-9
        u.attitude_valid = 1
        for i in range(4):
            u.quaternion[i] = attitude.orientation[i]
        for i in range(3):
            u.deck_rate[i] = attitude.angular_velocity[i]
    u.drive_ready, u.aligning = inputs[DRIVE] <= READY, inputs[INS] == ALIGNING


@compiled
def encode(o, lookahead, stamp, outputs):
    """Outputs of the control unit and counts of the look-ahead -> records of its messages."""
    command, estimate, reference = outputs[COMMAND], outputs[ESTIMATE], outputs[REFERENCE]
    command.stamp = estimate.stamp = reference.stamp = outputs[FILTER].stamp = stamp
    for i in range(2):
        command.velocity[i], command.effort[i] = o.rate[i], o.torque[i]
        estimate.position[i], reference.position[i] = o.estimate[i, 0], o.reference[i, 0]
        estimate.velocity[i], reference.velocity[i] = o.estimate[i, 1], o.reference[i, 1]
        estimate.acceleration[i], reference.acceleration[i] = o.estimate[i, 2], o.reference[i, 2]
        # In the order of topics.FILTER.
        numbers = outputs[FILTER].position[i * FILTER_SIZE:]
        numbers[0], numbers[1], numbers[2] = o.innovation[i], o.rate_innovation[i], o.nis[i]
        numbers[3], numbers[4] = math.sqrt(o.covariance[i, 0]), math.sqrt(o.covariance[i, 2])
        numbers[5] = o.covariance[i, 1] / (numbers[3] * numbers[4])
        numbers[6] = o.innovation_sigma[i]
        for model in range(MODELS):
            numbers[FILTER_SIZE - MODELS + model] = o.probability[i, model]
    outputs[MODE], outputs[KEYHOLE], outputs[BLOCKAGE] = o.mode, lookahead.forecasts - 1, lookahead.blockages - 1


@compiled
def law(memory, stamp, inputs, outputs):
    """Step k."""
    m = memory.record[0]
    decode(m.inputs, stamp, inputs)
    control_unit.step(m.state, m.constants, m.inputs, m.outputs, memory.program)
    m.inputs.preset_valid = 0
    m.invalid |= m.outputs.invalid_input
    encode(m.outputs, m.state.lookahead, stamp, outputs)


@compiled
def laws(memory, stamps, inputs, outputs):
    """`law` over arrays."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


class Acu(Unit):
    """The control unit of an AcuParameters, on a ship where its graph has ship/imu/data."""
    NODE, LAWS = nodes.row('acu'), {Memory: (law, laws)}
    LIVE = ('tracker', 'azimuth', 'elevation')
    REQUESTS = (*(f'acu/{mode}' for mode in modes.MODES), 'acu/reset_faults')
    CALLS = ('adu/emergency_stop',)
    MOMENTARY = (KEYHOLE, BLOCKAGE)

    def __init__(self, parameters, reads):
        super().__init__(parameters, reads)
        self.memory = Memory(joined(RECORD, state=control_unit.initial_state(parameters),
                                    constants=control_unit.constants(parameters)), program_track.NO_TRACK)
        self.parts['inputs']['stabilised'], self.parts['inputs']['drive_ready'] = ATTITUDE in self.reads, 1
        self.parts['outputs']['mode'] = modes.STANDBY
        signals.clear(self.parts['outputs'])
        self.drive_state = 'unknown'

    def latency(self, topic):
        """Age [s] of a topic's stamp at a step: attitude_latency or receiver_latency."""
        return self.parameters.attitude_latency if topic == ATTITUDE else self.parameters.receiver_latency

    def configure(self, parameters):
        """Take other values of LIVE parameters into the constants; the state stays."""
        super().configure(parameters)
        self.memory.record['constants'] = control_unit.constants(parameters)

    def decode(self, topic, message):
        """A program track: two or more points in earth angles; or a preset: one point in deck angles. Raises
        ValueError."""
        times, angles = rows(message)
        if len(angles) == 1:
            self.parts['inputs']['preset'], self.parts['inputs']['preset_valid'] = angles[0], 1
        else:
            start = messages.nanoseconds(message.header.stamp) * 1e-9
            self.memory = self.memory._replace(program=program_track.checked(times + start, angles))

    def take_text(self, topic, text):
        """Take a text topic; the drive's state is kept for the diagnosis."""
        super().take_text(topic, text)
        if topic == DRIVE:
            self.drive_state = text

    def encode(self, topic, code):
        """The text of a code on acu/mode, acu/keyhole or acu/blockage."""
        lookahead = self.parts['state']['lookahead']
        if topic == KEYHOLE:
            return announcement.keyhole(lookahead, self.parameters.tracker.receiver.beamwidth)
        return announcement.hidden(lookahead) if topic == BLOCKAGE else modes.MODES[code]

    def request(self, name):
        """The Reply to a mode or reset_faults; a refusal names the reason."""
        mode = name.removeprefix('acu/')
        m, outputs = self.parts, self.parts['outputs']
        if mode == 'reset_faults':
            m['state']['unasked']['moves'] = m['state']['divergence']['diverged'] = 0
            return Reply(True, 'cleared')
        if self.silent and mode != 'standby':
            return Reply(False, f'refused: no {JOINTS}, the drive is silent; mode is {modes.MODES[outputs["mode"]]}')
        m['inputs']['drive_ready'] = self.inputs[0][DRIVE] <= READY
        granted = control_unit.request(m['state'], m['constants'], m['inputs'], outputs, self.memory.program,
                                       modes.MODES.index(mode))
        refusal = '' if granted else f'refused: {modes.REASONS[outputs["reason"]]}; '
        return Reply(bool(granted), f'{refusal}mode is {modes.MODES[outputs["mode"]]}')

    def requests_for(self, topic, text):
        """[the mode's service] for a text on acu/mode, else []."""
        return [f'acu/{text}'] if topic == MODE and text in modes.MODES else []

    def diagnose(self):
        """ERROR for invalid inputs since the last diagnosis, WARN for gated errors, overtravel or coasting."""
        state, outputs = self.parts['state'], self.parts['outputs']
        mode, reason = modes.MODES[outputs['mode']], modes.REASONS[outputs['reason']]
        invalid = [name for i, name in enumerate(signals.INVALID_INPUTS) if self.parts['invalid'] >> i & 1]
        self.parts['invalid'] = 0
        values = [('mode', mode), ('reason', reason), ('faults', ', '.join(self.faults)),
                  ('locked', str(int(outputs['locked']))), ('coasting', str(int(outputs['coasting']))),
                  ('drive', 'silent' if self.silent else self.drive_state),
                  ('invalid_input', ' '.join(invalid)), ('errors gated', str(int(outputs['gated']))),
                  ('rates gated', str(int(outputs['rates_gated']))),
                  ('ranges gated', str(int(outputs['ranges_gated'])))]
        kinds = ('angle', 'rate', 'acceleration')
        values += [(f'{axis} limited', ' '.join(kind for kind in kinds if outputs[f'{kind}_limited'][i]))
                   for i, axis in enumerate(topics.AXES)]
        for axis, innovation, nis in zip(topics.AXES, outputs['innovation'], outputs['nis']):
            values += [(f'{axis} innovation_deg', f'{math.degrees(innovation):.4g}'), (f'{axis} nis', f'{nis:.4g}')]
        values += [('blocked', str(int(outputs['blocked']))), *announcement.numbers(state['lookahead'])]
        if faults.MOVES_UNASKED in self.faults:
            rates = ', '.join(f'{axis} {rate:.3g} rad/s where {low:.3g} to {high:.3g} was commanded' for axis, (
                rate, low, high) in zip(topics.AXES, state['unasked']['measured']))
            return Diagnosis(ERROR, f'the antenna moves unasked: {rates}; acu/reset_faults once it is known why',
                             values)
        if faults.DIVERGED in self.faults:
            return Diagnosis(ERROR, "autotrack diverged: the receiver's errors led away from the target; "
                             'acu/reset_faults once their slope, phase and sign are right', values)
        if invalid == ['error_gated']:
            return Diagnosis(WARN, 'an error of the receiver was too far off to be believed', values)
        if invalid:
            return Diagnosis(ERROR, f'invalid input: {" ".join(invalid)}', values)
        if state['overtravel']:
            return Diagnosis(WARN, 'no turn of the azimuth holds the whole program track: it will stop at a limit',
                             values)
        return Diagnosis(WARN if outputs['coasting'] else OK, f'{mode} ({reason})', values)

    @property
    def calls(self):
        return self.CALLS if self.parts['state']['unasked']['moves'] else ()

    @property
    def faults(self):
        """Names of the faults that wait for acu/reset_faults."""
        state = self.parts['state']
        latched = state['unasked']['moves'], state['divergence']['diverged']
        return tuple(fault.name for fault, on in zip(faults.FAULTS, latched) if on)

    @property
    def alarm(self):
        state = self.parts['state']
        return bool(state['unasked']['moves'] or state['divergence']['diverged']
                    or self.parts['outputs']['reason'] == modes.SILENCE)

    @staticmethod
    def idle(numbers):
        """Not exercised where the receiver never locked or the mode was never autotrack."""
        if not np.isfinite(numbers[ERRORS][:, 0]).any():
            return 'the receiver never locked'
        return '' if 'autotrack' in numbers[MODE] else 'the ACU was never in autotrack'


def rows(message):
    """(times after the stamp (n,) [s], angles (n, 2) [rad]) of a JointTrajectory; raises ValueError where an axis or a
    position is missing."""
    if not set(topics.AXES) <= set(message.joint_names):
        raise ValueError(f'joint_names {message.joint_names}: must hold {" and ".join(topics.AXES)}')
    columns = [message.joint_names.index(axis) for axis in topics.AXES]
    for row, point in enumerate(message.points):
        if len(point.positions) != len(message.joint_names):
            raise ValueError(f'row {row}: {len(point.positions)} positions; must be {len(message.joint_names)}')
    times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return np.array(times), np.reshape(angles, (-1, len(columns)))
