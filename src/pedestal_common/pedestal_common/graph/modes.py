"""The modes of the control unit: a row for each, from which the commands, the services, the page's buttons, the faults
study and the documentation follow."""
import typing


class Row(typing.NamedTuple):
    """A row of MODE_ROWS.

    doc: what the axes do; entry: when it can be entered; exit: when it ends by itself. needs, ends: of the Conditions
    in acu_tracker.modes, the one without which it cannot be entered and the one without which it ends, '' for none.
    follows: it follows a target through the sky, for which the deck's attitude must be known; by_level: it goes by the
    level of the signal about the expected place of the target; fallback: the mode it falls back on when its target
    ends, of `program` the mode whose table was followed last; handover: the mode it hands over to by itself, once that
    can be entered. Both are names, '' for none. table: it follows a table of directions; pinned: the stow pins may be
    in.
    predicted: the method of prediction.Predictor that makes its table; button: the page has one among the modes.
    """
    name: str
    doc: str
    entry: str
    exit: str = ''
    needs: str = ''
    ends: str = ''
    follows: bool = False
    by_level: bool = False
    fallback: str = ''
    handover: str = ''
    table: bool = False
    pinned: bool = False
    predicted: str = ''
    button: bool = True


MODE_ROWS = (
    Row('standby', 'rate command 0', 'always; after a fault'),
    Row('stop', 'the axes stand where they come to rest', 'encoders valid', button=False),
    Row('stow', 'the stow angles; with `stow_pins` the pins go in once the axes stand there',
        'encoders valid, angles inside the limits', needs='stow', pinned=True),
    Row('unstow', 'rate command 0; the stow pins go out', 'encoders valid, a stow pin is not out',
        'to `standby` when both are out', needs='pin', ends='pin', pinned=True),
    Row('preset', 'the preset angles', 'encoders valid, angles inside the limits', needs='preset'),
    Row('rate', 'the rates of the last ask `rate`, for 0.5 s; nobody asks again: the axes stand', 'encoders valid',
        button=False),
    Row('slave', 'the direction of the last ask `slave`, in earth angles, moved on by its rates',
        'a direction was given and holds, 1 s by default', 'to `stop` when it holds no longer',
        needs='direction', ends='direction', follows=True, fallback='stop', button=False),
    Row('program', 'the time-tagged table', 'the table is there, valid now and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` past its end, or where rows are missing',
        needs='program', ends='program', follows=True, handover='autotrack', table=True),
    Row('tle', 'a satellite by its elements', 'there are elements, not older than `prediction.oldest`; the satellite '
        'is above the horizon and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` when it has set',
        needs='tle', ends='tle', follows=True, handover='autotrack', table=True, predicted='satellite'),
    Row('sun', 'the sun, to calibrate the pointing', 'the sun is above the horizon and inside the limits',
        'to `standby` when it has set', needs='sun', ends='sun', follows=True, table=True, predicted='sun'),
    Row('autotrack', 'the filtered target, through short losses the prediction of the filter',
        'receiver locked, filter converged',
        'after `coast_time` without an error, or once the estimate is uncertain by half a beamwidth, to the fallback '
        'chosen beforehand, diverged to the table, in a side lobe to `acquire`; to `standby` where that cannot be '
        'entered',
        needs='lock', ends='track', follows=True, fallback='program'),
    Row('search', 'a pattern about the expected place of the target: the last place, a small area, the full one',
        'not after `diverged`', 'to `acquire` where the level has passed a peak; after `search.rounds` to the table, '
        'or to `standby` without one',
        needs='slope', ends='level', follows=True, by_level=True, fallback='program', handover='acquire'),
    Row('acquire', 'the place of the highest level, a look around it for a main lobe, a small circle to check the '
        'slopes of the errors', 'not after `diverged`',
        'to `autotrack` once the slopes are right and the receiver is locked; to `search` without a signal there; '
        'diverged, to `standby`, where a slope is wrong',
        needs='slope', ends='level', follows=True, by_level=True, fallback='search', handover='autotrack'),
    Row('steptrack', 'the highest level, found by steps to either side', 'always', 'to `search` without a signal',
        ends='level', follows=True, by_level=True, fallback='search'))
"""Another mode is a row here. A condition of its own is a field of acu_tracker.modes.Conditions; guidance has what it
asks of the axes."""

MODES = tuple(row.name for row in MODE_ROWS)
