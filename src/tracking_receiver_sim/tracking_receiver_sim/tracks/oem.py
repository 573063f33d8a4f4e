"""Reader of CCSDS Orbit Ephemeris Messages (OEM): 502.0-B in the notation KEYWORD = value, versions 1 to 3."""
import array
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from pedestal_common.quantities import Floats, Seconds, Times
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.tracks import frames, instant, lines, states

ENTRY_PATTERN = re.compile(r'([A-Z0-9_]+)( *= *)(.*)', re.ASCII)
FILE_SIGNATURE = 'CCSDS_OEM_VERS'
STATE_LIMITS = {**dict.fromkeys('xyz', (-2e6, 2e6)), **dict.fromkeys(('vx', 'vy', 'vz'), (-100.0, 100.0))}  # km, km/s
LINE_COLUMN, DAY_COLUMN, SECOND_COLUMN, FIRST_NUMBER_COLUMN = range(4)
COLUMN_COUNT = FIRST_NUMBER_COLUMN + len(STATE_LIMITS)
REPEATED_STATE = 'state that repeats the one above'  # same epoch and numbers
MAX_SEGMENTS = 1000  # largest number of segments of a file
REQUIRED_KEYWORDS = ('OBJECT_NAME', 'OBJECT_ID', 'CENTER_NAME', 'REF_FRAME', 'TIME_SYSTEM')


class _Entry(str):
    line: int       # its place in the file
    column: int

    def __new__(cls, value: str, line: int, column: int) -> '_Entry':
        entry = super().__new__(cls, value)
        entry.line, entry.column = line, column
        return entry


_Entries: TypeAlias = dict[str, _Entry]     # {keyword: value}


class _Block(NamedTuple):
    line: int       # at which the metadata end
    meta: _Entries
    rows: Floats    # (n, COLUMN_COUNT)
    error: csv_table.TableError | None      # of its first wrong row


class Object(NamedTuple):
    """An object of an OEM."""
    name: str
    designator: str     # OBJECT_ID
    line: int           # at which the metadata of its first segment end
    blocks: tuple[_Block, ...]
    midnight: Seconds   # instant of t = 0

    def ephemeris(self, path: str) -> states.Ephemeris:
        """Return the Ephemeris of the object. Raises TableError."""
        for block in self.blocks:
            if block.error:
                raise block.error
        segments = tuple(_segment(path, block, self.midnight) for block in self.blocks)
        for before, after, block in zip(segments, segments[1:], self.blocks[1:]):
            if after.begin < before.end:
                place = block.meta.get('USEABLE_START_TIME', block.meta['OBJECT_NAME'])
                raise lines.wrong(path, place.line, place.column, 'the segment begins before the end of the one above')
        first = self.blocks[0].meta
        count, given = sum(len(segment.t) for segment in segments), sum(len(block.rows) for block in self.blocks)
        passed_over = f', passed over {given - count} x {REPEATED_STATE}' if given > count else ''
        return states.Ephemeris(path, self.midnight, segments,
                                f'CCSDS OEM of {first["OBJECT_NAME"]:.40} ({first["OBJECT_ID"]:.40}): {count} states '
                                f'in {first["REF_FRAME"]}, {segments[0].method} of degree '
                                f'{segments[0].degree}{passed_over}')


def objects(path: str) -> list[Object]:
    """Return the objects of an OEM in the order of the file. Raises TableError for a file of another form."""
    found: dict[tuple[str, str], list[_Block]] = {}
    for block in _blocks(path):
        found.setdefault((block.meta['OBJECT_NAME'].upper(), block.meta['OBJECT_ID'].upper()), []).append(block)
    if not found:
        raise csv_table.TableError(f'{path}: META_START is missing')
    rows = next(iter(found.values()))[0].rows
    midnight = instant.of_day(int(rows[0, DAY_COLUMN]), 0.0) if len(rows) else 0.0
    return [Object(str(blocks[0].meta['OBJECT_NAME']), str(blocks[0].meta['OBJECT_ID']), blocks[0].line, tuple(blocks),
                   midnight) for blocks in found.values()]


def read(path: str, wanted: str = '') -> states.Ephemeris:
    """Return the Ephemeris of one object in an OEM. Raises TableError. wanted: name or international designator of the
    object; it may be empty for a file of one object."""
    known = objects(path)
    for block in (block for each in known for block in each.blocks):
        if block.error:
            raise block.error
    wanted = wanted.strip().upper()
    found = [each for each in known if not wanted or wanted in (each.name.upper(), each.designator.upper())]
    if len(found) != 1:
        listed = ', '.join(f'{each.name} {each.designator}'.upper()[:60] for each in known[:12])
        raise csv_table.TableError(f'{path}: aircraft = {wanted!r:.60}: must name one of the {len(known)} objects '
                                   f'in the file: {listed}')
    return found[0].ephemeris(path)


