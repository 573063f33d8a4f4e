"""Search for the columns of a table by their names, for csv_table and the readers of tracks.

The name of a column has a quantity and behind it a unit, as in time_s, `az [deg]`, `Azimuth (rad)`. A column is a
candidate for a quantity if its name consists of this quantity and a known unit; `az_rate` or `time_local` is none. Two
candidates are refused. Without a candidate, the error names a column that begins with the quantity.
"""
import re
import typing
from collections.abc import Iterable, Mapping, Sequence

from pedestal_common.text_files.units import UNIT_NAMES, UNIT_SIZES, UTC

_UTC_PATTERN = re.compile(r'(ut|utc|utcg|gmt|z|zulu|utciso8601|iso8601|iso)?(hrmn(ss|sc)?(fff)?)?')
"""Words behind the name of a time in UTC; HR:MN:SS.fff is of JPL Horizons, UTCG of STK."""
_APPARENT_NAMES = ('aapp', 'aappr', 'rapp')  # words that JPL Horizons writes behind an apparent angle in degrees
_BETWEEN_PATTERN = re.compile(r'[\s_\[\](){}<>|,:;.\-"\']+')
_CAMEL_CASE_PATTERN = re.compile(r'(?<=[a-z])(?=[A-Z])')
_DERIVED_WORDS = ('rate', 'vel', 'speed', 'acc', 'err', 'sigma', 'std', 'qual', 'valid')
"""If the word behind a quantity begins with one of these, the column holds something else, such as the rate or the
error of the quantity."""
_OTHER_HEIGHTS = {'msl': 'mean sea level', 'amsl': 'mean sea level', 'orthometric': 'the geoid', 'agl': 'the ground'}
"""{word behind an altitude: its zero}. The altitudes of this project are above the ellipsoid."""
MAX_LISTED_NAMES = 20  # number of names of columns that an error lists


class ColumnError(ValueError):
    """The columns of a table do not give a quantity. The message is one line that names the columns."""


class Quantity(typing.NamedTuple):
    """A quantity of a table."""
    label: str      # its name in errors
    # {name of the quantity in a file: unit that is assumed if the column states none}; '': the column must state it
    names: Mapping[str, str]
    unit: str       # unit in which the reader takes the values


class Column(typing.NamedTuple):
    """A column that was found."""
    name: str       # in the file
    unit: str       # of its values
    size: float     # factor from this unit to the unit of the Quantity

    def described(self) -> str:
        """Return the name with the unit."""
        return f'{self.name[:40]} in {self.unit}'


def quantity(name: str) -> Quantity:
    """Return the Quantity of a name with a unit, as in time_s; a column must name its unit."""
    word, _, unit = name.partition('_')
    return Quantity(name, {word: ''}, unit)


def find(names: Iterable[str], wanted: Quantity, required: bool = True) -> Column | None:
    """Return the Column of a Quantity among the names of a table; None if no name begins with the quantity.

    Raises ColumnError for two candidates, or if names begin with the quantity but none has a known unit. The name of
    the rate or the error of a quantity is ignored if the quantity is not required.
    """
    found, others = [], []
    for name in names:
        unit = unit_of(name, wanted)
        if unit:
            found.append(Column(name, unit, UNIT_SIZES[unit]))
        elif unit == '' and (required or not _rest(name, wanted).startswith(_DERIVED_WORDS)):
            others.append(name)
    if len(found) > 1:
        raise ColumnError(f'columns {found[0].name!r:.60} and {found[1].name!r:.60}: only one of them may be '
                          f'the {wanted.label}: rename or remove the other')
    if others and not found:
        rest = _rest(others[0], wanted) if wanted.unit == 'm' else ''
        if word := next(filter(rest.startswith, _OTHER_HEIGHTS), ''):
            raise ColumnError(f'column {others[0]!r:.60}: is above {_OTHER_HEIGHTS[word]}, must be above the '
                              'ellipsoid (WGS84): add the height of this zero above the ellipsoid, and name the '
                              f'column without {word}')
        units = [*UNIT_NAMES[wanted.unit], *([UTC] if wanted.unit == 's' else [])]
        raise ColumnError(f'column {others[0]!r:.60}: must end with a known unit to be taken as {wanted.label}: '
                          f'{", ".join(units[:-1])} or {units[-1]}')
    return found[0] if found else None


def is_time(unit: str) -> bool:
    """Return True for a unit of time, with or without a date."""
    return unit == UTC or unit in UNIT_NAMES['s']


def named(names: Iterable[str], wanted: Quantity) -> bool:
    """Return True if one of the names of a table begins with the quantity, whatever follows."""
    return any(unit_of(name, wanted) is not None for name in names)


def names_unit(name: str, wanted: Quantity) -> bool:
    """Return True if the name of a column of a Quantity states a unit."""
    return bool(_rest(name, wanted))


def listed(names: Sequence[str]) -> str:
    """Return the names of the columns of a table as a text for an error."""
    more = f' and {len(names) - MAX_LISTED_NAMES} more' if len(names) > MAX_LISTED_NAMES else ''
    return f'columns found: {", ".join(f"{name[:40]!r}" for name in names[:MAX_LISTED_NAMES]) or "none"}{more}'


def _known(name: str, wanted: Quantity) -> tuple[str, str] | None:
    """Return (name of the quantity, rest without blanks and brackets) of a column; None for another quantity."""
    for spaced in (name, _CAMEL_CASE_PATTERN.sub(' ', name)):
        text = ' '.join(spaced.lower().replace('_', ' ').replace('-', ' ').split())
        for known in sorted(wanted.names, key=len, reverse=True):
            if text.startswith(known) and not text[len(known):len(known) + 1].isalnum():
                return known, _BETWEEN_PATTERN.sub('', text[len(known):]).removeprefix('/')
    return None


def _rest(name: str, wanted: Quantity) -> str:
    match = _known(name, wanted)
    assert match
    return match[1]


def unit_of(name: str, wanted: Quantity) -> str | None:
    """Return the unit of a column; '' for words that are no known unit, None for another quantity."""
    match = _known(name, wanted)
    if not match:
        return None
    known, rest = match
    if not rest:
        return wanted.names[known]
    if wanted.unit == 's' and _UTC_PATTERN.fullmatch(rest):
        return UTC
    if wanted.unit == 'deg' and rest in _APPARENT_NAMES:
        return 'deg'
    return next((unit for unit, texts in UNIT_NAMES[wanted.unit].items() if rest in texts), '')
