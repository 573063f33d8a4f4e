"""Reader of logs of NMEA 0183: fixes from the sentences GGA (time of day, position, height), the date from RMC.

The height above the ellipsoid is altitude + geoidal separation. Text before the $ of a line and behind the checksum is
passed over, such as the time of a logger. Cut sentences, sentences with a wrong checksum, and GGA without fix, time or
altitude (2D) are passed over and counted. Each talker, the first two letters of a sentence, counts as a receiver.
Talkers that take turns are one receiver, whose constellations change.
"""
import contextlib
import datetime
import io
import math
import re
from collections import Counter
from collections.abc import Iterator

import pynmea2

from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Degrees, Seconds
from pedestal_common.text_files import csv_table, files
from tracking_receiver_sim.tracks import fixes, instant, lines

SENTENCE_PATTERN = re.compile(r'\$[A-Z]{2}([A-Z]{3}),[^$*]*(\*[0-9A-Fa-f]{2})?', re.ASCII)
CUT_SENTENCE_PATTERN = re.compile(r'[^$!]*,[^$!]*\*[0-9A-Fa-f]{2}', re.ASCII)
TIME_PATTERN = re.compile(r'(\d\d)(\d\d)(\d\d(?:\.\d*)?)', re.ASCII)
MIN_GGA_FIELDS = 11  # least number of fields of a GGA: up to the geoidal separation
MAX_LISTED_TYPES = 8  # number of types of sentences that an error lists
QUALITIES = {6: 'estimated', 7: 'manual input', 8: 'simulated'}  # {quality of a GGA that is no measured fix: name}
MIN_FIX_SHARE = 0.9  # least share of the fixes of the most frequent talker that a better talker has
COMBINED_TALKER = 'GN'  # talker of a solution from several constellations
FIRST_RECENT_DATE = datetime.date(2017, 1, 1)  # a log from before is named, because its receiver may err
ROLLOVER = datetime.timedelta(weeks=1024)  # time by which a receiver sets the date back if its week counter overflows
MAX_LINE_CHARS = 1024  # largest number of characters of a line; the standard allows 82


def rows(path: str, log: fixes.Log) -> Iterator[fixes.Fix]:
    """Yield the fixes of a log. Raises TableError. The time is an instant if an RMC has a date, otherwise it counts
    from midnight. The names of the aircraft are the talkers."""
    first_day = _first_day(path)
    log.form, log.time_name, log.dated = 'NMEA', 'time', first_day is not None
    clock, without_separation, talkers, qualities = _Clock(first_day), False, _Talkers(), Counter[tuple[int, str]]()
    for line, sentence in _sentences(path, log):
        if sentence.sentence_type == 'RMC':
            with contextlib.suppress(ValueError):
                clock.advance(_second_of_day(sentence), _day(sentence))
            continue
        try:
            time = clock.advance(_second_of_day(sentence))
        except ValueError:
            raise csv_table.TableError(f'{path}: line {line}: time = {sentence.data[0]!r:.60}: must be hhmmss.ss, '
                                       '235960 only for a leap second') from None
        for name, unit in (('altitude', sentence.data[9]), ('geoidal separation', ''.join(sentence.data[11:12]))):
            if unit.strip().upper() not in ('M', ''):
                raise csv_table.TableError(f'{path}: line {line}: unit of {name} = {unit!r:.20}: must be M')
        talkers.take(sentence)
        qualities[sentence.gps_qual, sentence.talker] += 1
        without_separation = without_separation or not sentence.geo_sep
        separation = csv_table.number(path, line, 'geoidal separation', sentence.geo_sep or '0', -150.0, 150.0)
        yield fixes.Fix(line, (sentence.talker,), time,
                        _angle(path, line, 'latitude', sentence.lat, sentence.lat_dir, 'NS', 90.0),
                        _angle(path, line, 'longitude', sentence.lon, sentence.lon_dir, 'EW', 180.0),
                        separation + csv_table.number(path, line, 'altitude', sentence.altitude, -1000.0, 1e8))
    if without_separation:
        log.remarks.append('altitude without geoidal separation taken as height above the ellipsoid')
    log.receivers = talkers.described()
    log.remarks += [f'{count} fixes of quality {quality} ({QUALITIES[quality]})'
                    + f' of {talker}' * (len(log.receivers) > 1)
                    for (quality, talker), count in sorted(qualities.items()) if quality in QUALITIES]
    first = None if first_day is None else datetime.date(1970, 1, 1) + datetime.timedelta(days=first_day)
    if first and first < FIRST_RECENT_DATE:
        log.remarks.append(f'dated {first}: if the week counter of its receiver has overflowed (1,024 weeks), the log '
                           f'is of {first + ROLLOVER}')


