"""Orbital elements of many satellites in one file: TLE, and CCSDS OMM (502.0-B) as KVN, XML, JSON or CSV.

The content of a file decides its format. Elements of an OMM become the two lines of a TLE, with the digits of a TLE:
both are mean elements of SGP4.
"""
import json
import re
import typing
from xml.parsers import expat

from sgp4 import omm
from sgp4.api import Satrec
from sgp4.exporter import export_tle

from pedestal_common.geometry.orbit import TargetError
from pedestal_common.parameters import did_you_mean
from pedestal_common.text_files import content, csv_table
from tracking_receiver_sim.ephemeris import lines

FORMAT_PROBE_BYTES = 4096
"""Number of bytes at the beginning of a file that decide its format."""
NUMBER_LIMITS = {'MEAN_MOTION': (0.05, 18.0), 'ECCENTRICITY': (0.0, 0.9999999), 'INCLINATION': (0.0, 180.0),
                 'RA_OF_ASC_NODE': (-360.0, 360.0), 'ARG_OF_PERICENTER': (-360.0, 360.0),
                 'MEAN_ANOMALY': (-360.0, 360.0), 'BSTAR': (-9.0, 9.0),
                 'MEAN_MOTION_DOT': (-9.0, 9.0), 'MEAN_MOTION_DDOT': (-9.0, 9.0),
                 'NORAD_CAT_ID': (0, 339_999), 'ELEMENT_SET_NO': (0, 9999), 'REV_AT_EPOCH': (0, 99_999)}
"""{keyword: (lowest, highest)} [rev/day], [deg], [1/earth radii], [rev/day^2 / 2], [rev/day^3 / 6]."""
ANGLE_KEYWORDS = ('RA_OF_ASC_NODE', 'ARG_OF_PERICENTER', 'MEAN_ANOMALY')
INTEGER_KEYWORDS = ('NORAD_CAT_ID', 'ELEMENT_SET_NO', 'REV_AT_EPOCH')
DEFAULT_FIELDS = {'MEAN_MOTION_DOT': '0', 'MEAN_MOTION_DDOT': '0', 'ELEMENT_SET_NO': '999', 'REV_AT_EPOCH': '0'}
"""{keyword that an OMM may omit: default value}."""
ALLOWED_VALUES = {'CENTER_NAME': ('EARTH',), 'REF_FRAME': ('TEME',), 'TIME_SYSTEM': ('UTC',),
                  'MEAN_ELEMENT_THEORY': ('SGP4', 'SGP/SGP4')}
"""{keyword: allowed values}; the first one is the default."""
OMM_KEYWORDS = ('OBJECT_NAME', 'OBJECT_ID', 'EPOCH', *ALLOWED_VALUES, *NUMBER_LIMITS)
MAX_SATELLITES = 300_000
"""Largest number of satellites in a file, several times the number of catalogued ones."""
MAX_COMPARED_NAMES = 40_000
"""Largest number of names compared with an unknown one for a hint, more than the number of catalogued satellites."""
MAX_XML_DEPTH, MAX_VALUE_CHARS = 100, 200
"""Largest depth of nested XML elements, and the number of characters to which a value is cut."""
PARSE_CHUNK_BYTES = 1 << 20
DESIGNATOR_PATTERN = re.compile(r'\d{4}-\d{3}[A-Z]{1,3}')


class Satellite(typing.NamedTuple):
    """A satellite of a file. line: first line in the file; number: catalogue number; designator: international
    designator; lines: those of its TLE, None for an OMM; fields: {keyword: text} of an OMM."""
    line: int
    name: str
    number: str
    designator: str
    lines: tuple | None
    fields: dict

    def is_named(self, name):
        """Return True for the name, catalogue number or international designator of the satellite, in any case."""
        number = self.number.lstrip('0') or '0'
        return name.strip().upper() in (self.name.upper(), number, self.number, self.designator)


