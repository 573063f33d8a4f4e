"""Track files of a target: their formats, and their kinds (recorded fixes, predicted orbit, table of directions).

target.py calls `lay_out`. The first row of FILE_FORMATS that matches the beginning of a file gives its reader and its
kind.
"""
import re
import typing

from pedestal_common.text_files import content, csv_table
from tracking_receiver_sim.ephemeris import course, directions, lines, oem, stk
from tracking_receiver_sim.track import fixes, flight, gpx, nmea, place, tables

FORMAT_PROBE_BYTES = 65536  # number of bytes at the beginning of a file that decide its format


class FileKind(typing.NamedTuple):
    """Kind of track, with two functions of the data that a reader returns.

        lay_out         (data, TargetParameters, duration, margin) -> flight.Flight
        run_parameters  (data, TargetParameters, given) -> {parameter: value} for a scenario that does not set them;
                        given: names of the parameters that the scenario sets
    """
    lay_out: typing.Callable
    run_parameters: typing.Callable


LOG_KIND = FileKind(lambda log, target, _duration, _margin: flight.lay_out(log, target.track_file, target.station),
                    place.run_parameters)
ORBIT_KIND = FileKind(course.flight_of_orbit, course.run_parameters_of_orbit)
DIRECTIONS_KIND = FileKind(course.flight_of_directions, course.run_parameters_of_directions)


class FileFormat(typing.NamedTuple):
    """Format of a file. matches(beginning: str): True if a file has this format; read(TrackFileParameters): its
    data."""
    name: str
    kind: FileKind
    matches: typing.Callable
    read: typing.Callable


def _read_log(rows):
    """Return the function TrackFileParameters -> fixes.Fixes for a function `rows` that yields fixes."""
    return lambda track: fixes.read(track, rows)


def _read_object(read):
    """Return the function TrackFileParameters -> data for a function read(path, name of the object)."""
    return lambda track: read(track.path, track.aircraft)


FILE_FORMATS = (
    FileFormat('CCSDS OEM', ORBIT_KIND, lambda beginning: lines.begins_with(beginning, oem.FILE_SIGNATURE),
               _read_object(oem.read)),
    FileFormat('STK ephemeris', ORBIT_KIND, stk.FILE_SIGNATURE_PATTERN.match, _read_object(stk.read)),
    FileFormat('GPX', LOG_KIND, lambda beginning: beginning.startswith('<'), _read_log(gpx.rows)),
    FileFormat('NMEA', LOG_KIND, nmea.is_log, _read_log(nmea.rows)),
    FileFormat('sat-nms program', DIRECTIONS_KIND, directions.is_program, _read_object(directions.read_program)),
    FileFormat('table of azimuth and elevation', DIRECTIONS_KIND, directions.is_table,
               _read_object(directions.read_table)),
    FileFormat('CSV', LOG_KIND, lambda beginning: True, _read_log(tables.rows)))
"""Formats in the order in which a file is compared with them; the last one takes every other file."""

FOREIGN_FORMATS = (
    (re.compile(r'A[A-Z0-9]{3}[^\n]*\n(?:[^\n]*\n){0,200}?(?:HFDTE|B\d{13}[NS]\d{8}[EW][AV])'),
     'an IGC log of a glider: convert it to GPX, for example with gpsbabel -i igc -f FLIGHT.igc -o gpx -F FLIGHT.gpx'),
    (re.compile(r'#[a-d][PV]\d{4} '),
     'an SP3 file of precise orbits: convert the orbit of one satellite to a CCSDS OEM (KEYWORD = value)'))
"""(pattern of the beginning of a file, its name and remedy) of text formats that this project cannot read."""

DERIVED_PARAMETERS = (*place.STATION_FIELDS, 'receiver.reference_range', 'duration')
"""Parameters that a track file gives if the scenario does not: of the receiver, and the duration of the run."""


def read(track):
    """Return (FileKind, data) of the file of a TrackFileParameters. Raises csv_table.TableError."""
    if not track.path:
        raise csv_table.TableError('track_file.path is empty: must name a file of one of the formats '
                                   + ', '.join(form.name for form in FILE_FORMATS))
    with csv_table.stream(track.path) as stream:
        beginning = content.beginning(stream.read(FORMAT_PROBE_BYTES)).lstrip()
    for pattern, name in FOREIGN_FORMATS:
        if pattern.match(beginning):
            raise csv_table.TableError(f'{track.path}: {name}')
    form = next(form for form in FILE_FORMATS if form.matches(beginning))
    return form.kind, form.read(track)


def lay_out(target, duration, margin) -> flight.Flight:
    """Return the Flight of a TargetParameters for a run of `duration` [s], with `margin` [s] at both ends as far as
    the file goes; raises csv_table.TableError."""
    kind, data = read(target.track_file)
    return kind.lay_out(data, target, duration, margin)


def derived_parameters(target, given):
    """Return {name: value} of DERIVED_PARAMETERS from the file of a TargetParameters. Raises csv_table.TableError.

    given: names of the parameters that the scenario sets; only those of the station and the start matter here.
    """
    kind, data = read(target.track_file)
    return kind.run_parameters(data, target, given)
