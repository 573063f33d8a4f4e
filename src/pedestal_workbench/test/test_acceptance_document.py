"""Report of an acceptance: the page, the rows of --json, JUnit read back."""
import datetime
import html
import json
import math
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_results.intervals import Target
from pedestal_workbench.acceptance import document, figure, in_loop
from pedestal_workbench.acceptance.judgement import judged
from pedestal_workbench.acceptance.method import NEVER, Measured
from pedestal_workbench.acceptance.methods import METHOD_BY_NAME
from pedestal_workbench.acceptance.sequence import Kept, Session
from pedestal_workbench.acceptance.specification import Head, Requirement, Specification

DIGEST = 'dae21ce247d6975e14b4750aeafc499dd34b7558b5d8f4ee483c1175c94c9275'
MADE = datetime.datetime(2026, 11, 30, 12, 0, 0, tzinfo=datetime.timezone.utc)
STOPPED = 'stopped: alarm azimuth drive fault'


def requirement(name, method, limit, repetitions=1):
    found = METHOD_BY_NAME[method]
    return Requirement(name, found, {one.name: one.default for one in found.arguments}, Target.parse(limit),
                       repetitions, 0.95)


REQUIREMENTS = (requirement('slew rate', 'slew_rate', '>= 20', 3), requirement('settling', 'step_settling', '<= 1.5'),
                requirement('slope <&> "x"', 'receiver_slope', '1 +- 0.1'),
                requirement('lash', 'lash', '0.01 to 0.05'), requirement('creep', 'creep_rms', '<= 0.01'))
VALUES = ([Measured(22.0, 0.1), Measured(22.1, 0.1), Measured(22.05, 0.1)], [Measured(1.45, 0.1)],
          [Measured(1.3, 0.05)], [Measured(math.nan, 0.0)])


