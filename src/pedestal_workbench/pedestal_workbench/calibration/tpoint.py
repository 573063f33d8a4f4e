"""Files of TPOINT for an altazimuth mount: observations of four numbers, sky and mount, in degrees (its format 4).

    ! a comment
    Caption of the file
    : ALTAZ
    +31 41 19.6 2021 8 21 13.0 741 2608 0.75     latitude, possibly date, temperature, pressure, height, humidity
    192.3860283 77.34684 -167.27889 77.34754     azimuth and elevation on the sky, then those of the mount
    END

Further numbers of an observation are ignored. The azimuth counts from north through east, or by a comment such as
`South = 0` from south. Because both origins fit equally well, the origin is always stated with the result.
"""
import datetime
import math
import pathlib
import re
from typing import NamedTuple

from pedestal_common.quantities import Degrees
from pedestal_common.text_files import csv_table
from pedestal_common.text_files.csv_table import TableError

AXIS_RANGE_DEG = (-540.0, 720.0)  # accepted azimuths [deg]
MOUNT_ELEVATION_RANGE_DEG = (-10.0, 95.0)  # accepted elevations of the mount [deg]; those on the sky are at most 90
MAX_DIFFERENCE_DEG = 5.0  # largest accepted offset on the sky [deg]

_ALTAZ_OPTIONS = ('ALTAZ', 'AZALT')
_MIN_DATE_NUMBERS = 6
_ORIGIN_PATTERN = re.compile(r'\b(?:(north|south)\s*=\s*0(?:\.0+)?\s*(?:deg\w*)?(?=\s*(?:[,;)]|\.?$))'
                             r'|az\w*\b.*\bfrom\s+(?:the\s+)?(north|south)\b'
                             r'|([ns])\s*=\s*0\s*,\s*(?:e|east|w|west)\s*=\s*(?:90|270)\b)', re.IGNORECASE)
"""Comments that state where the azimuth begins; a letter alone counts only with a second direction, as N=0, E=90."""
_LATITUDE_PATTERN = re.compile(r'[-+]?\d{1,2}$')
_NUMBERS_PATTERN = re.compile(r'[-+]?\.?\d')


class OffsetRow(NamedTuple):
    """Offset in a file, of any format. A standard deviation is NaN if the file states none."""
    line: int
    azimuth: Degrees
    elevation: Degrees
    across: Degrees         # offset in cross-elevation
    up: Degrees             # offset in elevation
    across_sigma: Degrees
    up_sigma: Degrees


def is_tpoint(text: str) -> bool:
    """Return True for a text of TPOINT, in which a line begins with : (an option) or with ! (a comment)."""
    return any(line.lstrip().startswith((':', '!')) or line.strip().upper() in _ALTAZ_OPTIONS
               for line in text.splitlines())


def _records(text: str) -> tuple[list[tuple[int, list[str]]], list[str]]:
    """Return ([(line, words) of the lines of numbers], options) of a text, up to the line END."""
    numbers: list[tuple[int, list[str]]] = []
    options: list[str] = []
    for line, content in enumerate(text.splitlines(), start=1):
        content = content.partition('!')[0].strip()
        if content.upper() == 'END':
            break
        if content.startswith(':') or content.upper() in _ALTAZ_OPTIONS:
            options += content.lstrip(':').upper().split()
        elif _NUMBERS_PATTERN.match(content) or (numbers and content):
            # The caption stands before the options, and may begin with a digit.
            if options:
                numbers.append((line, content.split()))
    return numbers, options


def date(text: str) -> str:
    """Return the date in the run parameters, as in 2021-08-21, '' without one."""
    numbers, _ = _records(text)
    words = numbers[0][1] if numbers else []
    try:
        return datetime.date(*map(int, words[3:6])).isoformat() if len(words) >= _MIN_DATE_NUMBERS else ''
    except ValueError:
        return ''


def origin(path: str | pathlib.Path, text: str) -> tuple[str, int]:
    """Return (`north` or `south`, line of the comment that states it, 0 without one). Raises TableError."""
    stated: dict[str, int] = {}
    for line, content in enumerate(text.splitlines(), start=1):
        match = _ORIGIN_PATTERN.search(content.partition('!')[2])
        if match:
            letter = next(filter(None, match.groups()))[0].lower()
            stated.setdefault({'n': 'north', 's': 'south'}[letter], line)
    if len(stated) == 2:
        raise TableError(f'{path}: the azimuth counts from north by line {stated["north"]} and from south by line '
                         f'{stated["south"]}; only one of them may be stated')
    return next(iter(stated.items()), ('north', 0))


def rows(path: str | pathlib.Path, text: str) -> list[OffsetRow]:
    """Return the offsets of the file, in the turn of the wrap in which the mount was. Raises TableError."""
    numbers, options = _records(text)
    if not set(options) & set(_ALTAZ_OPTIONS):
        others = f'; options found: {", ".join(options)}' if options else ''
        raise TableError(f'{path}: a TPOINT file must have the option `: ALTAZ`, for observations of azimuth and '
                         f'elevation{others}')
    from_south = origin(path, text)[0] == 'south'
    if numbers and not all(map(_LATITUDE_PATTERN.match, numbers[0][1][:2])):
        line, words = numbers[0]
        raise TableError(f'{path}: line {line}: begins with {" ".join(words[:3]):.40}: the first line of numbers must '
                         'be the run parameters, with the latitude in degrees, minutes and seconds')
    found: list[OffsetRow] = []
    for line, words in numbers[1:]:
        if len(words) < 4:
            raise TableError(f'{path}: line {line}: {len(words)} numbers, must be at least 4: azimuth and elevation '
                             'on the sky, azimuth and elevation of the mount')
        no_numbers = [word for word in words[4:] if not _NUMBERS_PATTERN.match(word)]
        if no_numbers:
            raise TableError(f'{path}: line {line}: {no_numbers[0]!r:.40}: must be a number; all angles are in deg, '
                             'and a unit is not allowed here')
        named = zip(('azimuth', 'elevation', 'azimuth of the mount', 'elevation of the mount'), words,
                    (AXIS_RANGE_DEG, (-5.0, 90.0), AXIS_RANGE_DEG, MOUNT_ELEVATION_RANGE_DEG))
        az, el, mount_az, mount_el = (csv_table.number(path, line, name, word, *limits)
                                      for name, word, limits in named)
        step = math.remainder(mount_az - az, 360.0)
        az = mount_az - step
        if from_south:
            az, step = 180.0 - az, -step
        offset = (step * math.cos(math.radians(el)), mount_el - el)
        for name, value in zip(('cross-elevation', 'elevation'), offset):
            if abs(value) > MAX_DIFFERENCE_DEG:
                raise TableError(f'{path}: line {line}: {name} of the mount minus that on the sky = {value:g} deg: '
                                 f'must be {-MAX_DIFFERENCE_DEG:g} to {MAX_DIFFERENCE_DEG:g}')
        found.append(OffsetRow(line, az, el, *offset, math.nan, math.nan))
    return found
