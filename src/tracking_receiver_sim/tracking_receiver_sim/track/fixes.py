"""The fixes of one aircraft in a log: recorded positions with their times, checked for their order in time.

A reader of a format (tables.rows, gpx.rows, nmea.rows) yields the fixes of all aircraft; `read` selects one aircraft.
"""
import array
import collections
import pathlib
import typing

import numpy as np

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import instant

MAX_LISTED_AIRCRAFT = 12  # number of aircraft that an error lists for a file with several
MAX_AIRCRAFT = 10_000  # largest number of aircraft in a file
MIN_FIXES = 4  # least number of fixes of a track


FIX_COLUMNS = ('line', 'aircraft', 'time', 'latitude', 'longitude', 'altitude')
"""Numbers of a fix while a file is read; `aircraft` is Aircraft.number."""


class Aircraft(typing.NamedTuple):
    """An aircraft of a file. number: from 0, in the order of the first fixes; names: all its names in the file."""
    number: int
    names: set


class Log:
    """Description of a log, which its reader fills in.

        form            name of the format
        time_name       name of the time in the file
        dated           True if the time is an instant (see track.instant)
        remarks         sentences about the numbers
        passed_over     {kind of row or sentence: its number}
        nothing         reason why the file has no fix, '' if it has one
    """

    def __init__(self):
        self.form, self.time_name, self.dated, self.nothing = '', '', False, ''
        self.remarks, self.passed_over = [], collections.Counter()


class Fixes(typing.NamedTuple):
    """The fixes of one aircraft, n of them.

    line: (n,) in the file; time: (n,) [s], growing, instants (see track.instant) if `dated`; latitude, longitude: (n,)
    WGS84 [deg]; altitude: (n,) above the ellipsoid [m]; description: format, remarks and the number of rows passed
    over.
    """
    path: str
    line: np.ndarray
    time: np.ndarray
    latitude: np.ndarray
    longitude: np.ndarray
    altitude: np.ndarray
    dated: bool
    description: str


def read(track, rows) -> Fixes:
    """Return the Fixes of the file of a TrackFileParameters. Raises csv_table.TableError.

    rows: reader of its format, a function (path, Log) that yields (line, names of the aircraft, *numbers of a fix).
    """
    log, numbers = Log(), array.array('d')
    aircraft_by_identity: dict[tuple, Aircraft] = {}
    for line, identities, *fix in rows(track.path, log):
        if len(numbers) >= len(FIX_COLUMNS) * csv_table.MAX_CSV_ROWS:
            raise csv_table.too_long(track.path, line)
        if len(aircraft_by_identity) > MAX_AIRCRAFT:
            raise csv_table.TableError(f'{track.path}: line {line}: must be at most {MAX_AIRCRAFT} aircraft')
        aircraft = aircraft_by_identity.setdefault(identities[:1], Aircraft(len(aircraft_by_identity), set()))
        aircraft.names.update(identities)
        numbers.extend((line, aircraft.number, *fix))
    table = np.array(numbers).reshape(-1, len(FIX_COLUMNS))
    label, number = _chosen_aircraft(track, aircraft_by_identity.values())
    aircraft_column = FIX_COLUMNS.index('aircraft')
    of_aircraft = np.delete(table[table[:, aircraft_column] == number], aircraft_column, axis=1)
    line, time, latitude, longitude, altitude = _without_repetitions(of_aircraft, log).T
    if len(line) < MIN_FIXES:
        reason = f': {log.nothing}' if log.nothing and not len(line) else ''
        raise csv_table.TableError(f'{track.path}: {len(line)} fixes, must be at least {MIN_FIXES}{reason}'
                                   f'{_passed_over(log)}')
    fixes = Fixes(track.path, line.astype(int), time, latitude, longitude, altitude, log.dated,
                  f'{pathlib.Path(track.path).name}: {log.form}{label}'
                  + ''.join(f', {remark}' for remark in log.remarks) + _passed_over(log))
    _check_order(fixes, track, log)
    return fixes


def _without_repetitions(table, log):
    """Return the rows (line, time, place) without those that repeat time and place of the row before.

    The Log receives the number of repetitions.
    """
    repeated = np.append(False, (np.diff(table[:, 1:], axis=0) == 0.0).all(axis=1))[:len(table)]
    if repeated.any():
        log.passed_over['row that repeats time and place'] = int(repeated.sum())
    return table[~repeated]


def _chosen_aircraft(track, all_aircraft):
    """Return (' of' its names, its number) of the Aircraft that `track` names, or of the only one.

    Raises TableError if no aircraft or several match.
    """
    wanted = track.aircraft.strip().lower()
    matches = [aircraft for aircraft in all_aircraft
               if not wanted or wanted in {name.lower() for name in aircraft.names}]
    if len(matches) == 1:
        label = _label(matches[0])
        return f' of {label}' if label else '', matches[0].number
    if not all_aircraft:
        return '', 0
    labels = [_label(aircraft) or 'aircraft without a name' for aircraft in all_aircraft]
    more = f' and {len(labels) - MAX_LISTED_AIRCRAFT} more' if len(labels) > MAX_LISTED_AIRCRAFT else ''
    raise csv_table.TableError(f'{track.path}: aircraft = {track.aircraft!r:.60}: must name one of the {len(labels)} '
                               f'in the file: {", ".join(labels[:MAX_LISTED_AIRCRAFT])}{more}')


def _label(aircraft):
    """Return the names of an Aircraft in one text, '' without a name."""
    return ' '.join(sorted(name[:40] for name in aircraft.names if name)[:MAX_LISTED_AIRCRAFT])


def _passed_over(log):
    """Return a part of the description with the rows of a Log that were passed over."""
    return ''.join(f', passed over {count} x {kind}' for kind, count in sorted(log.passed_over.items()))


def _check_order(fixes, track, log):
    """Raise TableError, with the line, if the time of Fixes falls, stays or jumps by more than max_gap."""
    step = np.diff(fixes.time)
    wrong = ~((step > 0.0) & (step <= track.max_gap))
    if wrong.any():
        i = int(np.argmax(wrong)) + 1
        value = instant.iso(fixes.time[i]) if fixes.dated else f'{fixes.time[i]:.10g}'
        raise csv_table.bad_step(fixes.path, fixes.line[i], f'{log.time_name} = {value}', step[i - 1], 's',
                                 track.max_gap, 'max_gap')
