"""Report of an acceptance: HTML and PDF from the same list of blocks, JSON, and JUnit XML."""
import collections
import dataclasses
import html
import json
import math
import pathlib
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import NamedTuple

import matplotlib
from fpdf import FPDF

from pedestal_common.parameters import as_dict
from pedestal_common.quantities import Json, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import configuration
from pedestal_results import intervals
from pedestal_results.report import elements, figures, subject
from pedestal_workbench.acceptance import figure
from pedestal_workbench.acceptance.exercise import Antenna
from pedestal_workbench.acceptance.judgement import FAILED, INCONCLUSIVE, PASSED, ends
from pedestal_workbench.acceptance.sequence import Kept, Session, utc_text
from pedestal_workbench.acceptance.specification import Requirement, Specification

VERDICTS = {PASSED: 'passed', INCONCLUSIVE: 'inconclusive', FAILED: 'failed'}
NOT_PERFORMED = 'not performed'
EXPLANATION = ('The uncertainty is the half width of the interval of the mean, at the confidence of the requirement. '
               'A requirement is passed if the whole interval meets the limit, failed if none of it does, and '
               'inconclusive in between. An alarm, or an antenna outside its envelope, ends an exercise and fails '
               'its requirement. Where the uncertainty is not known, the value alone is compared with the '
               'limit. Systematic errors, such as those of the encoders, are not part of the uncertainty.')
CSS = """
body { max-width: 76rem; } table.line { font-size: .85rem; } .line th, .line td { padding-right: .8rem; }
.results td:nth-child(n+3):nth-child(-n+6) { white-space: nowrap; }
.line td:last-child { overflow-wrap: anywhere; font-size: .75rem; } .sign td { height: 3.2rem; min-width: 14rem; }
"""
FONT, TEXT_PT, TITLE_PT, TABLE_PT = 'DejaVu', 9.0, 15.0, 6.5    # of the PDF; the font comes with matplotlib
FIGURE_MM, GAP_MM, SIGNATURE_MM, BOTTOM_MM = (134.0, 39.8), 6.0, 14.0, 15.0
"""Size of a figure, height of a gap and of a signature, margin at the bottom of a page."""
MIN_SECTION_MM = 65.0   # a section with less space left begins on the next page
LINE_GREY, LINE_MM = 170, 0.1   # colour and width of the lines of tables


class Block(NamedTuple):
    """Part of the report."""
    kind: str   # of a text: h1, h2, verdict, bad or p; of a table: meta, line, line results or sign; figure
    content: str | TextTable | tuple[figures.Spec, figure.Shown]


@dataclasses.dataclass(frozen=True)
class Acceptance:
    """Content of a report."""
    specification: Specification
    kept: Sequence[Kept]        # measured requirements
    antenna: Antenna
    source: str                 # what was tested: the running graph, or a scenario and how it ran
    command: str                # whole command line
    made: datetime              # of the report, UTC
    sessions: Sequence[Session] = ()
    stopped: str = ''           # reason why the sequence did not come to its end

    def lines(self) -> Iterator[tuple[Requirement, Kept | None]]:
        """Yield each requirement with its result, None if it was not performed."""
        found = {kept.name: kept for kept in self.kept}
        for requirement in self.specification.requirements:
            yield requirement, found.get(requirement.name)

    @property
    def counts(self) -> dict[str, int]:
        """{verdict: number of its requirements}."""
        found = collections.Counter(map(verdict, (kept for _, kept in self.lines())))
        return {word: found[word] for word in (*VERDICTS.values(), NOT_PERFORMED) if found[word]}

    @property
    def passed(self) -> bool:
        """True if all requirements are passed."""
        return list(self.counts) == [VERDICTS[PASSED]]

    @property
    def verdict(self) -> str:
        """The verdict on all requirements, in words."""
        counts = ', '.join(f'{number} {word}' for word, number in self.counts.items())
        return f'{"Passed" if self.passed else "Not passed"}: {counts} of {len(self.specification.requirements)}'


def verdict(kept: Kept | None) -> str:
    """Return the verdict on a requirement in words."""
    return VERDICTS[kept.judged.verdict] if kept else NOT_PERFORMED


