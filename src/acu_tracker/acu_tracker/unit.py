"""The control unit between its messages: what it makes of those it hears, and what it puts into those it says.

The node answers one step at a time, a recomputed bag all of them at once, through the same `answers`.
"""
import math

import numpy as np

from acu_tracker import control_unit, modes
from acu_tracker.estimation.motion_models import MODELS
from acu_tracker.program import program_track
from pedestal_common import messages, records
from pedestal_common.compiled import compiled
from pedestal_common.records import NEVER

JOINTS, ERROR, ATTITUDE = 'joint_states', 'tracking_receiver/angle_error', 'ship/imu/data'
RATE, RANGE = 'tracking_receiver/angle_rate', 'tracking_receiver/range'
COMMAND, ESTIMATE, REFERENCE, MODE = 'acu/rate_command', 'acu/estimate', 'acu/reference', 'acu/mode'
FILTER, PROGRAM, DRIVE, INS = 'acu/filter', 'acu/program_track', 'adu/state', 'ins/state'
HEARD = records.of(JOINTS, ERROR, RATE, RANGE, ATTITUDE)
NUMBERS = len(messages.FILTER) // len(messages.AXES)
SAID = records.of(COMMAND, ESTIMATE, REFERENCE, FILTER, more=(MODE,))


class Acu:
    """The control unit of an AcuParameters; on_ship: its deck moves, and an attitude is heard.

    heard, said: the records (1,) of one step; messages: {topic: message} it says; followers: {topic: latency [s]} that
    a step waits for; events: {topic: function(message)} it hears besides; WORDS: {topic: function from its
    code in `said` to its text}.
    """
    HEARD, SAID, WORDS = HEARD, SAID, {MODE: modes.MODES.__getitem__}

    def __init__(self, params, on_ship):
        self.state = control_unit.initial_state(params)
        self.inputs, self.outputs = np.zeros(1, control_unit.INPUTS), np.zeros(1, control_unit.OUTPUTS)
        self.inputs[0]['stabilised'], self.inputs[0]['drive_ready'] = on_ship, 1
        self.outputs[0]['mode'] = modes.STANDBY
        control_unit.clear(self.outputs[0])
        self.program = program_track.NO_TRACK
        self.heard, self.said = np.zeros(1, HEARD), np.zeros(1, SAID)
        for name in HEARD.names:
            self.heard[name]['stamp'] = NEVER
        self.remembers = self.state, self.inputs, self.outputs
        self.messages = {COMMAND: messages.joint_state(messages.AXES),
                         ESTIMATE: messages.joint_trajectory('earth', [messages.trajectory_point()]),
                         REFERENCE: messages.joint_trajectory('base_link', [messages.trajectory_point()]),
                         FILTER: messages.named_numbers(messages.FILTER, 'earth')}
        self.followers = {ERROR: params.receiver_latency,
                          **({RATE: params.receiver_latency} if params.receiver_rate else {}),
                          **({RANGE: params.receiver_latency} if params.receiver_range else {}),
                          **({ATTITUDE: params.attitude_latency} if on_ship else {})}
        self.events = {PROGRAM: self.take_program, DRIVE: self.take_drive_state,
                       **({INS: self.take_ins_state} if on_ship else {})}
        self.configure(params)

    def configure(self, params):
        self.constants = control_unit.constants(params)

    def take_program(self, message):
        """Two or more points are a program track in earth angles, one a preset in deck angles. Raises ValueError."""
        times, angles = rows(message)
        if len(angles) == 1:
            self.inputs[0]['preset'], self.inputs[0]['preset_valid'] = angles[0], 1
        else:
            start = messages.nanoseconds(message.header.stamp) * 1e-9
            self.program = program_track.checked(times + start, angles)

    def take_drive_state(self, message):
        """A drive that never says how it is counts as ready."""
        self.inputs[0]['drive_ready'] = message.data == 'enabled'

    def take_ins_state(self, message):
        """An INS that never says how it is counts as aligned."""
        self.inputs[0]['aligning'] = message.data == 'aligning'

    def prepare(self):
        """Compile `answers` and `request`."""
        state, inputs, outputs = self.state.copy(), self.inputs.copy(), self.outputs.copy()
        answers(state, self.constants, inputs, outputs, self.program, self.heard, self.said.copy())
        control_unit.request(state, self.constants, inputs, outputs, self.program, modes.STANDBY)

    def request(self, service):
        """Ask for a mode by the name of its service between two steps; True when granted."""
        return self.ask(modes.MODES.index(service.removeprefix('acu/')))

    def services_to(self, mode):
        """The services that bring acu/mode to a mode."""
        return [f'acu/{mode}'] if mode in modes.MODES else []

    def ask(self, mode):
        """Ask for a mode (its code) between two steps; True when granted."""
        return bool(control_unit.request(self.state, self.constants, self.inputs, self.outputs, self.program, mode))

    def answer(self):
        """Answer `heard` with `said`."""
        self.answers(self.heard, self.said)

    def answers(self, heard, said):
        """The same for many steps, records (n,)."""
        answers(self.state, self.constants, self.inputs, self.outputs, self.program, heard, said)


