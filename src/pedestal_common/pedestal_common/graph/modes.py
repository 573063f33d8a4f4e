"""Table of the modes of the control unit, from which commands, services, the buttons of the page, the faults study and
the documentation are made."""
import typing


class Row(typing.NamedTuple):
    """Row of MODE_ROWS."""
    name: str
    doc: str                    # motion of the axes
    entry: str                  # condition for entry
    exit: str = ''              # automatic exit
    needs: str = ''             # field of acu_tracker.modes.Conditions without which it cannot be entered; '' for none
    ends: str = ''              # field of acu_tracker.modes.Conditions without which the mode ends; '' for none
    follows: bool = False       # it follows a target through the sky, for which the attitude of the deck must be known
    by_level: bool = False      # it uses the signal level around the expected place of the target
    fallback: str = ''          # mode after the loss of the target; `program` stands for the table followed last
    handover: str = ''          # mode that replaces this one as soon as it can be entered, '' for none
    table: bool = False         # it follows a table of directions
    pinned: bool = False        # the stow pins may lock the axes
    predicted: str = ''         # method of acu_tracker.program.prediction.Predictor that makes the table; '' for none
    button: bool = True         # the page has a button for the mode
    going: str = ''             # words for the mode until the axes have arrived; '' for a mode without a destination
    arrived: str = ''           # words for the mode after this; '': it ends by itself


MODE_ROWS = (
    Row('standby', 'rate command 0; a drift of the position is not corrected', 'no condition; the ACU also enters it '
        'after a fault'),
    Row('stop', 'the axes brake to a stop and hold the position reached', 'encoders valid', button=False,
        going='stopping', arrived='stopped'),
    Row('stow', 'go to the stow angles; with `stow_pins` the pins go in after both axes have come to rest there',
        'encoders valid, angles inside the limits', needs='stow', pinned=True,
        going='stowing', arrived='stowed'),
    Row('unstow', 'rate command 0 while the stow pins go out', 'encoders valid, at least one stow pin not out',
        'to `standby` when both pins are out', needs='pin', ends='pin', pinned=True, going='unstowing'),
    Row('preset', 'go to the preset angles', 'encoders valid, angles inside the limits', needs='preset',
        going='preset, moving', arrived='preset, reached'),
    Row('rate', 'follow the commanded axis rates; the axes stop when no new `rate` command arrives within 0.5 s',
        'encoders valid', button=False),
    Row('slave', 'follow the earth angles of the last command `slave`, extrapolated with its rates',
        'a direction was commanded and is still valid (default: valid for 1 s)',
        'to `stop` when the direction has expired',
        needs='direction', ends='direction', follows=True, fallback='stop', button=False,
        going='slave, moving', arrived='slave, on target'),
    Row('program', 'follow the program track', 'a program track is loaded, has rows for this time, and is inside the '
        'limits',
        'to `autotrack` after `lock_count` accepted receiver errors; to `standby` after the last row of the track, or '
        'where rows are missing',
        needs='program', ends='program', follows=True, handover='autotrack', table=True,
        going='program, moving', arrived='program, on track'),
    Row('tle', 'follow a satellite, predicted from its elements',
        '`prediction.station` is given; elements not older than `prediction.oldest`; the satellite is above the '
        'horizon and inside the limits',
        'to `autotrack` after `lock_count` accepted receiver errors; to `standby` when the satellite has set',
        needs='tle', ends='tle', follows=True, handover='autotrack', table=True, predicted='satellite',
        going='tle, moving', arrived='tle, on track'),
    Row('sun', 'follow the sun, to calibrate the pointing',
        '`prediction.station` is given; the sun is above the horizon and inside the limits',
        'to `standby` when the sun has set', needs='sun', ends='sun', follows=True, table=True, predicted='sun',
        going='sun, moving', arrived='sun, on track'),
    Row('autotrack', 'follow the filtered receiver error; while the signal is lost for a short time, follow the '
        'prediction of the filter',
        'receiver locked, filter converged',
        'to the chosen fallback after `coast_time` without an accepted receiver error, when the uncertainty of the '
        'estimate reaches half a beamwidth, or when the coasting estimate departs from the program by two beamwidths; '
        'after divergence, or after a departure from the program while the level falls, back to the predicted track '
        'that was followed last (`program`, `tle` or `sun`); to `acquire` in a side lobe; to `standby` if the next '
        'mode cannot be entered',
        needs='lock', ends='track', follows=True, fallback='program'),
    Row('search', 'search around the expected place of the target in three stages: last place, small area, full area',
        'refused while the alarm `diverged` is latched',
        'to `acquire` after the level has passed a peak; after `search.rounds` back to the predicted track that '
        'was followed last (`program`, `tle` or `sun`), or to `standby` without such a track',
        needs='slope', ends='level', follows=True, by_level=True, fallback='program', handover='acquire'),
    Row('acquire', 'go to the place of the highest level, scan around it for the main lobe, then check the slopes of '
        'the receiver errors on a small circle', 'refused while the alarm `diverged` is latched',
        'to `autotrack` after the slopes are found right and the receiver is locked; to `search` without a signal; to '
        '`standby`, with the alarm `diverged`, if a slope is wrong',
        needs='slope', ends='level', follows=True, by_level=True, fallback='search', handover='autotrack'),
    Row('steptrack', 'maximise the level by small steps to both sides of the present direction, in each axis',
        'no condition', 'to `search` without a signal',
        ends='level', follows=True, by_level=True, fallback='search'))
"""Rows of all modes; a new mode is a new row.

A new condition also needs a field of acu_tracker.modes.Conditions. acu_tracker.guidance computes the reference of the
axes.
"""

MODES = tuple(row.name for row in MODE_ROWS)
