"""What a track file is and what becomes of it: a table of forms, the first whose mark the file bears, and of kinds.

A log of fixes was flown, an orbit or a table of directions is predicted; the target flies all of them.
"""
import typing

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.ephemeris import course, directions, oem, stk
from tracking_receiver_sim.track import fixes, flight, gpx, nmea, place, tables

FORMAT_PROBE_BYTES = 4096
"""Bytes that say what a file is."""


class FileKind(typing.NamedTuple):
    """lay_out(data, TargetParameters, duration, margin) -> flight.Flight; run(data, TargetParameters, given) -> the
    parameters that follow where a scenario leaves them open."""
    lay_out: typing.Callable
    run: typing.Callable


LOG_KIND = FileKind(lambda log, target, _duration, _margin: flight.lay_out(log, target.track_file, target.station),
                    place.run)
ORBIT_KIND = FileKind(course.of_orbit, course.run_of_orbit)
DIRECTIONS_KIND = FileKind(course.of_directions, course.run_of_directions)


class FileFormat(typing.NamedTuple):
    """bears(beginning: bytes): whether a file is one; read(TrackFileParameters): its data."""
    name: str
    kind: FileKind
    bears: typing.Callable
    read: typing.Callable


def _log(rows):
    return lambda track: fixes.read(track, rows)


def _of(read):
    return lambda track: read(track.path, track.aircraft)


FILE_FORMATS = (
    FileFormat('CCSDS OEM', ORBIT_KIND, lambda beginning: beginning.startswith(oem.FILE_SIGNATURE), _of(oem.read)),
    FileFormat('STK ephemeris', ORBIT_KIND, stk.FILE_SIGNATURE_PATTERN.match, _of(stk.read)),
    FileFormat('GPX', LOG_KIND, lambda beginning: beginning.startswith(b'<'), _log(gpx.rows)),
    FileFormat('NMEA', LOG_KIND, lambda beginning: beginning.startswith((b'$', b'!')), _log(nmea.rows)),
    FileFormat('sat-nms program', DIRECTIONS_KIND, directions.is_program, _of(directions.read_program)),
    FileFormat('table of azimuth and elevation', DIRECTIONS_KIND, directions.is_table, _of(directions.read_table)),
    FileFormat('CSV', LOG_KIND, lambda beginning: True, _log(tables.rows)))

DERIVED_PARAMETERS = (*place.STATION_FIELDS, 'receiver.reference_range', 'duration')
"""What a scenario may leave open: parameters of the receiver, and the duration of the run."""


def read(track):
    """(Kind, data) of the file of a TrackFileParameters. Raises csv_table.TableError."""
    if not track.path:
        raise csv_table.TableError('track_file.path is empty: must name a file: '
                                   + ', '.join(form.name for form in FILE_FORMATS))
    with csv_table.stream(track.path) as stream:
        beginning = stream.read(FORMAT_PROBE_BYTES).removeprefix(b'\xef\xbb\xbf').lstrip()
    form = next(form for form in FILE_FORMATS if form.bears(beginning))
    return form.kind, form.read(track)


def lay_out(target, duration, margin) -> flight.Flight:
    """The Flight of a TargetParameters for a run of `duration` [s], with `margin` [s] at both ends where the file
    tells it; raises csv_table.TableError."""
    kind, data = read(target.track_file)
    return kind.lay_out(data, target, duration, margin)


def derived_parameters(target, given):
    """{name: value} that follow from the file of a TargetParameters; given: the names that are, of which only those of
    the station and the start matter here. Raises csv_table.TableError."""
    kind, data = read(target.track_file)
    return kind.run(data, target, given)
