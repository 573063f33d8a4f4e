"""Law of one sample of an INS: frames, check of the frames, rates, and the reason why a sample is not published."""
import math

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.geometry.quaternion import product
from pedestal_common.quantities import Bit, Nanoseconds, Quaternion, Radians, RadiansPerSecond, Records, Vector3
from pedestal_common.record import Record
from pedestal_hardware.ins import frame_check, frames, rate_estimator


class Constants(Record):
    """Constants of a device."""
    frame: frames.Frame
    bandwidth: RadiansPerSecond     # of rate_estimator
    oldest_ns: Nanoseconds          # largest age of a heading of HDT
    max_gap_ns: Nanoseconds         # longest time between two samples, after which the rates begin again
    checked: Bit                    # 1 if a failed check withholds the attitude


class State(Record):
    """State of the law."""
    check: frame_check.Check
    estimator: rate_estimator.Estimator
    runs: Bit               # 1 after the first sample
    last: Nanoseconds       # stamp of the last sample
    gaps: int               # number of gaps
    course: rate_estimator.Estimator    # of the headings of HDT
    headings: int           # number of the headings since the begin of `course`


class Inputs(Record):
    """Sample in the frames of the device."""
    stamp: Nanoseconds
    q: Quaternion
    w: Vector3              # rates [rad/s]
    force: Vector3          # specific force [m/s2] or NaN
    axes: int               # bit mask of the known rates, 0 for none
    yaw: Radians            # yaw in q [rad], if its rate is known; otherwise not used
    yaw_rate: RadiansPerSecond      # rate of yaw, NaN if it follows from q


class Outputs(Record):
    """Sample in the frames of the graph."""
    q: Quaternion           # deck -> earth
    w: Vector3              # deck rate [rad/s]
    force: Vector3          # specific force [m/s2]


class InputRecord(Record):
    """All data of the law."""
    constants: Constants
    state: State
    inputs: Inputs
    outputs: Outputs


MAX_NORM_ERROR = 0.01  # largest difference of the length of a quaternion from 1
MAX_RATE_RAD_S = 2.0  # largest rate of a deck [rad/s]

MIN_HEADINGS = 4  # number of headings from which their rate is used: one more than the filter has states

OUTCOMES = ('published', 'no_attitude', 'not_newer', 'tilted', 'too_fast', 'wrong_frame', 'settling')

Outcome = codes(OUTCOMES)


@compiled
def _is_attitude(q: Quaternion, w: Vector3, axes: int) -> bool:
    size = math.sqrt(q[0]**2 + q[1]**2 + q[2]**2 + q[3]**2)
    return abs(size - 1.0) < MAX_NORM_ERROR and (axes == 0 or math.isfinite(w[0] + w[1] + w[2]))


@compiled
def take_heading(records: Records, stamp: Nanoseconds, yaw: Radians) -> None:
    """Take the yaw of an HDT into InputRecords (1,)."""
    constants, state = records[0].constants, records[0].state
    course = state.course
    if course.runs and stamp <= course.last:
        return
    if course.runs and stamp - course.last > constants.oldest_ns:
        rate_estimator.restart(course)
    if not course.runs or course.jumps == rate_estimator.MAX_JUMPS:
        state.headings = 0
    rate_estimator.take(course, stamp, (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)), constants.bandwidth)
    state.headings += 1


@compiled
def predict_yaw(records: Records, stamp: Nanoseconds,
                turn: RadiansPerSecond) -> tuple[Radians, RadiansPerSecond, bool]:
    """Return (yaw, its rate, True if the rate is settled) after the last HDT. turn: rate of a ROT, NaN without."""
    constants, state = records[0].constants, records[0].state
    course = state.course
    T = (stamp - course.last) * 1e-9
    rate, change = turn, T * turn
    settled = not math.isnan(turn) or state.headings >= MIN_HEADINGS and (
        (course.last - course.since) * 1e-9 * constants.bandwidth >= rate_estimator.SETTLING_TIME_CONSTANTS)
    if math.isnan(turn):
        rate, change = course.w[2] + T * course.dw[2], T * (course.w[2] + 0.5 * T * course.dw[2])
    return 2.0 * math.atan2(course.q[2], course.q[3]) + change, rate, settled


