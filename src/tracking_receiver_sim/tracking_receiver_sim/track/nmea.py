"""Logs of NMEA 0183: GGA for time of day, position and height, RMC for the date. Other sentences are passed over.

The height above the ellipsoid is altitude + geoidal separation. Text before the $ of a line, for example the time of
a logger, is passed over. Sentences with a wrong checksum and GGA without a fix are passed over and counted.
"""
import datetime
import re

import pynmea2

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.text_files import csv_table

SENTENCE_PATTERN = re.compile(r'\$..(?:GGA|RMC),.*', re.ASCII)
MAX_LINE_CHARS = 1024
"""Largest number of characters of a line; the standard allows 82."""


def rows(path, log):
    """Yield the fixes (line, (), time [s], latitude, longitude [deg], altitude [m]) of a log.

    log: fixes.Log, which receives the description of the file. The time is since midnight; with the offset in `log`,
    from the date of an RMC, it becomes UTC since 1970. Raises TableError.
    """
    log.form, log.time_name, log.dated = 'NMEA', 'time', False
    days, last, without_separation = 0, None, False
    for line, text in _lines(path):
        match = SENTENCE_PATTERN.search(text)
        if not match:
            continue
        try:
            sentence = pynmea2.parse(match[0])
        except pynmea2.ParseError:
            log.passed_over['damaged sentence'] += 1
            continue
        if sentence.sentence_type == 'RMC':
            if sentence.status == 'A' and isinstance(sentence.datestamp, datetime.date) and not log.dated:
                log.dated, midnight = True, datetime.datetime.combine(sentence.datestamp, datetime.time())
                log.offset = midnight.replace(tzinfo=datetime.timezone.utc).timestamp() - SECONDS_PER_DAY * days
            continue
        if not sentence.gps_qual or not sentence.lat or not sentence.lon:
            log.passed_over['GGA without a fix'] += 1
            continue
        time = _time_of_day(path, line, sentence)
        if last is not None and time < last - 0.5 * SECONDS_PER_DAY:
            days += 1
        last = time
        without_separation = without_separation or not sentence.geo_sep
        separation = csv_table.number(path, line, 'geoidal separation', sentence.geo_sep or '0', -150.0, 150.0)
        yield (line, (), time + SECONDS_PER_DAY * days,
               _angle(path, line, 'latitude', sentence.lat, sentence.lat_dir, 'NS', 90.0),
               _angle(path, line, 'longitude', sentence.lon, sentence.lon_dir, 'EW', 180.0),
               separation + csv_table.number(path, line, 'altitude', sentence.altitude, -1000.0, 1e8))
    if without_separation:
        log.remarks.append('altitude without geoidal separation taken as height above the ellipsoid')


def _lines(path):
    with csv_table.stream(path) as stream:
        number = 0
        while line := stream.readline(MAX_LINE_CHARS):
            number += 1
            if len(line) == MAX_LINE_CHARS and not line.endswith(b'\n'):
                raise csv_table.TableError(f'{path}: line {number}: longer than {MAX_LINE_CHARS} characters')
            yield number, line.decode('ascii', 'replace').strip()


def _time_of_day(path, line, sentence):
    """Return the seconds since midnight of a GGA; raises TableError."""
    time = sentence.timestamp
    if not isinstance(time, datetime.time):
        raise csv_table.TableError(f'{path}: line {line}: time = {sentence.data[0]!r:.60}: must be hhmmss.ss')
    return 3600.0 * time.hour + 60.0 * time.minute + time.second + 1e-6 * time.microsecond


def _angle(path, line, name, text, side, sides, limit):
    """Return the degrees of a ddmm.mm and its side, positive on the first of the sides; raises TableError."""
    value = csv_table.number(path, line, name, text, 0.0, 100.0 * limit)
    degrees, minutes = divmod(value, 100.0)
    if minutes >= 60.0 or side not in tuple(sides):
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60} {side!r:.60}: must be degrees and '
                                   f'minutes below 60, {sides[0]} or {sides[1]}')
    return csv_table.number(path, line, name, (degrees + minutes / 60.0) * (1 if side == sides[0] else -1), -limit,
                            limit)
