import pytest

from acu_tracker import modes
from acu_tracker.modes import NO_REQUEST, REQUEST_ACCEPTED, REQUEST_REFUSED, Mode, Reason

M, R = Mode, Reason


def next_mode(mode, request=NO_REQUEST, encoder_ok=True, drive_ready=True, attitude=R.NONE, program=R.NONE,
              stow=R.NONE, preset=R.NONE, slave=R.NONE, locked=True, lost=R.NONE, level=R.NONE, handover=False,
              chosen=M.PROGRAM, pins=R.NONE, tle=R.NONE, sun=R.NONE, table=M.PROGRAM):
    """Of a situation in which all is well but for what is named."""
    conditions = modes.Conditions(
        nothing=R.NONE, stow=stow, pin=R.PINS_OUT if pins == R.NONE else R.NONE, preset=preset, direction=slave,
        program=program, tle=tle, sun=sun, lock=R.NONE if locked else R.NOT_LOCKED, slope=R.NONE, track=lost,
        level=level)
    drive = R.NONE if drive_ready else R.DRIVE_NOT_READY
    now = modes.Situation(encoder_ok, drive, attitude, pins, handover, table, chosen, conditions)
    return modes.next_mode(mode, request, now)


CONDITIONS = {
    'stow': ('stow', ''), 'unstow': ('pin', 'pin'), 'preset': ('preset', ''), 'slave': ('direction', 'direction'),
    'program': ('program', 'program'), 'tle': ('tle', 'tle'), 'sun': ('sun', 'sun'), 'autotrack': ('lock', 'track'),
    'search': ('slope', 'level'), 'acquire': ('slope', 'level'), 'steptrack': ('', 'level')}
"""{mode: the condition that it needs, the one that ends it}; of all others none."""


def test_each_mode_has_its_own_conditions():
    assert {row.name: (row.needs, row.ends) for row in modes.MODE_ROWS if row.needs or row.ends} == CONDITIONS


@pytest.mark.parametrize('condition', modes.Conditions._fields[1:])
@pytest.mark.parametrize('mode', range(1, len(modes.MODES)))
def test_a_condition_that_does_not_hold_bars_and_ends_the_modes_of_its_own_and_no_other(mode, condition):
    why = modes.Conditions(*(R.DIVERGED if name == condition else R.NONE for name in modes.Conditions._fields))
    now = modes.Situation(True, R.NONE, R.NONE, R.NONE, False, M.PROGRAM, M.PROGRAM, why)
    needs, ends = CONDITIONS.get(modes.MODES[mode], ('', ''))
    assert modes.obstacle(mode, now) == (R.DIVERGED if needs == condition else R.NONE)
    assert (modes.next_mode(mode, NO_REQUEST, now).reason == R.DIVERGED) == (ends == condition)


MOVING = tuple(mode for mode, row in enumerate(modes.MODE_ROWS) if not row.pinned and mode != M.STANDBY)
"""Modes in which the axes move, or may."""


@pytest.mark.parametrize('mode', range(len(modes.MODES)))
@pytest.mark.parametrize('request_', range(len(modes.MODES)))
def test_every_mode_is_reached_from_every_mode(mode, request_):
    if request_ == M.UNSTOW:                              # what is not stowed cannot be unstowed
        assert next_mode(M.STANDBY, M.UNSTOW) == (M.STANDBY, R.PINS_OUT, REQUEST_REFUSED)
    else:
        assert next_mode(mode, request_) == (request_, R.REQUESTED, REQUEST_ACCEPTED)


@pytest.mark.parametrize('mode', range(len(modes.MODES)))
@pytest.mark.parametrize('request_', range(len(modes.MODES)))
def test_with_a_pin_not_out_only_stow_and_unstow_are_entered(mode, request_):
    able, stays = request_ in (M.STANDBY, M.STOW, M.UNSTOW), mode if mode not in MOVING else M.STANDBY
    for ready in (False, True):
        got = next_mode(mode, request_, drive_ready=ready, pins=R.PINNED)
        assert got == ((request_, R.REQUESTED, REQUEST_ACCEPTED) if able else (stays, R.PINNED, REQUEST_REFUSED))
        failed = next_mode(mode, request_, drive_ready=ready, pins=R.PIN_FAILED)
        assert failed == (M.STANDBY, *((R.REQUESTED, REQUEST_ACCEPTED) if request_ == M.STANDBY else
                                       (R.PIN_FAILED, REQUEST_REFUSED)))


