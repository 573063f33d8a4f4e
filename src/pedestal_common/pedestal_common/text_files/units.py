"""Units in files, one table for all readers: their names and sizes, and the unit behind a number, as in `51.6 [deg]`.

A format with a fixed unit accepts this unit in any spelling and refuses all others by the name of the number.
"""
import math
import re

from pedestal_common.graph.steps import SECONDS_PER_DAY

METRES_PER_FOOT = 0.3048  # length of the international foot [m]

UTC, JULIAN_DATE, MODIFIED_JULIAN_DATE = 'UTC', 'JD', 'MJD'
"""Units of a time with a date: a calendar date (or seconds since 1970), a Julian date, a modified Julian date."""

UNIT_NAMES: dict[str, dict[str, tuple[str, ...]]] = {
    # {unit of the reader, in lower case: {unit: its names in a file}}
    's': {'s': ('s', 'sec', 'secs', 'second', 'seconds'),
          'ms': ('ms', 'msec', 'millis', 'millisecond', 'milliseconds'),
          'us': ('us', 'µs', 'μs', 'usec', 'micros', 'microsecond', 'microseconds'),
          'ns': ('ns', 'nsec', 'nanos', 'nanosecond', 'nanoseconds'),
          'min': ('min', 'mins', 'minute', 'minutes'), 'h': ('h', 'hr', 'hrs', 'hour', 'hours'),
          'd': ('d', 'day', 'days'), JULIAN_DATE: ('jd', 'jdut', 'jdutc', 'juliandate', 'juliandateutc'),
          MODIFIED_JULIAN_DATE: ('mjd', 'mjdut', 'mjdutc')},
    'deg': {'deg': ('deg', 'degs', 'degree', 'degrees', '°', 'º', 'true', 'degtrue'),
            'rad': ('rad', 'rads', 'radian', 'radians'), 'mrad': ('mrad', 'mrads', 'milliradians')},
    'm': {'m': ('m', 'meter', 'meters', 'metre', 'metres'), 'km': ('km', 'kilometer', 'kilometers', 'kilometre',
                                                                   'kilometres'),
          'cm': ('cm',), 'mm': ('mm',), 'ft': ('ft', 'foot', 'feet')},
    'db': {'db': ('db', 'decibel', 'decibels')},
    'hz': {'hz': ('hz',), 'rad/s': ('rad/s', 'radpers')},
    'm2_per_hz': {'m2/Hz': ('m2/hz', 'm^2/hz', 'm2perhz', 'm²/hz', 'm**2/hz'),
                  'm2 s/rad': ('m2s/rad', 'm^2s/rad', 'm²s/rad', 'm2/rad/s', 'm^2/rad/s', 'm²/rad/s')}}
UNIT_SIZES = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0, 'h': 3600.0, 'd': SECONDS_PER_DAY,
              'deg': 1.0, 'rad': math.degrees(1.0), 'mrad': math.degrees(1e-3),
              'm': 1.0, 'km': 1000.0, 'cm': 0.01, 'mm': 1e-3, 'ft': METRES_PER_FOOT,
              'db': 1.0, 'hz': 1.0, 'rad/s': 0.5 / math.pi, 'm2/Hz': 1.0, 'm2 s/rad': 2.0 * math.pi,
              UTC: 1.0, JULIAN_DATE: SECONDS_PER_DAY, MODIFIED_JULIAN_DATE: SECONDS_PER_DAY}
"""Size of each unit, in the first unit of its row in UNIT_NAMES: s, deg, m, dB, Hz or m2/Hz."""

_BRACKETED_PATTERN = re.compile(r'([^\[]*)\[([^\[\]]*)\]')  # a number, then its unit in brackets
_NO_UNIT = ('', 'n/a', '-', '1')  # texts of the unit of a number without one
_POWERS = str.maketrans({'²': '2', '³': '3', '^': '', '*': '', ' ': ''})  # m**2, m^2 and m² become m2


class UnitError(ValueError):
    """The unit of a number is not that of its format. The message is one line that names number and unit."""


def bare(name: str, text: str, unit: str) -> str:
    """Return the number in a text such as `51.6 [deg]` or `51.6`, without its unit. Raises UnitError. name: name of
    the number; unit: the only one that its format has."""
    match = _BRACKETED_PATTERN.fullmatch(text)
    if not match:
        return text.strip()
    require(name, match[2], unit)
    return match[1].strip()


def require(name: str, written: str, unit: str) -> None:
    """Raise UnitError if a written unit, in any spelling, is not the unit of a number."""
    spelled, standard = (text.lower().translate(_POWERS) for text in (written, unit))
    others = UNIT_NAMES.get(unit.lower(), {}).get(unit.lower(), ())
    if spelled != standard and spelled not in others and (unit or spelled not in _NO_UNIT):
        raise UnitError(f'{name}: unit [{written.strip()}]: must be {f"[{unit}]" if unit else "absent"}')
