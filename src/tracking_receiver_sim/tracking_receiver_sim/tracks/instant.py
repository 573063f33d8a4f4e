"""Instants, the times of track files: seconds since 1970 that count leap seconds, from dates in many notations.

Because leap seconds count, the difference of two instants is the time between them. An instant is TAI - 37 s. From
2017 on it equals the seconds since 1970 of computers, which omit leap seconds. The table of leap seconds is that of
skyfield.
"""
import datetime
import functools
import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Seconds, Texts
from pedestal_common.text_files import csv_table
from pedestal_common.text_files.files import FilePath

if TYPE_CHECKING:   # slow to import
    from skyfield.timelib import Timescale

MONTH_NAMES = 'jan feb mar apr may jun jul aug sep oct nov dec'.split()
_FRACTION = r'(?:[.,](?P<fraction>\d{0,9}))?'
_CLOCK = rf'(?P<hour>\d{{1,2}}):(?P<minute>\d\d)(?::(?P<second>\d\d))?{_FRACTION}'
_BASIC_CLOCK = rf'(?P<hour>\d\d)(?P<minute>\d\d)(?P<second>\d\d){_FRACTION}'
_MONTH = rf'(?P<month_name>{"|".join(MONTH_NAMES)})[a-z]*'
DATE_PATTERNS = tuple(re.compile(f'{date}(?P<zone> ?(?:Z|UTC|[+-]\\d\\d:?\\d\\d))?', re.ASCII | re.IGNORECASE)
                      for date in (rf'(?P<year>\d{{4}})-(?P<month>\d\d)-(?P<day>\d\d)(?:T| ){_CLOCK}',
                                   rf'(?P<year>\d{{4}})(?P<month>\d\d)(?P<day>\d\d)(?:T| ){_BASIC_CLOCK}',
                                   rf'(?P<year>\d{{4}})/(?P<month>\d\d)/(?P<day>\d\d) {_CLOCK}',
                                   rf'(?P<day>\d{{1,2}})\.(?P<month>\d{{1,2}})\.(?P<year>\d{{4}}) {_CLOCK}',
                                   rf'(?:A\.D\. )?(?P<year>\d{{4}})-{_MONTH}-(?P<day>\d\d) {_CLOCK}',
                                   rf'(?P<day>\d{{1,2}}) {_MONTH} (?P<year>\d{{4}}) {_CLOCK}'))
"""ISO 8601, its basic format (20180723T100000), year/month/day, day.month.year, JPL Horizons (2018-Jul-23), STK, the
Systems Tool Kit (23 Jul 2018)."""
AMBIGUOUS_PATTERN = re.compile(r'\d{1,2}[/-]\d{1,2}[/-](?:\d{4}|\d\d)\b.*', re.ASCII)  # order differs by country
DATE_EXAMPLES = ('2018-07-23T10:00:00Z, 2018/07/23 10:00:00, 23.07.2018 10:00:00, 2018-Jul-23 10:00:00 or '
                 '23 Jul 2018 10:00:00')


def iso_date(text: str | None) -> str:
    """Return a date with a time of day in ISO 8601, with the zone as written; another text with single spaces."""
    words = ' '.join((text or '').split())
    match = next(filter(None, (pattern.fullmatch(words) for pattern in DATE_PATTERNS)), None)
    if not match:
        return words
    found = match.groupdict()
    month = found.get('month') or 1 + MONTH_NAMES.index(found['month_name'].lower())
    fraction, zone = found['fraction'], (found['zone'] or '').upper()
    return (f'{found["year"]}-{int(month):02}-{int(found["day"]):02}T{int(found["hour"]):02}:{found["minute"]}:'
            f'{found["second"] or "00"}{"." + fraction if fraction else ""}{zone}')


UNIX_TIME_LIMITS_S = (0.0, 4102444800.0)  # range of the seconds since 1970 without leap seconds: until 2100
TAI_OFFSET_S = 37.0  # TAI minus an instant [s]: TAI - UTC since 2017
UNIX_EPOCH_JULIAN_DATE = 2_440_587.5  # julian date of 1970-01-01T00:00 UTC

ISO_TIME_PATTERN = re.compile(
    r'(\d{4}-\d\d-\d\d)[T ](\d\d):(\d\d):(\d\d)(?:[.,](\d{1,9}))?(?: ?(?:Z|UTC|([+-])(\d\d):?(\d\d)))?', re.ASCII)

FINE_UNIX_TIME_PATTERN = re.compile(r'[1-9](?:\d{12}|\d{15})(?:\.0*)?', re.ASCII)
"""Milliseconds or microseconds since 1970, of the years 2001 to 2286. Read as seconds, such a number is no date."""


@functools.cache
def timescale() -> 'Timescale':
    """Return the timescale of skyfield."""
    from skyfield.api import load  # slow to import; a file without a date does not need it
    return load.timescale(builtin=True)


@functools.lru_cache(4096)
def tai_offset(day: int) -> Seconds:
    """Return TAI - UTC on a day since 1970."""
    return float(round((timescale().utc(1970, 1, 1 + day).tai - UNIX_EPOCH_JULIAN_DATE - day) * SECONDS_PER_DAY))