@pytest.mark.parametrize('request_, changes, reason', [
    (M.STOW, dict(stow=R.OUTSIDE_LIMITS), R.OUTSIDE_LIMITS),
    (M.PRESET, dict(preset=R.OUTSIDE_LIMITS), R.OUTSIDE_LIMITS),
    (M.PROGRAM, dict(program=R.NO_PROGRAM), R.NO_PROGRAM),
    (M.PROGRAM, dict(program=R.BEFORE_PROGRAM), R.BEFORE_PROGRAM),
    (M.PROGRAM, dict(program=R.AFTER_PROGRAM), R.AFTER_PROGRAM),
    (M.PROGRAM, dict(program=R.OUTSIDE_LIMITS), R.OUTSIDE_LIMITS),
    (M.PROGRAM, dict(program=R.PROGRAM_GAP), R.PROGRAM_GAP),
    (M.TLE, dict(tle=R.TOO_OLD), R.TOO_OLD),
    (M.TLE, dict(tle=R.BELOW_HORIZON), R.BELOW_HORIZON),
    (M.TLE, dict(attitude=R.ATTITUDE_INVALID), R.ATTITUDE_INVALID),
    (M.SUN, dict(sun=R.BELOW_HORIZON), R.BELOW_HORIZON),
    (M.SUN, dict(attitude=R.INS_ALIGNING), R.INS_ALIGNING),
    (M.PROGRAM, dict(attitude=R.ATTITUDE_INVALID), R.ATTITUDE_INVALID),
    (M.AUTOTRACK, dict(attitude=R.ATTITUDE_INVALID), R.ATTITUDE_INVALID),
    (M.PROGRAM, dict(attitude=R.INS_ALIGNING), R.INS_ALIGNING),
    (M.AUTOTRACK, dict(attitude=R.INS_ALIGNING), R.INS_ALIGNING),
    (M.AUTOTRACK, dict(locked=False), R.NOT_LOCKED),
    (M.SLAVE, dict(slave=R.NO_DIRECTION), R.NO_DIRECTION),
    (M.SLAVE, dict(attitude=R.ATTITUDE_INVALID), R.ATTITUDE_INVALID),
    (M.STOP, dict(encoder_ok=False), R.ENCODER_INVALID),
    (M.RATE, dict(drive_ready=False), R.DRIVE_NOT_READY),
    (M.STOW, dict(encoder_ok=False), R.ENCODER_INVALID),
    (M.STOW, dict(drive_ready=False), R.DRIVE_NOT_READY),
    (M.PRESET, dict(drive_ready=False), R.DRIVE_NOT_READY),
    (M.PROGRAM, dict(drive_ready=False), R.DRIVE_NOT_READY),
    (M.AUTOTRACK, dict(drive_ready=False), R.DRIVE_NOT_READY),
    (len(modes.MODES), {}, R.UNKNOWN_MODE),
    (-2, {}, R.UNKNOWN_MODE),
])
def test_refusals_name_the_reason_and_change_nothing(request_, changes, reason):
    for mode in (M.STANDBY, M.STOW):
        if mode == M.STANDBY or changes.get('encoder_ok', True) and changes.get('drive_ready', True):
            assert next_mode(mode, request_, **changes) == (mode, reason, REQUEST_REFUSED)


def test_standby_is_never_refused():
    everything = dict(encoder_ok=False, drive_ready=False, attitude=R.ATTITUDE_INVALID)
    assert next_mode(M.AUTOTRACK, M.STANDBY, **everything) == (M.STANDBY, R.REQUESTED, REQUEST_ACCEPTED)


