"""Reader of an Orbit Mean-Elements Message (OMM, CCSDS 502.0-B): it checks the elements of a satellite for SGP4.
Unlike a TLE, an OMM does not limit the number of digits."""
import datetime
import json
import math
from collections.abc import Mapping

from sgp4 import omm
from sgp4.alpha5 import from_alpha5
from sgp4.api import Satrec

from pedestal_common.text_files import units

NUMBER_LIMITS = {'MEAN_MOTION': (0.05, 18.0), 'ECCENTRICITY': (0.0, 0.9999999), 'INCLINATION': (0.0, 180.0),
                 'RA_OF_ASC_NODE': (-360.0, 360.0), 'ARG_OF_PERICENTER': (-360.0, 360.0),
                 'MEAN_ANOMALY': (-360.0, 360.0), 'BSTAR': (-1e3, 1e3),
                 'MEAN_MOTION_DOT': (-1e3, 1e3), 'MEAN_MOTION_DDOT': (-1e3, 1e3)}
"""{keyword: (lowest, highest)}. MEAN_MOTION_DOT is half of the derivative of MEAN_MOTION, MEAN_MOTION_DDOT a sixth of
its second derivative."""
ANGLE_KEYWORDS = ('RA_OF_ASC_NODE', 'ARG_OF_PERICENTER', 'MEAN_ANOMALY')
STANDARD_UNITS = {'MEAN_MOTION': 'rev/day', 'ECCENTRICITY': '', 'INCLINATION': 'deg',
                  **dict.fromkeys(ANGLE_KEYWORDS, 'deg'), 'BSTAR': '1/ER', 'MEAN_MOTION_DOT': 'rev/day**2',
                  'MEAN_MOTION_DDOT': 'rev/day**3', 'BTERM': 'm**2/kg', 'AGOM': 'm**2/kg'}
"""{keyword of a number: its only unit}, table 4-3 of CCSDS 502.0-B-3; ER: earth radii."""
MAX_CATALOGUE_NUMBER = 999_999_999  # largest catalogue number
DEFAULT_FIELDS = {'MEAN_MOTION_DOT': '0', 'MEAN_MOTION_DDOT': '0'}  # {keyword that an OMM may omit: default value}
ALLOWED_VALUES = {'CENTER_NAME': ('EARTH',), 'REF_FRAME': ('TEME',), 'TIME_SYSTEM': ('UTC',),
                  'MEAN_ELEMENT_THEORY': ('SGP4', 'SGP/SGP4')}
"""{keyword: allowed values}; the first one is the default."""
BSTAR_OPTIONAL_THEORIES = ALLOWED_VALUES['MEAN_ELEMENT_THEORY']
"""Theories that an OMM must name in order to omit BSTAR, which is then 0."""
SGP4_TYPES = ('', '0', '2')  # ephemeris types that mean elements of SGP4; '': no type is given
OTHER_TYPES = {'1': 'SGP', '3': 'PPT3', '4': 'SGP4-XP', '6': 'numerical propagation'}
"""{ephemeris type: theory of its elements}."""
OTHER_KEYWORDS = ('BTERM', 'AGOM')  # keywords that only elements of SGP4-XP have
KEYWORDS = ('OBJECT_NAME', 'OBJECT_ID', 'EPOCH', 'EPHEMERIS_TYPE', 'NORAD_CAT_ID', *ALLOWED_VALUES, *NUMBER_LIMITS,
            *OTHER_KEYWORDS)
"""Keywords that are read."""


def require_sgp4(ephemeris_type: object) -> None:
    """Raise ValueError if an ephemeris type means another theory than SGP4. '': the elements state no type."""
    kind = str(ephemeris_type).strip()
    if kind not in SGP4_TYPES:
        theory = f'; type {kind} needs {OTHER_TYPES[kind]}' if kind in OTHER_TYPES else ''
        raise ValueError(f'ephemeris type {kind!s:.20}: must be 0 or 2 (SGP4){theory}')


