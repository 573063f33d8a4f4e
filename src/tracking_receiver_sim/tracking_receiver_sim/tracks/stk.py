"""Reader of STK ephemeris files (.e) for orbits about the earth. The case of keywords does not matter, as in STK.

If two consecutive states have the same time, the first one ends a segment and the second one begins the next segment.
Blocks inside the ephemeris and the covariance after the states are passed over.
"""
import array
import datetime
import re
from collections.abc import Mapping
from typing import TypeAlias, TypeVar

import numpy as np

from pedestal_common.quantities import Floats, Meters, Seconds
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.tracks import instant, lines, states

FILE_SIGNATURE_PATTERN = re.compile(r'stk\.v\.\d+', re.IGNORECASE)
FRAME_NAMES = {'fixed': 'ITRF', 'j2000': 'EME2000', 'icrf': 'ICRF', 'temeofdate': 'TEME', 'trueofdate': 'TOD'}
METRES_PER_UNIT = {'meters': 1.0, 'kilometers': 1000.0}  # {DistanceUnit: its length [m]}
METHOD_NAMES = {'lagrange': 'LAGRANGE', 'hermite': 'HERMITE'}  # LagrangeVOP, relative to a Kepler orbit, is refused
STATE_KEYWORDS = {'ephemeristimepos': False, 'ephemeristimeposvel': True, 'ephemeristimeposvelacc': True}
"""True if the states have velocities."""
GEODETIC_MARK = 'lla'  # part of the keyword before states in latitude, longitude and height
READ_KEYWORDS = ('numberofephemerispoints', 'scenarioepoch', 'interpolationmethod', 'interpolationsamplesm1',
                 'interpolationorder', 'centralbody', 'coordinatesystem', 'distanceunit')
IGNORED_KEYWORDS = ('blockingfactor', 'coordinatesystemepoch', 'messagelevel', 'timeformat')
"""Keywords of the header, in lower case: those that the reader uses, and those without effect."""
MAX_SEGMENTS = 1000  # largest number of segments of a file
EPOCH_PATTERN = re.compile(r'(\d{1,2}) ([a-z]{3})[a-z]* (\d{4}) (\d{1,2}):(\d\d):(\d\d(?:\.\d*)?)', re.ASCII)

_R = TypeVar('_R')
_Head: TypeAlias = dict[str, tuple[int, int, str]]  # {keyword: (line, column, value)}


def read(path: str, _wanted: str = '') -> states.Ephemeris:
    """Return the Ephemeris of an STK ephemeris file. Raises TableError."""
    # limits: of the numbers of a state, None before the states begin; skipped: name of the block that is passed over.
    head: _Head = {}
    limits: lines.Limits | None = None
    rows, skipped = array.array('d'), ''
    for line, text in lines.read(path):
        text = text.split('#', 1)[0].rstrip()
        words = text.lower().split(None, 2)
        if not words or line == 1:
            continue
        if skipped:
            skipped = '' if ' '.join(words) == f'end {skipped}' else skipped
        elif words[0] == 'begin' and words[1:] != ['ephemeris']:
            skipped = ' '.join(words[1:])
        elif words[0] == 'end' or limits and words[0].startswith('covariance'):
            break
        elif limits:
            rows.extend((line, *lines.numbers(path, line, text, limits)))
        elif words[0] in STATE_KEYWORDS:
            unit, limits = _limits(path, head, STATE_KEYWORDS[words[0]])
        elif words[0] in READ_KEYWORDS or words[0] in IGNORED_KEYWORDS:
            value = text.lstrip()[len(words[0]):].lstrip()
            head[words[0]] = line, len(text) - len(value) + 1, value.strip('"')
        elif words[0] != 'begin':
            column = len(text) - len(text.lstrip()) + 1
            geodetic = ('states in latitude, longitude and height are not supported: ' if GEODETIC_MARK in words[0]
                        else '')
            raise lines.wrong(path, line, column,
                              f'{words[0]!r:.40}: {geodetic}must be one of {", ".join(STATE_KEYWORDS)}, '
                              'or a keyword of the header')
    if not limits:
        raise csv_table.TableError(f'{path}: the keyword of the states is missing, must be one of '
                                   f'{", ".join(STATE_KEYWORDS)}')
    table = np.array(rows).reshape(-1, 1 + len(limits))
    table[:, 2:] *= unit
    return _ephemeris(path, head, table)


