"""Track files of a target: their formats, and their kinds (recorded fixes, predicted orbit, table of directions).

The first row of FILE_FORMATS that matches the beginning of a file gives its reader and its kind.
"""
import functools
import os
import re
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple, TypeAlias

from pedestal_common.quantities import Seconds
from pedestal_common.text_files import csv_table, files
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.tracks import course, directions, fixes, flight, gpx, lines, nmea, oem, stk, tables

FORMAT_PROBE_BYTES = 65536  # number of bytes at the beginning of a file that decide its format


Data: TypeAlias = Any   # of a reader: fixes.Fixes, states.Ephemeris or Directions, which functions of one kind share


class FileKind(NamedTuple):
    """Kind of track, with two functions of the data that a reader returns."""
    doc: str        # what its files hold
    lay_out: Callable[[Data, TargetParameters, Seconds, Seconds], flight.Flight]    # of a duration and a margin
    # {parameter: value} for a scenario that does not set them, from the names of the parameters that it sets.
    run_parameters: Callable[[Data, TargetParameters, Collection[str]], dict[str, float]]


LOG_KIND = FileKind('recorded flight',
                    lambda log, target, _duration, _margin: flight.lay_out(log, target.track_file, target.station),
                    flight.run_parameters)
ORBIT_KIND = FileKind('predicted orbit', course.flight_of_orbit, course.run_parameters_of_orbit)
DIRECTIONS_KIND = FileKind('directions', course.flight_of_directions, course.run_parameters_of_directions)


class FileFormat(NamedTuple):
    """Format of a file."""
    name: str
    kind: FileKind
    beginning: str                      # of its files, in words
    doc: str                            # what is read
    matches: Callable[[str], object]    # a true value if a file with this beginning has this format
    read: Callable[[TrackFileParameters], Data]


def _read_log(rows: Callable[[str, fixes.Log], Iterator[fixes.Fix]]) -> Callable[[TrackFileParameters], fixes.Fixes]:
    return lambda track: fixes.read(track, rows)


def _read_object(read: Callable[[str, str], Data]) -> Callable[[TrackFileParameters], Data]:
    return lambda track: read(track.path, track.aircraft)


FILE_FORMATS = (
    FileFormat('CCSDS OEM', ORBIT_KIND, '`CCSDS_OEM_VERS`',
               'all segments of one object and their usable times, 502.0-B versions 1 to 3, keyword = value; '
               'covariances are ignored',
               lambda beginning: lines.begins_with(beginning, oem.FILE_SIGNATURE), _read_object(oem.read)),
    FileFormat('STK ephemeris', ORBIT_KIND, '`stk.v`',
               '`EphemerisTimePosVel`, `EphemerisTimePosVelAcc`, `EphemerisTimePos`; two states at one time separate '
               'two segments', stk.FILE_SIGNATURE_PATTERN.match, _read_object(stk.read)),
    FileFormat('GPX', LOG_KIND, '`<`',
               'every `trkpt` of a `trk`, altitude `ele` + `geoidheight` in metres, times in UTC',
               lambda beginning: beginning.startswith('<'), _read_log(gpx.rows)),
    FileFormat('NMEA', LOG_KIND, '`$` or `!`, or a sentence such as `$GPGGA,` after other text',
               'GGA and RMC of NMEA 0183, altitude + geoidal separation in metres; UTC, without a valid RMC seconds '
               'since midnight', nmea.is_log, _read_log(nmea.rows)),
    FileFormat('sat-nms program', DIRECTIONS_KIND, 'a Julian date',
               'Julian date (UTC), azimuth, elevation [deg]; further numbers and `#` comments are ignored',
               directions.is_program, _read_object(directions.read_program)),
    FileFormat('table of azimuth and elevation', DIRECTIONS_KIND,
               'names of columns with an azimuth, or three columns of numbers',
               'CSV of time, azimuth and elevation; without names, these three columns in this order',
               directions.is_table, _read_object(directions.read_table)),
    FileFormat('CSV', LOG_KIND, 'anything else', 'CSV of time, latitude, longitude and altitude',
               lambda beginning: True, _read_log(tables.rows)))

FOREIGN_FORMATS = (
    (re.compile(r'A[A-Z0-9]{3}[^\n]*\n(?:[^\n]*\n){0,200}?(?:HFDTE|B\d{13}[NS]\d{8}[EW][AV])'),
     'an IGC log of a glider: convert it to GPX, for example with gpsbabel -i igc -f FLIGHT.igc -o gpx -F FLIGHT.gpx'),
    (re.compile(r'(?:<\?xml[^>]*>\s*|<!--.*?-->\s*)*<(?:\w+:)?kml\b', re.DOTALL),
     'a KML file of Google Earth: convert it to GPX, for example with gpsbabel -i kml -f FLIGHT.kml -o gpx -F '
     'FLIGHT.gpx; a path without times (LineString) is no flight'),
    (re.compile(r'#[a-d][PV]\d{4} '),
     'an SP3 file of precise orbits: convert the orbit of one satellite to a CCSDS OEM (KEYWORD = value)'))
"""(pattern of the beginning of a file, its name and remedy) of text formats that this project cannot read."""

DERIVED_PARAMETERS = (*flight.STATION_FIELDS, 'receiver.reference_range', 'duration')
"""Parameters that a track file gives if the scenario does not: of the receiver, and the duration of the run."""


def read(track: TrackFileParameters) -> tuple[FileKind, Data]:
    """Return (kind, data) of a track file. Raises csv_table.TableError. Because the nodes of a run and all trials of a
    plan read one file, the last file is kept until it changes."""
    try:
        found = os.stat(track.path)
    except (OSError, ValueError):   # `_read` names the reason
        return _read(track)
    return _kept(track, (found.st_ino, found.st_size, found.st_mtime_ns))


def _read(track: TrackFileParameters) -> tuple[FileKind, Data]:
    if not track.path:
        raise csv_table.TableError('track_file.path is empty: give --param '
                                   'tracking_receiver.target.track_file.path=FILE, a file of one of the formats '
                                   + ', '.join(form.name for form in FILE_FORMATS))
    with csv_table.stream(track.path) as stream:
        beginning = files.beginning(stream.read(FORMAT_PROBE_BYTES)).lstrip()
    for pattern, name in FOREIGN_FORMATS:
        if pattern.match(beginning):
            raise csv_table.TableError(f'{track.path}: {name}')
    form = next(form for form in FILE_FORMATS if form.matches(beginning))
    return form.kind, form.read(track)


@functools.lru_cache(maxsize=1)
def _kept(track: TrackFileParameters, _state: tuple[int, int, int]) -> tuple[FileKind, Data]:
    """Return `_read` of a file in a state: number, size and time of its last change."""
    return _read(track)


def lay_out(target: TargetParameters, duration: Seconds, margin: Seconds) -> flight.Flight:
    """Return the Flight of a run, with `margin` at both ends as far as the file goes. Raises csv_table.TableError."""
    kind, data = read(target.track_file)
    return kind.lay_out(data, target, duration, margin)


def derived_parameters(target: TargetParameters, given: Collection[str]) -> dict[str, float]:
    """Return {name: value} of DERIVED_PARAMETERS from the file of a target. Raises csv_table.TableError. given: names
    of the parameters that the scenario sets; only those of the station and the start matter here."""
    kind, data = read(target.track_file)
    return kind.run_parameters(data, target, given)
