"""The plan file: a Night as `pedestal station` needs it, in JSON. `write` makes it, `read` checks every field of it.

An object with elements (TLE or OMM) is followed in the mode `tle`. An object of an ephemeris has a track instead, and
is followed in the mode `program`.
"""
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
from pedestal_common.parameters import ParameterError, build
from pedestal_common.quantities import Degrees, Floats, Json, Pairs, Seconds
from pedestal_common.text_files import files
from pedestal_station.night import Night, Object, Pass, Share
from pedestal_station.objects import Elements, Query
from tracking_receiver_sim.params import LeoPassParameters

VERSION_KEY, VERSION = 'pedestal_plan', 1
ELEMENT_NAMES = 'line_1', 'line_2', 'omm'
MAX_PLAN_BYTES = 50_000_000  # largest size of a plan file [bytes]
MAX_PASSES = 5000  # largest number of passes in a plan file
MAX_CONTACT_S = SECONDS_PER_DAY  # longest contact [s]
MAX_NAME_CHARACTERS = 100  # largest length of the name of an object [characters]
TRACK_ROW_INTERVAL_S, TRACK_MARGIN_S = 1.0, 10.0
"""Interval of the rows of a track, and time that it has before and after the contact [s]."""
EPOCH = datetime.datetime(1970, 1, 1)


Track: TypeAlias = tuple[tuple[float, float, float], ...]   # rows (UTC [s], azimuth, elevation [rad])


class PlanError(ValueError):
    """Error of a plan file: one line that names the file, the field, the value and the allowed range."""


class Contact(NamedTuple):
    """A pass of a plan file: the time in which the station tracks it, and what the antenna needs for that."""
    case: str                       # NAME/K
    name: str                       # of the object
    number: str                     # catalogue number, '' without one
    elements: Mapping[str, str]     # {line_1, line_2 or omm: text}, {} for an object with a track
    track: Track                    # () with elements
    begin: Seconds                  # UTC
    end: Seconds                    # UTC
    point: tuple[Degrees, Degrees]  # encoder angles at the begin
    max_elevation: Degrees
    priority: float
    taken: bool                     # False for a pass that the plan drops
    reason: str                     # why it is dropped or shortened


class Plan(NamedTuple):
    """Content of a plan file."""
    path: pathlib.Path
    station: StationParameters
    contacts: tuple[Contact, ...]   # in the order of their begin


def seconds(when: datetime.datetime) -> Seconds:
    """Return a naive UTC in seconds since 1970."""
    return (when - EPOCH).total_seconds()


def utc_text(utc: Seconds) -> str:
    """Return a UTC as ISO 8601 text, to the millisecond."""
    return (EPOCH + datetime.timedelta(milliseconds=round(utc * 1e3))).isoformat(timespec='milliseconds') + 'Z'


def orbit_of(elements: Mapping[str, str], station: StationParameters | None = None) -> Elements:
    """Return the orbit of elements, whose times are UTC [s]. Raises TargetError."""
    line_1, line_2, omm = (elements.get(name, '') for name in ELEMENT_NAMES)
    values = LeoPassParameters(line_1=line_1, line_2=line_2, omm=omm)
    return Elements(values, orbit.satellite(values), Query(station or StationParameters(), EPOCH, 0.0, 0.0))


def epoch_of(elements: Mapping[str, str]) -> Seconds:
    """Return the UTC of the epoch of elements. Raises TargetError."""
    return -orbit_of(elements).elements_age(0.0)


def direction(elements: Mapping[str, str], station: StationParameters, utc: Seconds) -> tuple[Degrees, Degrees]:
    """Return geometric azimuth (0 to 360) and elevation of a satellite. Raises TargetError."""
    azimuth, elevation = np.degrees(_angles(orbit_of(elements, station).enu(np.array([utc]))))[0].tolist()
    return azimuth % 360.0, elevation


def texts_of(found: Elements) -> dict[str, str]:
    """Return the elements of an orbit as texts, {line_1, line_2 or omm: text}."""
    return {name: text for name in ELEMENT_NAMES if (text := getattr(found.values, name))
            and (name == 'omm') == bool(found.values.omm)}


def _angles(enu: Floats) -> Pairs:
    return np.stack((np.arctan2(enu[:, 0], enu[:, 1]), np.arctan2(enu[:, 2], np.hypot(enu[:, 0], enu[:, 1]))), axis=-1)


