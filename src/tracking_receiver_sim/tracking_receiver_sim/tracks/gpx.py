"""Reader of tracks as GPX: each point (trkpt) with a time and an elevation (ele) is a fix.

expat gives the line of a point and keeps no parsed data in memory. The reader stops at a document type declaration.
This avoids the expansion of entities and access to other files. ele is above mean sea level. The height above the
ellipsoid is ele + geoidheight; without geoidheight ele takes its place, with a remark in the log.
"""
from collections import Counter
from collections.abc import Iterator
from xml.parsers import expat

from pedestal_common.text_files import csv_table, files
from tracking_receiver_sim.tracks import instant
from tracking_receiver_sim.tracks.fixes import Fix, Log

PARSE_CHUNK_BYTES = 1 << 20  # parsed at once; expat reads an incomplete token again with each piece
MAX_XML_DEPTH, MAX_TEXT_CHARS = 100, 200  # of nested elements; length to which a text is cut

OEM_XML_HINT = '; an OEM must be in the notation KEYWORD = value, not XML'

OTHER_POINTS = ('rtept', 'wpt')  # points of a planned route and marks, which are no recorded track
TEXT_ELEMENTS = ('ele', 'time', 'geoidheight', 'name')  # elements whose text the reader takes


def rows(path: str, log: Log) -> Iterator[Fix]:
    """Yield the fixes of a GPX file; the name of an aircraft is that of its track. Raises TableError."""
    log.form, log.time_name, log.dated = 'GPX', 'time', True
    points = _Points(path, log)
    try:
        with csv_table.stream(path) as stream:
            points.parse_with(files.xml_parser(stream))
            while piece := stream.read(PARSE_CHUNK_BYTES):
                points.parser.Parse(piece)
                yield from points.taken_fixes()
            points.parser.Parse(b'', True)
    except expat.ExpatError as error:
        raise csv_table.TableError(f'{path}: line {error.lineno}: not well-formed XML'
                                   f'{points.encoding()}: {expat.ErrorString(error.code)}') from None
    except (LookupError, ValueError) as error:
        if isinstance(error, csv_table.TableError):
            raise
        raise csv_table.TableError(f'{path}: line 1: not well-formed XML{points.encoding()}: {error}') from None
    names = ', '.join(f'{count} {name}' for name, count in sorted(points.others.items()))
    log.nothing = (f'no trkpt in it{f" ({names})" if names else ""}' if not points.count else
                   next((f'no point has {article} {name}' for article, name in (('a', 'time'), ('an', 'ele'))
                         if log.passed_over[f'point without {name}'] == points.count), ''))
    if points.with_ele:
        log.remarks.append('ele taken as height above the ellipsoid')


class _Points:
    path_of_elements: list[str]     # names of the open elements, the outermost first
    texts: dict[str, str]           # {name: text} of the elements of the open point
    fixes: list[Fix]                # since the last `taken_fixes`
    tracks: int                     # number of trk
    track: str                      # name of the open track
    with_ele: bool                  # True if a point had no geoidheight, so that ele took the place of the height
    count: int                      # number of trkpt
    others: Counter[str]            # {name of OTHER_POINTS: number}
    declared: str                   # encoding of the XML declaration
    line: int                       # of the open point
    place: dict[str, str]           # attributes of the open point

    def __init__(self, path: str, log: Log) -> None:
        self.path, self.log = path, log
        self.path_of_elements, self.texts, self.fixes = [], {}, []
        self.tracks, self.track, self.with_ele = 0, '', False
        self.count, self.others, self.declared = 0, Counter(), ''

    def parse_with(self, parser: expat.XMLParserType) -> None:
        """Receive the elements of an expat parser."""
        self.parser = parser
        self.parser.buffer_text = True
        self.parser.XmlDeclHandler = self.declaration
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.parser.StartElementHandler, self.parser.EndElementHandler = self.start, self.end
        self.parser.CharacterDataHandler = self.text

    def taken_fixes(self) -> list[Fix]:
        """Return the fixes since the last call, and remove them."""
        fixes, self.fixes = self.fixes, []
        return fixes

    def declaration(self, _version: str, encoding: str | None, _standalone: int) -> None:
        """Store the encoding of the XML declaration."""
        self.declared = encoding or ''

    def encoding(self) -> str:
        """Return the encoding of the file in parentheses, for the end of an error message."""
        return f' (encoding {self.declared or "UTF-8":.40})'

    def doctype(self, *_: object) -> None:
        """Raise TableError for a document type declaration."""
        raise csv_table.TableError(f'{self.path}: line {self.parser.CurrentLineNumber}: a document type declaration: '
                                   'GPX has none')

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Begin an element. Raises TableError for a file that is no GPX or is nested too deeply."""
        name = name.rpartition(':')[2]
        self.path_of_elements.append(name)
        if len(self.path_of_elements) > MAX_XML_DEPTH:
            raise csv_table.TableError(f'{self.path}: line {self.parser.CurrentLineNumber}: must be at most '
                                       f'{MAX_XML_DEPTH} nested elements')
        if len(self.path_of_elements) == 1 and name != 'gpx':
            raise csv_table.TableError(f'{self.path}: line {self.parser.CurrentLineNumber}: element {name!r:.60}: '
                                       f'must be gpx{OEM_XML_HINT if name in ("oem", "ndm") else ""}')
        if name == 'trk':
            self.tracks += 1
            self.track = f'track {self.tracks}'
        elif name == 'trkpt':
            self.count += 1
            self.texts, self.line, self.place = {}, self.parser.CurrentLineNumber, attributes
        elif name in OTHER_POINTS:
            self.others[name] += 1

    def text(self, text: str) -> None:
        """Add a part of the text of the open element."""
        parent, name = ['', '', *self.path_of_elements][-2:]
        if name in TEXT_ELEMENTS and parent == ('trk' if name == 'name' else 'trkpt'):
            self.texts[name] = (self.texts.get(name, '') + text[:MAX_TEXT_CHARS])[:MAX_TEXT_CHARS]

    def end(self, name: str) -> None:
        """End an element: take the name of a track, or the fix of a point."""
        name = self.path_of_elements.pop()
        if name == 'name' and self.path_of_elements[-1:] == ['trk']:
            self.track = self.texts.pop('name', '').strip() or self.track
        elif name == 'trkpt':
            self.point()

    def point(self) -> None:
        """Take the fix of the open point, or count a point without time or elevation. Raises TableError."""
        path, line, texts = self.path, self.line, self.texts
        missing = next((name for name in ('time', 'ele') if not texts.get(name, '').strip()), '')
        if missing:
            self.log.passed_over[f'point without {missing}'] += 1
            return
        ele = csv_table.number(path, line, 'ele', texts['ele'], -1000.0, 1e8)
        geoid = csv_table.number(path, line, 'geoidheight', texts.get('geoidheight', '0'), -150.0, 150.0)
        self.with_ele = self.with_ele or 'geoidheight' not in texts
        self.fixes.append(Fix(line, (self.track,), instant.seconds(path, line, 'time', texts['time']),
                              csv_table.number(path, line, 'lat', self.place.get('lat'), -90.0, 90.0),
                              csv_table.number(path, line, 'lon', self.place.get('lon'), -180.0, 360.0), ele + geoid))