class _Talkers:
    """Numbers of fixes and horizontal dilutions of precision of the talkers."""

    def __init__(self) -> None:
        self._fixes: Counter[str] = Counter()
        self._dilutions: dict[str, float] = {}      # sum of each talker

    def take(self, gga: pynmea2.NMEASentence) -> None:
        """Count a GGA with a fix."""
        self._fixes[gga.talker] += 1
        text = gga.horizontal_dil
        # A talker without dilutions of precision is the last of its kind.
        dilution = float(text) if lines.NUMBER_PATTERN.fullmatch(text) else math.inf
        self._dilutions[gga.talker] = self._dilutions.get(gga.talker, 0.0) + dilution

    def described(self) -> dict[str, str]:
        """Return {talker: text about its fixes}, the best first: nearly as many fixes as the most frequent one, the
        smallest dilution, the combined solution."""
        most = max(self._fixes.values(), default=0)

        def rank(name: str) -> tuple[bool, float, bool, str]:
            few = self._fixes[name] < MIN_FIX_SHARE * most
            return few, self._dilutions[name] / self._fixes[name], name != COMBINED_TALKER, name

        return {name: f'{self._fixes[name]} fixes, ' + (f'mean HDOP {self._dilutions[name] / self._fixes[name]:.2g}'
                                                        if math.isfinite(self._dilutions[name]) else 'HDOP not known')
                for name in sorted(self._fixes, key=rank)}


def is_log(beginning: str) -> bool:
    """Return True if a text is the beginning of a log: a sentence first, or GGA and the like after other text."""
    return beginning.startswith(('$', '!')) or bool(SENTENCE_PATTERN.search(beginning))


def _sentences(path: str, log: fixes.Log) -> Iterator[tuple[int, pynmea2.NMEASentence]]:
    types: Counter[str] = Counter()
    with_checksum = False
    for line, text in _lines(path):
        if CUT_SENTENCE_PATTERN.fullmatch(text) and not text.startswith('#'):
            log.passed_over['damaged sentence'] += 1
        for match in SENTENCE_PATTERN.finditer(text):
            types[match[1]] += 1
            if match[1] not in ('GGA', 'RMC'):
                continue
            with_checksum = with_checksum or bool(match[2])
            try:
                sentence = pynmea2.parse(match[0])
            except pynmea2.ParseError:
                sentence = None
            if sentence is None or with_checksum and not match[2] or (
                    match[1] == 'GGA' and len(sentence.data) < MIN_GGA_FIELDS):
                log.passed_over['damaged sentence'] += 1
            elif match[1] == 'RMC':
                if sentence.status == 'A':
                    yield line, sentence
            elif missing := _missing(sentence):
                log.passed_over[f'GGA without {missing}'] += 1
            else:
                yield line, sentence
    if not types['GGA']:
        listed = ', '.join(f'{count} {name}' for name, count in sorted(types.items())[:MAX_LISTED_TYPES])
        log.nothing = f'no GGA in it{f" ({listed})" if listed else ""}'


