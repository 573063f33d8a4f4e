"""Inputs and outputs of the control unit in one step."""
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
"""Names of the bits of outputs.invalid_input: bit i stands for INVALID_INPUTS[i]."""
Flag = bits(INVALID_INPUTS)

DRIVE_STATES = topics.TOPIC_BY_NAME['adu/state'].texts
DRIVE_READY = len(topics.ENABLED_STATES) - 1
DRIVE_EMERGENCY_STOP, FIRST_DRIVE_FAULT = DRIVE_STATES.index('emergency stop'), len(DRIVE_STATES)
"""Codes of adu/state.

Up to DRIVE_READY the drive follows commands; from FIRST_DRIVE_FAULT on the code stands for a fault. A drive that has
published no state, topics.NO_TEXT_CODE, counts as ready.
"""

INPUT_TOPICS = nodes.row('acu').reads
"""Topics that the control unit reads."""

INPUTS_DTYPE = np.dtype([
    *inputs.fields(INPUT_TOPICS),                                               # see the rows of topics.TOPICS
    ('stamp', 'f8'), ('encoder_valid', 'i8'),                                   # t_k [s]
    ('error_valid', 'i8'),                                                      # 0: no error, or unlocked
    ('stabilised', 'i8'), ('attitude_valid', 'i8'),                             # 1: the pedestal stands on a ship
    ('aligning', 'i8'), ('drive_ready', 'i8'),          # 1: the INS is still aligning; the drive follows the commands
    ('unpredicted', 'i8', (sum(row.table for row in MODE_ROWS),)),    # of the modes that follow a table: NONE or why
                                                        # there is no table
    ('gap', 'i8'), ('turnaround', 'i8'),                # 1: rows of the program are missing here; the last segment
                                                        # was refused because its turnaround is too fast
    ('preset', 'f8', (2,)), ('preset_valid', 'i8'),                             # deck angles
], align=True)

OUTPUTS_DTYPE = np.dtype([
    ('mode', 'i8'), ('reason', 'i8'),                                           # codes of MODES and REASONS
    ('rate', 'f8', (2,)), ('torque', 'f8', (2,)),                               # command [rad/s], feed-forward [Nm]
    ('estimate', 'f8', (2, 3)),                                                 # target at t_k; NaN: no estimate
    ('reference', 'f8', (2, 3)),                        # deck angle, rate, acceleration at t_k; of a beam: the
                                                        # command at t_m
    ('covariance', 'f8', (2, 3)),                                               # p11, p12, p22 at t_k
    ('probability', 'f8', (2, len(COLUMN_NAMES))),                               # of the motion models COLUMN_NAMES
    ('innovation', 'f8', (2,)), ('rate_innovation', 'f8', (2,)),                # nu of angle, rate; NaN: no error
    ('innovation_sigma', 'f8', (2,)),                                           # of the angle's, as predicted
    ('nis', 'f8', (2,)), ('gated', 'i8'),                                       # nu' S^-1 nu; errors gated so far
    ('rates_gated', 'i8'), ('ranges_gated', 'i8'),
    ('coasting', 'i8'), ('locked', 'i8'), ('blocked', 'i8'), ('invalid_input', 'i8'),
    ('time_to_limit', 'f8', (2,)),                                              # at the present rates [s]; inf: none
    ('alarms', 'i8'),                                                           # count of changes of the alarm list
    ('pins', 'i8'), ('pins_wrong', 'i8'),               # code of acu/stow_pins; bits of the axes whose pin failed
    ('angle_limited', 'i8', (2,)), ('rate_limited', 'i8', (2,)), ('acceleration_limited', 'i8', (2,)),
], align=True)


@compiled
def clear(o):
    """Reset the outputs at the start of a step."""
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
