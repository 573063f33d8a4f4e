"""Calendar dates of track files: notations of spreadsheets, JPL Horizons and STK, converted into ISO 8601.

STK is the Systems Tool Kit.
"""
import re

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
"""Notations in this order: ISO 8601, its basic format (20180723T100000), year/month/day, day.month.year, JPL Horizons
(2018-Jul-23), STK (23 Jul 2018)."""
AMBIGUOUS_PATTERN = re.compile(r'\d{1,2}[/-]\d{1,2}[/-](?:\d{4}|\d\d)\b.*', re.ASCII)
"""A date whose order of day and month differs between countries."""
DATE_EXAMPLES = ('2018-07-23T10:00:00Z, 2018/07/23 10:00:00, 23.07.2018 10:00:00, 2018-Jul-23 10:00:00 or '
                 '23 Jul 2018 10:00:00')


def iso(text: str | None) -> str:
    """Return a date with a time of day in ISO 8601; the zone stays as it is written, in capitals.

    A text in no known notation is returned with single spaces.
    """
    words = ' '.join((text or '').split())
    match = next(filter(None, (pattern.fullmatch(words) for pattern in DATE_PATTERNS)), None)
    if not match:
        return words
    found = match.groupdict()
    month = found.get('month') or 1 + MONTH_NAMES.index(found['month_name'].lower())
    fraction, zone = found['fraction'], (found['zone'] or '').upper()
    return (f'{found["year"]}-{int(month):02}-{int(found["day"]):02}T{int(found["hour"]):02}:{found["minute"]}:'
            f'{found["second"] or "00"}{"." + fraction if fraction else ""}{zone}')
