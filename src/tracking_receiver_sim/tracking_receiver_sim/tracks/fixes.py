"""The fixes of one aircraft in a log: recorded positions with their times, checked for their order in time."""
import array
import pathlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Degrees, Floats, Ints, Meters, Seconds, Times
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TrackFileParameters
from tracking_receiver_sim.tracks import instant

MAX_LISTED_AIRCRAFT = 12  # number of aircraft that an error lists for a file with several
MAX_AIRCRAFT = 10_000  # largest number of aircraft in a file
MIN_FIXES = 4  # least number of fixes of a track
FIX_COLUMNS = ('line', 'aircraft', 'time', 'latitude', 'longitude', 'altitude')  # aircraft: Aircraft.number


class Fix(NamedTuple):
    """A fix as a reader yields it."""
    line: int                   # in the file
    names: tuple[str, ...]      # of the aircraft
    time: Seconds               # an instant (see the module instant) if the log is dated
    latitude: Degrees           # WGS84
    longitude: Degrees
    altitude: Meters            # above the ellipsoid


class Aircraft(NamedTuple):
    """An aircraft of a file."""
    number: int         # from 0, in the order of the first fixes
    names: set[str]     # all its names in the file


class Log:
    """Description of a log, which its reader fills in."""
    form: str                       # name of the format
    time_name: str                  # name of the time in the file
    dated: bool                     # True if the time is an instant (see the module instant)
    remarks: list[str]              # sentences about the numbers
    passed_over: Counter[str]       # {kind of row or sentence: its number}
    nothing: str                    # reason why the file has no fix, '' if it has one
    # {name: how good its fixes are}, the best first, for a format whose names are receivers of one aircraft.
    receivers: dict[str, str]

    def __init__(self) -> None:
        self.form, self.time_name, self.dated, self.nothing, self.receivers = '', '', False, '', {}
        self.remarks, self.passed_over = [], Counter()


class Fixes(NamedTuple):
    """The fixes of one aircraft."""
    path: str
    line: Ints          # in the file
    time: Times         # growing; instants (see the module instant) if `dated`
    latitude: Floats    # WGS84 [deg]
    longitude: Floats   # WGS84 [deg]
    altitude: Floats    # above the ellipsoid [m]
    dated: bool
    description: str    # format, remarks and the number of rows passed over


def read(track: TrackFileParameters, rows: Callable[[str, Log], Iterator[Fix]]) -> Fixes:
    """Return the fixes of a track file; rows: reader of its format. Raises csv_table.TableError."""
    log, numbers = Log(), array.array('d')
    aircraft_by_identity: dict[tuple[str, ...], Aircraft] = {}
    for line, identities, *fix in rows(track.path, log):
        if len(numbers) >= len(FIX_COLUMNS) * csv_table.MAX_CSV_ROWS:
            raise csv_table.too_long(track.path, line)
        if len(aircraft_by_identity) > MAX_AIRCRAFT:
            raise csv_table.TableError(f'{track.path}: line {line}: must be at most {MAX_AIRCRAFT} aircraft')
        aircraft = aircraft_by_identity.setdefault(identities[:1], Aircraft(len(aircraft_by_identity), set()))
        aircraft.names.update(identities)
        numbers.extend((line, aircraft.number, *fix))
    table = np.array(numbers).reshape(-1, len(FIX_COLUMNS))
    aircraft_column = FIX_COLUMNS.index('aircraft')
    if len(log.receivers) > 1 and not track.aircraft.strip() and _take_turns(table):
        label = f' of {" and ".join(f"{name} ({fixes})" for name, fixes in log.receivers.items())}, which take turns'
    else:
        label, number = _chosen_aircraft(track, aircraft_by_identity.values(), log.receivers)
        table = table[table[:, aircraft_column] == number]
    of_aircraft = np.delete(table, aircraft_column, axis=1)
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


def _take_turns(table: Floats) -> bool:
    """Return True if no fix of a receiver lies within a usual time step of another one."""
    receiver, time = (table[:, FIX_COLUMNS.index(name)] for name in ('aircraft', 'time'))
    for number in np.unique(receiver):
        own = np.sort(time[receiver == number])
        longest = 1.5 * np.median(np.diff(own)) if len(own) > 1 else 0.0
        bounds = np.concatenate(([-np.inf], own, [np.inf]))
        others = time[receiver != number]
        i = np.searchsorted(bounds, others)
        if ((bounds[i] - bounds[i - 1] <= longest) | (bounds[i] == others)).any():
            return False
    return True


def _without_repetitions(table: Floats, log: Log) -> Floats:
    """Remove the rows that repeat time and place of the row before; the log receives their number."""
    repeated = np.append(False, (np.diff(table[:, 1:], axis=0) == 0.0).all(axis=1))[:len(table)]
    if repeated.any():
        log.passed_over['row that repeats time and place'] = int(repeated.sum())
    return table[~repeated]


def _chosen_aircraft(track: TrackFileParameters, all_aircraft: Collection[Aircraft],
                     receivers: Mapping[str, str]) -> tuple[str, int]:
    """Return (' of' its names, its number) of the aircraft that `track` names, or of the only one; of several
    receivers of one aircraft, of the best."""
    wanted = (track.aircraft.strip() or next(iter(receivers), '')).lower()
    matches = [aircraft for aircraft in all_aircraft
               if not wanted or wanted in {name.lower() for name in aircraft.names}]
    if len(matches) == 1:
        label = _label(matches[0])
        others = [f'{name} ({fixes})' for name, fixes in receivers.items() if name != label]
        if others:
            label += f' ({receivers[label]}), not of {", ".join(others)}: aircraft names the talker to take'
        return f' of {label}' if label else '', matches[0].number
    if not all_aircraft:
        return '', 0
    labels = [_label(aircraft) or 'aircraft without a name' for aircraft in all_aircraft]
    more = f' and {len(labels) - MAX_LISTED_AIRCRAFT} more' if len(labels) > MAX_LISTED_AIRCRAFT else ''
    raise csv_table.TableError(f'{track.path}: aircraft = {track.aircraft!r:.60}: must name one of the {len(labels)} '
                               f'in the file: {", ".join(labels[:MAX_LISTED_AIRCRAFT])}{more}')


def _label(aircraft: Aircraft) -> str:
    return ' '.join(sorted(name[:40] for name in aircraft.names if name)[:MAX_LISTED_AIRCRAFT])


def _passed_over(log: Log) -> str:
    return ''.join(f', passed over {count} x {kind}' for kind, count in sorted(log.passed_over.items()))


def _check_order(fixes: Fixes, track: TrackFileParameters, log: Log) -> None:
    step = np.diff(fixes.time)
    wrong = ~((step > 0.0) & (step <= track.max_gap))
    if wrong.any():
        i = int(np.argmax(wrong)) + 1
        value = instant.iso(fixes.time[i]) if fixes.dated else f'{fixes.time[i]:.10g}'
        raise csv_table.bad_step(fixes.path, fixes.line[i], f'{log.time_name} = {value}', step[i - 1], 's',
                                 track.max_gap, 'max_gap')
