"""Law of one sample of an INS: frames, check of the frames, rates, and the reason why a sample is not published."""
import math
from typing import Annotated

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Vector3
from pedestal_common.record import Record
from pedestal_hardware.ins import frame_check, frames, rate_estimator


class Constants(Record):
    """frame: of the device; bandwidth: of rate_estimator [rad/s]; max_gap_ns: longest time between two samples, after
    which the rates begin again; checked: 1 if a failed check withholds the attitude.
    """
    frame: frames.Frame
    bandwidth: float
    max_gap_ns: int
    checked: int


class State(Record):
    """runs: 1 after the first sample; last: its stamp [ns]; gaps: number of gaps."""
    check: frame_check.Check
    estimator: rate_estimator.Estimator
    runs: int
    last: int
    gaps: int


class Inputs(Record):
    """Sample in the frames of the device: stamp [ns], quaternion, rates [rad/s], specific force [m/s2] or NaN; axes: bit
    mask of the known rates, 0 for none.
    """
    stamp: int
    q: Annotated[Floats, (4,)]
    w: Vector3
    force: Vector3
    axes: int


class Outputs(Record):
    """Sample in the frames of the graph: quaternion deck -> earth, deck rate [rad/s], specific force [m/s2]."""
    q: Annotated[Floats, (4,)]
    w: Vector3
    force: Vector3


class UnitRecord(Record):
    """Record."""
    constants: Constants
    state: State
    inputs: Inputs
    outputs: Outputs


MAX_NORM_ERROR = 0.01  # largest difference of the length of a quaternion from 1
MAX_RATE_RAD_S = 2.0  # largest rate of a deck [rad/s]

OUTCOMES = ('published', 'no_attitude', 'not_newer', 'tilted', 'too_fast', 'wrong_frame', 'settling')
"""Outcomes of a sample, in the order of their codes."""

Outcome = codes(OUTCOMES)


@compiled
def _is_attitude(q, w, axes):
    """Return True if q has the length 1 and the known rates are finite."""
    size = math.sqrt(q[0]**2 + q[1]**2 + q[2]**2 + q[3]**2)
    return abs(size - 1.0) < MAX_NORM_ERROR and (axes == 0 or math.isfinite(w[0] + w[1] + w[2]))


@compiled
def step(record):
    """Convert the sample in the inputs. Return the code of its outcome; record: (1,) of Record."""
    m = record[0]
    c, s, u, o = m.constants, m.state, m.inputs, m.outputs
    if not _is_attitude(u.q, u.w, u.axes):
        return Outcome.NO_ATTITUDE
    if s.runs and u.stamp <= s.last:
        return Outcome.NOT_NEWER
    if u.axes == frame_check.ALL_AXES and u.w[0]**2 + u.w[1]**2 + u.w[2]**2 > MAX_RATE_RAD_S**2:
        return Outcome.TOO_FAST
    if s.runs and u.stamp - s.last > c.max_gap_ns:
        s.gaps += 1
        frame_check.restart(s.check)
        rate_estimator.restart(s.estimator)
    s.runs, s.last = 1, u.stamp
    q, w, force = frames.attitude(c.frame, u.q), frames.on_deck(c.frame, u.w), frames.on_deck(c.frame, u.force)
    size = math.sqrt(q[0]**2 + q[1]**2 + q[2]**2 + q[3]**2)
    for i in range(4):
        o.q[i] = q[i] / size
    for i in range(3):
        o.w[i], o.force[i] = w[i], force[i]
    if u.axes:
        frame_check.take(s.check, u.stamp, o.q, o.w, o.force, u.axes)
    # The cosine of the tilt is the third diagonal element of the matrix of q.
    if 1.0 - 2.0 * (o.q[0]**2 + o.q[1]**2) < 0.5:
        return Outcome.TILTED
    settled = True
    if u.axes != frame_check.ALL_AXES:
        settled, w, jumped = rate_estimator.take(s.estimator, u.stamp, o.q, c.bandwidth)
        if jumped:
            return Outcome.TOO_FAST
        for i in range(3):
            o.w[i] = w[i]
    if settled and o.w[0]**2 + o.w[1]**2 + o.w[2]**2 > MAX_RATE_RAD_S**2:
        return Outcome.TOO_FAST
    if c.checked and (s.check.verdict == frame_check.FRAME_WRONG or s.check.down):
        return Outcome.WRONG_FRAME
    return Outcome.PUBLISHED if settled else Outcome.SETTLING
