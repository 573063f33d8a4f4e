"""Reader of files of orbital elements: TLE, and CCSDS OMM (502.0-B) as KVN (KEYWORD = value), XML, JSON or CSV.

A file may hold many satellites, and several sets of elements of one. Its content decides its format.
"""
import datetime
import json
import pathlib
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple
from xml.parsers import expat

from pedestal_common.geometry import omm, orbit
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.parameters import did_you_mean
from pedestal_common.text_files import csv_table, files
from pedestal_common.text_files.files import FilePath
from tracking_receiver_sim.params import LeoPassParameters
from tracking_receiver_sim.tracks import lines

FORMAT_PROBE_BYTES = 4096  # number of bytes at the beginning of a file that decide its format
MAX_SATELLITES = 300_000  # largest number of satellites in a file, several times the number of catalogued ones
MAX_COMPARED_NAMES = 40_000  # with which an error compares a name: more than catalogued satellites
MAX_XML_DEPTH, MAX_VALUE_CHARS = 100, 200  # of nested elements; length to which a value is cut
PARSE_CHUNK_BYTES = 1 << 20  # number of bytes of XML that are parsed at once
TLE_EPOCH_COLUMNS = slice(18, 32)  # columns of the epoch in line 1 of a TLE
TLE_LINE_PATTERN = re.compile(r'[12] [ 0-9A-Z][ 0-9]{4}[ A-Z]? .{40}')  # beginning of a line of a TLE


class Elements(NamedTuple):
    """Elements of a satellite."""
    name: str
    values: dict[str, str]  # {field of LeoPassParameters (line_1, line_2, omm): text}
    remark: str = ''        # the set that was chosen from a history, and values that were missing


class Satellite(NamedTuple):
    """One set of elements of a satellite in a file."""
    line: int                       # first line in the file
    name: str
    number: str                     # catalogue number
    designator: str                 # international designator
    lines: tuple[str, str] | None   # of its TLE, None for an OMM
    fields: dict[str, str]          # {keyword: text} of an OMM, empty for a TLE

    @property
    def identity(self) -> str:
        """Catalogue number; without one the international designator, or else the name."""
        return self.number or self.designator or self.name

    def is_named(self, name: str) -> bool:
        """Return True for the name, catalogue number or international designator of the satellite, in any case."""
        number = self.number.lstrip('0') or '0'
        return name.strip().upper() in (self.name.upper(), number, self.number, self.designator)


class Loose(csv_table.TableError):
    """A line of a TLE without the other one."""


def satellites(path: FilePath) -> Iterator[Satellite | csv_table.TableError]:
    """Yield the sets of elements of a file, and a TableError in the place of each set that cannot be read. Raises
    TableError where the rest of the file cannot be read."""
    with csv_table.stream(path) as stream:
        beginning = files.beginning(stream.read(FORMAT_PROBE_BYTES)).lstrip()
    count = 0
    for each in _reader(beginning)(path):
        count += 1
        if count > MAX_SATELLITES and isinstance(each, Satellite):
            raise csv_table.TableError(f'{path}: line {each.line}: must be at most {MAX_SATELLITES} satellites')
        yield each


def read(path: FilePath, name: str = '', when: datetime.datetime | None = None) -> Elements:
    """Return the elements of a satellite in a file. Raises TargetError. name: name, catalogue number or international
    designator; it may be empty for a file of one satellite. From several sets the function takes that whose epoch is
    nearest to `when` (UTC), or the latest one."""
    # history: sets of elements of the wanted satellite; others: number of sets of other satellites of this name.
    names, others = list[str](), 0
    history: list[Satellite] = []
    try:
        for satellite in satellites(path):
            if isinstance(satellite, Loose):
                continue
            if isinstance(satellite, csv_table.TableError):
                raise satellite
            names.append(satellite.name)
            if not name or satellite.is_named(name):
                if history and satellite.identity != history[0].identity:
                    others += 1
                else:
                    history.append(satellite)
    except csv_table.TableError as error:
        raise TargetError(f'TLE file {error}') from None
    if not names:
        raise TargetError(f'TLE file {path}: must hold a TLE (a line that begins with "1 ", then one that begins with '
                          '"2 ") or an OMM')
    if others or not history:
        listed = ', '.join(names[:5]) + (', ...' if len(names) > 5 else '')
        remedy = 'name one with --satellite'
        if name:
            count = f'satellite {name!r:.60} is in it {len(history) + others} times'
            hint = did_you_mean(name.upper(), list(dict.fromkeys(names))[:MAX_COMPARED_NAMES])
            remedy = f'{count}; name it by its number' if history else f'{count};{hint}'.removesuffix(';')
        raise TargetError(f'TLE file {path}: satellites: {len(names)} found, {listed}: {remedy}')
    satellite, remark = _nearest(path, history, when)
    values, missing = checked(path, satellite)
    return Elements(satellite.name, {key: getattr(values, key) for key in ('line_1', 'line_2', 'omm')},
                    '; '.join(filter(None, (remark, missing))))


