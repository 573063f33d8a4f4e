"""The fixes of one aircraft in a log, read from the stream and checked for their order in time."""
import array
import collections
import pathlib
import typing

import numpy as np

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import instant

MAX_LISTED_AIRCRAFT = 12
"""Number of aircraft that an error lists for a file with several."""

MAX_AIRCRAFT = 10_000
"""Largest number of aircraft in a file."""

MIN_FIXES = 4
"""Least number of fixes of a track."""


class Log:
    """Description of a log, which its reader fills in.

        form            name of the format
        time_name       name of the time in the file
        dated           True if the time is an instant (see track.instant)
        remarks         sentences about the numbers
        passed_over     {kind of row or sentence: its number}
        nothing         reason if the file has no fix
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
    """Return the Fixes of the file of a TrackFileParameters; rows: reader of its format. Raises
    csv_table.TableError."""
    log, numbers = Log(), array.array('d')
    names: dict[tuple, tuple[int, set]] = {}
    for line, identities, *fix in rows(track.path, log):
        if len(numbers) >= 6 * csv_table.MAX_CSV_ROWS:
            raise csv_table.too_long(track.path, line)
        if len(names) > MAX_AIRCRAFT:
            raise csv_table.TableError(f'{track.path}: line {line}: must be at most {MAX_AIRCRAFT} aircraft')
        number, known_as = names.setdefault(identities[:1], (len(names), set()))
        known_as.update(identities)
        numbers.extend((line, number, *fix))
    table = np.array(numbers).reshape(-1, 6)
    aircraft, number = _chosen(track, names)
    line, time, latitude, longitude, altitude = _fresh(table[table[:, 1] == number][:, (0, 2, 3, 4, 5)], log).T
    if len(line) < MIN_FIXES:
        reason = f': {log.nothing}' if log.nothing and not len(line) else ''
        raise csv_table.TableError(f'{track.path}: {len(line)} fixes, must be at least {MIN_FIXES}{reason}'
                                   f'{_passed_over(log)}')
    fixes = Fixes(track.path, line.astype(int), time, latitude, longitude, altitude, log.dated,
                  f'{pathlib.Path(track.path).name}: {log.form}{aircraft}'
                  + ''.join(f', {remark}' for remark in log.remarks) + _passed_over(log))
    _check_order(fixes, track, log)
    return fixes


def _fresh(table, log):
    """Return the rows (line, time, place) without those that repeat time and place of the row before, which are
    counted."""
    repeated = np.append(False, (np.diff(table[:, 1:], axis=0) == 0.0).all(axis=1))[:len(table)]
    if repeated.any():
        log.passed_over['row that repeats time and place'] = int(repeated.sum())
    return table[~repeated]


def _chosen(track, names):
    """Return (' of' its names, its number) of the aircraft that `track` names, or of the only one.

    names: {identity: (number, names)}. Raises TableError if no aircraft or several match.
    """
    wanted = track.aircraft.strip().lower()
    matches = [row for row in names.values() if not wanted or wanted in {name.lower() for name in row[1]}]
    if len(matches) == 1:
        number, known_as = matches[0]
        label = _label(known_as)
        return f' of {label}' if label else '', number
    if not names:
        return '', 0
    labels = [_label(known_as) or 'aircraft without a name' for _, known_as in names.values()]
    more = f' and {len(labels) - MAX_LISTED_AIRCRAFT} more' if len(labels) > MAX_LISTED_AIRCRAFT else ''
    raise csv_table.TableError(f'{track.path}: aircraft = {track.aircraft!r:.60}: must name one of the {len(labels)} '
                               f'in the file: {", ".join(labels[:MAX_LISTED_AIRCRAFT])}{more}')


def _label(known_as):
    return ' '.join(sorted(name[:40] for name in known_as if name)[:MAX_LISTED_AIRCRAFT])


def _passed_over(log):
    return ''.join(f', passed over {count} x {kind}' for kind, count in sorted(log.passed_over.items()))


def _check_order(fixes, track, log):
    step = np.diff(fixes.time)
    wrong = ~((step > 0.0) & (step <= track.max_gap))
    if wrong.any():
        i = int(np.argmax(wrong)) + 1
        value = instant.iso(fixes.time[i]) if fixes.dated else f'{fixes.time[i]:.10g}'
        raise csv_table.bad_step(fixes.path, fixes.line[i], f'{log.time_name} = {value}', step[i - 1], 's',
                                 track.max_gap, 'max_gap')