def read(path, name=''):
    """Return (name, line 1, line 2) of a satellite in a file of elements, see the module. Raises TargetError.

    name: name, catalogue number or international designator; it may be empty for a file of one satellite.
    """
    try:
        with csv_table.stream(path) as stream:
            beginning = content.beginning(stream.read(FORMAT_PROBE_BYTES)).lstrip()
        names, found = [], []
        for satellite in _reader(beginning)(path):
            names.append(satellite.name)
            if len(names) > MAX_SATELLITES:
                raise csv_table.TableError(f'{path}: line {satellite.line}: must be at most {MAX_SATELLITES} '
                                           'satellites')
            if not name or satellite.is_named(name):
                found.append(satellite if not found else None)
    except csv_table.TableError as error:
        raise TargetError(f'TLE file {error}') from None
    if not names:
        raise TargetError(f'TLE file {path}: must hold a TLE (a line that begins with "1 ", then one that begins with '
                          '"2 ") or an OMM')
    if len(found) != 1:
        listed = ', '.join(names[:5]) + (', ...' if len(names) > 5 else '')
        remedy = 'name one with --satellite'
        if name:
            count = f'satellite {name!r:.60} is in it {len(found)} times'
            hint = did_you_mean(name.upper(), list(dict.fromkeys(names))[:MAX_COMPARED_NAMES])
            remedy = f'{count}; name it by its number' if found else f'{count};{hint}'.removesuffix(';')
        raise TargetError(f'TLE file {path}: satellites: {len(names)} found, {listed}: {remedy}')
    satellite = found[0]
    return (satellite.name, *(satellite.lines or _tle(path, satellite)))


def _reader(beginning):
    if beginning.startswith('<'):
        return _xml
    if beginning.startswith(('{', '[')):
        return _json
    if beginning.startswith('CCSDS_OMM_VERS'):
        return _kvn
    try:
        names = csv_table.Table('', beginning).fieldnames
    except csv_table.READ_ERRORS:
        names = ()
    return _csv if 'EPOCH' in names else _tles


def _tles(path):
    """Yield the satellites of a file of TLEs, with or without a line of the name before each."""
    before, first = (0, ''), (0, '')
    for number, text in lines.read(path):
        if first[1].startswith('1 ') and text.startswith('2 '):
            title = '' if before[1].startswith('2 ') else before[1].removeprefix('0 ').strip()
            yield Satellite(first[0], title or first[1][2:7].strip(), _number(first[1][2:7]), _designator(first[1]),
                            (first[1], text), {})
        before, first = first, (number, text)


def _number(text):
    """Return the catalogue number in a TLE, whose first digit may be a letter (Alpha-5)."""
    from sgp4.alpha5 import from_alpha5
    try:
        return str(from_alpha5(text.strip()))
    except (ValueError, IndexError):
        return text.strip()


def _designator(line):
    year, piece = line[9:11], line[11:17].strip()
    return f'{"19" if year >= "57" else "20"}{year}-{piece}'


def _omm(line, fields):
    number = fields.get('NORAD_CAT_ID', '')
    return Satellite(line, fields.get('OBJECT_NAME') or number or fields.get('OBJECT_ID', ''), number,
                     fields.get('OBJECT_ID', '').upper(), None, fields)


def _kvn(path):
    """Yield the satellites of OMMs in sequence; each begins with its CCSDS_OMM_VERS."""
    fields, begun = {}, 0
    for number, text in lines.read(path):
        keyword, equals, value = text.partition('=')
        keyword = keyword.strip()
        if keyword == 'CCSDS_OMM_VERS':
            if begun:
                yield _omm(begun, fields)
            fields, begun = {}, number
        elif equals and keyword in OMM_KEYWORDS:
            fields[keyword] = value.partition('[')[0].strip()[:MAX_VALUE_CHARS]
        elif not equals and keyword.split(None, 1)[0] not in ('COMMENT', 'META_START', 'META_STOP'):
            raise lines.wrong(path, number, 1, f'{text.strip()!r:.60}: must be KEYWORD = value')
    if begun:
        yield _omm(begun, fields)


def _csv(path):
    with csv_table.opened(path) as reader:
        csv_table.require(reader, ('EPOCH', 'NORAD_CAT_ID'))
        for row in reader:
            yield _omm(reader.line_num, {keyword: row[keyword].strip()[:MAX_VALUE_CHARS] for keyword in OMM_KEYWORDS
                                         if isinstance(row.get(keyword), str)})


