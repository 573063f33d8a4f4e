"""Law of a rotator: its set-point, from the reference of the control unit.

    set-point = reference in the range of the device, in steps of its resolution

The control unit computes the reference for the time at which the device has reached it (`command_delay`). A new
set-point is sent when the reference has moved from the last set-point by more than the dead band, because each
set-point starts and stops the motors of a rotator.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Nanoseconds, Pair, Radians, Records
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

MAX_REFERENCE_RAD = 1e3  # largest valid angle of a reference [rad]; a reference beyond it, infinite or NaN is ignored

MAX_START_DISTANCE_RAD = 0.05
"""Largest distance of the measured angles from the reference at which a mode with commanded rates may begin [rad].
After a stop the control unit still holds the reference of the mode before, to which the rotator must not move."""


class Constants(Record):
    """Constants of the device."""
    dead_band: Radians
    resolution: Pair            # smallest step [rad]
    low: Pair                   # lower end of the range [rad]
    high: Pair                  # upper end of the range [rad], the lower one of an axis that the device has not
    timeout_ns: Nanoseconds     # age from which a reference is stale


class State(Record):
    """State of the law."""
    set_point: Pair                     # the last one [rad]
    moving: Bit                         # 1 if it is in force, 0 after a stop
    reference_stamp_ns: Nanoseconds     # of the newest valid reference


class Inputs(Record):
    """Inputs of a step."""
    stamp_ns: Nanoseconds
    enabled: Bit                        # 1 if the drive is enabled and the mode moves the antenna
    by_hand: Bit                        # 1 in a mode in which an operator commands rates
    reference_stamp_ns: Nanoseconds     # of the newest reference, NO_STAMP without a new one
    angle: Pair                         # of the newest reference [rad]
    rate: Pair                          # of the newest reference [rad/s]
    measured: Pair                      # measured angles [rad]


class Outputs(Record):
    """Outputs of a step."""
    send: Bit           # 1 for a set-point to send
    stop: Bit           # 1 for a stop to send
    set_point: Pair     # [rad]
    stale: Bit          # 1 for a stale reference
    invalid: Bit        # 1 for an invalid reference
    outside: Bit        # 1 for a target outside the range of the device
    far: Bit            # 1 for a mode `rate` that would begin far from the measured angles


def initial_state() -> Records:
    """Return State (1,) without a set-point."""
    s = State.zeros()
    s['reference_stamp_ns'] = NO_STAMP
    return s


@compiled
def valid(inputs: Inputs, state: State) -> bool:
    """Return True if the reference of a step is finite, in range, and newer than the reference before."""
    for i in range(2):
        if not (abs(inputs.angle[i]) <= MAX_REFERENCE_RAD and abs(inputs.rate[i]) <= MAX_REFERENCE_RAD):
            return False
    return inputs.reference_stamp_ns > state.reference_stamp_ns


@compiled
def step(state: State, constants: Constants, inputs: Inputs, outputs: Outputs) -> None:
    """Compute the set-point of a step."""
    outputs.send = outputs.stop = outputs.invalid = outputs.outside = 0
    came = inputs.reference_stamp_ns != NO_STAMP
    if came and not valid(inputs, state):
        came, outputs.invalid = False, 1
    if came:
        state.reference_stamp_ns = inputs.reference_stamp_ns
    last = state.reference_stamp_ns
    outputs.stale = 1 if last == NO_STAMP or inputs.stamp_ns - last > constants.timeout_ns else 0
    if inputs.enabled == 0 or outputs.stale == 1:
        outputs.stop, state.moving = state.moving, 0
        return
    if not came:
        return
    outputs.far = 0
    for i in range(2):
        distance = abs(inputs.angle[i] - inputs.measured[i]) if constants.low[i] < constants.high[i] else 0.0
        outputs.far |= inputs.by_hand == 1 and state.moving == 0 and distance > MAX_START_DISTANCE_RAD
    if outputs.far == 1:
        return
    moved = state.moving == 0
    for i in range(2):
        target = inputs.angle[i]
        if not constants.low[i] <= target <= constants.high[i]:
            target = min(max(target, constants.low[i]), constants.high[i])
            outputs.outside |= 1 if constants.low[i] < constants.high[i] else 0
        outputs.set_point[i] = constants.resolution[i] * np.round(target / constants.resolution[i])
        # The second condition avoids that the same set-point is sent again, because of a step above the dead band.
        moved |= abs(target - state.set_point[i]) > constants.dead_band and outputs.set_point[i] != state.set_point[i]
    if moved:
        outputs.send = state.moving = 1
        for i in range(2):
            state.set_point[i] = outputs.set_point[i]