def measured(requirement: Requirement, kept: Kept | None) -> tuple[str, str, str]:
    """Return value, uncertainty and limit of a requirement in words."""
    def text(number: str) -> str:
        return f'{number} {requirement.method.unit}'.removesuffix(' 1').rstrip()
    limit = text(requirement.limit.text)
    if kept is None:
        return '', '', limit
    value, uncertainty = kept.judged[:2]
    if math.isnan(value):
        return f'not measured: {kept.judged.reason}'.rstrip(': '), '', limit
    return ('never' if math.isinf(value) else text(intervals.number(value)),
            text(intervals.number(float(f'{uncertainty:.2g}'))) if uncertainty else 'not known', limit)


def line(specification: Specification, kept: Kept) -> str:
    """Return a result as a line of text."""
    requirement = next(one for one in specification.requirements if one.name == kept.name)
    value, uncertainty, limit = measured(requirement, kept)
    return f'{verdict(kept):12}  {kept.name}: {value}, {f"uncertainty {uncertainty}, " * bool(uncertainty)}' \
           f'must be {limit}'


def json_content(acceptance: Acceptance) -> dict[str, Json]:
    """Return the content of the --json file. The row `limit` of a range is the end that is nearer to the value."""
    rows: list[Row] = []
    for requirement, kept in acceptance.lines():
        if kept is not None:
            unit, judged = requirement.method.unit, kept.judged
            near = min(filter(math.isfinite, ends(requirement.limit)), key=lambda end: abs(end - judged.value))
            rows += [intervals.single(kept.name, 'value', judged.value, unit, requirement.limit.text),
                     intervals.single(kept.name, 'limit', near, unit),
                     intervals.single(kept.name, 'uncertainty', judged.uncertainty, unit),
                     intervals.single(kept.name, 'passed', judged.verdict)]
    return {'name': 'acceptance', 'rows': rows, 'verdict': acceptance.verdict, 'counts': acceptance.counts,
            'stopped': acceptance.stopped, 'bags': {kept.name: dict(kept.bags) for kept in acceptance.kept}}


def junit(acceptance: Acceptance) -> bytes:
    """Return the report as JUnit XML: a test case a requirement. Because an inconclusive requirement is not passed, it
    is a failure too."""
    failures = sum(kept is not None and kept.judged.verdict != PASSED for _, kept in acceptance.lines())
    whole = ElementTree.Element('testsuites')
    suite = ElementTree.SubElement(whole, 'testsuite', {
        'name': acceptance.specification.title, 'tests': str(len(acceptance.specification.requirements)),
        'failures': str(failures), 'errors': '0', 'skipped': str(acceptance.counts.get(NOT_PERFORMED, 0)),
        'timestamp': acceptance.made.isoformat(timespec='seconds')})
    for requirement, kept in acceptance.lines():
        case = ElementTree.SubElement(suite, 'testcase', {'classname': requirement.method.name,
                                                          'name': requirement.name})
        if kept is None:
            ElementTree.SubElement(case, 'skipped', {'message': acceptance.stopped or NOT_PERFORMED})
            continue
        said = line(acceptance.specification, kept)
        if kept.judged.verdict != PASSED:
            ElementTree.SubElement(case, 'failure', {'type': verdict(kept), 'message': said})
        ElementTree.SubElement(case, 'system-out').text = '\n'.join((said, *map(' '.join, kept.bags)))
    ElementTree.indent(whole)
    return ElementTree.tostring(whole, encoding='utf-8', xml_declaration=True)