def _json(path):
    """Yield the satellites of a JSON array of objects, or of one object, decoded one by one."""
    text = csv_table.text(path)
    decoder, between = json.JSONDecoder(parse_int=str, parse_float=str), re.compile(r'[\s,\[\]]*')
    at, line, counted = between.match(text).end(), 1, 0
    while at < len(text):
        line, counted = line + text.count('\n', counted, at), at
        begun = at
        try:
            value, at = decoder.raw_decode(text, at)
        except json.JSONDecodeError as error:
            raise lines.wrong(path, error.lineno, error.colno, f'not valid JSON: {error.msg}') from None
        except RecursionError:
            raise lines.wrong(path, line, begun - text.rfind('\n', 0, begun), 'JSON nested too deeply') from None
        if not isinstance(value, dict):
            raise lines.wrong(path, line, begun - text.rfind('\n', 0, begun), 'must be an object of an OMM')
        yield _omm(line, {keyword: str(value[keyword]).strip()[:MAX_VALUE_CHARS] for keyword in OMM_KEYWORDS
                          if value.get(keyword) is not None})
        at = between.match(text, at).end()


def _xml(path):
    """Yield the satellites of the segments of an OMM or NDM as XML; expat keeps no parsed data in memory."""
    satellites, open_elements, texts = [], [], {}

    def doctype(*_):
        raise lines.wrong(path, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1,
                          'a document type declaration: an OMM has none')

    def start(name, _attributes):
        if len(open_elements) >= MAX_XML_DEPTH:
            raise csv_table.TableError(f'{path}: line {parser.CurrentLineNumber}: must be at most {MAX_XML_DEPTH} '
                                       'nested elements')
        name = name.rpartition(':')[2][:MAX_VALUE_CHARS]
        open_elements.append(name)
        if name == 'segment':
            texts.clear()
            texts['line'] = parser.CurrentLineNumber

    def text(data):
        if open_elements and open_elements[-1] in OMM_KEYWORDS:
            texts[open_elements[-1]] = (texts.get(open_elements[-1], '') + data)[:MAX_VALUE_CHARS]

    def end(_name):
        if open_elements.pop() == 'segment':
            line = texts.pop('line', 1)
            satellites.append(_omm(line, {keyword: value.strip() for keyword, value in texts.items()}))

    try:
        with csv_table.stream(path) as stream:
            parser = content.xml_parser(stream)
            parser.buffer_text = True
            parser.StartDoctypeDeclHandler, parser.CharacterDataHandler = doctype, text
            parser.StartElementHandler, parser.EndElementHandler = start, end
            while piece := stream.read(PARSE_CHUNK_BYTES):
                parser.Parse(piece)
                yield from satellites
                satellites.clear()
            parser.Parse(b'', True)
    except expat.ExpatError as error:
        raise lines.wrong(path, error.lineno, error.offset + 1, 'not well-formed XML: '
                          f'{expat.ErrorString(error.code)}') from None
    except (LookupError, ValueError) as error:  # of an encoding that the file declares
        if isinstance(error, csv_table.TableError):
            raise
        raise lines.wrong(path, 1, 1, f'not well-formed XML: {error}') from None


def _tle(path, satellite):
    """Return the two lines of a satellite of an OMM. Raises TargetError."""
    place, fields = f'TLE file {path}: line {satellite.line}', {**DEFAULT_FIELDS, **satellite.fields}
    for keyword, allowed in ALLOWED_VALUES.items():
        if fields.get(keyword, allowed[0]).upper() not in allowed:
            raise TargetError(f'{place}: {keyword} = {fields[keyword]!r:.60}: must be {" or ".join(allowed)}')
    try:
        for keyword, (low, high) in NUMBER_LIMITS.items():
            value = csv_table.number(path, satellite.line, keyword, fields.get(keyword), low, high)
            fields[keyword] = str(value % 360.0 if keyword in ANGLE_KEYWORDS
                                  else int(value) if keyword in INTEGER_KEYWORDS else value)
        day, second = lines.instant(path, satellite.line, 1, 'EPOCH', fields.get('EPOCH', ''))
    except csv_table.TableError as error:
        raise TargetError(f'TLE file {error}') from None
    designator = fields.get('OBJECT_ID', '').upper()
    satrec = Satrec()
    omm.initialize(satrec, {
        **fields, 'CLASSIFICATION_TYPE': 'U', 'EPHEMERIS_TYPE': '0', 'EPOCH': lines.text(day, second),
        'OBJECT_ID': designator if DESIGNATOR_PATTERN.fullmatch(designator) else '    '})
    return export_tle(satrec)
