"""The verb `acceptance` in the closed loop: what it prints, asks, writes and returns."""
import importlib.resources
import io
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_workbench.acceptance import in_loop, specification

SCENARIO = '--scenario', 'uav_tracker_3m', '--closed-loop'
TITLE = 'title: Acceptance\ntester: A. Smith\nrequirements:\n'
STEP = "- {name: step, method: step_settling, arguments: {size: 0.1}, limit: '<= 0.15', unit: s, repetitions: 2}\n"
SLEW = "- {name: slew, method: slew_rate, limit: '>= 130', unit: deg/s}\n"


@pytest.fixture
def accept(pedestal, tmp_path):
    """accept(text, *options) -> (exit code, output, complaints) of `pedestal acceptance` in the closed loop."""
    def call(text, *options):
        (tmp_path / 'spec.yaml').write_text(text)
        return pedestal('acceptance', 'spec.yaml', *SCENARIO, *options)
    return call


def rows(text):
    """{(case, metric): value} of the JSON."""
    return {(row['case'], row['metric']): row['value'] for row in json.loads(text)['rows']}


def test_an_antenna_is_accepted(tmp_path):
    """The interface, as a process of its own: JSON alone on standard output."""
    (tmp_path / 'spec.yaml').write_text(TITLE + STEP + SLEW)
    done = subprocess.run([sys.executable, '-m', 'pedestal.cli', 'acceptance', 'spec.yaml', *SCENARIO, '--yes',
                           '--output', 'out', '--tester', 'B. Jones', '--json', '-'], cwd=tmp_path,
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, check=True)
    found = rows(done.stdout)
    assert list(found) == [(case, metric) for case in ('step', 'slew')
                           for metric in ('value', 'limit', 'uncertainty', 'passed')]
    assert [found[case, 'passed'] for case in ('step', 'slew')] == [1.0, 1.0]
    assert [found[case, 'limit'] for case in ('step', 'slew')] == [0.15, 130.0]
    for part in ('The antenna will move within', 'azimuth rate', 'passed        step: 0.07', 'Passed: 2 passed of 2',
                 'out/report.html', 'out/report.pdf', 'out/report.xml', 'out/report.json'):
        assert part in done.stderr, part
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert 'B. Jones' in page and 'scenario uav_tracker_3m in the closed loop, seed 1' in page
    assert rows((tmp_path / 'out' / 'report.json').read_text()) == found
    assert (tmp_path / 'out' / 'report.pdf').read_bytes().startswith(b'%PDF')
    assert len(ElementTree.parse(tmp_path / 'out' / 'report.xml').findall('.//testcase')) == 2


@pytest.mark.parametrize('old, new, verdict', [('0.15', '0.05', 'failed'), ('0.15', '0.0762', 'inconclusive')])
def test_a_failed_or_inconclusive_requirement_is_exit_code_4(accept, tmp_path, old, new, verdict):
    code, said, _ = accept(TITLE + STEP.replace(old, new), '--yes')
    assert code == 4 and f'{verdict:12}  step: ' in said and f'1 {verdict} of 1' in said
    assert (tmp_path / 'acceptance-spec' / 'report.html').is_file()


class Terminal(io.StringIO):
    """Standard input of a person at a terminal."""

    def isatty(self):
        return True


def test_nothing_moves_before_it_is_confirmed(accept, tmp_path, monkeypatch):
    monkeypatch.setattr('sys.stdin', io.StringIO('yes\n'))
    code, said, errors = accept(TITLE + SLEW)
    assert code == 2 and '--yes: must be given without a terminal' in errors and 'slew' in said
    for answer in ('no\n', '\n', 'y\n', ''):
        monkeypatch.setattr('sys.stdin', Terminal(answer))
        code, _, errors = accept(TITLE + SLEW)
        assert code == 2 and 'nothing has moved' in errors
    assert not (tmp_path / 'acceptance-spec').exists()
    monkeypatch.setattr('sys.stdin', Terminal('Yes\n'))
    assert accept(TITLE + SLEW)[0] == 0


@pytest.mark.parametrize('text, options, words', [
    (TITLE + SLEW.replace('slew_rate', 'slew'), (), ("requirement 1 'slew': method = 'slew'", 'slew_rate')),
    (TITLE + STEP.replace('size: 0.1', 'axis: elevation, size: 170') + SLEW, (), ("requirement 'step': size = 170",)),
    ('', (), ('spec.yaml',)),
    (TITLE + SLEW, ('--param', 'adu.nothing=1'), ('nothing',)),
    (TITLE + SLEW, ('--output', 'spec.yaml'), ('--output spec.yaml: must be a directory',)),
    (TITLE + SLEW, ('--output', 'missing/out'), ('--output missing/out: must be a directory',)),
    (TITLE + SLEW, ('--tester', 'A\nB'), (r"tester = 'A\nB': must be a text of one line",)),
    (TITLE + SLEW, ('--json', 'missing/rows.json'), ('--json missing/rows.json',))])