def _blocks(path: str) -> Iterator[_Block]:
    # begun: line of the last META_START; ended: of the last META_STOP; state: part of the file that contains the line.
    meta: _Entries = {}
    rows, begun, ended, state, count = array.array('d'), 0, 0, 'header', 0
    wrong: csv_table.TableError | None = None
    for line, text in lines.read(path):
        word = text.split(None, 1)[0]
        if state == 'covariance':
            state = 'data' if word == 'COVARIANCE_STOP' else state
        elif word == 'META_START':
            if state == 'meta':
                raise lines.wrong(path, line, 1, f'META_START inside the metadata of line {begun}')
            if state == 'data':
                yield _Block(ended, meta, _table(rows), wrong)
            count += 1
            if count > MAX_SEGMENTS:
                raise csv_table.TableError(f'{path}: line {line}: must be at most {MAX_SEGMENTS} segments')
            meta, rows, begun, state, wrong = {}, array.array('d'), line, 'meta', None
        elif word == 'META_STOP' and state == 'meta':
            missing = [name for name in REQUIRED_KEYWORDS if name not in meta]
            if missing:
                raise csv_table.TableError(f'{path}: line {line}: {missing[0]} is missing in the metadata above')
            ended, state = line, 'data'
        elif word == 'COVARIANCE_START' and state == 'data':
            state = 'covariance'
        elif state == 'data' and word != 'COMMENT':
            try:
                rows.extend(_row(path, line, text))
            except csv_table.TableError as error:
                wrong = wrong or error
        elif word != 'COMMENT':
            entry = ENTRY_PATTERN.fullmatch(text.strip())
            if not entry:
                raise lines.wrong(path, line, 1, f'{text.strip()!r:.60}: must be KEYWORD = value')
            meta[entry[1]] = _Entry(entry[3], line, text.index('=') + 1 + len(entry[2].split('=')[1]) + 1)
    if state == 'meta':
        raise csv_table.TableError(f'{path}: the file ends inside the metadata of line {begun}')
    if state in ('data', 'covariance'):
        yield _Block(ended, meta, _table(rows), wrong)


def _table(rows: 'array.array[float]') -> Floats:
    return np.array(rows).reshape(-1, COLUMN_COUNT)


def _row(path: str, line: int, text: str) -> tuple[float, ...]:
    # rest: the line with blanks in place of the epoch, so that errors name the right column.
    epoch = text.split(None, 1)[0]
    at = text.index(epoch)
    rest = ' ' * (at + len(epoch)) + text[at + len(epoch):]
    return line, *lines.instant(path, line, at + 1, 'epoch', epoch), *lines.numbers(path, line, rest, STATE_LIMITS)


def _segment(path: str, block: _Block, midnight: Seconds) -> states.Segment:
    meta, rows = block.meta, block.rows
    _one_of(path, meta, 'CENTER_NAME', ('EARTH',))
    frame, system = meta['REF_FRAME'].upper(), meta['TIME_SYSTEM'].upper()
    if not frames.known(frame):
        raise lines.wrong(path, meta['REF_FRAME'].line, meta['REF_FRAME'].column,
                          f'REF_FRAME = {meta["REF_FRAME"]!s:.40}: must be {frames.names()}')
    if 'REF_FRAME_EPOCH' in meta:
        entry = meta['REF_FRAME_EPOCH']
        raise lines.wrong(path, entry.line, entry.column, 'REF_FRAME_EPOCH: must be absent, because only frames of '
                          'date are supported')
    _one_of(path, meta, 'TIME_SYSTEM', tuple(frames.TIME_SYSTEM_OFFSETS_S))

    def seconds(line: Floats, column: int, days: Floats, of_day: Floats) -> Times:
        try:
            return frames.instants(system, days, of_day) - midnight
        except ValueError as error:
            [i] = error.args        # index of the row
            raise lines.wrong(path, int(line[i]), column, f'second 60: TIME_SYSTEM {system} has no leap second at the '
                              'end of this minute') from None

    def bound(name: str) -> Seconds:
        entry = meta[name]
        day, second = lines.instant(path, entry.line, entry.column, name, entry)
        return float(seconds(np.array([entry.line]), entry.column, np.array([day]), np.array([second]))[0])

    span = [bound(name) if name in meta else None for name in ('USEABLE_START_TIME', 'USEABLE_STOP_TIME')]
    method, degree = _interpolation(path, meta)
    lines_of_rows, metres = rows[:, LINE_COLUMN], 1e3 * rows[:, FIRST_NUMBER_COLUMN:]
    times = seconds(lines_of_rows, 1, rows[:, DAY_COLUMN], rows[:, SECOND_COLUMN])
    table = _without_repetitions(path, np.column_stack((lines_of_rows, times, metres)))
    return states.segment(path, block.line, table, frame, method, degree, *span)


def _without_repetitions(path: str, table: Floats) -> Floats:
    """Remove repetitions of the row above. Raise TableError for different states at one time."""
    step = np.diff(table[:, 1:], axis=0)
    at_once = step[:, 0] == 0.0
    repeated = at_once & (step == 0.0).all(axis=1)
    different = np.flatnonzero(at_once & ~repeated)
    if different.size:
        i = int(different[0]) + 1
        raise lines.wrong(path, int(table[i, 0]), 1, 'the state differs from the one above, at the same epoch; must '
                          'be one state for each epoch')
    return table[np.append(True, ~repeated)[:len(table)]]


def _interpolation(path: str, meta: _Entries) -> tuple[str, int | None]:
    if 'INTERPOLATION' not in meta:
        return '', None
    method = _one_of(path, meta, 'INTERPOLATION', states.INTERPOLATION_METHODS)
    entry = meta.get('INTERPOLATION_DEGREE')
    if entry is None:
        return method, None
    low, high = states.DEGREE_LIMITS
    degree = int(entry) if entry.isdecimal() and len(entry) < 4 else 0
    odd = method == 'HERMITE'
    if not low + 2 * odd <= degree <= high or odd and degree % 2 == 0:
        raise lines.wrong(path, entry.line, entry.column, f'INTERPOLATION_DEGREE = {entry!s:.20}: must be an '
                          f'{"odd" if odd else "integer"} number from {low + 2 * odd} to {high}')
    return method, degree


def _one_of(path: str, meta: _Entries, name: str, allowed: Sequence[str]) -> str:
    entry = meta[name]
    if entry.upper() not in allowed:
        raise lines.wrong(path, entry.line, entry.column, f'{name} = {entry!s:.40}: must be {" or ".join(allowed)}')
    return entry.upper()
