"""The mode machine: which target the antenna follows, and why. One pure transition function."""
from pedestal_common.compiled import compiled

MODES = ('standby', 'stow', 'preset', 'program', 'autotrack')
STANDBY, STOW, PRESET, PROGRAM, AUTOTRACK = range(len(MODES))

REASONS = ('none', 'requested', 'locked', 'signal lost', 'encoder invalid', 'attitude invalid', 'no program track',
           'before program track', 'after program track', 'receiver not locked', 'outside limits', 'unknown mode',
           'stamp does not advance', 'drive not ready', 'INS aligning', 'blocked', 'keyhole')
(NONE, REQUESTED, LOCKED, SIGNAL_LOST, ENCODER_INVALID, ATTITUDE_INVALID, NO_PROGRAM, BEFORE_PROGRAM,
 AFTER_PROGRAM, NOT_LOCKED, OUTSIDE_LIMITS, UNKNOWN_MODE, BAD_STAMP, DRIVE_NOT_READY, INS_ALIGNING,
 BLOCKED, KEYHOLE) = range(len(REASONS))

NO_REQUEST, REFUSED, ACCEPTED = -1, 0, 1


@compiled
def obstacle(request, encoder_ok, drive_ready, attitude, program, stow, preset, locked):
    """Why a mode cannot be entered now, NONE if it can. `attitude`, `program`, `stow`, `preset`: NONE or their own
    obstacle."""
    if request == STANDBY:
        return NONE
    if request < STANDBY or request > AUTOTRACK:
        return UNKNOWN_MODE
    if not encoder_ok:
        return ENCODER_INVALID
    if not drive_ready:
        return DRIVE_NOT_READY
    if request == STOW:
        return stow
    if request == PRESET:
        return preset
    if attitude != NONE:
        return attitude
    if request == PROGRAM:
        return program
    return NONE if locked else NOT_LOCKED


@compiled
def next_mode(mode, request, encoder_ok, drive_ready, attitude, program, stow, preset, locked, lost, handover):
    """(mode, reason, result) of one step.

    request     mode asked for, NO_REQUEST for none
    drive_ready the drive follows commands; a mode that runs ends with it, and none begins without it
    locked      the receiver has delivered long enough and the filter has converged
    lost        the coast time is over
    handover    program -> autotrack by itself once locked
    reason      NONE where nothing happened
    """
    result = NO_REQUEST
    if request != NO_REQUEST:
        why = obstacle(request, encoder_ok, drive_ready, attitude, program, stow, preset, locked)
        if why == NONE:
            return request, REQUESTED, ACCEPTED
        result = REFUSED
    else:
        why = NONE
    if mode == STANDBY:
        return mode, why, result
    if not encoder_ok:
        return STANDBY, ENCODER_INVALID, result
    if not drive_ready:
        return STANDBY, DRIVE_NOT_READY, result
    if mode == PROGRAM or mode == AUTOTRACK:
        if attitude != NONE:
            return STANDBY, attitude, result
        if mode == PROGRAM and locked and handover:
            return AUTOTRACK, LOCKED, result
        if mode == PROGRAM and program != NONE and program != OUTSIDE_LIMITS:
            return STANDBY, program, result
        if mode == AUTOTRACK and lost:
            return (PROGRAM if program == NONE else STANDBY), SIGNAL_LOST, result
    return mode, why, result