def write(path: pathlib.Path, night: Night) -> None:
    """Write the plan file of a Night. Raises OSError, TargetError."""
    path.write_text(text(night), encoding='utf-8')


def text(night: Night) -> str:
    """Return the content of the plan file of a Night: all its passes, also those that its exact plan drops. Raises
    TargetError."""
    contacts = [_planned(each, share, night) for each, share in zip(night.passes, night.exact.shares)]
    return json.dumps({VERSION_KEY: VERSION, 'begin': utc_text(seconds(night.begin)), 'duration_s': night.duration,
                       'station': {name: getattr(night.station, name) for name in STATION_NAMES},
                       'horizon_deg': night.horizon, 'scenario': night.scenario,
                       'passes': [row(contact) for contact in contacts]}, indent=1) + '\n'


def row(contact: Contact) -> dict[str, Json]:
    """Return the object of JSON of a contact."""
    track = [[utc, math.degrees(azimuth), math.degrees(elevation)] for utc, azimuth, elevation in contact.track]
    return {'case': contact.case, 'object': contact.name, 'number': contact.number,
            **({'elements': dict(contact.elements)} if contact.elements else {'track': np.round(track, 6).tolist()}),
            'begin': utc_text(contact.begin), 'end': utc_text(contact.end),
            'azimuth_deg': contact.point[0], 'elevation_deg': contact.point[1],
            'max_elevation_deg': contact.max_elevation, 'priority': contact.priority, 'taken': contact.taken,
            'reason': contact.reason}


def _planned(each: Pass, share: Share, night: Night) -> Contact:
    """Return the contact of a pass. The times of a dropped pass are its rise and set. share: its times count from the
    begin of the night."""
    begin, end = (share.begin, share.end) if share.taken else (each.window.rise, each.window.set)
    times = np.append(np.arange(each.window.rise, begin, TRACK_ROW_INTERVAL_S), begin)
    angles = _angles(each.object.orbit.enu(times))
    azimuth = each.prediction.azimuth[0] + float(np.diff(np.unwrap(angles[:, 0])).sum())
    reason = ', '.join(filter(None, (share.reason, f'lost to {", ".join(share.lost_to)}' if share.lost_to else '')))
    elements, track = _prediction(each.object, night, begin, end)
    utc = seconds(night.begin)
    return Contact(each.case, each.object.name, each.object.number, elements, track, utc + begin, utc + end,
                   (math.degrees(azimuth), math.degrees(angles[-1, 1])), math.degrees(each.window.max_elevation),
                   each.object.priority, share.taken, reason)


def _prediction(planned: Object, night: Night, begin: Seconds, end: Seconds) -> tuple[dict[str, str], Track]:
    """Return (elements of an object, its track). One of them is empty."""
    if isinstance(planned.orbit, Elements):
        return texts_of(planned.orbit), ()
    first = begin - TRACK_MARGIN_S
    times = first + np.arange(0.0, end + TRACK_MARGIN_S - first, TRACK_ROW_INTERVAL_S)
    rows = np.column_stack((seconds(night.begin) + times, _angles(planned.orbit.enu(times))))
    rows = rows[np.isfinite(rows).all(axis=1)]
    return {}, tuple(map(tuple, rows.tolist()))


def read(path: pathlib.Path) -> Plan:
    """Return the content of a plan file. Raises PlanError, which names file, field, value and range."""
    try:
        content = json.loads(files.read_text(path, MAX_PLAN_BYTES))
    except OSError as error:
        raise PlanError(f'{path}: {error.strerror}') from None
    except (ValueError, RecursionError) as error:
        raise PlanError(f'{path}: must be a plan of `pedestal plan --output`, JSON: {error!s:.100}') from None
    file = _Fields(str(path), '', content)
    if file.get(VERSION_KEY, int) != VERSION:
        raise file.error(VERSION_KEY, f'must be {VERSION}, the version of plans that this program reads')
    rows = file.get('passes', list)
    if not 1 <= len(rows) <= MAX_PASSES:
        raise PlanError(f'{path}: passes: {len(rows)} passes, must be 1 to {MAX_PASSES}')
    contacts = [contact(str(path), f'passes[{i}].', found) for i, found in enumerate(rows)]
    cases = [each.case for each in contacts]
    for i, case in enumerate(cases):
        if case in cases[:i]:
            raise PlanError(f'{path}: passes[{i}].case = {case!r}: must be unique')
    place = _Fields(str(path), 'station.', file.get('station', dict))
    given = {f'station.{name}': place.number(name, -1e5, 1e5) for name in STATION_NAMES}
    try:
        station = build(StationParameters, given, 'station.')
    except ParameterError as error:
        raise PlanError(f'{path}: {error}') from None
    return Plan(path, station, tuple(sorted(contacts, key=lambda each: each.begin)))