def blocks(acceptance: Acceptance, signals: pathlib.Path) -> Iterator[Block]:
    """Yield the blocks of the report, the only place that states what it contains. signals: folder of the signals."""
    spec, numbered = acceptance.specification, list(enumerate(acceptance.lines(), start=1))
    yield Block('h1', spec.title)
    yield Block('verdict' if acceptance.passed else 'bad', acceptance.verdict)
    if acceptance.stopped:
        yield Block('bad', f'The sequence was stopped before its end: {acceptance.stopped}')
    yield Block('meta', TextTable(('', ''), _head(acceptance)))
    yield Block('h2', 'Requirements')
    yield Block('line results', TextTable(
        ('', 'requirement', ('measured', '>'), ('uncertainty', '>'), ('limit', '>'), 'verdict', 'figure',
         'recording and its SHA-256'),
        [(str(i), requirement.name, *measured(requirement, kept), verdict(kept), str(i) if kept else '',
          _first_bag(kept.bags) if kept else '') for i, (requirement, kept) in numbered]))
    yield Block('p', EXPLANATION)
    yield Block('h2', 'Signatures')
    yield Block('sign', TextTable(('', 'name', 'place and date', 'signature'), [
        (who, '', '', '') for who in ('tested by', 'for the supplier', 'for the customer')]))
    yield Block('h2', 'Methods')
    yield Block('line', TextTable(
        ('', 'requirement', 'method', 'arguments', ('repetitions', '>'), ('confidence', '>'), 'begun (UTC)'),
        [(str(i), requirement.name, f'{requirement.method.name}: {requirement.method.doc}'.replace('`', ''),
          ', '.join(f'{name} {value}' for name, value in requirement.arguments.items()), str(requirement.repetitions),
          f'{100.0 * requirement.confidence:g} %', kept.begun if kept else '')
         for i, (requirement, kept) in numbered]))
    yield Block('h2', 'Figures')
    for i, (requirement, kept) in numbered:
        if kept:
            yield Block('figure', (figures.Spec(f'requirement-{i}', f'{i}  {requirement.name}', '', (), figure.draw),
                                   figure.Shown(requirement, kept.judged, signals / f'{requirement.file_name}.csv')))
    yield Block('h2', 'Recordings')
    yield Block('line', TextTable(('requirement', 'recording', 'SHA-256'), [
        (kept.name, *bag) for kept in acceptance.kept for bag in kept.bags]))
    yield Block('h2', 'Parameters that differ from their defaults')
    yield Block('line', TextTable(('parameter', 'value', 'default', 'unit'), [
        row for node, part in acceptance.antenna.parts.items()
        for row in subject.changed(node, type(part), as_dict(part))]))


def _first_bag(bags: Sequence[tuple[str, str]]) -> str:
    """Return the first recording of a requirement as text."""
    more = f' and {len(bags) - 1} more (table Recordings)' if len(bags) > 1 else ''
    return f'{" ".join(bags[0])}{more}' if bags else 'none'


def _head(acceptance: Acceptance) -> list[tuple[str, str]]:
    """Return the rows [name, text] of the table at the head."""
    spec, pointing = acceptance.specification, acceptance.antenna.acu.pointing
    begun = min((kept.begun for kept in acceptance.kept), default='nothing was measured')
    versions = ', '.join(f'{key.removeprefix("version.")} {value}' for key, value in configuration.versions().items())
    model = f'pointing model {pointing.report().title}' if pointing.named else 'the control unit has no pointing model'
    return [('customer', spec.customer), ('antenna', spec.antenna), ('tested by', spec.tester),
            ('tested', f'{begun} to {utc_text(acceptance.made)}'),
            *((f'session {i}', f'from {session.begun}: {session.end}; parameters SHA-256 {session.parameters}')
              for i, session in enumerate(acceptance.sessions, start=1)),
            ('equipment', acceptance.source), ('calibration', '; '.join(filter(None, (spec.calibration, model)))),
            ('software', f'{versions}, git {configuration.git_revision() or "unknown"}'),
            ('parameters', f'SHA-256 {acceptance.antenna.sha256}'),
            ('specification', f'SHA-256 {spec.sha256}'),
            ('made by', acceptance.command)]


def page(content: Sequence[Block], title: str) -> str:
    """Return the HTML page of blocks."""
    parts = []
    for kind, part in content:
        if isinstance(part, str):
            tag = kind if kind in ('h1', 'h2') else 'p'
            parts.append(f'<{tag} class="{kind}">{html.escape(part)}</{tag}>')
        else:
            parts.append(part.html(kind) if isinstance(part, TextTable) else elements.figure(*part))
    return elements.page(title, parts, CSS)