def checked(path: FilePath, satellite: Satellite) -> tuple[LeoPassParameters, str]:
    """Return (valid elements, remark on values that were missing). Raises TargetError."""
    remark = ''
    if not (satellite.lines or satellite.fields.get('BSTAR', '').partition('[')[0].strip()):
        remark = f'{pathlib.Path(path).name}: line {satellite.line}: BSTAR is missing: taken as 0, without drag'
    line_1, line_2 = satellite.lines or ('', '')
    values = LeoPassParameters(line_1=line_1, line_2=line_2, omm='' if satellite.lines else _omm_text(path, satellite))
    try:
        orbit.satellite(values)
    except TargetError as error:
        raise TargetError(f'TLE file {path}: line {satellite.line}: {error}') from None
    return values, remark


def _nearest(path: FilePath, history: list[Satellite], when: datetime.datetime | None) -> tuple[Satellite, str]:
    if len(history) == 1:
        return history[0], ''
    epochs = [epoch(path, satellite) for satellite in history]
    wanted = when or max(epochs)
    # Of two sets that are equally near, the later one in the file is taken.
    i = min(range(len(history)), key=lambda i: (abs(epochs[i] - wanted), -i))
    return history[i], (f'{pathlib.Path(path).name}: {len(history)} sets of elements of satellite '
                        f'{history[i].number or history[i].name}, of {min(epochs):%Y-%m-%d} to '
                        f'{max(epochs):%Y-%m-%d}; taken: the set of {epochs[i]:%Y-%m-%d %H:%M:%S} UTC in line '
                        f'{history[i].line}, the nearest to {wanted:%Y-%m-%d %H:%M:%S}')


def epoch(path: FilePath, satellite: Satellite) -> datetime.datetime:
    """Return the epoch of a set of elements, UTC. Raises TargetError."""
    if satellite.lines:
        text = satellite.lines[0][TLE_EPOCH_COLUMNS]
        try:
            return datetime.datetime(orbit.epoch_year(text[:2]), 1, 1) + datetime.timedelta(days=float(text[2:]) - 1.0)
        except (ValueError, OverflowError):
            raise TargetError(f'TLE file {path}: line {satellite.line}, column {TLE_EPOCH_COLUMNS.start + 1}: epoch = '
                              f'{text!r}: must be year and day, for example 19343.69339541') from None
    try:
        day, second = lines.instant(path, satellite.line, 1, 'EPOCH', satellite.fields.get('EPOCH', ''))
    except csv_table.TableError as error:
        raise TargetError(f'TLE file {error}') from None
    return datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=SECONDS_PER_DAY * day + second)


def _reader(beginning: str) -> Callable[[FilePath], Iterator[Satellite | csv_table.TableError]]:
    if beginning.startswith('<'):
        return _xml
    if beginning.startswith(('{', '[')):
        return _json
    try:
        names = csv_table.Table('', beginning).fieldnames
    except csv_table.READ_ERRORS:
        names = ()
    if 'EPOCH' in names:
        return _csv
    return _kvn if lines.begins_with(beginning, 'CCSDS_OMM_VERS') else _tles


