"""Objects of a night, from files of elements (TLE, OMM) and of ephemerides (OEM).

Of several sets of an object, in one or many files, the nearest valid one to the middle of the night is used. Therefore
an ephemeris that covers it takes precedence over elements. Each set that was tried in vain is refused by file, line
and reason, and the others go on.

The earth turns with the UT1 of skyfield's tables, as it does for an OEM. UT1 - UTC is constant through the night.
"""
import collections
import datetime
import functools
import pathlib
import re
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from acu_tracker.program.prediction import PredictionParameters
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Days, Seconds, Times, Vectors3
from pedestal_common.text_files import csv_table, files
from pedestal_common.text_files.files import FilePath
from pedestal_station.night import Object, Orbit, Refusal
from tracking_receiver_sim import elements
from tracking_receiver_sim.params import LeoPassParameters
from tracking_receiver_sim.tracks import course, instant, lines, oem, states

OLDEST_DAYS = PredictionParameters().oldest  # largest age of elements in a pass, unless the antenna has another [days]
FRESH_DAYS = 3.0  # age of the elements of a low satellite up to which no warning is given [days]
LOW_PERIOD_S = SECONDS_PER_DAY / 11.25  # longest revolution of a low satellite [s]
MAX_UT1_OFFSET_S = 0.9  # largest UT1 - UTC that leap seconds allow [s]; the tables go on without them
SPLINE_SPAN_S, KNOT_SPACING_S = 3600.0, 20.0  # length of a spline of an ephemeris, and of each of its pieces [s]
PROBE_COUNT = 200  # number of instants of the night at which SGP4 is tried
DESIGNATOR_PATTERN = re.compile(r'(\d{4}-\d{3})-?([A-Z]{1,3})')
LINE_PATTERN = re.compile(r'line (\d+)(?:: |, )')
NO_ELEMENTS = ('must hold a TLE (a line that begins with "1 ", then one that begins with "2 "), an OMM, or an OEM in '
               'the notation KEYWORD = value')


class Query(NamedTuple):
    """Place and time for which objects are read."""
    station: StationParameters
    begin: datetime.datetime    # UTC
    duration: Seconds
    ut1_offset: Seconds         # UT1 - UTC

    @property
    def middle(self) -> Seconds:
        """Middle of the night."""
        return 0.5 * self.duration


class Elements(NamedTuple):
    """Orbit by elements: a night.Orbit."""
    values: LeoPassParameters   # the TLE or the OMM
    satellite: orbit.Satellite
    query: Query

    def enu(self, times: Times) -> Vectors3:
        """As in night.Orbit."""
        return orbit.enu(self.satellite, self.query.station, *orbit.julian_date(self.query.begin), times,
                         self.query.ut1_offset)[0]

    def elements_age(self, t: Seconds) -> Seconds:
        """As in night.Orbit."""
        julian, fraction = orbit.julian_date(self.query.begin)
        return SECONDS_PER_DAY * (julian - self.satellite.jdsatepoch + fraction - self.satellite.jdsatepochF) + t

    @property
    def low(self) -> bool:
        """True for a satellite in a low orbit."""
        return bool(2.0 * np.pi * 60.0 / self.satellite.no_kozai < LOW_PERIOD_S)


class Ephemeris(NamedTuple):
    """Orbit by states of a file: a night.Orbit. Splines through its positions, within 0.1 m, are kept, because the
    interpolation and the nutation of the earth take milliseconds for each state."""
    track: states.Ephemeris
    zero: Seconds       # time of the track at the beginning of the night
    station: StationParameters
    splines: dict[int, CubicHermiteSpline]      # {number of an interval of SPLINE_SPAN_S: spline}

    def enu(self, times: Times) -> Vectors3:
        """As in night.Orbit."""
        t = self.zero + times
        position = np.full((len(t), 3), np.nan)
        known = (t >= self.track.begin) & (t <= self.track.end)
        for begin, end, _ in course.gaps(self.track):
            known &= (t <= begin) | (t >= end)
        number = np.floor(t / SPLINE_SPAN_S).astype(int)
        for i in np.unique(number[known]).tolist():
            if i not in self.splines:
                self.splines[i] = self._spline(i)
            position[known & (number == i)] = self.splines[i](t[known & (number == i)])
        return position

    def _spline(self, number: int) -> CubicHermiteSpline:
        # Knots stand at the ends of the segments and gaps too, so that no piece reaches over one of these.
        ends = [t for each in self.track.segments for t in (each.begin, each.end)]
        ends += [t for begin, end, _ in course.gaps(self.track) for t in (begin, end)]
        first, last = SPLINE_SPAN_S * number - KNOT_SPACING_S, SPLINE_SPAN_S * (number + 1) + KNOT_SPACING_S
        even = np.arange(first, last + 0.5 * KNOT_SPACING_S, KNOT_SPACING_S)
        knots = np.union1d(even, [t for t in ends if first < t < last])
        position, velocity = course.enu(self.track, self.station, knots)
        finite = np.isfinite(position).all(axis=1)
        return CubicHermiteSpline(knots[finite], position[finite], velocity[finite])

    def elements_age(self, t: Seconds) -> Seconds:
        """As in night.Orbit."""
        return self.zero + t - min(max(self.zero + t, self.track.begin), self.track.end)