def catalogue_number(text: str) -> str:
    """Return a catalogue number as digits, '' for an empty text. The first of five characters may be a letter
    (Alpha-5). Raises ValueError."""
    text = text.strip()
    try:
        number = from_alpha5(text) if len(text) == 5 else int(text or 0)
        if not 0 <= number <= MAX_CATALOGUE_NUMBER:
            raise ValueError(text)
    except (ValueError, IndexError):
        raise ValueError(f'NORAD_CAT_ID = {text!r:.60}: must be 0 to {MAX_CATALOGUE_NUMBER}') from None
    return str(number) if text else ''


def checked(fields: Mapping[str, object]) -> dict[str, str]:
    """Return {keyword: text} of valid elements, with every number that SGP4 needs, from the fields of an OMM. Raises
    ValueError, which names keyword, value and range. A number may have its unit behind it; an empty text counts as
    missing."""
    texts = {key: units.bare(key, str(value), STANDARD_UNITS[key]) if key in STANDARD_UNITS else str(value).strip()
             for key, value in fields.items() if key in KEYWORDS}
    given = {**DEFAULT_FIELDS, **{key: text for key, text in texts.items() if text}}
    for keyword, allowed in ALLOWED_VALUES.items():
        if given.get(keyword, allowed[0]).upper() not in allowed:
            raise ValueError(f'{keyword} = {given[keyword]!r:.60}: must be {" or ".join(allowed)}')
    require_sgp4(given.get('EPHEMERIS_TYPE', ''))
    for keyword in OTHER_KEYWORDS:
        if float(given.get(keyword) or 0.0):
            raise ValueError(f'{keyword} = {given[keyword]!r:.60}: must be absent, because it needs SGP4-XP')
    without_drag = not given.get('BSTAR')
    if without_drag:
        given['BSTAR'] = '0'
    for keyword, (low, high) in NUMBER_LIMITS.items():
        if keyword not in given:
            raise ValueError(f'{keyword} is missing')
        try:
            value = float(given[keyword].replace('_', ' '))  # float() alone would accept _ between digits
        except ValueError:
            raise ValueError(f'{keyword} = {given[keyword]!r:.60}: must be a number') from None
        if not low <= value <= high:
            raise ValueError(f'{keyword} = {value:g}: must be {low:g} to {high:g}')
    if without_drag and given.get('MEAN_ELEMENT_THEORY', '').upper() not in BSTAR_OPTIONAL_THEORIES:
        raise ValueError('BSTAR is missing: only an OMM with MEAN_ELEMENT_THEORY = SGP4 may omit it')
    return {**given, 'NORAD_CAT_ID': catalogue_number(given.get('NORAD_CAT_ID', ''))}


def initialize(satrec: Satrec, text: str) -> str:
    """Fill a Satrec with an OMM in JSON. Return the catalogue number, else the name. Raises ValueError."""
    try:
        fields = json.loads(text, parse_int=str, parse_float=str)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f'not valid JSON: {error}') from None
    if not isinstance(fields, dict):
        raise ValueError('must be an object {"EPOCH": ...}')
    fields = checked(fields)
    try:
        epoch = datetime.datetime.fromisoformat(fields.get('EPOCH', '').removesuffix('Z'))
    except ValueError:
        raise ValueError(f'EPOCH = {fields.get("EPOCH", "")!r:.60}: must be UTC as ISO 8601, for example '
                         '2026-11-22T05:00:00.123456') from None
    if epoch.tzinfo is not None:
        epoch = epoch.astimezone(datetime.timezone.utc).replace(tzinfo=None)
    angles = {keyword: str(math.fmod(float(fields[keyword]), 360.0) % 360.0) for keyword in ANGLE_KEYWORDS}
    omm.initialize(satrec, {**fields, **angles, 'EPOCH': epoch.isoformat(timespec='microseconds'), 'NORAD_CAT_ID': '0',
                            'CLASSIFICATION_TYPE': 'U', 'OBJECT_ID': '    ', 'EPHEMERIS_TYPE': '0',
                            'ELEMENT_SET_NO': '0', 'REV_AT_EPOCH': '0'})
    return fields['NORAD_CAT_ID'] or fields.get('OBJECT_ID') or fields.get('OBJECT_NAME') or 'without a name'
