"""Report of an acceptance: HTML and the PDF of this page, JSON, and JUnit XML."""
import collections
import dataclasses
import html
import json
import math
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from datetime import datetime

from pedestal_common.parameters import as_dict, value_text
from pedestal_common.quantities import Json, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import configuration
from pedestal_results import intervals
from pedestal_results.report import elements, figures, paper, subject
from pedestal_workbench.acceptance import figure
from pedestal_workbench.acceptance.exercise import Antenna
from pedestal_workbench.acceptance.judgement import FAILED, INCONCLUSIVE, PASSED
from pedestal_workbench.acceptance.sequence import COMPLETE, SIGNALS_FOLDER, Kept, Session, utc_text
from pedestal_workbench.acceptance.specification import Requirement, Specification

VERDICTS = {PASSED: 'passed', INCONCLUSIVE: 'inconclusive', FAILED: 'failed'}
NOT_PERFORMED = 'not performed'
EXPLANATION = ('The uncertainty is the half width of the interval of the mean, at the confidence of the requirement. '
               'A requirement is passed if the whole interval meets the limit, failed if none of it does, and '
               'inconclusive in between. An alarm, or an antenna outside its envelope, ends an exercise and fails '
               'its requirement. Where the uncertainty is not known, the value alone is compared with the limit. '
               'Systematic errors, such as those of the encoders, are not part of the uncertainty. The measurement of '
               'a requirement has its number.')
CSS = """
.results th, .results td { padding-right: .8rem; font-size: .85rem; }
.results td:nth-child(-n+6) { white-space: nowrap; } .results td:last-child { overflow-wrap: anywhere; }
.sign td { height: 3.2rem; min-width: 14rem; }
"""


@dataclasses.dataclass(frozen=True)
class Acceptance:
    """Content of a report."""
    specification: Specification
    kept: Sequence[Kept]        # measured requirements
    sessions: Sequence[Session]
    antenna: Antenna
    source: str                 # what was tested: the running graph, or a scenario and how it ran
    command: str                # whole command line
    made: datetime              # of the report, UTC

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
    def stopped(self) -> str:
        """How the sequence ended before its end, '' if it came to its end."""
        return '' if self.sessions[-1].end == COMPLETE else self.sessions[-1].end

    @property
    def passed(self) -> bool:
        """True if all requirements are passed."""
        return list(self.counts) == [VERDICTS[PASSED]]

    @property
    def verdict(self) -> str:
        """The verdict on all requirements, in words."""
        counts = ', '.join(f'{number} {word}' for word, number in self.counts.items())
        return f'{"Passed" if self.passed else "Not passed"}: {counts} of {len(self.specification.requirements)} '\
               'requirements'


def verdict(kept: Kept | None) -> str:
    """Return the verdict on a requirement in words."""
    return VERDICTS[kept.judged.verdict] if kept else NOT_PERFORMED


def measured(requirement: Requirement, kept: Kept | None) -> tuple[str, str, str]:
    """Return value, uncertainty and limit of a requirement in words. The value has no digit below the uncertainty."""
    def text(number: str) -> str:
        return f'{number} {requirement.method.unit}'.removesuffix(' 1').rstrip()
    limit = text(requirement.limit.text)
    if kept is None:
        return '', '', limit
    value, uncertainty = kept.judged[:2]
    if math.isnan(value):
        return f'not measured: {kept.judged.reason}', '', limit
    if not uncertainty:
        return 'never' if math.isinf(value) else text(intervals.number(value)), 'not known', limit
    below = math.floor(math.log10(abs(value) or 1.0)) - math.floor(math.log10(uncertainty))
    rounded = float(f'{value:.{min(max(below + 2, 1), 4)}g}')
    return text(f'{rounded:.5g}'), text(f'{float(f"{uncertainty:.2g}"):g}'), limit


def line(requirement: Requirement, kept: Kept) -> str:
    """Return a result as a line of text."""
    value, uncertainty, limit = measured(requirement, kept)
    of_value = f'uncertainty {uncertainty}, ' if uncertainty else ''
    return f'{verdict(kept):12}  {requirement.name}: {value}, {of_value}must be {limit}'


def json_content(acceptance: Acceptance) -> dict[str, Json]:
    """Return the content of the --json file. The row `limit` of a range is the end that is nearer to the value."""
    rows: list[Row] = []
    for requirement, kept in acceptance.lines():
        if kept is not None:
            unit, judged = requirement.method.unit, kept.judged
            near = min(filter(math.isfinite, requirement.limit.ends), key=lambda end: abs(end - judged.value))
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
        'name': acceptance.specification.head.title, 'tests': str(len(acceptance.specification.requirements)),
        'failures': str(failures), 'errors': '0', 'skipped': str(acceptance.counts.get(NOT_PERFORMED, 0)),
        'timestamp': acceptance.made.isoformat(timespec='seconds')})
    for requirement, kept in acceptance.lines():
        case = ElementTree.SubElement(suite, 'testcase', {'classname': requirement.method.name,
                                                          'name': requirement.name})
        if kept is None:
            ElementTree.SubElement(case, 'skipped', {'message': acceptance.stopped or NOT_PERFORMED})
            continue
        said = line(requirement, kept)
        if kept.judged.verdict != PASSED:
            ElementTree.SubElement(case, 'failure', {'type': verdict(kept), 'message': said})
        ElementTree.SubElement(case, 'system-out').text = '\n'.join((said, *map(' '.join, kept.bags)))
    ElementTree.indent(whole)
    return ElementTree.tostring(whole, encoding='utf-8', xml_declaration=True)


