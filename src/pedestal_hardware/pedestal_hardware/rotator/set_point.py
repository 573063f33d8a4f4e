"""Law of a rotator: its set-point, from the reference of the control unit.

    set-point = reference in the range of the device, in steps of its resolution

The control unit computes the reference for the time at which the device has reached it (`command_delay`). A new
set-point is sent when the reference has moved from the last set-point by more than the dead band, because each
set-point starts and stops the motors of a rotator.

Records: s State, c Constants, u Inputs, y Outputs.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Pair
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

MAX_REFERENCE_RAD = 1e3  # largest valid angle of a reference [rad]; a reference beyond it, infinite or NaN is ignored

MAX_START_DISTANCE_RAD = 0.05
"""Largest distance of the measured angles from the reference at which a mode with commanded rates may begin [rad].

After a stop the control unit still holds the reference of the mode before, to which the rotator must not move.
"""


class Constants(Record):
    """Constants: dead band and resolution [rad], range of azimuth and elevation [rad], age from which a
    reference is stale [ns].
    """
    dead_band: float
    resolution: float
    low: Pair
    high: Pair
    timeout_ns: int


class State(Record):
    """State: last set-point [rad]; 1 if it is in force, 0 after a stop; stamp of the newest valid reference [ns]."""
    set_point: Pair
    moving: int
    reference_stamp_ns: int


class Inputs(Record):
    """Inputs: stamp of the step [ns]; 1 if the drive is enabled and the mode moves the antenna; 1 in a mode in which an
    operator commands rates; stamp [ns], angles [rad] and rates [rad/s] of the newest reference, NO_STAMP without a new
    one; measured angles [rad].
    """
    stamp_ns: int
    enabled: int
    by_hand: int
    reference_stamp_ns: int
    angle: Pair
    rate: Pair
    measured: Pair


class Outputs(Record):
    """Outputs: 1 for a set-point [rad] to send; 1 for a stop to send; 1 for a stale reference, for an invalid reference,
    for a target outside the range of the device, and for a mode `rate` that would begin far from the measured angles.
    """
    send: int
    stop: int
    set_point: Pair
    stale: int
    invalid: int
    outside: int
    far: int


def initial_state() -> np.ndarray:
    """Return State (1,) without a set-point."""
    s = State.zeros()
    s['reference_stamp_ns'] = NO_STAMP
    return s


@compiled
def valid(u, s):
    """Return True if the reference of a step is finite, in range, and newer than the reference before."""
    for i in range(2):
        if not (abs(u.angle[i]) <= MAX_REFERENCE_RAD and abs(u.rate[i]) <= MAX_REFERENCE_RAD):
            return False
    return u.reference_stamp_ns > s.reference_stamp_ns


@compiled
def step(s, c, u, y):
    """Compute the set-point of a step."""
    y.send = y.stop = y.invalid = y.outside = 0
    came = u.reference_stamp_ns != NO_STAMP
    if came and not valid(u, s):
        came, y.invalid = False, 1
    if came:
        s.reference_stamp_ns = u.reference_stamp_ns
    y.stale = 1 if s.reference_stamp_ns == NO_STAMP or u.stamp_ns - s.reference_stamp_ns > c.timeout_ns else 0
    if u.enabled == 0 or y.stale == 1:
        y.stop, s.moving = s.moving, 0
        return
    if not came:
        return
    y.far = 0
    for i in range(2):
        y.far |= u.by_hand == 1 and s.moving == 0 and abs(u.angle[i] - u.measured[i]) > MAX_START_DISTANCE_RAD
    if y.far == 1:
        return
    moved = s.moving == 0
    for i in range(2):
        target = u.angle[i]
        if not c.low[i] <= target <= c.high[i]:
            target, y.outside = min(max(target, c.low[i]), c.high[i]), 1
        y.set_point[i] = c.resolution * np.round(target / c.resolution)
        # The second condition avoids that the same set-point is sent again, because of a step above the dead band.
        moved |= abs(target - s.set_point[i]) > c.dead_band and y.set_point[i] != s.set_point[i]
    if moved:
        y.send = s.moving = 1
        for i in range(2):
            s.set_point[i] = y.set_point[i]