class _Set(NamedTuple):
    """A set of elements of an object, or its ephemeris."""
    path: pathlib.Path
    line: int
    name: str
    number: str
    designator: str     # international designator, '' without one
    age: Seconds        # distance from the middle of the night
    orbit: Callable[[], tuple[Elements | Ephemeris, str]]   # raises TargetError; with a remark

    def refused(self, reason: object) -> Refusal:
        """Return the Refusal of the set."""
        return _refusal(self.path, self.line, self.name, reason)


def read(paths: Sequence[FilePath], station: StationParameters, begin: datetime.datetime, duration: Seconds,
         oldest: Days = OLDEST_DAYS) -> tuple[list[Object], list[Refusal]]:
    """Return the objects of files and of the files in folders, and what cannot be planned. begin: beginning of the
    night (UTC, without a zone); oldest: acu.prediction.oldest. Raises TargetError for a path that does not exist."""
    query = Query(station, begin, duration, _ut1_offset(begin + datetime.timedelta(seconds=0.5 * duration)))
    found: list[_Set | Object | Refusal] = []
    for path in _files(paths):
        found += list(_read(path, query)) or [_refusal(path, 0, path.name, NO_ELEMENTS)]
    for group in _groups([each for each in found if isinstance(each, _Set)]):
        found += _chosen(group, query, oldest)
    return (_told_apart([each for each in found if isinstance(each, Object)]),
            [each for each in found if isinstance(each, Refusal)])


def age_refusal(orbit_of: Orbit, t: Seconds, oldest: Days = OLDEST_DAYS) -> str:
    """Return why the elements are too old, or too far ahead, for a pass at t; '' if they are not."""
    age, limit = orbit_of.elements_age(t) / SECONDS_PER_DAY, min(oldest, orbit.MAX_TLE_AGE_DAYS)
    if abs(age) <= limit:
        return ''
    return (f'the epoch of the elements is {abs(age):.1f} days {"before" if age > 0.0 else "after"} the pass, must be '
            f'at most {limit:g} (acu.prediction.oldest, SGP4)')


def age_warning(orbit_of: Orbit, t: Seconds) -> str:
    """Return a warning about the elements of a low satellite for a pass at t; '' without one."""
    age = orbit_of.elements_age(t) / SECONDS_PER_DAY
    if not getattr(orbit_of, 'low', False) or abs(age) <= FRESH_DAYS:
        return ''
    return f'elements {abs(age):.1f} days from the pass, above {FRESH_DAYS:g} days for a low satellite'


def _ut1_offset(when: datetime.datetime) -> Seconds:
    time = instant.timescale().utc(when.year, when.month, when.day, when.hour, when.minute, when.second)
    return float(np.clip(time.dut1, -MAX_UT1_OFFSET_S, MAX_UT1_OFFSET_S))


def _files(paths: Sequence[FilePath]) -> Iterator[pathlib.Path]:
    for path in map(pathlib.Path, paths):
        if not path.exists():
            raise TargetError(f'{path}: no such file or folder')
        if not path.is_dir():
            yield path
            continue
        inside = sorted(each for each in path.iterdir() if each.is_file() and not each.name.startswith('.'))
        if not inside:
            raise TargetError(f'{path}: no file in this folder')
        yield from inside


def _read(path: pathlib.Path, query: Query) -> Iterator[_Set | Refusal]:
    try:
        with csv_table.stream(path) as stream:
            beginning = files.beginning(stream.read(elements.FORMAT_PROBE_BYTES)).lstrip()
        if '<oem' in beginning:
            raise csv_table.TableError(f'{path}: an OEM must be in the notation KEYWORD = value, not XML')
        yield from (_ephemerides if lines.begins_with(beginning, oem.FILE_SIGNATURE) else _elements)(path, query)
    except csv_table.TableError as error:
        yield _refusal(path, 0, path.name, error)