def test_what_cannot_be_done_is_refused(accept, tmp_path, text, options, words):
    code, _, errors = accept(text, '--yes', *options)
    assert code == 2 and all(word in errors for word in words) and 'Traceback' not in errors
    assert {path.name for path in tmp_path.iterdir()} == {'spec.yaml'}


def test_options_of_a_scenario_need_one(pedestal, tmp_path):
    (tmp_path / 'spec.yaml').write_text(TITLE + SLEW)
    for options in (('--closed-loop',), ('--param', 'adu.azimuth.load.inertia=300')):
        code, _, errors = pedestal('acceptance', 'spec.yaml', '--yes', *options)
        assert code == 2 and 'needs --scenario' in errors


def test_results_stay_and_another_specification_needs_another_folder(accept, tmp_path):
    assert accept(TITLE + SLEW, '--yes')[0] == 0
    first = rows((tmp_path / 'acceptance-spec' / 'report.json').read_text())
    code, said, _ = accept(TITLE + SLEW, '--yes', '--seed', '7')
    assert code == 0 and 'passed        slew' in said
    assert rows((tmp_path / 'acceptance-spec' / 'report.json').read_text()) == first
    code, _, errors = accept(TITLE + STEP, '--yes')
    assert code == 2 and 'another specification' in errors


MOTOR_LOSS_OPTIONS = '--param', 'adu.inject=0.1 motor_loss axis=azimuth motor=1'


def test_an_alarm_fails_its_requirement_and_is_exit_code_4(accept, tmp_path):
    code, said, _ = accept(TITLE + STEP + SLEW, '--yes', *MOTOR_LOSS_OPTIONS)
    assert code == 4 and 'Not passed: 2 failed of 2' in said
    assert re.search('failed        step: not measured: step-1, after .* s: alarm azimuth motor lost, must be', said)
    folder = tmp_path / 'acceptance-spec'
    assert 'alarm azimuth motor lost' in (folder / 'report.html').read_text()
    assert {rows((folder / 'report.json').read_text())[name, 'passed'] for name in ('step', 'slew')} == {0.0}
    assert len(ElementTree.parse(folder / 'report.xml').findall('.//failure[@type="failed"]')) == 2


def test_a_sequence_that_is_stopped_is_exit_code_1_with_a_report(accept, tmp_path, monkeypatch):
    """By an alarm of a running graph, for which the closed loop stands in."""
    monkeypatch.setattr(in_loop.InLoop, 'own_runs', False)
    code, _, errors = accept(TITLE + STEP + SLEW, '--yes', *MOTOR_LOSS_OPTIONS)
    assert code == 1 and 'alarm azimuth motor lost' in errors and 'the same command continues' in errors
    page = (tmp_path / 'acceptance-spec' / 'report.html').read_text()
    assert 'The sequence did not come to its end; stopped: ' in page and '1 failed, 1 not performed of 2' in page
    code, said, _ = accept(TITLE + STEP + SLEW, '--yes')
    assert code == 4 and '1 passed, 1 failed of 2' in said


def test_an_operator_stops_the_sequence(accept, tmp_path, monkeypatch):
    made = in_loop.InLoop.perform

    def perform(self, name, exercise, seed):
        if name.startswith('slew'):
            raise KeyboardInterrupt
        return made(self, name, exercise, seed)
    monkeypatch.setattr(in_loop.InLoop, 'perform', perform)
    code, said, errors = accept(TITLE + STEP + SLEW, '--yes')
    assert code == 130 and 'by an operator' in errors and '1 passed, 1 not performed of 2' in said
    monkeypatch.setattr(in_loop.InLoop, 'perform', made)
    code, said, _ = accept(TITLE + STEP + SLEW, '--yes')
    assert code == 0
    page = (tmp_path / 'acceptance-spec' / 'report.html').read_text()
    assert ': stopped: by an operator; parameters' in page and ': came to its end; parameters' in page


@pytest.mark.parametrize('name, scenario', [
    ('acceptance', 'uav_tracker_3m'), ('acceptance_uav_tracker_3m', 'uav_tracker_3m'),
    ('acceptance_station_real', 'station_real'), ('acceptance_ship_pass', 'ship_pass')])
def test_a_sample_fits_its_antenna(name, scenario):
    path = importlib.resources.files('pedestal') / 'samples' / f'{name}.yaml'
    spec = specification.read(path)
    assert len(spec.exercises(in_loop.InLoop(Variant(scenario)))) >= 5


@pytest.mark.thorough
@pytest.mark.parametrize('scenario', ['uav_tracker_3m', 'station_real', 'ship_pass'])
def test_an_antenna_passes_its_sample(pedestal, scenario):
    path = importlib.resources.files('pedestal') / 'samples' / f'acceptance_{scenario}.yaml'
    code, said, _ = pedestal('acceptance', path, '--scenario', scenario, '--closed-loop', '--yes')
    assert code == 0, said


def test_the_commented_sample_is_passed(pedestal):
    path = importlib.resources.files('pedestal') / 'samples' / 'acceptance.yaml'
    code, said, _ = pedestal('acceptance', path, *SCENARIO, '--yes')
    assert code == 0, said