def _tles(path: FilePath) -> Iterator[Satellite | csv_table.TableError]:
    """A line of the name may stand before each TLE."""
    # first: (line number, text) of the line before; before: that of the line before `first`, which may hold a name.
    before, first, paired = (0, ''), (0, ''), True
    for number, text in lines.read(path):
        text = text.strip()
        pair = first[1].startswith('1 ') and text.startswith('2 ')
        if not (pair or paired) and TLE_LINE_PATTERN.match(first[1]):
            yield _loose(path, *first)
        if pair:
            title = ('' if before[1].startswith('2 ') or TLE_LINE_PATTERN.match(before[1]) else
                     before[1].removeprefix('0 ').strip())
            yield Satellite(first[0], title or first[1][2:7].strip(), _number(first[1][2:7]), _designator(first[1]),
                            (first[1], text), {})
        before, first, paired = first, (number, text), pair
    if not paired and TLE_LINE_PATTERN.match(first[1]):
        yield _loose(path, *first)


def _loose(path: FilePath, number: int, text: str) -> Loose:
    other = '2 " behind' if text.startswith('1') else '1 " before'
    return Loose(f'{path}: line {number}: satellite {text[2:7].strip()}: must have a line that begins with "{other} '
                 'this one')


def _number(text: str) -> str:
    """Return a catalogue number, whose first digit may be a letter (notation Alpha-5)."""
    try:
        return omm.catalogue_number(text)
    except ValueError:
        return text.strip()


def _designator(line: str) -> str:
    year, piece = line[9:11], line[11:17].strip()
    return f'{"19" if year >= str(orbit.FIRST_SATELLITE_YEAR) else "20"}{year}-{piece}'


def _omm(line: int, fields: dict[str, str]) -> Satellite:
    number = _number(fields.get('NORAD_CAT_ID', ''))
    return Satellite(line, fields.get('OBJECT_NAME') or number or fields.get('OBJECT_ID', ''), number,
                     fields.get('OBJECT_ID', '').upper(), None, fields)


def _kvn(path: FilePath) -> Iterator[Satellite | csv_table.TableError]:
    """Each OMM begins with its CCSDS_OMM_VERS. An OMM with a wrong line is left out."""
    fields: dict[str, str] = {}
    begun = 0       # line of the beginning of an OMM; 0 outside one, and after a wrong line
    for number, text in lines.read(path):
        keyword, equals, value = text.partition('=')
        keyword = keyword.strip()
        if keyword == 'CCSDS_OMM_VERS':
            if begun:
                yield _omm(begun, fields)
            fields, begun = {}, number
        elif equals and keyword in omm.KEYWORDS:
            # The names of an object may have a remark in brackets.
            value = value if keyword in omm.STANDARD_UNITS or keyword == 'EPOCH' else value.partition('[')[0]
            fields[keyword] = value.strip()[:MAX_VALUE_CHARS]
        elif not equals and keyword.split(None, 1)[0] not in ('COMMENT', 'META_START', 'META_STOP'):
            begun = 0
            yield lines.wrong(path, number, 1, f'{text.strip()!r:.60}: must be KEYWORD = value')
    if begun:
        yield _omm(begun, fields)


def _csv(path: FilePath) -> Iterator[Satellite | csv_table.TableError]:
    with csv_table.opened(path) as reader:
        csv_table.require(reader, ('EPOCH', 'NORAD_CAT_ID'))
        while True:
            try:
                row = next(iter(reader), None)      # goes on behind the last row
            except csv_table.TableError as error:
                yield error
                continue
            if row is None:
                return
            # The name of a column may have a unit behind it, as in `INCLINATION [deg]`.
            named = ((name.partition('['), cell.strip()[:MAX_VALUE_CHARS]) for name, cell in row.items() if cell)
            yield _omm(reader.line_num, {keyword: f'{cell} {bracket}{unit}' if bracket else cell
                                         for (column, bracket, unit), cell in named
                                         if (keyword := column.strip()) in omm.KEYWORDS})


