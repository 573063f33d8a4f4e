"""Reader of flights as CSV. The names of the columns select a row of CSV_LAYOUTS (docs/reference/tracks.md).

The geometric altitude of ADS-B is above the ellipsoid. If a file has only the barometric altitude, it is taken
instead, with a remark in the log. Rows of ADS-B logs without a position are passed over and counted.
"""

from collections.abc import Iterator
from typing import NamedTuple

from pedestal_common.quantities import Meters
from pedestal_common.text_files import columns, csv_table, units
from tracking_receiver_sim.tracks import times
from tracking_receiver_sim.tracks.fixes import Fix, Log

ALTITUDE_LIMITS_FT_IN_M = -3000.0 * units.METRES_PER_FOOT, 500_000.0 * units.METRES_PER_FOOT
ALTITUDE_LIMITS_M = -1000.0, 150_000.0  # of ADS-B [m], in feet and in metres
EMPTY_CELL_TEXTS = ('', 'nan', 'none', 'null')  # texts of a cell without a value, in lower case

IDENTITY_NAMES = ('icao24', 'callsign')
LATITUDE = columns.Quantity('latitude_deg', dict.fromkeys(('latitude', 'lat'), 'deg'), 'deg')
LONGITUDE = columns.Quantity('longitude_deg', dict.fromkeys(('longitude', 'lon', 'lng', 'long'), 'deg'), 'deg')
ALTITUDE = columns.Quantity('altitude_m', dict.fromkeys(('altitude', 'alt', 'height', 'elevation', 'ele',
                                                         'geoaltitude'), ''), 'm')
POSITION = columns.Quantity('position', {'position': 'deg'}, 'deg')  # an altitude must name its unit


class CsvLayout(NamedTuple):
    """Layout of a CSV file."""
    name: str
    time: columns.Quantity
    latitude: columns.Quantity                  # POSITION if one column holds latitude and longitude
    longitude: columns.Quantity
    altitudes: tuple[columns.Quantity, ...]     # the best first
    limits: tuple[Meters, Meters]               # range of an altitude
    adsb: bool                                  # True: UTC, and cells of the needed columns may be empty
    barometric: int                             # index of the first barometric altitude in `altitudes`

    def matches(self, table: csv_table.Table) -> bool:
        """Return True if a table has a column for each quantity."""
        names = table.fieldnames
        if not all(columns.named(names, wanted) for wanted in (self.time, self.latitude, self.longitude)):
            return False
        return (any(columns.named(names, altitude) for altitude in self.altitudes)
                and not (self.adsb and table.column(self.time).unit not in ('s', units.UTC)))


def _named(name: str, default: str, unit: str = '') -> columns.Quantity:
    """unit: in which the reader takes the values, '': `default`, the unit if the name states none."""
    return columns.Quantity(name, {name: default}, unit or default)


CSV_LAYOUTS = (
    CsvLayout('Flightradar24', _named('timestamp', 's'), POSITION, POSITION, (_named('altitude', 'ft', 'm'),),
              ALTITUDE_LIMITS_FT_IN_M, True, 0),
    CsvLayout('ADS-B', _named('timestamp', 's'), _named('latitude', 'deg'), _named('longitude', 'deg'),
              (_named('geoaltitude', 'ft', 'm'), _named('altitude', 'ft', 'm')), ALTITUDE_LIMITS_FT_IN_M, True, 1),
    CsvLayout('ADS-B', _named('time', 's'), _named('lat', 'deg'), _named('lon', 'deg'),
              (_named('geoaltitude', 'm'), _named('baroaltitude', 'm')), ALTITUDE_LIMITS_M, True, 1),
    CsvLayout('CSV', times.TIME._replace(label='time_s'), LATITUDE, LONGITUDE, (ALTITUDE,), (-1000.0, 1e8), False, 1))


def rows(path: str, log: Log) -> Iterator[Fix]:
    """Yield the fixes of a CSV file; the names of an aircraft are icao24 and callsign. Raises TableError."""
    with csv_table.opened(path) as table:
        layout = _layout(table)
        clock = times.Times(table, layout.time, units.UTC if layout.adsb else '')
        latitude, longitude = map(table.column, (layout.latitude, layout.longitude))
        altitudes = [table.column(altitude, required=False) for altitude in layout.altitudes]
        altitude = next(filter(None, altitudes), None) or table.column(layout.altitudes[0])
        identities = [name for known in IDENTITY_NAMES for name in table.fieldnames if name.lower() == known]
        log.form, log.time_name = layout.name, clock.name
        if altitude in altitudes[layout.barometric:]:
            log.remarks.append('barometric altitude taken as height above the ellipsoid')
        needed = [column.name for column in (clock.column, latitude, longitude, altitude)] + identities[:1]
        for row in table:
            if layout.adsb and any((row[name] or '').lower() in EMPTY_CELL_TEXTS for name in needed):
                log.passed_over['row without time, position or aircraft'] += 1
                continue
            t = clock.seconds(row)
            log.dated = bool(clock.dated)
            north, east = (_position(table, row, latitude) if latitude == longitude else
                           (row[latitude.name], row[longitude.name]))
            yield Fix(table.line_num, tuple(row[name] or '' for name in identities), t,
                      table.number(latitude, north, -90.0, 90.0), table.number(longitude, east, -180.0, 360.0),
                      table.number(altitude, row[altitude.name], *layout.limits))
        clock.check()
        described = (column.described() for column in dict.fromkeys((latitude, longitude, altitude)))
        log.remarks.insert(0, f'columns {", ".join((clock.described(), *described))}')


def _layout(table: csv_table.Table) -> CsvLayout:
    """Return the first layout that matches, else the ADS-B layout whose time column the table has. The error about a
    missing column then names the columns of that layout."""
    names = [name.lower() for name in table.fieldnames]
    return next((layout for layout in CSV_LAYOUTS if layout.matches(table)), None) or next(
        (layout for layout in CSV_LAYOUTS[1:] if layout.adsb and layout.time.label in names), CSV_LAYOUTS[-1])


def _position(table: csv_table.Table, row: csv_table.Cells, column: columns.Column) -> list[str]:
    cell = row[column.name] or ''
    parts = [part.strip() for part in cell.split(',')]
    if len(parts) != 2:
        raise csv_table.TableError(f'{table.path}: line {table.line_num}: {column.name} = {cell!r:.60}: must be '
                                   'latitude,longitude')
    return parts
