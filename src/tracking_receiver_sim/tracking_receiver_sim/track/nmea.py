"""Logs of NMEA 0183: GGA for time of day, position and height, RMC for the date. Other sentences are passed over.

The height above the ellipsoid is altitude + geoidal separation. Text before the $ of a line, for example the time of
a logger, is passed over. Sentences with a wrong checksum and GGA without a fix are passed over and counted.
"""
import contextlib
import datetime
import re

import pynmea2

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.track import fixes, instant

SENTENCE_PATTERN = re.compile(r'\$..(?:GGA|RMC),.*', re.ASCII)
TIME_PATTERN = re.compile(r'(\d\d)(\d\d)(\d\d(?:\.\d*)?)', re.ASCII)
MAX_LINE_CHARS = 1024
"""Largest number of characters of a line; the standard allows 82."""


def rows(path, log):
    """Yield the fixes (line, (), time [s], latitude, longitude [deg], altitude [m]) of a log.

    log: fixes.Log, which receives the description of the file. The time is an instant if an RMC has a date, otherwise
    it is since midnight. Raises TableError.
    """
    begins = _begin(path)
    log.form, log.time_name, log.dated = 'NMEA', 'time', begins is not None
    clock, without_separation = _Clock(begins), False
    for line, sentence in _sentences(path, log):
        if sentence.sentence_type == 'RMC':
            with contextlib.suppress(ValueError):
                clock.read(_second_of_day(sentence), _day(sentence))
            continue
        try:
            time = clock.read(_second_of_day(sentence))
        except ValueError:
            raise csv_table.TableError(f'{path}: line {line}: time = {sentence.data[0]!r:.60}: must be hhmmss.ss, '
                                       '235960 only for a leap second') from None
        without_separation = without_separation or not sentence.geo_sep
        separation = csv_table.number(path, line, 'geoidal separation', sentence.geo_sep or '0', -150.0, 150.0)
        yield (line, (), time,
               _angle(path, line, 'latitude', sentence.lat, sentence.lat_dir, 'NS', 90.0),
               _angle(path, line, 'longitude', sentence.lon, sentence.lon_dir, 'EW', 180.0),
               separation + csv_table.number(path, line, 'altitude', sentence.altitude, -1000.0, 1e8))
    if without_separation:
        log.remarks.append('altitude without geoidal separation taken as height above the ellipsoid')


def _sentences(path, log):
    """Yield (line, sentence) of each GGA and RMC with a fix; count the others in a fixes.Log."""
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
            if sentence.status == 'A':
                yield line, sentence
        elif not sentence.gps_qual or not sentence.lat or not sentence.lon:
            log.passed_over['GGA without a fix'] += 1
        else:
            yield line, sentence


def _lines(path):
    with csv_table.stream(path) as stream:
        number = 0
        while line := stream.readline(MAX_LINE_CHARS):
            number += 1
            if len(line) == MAX_LINE_CHARS and not line.endswith(b'\n'):
                raise csv_table.TableError(f'{path}: line {number}: longer than {MAX_LINE_CHARS} characters')
            yield number, line.decode('ascii', 'replace').strip()


class _Clock:
    """Time of consecutive sentences, which hold only the time of day. The midnight between two sentences is the one
    that makes them less than half a day apart.

        first   day since 1970 of the first sentence, None if it is unknown
        days    midnights since the first sentence
        leaps   leap seconds (235960) since the first sentence, for a log without a date
    """

    def __init__(self, first=None):
        self.first, self.days, self.leaps, self._last = first, 0, 0, None

    def read(self, second, day=None):
        """Return the instant of a sentence (see track.instant), without a date the time since midnight [s].

        second: of the day; day: since 1970, if the sentence has a date. A date moves the time only forward. Raises
        ValueError for a leap second on a day that has none.
        """
        if self._last is not None:
            passed = round((self._last - second) / SECONDS_PER_DAY)
            self.leaps += passed > 0 and self._last >= SECONDS_PER_DAY
            self.days += passed
        self._last = second
        if self.first is None:
            return SECONDS_PER_DAY * self.days + second + self.leaps
        if day is not None:
            self.days = max(self.days, day - self.first)
        return instant.of_day(self.first + self.days, second)


def _begin(path):
    """Return the day since 1970 of the first sentence with a fix, None if no RMC has a date.

    The date of an RMC belongs to the time of the same RMC, which may lie on the other side of midnight.
    """
    clock = _Clock()
    for _, sentence in _sentences(path, fixes.Log()):
        with contextlib.suppress(ValueError):
            clock.read(_second_of_day(sentence))
            if sentence.sentence_type == 'RMC' and _day(sentence) is not None:
                return _day(sentence) - clock.days
    return None


def _day(sentence):
    """Return the day since 1970 of an RMC, None without a valid date."""
    date = sentence.datestamp
    return (date - datetime.date(1970, 1, 1)).days if isinstance(date, datetime.date) else None


def _second_of_day(sentence):
    """Return the seconds since midnight of a sentence. Raises ValueError."""
    match = TIME_PATTERN.fullmatch(sentence.data[0])
    if not match:
        raise ValueError(sentence.data[0])
    return instant.second_of_day(int(match[1]), int(match[2]), float(match[3]))


def _angle(path, line, name, text, side, sides, limit):
    """Return the degrees of a ddmm.mm and its side, positive on the first of the sides; raises TableError."""
    value = csv_table.number(path, line, name, text, 0.0, 100.0 * limit)
    degrees, minutes = divmod(value, 100.0)
    if minutes >= 60.0 or side not in tuple(sides):
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60} {side!r:.60}: must be degrees and '
                                   f'minutes below 60, {sides[0]} or {sides[1]}')
    return csv_table.number(path, line, name, (degrees + minutes / 60.0) * (1 if side == sides[0] else -1), -limit,
                            limit)
