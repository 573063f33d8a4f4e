"""Conditions of the alarms in a step: which rows of the table of alarms have their condition.

The conditions come from the detectors of both axes, from the state of the drive, and from facts of the control unit.
The result is a number with one bit for each alarm (table.Bit), which the annunciator takes.

s: record of Supervision; u, o: records of signals.Inputs.dtype and of signals.Outputs; facts: the Facts.
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker import modes, signals
from acu_tracker.alarms import annunciator, detectors, table
from acu_tracker.modes import Mode, Reason
from acu_tracker.servo import position_loop
from acu_tracker.signals import Flag
from pedestal_common.compiled import compiled
from pedestal_common.quantities import BothAxes, Vector3
from pedestal_common.record import Record


class Supervision(Record):
    """State of the alarms and of their conditions."""
    axis: BothAxes[detectors.AxisDetectors]  # state of the detectors of each axis
    previous: Vector3  # errors [rad] and C/N0 [dB-Hz] of the receiver in the previous step
    least: float  # lowest C/N0 received so far [dB-Hz]
    ready: float  # last stamp at which the drive was ready [s]
    lost: int  # bits of the axes that had only one motor at that stamp: 1 azimuth, 2 elevation
    alarms: annunciator.AlarmList  # state of the annunciator


INVALID_INPUT_FLAGS = Flag.ENCODER | Flag.ERROR | Flag.ERROR_STAMP | Flag.PROGRAM | Flag.PRESET | Flag.ATTITUDE_ERROR
"""Flags of refused inputs, except the attitude, which has the alarm `INS lost`."""

BRAKE_GRIP_DEADLINE_S = 2.5
"""Time within which the brakes must hold after the drive has ceased to follow commands [s].

The time is longer than the longest stop of the drive.
"""

JUDGED_ALWAYS, JUDGED_WITH_MOTORS, JUDGED_MOVING, JUDGED_FOLLOWING = table.JUDGED_ALARM_BITS
"""Bits of the alarms of each of table.JUDGED_CASES."""

Facts = namedtuple('Facts', 'dt gap lost latched attitude_lost attitude_jumped signal_lost unasked_rate beamwidth')
"""Facts of a step for the alarms.