def of_day(day: int, second: Seconds) -> Seconds:
    """Return the instant of a day since 1970 and seconds of the day, UTC. Raises ValueError for second 86400 of a day
    without a leap second."""
    if second >= SECONDS_PER_DAY and second >= SECONDS_PER_DAY + tai_offset(day + 1) - tai_offset(day):
        raise ValueError('no leap second on this day')
    return SECONDS_PER_DAY * day + second + tai_offset(day) - TAI_OFFSET_S


def of_unix_time(value: Seconds) -> Seconds:
    """Return the instant of seconds since 1970 that omit leap seconds."""
    return value + tai_offset(int(value // SECONDS_PER_DAY)) - TAI_OFFSET_S


def second_of_day(hours: int, minutes: int, seconds: Seconds) -> Seconds:
    """Return the seconds since midnight of a time of day. Raises ValueError; 23:59:60 is valid."""
    if hours > 23 or minutes > 59 or seconds >= (61.0 if (hours, minutes) == (23, 59) else 60.0):
        raise ValueError('no time of day')
    return 3600.0 * hours + 60.0 * minutes + seconds


def is_dated(text: str) -> bool:
    """Return True for a date, and for milliseconds or microseconds since 1970."""
    return bool(ISO_TIME_PATTERN.fullmatch(iso_date(text)) or FINE_UNIX_TIME_PATTERN.fullmatch(text))


def seconds(path: FilePath, line: int, name: str, text: str | None) -> Seconds:
    """Return the instant of a date (without a zone: UTC), or of seconds since 1970 without leap seconds. Raises
    TableError. A number of 13 digits is in milliseconds, one of 16 digits in microseconds."""
    text = iso_date(text)
    match = ISO_TIME_PATTERN.fullmatch(text)
    try:
        if not match:
            size = 1.0
            if FINE_UNIX_TIME_PATTERN.fullmatch(text):
                size = 1e-3 if len(text.partition('.')[0]) == 13 else 1e-6
            return of_unix_time(csv_table.number(path, line, name, size * float(text.replace('_', ' ')),
                                                 *UNIX_TIME_LIMITS_S))
        return _of_iso(*match.groups())
    except csv_table.TableError:
        raise
    except ValueError:
        order = 'the order of day and month is unknown: ' if AMBIGUOUS_PATTERN.fullmatch(text) else ''
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60}: {order}must be UTC as ISO 8601, for '
                                   f'example {DATE_EXAMPLES}, or as seconds since 1970') from None


def _of_iso(date: str, hours: str, minutes: str, second: str, fraction: str | None, sign: str | None,
            zone_hours: str | None, zone_minutes: str | None) -> Seconds:
    leap = int(second) == 60
    zone = f'{sign}{zone_hours}:{zone_minutes}' if sign else '+00:00'
    utc = datetime.datetime.fromisoformat(f'{date}T{hours}:{minutes}:{59 if leap else second}{zone}').timestamp()
    if not UNIX_TIME_LIMITS_S[0] <= utc <= UNIX_TIME_LIMITS_S[1]:
        raise ValueError('outside the range')
    day, whole = divmod(utc, SECONDS_PER_DAY)
    if leap and whole != SECONDS_PER_DAY - 1.0:
        raise ValueError('no leap second at this time')
    return of_day(int(day), whole + leap + float(f'0.{fraction or 0}'))


def iso(value: Seconds) -> str:
    """Return an instant as ISO 8601 to the millisecond, UTC."""
    ms = round(value * 1e3)
    day = int(ms // (1000 * SECONDS_PER_DAY)) + 1
    while ms < round(of_day(day, 0.0) * 1e3):
        day -= 1
    ms -= round(of_day(day, 0.0) * 1e3)
    minutes = min(ms // 60_000, 1439)
    date = datetime.date(1970, 1, 1) + datetime.timedelta(days=day)
    return f'{date}T{minutes // 60:02}:{minutes % 60:02}:{(ms - 60_000 * minutes) / 1e3:06.3f}Z'


def utc_texts(begin: np.datetime64, passed: NDArray[np.timedelta64]) -> Texts:
    """Return ISO 8601 to the microsecond of times, UTC: `passed`, growing, after begin."""
    times: NDArray[np.datetime64] = np.add(begin, passed)
    texts = np.datetime_as_string(times)
    first, last = (int(time.astype('M8[D]').astype(int)) for time in (begin, times[-1])) if len(times) else (0, 0)
    for day in range(first + 1, last + 1):
        if tai_offset(day) > tai_offset(day - 1):
            # numpy has no second 60, so a leap second gets the text of the second before it with 60 in place of 59.
            after = times >= np.datetime64(day, 'D')
            times = np.where(after, times - np.timedelta64(1, 's'), times)
            texts = np.datetime_as_string(times)
            inside = after & (times < np.datetime64(day, 'D'))
            texts[inside] = np.char.replace(texts[inside], ':59.', ':60.')
            break
    return texts
