"""Calendar dates with a time of day in the notations of spreadsheets, JPL Horizons and STK, turned into ISO 8601."""
import re

MONTH_NAMES = 'jan feb mar apr may jun jul aug sep oct nov dec'.split()
_CLOCK = r'(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d))?(?:[.,](?P<fraction>\d{0,9}))?'
_MONTH = rf'(?P<name>{"|".join(MONTH_NAMES)})[a-z]*'
DATE_PATTERNS = tuple(re.compile(f'{date}{_CLOCK}(?P<zone> ?(?:Z|UTC|[+-]\\d\\d:?\\d\\d))?', re.ASCII | re.IGNORECASE)
                      for date in (r'(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)(?:T| )',
                                   r'(?P<year>\d{4})/(?P<month>\d\d)/(?P<day>\d\d) ',
                                   r'(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>\d{4}) ',
                                   rf'(?:A\.D\. )?(?P<year>\d{{4}})-{_MONTH}-(?P<day>\d\d) ',
                                   rf'(?P<day>\d{{1,2}}) {_MONTH} (?P<year>\d{{4}}) '))
"""ISO 8601, with strokes, day.month.year, of JPL Horizons (2018-Jul-23), of STK (23 Jul 2018)."""
DATE_EXAMPLES = ('2018-07-23T10:00:00Z, 2018/07/23 10:00:00, 23.07.2018 10:00:00, 2018-Jul-23 10:00:00 or '
                 '23 Jul 2018 10:00:00')


def iso(text):
    """Return a date with a time of day in ISO 8601; a text in no known notation is returned as it is."""
    words = ' '.join((text or '').split())
    match = next(filter(None, (pattern.fullmatch(words) for pattern in DATE_PATTERNS)), None)
    if not match:
        return words
    found = match.groupdict()
    month = found.get('month') or 1 + MONTH_NAMES.index(found['name'].lower())
    fraction, zone = found['fraction'], (found['zone'] or '').upper()
    return (f'{found["year"]}-{int(month):02}-{int(found["day"]):02}T{int(found["hour"]):02}:{found["minute"]}:'
            f'{found["second"] or "00"}{"." + fraction if fraction else ""}{zone}')
