"""Instants of logs: UTC as ISO 8601, and seconds since 1970."""
import datetime
import re

from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import dates

UNIX_TIME_LIMITS_S = (0.0, 4102444800.0)
"""Range of an instant, in seconds since 1970: until 2100."""

ISO_TIME_PATTERN = re.compile(
    r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9}))?(?: ?(?:Z|UTC|([+-]\d\d):?(\d\d)))?', re.ASCII)


def seconds(path, line, name, text):
    """Return UTC seconds since 1970 of a text: a date, see `dates` (without a zone: UTC), or the number itself. Raises
    TableError."""
    text = dates.iso(text)
    match = ISO_TIME_PATTERN.fullmatch(text)
    try:
        if not match:
            value = float(text)
        else:
            date, time, fraction, hours, minutes = match.groups()
            zone = f'{hours}:{minutes}' if hours else '+00:00'
            value = datetime.datetime.fromisoformat(f'{date}T{time}{zone}').timestamp() + float(f'0.{fraction or 0}')
    except ValueError:
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60}: must be UTC as ISO 8601, for example '
                                   f'{dates.DATE_EXAMPLES}, or as seconds since 1970') from None
    return csv_table.number(path, line, name, value, *UNIX_TIME_LIMITS_S)


def iso(value):
    """Return UTC seconds since 1970 as ISO 8601 to the millisecond."""
    since_1970 = datetime.timedelta(milliseconds=round(value * 1e3))
    return (datetime.datetime(1970, 1, 1) + since_1970).isoformat(timespec='milliseconds') + 'Z'
