import pytest

from acu_tracker import modes
from acu_tracker.modes import (
    ACCEPTED,
    ACQUIRE,
    AFTER_PROGRAM,
    ATTITUDE_INVALID,
    AUTOTRACK,
    BEFORE_PROGRAM,
    BELOW_HORIZON,
    DIVERGED,
    DRIVE_NOT_READY,
    ENCODER_INVALID,
    FOUND,
    INS_ALIGNING,
    LOCKED,
    NO_DIRECTION,
    NO_PROGRAM,
    NO_REQUEST,
    NONE,
    NOT_FOUND,
    NOT_LOCKED,
    OUTSIDE_LIMITS,
    PIN_FAILED,
    PINNED,
    PINS_OUT,
    PRESET,
    PROGRAM,
    PROGRAM_GAP,
    RATE,
    REFUSED,
    REQUESTED,
    SEARCH,
    SIDE_LOBE,
    SIGNAL_LOST,
    SLAVE,
    STANDBY,
    STEPTRACK,
    STOP,
    STOW,
    SUN,
    TLE,
    TOO_OLD,
    UNKNOWN_MODE,
    UNSTOW,
)


def next_mode(mode, request=NO_REQUEST, encoder_ok=True, drive_ready=True, attitude=NONE, program=NONE, stow=NONE,
              preset=NONE, slave=NONE, locked=True, lost=NONE, level=NONE, handover=False, chosen=PROGRAM, pins=NONE,
              tle=NONE, sun=NONE, table=PROGRAM):
    """Of a situation in which all is well but for what is named."""
    conditions = modes.Conditions(
        nothing=NONE, stow=stow, pin=PINS_OUT if pins == NONE else NONE, preset=preset, direction=slave,
        program=program, tle=tle, sun=sun, lock=NONE if locked else NOT_LOCKED, slope=NONE, track=lost, level=level)
    drive = NONE if drive_ready else DRIVE_NOT_READY
    now = modes.Situation(encoder_ok, drive, attitude, pins, handover, table, chosen, conditions)
    return modes.next_mode(mode, request, now)


CONDITIONS = {
    'stow': ('stow', ''), 'unstow': ('pin', 'pin'), 'preset': ('preset', ''), 'slave': ('direction', 'direction'),
    'program': ('program', 'program'), 'tle': ('tle', 'tle'), 'sun': ('sun', 'sun'), 'autotrack': ('lock', 'track'),
    'search': ('slope', 'level'), 'acquire': ('slope', 'level'), 'steptrack': ('', 'level')}
"""{mode: the condition that it needs, the one that ends it}; of all others none."""


def test_each_mode_has_its_own_conditions():
    assert {row.name: (row.needs, row.ends) for row in modes.TABLE if row.needs or row.ends} == CONDITIONS


@pytest.mark.parametrize('condition', modes.Conditions._fields[1:])
@pytest.mark.parametrize('mode', range(1, len(modes.MODES)))
def test_a_condition_that_does_not_hold_bars_and_ends_the_modes_of_its_own_and_no_other(mode, condition):
    why = modes.Conditions(*(DIVERGED if name == condition else NONE for name in modes.Conditions._fields))
    now = modes.Situation(True, NONE, NONE, NONE, False, PROGRAM, PROGRAM, why)
    needs, ends = CONDITIONS.get(modes.MODES[mode], ('', ''))
    assert modes.obstacle(mode, now) == (DIVERGED if needs == condition else NONE)
    assert (modes.next_mode(mode, NO_REQUEST, now).reason == DIVERGED) == (ends == condition)


MOVING = tuple(mode for mode, row in enumerate(modes.TABLE) if not row.pinned and mode != STANDBY)
"""Modes in which the axes move, or may."""


@pytest.mark.parametrize('mode', range(len(modes.MODES)))
@pytest.mark.parametrize('request_', range(len(modes.MODES)))
def test_every_mode_is_reached_from_every_mode(mode, request_):
    if request_ == UNSTOW:                              # what is not stowed cannot be unstowed
        assert next_mode(STANDBY, UNSTOW) == (STANDBY, PINS_OUT, REFUSED)
    else:
        assert next_mode(mode, request_) == (request_, REQUESTED, ACCEPTED)