def _json(path: FilePath) -> Iterator[Satellite | csv_table.TableError]:
    """Decode an array of objects, or one object, one by one."""
    text = csv_table.text(path)
    decoder, between = json.JSONDecoder(parse_int=str, parse_float=str), re.compile(r'[\s,\[\]]*')

    def skipped(at: int) -> int:
        match = between.match(text, at)
        return match.end() if match else at

    # at: index in the text; line: its line number; counted: index up to which line ends are counted in `line`.
    at, line, counted = skipped(0), 1, 0
    while at < len(text):
        line, counted = line + text.count('\n', counted, at), at
        begun = at
        try:
            value, at = decoder.raw_decode(text, at)
        except json.JSONDecodeError as error:
            raise lines.wrong(path, error.lineno, error.colno, f'not valid JSON: {error.msg}') from None
        except RecursionError:
            raise lines.wrong(path, line, begun - text.rfind('\n', 0, begun), 'JSON nested too deeply') from None
        column = begun - text.rfind('\n', 0, begun)
        if not isinstance(value, dict):
            yield lines.wrong(path, line, column, 'must be an object of an OMM')
        elif 'EPOCH' not in value:
            yield lines.wrong(path, line, column, f'EPOCH is missing; keywords found: {", ".join(value):.60}')
        else:
            yield _omm(line, {keyword: str(value[keyword]).strip()[:MAX_VALUE_CHARS] for keyword in omm.KEYWORDS
                              if value.get(keyword) is not None})
        at = skipped(at)


class _Segments:
    """Satellites of the segments of an OMM or NDM, from the events of an expat parser."""

    def __init__(self, path: FilePath, parser: expat.XMLParserType) -> None:
        self.satellites: list[Satellite] = []   # of the segments that have ended
        self._path, self._parser = path, parser
        self._open: list[str] = []      # names of the open elements
        self._texts: dict[str, str] = {}    # of the keywords in the open segment, which begins at _line
        self._units: dict[str, str] = {}    # of the keywords that state one, in brackets
        self._line = 1
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler, parser.CharacterDataHandler = self._doctype, self._text
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end

    def _doctype(self, *_: object) -> None:
        raise lines.wrong(self._path, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1,
                          'a document type declaration: an OMM has none')

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if len(self._open) >= MAX_XML_DEPTH:
            raise csv_table.TableError(f'{self._path}: line {self._parser.CurrentLineNumber}: must be at most '
                                       f'{MAX_XML_DEPTH} nested elements')
        self._open.append(name.rpartition(':')[2][:MAX_VALUE_CHARS])
        if self._open[-1] == 'segment':
            self._texts.clear()
            self._units.clear()
            self._line = self._parser.CurrentLineNumber
        if 'units' in attributes and self._open[-1] in omm.KEYWORDS:
            self._units[self._open[-1]] = f' [{attributes["units"][:MAX_VALUE_CHARS]}]'

    def _text(self, data: str) -> None:
        if self._open and self._open[-1] in omm.KEYWORDS:
            self._texts[self._open[-1]] = (self._texts.get(self._open[-1], '') + data)[:MAX_VALUE_CHARS]

    def _end(self, _name: str) -> None:
        if self._open.pop() == 'segment':
            self.satellites.append(_omm(self._line, {key: value.strip() + self._units.get(key, '')
                                                     for key, value in self._texts.items()}))
            self._line = 1


def _xml(path: FilePath) -> Iterator[Satellite]:
    """Yield the satellites of the segments of an OMM or NDM as XML; expat keeps no parsed data in memory."""
    try:
        with csv_table.stream(path) as stream:
            parser = files.xml_parser(stream)
            segments = _Segments(path, parser)
            while piece := stream.read(PARSE_CHUNK_BYTES):
                try:
                    parser.Parse(piece)
                finally:
                    yield from segments.satellites
                segments.satellites.clear()
            parser.Parse(b'', True)
    except expat.ExpatError as error:
        raise lines.wrong(path, error.lineno, error.offset + 1, 'not well-formed XML: '
                          f'{expat.ErrorString(error.code)}') from None
    except (LookupError, ValueError) as error:  # The file may declare an unknown encoding.
        if isinstance(error, csv_table.TableError):
            raise
        raise lines.wrong(path, 1, 1, f'not well-formed XML: {error}') from None


def _omm_text(path: FilePath, satellite: Satellite) -> str:
    fields = dict(satellite.fields)
    try:
        fields['EPOCH'] = lines.text(*lines.instant(path, satellite.line, 1, 'EPOCH', fields.get('EPOCH', '')))
        return json.dumps(omm.checked(fields))
    except csv_table.TableError as error:
        raise TargetError(f'TLE file {error}') from None
    except ValueError as error:
        raise TargetError(f'TLE file {path}: line {satellite.line}: {error}') from None