def _elements(path: pathlib.Path, query: Query) -> Iterator[_Set | Refusal]:
    middle = query.begin + datetime.timedelta(seconds=query.middle)
    for each in elements.satellites(path):
        if isinstance(each, csv_table.TableError):
            yield _refusal(path, 0, path.name, each)
            continue
        # A TLE without a name has its number as it is in the file, which may be Alpha-5.
        name = each.number if each.lines and each.name == each.lines[0][2:7].strip() else each.name
        try:
            age = abs((elements.epoch(path, each) - middle).total_seconds())
        except TargetError as error:
            yield _refusal(path, each.line, name, error)
            continue
        yield _Set(path, each.line, name, each.number, _designator(each.designator), age,
                   functools.partial(_built, path, each, query))


def _built(path: pathlib.Path, satellite: elements.Satellite, query: Query) -> tuple[Elements, str]:
    values, remark = elements.checked(path, satellite)
    return Elements(values, orbit.satellite(values), query), remark


def _ephemerides(path: pathlib.Path, query: Query) -> Iterator[_Set | Refusal]:
    since_1970 = query.begin - datetime.datetime(1970, 1, 1)
    begin = instant.of_day(since_1970.days, since_1970.seconds + 1e-6 * since_1970.microseconds)
    for each in oem.objects(str(path)):
        try:
            track = each.ephemeris(str(path))
        except csv_table.TableError as error:
            yield _refusal(path, each.line, each.name, error)
            continue
        found = Ephemeris(track, begin - track.midnight, query.station, {})
        number, designator = (each.designator if each.designator.isdecimal() else '', _designator(each.designator))
        covers = f'{instant.iso(track.midnight + track.begin)} to {instant.iso(track.midnight + track.end)}'
        if found.elements_age(0.0) > 0.0 or found.elements_age(query.duration) < 0.0:
            yield _refusal(path, each.line, each.name, f'the ephemeris is of {covers}, outside the night')
            continue
        whole = found.elements_age(0.0) == found.elements_age(query.duration) == 0.0
        remark = '' if whole else f'{path.name}: the ephemeris is of {covers}, a part of the night'
        yield _Set(path, each.line, each.name, number, designator, abs(found.elements_age(query.middle)),
                   functools.partial(tuple[Ephemeris, str], (found, remark)))


def _designator(text: str) -> str:
    """Return an international designator in one form, '' for another text."""
    match = DESIGNATOR_PATTERN.fullmatch(text.strip().upper())
    return ''.join(match.groups()) if match else ''


def _groups(sets: Sequence[_Set]) -> list[list[_Set]]:
    """Return the sets of each object: those of one number, or of its international designator."""
    numbers = {each.designator: each.number for each in sets if each.designator and each.number}
    groups: dict[str, list[_Set]] = {}
    for each in sets:
        key = each.number or numbers.get(each.designator) or each.designator or each.name.upper()
        groups.setdefault(key, []).append(each)
    return list(groups.values())


def _chosen(group: list[_Set], query: Query, oldest: Days) -> Iterator[Object | Refusal]:
    """Yield the refusals of the sets that are tried, then the object of its nearest valid set, if any."""
    for i in sorted(range(len(group)), key=lambda i: (group[i].age, -i)):
        chosen = group[i]
        try:
            found, remark = chosen.orbit()
            nearest = min(max(0.0, -found.elements_age(0.0)), query.duration)
            if reason := age_refusal(found, nearest, oldest):
                yield chosen.refused(reason)
                return
            if isinstance(found, Elements):
                found.enu(np.linspace(0.0, query.duration, PROBE_COUNT))    # raises TargetError where SGP4 fails
        except TargetError as error:
            yield chosen.refused(error)
            continue
        if len(group) > 1:
            several = f'{len(group)} sets of elements; taken: {chosen.path.name}, line {chosen.line}'
            remark = '; '.join(filter(None, (several, remark)))
        number = next((each.number for each in (chosen, *group) if each.number), '')
        yield Object(chosen.name or number, number, chosen.path, chosen.line, found, 1.0, remark)
        return


def _told_apart(objects: Sequence[Object]) -> list[Object]:
    """Return objects of which those of one name have their number behind it."""
    count = collections.Counter(each.name.upper() for each in objects)
    return [each._replace(name=f'{each.name} {each.number}') if each.number and count[each.name.upper()] > 1 else each
            for each in objects]


def _refusal(path: pathlib.Path, line: int, name: str, reason: object) -> Refusal:
    """Return a Refusal, whose line is the one that the text of an error states."""
    text = str(reason).removeprefix('TLE file ').removeprefix(f'{path}: ')
    if match := LINE_PATTERN.match(text):
        line, text = int(match[1]), text[match.end():]
    return Refusal(path, line, name, text)
