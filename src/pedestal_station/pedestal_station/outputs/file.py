"""The plan file: a Night as `pedestal station` needs it, in JSON. `write` makes it, `read` checks every field of it.

An object with elements (TLE or OMM) is followed in the mode `tle`. An object of an ephemeris has a track instead, and
is followed in the mode `program`.
"""
import dataclasses
import datetime
import json
import math
import pathlib
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import STATION_NAMES, StationParameters
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.parameters import ParameterError, Parameters, as_dict, build, flag, parameter, text
from pedestal_common.quantities import Degrees, Json, Seconds
from pedestal_common.text_files import files
from pedestal_station import windows
from pedestal_station.night import Line, Night, Object
from pedestal_station.objects import Elements, Query
from tracking_receiver_sim.params import LeoPassParameters

VERSION_KEY, VERSION = 'pedestal_plan', 1
ELEMENT_NAMES = 'line_1', 'line_2', 'omm'
MAX_PLAN_BYTES = 50_000_000  # largest size of a plan file [bytes]
MAX_PASSES = 5000  # largest number of passes in a plan file
MAX_CONTACT_S = 33 * SECONDS_PER_DAY  # longest contact: the longest night of a plan, with the days beside it [s]
MAX_NAME_CHARACTERS = 100  # largest length of the name of an object [characters]
TRACK_ROW_INTERVAL_S, TRACK_MARGIN_S = 1.0, 10.0
"""Interval of the rows of a track, and time that it has before and after the contact [s]."""
UNIX_EPOCH = datetime.datetime(1970, 1, 1)

Track: TypeAlias = tuple[tuple[float, float, float], ...]   # rows (UTC [s], azimuth, elevation [rad])


class PlanError(ValueError):
    """Error of a plan file: one line that names the file, the field, the value and the allowed range."""


@dataclasses.dataclass(frozen=True)
class Contact(Parameters):
    """A pass of a plan file: the time in which the station tracks it, and what the antenna needs for that. The fields
    of its object of JSON have the same names; there the times are ISO 8601, and the angles of the track degrees."""
    case: str = text('', 'NAME/K')
    object: str = text('', 'name of the object')
    number: str = text('', 'catalogue number, empty without one')
    elements: Mapping[str, str] = dataclasses.field(default_factory=dict)   # empty for an object with a track
    track: Track = ()       # empty with elements
    begin: Seconds = parameter(0.0, 0.0, 1e10, 's', 'begin of the contact, UTC')
    end: Seconds = parameter(1.0, 0.0, 1e10, 's', 'end of the contact, UTC')
    azimuth_deg: Degrees = parameter(0.0, -1080.0, 1080.0, 'deg', 'encoder angle at the begin')
    elevation_deg: Degrees = parameter(0.0, -90.0, 180.0, 'deg', 'encoder angle at the begin')
    max_elevation_deg: Degrees = parameter(0.0, -90.0, 90.0, 'deg', 'largest elevation')
    taken: bool = flag(True, 'false for a pass that the plan drops')
    reason: str = text('', 'reason for which it is dropped or shortened')

    def check(self) -> None:
        """Check the names, the length of the contact, and the elements."""
        for name, least in (('case', 1), ('object', 1), ('number', 0)):
            value = getattr(self, name)
            if not (value.isprintable() and least <= len(value) <= MAX_NAME_CHARACTERS):
                raise ParameterError(f'{name} = {value!r:.60}: must be {least} to {MAX_NAME_CHARACTERS} printable '
                                     'characters')
        if not self.begin < self.end <= self.begin + MAX_CONTACT_S:
            raise ParameterError(f'end = {utc_text(self.end)}: must be after begin, at most '
                                 f'{MAX_CONTACT_S / SECONDS_PER_DAY:g} days')
        if self.elements:
            epoch_of(self.elements)

    @property
    def satellite(self) -> str:
        """Catalogue number, else the name."""
        return self.number or self.object


class Plan(NamedTuple):
    """Content of a plan file."""
    path: pathlib.Path
    station: StationParameters
    contacts: tuple[Contact, ...]   # in the order of their begin


def seconds(when: datetime.datetime) -> Seconds:
    """Return a naive UTC in seconds since 1970."""
    return (when - UNIX_EPOCH).total_seconds()