def _parts(acceptance: Acceptance, signals: pathlib.Path) -> Iterator[str]:
    """Yield the elements of the page. signals: folder of the signals."""
    spec, numbered = acceptance.specification, list(enumerate(acceptance.lines(), start=1))
    yield f'<h1>{html.escape(spec.head.title)}</h1>'
    yield f'<p class="verdict{" bad" * (not acceptance.passed)}">{acceptance.verdict}</p>'
    if acceptance.stopped:
        yield f'<p class="bad">The sequence did not come to its end; {html.escape(acceptance.stopped)}</p>'
    yield TextTable(('', ''), [(name, text or 'not stated') for name, text in _head(acceptance)]).html('meta')
    yield '<h2>Requirements</h2>'
    yield TextTable(
        ('', 'requirement', ('measured', '>'), ('uncertainty', '>'), ('limit', '>'), 'verdict', 'recording, SHA-256'),
        [(str(i), requirement.name, *measured(requirement, kept), verdict(kept),
          f'{" ".join(kept.bags[0])}{f" and {len(kept.bags) - 1} more" * (len(kept.bags) > 1)}' if kept and kept.bags
          else 'none') for i, (requirement, kept) in numbered]).html('results')
    yield f'<p>{EXPLANATION}</p><h2>Signatures</h2>'
    yield TextTable(('', 'name', 'place and date', 'signature'), [
        ('tested by', spec.head.tester, '', ''), ('for the supplier', '', '', ''), ('for the customer', '', '', '')]
    ).html('sign')
    yield '<h2>Measurements</h2>'
    for i, (requirement, kept) in numbered:
        if kept:
            of_figure = figures.Spec(f'requirement-{i}', f'{i}  {requirement.name}', _caption(requirement, kept), (),
                                     figure.draw)
            yield elements.figure(of_figure, figure.Shown(requirement, kept.judged,
                                                          signals / f'{requirement.file_name}.csv'))
    yield '<h2>Parameters that differ from their defaults</h2>'
    yield TextTable(('parameter', 'value', 'default', 'unit'), [
        row for node, part in acceptance.antenna.parts.items()
        for row in subject.changed(node, type(part), as_dict(part))]).html()


def _caption(requirement: Requirement, kept: Kept) -> str:
    """Return how a requirement was measured: method, arguments, repetitions, begin, and all recordings."""
    method, count = requirement.method, requirement.repetitions
    arguments = ', '.join(f'{each.name} {value_text(requirement.arguments[each.name])} {each.unit}'.rstrip()
                          for each in method.arguments)
    bags = ', '.join(map(' '.join, kept.bags))
    return (f'Method {method.name}: {method.doc}. Arguments: {arguments}. Begun {kept.begun}, {count} '
            f'repetition{"s" * (count > 1)}, confidence {100.0 * requirement.confidence:g} %. '.replace('`', '')
            + f'Recordings and their SHA-256: {bags}.' * bool(bags))


def _head(acceptance: Acceptance) -> list[tuple[str, str]]:
    """Return the rows [name, text] of the table at the head."""
    head, antenna = acceptance.specification.head, acceptance.antenna
    begun = min((kept.begun for kept in acceptance.kept), default='nothing was measured')
    versions = ', '.join(f'{key.removeprefix("version.")} {value}' for key, value in configuration.versions().items())
    pointing = antenna.acu.pointing
    return [('customer', head.customer), ('antenna', head.antenna), ('tester', head.tester),
            ('tested', f'{begun} to {utc_text(acceptance.made)}'), ('tested on', acceptance.source),
            ('simulated nodes', ', '.join(antenna.simulated) or 'none'), ('calibration', head.calibration),
            ('pointing model', pointing.report().title if pointing.named else 'none'),
            ('software', f'{versions}, git {configuration.git_revision() or "unknown"}'),
            ('specification', f'SHA-256 {acceptance.specification.sha256}'),
            *((f'session {i}', f'from {session.begun}: {session.end}; parameters SHA-256 {session.parameters}')
              for i, session in enumerate(acceptance.sessions, start=1)),
            ('command', acceptance.command)]


def write(acceptance: Acceptance, folder: pathlib.Path) -> list[pathlib.Path]:
    """Write the report into a folder as HTML, PDF, JSON and JUnit XML, and return the paths."""
    page = elements.page(acceptance.specification.head.title, _parts(acceptance, folder / SIGNALS_FOLDER), CSS)
    written = {'report.html': page.encode(), 'report.pdf': paper.pdf(page, acceptance.made),
               'report.json': json.dumps(json_content(acceptance), indent=1).encode(), 'report.xml': junit(acceptance)}
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in written.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in written]
