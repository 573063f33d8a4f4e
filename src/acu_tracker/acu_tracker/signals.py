"""Inputs and outputs of the control unit in one step: the records that the law reads and writes.

`unit` converts messages to the inputs, and the outputs to messages. Pairs of numbers are (azimuth, elevation).
"""
import math

import numpy as np

from acu_tracker.estimation.filters.motion_models import COLUMN_NAMES
from pedestal_common.codes import bits
from pedestal_common.compiled import compiled
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.modes import MODE_ROWS
from pedestal_common.wire import inputs

INVALID_INPUTS = ('stamp', 'encoder', 'error', 'error_stamp', 'error_gated', 'attitude', 'program', 'preset',
                  'step_gap', 'error_noisy', 'attitude_error')
"""Names of the bits of outputs.invalid_input: bit i stands for INVALID_INPUTS[i].

stamp           the stamp of the step does not advance, or is not finite
encoder         the encoder angles are missing or not finite
error           a number of the receiver is not finite
error_stamp     an error is not newer than the last one, or its time is outside the history of the encoders
error_gated     an error is outside the gate of the filter
attitude        the attitude is missing or not valid
program         a table contains an angle that is not finite
preset          a preset is not finite
step_gap        the previous step is more than the parameter step_gap ago
error_noisy     the errors of the receiver are only noise
attitude_error  the INS has published statistics of its error that are out of range
"""
Flag = bits(INVALID_INPUTS)  # bits of outputs.invalid_input, by name

DRIVE_STATES = topics.TOPIC_BY_NAME['adu/state'].texts
DRIVE_READY = len(topics.ENABLED_STATES) - 1
DRIVE_EMERGENCY_STOP, FIRST_DRIVE_FAULT = DRIVE_STATES.index('emergency stop'), len(DRIVE_STATES)
"""Codes of adu/state.

The drive follows commands if its code is at most DRIVE_READY. A code from FIRST_DRIVE_FAULT on is a fault. A drive
that has published no state has the code topics.NO_TEXT_CODE and counts as ready.
"""

INPUT_TOPICS = nodes.row('acu').reads  # topics that the control unit reads

INPUTS_DTYPE = np.dtype([
    *inputs.fields(INPUT_TOPICS),                       # numbers of the topics, see topics.TOPICS
    ('stamp', 'f8'), ('encoder_valid', 'i8'),           # t_k, the stamp of the step [s]; 1: angles have come
    ('error_valid', 'i8'),                              # 1: the receiver is locked and has published an error
    ('stabilised', 'i8'), ('attitude_valid', 'i8'),     # 1: the pedestal stands on a ship; 1: an attitude has come
    ('aligning', 'i8'), ('drive_ready', 'i8'),          # 1: the INS is still aligning; 1: the drive follows commands
    ('unpredicted', 'i8', (sum(row.table for row in MODE_ROWS),)),    # for each mode that follows a
                                                        # table: Reason.NONE, or why there is no table
    ('gap', 'i8'), ('turnaround', 'i8'),                # 1: rows of the program are missing at t_k; 1: the last
                                                        # segment was refused, its turnaround is too fast
    ('preset', 'f8', (2,)), ('preset_valid', 'i8'),     # new preset, deck angles [rad]; 1: it came before this step
], align=True)
"""Inputs of a step."""

OUTPUTS_DTYPE = np.dtype([
    ('mode', 'i8'), ('reason', 'i8'),                   # codes of modes.MODES and modes.REASONS
    ('rate', 'f8', (2,)), ('torque', 'f8', (2,)),       # rate command [rad/s], feed-forward torque [Nm]
    ('estimate', 'f8', (2, 3)),                         # of the target at t_k: earth angle, rate, acceleration;
                                                        # NaN: no estimate
    ('reference', 'f8', (2, 3)),                        # encoder angle, rate, acceleration at t_k; for a beam: the
                                                        # command at t_m, the middle of its interval
    ('covariance', 'f8', (2, 3)),                       # of the estimate: variance of the angle, covariance, variance
                                                        # of the rate
    ('probability', 'f8', (2, len(COLUMN_NAMES))),      # of the motion models COLUMN_NAMES
    ('innovation', 'f8', (2,)), ('rate_innovation', 'f8', (2,)),    # of the angle and of the rate; NaN: no error
    ('innovation_sigma', 'f8', (2,)),                   # predicted 1-sigma of the innovation of the angle [rad]
    ('nis', 'f8', (2,)), ('gated', 'i8'),               # normalised innovation squared; number of gated errors so far
    ('rates_gated', 'i8'), ('ranges_gated', 'i8'),      # numbers of gated rates and ranges so far
    ('coasting', 'i8'), ('locked', 'i8'), ('blocked', 'i8'), ('invalid_input', 'i8'),   # flags; bits of Flag
    ('time_to_limit', 'f8', (2,)),                      # time to the next limit at the present rates [s]; inf: never
    ('alarms', 'i8'),                                   # number of changes of the list of alarms
    ('pins', 'i8'), ('pins_wrong', 'i8'),               # code of acu/stow_pins; bits of the axes whose pin failed
    ('angle_limited', 'i8', (2,)), ('rate_limited', 'i8', (2,)), ('acceleration_limited', 'i8', (2,)),
], align=True)
"""Outputs of a step."""


@compiled
def clear(o):
    """Reset, at the start of a step, the outputs o that a step may leave unwritten."""
    o.coasting, o.blocked, o.invalid_input = 0, 0, 0
    o.torque[:] = 0.0
    o.innovation[:] = math.nan
    o.rate_innovation[:] = math.nan
    o.innovation_sigma[:] = math.nan
    o.nis[:] = math.nan
    o.estimate[:] = math.nan
    o.covariance[:] = math.nan
    o.probability[:] = math.nan
    o.reference[:] = 0.0
    o.angle_limited[:] = 0
    o.rate_limited[:] = 0
    o.acceleration_limited[:] = 0
