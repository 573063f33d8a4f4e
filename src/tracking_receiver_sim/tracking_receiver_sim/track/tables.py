"""Flights as CSV. The name of its column of time says what a file holds: a row of CSV_LAYOUTS.

    our own                     time_s, latitude_deg, longitude_deg, altitude_m: every cell is a number
    traffic (ADS-B)             timestamp, latitude, longitude, geoaltitude or altitude: in feet
    OpenSky state vectors       time, lat, lon, geoaltitude or baroaltitude: in metres

The geometric altitude of ADS-B is above the ellipsoid; where a file has only the barometric one, that is taken for it
and said. ADS-B logs have rows without a position: these are passed over and counted.
"""
import typing

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import instant

METRES_PER_FOOT = 0.3048
"""[m]"""

ALTITUDE_LIMITS_FT, ALTITUDE_LIMITS_M = (-3000.0, 500_000.0), (-1000.0, 150_000.0)
"""Altitudes of ADS-B."""

EMPTY_CELL_TEXTS = ('', 'nan', 'none', 'null')
"""What a log writes where it knows nothing."""


class CsvLayout(typing.NamedTuple):
    """Names of the columns; altitudes: the best first, and the unit of both [m]; adsb: cells may be empty, the time is
    UTC and aircraft have an icao24 or a callsign."""
    name: str
    time: str
    latitude: str
    longitude: str
    altitudes: tuple
    unit: float
    limits: tuple
    adsb: bool


CSV_LAYOUTS = (CsvLayout('CSV', 'time_s', 'latitude_deg', 'longitude_deg', ('altitude_m',), 1.0, (-1000.0, 1e8),
                         False),
               CsvLayout('ADS-B', 'timestamp', 'latitude', 'longitude', ('geoaltitude', 'altitude'), METRES_PER_FOOT,
                         ALTITUDE_LIMITS_FT, True),
               CsvLayout('ADS-B', 'time', 'lat', 'lon', ('geoaltitude', 'baroaltitude'), 1.0, ALTITUDE_LIMITS_M, True))


def rows(path, log):
    """Fixes (line, (icao24, callsign), time [s], latitude, longitude [deg], altitude [m]) of a CSV file; log: the
    fixes.Log in which it is noted what the file is. Raises TableError."""
    with csv_table.opened(path) as reader:
        header = reader.fieldnames or ()
        form = next((form for form in CSV_LAYOUTS if form.time in header), CSV_LAYOUTS[0])
        altitude = next((name for name in form.altitudes if name in header), form.altitudes[0])
        names = form.time, form.latitude, form.longitude, altitude
        csv_table.require(path, reader, names)
        identities = [name for name in ('icao24', 'callsign') if name in header] if form.adsb else []
        log.form, log.time_name, log.dated = form.name, form.time, form.adsb
        if form.adsb and altitude != form.altitudes[0]:
            log.remarks.append('barometric altitude taken as height above the ellipsoid')
        for row in reader:
            line = reader.line_num
            cells = {name: (row[name] or '').strip() for name in (*names, *identities)} if form.adsb else row
            if form.adsb and any(cells[name].lower() in EMPTY_CELL_TEXTS for name in (*names, *identities[:1])):
                log.passed_over['row without time, position or aircraft'] += 1
                continue
            time = (instant.seconds(path, line, form.time, cells[form.time]) if form.adsb else
                    csv_table.number(path, line, form.time, cells[form.time], -1e12, 1e12))
            yield (line, tuple(cells[name] for name in identities), time,
                   csv_table.number(path, line, form.latitude, cells[form.latitude], -90.0, 90.0),
                   csv_table.number(path, line, form.longitude, cells[form.longitude], -180.0, 360.0),
                   form.unit * csv_table.number(path, line, altitude, cells[altitude], *form.limits))
