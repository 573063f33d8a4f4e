"""Inputs and outputs of the control unit in one step: the records that the law reads and writes."""
import math
from typing import Annotated

from acu_tracker.estimation.filters.motion_models import COLUMN_NAMES
from pedestal_common.codes import bits
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.quantities import (
    Bit,
    DecibelHertz,
    Floats,
    Ints,
    Meters,
    Pair,
    Quaternion,
    Radians,
    RadiansPerSecond,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record

INVALID_INPUTS = (
    'stamp',            # the stamp of the step does not advance, or is not finite
    'encoder',          # the encoder angles are missing or not finite
    'error',            # a number of the receiver is not finite
    'error_stamp',      # an error is not newer than the last one, or its time is outside the history of the encoders
    'error_gated',      # an error is outside the gate of the filter
    'attitude',         # the attitude is missing or not valid
    'program',          # a table contains an angle that is not finite
    'preset',           # a preset is not finite
    'step_gap',         # the previous step is more than the parameter step_gap ago
    'error_noisy',      # the errors of the receiver are only noise
    'attitude_error')   # the INS has published statistics of its error that are out of range
Flag = bits(INVALID_INPUTS)  # bits of outputs.invalid_input, by name

# Codes of adu/state. The drive follows commands if its code is at most DRIVE_READY. A code from FIRST_DRIVE_FAULT on
# is a fault. A drive that has published no state has the code topics.NO_TEXT_CODE and counts as ready.
DRIVE_STATES = topics.TOPIC_BY_NAME['adu/state'].texts
DRIVE_READY = len(topics.ENABLED_STATES) - 1
DRIVE_EMERGENCY_STOP, FIRST_DRIVE_FAULT = DRIVE_STATES.index('emergency stop'), len(DRIVE_STATES)

INPUT_TOPICS = nodes.row('acu').reads  # topics that the control unit reads


class Inputs(Record):
    """Inputs of a step: the numbers of INPUT_TOPICS (inputs.fields, topics.TOPICS), and what the unit adds."""
    position: Pair              # encoder angles [rad]
    velocity: Pair              # [rad/s]
    torque: Pair                # of the drive on the load [Nm]
    error_came: Bit             # 1 in a step in which a message of the receiver came
    error_stamp: Seconds
    cross_elevation: Radians
    elevation: Radians
    cn0_dbhz: DecibelHertz
    error_rate: Pair            # of the errors [rad/s]
    error_rate_sigma: RadiansPerSecond
    range: Meters
    range_variance: float       # [m2]
    attitude_stamp: Seconds
    quaternion: Quaternion
    deck_rate: Vector3
    attitude_error_came: Bit
    attitude_noise: Vector3
    attitude_walk: Vector3
    drive: int                  # code of adu/state
    pins: int                   # code of adu/stow_pins
    stamp: Seconds              # t_k of the step
    encoder_valid: Bit          # 1: angles have come
    error_valid: Bit            # 1: the receiver is locked and has published an error
    stabilised: Bit             # 1: the pedestal stands on a ship
    attitude_valid: Bit         # 1: an attitude has come
    aligning: Bit               # 1: the INS is still aligning
    drive_ready: Bit            # 1: the drive follows commands
    steps_lost: Bit             # 1: the drive reports too many lost steps
    # for each mode that follows a table: Reason.NONE, or why there is no table
    unpredicted: Annotated[Ints, (sum(row.table for row in MODE_ROWS),)]
    gap: Bit                    # 1: rows of the program are missing at t_k
    turnaround: Bit             # 1: the last segment was refused, its turnaround is too fast
    preset: Pair                # new preset, deck angles [rad]
    preset_valid: Bit           # 1: it came before this step


class Outputs(Record):
    """Outputs of a step."""
    mode: int                   # code of modes.MODES
    reason: int                 # code of modes.REASONS
    rate: Pair                  # rate command [rad/s]
    torque: Pair                # feed-forward torque [Nm]
    estimate: Annotated[Floats, (2, 3)]     # of the target at t_k: earth angle, rate, acceleration; NaN: no estimate
    # encoder angle, rate, acceleration at t_k; for a beam: the command at t_m, the middle of its interval
    reference: Annotated[Floats, (2, 3)]
    covariance: Annotated[Floats, (2, 3)]   # of the estimate: variance of the angle, covariance, variance of the rate
    probability: Annotated[Floats, (2, len(COLUMN_NAMES))]  # of the motion models COLUMN_NAMES
    innovation: Pair            # of the angle [rad]; NaN: no error
    rate_innovation: Pair       # of the rate [rad/s]; NaN: no error
    innovation_sigma: Pair      # predicted 1-sigma of the innovation of the angle [rad]
    nis: Pair                   # normalised innovation squared
    gated: int                  # number of gated errors so far
    rates_gated: int            # number of gated rates so far
    ranges_gated: int           # number of gated ranges so far
    coasting: Bit
    locked: Bit
    blocked: Bit
    arrived: Bit                # 1: the axes have reached the target of the mode
    invalid_input: int          # bits of Flag
    time_to_limit: Pair         # time to the next limit at the present rates [s]; inf: never
    alarms: int                 # number of changes of the list of alarms
    pins: int                   # code of acu/stow_pins
    pins_wrong: int             # bits of the axes whose pin failed
    angle_limited: Annotated[Ints, (2,)]
    rate_limited: Annotated[Ints, (2,)]
    acceleration_limited: Annotated[Ints, (2,)]


@compiled
def clear(outputs: Outputs) -> None:
    """Reset, at the start of a step, the outputs that a step may leave unwritten."""
    outputs.coasting, outputs.blocked, outputs.invalid_input = 0, 0, 0
    outputs.torque[:] = 0.0
    outputs.innovation[:] = math.nan
    outputs.rate_innovation[:] = math.nan
    outputs.innovation_sigma[:] = math.nan
    outputs.nis[:] = math.nan
    outputs.estimate[:] = math.nan
    outputs.covariance[:] = math.nan
    outputs.probability[:] = math.nan
    outputs.reference[:] = 0.0
    outputs.angle_limited[:] = 0
    outputs.rate_limited[:] = 0
    outputs.acceleration_limited[:] = 0
