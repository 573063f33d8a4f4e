"""The modes search, acquire and steptrack, which use the signal level: the C/N0 of the receiver.

The modes move the beam about the expected place of the target. `acquisition` and `step_track` are the laws of these
motions.

`way` is the program, rotated to the place where the target was last tracked.
"""
import math
from typing import TYPE_CHECKING

from acu_tracker import modes
from acu_tracker.estimation import target
from acu_tracker.geometry.vector import Motion, Vector
from acu_tracker.modes import Mode, Reason
from acu_tracker.program import bridge, program_track
from acu_tracker.search import acquisition, level, pattern, place, side_lobe, step_track
from acu_tracker.search.acquisition import Acquisition
from acu_tracker.search.pattern import Point
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, Seconds

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants

SIDE_LOBE_TIME_S = 0.3
"""Time for which the level must be that of a side lobe before autotrack ends [s].

The time may begin in the mode program, before autotrack. Because the filter diverges within 0.4 s on the slopes of a
side lobe, the time is shorter.
"""


@compiled
def expected(state: Acquisition, way: bridge.Way, t: Seconds) -> Motion:
    """Return the motion in earth angles of the expected place of the target at t.

    The place follows the program, rotated to where the target was last tracked. Without a program it is the last
    place, moved on with a rate that fades.
    """
    if program_track.status(way.program, t) != Reason.NONE:
        return place.motion_at(state.place, t)
    return bridge.motion_at(way, t)


@compiled
def source(state: Acquisition, mode: int, constants: 'Constants', way: bridge.Way, t: Seconds) -> target.Source:
    """Return the target.Source to which the beam points at t: the expected place plus the offset of the mode."""
    motion = expected(state, way, t)
    return target.Source(0, place.displaced(motion, _offset(state, mode, constants, t, motion)))


@compiled
def _offset(state: Acquisition, mode: int, constants: 'Constants', t: Seconds, motion: Motion) -> Point:
    """Return the offset of the beam from the expected place at t, in cross-elevation and elevation.

    motion: of the expected place in earth angles.
    """
    beamwidth = constants.p.tracker.receiver.beamwidth
    if mode == Mode.SEARCH:
        p, _ = acquisition.searched(state, constants.p.search, constants.p.acquisition.time_constant, beamwidth, t)
        return pattern.rotated(p, place.track(motion))
    if mode == Mode.ACQUIRE:
        return acquisition.acquired(state, beamwidth, t)
    return Point(state.centre[0], state.centre[1], 0.0, 0.0)


@compiled
def advance(state: Acquisition, mode: int, constants: 'Constants', inputs: Inputs, way: bridge.Way) -> bool:
    """Take the level of a step and advance the running mode. Return True if acquire has found a slope of wrong sign.

    mode: the mode of the previous step. While the beam is off the target, the level is noise alone; the function then
    learns the statistics of the noise.
    """
    p, beamwidth = constants.p.acquisition, constants.p.tracker.receiver.beamwidth
    new = inputs.error_stamp > state.level.stamp and math.isfinite(inputs.cn0_dbhz)
    waiting = mode == Mode.SEARCH and acquisition.waiting(state, constants.p.search, inputs.stamp)
    if inputs.error_valid:
        level.restart_noise(state.level, p)
    elif new and math.isfinite(state.level.stamp) and (waiting or not modes.FOLLOWS_TARGET[mode]):
        level.learn(state.level, p, inputs.cn0_dbhz, min(inputs.error_stamp - state.level.stamp, p.time_constant))
    level.take(state.level, p, inputs.cn0_dbhz, inputs.error_stamp, inputs.error_valid != 0)
    if mode == Mode.SEARCH and new:
        # The receiver smooths the level, which therefore belongs to the offset one time constant ago.
        t = inputs.error_stamp - p.time_constant
        offset = _offset(state, mode, constants, t, expected(state, way, t))
        acquisition.note_peak(state, (offset.x, offset.y))
    elif mode == Mode.ACQUIRE:
        acquisition.acquire(state, p, beamwidth, inputs.stamp, inputs.range)
    elif mode == Mode.STEPTRACK:
        present = state.level.below_loss < p.loss_time
        state.centre[0], state.centre[1] = step_track.step(
            state.step_track, constants.p.steptrack, beamwidth, p.time_constant, inputs.stamp,
            inputs.cn0_dbhz if new else math.nan, present)
    level_on_axis = side_lobe.expected(p.expected_dbhz, p.reference_range, p.range_exponent, inputs.range)
    judged = mode == Mode.PROGRAM or mode == Mode.AUTOTRACK
    # A level is called fair if it is not suspected to be that of a side lobe.
    fair = not judged or not inputs.error_valid or not side_lobe.suspected(inputs.cn0_dbhz, level_on_axis)
    if fair:
        state.fair = inputs.stamp
    return mode == Mode.ACQUIRE and state.phase == acquisition.Phase.WRONG_SLOPE


@compiled
def in_side_lobe(state: Acquisition, constants: 'Constants', t: Seconds) -> bool:
    """Return True if the level has been that of a side lobe for SIDE_LOBE_TIME_S up to t."""
    return constants.p.acquisition.expected_dbhz > 0.0 and t - state.fair > SIDE_LOBE_TIME_S


@compiled
def found(state: Acquisition, mode: int, constants: 'Constants') -> bool:
    """Return True if the mode search may hand over to acquire, or the mode acquire to autotrack."""
    if mode == Mode.SEARCH:
        return acquisition.peak_passed(state, constants.p.acquisition)
    return state.phase == acquisition.Phase.CHECKED


@compiled
def end(state: Acquisition, mode: int, constants: 'Constants', t: Seconds) -> int:
    """Return the reason why a mode that uses the signal level ends at t, or NONE."""
    p, beamwidth = constants.p.acquisition, constants.p.tracker.receiver.beamwidth
    if mode == Mode.SEARCH:
        _, over = acquisition.searched(state, constants.p.search, p.time_constant, beamwidth, t)
        return Reason.NOT_FOUND if over else Reason.NONE
    if mode == Mode.ACQUIRE:
        if state.phase == acquisition.Phase.WRONG_SLOPE:
            return Reason.WRONG_SLOPE
        return Reason.SIGNAL_LOST if acquisition.failed(state, p, t) else Reason.NONE
    if mode == Mode.STEPTRACK and state.level.below_loss >= p.loss_time:
        return Reason.SIGNAL_LOST
    return Reason.NONE


@compiled
def begin(state: Acquisition, mode: int, constants: 'Constants', t: Seconds, spread: Radians) -> None:
    """Enter a mode that uses the signal level at t.

    spread: standard deviation of the expected place, across the line of sight; NaN if it is not known.
    """
    level.restart_times(state.level)
    if mode == Mode.SEARCH:
        acquisition.begin_search(state, constants.p.search, constants.p.tracker.receiver.beamwidth, t, spread)
    elif mode == Mode.ACQUIRE:
        acquisition.begin_acquire(state, t)
    else:
        step_track.start(state.step_track, t, state.centre[0], state.centre[1])


@compiled
def remember(state: Acquisition, t: Seconds, u: Vector, du: Vector) -> None:
    """Store the expected place of the target at t: an ENU unit vector u and its rate du [1/s]."""
    place.remember(state.place, t, u, du)
    state.centre[0] = state.centre[1] = 0.0
