"""Times in a column of a track file: UTC as a date, Julian dates, or numbers from any origin.

A table may also have two columns: one of the date and one of the time of day, both UTC.
"""
from collections.abc import Sequence

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Seconds
from pedestal_common.text_files import columns, csv_table, units
from pedestal_common.text_files.files import FilePath
from tracking_receiver_sim.tracks import instant

TIME = columns.Quantity('time', {
    **dict.fromkeys(('time', 'epoch', 'timestamp', 't'), 's'),
    **dict.fromkeys(('utc', 'utc time', 'utc date', 'utcg', 'date', 'datetime', 'date time', 'date utc time'),
                    units.UTC),
    **dict.fromkeys(('jd', 'jdut', 'jdutc', 'jd ut', 'jd utc', 'julian date', 'julian day'), units.JULIAN_DATE),
    **dict.fromkeys(('mjd', 'mjd ut', 'mjd utc'), units.MODIFIED_JULIAN_DATE)}, 's')
DATE = columns.Quantity('date', dict.fromkeys(('date', 'utc date'), units.UTC), 's')
TIME_OF_DAY = columns.Quantity('time of day', dict.fromkeys(('time', 'utc', 'utc time'), units.UTC), 's')
MODIFIED_JULIAN_DATE_ZERO = 2_400_000.5  # julian date of the modified Julian date 0
JULIAN_DATE_LIMITS = 2_400_000.5, 2_536_000.0  # range of Julian dates: from 1858, the modified Julian date 0, to 2231
FIRST_EXPECTED_JULIAN_DATE = 2_440_000.5
"""Julian date of 1968, the modified Julian date 40,000; `check` takes no smaller number for a date, so that a short
file of seconds from 0 on is not refused."""
MIN_UNIX_TIME_S = 1e8  # least number of seconds since 1970 in a column of UTC [s]; a smaller number has another origin
MIN_SPAN_S = 3.0
"""Least time from first to last row if the times may be days of a Julian date [s]: a pass lasts less than 3 days."""


class Times:
    """The times of a table, all with a date or all without."""
    column: columns.Column      # of the time, or of the time of day
    date: str                   # name of the column of the date beside it, '' if there is none
    dated: bool | None          # True: instants; False: seconds from any origin; None: no row yet
    first: Seconds | None       # time of the first row
    last: Seconds | None        # time of the last row

    def __init__(self, table: csv_table.Table, wanted: columns.Quantity, unit: str = '') -> None:
        """Find the column. Raises TableError. unit: unit of its values; '': the one that its name states."""
        self.table, self.date, self.dated = table, _date(table.fieldnames, wanted), None
        unit = units.UTC if self.date else unit
        column = table.column(wanted, without=self.date)
        self.column = column._replace(unit=unit) if unit else column
        self.first = self.last = None

    @property
    def name(self) -> str:
        """Name of the column, or names of the two columns."""
        return f'{self.date} and {self.column.name}' if self.date else self.column.name

    def seconds(self, row: csv_table.Cells) -> Seconds:
        """Return the time of a row: an instant if dated, otherwise seconds from any origin. Raises TableError."""
        cell = row[self.column.name] or ''
        value = self._seconds(f'{row[self.date] or ""} {cell}' if self.date else cell)
        self.first, self.last = value if self.first is None else self.first, value
        return value

    def _seconds(self, cell: str) -> Seconds:
        table, column = self.table, self.column
        place = table.path, table.line_num, self.name
        if column.unit in (units.JULIAN_DATE, units.MODIFIED_JULIAN_DATE):
            self.dated = True
            return julian(*place, table.point(column.name, cell), column.unit == units.MODIFIED_JULIAN_DATE)
        dated = column.unit == units.UTC or column.unit == 's' and instant.is_dated(cell)
        if self.dated not in (None, dated):
            raise csv_table.TableError(f'{table.path}: line {table.line_num}: {column.name} = {cell!r:.60}: must be '
                                       f'{"UTC as ISO 8601" if self.dated else "a number"} as in the lines above')
        self.dated = dated
        if not dated:
            # Such a cell, for example hh:mm:ss, is neither a date nor a number. The call only raises the error that
            # names the valid forms of a date.
            if column.unit == 's' and ':' in cell:
                return instant.seconds(*place, cell)
            return table.number(column, cell, -1e12, 1e12)
        value = instant.seconds(*place, cell)
        if value < MIN_UNIX_TIME_S and ':' not in cell:
            raise csv_table.TableError(f'{table.path}: line {table.line_num}: {column.name} = {cell!r:.60}: must be '
                                       f'UTC, for example {instant.DATE_EXAMPLES}, or at least {MIN_UNIX_TIME_S:g} s '
                                       'since 1970; for seconds from another origin, name the column time_s')
        return value

    def described(self) -> str:
        """Return the name of the column with the unit that was taken."""
        return self.column._replace(name=self.name, unit=units.UTC if self.dated else self.column.unit).described()

    def check(self) -> None:
        """Raise TableError after the last row if times taken as seconds look like days of a Julian date."""
        if self.dated or self.column.unit != 's' or self.first is None or self.last is None:
            return
        if self.last - self.first >= MIN_SPAN_S:
            return
        for unit, zero in (('JD', 0.0), ('MJD', MODIFIED_JULIAN_DATE_ZERO)):
            if FIRST_EXPECTED_JULIAN_DATE <= self.first + zero <= JULIAN_DATE_LIMITS[1]:
                raise csv_table.TableError(
                    f'{self.table.path}: line {self.table.head_line}: {self.column.name} = {self.first:.10g} to '
                    f'{self.last:.10g} s: must last at least {MIN_SPAN_S:g} s at such numbers, which look like a '
                    f'Julian date in days: name the column {unit}; write the dates of a spreadsheet as text')


def _date(names: Sequence[str], wanted: columns.Quantity) -> str:
    """Return the name of the column of dates if the table also has one of the time of day, else ''."""
    if not DATE.names.keys() <= wanted.names.keys():
        return ''
    found, clocks = ([name for name in names if columns.unit_of(name, part) == units.UTC]
                     for part in (DATE, TIME_OF_DAY))
    return found[0] if len(found) == len(clocks) == 1 else ''


def julian(path: FilePath, line: int, name: str, text: str, modified: bool = False) -> Seconds:
    """Return the instant, see the module instant, of a Julian date, or a modified one, in days. Raises TableError."""
    zero = MODIFIED_JULIAN_DATE_ZERO if modified else 0.0
    low, high = JULIAN_DATE_LIMITS
    csv_table.number(path, line, name, text, low - zero, high - zero)
    day, _, fraction = text.partition('.')
    if not (day.isdecimal() and (fraction or '0').isdecimal()):
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60}: must be a number of days')
    return instant.of_unix_time(SECONDS_PER_DAY * (float(day) + zero - instant.UNIX_EPOCH_JULIAN_DATE)
                                + SECONDS_PER_DAY * float(f'0.{fraction or 0}'))