class _Fields:
    """Object of the file, whose fields are read with a check."""

    def __init__(self, path: str, place: str, content: Json) -> None:
        if not isinstance(content, dict):
            raise PlanError(f'{path}: {place.rstrip(".") or "content"} = {content!r:.40}: must be an object of JSON')
        self.path, self.place, self._content = path, place, content

    def error(self, name: str, must: str) -> PlanError:
        """Return the error of a field."""
        found = f' = {self._content[name]!r:.60}' if name in self._content else ' is missing'
        return PlanError(f'{self.path}: {self.place}{name}{found}: {must}')

    def get(self, name: str, kind: type, default: Json = None) -> Json:
        """Return a field of a type of JSON. Raises PlanError."""
        value = self._content.get(name, default)
        if not isinstance(value, kind) or isinstance(value, bool) != (kind is bool):
            raise self.error(name, f'must be {_KIND_NAMES[kind]}')
        return value

    def number(self, name: str, low: float, high: float) -> float:
        """Return a number in a range. Raises PlanError."""
        value = self._content.get(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise self.error(name, f'must be {low:g} to {high:g}')
        return float(value)

    def name(self, name: str, default: str | None = None) -> str:
        """Return a short printable text. Raises PlanError."""
        value: str = self.get(name, str, default)
        if not (value.isprintable() and len(value) <= MAX_NAME_CHARACTERS and (value or default is not None)):
            raise self.error(name, f'must be 1 to {MAX_NAME_CHARACTERS} printable characters')
        return value

    def utc(self, name: str) -> Seconds:
        """Return a UTC. Raises PlanError."""
        try:
            return seconds(orbit.instant(name, self.get(name, str)))
        except (TargetError, OverflowError):
            raise self.error(name, 'must be UTC as ISO 8601, for example 2019-12-10T06:00:00') from None


_KIND_NAMES = {str: 'a text', int: 'a whole number', list: 'a list', dict: 'an object of JSON', bool: 'true or false'}


def contact(path: str, place: str, content: Json) -> Contact:
    """Return the contact of an object of JSON, see `row`. path, place: its file and its place there, for the error.
    Raises PlanError."""
    fields = _Fields(path, place, content)
    begin, end = fields.utc('begin'), fields.utc('end')
    if not begin < end <= begin + MAX_CONTACT_S:
        raise fields.error('end', f'must be after begin, at most {MAX_CONTACT_S:g} s')
    found = fields.get('elements', dict, {})
    track = _track(fields, begin, end) if not found else ()
    try:
        elements = {str(name): str(value) for name, value in found.items()}
        if elements:
            if set(elements) - set(ELEMENT_NAMES):
                raise TargetError(f'{", ".join(elements)}: must be line_1 and line_2, or omm')
            epoch_of(elements)
    except TargetError as error:
        raise fields.error('elements', str(error)) from None
    return Contact(fields.name('case'), fields.name('object'), fields.name('number', ''), elements, track, begin, end,
                   (fields.number('azimuth_deg', -1080.0, 1080.0), fields.number('elevation_deg', -90.0, 180.0)),
                   fields.number('max_elevation_deg', -90.0, 90.0), fields.number('priority', 0.0, 1e6),
                   fields.get('taken', bool), fields.get('reason', str, ''))


def _track(fields: _Fields, begin: Seconds, end: Seconds) -> Track:
    given = fields.get('track', list, [])
    try:
        rows = np.array(given, float).reshape(-1, 3)
        valid = len(rows) > 1 and np.isfinite(rows).all() and (np.diff(rows[:, 0]) > 0.0).all()
    except (ValueError, TypeError):
        valid = False
    if not (valid and rows[0, 0] <= begin and rows[-1, 0] >= end):
        raise fields.error('track', 'must be two or more rows [UTC s, azimuth deg, elevation deg] in the order of '
                           'time, from the begin to the end, if there are no elements')
    rows[:, 1:] = np.radians(rows[:, 1:])
    return tuple(map(tuple, rows.tolist()))