def _missing(gga: pynmea2.NMEASentence) -> str:
    parts = {'a fix': gga.gps_qual and gga.lat and gga.lon, 'time': gga.data[0], 'altitude': gga.altitude is not None}
    return next((name for name, value in parts.items() if not value), '')


def _lines(path: str) -> Iterator[tuple[int, str]]:
    """Noise between the sentences becomes replacement characters."""
    with csv_table.stream(path) as stream:
        encoding = files.marked_encoding(stream.read(files.MAX_MARK_BYTES)) or 'ascii'
        stream.seek(0)
        number, lines = 0, io.TextIOWrapper(stream, encoding, errors='replace', newline='')
        while line := lines.readline(MAX_LINE_CHARS):
            number += 1
            if len(line) == MAX_LINE_CHARS and not line.endswith(('\n', '\r')):
                raise csv_table.TableError(f'{path}: line {number}: longer than {MAX_LINE_CHARS} characters')
            yield number, line.strip()


class _Clock:
    """Time of consecutive sentences, which hold only the time of day. A jump by more than half a day is midnight."""
    first: int | None       # day since 1970 of the first sentence, None if it is unknown
    days: int               # midnights since the first sentence
    leaps: int              # leap seconds (235960) since the first sentence, for a log without a date
    _last: Seconds | None   # second of the day of the last sentence

    def __init__(self, first: int | None = None) -> None:
        self.first, self.days, self.leaps, self._last = first, 0, 0, None

    def advance(self, second: Seconds, day: int | None = None) -> Seconds:
        """Move on to a sentence. Return its instant, without a date the time since midnight. second: seconds since
        midnight; day: number of days since 1970 if the sentence has a date, which moves the time only forward. Raises
        ValueError for a leap second on a day that has none."""
        if self._last is not None:
            midnights = round((self._last - second) / SECONDS_PER_DAY)
            # A last second of 86400 or more was a leap second.
            self.leaps += midnights > 0 and self._last >= SECONDS_PER_DAY
            self.days += midnights
        self._last = second
        if self.first is None:
            return SECONDS_PER_DAY * self.days + second + self.leaps
        if day is not None:
            self.days = max(self.days, day - self.first)
        return instant.of_day(self.first + self.days, second)


def _first_day(path: str) -> int | None:
    """Return the day since 1970 of the first sentence with a fix, None if no RMC has a date. The date of an RMC
    belongs to the time of the same RMC, which may lie on the other side of midnight."""
    clock = _Clock()
    for _, sentence in _sentences(path, fixes.Log()):
        with contextlib.suppress(ValueError):
            clock.advance(_second_of_day(sentence))
            if sentence.sentence_type == 'RMC' and (day := _day(sentence)) is not None:
                return day - clock.days
    return None


def _day(sentence: pynmea2.NMEASentence) -> int | None:
    date = sentence.datestamp
    return (date - datetime.date(1970, 1, 1)).days if isinstance(date, datetime.date) else None


def _second_of_day(sentence: pynmea2.NMEASentence) -> Seconds:
    match = TIME_PATTERN.fullmatch(sentence.data[0])
    if not match:
        raise ValueError(sentence.data[0])
    return instant.second_of_day(int(match[1]), int(match[2]), float(match[3]))


def _angle(path: str, line: int, name: str, text: str, side: str, sides: str, limit: Degrees) -> Degrees:
    """Return the angle of a text ddmm.mm (degrees and minutes); sides: letters of + and -, such as NS."""
    value = csv_table.number(path, line, name, text, 0.0, 100.0 * limit)
    degrees, minutes = divmod(value, 100.0)
    if minutes >= 60.0 or side not in tuple(sides):
        raise csv_table.TableError(f'{path}: line {line}: {name} = {text!r:.60} {side!r:.60}: must be degrees and '
                                   f'minutes below 60, {sides[0]} or {sides[1]}')
    return csv_table.number(path, line, name, (degrees + minutes / 60.0) * (1 if side == sides[0] else -1), -limit,
                            limit)