@compiled
def _estimate(state: State, inputs: Inputs, outputs: Outputs, bandwidth: RadiansPerSecond) -> tuple[bool, bool]:
    """Fill outputs.w by the rates of the attitudes. Return (True if they are settled, True for a jump). With a known
    rate of yaw the filter takes the attitude without its yaw, and this rate is added about the vertical."""
    if math.isnan(inputs.yaw_rate):
        settled, w, jumped = rate_estimator.take(state.estimator, inputs.stamp, outputs.q, bandwidth)
    else:
        x, y, z, r = outputs.q[0], outputs.q[1], outputs.q[2], outputs.q[3]
        level = product((0.0, 0.0, -math.sin(0.5 * inputs.yaw), math.cos(0.5 * inputs.yaw)), outputs.q)
        settled, w, jumped = rate_estimator.take(state.estimator, inputs.stamp, level, bandwidth)
        # The vertical in axes of the deck is the third row of the matrix of q.
        up = (2.0 * (x * z - y * r), 2.0 * (y * z + x * r), 1.0 - 2.0 * (x * x + y * y))
        w = (w[0] + inputs.yaw_rate * up[0], w[1] + inputs.yaw_rate * up[1], w[2] + inputs.yaw_rate * up[2])
    for i in range(3):
        outputs.w[i] = w[i]
    return settled, jumped


@compiled
def step(records: Records) -> int:
    """Convert the sample in the inputs of InputRecords (1,). Return the code of its outcome."""
    record = records[0]
    constants, state, inputs, outputs = record.constants, record.state, record.inputs, record.outputs
    if not _is_attitude(inputs.q, inputs.w, inputs.axes):
        return Outcome.NO_ATTITUDE
    if state.runs and inputs.stamp <= state.last:
        return Outcome.NOT_NEWER
    if inputs.axes == frame_check.ALL_AXES and inputs.w[0]**2 + inputs.w[1]**2 + inputs.w[2]**2 > MAX_RATE_RAD_S**2:
        return Outcome.TOO_FAST
    if state.runs and inputs.stamp - state.last > constants.max_gap_ns:
        state.gaps += 1
        frame_check.restart(state.check)
        rate_estimator.restart(state.estimator)
    state.runs, state.last = 1, inputs.stamp
    frame = constants.frame
    q = frames.attitude(frame, inputs.q)
    w, force = frames.on_deck(frame, inputs.w), frames.on_deck(frame, inputs.force)
    size = math.sqrt(q[0]**2 + q[1]**2 + q[2]**2 + q[3]**2)
    for i in range(4):
        outputs.q[i] = q[i] / size
    for i in range(3):
        outputs.w[i], outputs.force[i] = w[i], force[i]
    if inputs.axes:
        frame_check.take(state.check, inputs.stamp, outputs.q, outputs.w, outputs.force, inputs.axes)
    # The cosine of the tilt is the third diagonal element of the matrix of q.
    if 1.0 - 2.0 * (outputs.q[0]**2 + outputs.q[1]**2) < 0.5:
        return Outcome.TILTED
    settled = True
    if inputs.axes != frame_check.ALL_AXES:
        settled, jumped = _estimate(state, inputs, outputs, constants.bandwidth)
        if jumped:
            return Outcome.TOO_FAST
    if settled and outputs.w[0]**2 + outputs.w[1]**2 + outputs.w[2]**2 > MAX_RATE_RAD_S**2:
        return Outcome.TOO_FAST
    if constants.checked and (state.check.verdict == frame_check.FRAME_WRONG or state.check.down):
        return Outcome.WRONG_FRAME
    return Outcome.PUBLISHED if settled else Outcome.SETTLING
