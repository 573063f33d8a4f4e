"""Modes of the control unit, a row each.

The commands, the services, the buttons of the page, the faults study and the documentation follow from the rows.
"""
import typing


class Row(typing.NamedTuple):
    """Row of MODE_ROWS.

    doc        what the axes follow
    entry      when the mode can be entered
    exit       when the mode ends by itself
    needs      field of acu_tracker.modes.Conditions without which the mode cannot be entered; '' for none
    ends       field of acu_tracker.modes.Conditions without which the mode ends; '' for none
    follows    the mode follows a target through the sky, for which the attitude of the deck must be known
    by_level   the mode uses the signal level about the expected place of the target
    fallback   mode after the end of the target, '' for none; `program` stands for the table that was followed last
    handover   mode that replaces this one as soon as it can be entered, '' for none
    table      the mode follows a table of directions
    pinned     the stow pins may be in
    predicted  method of prediction.Predictor that makes the table
    button     the page has a button for the mode
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
    Row('stop', 'braking to a stop and holding the position reached', 'encoders valid', button=False),
    Row('stow', 'the stow angles; with `stow_pins` the pins go in after both axes have come to rest there',
        'encoders valid, angles inside the limits', needs='stow', pinned=True),
    Row('unstow', 'rate command 0 while the stow pins go out', 'encoders valid, at least one stow pin not out',
        'to `standby` when both pins are out', needs='pin', ends='pin', pinned=True),
    Row('preset', 'the preset angles', 'encoders valid, angles inside the limits', needs='preset'),
    Row('rate', 'the commanded axis rates; the axes stop when no new `rate` command arrives within 0.5 s',
        'encoders valid', button=False),
    Row('slave', 'the direction of the last command `slave`, in earth angles, moved on by its rates',
        'a direction was commanded and is valid, by default for 1 s', 'to `stop` when the direction has expired',
        needs='direction', ends='direction', follows=True, fallback='stop', button=False),
    Row('program', 'the time-tagged table', 'the table is there, valid now and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` past the end of the table, or where rows are '
        'missing',
        needs='program', ends='program', follows=True, handover='autotrack', table=True),
    Row('tle', 'a satellite, predicted from its elements',
        'elements not older than `prediction.oldest`; the satellite is above the horizon and inside the limits',
        'to `autotrack` after `lock_count` accepted errors; to `standby` when the satellite has set',
        needs='tle', ends='tle', follows=True, handover='autotrack', table=True, predicted='satellite'),
    Row('sun', 'the sun, to calibrate the pointing', 'the sun is above the horizon and inside the limits',
        'to `standby` when the sun has set', needs='sun', ends='sun', follows=True, table=True, predicted='sun'),
    Row('autotrack', 'the filtered target; through short losses the prediction of the filter',
        'receiver locked, filter converged',
        'after `coast_time` without an error, or when the uncertainty of the estimate reaches half a beamwidth, to '
        'the chosen fallback; after divergence to the table; in a side lobe to `acquire`; to `standby` where the next '
        'mode cannot be entered',
        needs='lock', ends='track', follows=True, fallback='program'),
    Row('search', 'a pattern about the expected place of the target: the last place, a small area, the full area',
        'not after `diverged`', 'to `acquire` where the level has passed a peak; after `search.rounds` to the table, '
        'or to `standby` without a table',
        needs='slope', ends='level', follows=True, by_level=True, fallback='program', handover='acquire'),
    Row('acquire', 'the place of the highest level, a scan around it for a main lobe, a small circle to check the '
        'slopes of the errors', 'not after `diverged`',
        'to `autotrack` once the slopes are right and the receiver is locked; to `search` without a signal there; '
        'to `standby`, diverged, where a slope is wrong',
        needs='slope', ends='level', follows=True, by_level=True, fallback='search', handover='autotrack'),
    Row('steptrack', 'the highest level, found by steps to either side', 'always', 'to `search` without a signal',
        ends='level', follows=True, by_level=True, fallback='search'))
"""Rows of all modes; a new mode is a new row.

A new condition also needs a field of acu_tracker.modes.Conditions; the axes' reference is in acu_tracker.guidance.
"""

MODES = tuple(row.name for row in MODE_ROWS)