class _Pdf(FPDF):
    """PDF on A4 across, with the numbers of its pages."""

    def __init__(self, title: str, made: datetime) -> None:
        super().__init__('landscape', format='A4')
        self.set_title(title)
        self.set_creation_date(made)
        self.set_auto_page_break(True, BOTTOM_MM)
        folder = pathlib.Path(matplotlib.get_data_path(), 'fonts', 'ttf')
        for style, file in (('', 'DejaVuSans.ttf'), ('B', 'DejaVuSans-Bold.ttf')):
            self.add_font(FONT, style, folder / file)
        self.set_draw_color(LINE_GREY)
        self.set_line_width(LINE_MM)
        self.add_page()

    def footer(self) -> None:
        """Write the number of the page; the library calls this."""
        self.set_y(-0.8 * BOTTOM_MM)
        self.set_font(FONT, size=TABLE_PT)
        self.cell(0.0, None, f'{self.title}: page {self.page_no()} of {{nb}}', align='R')

    def write_line(self, kind: str, text: str) -> None:
        """Write a line of text."""
        if kind == 'h2' and self.will_page_break(MIN_SECTION_MM):
            self.add_page()
        self.set_font(FONT, '' if kind == 'p' else 'B', TITLE_PT if kind == 'h1' else TEXT_PT)
        self.ln(GAP_MM / 3.0)
        self.multi_cell(0.0, None, text, align='L', new_x='LMARGIN', new_y='NEXT')
        self.ln(GAP_MM / 3.0)

    def write_table(self, kind: str, table: TextTable) -> None:
        """Write a table. A narrow column is as wide as its texts; the wide ones share the rest of the page."""
        headed = any(table.heads)
        texts = [table.heads, *table.rows] if headed else table.rows
        self.set_font(FONT, 'B', TABLE_PT)      # of the heads, which is the wider one
        widths = [max(map(self.get_string_width, column)) + GAP_MM / 2.0 for column in zip(*texts)]
        rest, widest = self.epw, self.epw
        for i, width in enumerate(sorted(widths)):
            widest = rest / (len(widths) - i)
            if width > widest:
                break
            rest -= width
        self.set_font(FONT, size=TABLE_PT)
        with self.table(col_widths=[min(width, widest) for width in widths], first_row_as_headings=headed,
                        borders_layout='HORIZONTAL_LINES',
                        text_align=tuple('RIGHT' if right else 'LEFT' for right in table.right),
                        line_height=1.4 * self.font_size) as made:
            for i, row in enumerate(texts):
                made.row(row, min_height=SIGNATURE_MM if kind == 'sign' and i else None)

    def write_figures(self, pictures: Sequence[tuple[figures.Spec, figure.Shown]]) -> None:
        """Write figures, two side by side."""
        for i, (spec, shown) in enumerate(pictures):
            if i % 2 == 0 and self.will_page_break(FIGURE_MM[1] + GAP_MM):
                self.add_page()
            x, y = self.l_margin + i % 2 * (FIGURE_MM[0] + GAP_MM), self.get_y()
            self.set_font(FONT, 'B', TABLE_PT)
            self.text(x, y + GAP_MM / 2.0, spec.title)
            with tempfile.TemporaryDirectory() as folder:
                path = pathlib.Path(folder, 'figure.png')
                figures.render(spec, shown, path)
                self.image(path, x, y + GAP_MM, *FIGURE_MM, keep_aspect_ratio=True)
            self.set_y(y if i % 2 == 0 and i + 1 < len(pictures) else y + FIGURE_MM[1] + GAP_MM)


def pdf(content: Sequence[Block], title: str, made: datetime) -> bytes:
    """Return the PDF of blocks."""
    paper = _Pdf(title, made)
    pictures = [block.content for block in content if isinstance(block.content, tuple)]
    for kind, part in content:
        if isinstance(part, str):
            paper.write_line(kind, part)
        elif isinstance(part, TextTable):
            paper.write_table(kind, part)
        elif part is pictures[0]:
            paper.write_figures(pictures)
    return bytes(paper.output())


def write(acceptance: Acceptance, folder: pathlib.Path) -> list[pathlib.Path]:
    """Write the report into a folder as HTML, PDF, JSON and JUnit XML, and return the paths."""
    title = acceptance.specification.title
    content = list(blocks(acceptance, folder / 'signals'))
    written = {'report.html': page(content, title).encode(), 'report.pdf': pdf(content, title, acceptance.made),
               'report.json': json.dumps(json_content(acceptance), indent=1).encode(), 'report.xml': junit(acceptance)}
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in written.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in written]