def utc_text(utc: Seconds) -> str:
    """Return a UTC as ISO 8601 text, to the millisecond."""
    return (UNIX_EPOCH + datetime.timedelta(milliseconds=round(utc * 1e3))).isoformat(timespec='milliseconds') + 'Z'


def orbit_of(elements: Mapping[str, str], station: StationParameters | None = None) -> Elements:
    """Return the orbit of elements, whose times are UTC [s]. Raises TargetError."""
    if set(elements) not in ({'line_1', 'line_2'}, {'omm'}):
        raise TargetError(f'elements = {", ".join(elements) or "none"}: must be line_1 and line_2, or omm')
    line_1, line_2, omm = (elements.get(name, '') for name in ELEMENT_NAMES)
    values = LeoPassParameters(line_1=line_1, line_2=line_2, omm=omm)
    return Elements(values, orbit.satellite(values), Query(station or StationParameters(), UNIX_EPOCH, 0.0, 0.0))


def epoch_of(elements: Mapping[str, str]) -> Seconds:
    """Return the UTC of the epoch of elements. Raises TargetError."""
    return -orbit_of(elements).elements_age(0.0)


def direction(elements: Mapping[str, str], station: StationParameters, utc: Seconds) -> tuple[Degrees, Degrees]:
    """Return geometric azimuth (0 to 360) and elevation of a satellite. Raises TargetError."""
    azimuth, elevation = np.degrees(windows.angles(orbit_of(elements, station), np.array([utc])))[0].tolist()
    return azimuth % 360.0, elevation


def texts_of(found: Elements) -> dict[str, str]:
    """Return the elements of an orbit as texts, {line_1, line_2 or omm: text}."""
    return {name: text for name in ELEMENT_NAMES if (text := getattr(found.values, name))
            and (name == 'omm') == bool(found.values.omm)}


def write(path: pathlib.Path, night: Night) -> None:
    """Write the plan file of a Night: all its passes, also those that its exact plan drops. Raises OSError,
    TargetError, PlanError for more passes than `read` accepts."""
    if len(night.passes) > MAX_PASSES:
        raise PlanError(f'{path}: {len(night.passes)} passes, must be at most {MAX_PASSES}')
    contacts = [_planned(line, night) for line in night.lines]
    content = {VERSION_KEY: VERSION, 'begin': utc_text(seconds(night.begin)), 'duration_s': night.duration,
               'station': {name: getattr(night.station, name) for name in STATION_NAMES},
               'horizon_deg': night.horizon, 'scenario': night.scenario, 'passes': list(map(row, contacts))}
    path.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')


def row(contact: Contact) -> dict[str, Json]:
    """Return the object of JSON of a contact."""
    track = [[utc, round(math.degrees(azimuth), 6), round(math.degrees(elevation), 6)]
             for utc, azimuth, elevation in contact.track]
    return {**as_dict(contact), 'elements': dict(contact.elements), 'track': track,
            'begin': utc_text(contact.begin), 'end': utc_text(contact.end)}


def _planned(line: Line, night: Night) -> Contact:
    """Return the contact of a pass. The times of a dropped pass are its rise and set."""
    each, share = line.each, line.share
    begin, end = (share.begin, share.end) if share.taken else (each.window.rise, each.window.set)
    times = np.append(np.arange(each.window.rise, begin, TRACK_ROW_INTERVAL_S), begin)
    angles = windows.angles(each.object.orbit, times)
    azimuth = each.prediction.azimuth[0] + float(np.diff(np.unwrap(angles[:, 0])).sum())
    reason = ', '.join(filter(None, (share.reason, f'lost to {", ".join(share.lost_to)}' if share.lost_to else '')))
    elements, track = _prediction(each.object, night, begin, end)
    utc = seconds(night.begin)
    return Contact(each.case, each.object.name, each.object.number, elements, track, utc + begin, utc + end,
                   math.degrees(azimuth), math.degrees(angles[-1, 1]), math.degrees(each.window.max_elevation),
                   share.taken, reason)