@compiled
def hear(u, joints, error, rate, distance, attitude):
    """Records of the messages of a step -> inputs of the control unit; an attitude stays until the next. A rate or a
    range belongs to the error that was measured with it, or to none."""
    u.stamp = joints.stamp * 1e-9
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


@compiled
def say(o, stamp, command, estimate, reference, filtered):
    """Outputs of the control unit -> records of its messages."""
    command.stamp = estimate.stamp = reference.stamp = filtered.stamp = stamp
    for i in range(2):
        command.velocity[i], command.effort[i] = o.rate[i], o.torque[i]
        estimate.position[i], reference.position[i] = o.estimate[i, 0], o.reference[i, 0]
        estimate.velocity[i], reference.velocity[i] = o.estimate[i, 1], o.reference[i, 1]
        estimate.acceleration[i], reference.acceleration[i] = o.estimate[i, 2], o.reference[i, 2]
        # In the order of messages.FILTER.
        numbers = filtered.position[NUMBERS * i:]
        numbers[0], numbers[1], numbers[2] = o.innovation[i], o.rate_innovation[i], o.nis[i]
        numbers[3], numbers[4] = math.sqrt(o.covariance[i, 0]), math.sqrt(o.covariance[i, 2])
        numbers[5] = o.covariance[i, 1] / (numbers[3] * numbers[4])
        numbers[6] = o.innovation_sigma[i]
        for model in range(len(MODELS)):
            numbers[7 + model] = o.probability[i, model]


@compiled
def answers(state, constants, inputs, outputs, program, heard, said):
    """Step by step: said[k] answers heard[k]."""
    for k in range(len(heard)):
        h, y = heard[k], said[k]
        hear(inputs[0], h[JOINTS], h[ERROR], h[RATE], h[RANGE], h[ATTITUDE])
        control_unit.step(state, constants, inputs, outputs, program)
        inputs[0].preset_valid = 0
        say(outputs[0], h[JOINTS].stamp, y[COMMAND], y[ESTIMATE], y[REFERENCE], y[FILTER])
        y[MODE] = outputs[0].mode


def rows(message):
    """(times after the stamp (n,) [s], angles (n, 2) [rad]) of a JointTrajectory; ValueError when not there."""
    if not set(messages.AXES) <= set(message.joint_names):
        raise ValueError(f'joint_names {message.joint_names}: must hold {" and ".join(messages.AXES)}')
    columns = [message.joint_names.index(axis) for axis in messages.AXES]
    for row, point in enumerate(message.points):
        if len(point.positions) != len(message.joint_names):
            raise ValueError(f'row {row}: {len(point.positions)} positions; must be {len(message.joint_names)}')
    times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return np.array(times), np.reshape(angles, (-1, len(columns)))