def results(values=VALUES):
    return [Kept(one.name, judged(one, repetitions, 'no reversal' * math.isnan(repetitions[0].value)),
                 tuple((f'{one.name}-{k + 1}/{one.name}-{k + 1}.mcap', DIGEST) for k in range(len(repetitions))),
                 f'2026-11-30T1{i}:00:00Z', 1 + i // 2)
            for i, (one, repetitions) in enumerate(zip(REQUIREMENTS, values))]


@pytest.fixture(scope='module')
def antenna():
    return in_loop.antenna(Variant('station_real').load())


@pytest.fixture(scope='module')
def whole(antenna):
    """Report of a sequence that was interrupted once, then stopped before its last requirement."""
    specification = Specification(Head('Acceptance of Zürich', 'Ω <&> Söhne', 'no. 7', 'A. Smith', 'of 2026-11-20'),
                                  REQUIREMENTS, 'title: x')
    sessions = [Session('2026-11-30T10:00:00Z', DIGEST, 'stopped: alarm azimuth at limit'),
                Session('2026-11-30T11:59:00Z', DIGEST, STOPPED)]
    return document.Acceptance(specification, results(), sessions, antenna, 'the running graph',
                               'pedestal acceptance x.yaml', MADE)


@pytest.fixture(scope='module')
def folder(whole, tmp_path_factory):
    folder = tmp_path_factory.mktemp('report')
    (folder / 'signals').mkdir()
    t = np.linspace(0.0, 5.0, 50)
    np.savetxt(folder / 'signals' / 'slew_rate.csv', np.column_stack((t, np.sin(t), 0.0 * t)), delimiter=',',
               header=','.join(figure.HEADER), comments='')
    document.write(whole, folder)
    return folder


def test_the_report_states_what_a_customer_signs(folder):
    text = html.unescape((folder / 'report.html').read_text())
    for part in ('Acceptance of Zürich', 'Ω <&> Söhne', 'A. Smith', 'of 2026-11-20', 'pedestal_bringup 0.',
                 f'slew rate-1/slew rate-1.mcap {DIGEST} and 2 more', f'slew rate-3/slew rate-3.mcap {DIGEST}.',
                 f'from 2026-11-30T10:00:00Z: stopped: alarm azimuth at limit; parameters SHA-256 {DIGEST}',
                 f'from 2026-11-30T11:59:00Z: {STOPPED}', '2026-11-30T10:00:00Z to 2026-11-30T12',
                 'Not passed: 1 passed, 2 inconclusive, 1 failed, 1 not performed of 5 requirements', STOPPED,
                 'signature', 'not measured: no reversal', 'acu.azimuth.shaper.rate'):
        assert part in text, part
    assert not re.findall('(?:src|href)="(?!#)', text) and 'url(' not in text.replace('url(#', '')  # self-contained
    assert text.count('<figure') == 4 and text.count('motion, repetition 1') == 1
    assert len(re.findall(r'SHA-256 [0-9a-f]{64}', text)) == 3      # sessions, specification


def test_the_pdf_has_the_pages_of_a_document(folder):
    data = (folder / 'report.pdf').read_bytes()
    assert data.startswith(b'%PDF') and len(re.findall(rb'/Type /Page\b', data)) >= 3


def test_a_value_has_no_digit_below_its_uncertainty():
    one = requirement('ramp', 'ramp_error', '<= 1')
    for value, uncertainty, words in (
            (8.782e-6, 6.3e-6, ('8.8e-06 deg', '6.3e-06 deg')), (0.017768, 3e-8, ('0.01777 deg', '3e-08 deg')),
            (85.97, 1.6, ('86 deg', '1.6 deg')), (1358.0, 120.0, ('1360 deg', '120 deg')),
            (-0.0048, 0.015, ('-0.005 deg', '0.015 deg')), (0.0, 0.01, ('0 deg', '0.01 deg'))):
        found = Kept('', judged(one, [Measured(value, uncertainty)]), (), '', 1)
        assert document.measured(one, found)[:2] == words
    assert document.measured(one, Kept('', judged(one, [NEVER]), (), '', 1)) == ('never', 'not known', '<= 1 deg')


def test_equal_results_give_equal_bytes(whole, tmp_path):
    one = document.dataclasses.replace(whole, kept=whole.kept[:1])
    first = [path.read_bytes() for path in document.write(one, tmp_path)]
    assert [path.read_bytes() for path in document.write(one, tmp_path)] == first


def test_junit_holds_each_requirement(folder):
    suite = ElementTree.parse(folder / 'report.xml').getroot().find('testsuite')
    assert {key: suite.get(key) for key in ('name', 'tests', 'failures', 'skipped', 'errors')} == {
        'name': 'Acceptance of Zürich', 'tests': '5', 'failures': '3', 'skipped': '1', 'errors': '0'}
    cases = {case.get('name'): case for case in suite}
    assert list(cases) == [one.name for one in REQUIREMENTS]
    assert cases['slew rate'].find('failure') is None and DIGEST in cases['slew rate'].findtext('system-out')
    assert cases['settling'].find('failure').get('type') == 'inconclusive'
    assert cases['slope <&> "x"'].find('failure').get('type') == 'failed'
    assert cases['creep'].find('skipped').get('message') == STOPPED


def test_rows_for_json(whole):
    content = document.json_content(whole)
    assert json.loads(json.dumps(content, allow_nan=False)) == content
    found = {(row['case'], row['metric']): row['value'] for row in content['rows']}
    assert len(found) == 4 * 4
    assert [found[one.name, 'passed'] for one in REQUIREMENTS[:4]] == [1.0, 0.5, 0.0, 0.5]
    assert [found[one.name, 'limit'] for one in REQUIREMENTS[:3]] == pytest.approx([20.0, 1.5, 1.1])
    assert found['slew rate', 'value'] == pytest.approx(22.05) and found['settling', 'uncertainty'] == 0.1
    assert found['lash', 'value'] is None and found['lash', 'uncertainty'] is None


def test_a_report_without_results_and_one_of_passed_requirements(whole, tmp_path):
    nothing = document.dataclasses.replace(whole, kept=[])
    document.write(nothing, tmp_path)
    assert not nothing.passed and 'nothing was measured' in (tmp_path / 'report.html').read_text()
    passed = document.dataclasses.replace(whole, kept=results(
        [[Measured(value, 0.001)] for value in (30.0, 1.0, 1.0, 0.03, 0.001)]))
    assert passed.passed and passed.verdict == 'Passed: 5 passed of 5 requirements'


def test_the_signal_of_a_performance_is_kept(tmp_path):
    from pedestal_workbench.acceptance.exercise import Action, Exercise, Span
    span = Span(-90.0, 90.0, 30.0)
    performed = in_loop.InLoop(Variant('station_real')).perform('x', Exercise(
        3.0, (span, span), (Action(0.5, 'acu', 'preset azimuth=0.05 elevation=0.5'),), (0.0, 0.5)), 1)
    figure.keep_signal(performed, tmp_path / 'signals' / 'x.csv')
    t, azimuth, elevation = np.loadtxt(tmp_path / 'signals' / 'x.csv', delimiter=',', skiprows=1).T
    assert 300 < t.size <= figure.MAX_SIGNAL_POINTS + 1 and t[0] < 0.01 and t[-1] == pytest.approx(3.0, abs=0.02)
    assert azimuth[0] == pytest.approx(0.0, abs=0.02) and azimuth[-1] == pytest.approx(math.degrees(0.05), abs=0.02)
    assert elevation[-1] == pytest.approx(math.degrees(0.5), abs=0.02)
