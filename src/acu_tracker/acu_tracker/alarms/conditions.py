"""Conditions of the alarms in a step: a number with one bit for each alarm (table.Bit), for the annunciator.

The product of a bit and a condition is the bit if the condition holds, else 0.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker import modes, signals
from acu_tracker.alarms import annunciator, detectors, table
from acu_tracker.alarms.table import Bit
from acu_tracker.modes import Mode, Reason
from acu_tracker.servo import drive_watch, position_loop
from acu_tracker.signals import Flag, Inputs, Outputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import (
    BothAxes,
    DecibelHertz,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.control_unit import AxisConstants
    from acu_tracker.params import AxisParameters


class Supervision(Record):
    """State of the alarms and of their conditions."""
    axis: BothAxes[detectors.AxisDetectors]
    previous: Vector3       # errors [rad] and C/N0 [dB-Hz] of the receiver in the previous step
    least: DecibelHertz     # lowest C/N0 received so far
    ready: Seconds          # last stamp at which the drive was ready
    lost: int               # bits of the axes that had only one motor at that stamp: 1 azimuth, 2 elevation
    alarms: annunciator.AlarmList


# Flags of refused inputs, except the attitude, which has the alarm `INS lost`.
INVALID_INPUT_FLAGS = Flag.ENCODER | Flag.ERROR | Flag.ERROR_STAMP | Flag.PROGRAM | Flag.PRESET | Flag.ATTITUDE_ERROR

# Time within which the brakes must hold after the drive has ceased to follow commands [s]. The time is longer than the
# longest stop of the drive.
BRAKE_GRIP_DEADLINE_S = 2.5
DRIVE_SILENCE_GAP_S = 0.3  # gap between two steps above which the drive was silent [s]

JUDGED_ALWAYS, JUDGED_WITH_MOTORS, JUDGED_MOVING, JUDGED_FOLLOWING = table.JUDGED_ALARM_BITS


class Facts(NamedTuple):
    """Facts of a step for the alarms."""
    dt: Seconds             # time since the previous step; 0 after a gap
    gap: Seconds            # length of a gap before this step; 0: no gap, inf: first step
    lost: bool              # True if steps are missing between the previous step and this one
    latched: int            # bits of the latched faults that wait for a reset
    attitude_lost: bool      # True if the attitude of a ship is not known
    attitude_jumped: bool    # True if a jump of the attitude is being corrected
    signal_lost: bool        # True if autotrack has lost its signal without an explanation
    unasked_rate: RadiansPerSecond      # excess over the commanded rates that counts as uncommanded motion
    beamwidth: Radians      # of the receiver


def initialise(supervision: Records) -> None:
    """Begin without a condition."""
    supervision['least'], supervision['ready'] = np.inf, -np.inf
    supervision['axis']['y'] = np.nan
    annunciator.initialise(supervision['alarms'])


@compiled
def _of_motors(axis: detectors.AxisDetectors, i: int, inputs: Inputs, envelope: drive_watch.Envelope,
               params: 'AxisParameters', facts: Facts) -> int:
    """Return the bits of the alarms of axis i that follow from its encoder, its motors and its commands."""
    # surge: acceleration that the axis may have had in lost steps [rad/s2].
    y, dy, high, low = inputs.position[i], inputs.velocity[i], envelope.high[i], envelope.low[i]
    surge = detectors.MAX_ACCELERATION_RATIO * params.limits.acceleration if facts.lost else 0.0
    x = detectors.encoder_motor_mismatch(axis, y, dy, facts.dt, surge)
    resisted = detectors.brake_not_released(axis, inputs.torque[i], dy, high, low, params.feedforward, facts.dt)
    bits = Bit.AZIMUTH_ENCODER_JUMP * (abs(x) > detectors.MAX_STEP_MISMATCH_RAD)
    bits |= Bit.AZIMUTH_ENCODER_STUCK * detectors.encoder_stuck(axis, y, dy, facts.dt)
    bits |= Bit.AZIMUTH_ENCODER_DISAGREEMENT * detectors.disagreement(axis, x, facts.dt)
    bits |= Bit.AZIMUTH_BRAKE_NOT_RELEASED * resisted
    bits |= Bit.AZIMUTH_IMMOBILE * detectors.immobile(axis, dy, high, low)
    bits |= Bit.AZIMUTH_RUNAWAY * detectors.opposes_command(axis, dy, high, low, facts.unasked_rate, facts.dt)
    return bits << i


@compiled
def _of_loop(axis: detectors.AxisDetectors, i: int, e: Radians, outputs: Outputs, facts: Facts) -> int:
    """Return the bits of the alarms of axis i that follow from its following error e and its limits."""
    # The following error does not count while the command is limited in rate or acceleration; its hidden part does.
    limited = outputs.rate_limited[i] or outputs.acceleration_limited[i]
    total = detectors.hide_error(axis, e, facts.dt) + (0.0 if limited else e)
    bits = Bit.AZIMUTH_AT_LIMIT * (outputs.angle_limited[i] != 0)
    bits |= Bit.AZIMUTH_FOLLOWING_ERROR * detectors.following_error(axis, total, facts.beamwidth)
    bits |= Bit.AZIMUTH_OSCILLATION * detectors.oscillation(axis, e, facts.dt)
    return bits << i


@compiled
def _of_axes(supervision: Supervision, mode: int, inputs: Inputs, outputs: Outputs,
             constants: BothAxes['AxisConstants'], envelope: drive_watch.Envelope, facts: Facts) -> int:
    """Return the bits of the alarms of both axes; an electronic beam has none of them."""
    bits, off = 0, inputs.stamp - supervision.ready > BRAKE_GRIP_DEADLINE_S
    for i in range(2):
        params, axis, y, dy = constants[i].p, supervision.axis[i], inputs.position[i], inputs.velocity[i]
        if int(params.controller) == position_loop.CONTROLLER_BEAM:
            continue
        if facts.gap > 0.0 or not math.isfinite(axis.y + axis.dy):
            detectors.initialise(axis, y, dy)
        if math.isfinite(y + dy):
            bits |= _of_motors(axis, i, inputs, envelope, params, facts)
            bits |= Bit.AZIMUTH_BRAKE_NOT_GRIPPING * (detectors.moves(axis, dy) and off) << i
            if mode != Mode.STANDBY:
                bits |= _of_loop(axis, i, outputs.reference[i, 0] - y, outputs, facts)
        axis.y, axis.dy = y, dy
    return bits


@compiled
def _of_drive(supervision: Supervision, inputs: Inputs) -> int:
    """Return the bits of the alarms that the drive itself reports by its code of adu/state."""
    if inputs.drive_ready:
        # The code of a ready drive is a number whose bits are the axes with one motor (topics.ENABLED_STATES), or -1
        # before the drive has published its state.
        supervision.ready, supervision.lost = inputs.stamp, max(inputs.drive, 0)
    # The bit of the elevation alarm follows that of the azimuth alarm. The product therefore sets the bits of exactly
    # these axes.
    bits = Bit.AZIMUTH_MOTOR_LOST * supervision.lost
    bits |= Bit.EMERGENCY_STOP * (inputs.drive == signals.DRIVE_EMERGENCY_STOP)
    return bits | Bit.DRIVE_FAULT * (inputs.drive >= signals.FIRST_DRIVE_FAULT)


@compiled
def _repeated(supervision: Supervision, inputs: Inputs) -> bool:
    """Return True if the receiver repeats the numbers of the previous step.

    Because of noise a working receiver never does so. An unlocked receiver publishes only the level. The lowest level
    so far may repeat, because it may be the fixed level of an empty sky.
    """
    previous, z = supervision.previous, inputs.cn0_dbhz
    x, e = inputs.cross_elevation, inputs.elevation
    same = z == previous[2] and (x == previous[0] and e == previous[1] if inputs.error_valid else
                                 z > supervision.least)
    previous[0], previous[1], previous[2] = x, e, z
    if z < supervision.least:
        supervision.least = z
    return same


@compiled
def _of_unit(supervision: Supervision, inputs: Inputs, outputs: Outputs, facts: Facts) -> int:
    bits = facts.latched | Bit.AZIMUTH_STOW_PIN * outputs.pins_wrong
    bits |= Bit.TIME_JUMP * (0.0 < facts.gap < math.inf)
    bits |= Bit.DRIVE_SILENT * (DRIVE_SILENCE_GAP_S < facts.gap < math.inf)
    bits |= Bit.STEPS_LOST * (inputs.steps_lost != 0)
    bits |= Bit.RECEIVER_SILENT * (inputs.error_came == 0 or _repeated(supervision, inputs))
    bits |= Bit.RECEIVER_NOISY * (outputs.invalid_input & Flag.ERROR_NOISY != 0)
    bits |= Bit.INVALID_INPUT * (outputs.invalid_input & INVALID_INPUT_FLAGS != 0)
    bits |= Bit.INS_LOST * facts.attitude_lost
    bits |= Bit.INS_JUMP * facts.attitude_jumped
    bits |= Bit.SIGNAL_LOST * facts.signal_lost
    bits |= Bit.PROGRAM_TURNAROUND * (inputs.turnaround != 0)
    bits |= Bit.PROGRAM_TOO_EARLY * (outputs.reason == Reason.BEFORE_PROGRAM)
    bits |= Bit.PROGRAM_GAP * (outputs.reason == Reason.PROGRAM_GAP)
    return bits | Bit.PROGRAM_ENDED * (outputs.reason == Reason.AFTER_PROGRAM)


@compiled
def _judged(mode: int, constants: BothAxes['AxisConstants']) -> int:
    """Return the bits of the alarms that have a meaning in a mode; the others are suppressed."""
    motors = (int(constants[0].p.controller) != position_loop.CONTROLLER_BEAM
              or int(constants[1].p.controller) != position_loop.CONTROLLER_BEAM)
    return (JUDGED_ALWAYS | JUDGED_WITH_MOTORS * motors | JUDGED_MOVING * (mode != Mode.STANDBY)
            | JUDGED_FOLLOWING * modes.FOLLOWS_TARGET[mode])


@compiled
def take(supervision: Supervision, mode: int, inputs: Inputs, outputs: Outputs, constants: BothAxes['AxisConstants'],
         envelope: drive_watch.Envelope, facts: Facts) -> None:
    """Determine the conditions of all alarms, and update the alarms. mode: standby while it commands no motion."""
    bits = _of_drive(supervision, inputs) | _of_unit(supervision, inputs, outputs, facts)
    bits |= _of_axes(supervision, mode, inputs, outputs, constants, envelope, facts)
    if facts.gap > 0.0:
        annunciator.restart(supervision.alarms, inputs.stamp)
    annunciator.update(supervision.alarms, inputs.stamp, bits, _judged(mode, constants))
