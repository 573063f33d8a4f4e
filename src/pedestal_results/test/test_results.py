"""The table of results: what a run is measured by stands in it once, and only there."""
import collections
import dataclasses
import math
import pathlib

import numpy as np
import pytest

from pedestal import console
from pedestal_recording import bag
from pedestal_results import consistency, results, tracking
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.again import what_if

REFERENCES = pathlib.Path(__file__).parents[3] / 'bags' / 'reference'


@pytest.mark.parametrize('table', [results.RESULTS, what_if.COMPARISON_RESULTS], ids=['results', 'old against new'])
def test_a_name_stands_once_with_a_sentence(table):
    documented = results.documented(table)
    assert len({name for name, *_ in documented}) == len(table) == len(documented)
    assert all(sentence.endswith('.') and '\n' not in sentence for _, _, sentence, _ in documented)


def test_the_parts_of_a_recording_decide_its_rows():
    """Ashore there is neither isolation nor an INS; a row's unit and target are those of the table."""
    ashore, ship = (results.measured(RecordedRun(bag.read(REFERENCES / name)).parts)
                    for name in ('leo_pass', 'ship_pass'))
    kinds = {name: results.RESULT_BY_NAME[name].part for name in ship}
    assert set(kinds.values()) == {'motors', 'encoders', 'tracking', 'filter', 'attitude'}    # no isolation: too short
    assert list(ashore) == [name for name in ship if kinds[name] != 'attitude']
    rows = results.rows('leo_pass', {**ashore, 'loss_s': (math.nan, 's')})
    assert [(row['metric'], row['unit'], row['target']) for row in rows] == [
        (result.name, result.unit, result.target) for result in results.RESULTS if result.name in ashore]
    assert {row['metric'] for row in rows if row['value'] is None} == {'loss_s'}


def test_a_title_is_no_markup(capsys):
    console.show_results('run: [/bold] [red]', [''], [{'x': (1.0, 'deg')}], {'lost_steps': (53093.0, 'of 120012')})
    printed = capsys.readouterr().out
    assert 'run: [/bold] [red]' in printed
    assert [line.split() for line in printed.splitlines() if 'lost_steps' in line] == [
        ['\u2502', 'lost_steps', '\u2502', '53,093', '\u2502', 'of', '120012', '\u2502']]


def test_a_number_has_four_digits(capsys):
    values = {'pointing_rms_deg': (0.0082486612, 'deg'), 'messages': (1299965.0, 'messages'),
              'loss_s': (math.nan, 's')}
    console.show_results('run', [''], [values], {})
    cells = [[cell.strip() for cell in line.split('\u2502')[1:4]] for line in capsys.readouterr().out.splitlines()
             if '\u2502' in line]
    assert cells == [['pointing_rms_deg', '0.008249', 'deg'], ['messages', '1,299,965', 'messages'],
                     ['loss_s', 'not measured', 's']]


def test_every_result_has_a_unit_and_a_sentence(capsys):
    assert all(result.unit for table in (results.RESULTS, what_if.COMPARISON_RESULTS) for result in table)
    console.explain(results.RESULTS, {'loss_s', 'lost_steps'})
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ['loss_s', 'lost_steps']


@pytest.mark.parametrize('mean, expected, band, said', [
    (1.05, 1.0, (0.99, 1.01), ''), (1.3, 1.0, (0.6, 1.6), ''), (1.3, 1.0, (0.9, 1.1), 'too sure'),
    (1.3, 2.0, (1.8, 2.2), 'too careful'), (math.nan, 2.0, (math.nan, math.nan), '')])
def test_what_marks_a_filter(mean, expected, band, said):
    """More than chance explains, and more than a tenth."""
    assert consistency.mark(mean, expected, band) == said