def _prediction(planned: Object, night: Night, begin: Seconds, end: Seconds) -> tuple[dict[str, str], Track]:
    """Return (elements of an object, its track). One of them is empty."""
    if isinstance(planned.orbit, Elements):
        return texts_of(planned.orbit), ()
    first = begin - TRACK_MARGIN_S
    times = first + np.arange(0.0, end + TRACK_MARGIN_S - first, TRACK_ROW_INTERVAL_S)
    rows = np.column_stack((seconds(night.begin) + times, windows.angles(planned.orbit, times)))
    rows = rows[np.isfinite(rows).all(axis=1)]
    return {}, tuple(map(tuple, rows.tolist()))


def read(path: pathlib.Path) -> Plan:
    """Return the content of a plan file. Raises PlanError, which names file, field, value and range."""
    try:
        found = json.loads(files.read_text(path, MAX_PLAN_BYTES))
    except OSError as error:
        raise PlanError(f'{path}: {error.strerror}') from None
    except (ValueError, RecursionError) as error:
        raise PlanError(f'{path}: must be a plan of `pedestal plan --output`, JSON: {error!s:.100}') from None
    try:
        if _typed('content', found, dict).get(VERSION_KEY) != VERSION:
            raise ParameterError(f'{VERSION_KEY} = {found.get(VERSION_KEY)!r:.60}: must be {VERSION}, the version of '
                                 'plans that this program reads')
        rows = _typed('passes', found.get('passes'), list)
        if not 1 <= len(rows) <= MAX_PASSES:
            raise ParameterError(f'passes: {len(rows)} passes, must be 1 to {MAX_PASSES}')
        place = _typed('station', found.get('station'), dict)
        station = build(StationParameters, {f'station.{name}': place.get(name) for name in STATION_NAMES}, 'station.')
    except ParameterError as error:
        raise PlanError(f'{path}: {error}') from None
    contacts = [contact(path, f'passes[{i}]', each) for i, each in enumerate(rows)]
    cases: set[str] = set()
    for i, each in enumerate(contacts):
        if each.case in cases:
            raise PlanError(f'{path}: passes[{i}].case = {each.case!r}: must be unique')
        cases.add(each.case)
    return Plan(path, station, tuple(sorted(contacts, key=lambda each: each.begin)))


_KIND_NAMES: dict[type, str] = {str: 'text', list: 'a list', dict: 'an object of JSON'}


def _typed(name: str, value: Json, kind: type) -> Json:
    """Return a value of a type of JSON. Raises ParameterError."""
    if not isinstance(value, kind):
        raise ParameterError(f'{name} = {value!r:.60}: must be {_KIND_NAMES[kind]}')
    return value


def contact(path: pathlib.Path, place: str, given: Json) -> Contact:
    """Return the contact of an object of JSON, see `row`. path, place: its file and its place there, for the error.
    Raises PlanError."""
    if not isinstance(given, dict):
        raise PlanError(f'{path}: {place} = {given!r:.40}: must be an object of JSON')
    try:
        begin, end = (seconds(orbit.instant(name, _typed(name, given.get(name), str))) for name in ('begin', 'end'))
        elements = _typed('elements', given.get('elements', {}), dict)
        track = () if elements else _track(given.get('track'), begin, end)
        return Contact(**{**{field.name: given.get(field.name) for field in dataclasses.fields(Contact)},
                          'begin': begin, 'end': end, 'elements': elements, 'track': track})
    except (ParameterError, TargetError) as error:
        raise PlanError(f'{path}: {place}.{error}') from None


def _track(given: Json, begin: Seconds, end: Seconds) -> Track:
    """Return the rows of a track. Raises ParameterError."""
    try:
        rows = np.array(given, float).reshape(-1, 3)
        valid = len(rows) > 1 and np.isfinite(rows).all() and (np.diff(rows[:, 0]) > 0.0).all()
    except (ValueError, TypeError, OverflowError):
        valid = False
    if not (valid and rows[0, 0] <= begin and rows[-1, 0] >= end):
        raise ParameterError(f'track = {given!r:.60}: must be two or more rows [UTC s, azimuth deg, elevation deg] in '
                             'the order of time, from the begin to the end, if there are no elements')
    rows[:, 1:] = np.radians(rows[:, 1:])
    return tuple(map(tuple, rows.tolist()))