dt               time since the previous step [s]; 0 after a gap
gap              length of a gap before this step [s]; 0: no gap, inf: first step
lost             True if steps are missing between the previous step and this one
latched          bits of the latched faults that wait for a reset
attitude_lost    True if the attitude of a ship is not known
attitude_jumped  True if a jump of the attitude is being corrected
signal_lost      True if autotrack has lost its signal without an explanation
unasked_rate     excess over the commanded rates that counts as uncommanded motion [rad/s]
beamwidth        beamwidth of the receiver [rad]
"""

DRIVE_SILENCE_GAP_S = 0.3  # gap between two steps above which the drive was silent [s]


def initialise(s):
    """Begin without a condition; s: view of Supervision."""
    s['least'], s['ready'] = np.inf, -np.inf
    s['axis']['y'] = np.nan
    annunciator.initialise(s['alarms'])


@compiled
def _of_motors(d, i, u, envelope, p, facts):
    """Return the bits of the alarms of axis i that follow from its encoder, its motors and its commands.

    d         record of AxisDetectors of the axis
    envelope  record of uncommanded_motion.Envelope
    p         record of AxisParameters

    The bit of an azimuth alarm, shifted left by i, is the bit of axis i.
    """
    # surge: acceleration that the axis may have had in lost steps [rad/s2].
    y, dy, high, low = u.position[i], u.velocity[i], envelope.high[i], envelope.low[i]
    bits, surge = 0, detectors.MAX_ACCELERATION_RATIO * p.limits.acceleration if facts.lost else 0.0
    x = detectors.encoder_motor_mismatch(d, y, dy, facts.dt, surge)
    if detectors.encoder_jump(x):
        bits |= table.Bit.AZIMUTH_ENCODER_JUMP
    if detectors.encoder_stuck(d, y, dy, facts.dt):
        bits |= table.Bit.AZIMUTH_ENCODER_STUCK
    if detectors.disagreement(d, x, facts.dt):
        bits |= table.Bit.AZIMUTH_ENCODER_DISAGREEMENT
    if detectors.brake_not_released(d, u.torque[i], dy, high, low, p.feedforward, facts.dt):
        bits |= table.Bit.AZIMUTH_BRAKE_NOT_RELEASED
    if detectors.immobile(d, dy, high, low):
        bits |= table.Bit.AZIMUTH_IMMOBILE
    if detectors.opposes_command(dy, high, low, facts.unasked_rate):
        bits |= table.Bit.AZIMUTH_RUNAWAY
    return bits << i


@compiled
def _of_loop(d, i, e, o, facts):
    """Return the bits of the alarms of axis i that follow from its following error e [rad] and its limits.

    d: record of AxisDetectors. The following error does not count while the command is limited in rate or
    acceleration.
    """
    bits, limited = 0, o.rate_limited[i] or o.acceleration_limited[i]
    if o.angle_limited[i]:
        bits |= table.Bit.AZIMUTH_AT_LIMIT
    if detectors.following_error(d, 0.0 if limited else e, facts.beamwidth):
        bits |= table.Bit.AZIMUTH_FOLLOWING_ERROR
    if detectors.oscillation(d, e, facts.dt):
        bits |= table.Bit.AZIMUTH_OSCILLATION
    return bits << i


@compiled
def _of_axes(s, mode, u, o, c, envelope, facts):
    """Return the bits of the alarms of both axes; an electronic beam has none of them.

    c: records (2,) of control_unit.AxisConstants; envelope: record of uncommanded_motion.Envelope.
    """
    bits, off = 0, u.stamp - s.ready > BRAKE_GRIP_DEADLINE_S
    for i in range(2):
        p, d, y, dy = c[i].p, s.axis[i], u.position[i], u.velocity[i]
        if p.controller == position_loop.CONTROLLER_BEAM:
            continue
        if facts.gap > 0.0 or not math.isfinite(d.y + d.dy):
            detectors.initialise(d, y, dy)
        if math.isfinite(y + dy):
            bits |= _of_motors(d, i, u, envelope, p, facts)
            if detectors.moves(d, dy) and off:
                bits |= table.Bit.AZIMUTH_BRAKE_NOT_GRIPPING << i
            if mode != Mode.STANDBY:
                bits |= _of_loop(d, i, o.reference[i, 0] - y, o, facts)
        d.y, d.dy = y, dy
    return bits


@compiled
def _of_drive(s, u):
    """Return the bits of the alarms that the drive itself reports by u.drive, a code of adu/state."""
    if u.drive_ready:
        # The code of a ready drive is a number whose bits are the axes with one motor (topics.ENABLED_STATES), or -1
        # before the drive has published its state.
        s.ready, s.lost = u.stamp, max(u.drive, 0)
    # The bit of the elevation alarm follows that of the azimuth alarm. The product therefore sets the bits of exactly
    # the axes in s.lost.
    bits = s.lost * table.Bit.AZIMUTH_MOTOR_LOST
    if u.drive == signals.DRIVE_EMERGENCY_STOP:
        bits |= table.Bit.EMERGENCY_STOP
    elif u.drive >= signals.FIRST_DRIVE_FAULT:
        bits |= table.Bit.DRIVE_FAULT
    return bits


@compiled
def _repeated(s, u):
    """Return True if the receiver repeats the numbers of the previous step.

    Because of noise a working receiver never does so. An unlocked receiver publishes only the level. The lowest level
    so far may repeat, because it may be the fixed level of an empty sky.
    """
    previous, z = s.previous, u.cn0_dbhz
    same = z == previous[2] and (u.cross_elevation == previous[0] and u.elevation == previous[1] if u.error_valid else
                                 z > s.least)
    previous[0], previous[1], previous[2] = u.cross_elevation, u.elevation, z
    if z < s.least:
        s.least = z
    return same


@compiled
def _of_unit(s, u, o, facts):
    """Return the bits of the alarms that follow from the inputs and from the Facts."""
    bits = facts.latched
    if 0.0 < facts.gap < math.inf:
        bits |= table.Bit.TIME_JUMP | (table.Bit.DRIVE_SILENT if facts.gap > DRIVE_SILENCE_GAP_S else 0)
    if not u.error_came or _repeated(s, u):
        bits |= table.Bit.RECEIVER_SILENT
    if facts.attitude_lost:
        bits |= table.Bit.INS_LOST
    if facts.attitude_jumped:
        bits |= table.Bit.INS_JUMP
    if facts.signal_lost:
        bits |= table.Bit.SIGNAL_LOST
    if o.invalid_input & Flag.ERROR_NOISY:
        bits |= table.Bit.RECEIVER_NOISY
    if o.invalid_input & INVALID_INPUT_FLAGS:
        bits |= table.Bit.INVALID_INPUT
    return bits | o.pins_wrong * table.Bit.AZIMUTH_STOW_PIN | _of_program(u, o)


@compiled
def _of_program(u, o):
    """Return the bits of the alarms of the program track: a refused segment, or the reason why it is not followed."""
    bits = table.Bit.PROGRAM_TURNAROUND if u.turnaround else 0
    if o.reason == Reason.BEFORE_PROGRAM:
        return bits | table.Bit.PROGRAM_TOO_EARLY
    if o.reason == Reason.PROGRAM_GAP:
        return bits | table.Bit.PROGRAM_GAP
    return bits | (table.Bit.PROGRAM_ENDED if o.reason == Reason.AFTER_PROGRAM else 0)


@compiled
def _judged(mode, c):
    """Return the bits of the alarms that have a meaning in a mode; the others are suppressed.

    c: records (2,) of control_unit.AxisConstants.
    """
    motors = c[0].p.controller != position_loop.CONTROLLER_BEAM or c[1].p.controller != position_loop.CONTROLLER_BEAM
    return (JUDGED_ALWAYS | (JUDGED_WITH_MOTORS if motors else 0) | (JUDGED_MOVING if mode != Mode.STANDBY else 0)
            | (JUDGED_FOLLOWING if modes.FOLLOWS_TARGET[mode] else 0))


@compiled
def take(s, mode, u, o, c, envelope, facts):
    """Determine the conditions of all alarms in a step, and update the alarms.

    mode      code of the mode; standby while the mode commands no motion
    c         records (2,) of control_unit.AxisConstants
    envelope  record of uncommanded_motion.Envelope
    """
    bits = _of_drive(s, u) | _of_unit(s, u, o, facts) | _of_axes(s, mode, u, o, c, envelope, facts)
    if facts.gap > 0.0:
        annunciator.restart(s.alarms, u.stamp)
    annunciator.update(s.alarms, u.stamp, bits, _judged(mode, c))