@pytest.mark.parametrize('mode', range(len(modes.MODES)))
@pytest.mark.parametrize('request_', range(len(modes.MODES)))
def test_with_a_pin_not_out_only_stow_and_unstow_are_entered(mode, request_):
    able, stays = request_ in (STANDBY, STOW, UNSTOW), mode if mode not in MOVING else STANDBY
    for ready in (False, True):
        got = next_mode(mode, request_, drive_ready=ready, pins=PINNED)
        assert got == ((request_, REQUESTED, ACCEPTED) if able else (stays, PINNED, REFUSED))
        failed = next_mode(mode, request_, drive_ready=ready, pins=PIN_FAILED)
        assert failed == ((STANDBY, REQUESTED, ACCEPTED) if request_ == STANDBY else (STANDBY, PIN_FAILED, REFUSED))


@pytest.mark.parametrize('request_, changes, reason', [
    (STOW, dict(stow=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PRESET, dict(preset=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PROGRAM, dict(program=NO_PROGRAM), NO_PROGRAM),
    (PROGRAM, dict(program=BEFORE_PROGRAM), BEFORE_PROGRAM),
    (PROGRAM, dict(program=AFTER_PROGRAM), AFTER_PROGRAM),
    (PROGRAM, dict(program=OUTSIDE_LIMITS), OUTSIDE_LIMITS),
    (PROGRAM, dict(program=PROGRAM_GAP), PROGRAM_GAP),
    (TLE, dict(tle=TOO_OLD), TOO_OLD),
    (TLE, dict(tle=BELOW_HORIZON), BELOW_HORIZON),
    (TLE, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (SUN, dict(sun=BELOW_HORIZON), BELOW_HORIZON),
    (SUN, dict(attitude=INS_ALIGNING), INS_ALIGNING),
    (PROGRAM, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (AUTOTRACK, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (PROGRAM, dict(attitude=INS_ALIGNING), INS_ALIGNING),
    (AUTOTRACK, dict(attitude=INS_ALIGNING), INS_ALIGNING),
    (AUTOTRACK, dict(locked=False), NOT_LOCKED),
    (SLAVE, dict(slave=NO_DIRECTION), NO_DIRECTION),
    (SLAVE, dict(attitude=ATTITUDE_INVALID), ATTITUDE_INVALID),
    (STOP, dict(encoder_ok=False), ENCODER_INVALID),
    (RATE, dict(drive_ready=False), DRIVE_NOT_READY),
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
    (PROGRAM, dict(program=PROGRAM_GAP), (STANDBY, PROGRAM_GAP)),
    (TLE, dict(handover=True), (AUTOTRACK, LOCKED)),
    (TLE, dict(tle=BELOW_HORIZON), (STANDBY, BELOW_HORIZON)),
    (TLE, dict(tle=OUTSIDE_LIMITS), (TLE, NONE)),
    (TLE, dict(attitude=ATTITUDE_INVALID), (STANDBY, ATTITUDE_INVALID)),
    (SUN, dict(handover=True), (SUN, NONE)),
    (SUN, dict(sun=BELOW_HORIZON), (STANDBY, BELOW_HORIZON)),
    (SUN, dict(tle=BELOW_HORIZON, program=NO_PROGRAM), (SUN, NONE)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, table=TLE), (TLE, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=TLE), (TLE, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=TLE, tle=BELOW_HORIZON), (STANDBY, SIGNAL_LOST)),
    (SEARCH, dict(level=NOT_FOUND, table=TLE), (TLE, NOT_FOUND)),
    (STOW, dict(pins=PINNED, drive_ready=False), (STOW, NONE)),
    (STOW, dict(pins=PIN_FAILED, drive_ready=False), (STANDBY, PIN_FAILED)),
    (UNSTOW, dict(pins=PINNED, drive_ready=False), (UNSTOW, NONE)),
    (UNSTOW, dict(drive_ready=False), (STANDBY, PINS_OUT)),
    (UNSTOW, {}, (STANDBY, PINS_OUT)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST), (PROGRAM, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, program=AFTER_PROGRAM), (STANDBY, SIGNAL_LOST)),
    (AUTOTRACK, dict(locked=False), (AUTOTRACK, NONE)),
    (PROGRAM, dict(attitude=INS_ALIGNING), (STANDBY, INS_ALIGNING)),
    (STOW, dict(attitude=INS_ALIGNING), (STOW, NONE)),
    (AUTOTRACK, dict(attitude=ATTITUDE_INVALID), (STANDBY, ATTITUDE_INVALID)),
    (PRESET, dict(attitude=ATTITUDE_INVALID), (PRESET, NONE)),
    (STOW, dict(attitude=ATTITUDE_INVALID, lost=SIGNAL_LOST), (STOW, NONE)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=STOP), (STOP, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=PRESET), (PRESET, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=PRESET, preset=OUTSIDE_LIMITS), (STANDBY, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=STANDBY), (STANDBY, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=AUTOTRACK), (AUTOTRACK, SIGNAL_LOST)),
    (AUTOTRACK, dict(drive_ready=False, lost=SIGNAL_LOST, chosen=AUTOTRACK), (STANDBY, DRIVE_NOT_READY)),
    (SLAVE, dict(slave=NO_DIRECTION), (STOP, NO_DIRECTION)),
    (SLAVE, dict(attitude=ATTITUDE_INVALID), (STANDBY, ATTITUDE_INVALID)),
    (STOP, dict(attitude=ATTITUDE_INVALID, lost=SIGNAL_LOST), (STOP, NONE)),
    (RATE, dict(program=AFTER_PROGRAM, lost=SIGNAL_LOST), (RATE, NONE)),
    (STANDBY, dict(encoder_ok=False, handover=True), (STANDBY, NONE)),
    (STANDBY, dict(drive_ready=False, handover=True), (STANDBY, NONE)),
] + [(mode, dict(encoder_ok=False), (STANDBY, ENCODER_INVALID)) for mode in range(STOP, len(modes.MODES))]
  + [(mode, dict(drive_ready=False), (STANDBY, DRIVE_NOT_READY)) for mode in range(STOP, len(modes.MODES))
     if mode != UNSTOW]
  + [(mode, dict(pins=PINNED), (STANDBY, PINNED)) for mode in MOVING])
def test_what_happens_by_itself(mode, changes, expected):
    assert next_mode(mode, **changes) == (*expected, NO_REQUEST)


@pytest.mark.parametrize('mode, changes, expected', [
    (SEARCH, dict(handover=True), (ACQUIRE, FOUND)), (SEARCH, dict(level=NOT_FOUND), (PROGRAM, NOT_FOUND)),
    (SEARCH, dict(level=NOT_FOUND, program=NO_PROGRAM), (STANDBY, NOT_FOUND)),
    (ACQUIRE, dict(handover=True), (AUTOTRACK, LOCKED)), (ACQUIRE, dict(level=SIGNAL_LOST), (SEARCH, SIGNAL_LOST)),
    (ACQUIRE, dict(handover=True, locked=False), (ACQUIRE, NONE)),
    (STEPTRACK, {}, (STEPTRACK, NONE)), (STEPTRACK, dict(level=SIGNAL_LOST), (SEARCH, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIGNAL_LOST, chosen=SEARCH), (SEARCH, SIGNAL_LOST)),
    (AUTOTRACK, dict(lost=SIDE_LOBE, chosen=STANDBY), (ACQUIRE, SIDE_LOBE))])
def test_what_happens_by_the_level(mode, changes, expected):
    assert next_mode(mode, **changes) == (*expected, NO_REQUEST)


def test_a_refused_request_does_not_stop_a_fault():
    assert next_mode(AUTOTRACK, 99, encoder_ok=False) == (STANDBY, ENCODER_INVALID, REFUSED)
