"""Law of one sample of an INS: frames, check of the frames, rates, and the reason why a sample is not published."""
import math

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Nanoseconds, Quaternion, RadiansPerSecond, Records, Vector3
from pedestal_common.record import Record
from pedestal_hardware.ins import frame_check, frames, rate_estimator


class Constants(Record):
    """Constants of a device."""
    frame: frames.Frame
    bandwidth: RadiansPerSecond     # of rate_estimator
    max_gap_ns: Nanoseconds         # longest time between two samples, after which the rates begin again
    checked: Bit                    # 1 if a failed check withholds the attitude


class State(Record):
    """State of the law."""
    check: frame_check.Check
    estimator: rate_estimator.Estimator
    runs: Bit               # 1 after the first sample
    last: Nanoseconds       # stamp of the last sample
    gaps: int               # number of gaps


class Inputs(Record):
    """Sample in the frames of the device."""
    stamp: Nanoseconds
    q: Quaternion
    w: Vector3              # rates [rad/s]
    force: Vector3          # specific force [m/s2] or NaN
    axes: int               # bit mask of the known rates, 0 for none


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

OUTCOMES = ('published', 'no_attitude', 'not_newer', 'tilted', 'too_fast', 'wrong_frame', 'settling')

Outcome = codes(OUTCOMES)


@compiled
def _is_attitude(q: Quaternion, w: Vector3, axes: int) -> bool:
    size = math.sqrt(q[0]**2 + q[1]**2 + q[2]**2 + q[3]**2)
    return abs(size - 1.0) < MAX_NORM_ERROR and (axes == 0 or math.isfinite(w[0] + w[1] + w[2]))


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
        settled, w, jumped = rate_estimator.take(state.estimator, inputs.stamp, outputs.q, constants.bandwidth)
        if jumped:
            return Outcome.TOO_FAST
        for i in range(3):
            outputs.w[i] = w[i]
    if settled and outputs.w[0]**2 + outputs.w[1]**2 + outputs.w[2]**2 > MAX_RATE_RAD_S**2:
        return Outcome.TOO_FAST
    if constants.checked and (state.check.verdict == frame_check.FRAME_WRONG or state.check.down):
        return Outcome.WRONG_FRAME
    return Outcome.PUBLISHED if settled else Outcome.SETTLING