@pytest.mark.parametrize('mode, changes, expected', [
    (M.PROGRAM, dict(handover=True), (M.AUTOTRACK, R.LOCKED)),
    (M.PROGRAM, dict(handover=False), (M.PROGRAM, R.NONE)),
    (M.PROGRAM, dict(handover=True, locked=False), (M.PROGRAM, R.NONE)),
    (M.PROGRAM, dict(program=R.AFTER_PROGRAM), (M.STANDBY, R.AFTER_PROGRAM)),
    (M.PROGRAM, dict(program=R.NO_PROGRAM), (M.STANDBY, R.NO_PROGRAM)),
    (M.PROGRAM, dict(program=R.OUTSIDE_LIMITS), (M.PROGRAM, R.NONE)),
    (M.PROGRAM, dict(attitude=R.ATTITUDE_INVALID), (M.STANDBY, R.ATTITUDE_INVALID)),
    (M.PROGRAM, dict(program=R.PROGRAM_GAP), (M.STANDBY, R.PROGRAM_GAP)),
    (M.TLE, dict(handover=True), (M.AUTOTRACK, R.LOCKED)),
    (M.TLE, dict(tle=R.BELOW_HORIZON), (M.STANDBY, R.BELOW_HORIZON)),
    (M.TLE, dict(tle=R.OUTSIDE_LIMITS), (M.TLE, R.NONE)),
    (M.TLE, dict(attitude=R.ATTITUDE_INVALID), (M.STANDBY, R.ATTITUDE_INVALID)),
    (M.SUN, dict(handover=True), (M.SUN, R.NONE)),
    (M.SUN, dict(sun=R.BELOW_HORIZON), (M.STANDBY, R.BELOW_HORIZON)),
    (M.SUN, dict(tle=R.BELOW_HORIZON, program=R.NO_PROGRAM), (M.SUN, R.NONE)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, table=M.TLE), (M.TLE, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.TLE), (M.TLE, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.TLE, tle=R.BELOW_HORIZON), (M.STANDBY, R.SIGNAL_LOST)),
    (M.SEARCH, dict(level=R.NOT_FOUND, table=M.TLE), (M.TLE, R.NOT_FOUND)),
    (M.STOW, dict(pins=R.PINNED, drive_ready=False), (M.STOW, R.NONE)),
    (M.STOW, dict(pins=R.PIN_FAILED, drive_ready=False), (M.STANDBY, R.PIN_FAILED)),
    (M.UNSTOW, dict(pins=R.PINNED, drive_ready=False), (M.UNSTOW, R.NONE)),
    (M.UNSTOW, dict(drive_ready=False), (M.STANDBY, R.PINS_OUT)),
    (M.UNSTOW, {}, (M.STANDBY, R.PINS_OUT)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST), (M.PROGRAM, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, program=R.AFTER_PROGRAM), (M.STANDBY, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(locked=False), (M.AUTOTRACK, R.NONE)),
    (M.PROGRAM, dict(attitude=R.INS_ALIGNING), (M.STANDBY, R.INS_ALIGNING)),
    (M.STOW, dict(attitude=R.INS_ALIGNING), (M.STOW, R.NONE)),
    (M.AUTOTRACK, dict(attitude=R.ATTITUDE_INVALID), (M.STANDBY, R.ATTITUDE_INVALID)),
    (M.PRESET, dict(attitude=R.ATTITUDE_INVALID), (M.PRESET, R.NONE)),
    (M.STOW, dict(attitude=R.ATTITUDE_INVALID, lost=R.SIGNAL_LOST), (M.STOW, R.NONE)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.STOP), (M.STOP, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.PRESET), (M.PRESET, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.PRESET, preset=R.OUTSIDE_LIMITS), (M.STANDBY, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.STANDBY), (M.STANDBY, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.AUTOTRACK), (M.AUTOTRACK, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(drive_ready=False, lost=R.SIGNAL_LOST, chosen=M.AUTOTRACK), (M.STANDBY, R.DRIVE_NOT_READY)),
    (M.SLAVE, dict(slave=R.NO_DIRECTION), (M.STOP, R.NO_DIRECTION)),
    (M.SLAVE, dict(attitude=R.ATTITUDE_INVALID), (M.STANDBY, R.ATTITUDE_INVALID)),
    (M.STOP, dict(attitude=R.ATTITUDE_INVALID, lost=R.SIGNAL_LOST), (M.STOP, R.NONE)),
    (M.RATE, dict(program=R.AFTER_PROGRAM, lost=R.SIGNAL_LOST), (M.RATE, R.NONE)),
    (M.STANDBY, dict(encoder_ok=False, handover=True), (M.STANDBY, R.NONE)),
    (M.STANDBY, dict(drive_ready=False, handover=True), (M.STANDBY, R.NONE)),
] + [(mode, dict(encoder_ok=False), (M.STANDBY, R.ENCODER_INVALID)) for mode in range(M.STOP, len(modes.MODES))]
  + [(mode, dict(drive_ready=False), (M.STANDBY, R.DRIVE_NOT_READY)) for mode in range(M.STOP, len(modes.MODES))
     if mode != M.UNSTOW]
  + [(mode, dict(pins=R.PINNED), (M.STANDBY, R.PINNED)) for mode in MOVING])
def test_what_happens_by_itself(mode, changes, expected):
    assert next_mode(mode, **changes) == (*expected, NO_REQUEST)


@pytest.mark.parametrize('mode, changes, expected', [
    (M.SEARCH, dict(handover=True), (M.ACQUIRE, R.FOUND)),
    (M.SEARCH, dict(level=R.NOT_FOUND), (M.PROGRAM, R.NOT_FOUND)),
    (M.SEARCH, dict(level=R.NOT_FOUND, program=R.NO_PROGRAM), (M.STANDBY, R.NOT_FOUND)),
    (M.ACQUIRE, dict(handover=True), (M.AUTOTRACK, R.LOCKED)),
    (M.ACQUIRE, dict(level=R.SIGNAL_LOST), (M.SEARCH, R.SIGNAL_LOST)),
    (M.ACQUIRE, dict(handover=True, locked=False), (M.ACQUIRE, R.NONE)),
    (M.STEPTRACK, {}, (M.STEPTRACK, R.NONE)), (M.STEPTRACK, dict(level=R.SIGNAL_LOST), (M.SEARCH, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIGNAL_LOST, chosen=M.SEARCH), (M.SEARCH, R.SIGNAL_LOST)),
    (M.AUTOTRACK, dict(lost=R.SIDE_LOBE, chosen=M.STANDBY), (M.ACQUIRE, R.SIDE_LOBE))])
def test_what_happens_by_the_level(mode, changes, expected):
    assert next_mode(mode, **changes) == (*expected, NO_REQUEST)


def test_a_refused_request_does_not_stop_a_fault():
    assert next_mode(M.AUTOTRACK, 99, encoder_ok=False) == (M.STANDBY, R.ENCODER_INVALID, REQUEST_REFUSED)