def _limits(path: str, head: _Head, with_velocity: bool) -> tuple[Meters, dict[str, tuple[float, float]]]:
    unit = _choice(path, head, 'distanceunit', METRES_PER_UNIT, 'meters')
    limits = {'time': (-1e9, 1e9), **dict.fromkeys('xyz', (-2e9 / unit, 2e9 / unit))}
    if with_velocity:
        limits.update(dict.fromkeys(('vx', 'vy', 'vz'), (-1e5 / unit, 1e5 / unit)))
    return unit, limits


def _ephemeris(path: str, head: _Head, table: Floats) -> states.Ephemeris:
    if 'scenarioepoch' not in head:
        raise csv_table.TableError(f'{path}: ScenarioEpoch is missing')
    begin, second = _epoch(path, *head['scenarioepoch'])
    _choice(path, head, 'centralbody', {'earth': ''}, 'earth')
    frame = _choice(path, head, 'coordinatesystem', FRAME_NAMES, 'fixed')
    method = _choice(path, head, 'interpolationmethod', METHOD_NAMES, 'lagrange')
    if method == 'HERMITE' and not states.has_velocities(table):
        line, column, _ = head['interpolationmethod']
        raise lines.wrong(path, line, column, 'InterpolationMethod = Hermite: must be Lagrange, because the '
                          'states have no velocity')
    degree = _degree(path, head, method)
    table[:, 1] += second
    ends = np.flatnonzero(np.diff(table[:, 1]) == 0.0) + 1
    if len(ends) >= MAX_SEGMENTS:
        raise csv_table.TableError(f'{path}: line {table[ends[MAX_SEGMENTS - 1], 0]:.0f}: must be at most '
                                   f'{MAX_SEGMENTS} segments')
    segments = tuple(states.segment(path, int(part[0, 0]) if len(part) else 0, part, frame, method, degree)
                     for part in np.split(table, ends))
    return states.Ephemeris(path, begin, segments, f'STK ephemeris: {len(table)} states in {frame}, '
                            f'{segments[0].method} of degree {segments[0].degree}')


def _epoch(path: str, line: int, column: int, text: str) -> tuple[Seconds, Seconds]:
    """Return (instant of midnight, seconds of the day) of a UTC such as 1 Jun 2026 12:00:00.0."""
    match = EPOCH_PATTERN.fullmatch(' '.join(text.lower().split()))
    try:
        day, month, year, hours, minutes, seconds = match.groups() if match else [''] * 6
        date = datetime.date(int(year), instant.MONTH_NAMES.index(month) + 1, int(day))
        if not lines.YEAR_LIMITS[0] <= date.year <= lines.YEAR_LIMITS[1]:
            raise ValueError
        days, second = ((date - datetime.date(1970, 1, 1)).days,
                        instant.second_of_day(int(hours), int(minutes), float(seconds)))
        instant.of_day(days, second)
    except ValueError:
        raise lines.wrong(path, line, column, f'ScenarioEpoch = {text!r:.60}: must be UTC such as 1 Jun 2026 '
                          '12:00:00.0') from None
    return instant.of_day(days, 0.0), second


def _choice(path: str, head: _Head, name: str, choices: Mapping[str, _R], default: str) -> _R:
    line, column, text = head.get(name, (0, 0, default))
    if text.lower() not in choices:
        raise lines.wrong(path, line, column, f'{name} = {text!r:.40}: must be {" or ".join(choices)}')
    return choices[text.lower()]


def _degree(path: str, head: _Head, method: str) -> int | None:
    """InterpolationSamplesM1 is the number of states of a polynomial minus 1."""
    name = next((name for name in ('interpolationsamplesm1', 'interpolationorder') if name in head), '')
    if not name:
        return None
    line, column, text = head[name]
    low, high = states.DEGREE_LIMITS
    samples = int(text) + 1 if text.isdecimal() and len(text) < 4 else 0
    degree = 2 * samples - 1 if method == 'HERMITE' and name == 'interpolationsamplesm1' else samples - 1
    if not low <= degree <= high or method == 'HERMITE' and degree % 2 == 0:
        raise lines.wrong(path, line, column, f'{name} = {text!r:.20}: must give a polynomial of a degree from {low} '
                          f'to {high}{", odd for Hermite" if method == "HERMITE" else ""}')
    return degree
