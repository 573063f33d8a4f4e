import pytest

from acu_tracker import modes
from acu_tracker.modes import (
    ACCEPTED,
    AFTER_PROGRAM,
    ATTITUDE_INVALID,
    AUTOTRACK,
    BEFORE_PROGRAM,
    DRIVE_NOT_READY,
    ENCODER_INVALID,
    INS_ALIGNING,
    LOCKED,
    NO_PROGRAM,
    NO_REQUEST,
    NONE,
    NOT_LOCKED,
    OUTSIDE_LIMITS,
    PRESET,
    PROGRAM,
    REFUSED,
    REQUESTED,
    SIGNAL_LOST,
    STANDBY,
    STOW,
    UNKNOWN_MODE,
)


def next_mode(mode, request=NO_REQUEST, encoder_ok=True, drive_ready=True, attitude=NONE, program=NONE, stow=NONE,
              preset=NONE, locked=True, lost=False, handover=False):
    """Of a situation in which all is well but for what is named."""
    now = modes.situation(encoder_ok, drive_ready, attitude, stow, preset, program, NONE if locked else NOT_LOCKED,
                          SIGNAL_LOST if lost else NONE)
    return modes.next_mode(mode, request, now, handover)


@pytest.mark.parametrize('mode', range(len(modes.MODES)))
@pytest.mark.parametrize('request_', range(len(modes.MODES)))
def test_every_mode_is_reached_from_every_mode(mode, request_):
    assert next_mode(mode, request_) == (request_, REQUESTED, ACCEPTED)


@pytest.mark.parametrize('request_, changes, reason', [
    (STOW, dict(stow=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PRESET, dict(preset=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PROGRAM, dict(program=NO_PROGRAM), NO_PROGRAM),
    (PROGRAM, dict(program=BEFORE_PROGRAM), BEFORE_PROGRAM),
    (PROGRAM, dict(program=AFTER_PROGRAM), AFTER_PROGRAM),
    (PROGRAM, dict(program=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PROGRAM, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (AUTOTRACK, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (PROGRAM, dict(attitude=INS_ALIGNING), INS_ALIGNING),
    (AUTOTRACK, dict(attitude=INS_ALIGNING), INS_ALIGNING),
    (AUTOTRACK, dict(locked=False), NOT_LOCKED),
    (STOW, dict(encoder_ok=False), ENCODER_INVALID),
    (STOW, dict(drive_ready=False), DRIVE_NOT_READY),
    (PRESET, dict(drive_ready=False), DRIVE_NOT_READY),
    (PROGRAM, dict(drive_ready=False), DRIVE_NOT_READY),
    (AUTOTRACK, dict(drive_ready=False), DRIVE_NOT_READY),
    (len(modes.MODES), {}, UNKNOWN_MODE),
    (-2, {}, UNKNOWN_MODE),
])
def test_refusals_name_the_reason_and_change_nothing(request_, changes, reason):
    for mode in (STANDBY, STOW):
        if mode == STANDBY or changes.get('encoder_ok', True) and changes.get('drive_ready', True):
            assert next_mode(mode, request_, **changes) == (mode, reason, REFUSED)


def test_standby_is_never_refused():
    everything = dict(encoder_ok=False, drive_ready=False, attitude=ATTITUDE_INVALID)
    assert next_mode(AUTOTRACK, STANDBY, **everything) == (STANDBY, REQUESTED, ACCEPTED)


@pytest.mark.parametrize('mode, changes, expected', [
    (PROGRAM, dict(handover=True), (AUTOTRACK, LOCKED)),
    (PROGRAM, dict(handover=False), (PROGRAM, NONE)),
    (PROGRAM, dict(handover=True, locked=False), (PROGRAM, NONE)),
    (PROGRAM, dict(program=AFTER_PROGRAM), (STANDBY, AFTER_PROGRAM)),
    (PROGRAM, dict(program=NO_PROGRAM), (STANDBY, NO_PROGRAM)),
    (PROGRAM, dict(program=OUTSIDE_LIMITS), (PROGRAM, NONE)),
    (PROGRAM, dict(attitude=ATTITUDE_INVALID), (STANDBY, ATTITUDE_INVALID)),
    (AUTOTRACK, dict(lost=True), (PROGRAM, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=True, program=AFTER_PROGRAM), (STANDBY, SIGNAL_LOST)),
    (AUTOTRACK, dict(locked=False), (AUTOTRACK, NONE)),
    (PROGRAM, dict(attitude=INS_ALIGNING), (STANDBY, INS_ALIGNING)),
    (STOW, dict(attitude=INS_ALIGNING), (STOW, NONE)),
    (AUTOTRACK, dict(attitude=ATTITUDE_INVALID), (STANDBY, ATTITUDE_INVALID)),
    (PRESET, dict(attitude=ATTITUDE_INVALID), (PRESET, NONE)),
    (STOW, dict(attitude=ATTITUDE_INVALID, lost=True), (STOW, NONE)),
    (STANDBY, dict(encoder_ok=False, handover=True), (STANDBY, NONE)),
    (STANDBY, dict(drive_ready=False, handover=True), (STANDBY, NONE)),
] + [(mode, dict(encoder_ok=False), (STANDBY, ENCODER_INVALID)) for mode in (STOW, PRESET, PROGRAM, AUTOTRACK)]
  + [(mode, dict(drive_ready=False), (STANDBY, DRIVE_NOT_READY)) for mode in (STOW, PRESET, PROGRAM, AUTOTRACK)])
def test_what_happens_by_itself(mode, changes, expected):
    assert next_mode(mode, **changes) == (*expected, NO_REQUEST)


def test_a_refused_request_does_not_stop_a_fault():
    assert next_mode(AUTOTRACK, 9, encoder_ok=False) == (STANDBY, ENCODER_INVALID, REFUSED)