def test_a_filter_that_is_off_is_marked_in_the_table(capsys):
    off = {name: (2.0, '-') for name in ('azimuth_nis_mean', 'elevation_nis_mean')}
    console.show_results('run', ['beam_1', 'beam_2'], [off, off], {}, [{}, {'elevation_nis_mean': 'too sure'}])
    lines = capsys.readouterr().out.splitlines()
    assert ['too sure' in line for line in lines if '_nis_mean' in line] == [False, True]
    assert any('beam_2: too sure' in line for line in lines)
    leo = RecordedRun(bag.read(REFERENCES / 'leo_pass')).parts
    judged = leo['filter'].axes
    assert ('azimuth_nees_mean' in results.marks(leo)) == bool(
        consistency.mark(judged[0].nees, consistency.NEES_FREEDOMS, judged[0].nees_band))


def test_the_eight_results_come_first_and_others_fill_their_places():
    leo = results.measured(RecordedRun(bag.read(REFERENCES / 'leo_pass')).parts)
    # The results of the part `receiver` take the place of the true ones in a run without truth.
    flagged = [result.name for result in results.RESULTS if result.brief and result.part != 'receiver']
    assert len(flagged) == results.BRIEF_COUNT
    run = {'lost_steps': (0.0, 'steps'), 'messages': (4.0, 'messages')}
    assert results.brief([leo, run]) == flagged
    lost = {name: (math.nan if name in flagged else value, unit) for name, (value, unit) in leo.items()}
    filled = results.brief([lost, run])
    assert len(filled) == results.BRIEF_COUNT and filled[0] == 'azimuth_following_rms_deg'
    assert 'lost_steps' in filled and 'pointing_rms_deg' not in filled


def test_the_loss_at_half_a_beamwidth_is_half_of_the_power():
    run = tracking.read(bag.read(REFERENCES / 'leo_pass'))
    on = np.flatnonzero(run.tracking)
    off = np.zeros(run.t.size)
    off[on[len(on) // 2:]] = 0.5 * run.beamwidth
    for error, loss in ((np.full(run.t.size, 0.5 * run.beamwidth), (3.01, 3.01)),
                        (off, (10.0 * math.log10(1.0 / 0.75), 3.01)), (np.zeros(run.t.size), (0.0, 0.0))):
        for swapped in (False, True):
            first, second = (np.zeros(run.t.size), error)[::-1 if swapped else 1]
            moved = dataclasses.replace(run, error=np.column_stack((first, second)))
            assert (moved.mean_power_loss, moved.max_power_loss) == pytest.approx(loss, abs=0.02)
    assert math.isnan(dataclasses.replace(run, tracking=np.zeros(run.t.size, bool)).mean_power_loss)
    assert math.isnan(dataclasses.replace(run, beamwidth=math.nan).max_power_loss)


def test_the_exported_pointing_error_is_that_of_the_results():
    recorded = RecordedRun(bag.read(REFERENCES / 'leo_pass'))
    table, run = recorded.pointing_errors, recorded.tracking
    assert np.array_equal(table['true.cross_elevation [rad]'], run.error[:, 0])
    assert np.array_equal(table['true.elevation [rad]'], run.error[:, 1])
    across = table['true.azimuth [rad]'] * np.cos(run.encoders[:, 1])
    assert np.allclose(across, run.error[:, 0], rtol=1e-12, atol=0.0)
    # The receiver measures the true error with its noise.
    assert 0.5 < np.corrcoef(table['measured.elevation [rad]'][run.since], run.measured[run.since, 1])[0, 1] <= 1.0
    assert len(table['stamp [ns]']) == len(run.t) and table['stamp [ns]'][1] == round(run.t[1] * 1e9)


def test_a_recorded_run_decodes_each_topic_once(monkeypatch):
    decoded = collections.Counter()

    def counted(method):
        def decode(self, topic):
            decoded[method.__name__, topic] += 1
            return method(self, topic)
        return decode
    for method in (bag.Bag.table, bag.Bag.messages):
        monkeypatch.setattr(bag.Bag, method.__name__, counted(method))
    run = RecordedRun(bag.read(REFERENCES / 'ship_pass'))
    run.check_stamps()
    assert run.parts and run.verdict and run.events and run.statuses and run.motors and run.raw_angles.size
    assert {('table', 'joint_states'), ('messages', 'diagnostics')} <= set(decoded)
    assert set(decoded.values()) == {1}
