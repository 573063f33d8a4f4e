"""Flights as CSV. The name of the column of time selects the layout of a file, a row of CSV_LAYOUTS.

    native                      time_s, latitude_deg, longitude_deg, altitude_m: every cell is a number
    traffic (ADS-B)             timestamp, latitude, longitude, geoaltitude or altitude: in feet
    OpenSky state vectors       time, lat, lon, geoaltitude or baroaltitude: in metres

The geometric altitude of ADS-B is above the ellipsoid. If a file has only the barometric altitude, it is taken
instead, with a remark in the log. Rows of ADS-B logs without a position are passed over and counted.
"""
import typing

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import instant

METRES_PER_FOOT = 0.3048
"""Length of a foot [m]."""

ALTITUDE_LIMITS_FT, ALTITUDE_LIMITS_M = (-3000.0, 500_000.0), (-1000.0, 150_000.0)
"""Ranges of altitudes of ADS-B [ft], [m]."""

EMPTY_CELL_TEXTS = ('', 'nan', 'none', 'null')
"""Texts of a cell without a value, in lower case."""


class CsvLayout(typing.NamedTuple):
    """Layout of a CSV file.

        time, latitude, longitude   names of the columns
        altitudes                   names of the columns of altitude, the best first
        unit, limits                unit of an altitude [m], and range in this unit
        adsb                        True: UTC, aircraft with an icao24 or a callsign, possibly empty cells
    """
    name: str
    time: str
    latitude: str
    longitude: str
    altitudes: tuple
    unit: float
    limits: tuple
    adsb: bool


CSV_LAYOUTS = (
    CsvLayout('CSV', 'time_s', 'latitude_deg', 'longitude_deg', ('altitude_m',), 1.0, (-1000.0, 1e8), False),
    CsvLayout('ADS-B', 'timestamp', 'latitude', 'longitude', ('geoaltitude', 'altitude'), METRES_PER_FOOT,
              ALTITUDE_LIMITS_FT, True),
    CsvLayout('ADS-B', 'time', 'lat', 'lon', ('geoaltitude', 'baroaltitude'), 1.0, ALTITUDE_LIMITS_M, True))
"""Known layouts; the first one is for a file without a known column of time."""


def rows(path, log):
    """Yield the fixes (line, (icao24, callsign), time [s], latitude, longitude [deg], altitude [m]) of a CSV file.

    log: fixes.Log, which receives the description of the file. Raises TableError.
    """
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
