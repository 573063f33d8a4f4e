"""Sides of a comparison, criteria of the user, and the search for the value at which a result reaches a limit."""
import json
import math
import re

import numpy as np
import pytest

from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_workbench.trials import comparison, plan, solve, statistics
from pedestal_workbench.trials.table import Table

KIND = 'acu.azimuth.filter.kind'


@pytest.mark.thorough
def test_the_best_of_three_sides_comes_first(pedestal, tmp_path):
    code, said, errors = pedestal('trials', 'uav_flyby', '--runs', 3, '--duration', 6, '--workers', 1, '--json',
                                  'r.json', '--side', 'slow', f'{KIND}=alpha_beta', '--side', 'ca', f'{KIND}=ca',
                                  '--require', 'pointing_max_deg < 1', '--require', 'pointing_max_deg > 1')
    assert (code, errors) == (0, '')
    rows = json.loads((tmp_path / 'r.json').read_text())['rows']
    means = {row['case']: row['value'] for row in rows if row['metric'] == 'pointing_rms_deg/mean'}
    order = sorted(means, key=lambda case: means[case])
    short = KIND.partition('.')[2]
    named = {'base': f'base ({short}=imm)', 'ca': f'ca ({short}=ca)', 'slow': f'slow ({short}=alpha_beta)'}
    lines = said.splitlines()
    for line, other in zip(lines, order[1:]):
        assert line.startswith(f'{named[order[0]]} is ') and f' than {named[other]}' in line
    assert [line for line in lines if 'in 3 of 3 trials' in line] == [
        f'{case}: pointing_max_deg < 1 in 3 of 3 trials, 100 % (29.24 to 100 %)' for case in order]
    table = [line.split()[:2] for line in lines if line.startswith((' pointing_rms_deg ', ' pointing_max_deg '))]
    assert table == [[metric, case] for metric in ('pointing_rms_deg', 'pointing_max_deg') for case in order]
    assert ' azimuth_nis_mean' not in said
    assert all(len(line) <= 80 for line in lines if line.startswith(' ') and 'pedestal run' not in line)
    worst = [line.split(' by ')[0] for line in lines if line.startswith('the worst trials')]
    assert worst == [f'the worst trials of {side}' for side in order]
    assert sum('pedestal run uav_flyby --seed' in line for line in lines) == 9
    assert {row['value'] for row in rows if row['metric'] == 'require(pointing_max_deg > 1)/rate'} == {0.0}
    assert {file.name for file in (tmp_path / 'trials' / 'uav_flyby').glob('*.csv')} == {
        'trials.csv', 'side_slow.csv', 'side_ca.csv'}
    page = (tmp_path / 'trials' / 'uav_flyby' / 'trials.html').read_text()
    assert f'{named[order[0]]} is ' in page and 'in 3 of 3 trials' in page


@pytest.mark.thorough
def test_sides_with_the_same_parameters_are_named_so(pedestal):
    """One sentence for a pair of sides: imm and program are the values that uav_flyby has anyway."""
    code, said, errors = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 3, '--workers', 1,
                                  '--against-param', f'{KIND}=imm')
    assert (code, errors) == (0, '')
    assert said.splitlines()[0] == f'Both sides have the same parameters: {KIND}=imm changes nothing.'
    plans = [plan.plan(Variant('uav_flyby', overrides), 2, ['adu.azimuth.load.inertia=normal(1, 0.1)x'])
             for overrides in ((), (f'{KIND}=ca',), (f'{KIND}=ca', 'acu.initial_mode=program'))]
    assert comparison.unchanged(plans[0], plans[0]) == 'Both sides have the same parameters.'
    assert comparison.unchanged(plans[0], plans[1]) == ''
    assert comparison.unchanged(plans[1], plans[2]) == (
        'Both sides have the same parameters: acu.initial_mode=program changes nothing.')


def test_a_trial_without_the_result_does_not_meet_a_requirement(tmp_path):
    with Table(tmp_path, 'trials', {}, [], ['pointing_max_deg'], ['why']) as table:
        table.append([[i, i, value, 'tripped: at once' if value is None else '']
                      for i, value in enumerate((0.05, None, 0.2, 0.1))])
    required = statistics.requirement('pointing_max_deg<=0.1', table.results)
    row, = statistics.of_requirements('case', table, [required])
    assert (row['metric'], row['value'], row['runs']) == ('require(pointing_max_deg <= 0.1)/rate', 50.0, 4)
    mean = statistics.of_results('case', table)[0]
    assert statistics.coverage(mean) == '3 of 4, 1 tripped'
    assert (row['of'], row['left_out']) == (4, {'tripped': 1})
    assert statistics.failures(table) == '1 of 4 runs failed: 1 tripped; column `why` of the table'


def test_sides_are_named_with_their_sensitivities_and_missing_results(pedestal):
    """No trial ashore has an isolation."""
    code, said, errors = pedestal('trials', 'uav_flyby', '--runs', 4, '--duration', 3, '--workers', 1, '--vary',
                                  f'{KIND}=choice(imm, alpha_beta)', '--sobol', '--side', 'windy',
                                  'adu.wind.field.speed=8', '--side', 'storm',
                                  'adu.wind.field.speed=20', '--require', 'isolation_db > 20')
    assert (code, errors) == (0, '')
    for side in ('base', 'windy', 'storm'):
        found = [line for line in said.splitlines() if line.startswith(f'{side}') and f'eta_squared({KIND}): ' in line]
        assert len(found) == 1, said
        assert re.search(rf'^{side}\b.*: isolation_db > 20 in 0 of 4 trials, 0 % .*; without the result: 4 not '
                         'measured', said, re.MULTILINE), said


def test_a_side_without_a_change_names_the_base(pedestal, tmp_path):
    code, said, errors = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 3, '--workers', 1, '--side',
                                  'windy', 'adu.wind.field.speed=8', '--side', 'calm', '--json', 'r.json')
    assert (code, errors) == (0, '')
    assert re.match(r'(calm|windy) \(wind\.field\.speed=\d\) is ', said)
    cases = {row['case'] for row in json.loads((tmp_path / 'r.json').read_text())['rows']}
    assert cases == {'calm', 'windy', 'calm against windy'}
    alone = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 3, '--workers', 1, '--side', 'calm')
    assert alone[0] == 0 and 'against' not in alone[1] and 'the worst trials by pointing_rms_deg:' in alone[1]


@pytest.mark.parametrize('columns, shown', [('80', False), ('150', True)])
def test_a_table_fits_the_terminal_and_says_what_it_leaves_out(pedestal, monkeypatch, columns, shown):
    monkeypatch.setenv('COLUMNS', columns)
    _, said, _ = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 3, '--workers', 1, '--side', 'calm',
                          '--side', 'windy', 'adu.wind.field.speed=8')
    tables = [line for line in said.splitlines() if line.startswith(' ') and 'pedestal run' not in line]
    assert max(map(len, tables)) <= int(columns) and any('95 % interval' in line for line in tables)
    assert any(' median ' in line for line in tables) == shown
    assert ('not shown for lack of space: ' in said and 'COLUMNS=150' in said) != shown


def test_a_program_track_is_ranked_by_its_own_pointing(pedestal):
    _, said, _ = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 5, '--workers', 1, '--param',
                          'acu.tracker.handover=false', '--side', 'off', 'scenario.program.azimuth_offset=0.01')
    assert said.startswith('base (program.azimuth_offset=0.003) is better than off (program.azimuth_offset=0.01) by a '
                           'factor of 2.')
    assert 'the worst trials of off by program_pointing_rms_deg:' in said


def test_a_side_without_some_trials_is_compared_over_the_common_ones(tmp_path):
    tables = [Table(tmp_path, name, {}, [], ['pointing_rms_deg']) for name in 'ab']
    for table, values in zip(tables, ((0.1, 0.2, 0.3, 0.4), (0.05, 0.1, 0.2, None))):
        with table:
            table.append([[i, i, value] for i, value in enumerate(values)])
    found = comparison.sentence(comparison.Sides('A', 'B', *tables), 'pointing_rms_deg')
    assert found.startswith('B is better than A by ') and '3 of 4 pairs' in found


def test_a_search_names_the_value_at_which_the_target_is_lost():
    """And states it before the values without a result."""
    def law(value):
        return value if value < 5.5 else math.nan

    rig = Rig(law)
    rig.mean_loss = 3.14
    assert re.fullmatch(r'.* trials; at [\d.]+ the target is lost for 3.14 s of a run; most trials have no '
                        r'pointing_rms_deg from 6 to 8', rig.run().sentence)
    rig = Rig(law)
    rig.mean_loss = 0.0     # a run begins without a lock, which is no loss
    assert 'lost' not in rig.run().sentence


class Rig(solve.Search):
    """A Search over a law instead of trials: law(value) -> mean, NaN without a result."""

    def __init__(self, law, low=0.0, high=8.0, limit=2.0, whole=False):
        wanted = solve.Range('adu.wind.field.speed', low, high, whole, 'm/s')
        super().__init__(None, wanted, solve.Goal('pointing_rms_deg', limit), None, None)
        self.law, self.mean_loss = law, None

    def _try(self, values):
        found = [solve.Tried(value, {'value': self.law(value), 'runs': 3, 'of': 3, 'left_out': {},
                                     'mean_loss_s': self.mean_loss}, '', math.isfinite(self.law(value)))
                 for value in values]
        self.tried = sorted((*self.tried, *found), key=lambda one: one.value)
        return found


def test_the_value_at_which_a_law_reaches_the_limit_is_found():
    for low, high in ((0.0, 8.0), (0.01, 80.0)):
        found = Rig(lambda x: 0.5 * x * x, low, high).run()
        assert found.value == pytest.approx(2.0, rel=2.0 * solve.BRACKET_TOLERANCE)
        assert found.sentence.startswith('adu.wind.field.speed = 2')
        assert 'pointing_rms_deg = 2 is reached between ' in found.sentence
    assert Rig(lambda x: 10.0 - x, limit=4.4, whole=True).run().value in (5, 6)


def test_a_limit_that_is_not_reached_or_not_steadily_is_told_with_the_values():
    never = Rig(lambda x: 0.1 * x if x < 5.5 else math.nan).run()
    assert math.isnan(never.value) and len(never.tried) > solve.GRID_COUNT
    assert 'is not reached for adu.wind.field.speed from 0 to 8 m/s: the mean is 0 at 0 to 0.5' in never.sentence
    *_, (last, first) = [pair for pair in zip(never.tried, never.tried[1:]) if pair[0].measured != pair[1].measured]
    assert last.value < 5.5 <= first.value <= last.value * (1.0 + 1.5 * solve.BRACKET_TOLERANCE)
    assert never.sentence.endswith(f'most trials have no pointing_rms_deg from {first.value:.4g} to 8')
    unsteady = Rig(lambda x: 2.0 + math.sin(x)).run()
    assert math.isnan(unsteady.value)
    assert 'is not reached steadily: between 3 and 4, between 6 and 7' in unsteady.sentence
    hidden = Rig(lambda x: x if x < 5.5 else math.nan, limit=5.2).run()     # between the last grid value and the edge
    assert hidden.value == pytest.approx(5.2, rel=solve.BRACKET_TOLERANCE)
    gap = Rig(lambda x: x if abs(x - 2.5) > 0.1 else math.nan, limit=2.5).run()
    assert math.isnan(gap.value) and 'is not reached steadily: between 2 and 3' in gap.sentence


def test_a_range_is_that_of_the_parameter_or_given():
    chosen = scenario.load('leo_pass')
    whole = solve.search_range('adu.wind.field.speed', chosen)
    assert (whole.low, whole.unit) == (0.0, 'm/s') and math.isfinite(whole.high)
    given = solve.search_range('acu.tracker.lock_count=10:200', chosen)
    assert given == solve.Range('acu.tracker.lock_count', 10.0, 200.0, True, '')


def test_a_search_through_the_command_line(pedestal, tmp_path):
    """The noise of a receiver falls with its level, so the level of a given noise is found; it says what it tried."""
    code, said, errors = pedestal('trials', 'uav_flyby', '--runs', 2, '--duration', 3, '--workers', 1, '--json',
                                  's.json', '--solve', 'tracking_receiver.receiver.cn0_dbhz=30:80', '--until',
                                  'single_sample_noise_deg = 0.02')
    assert (code, errors) == (0, '')
    found = json.loads((tmp_path / 's.json').read_text())
    nominal = scenario.load('uav_flyby').node_parameters('tracking_receiver')
    at_nominal = 0.03     # the single-sample noise that the scenario states
    expected = nominal.receiver.cn0_dbhz + 20.0 * np.log10(at_nominal / 0.02)
    assert found['value'] == pytest.approx(expected, abs=1.5)
    assert said.startswith(f'tracking_receiver.receiver.cn0_dbhz = {found["value"]:.4g} dB-Hz: ')
    assert '0 of 2, 2 never locked' in said
    assert len(found['rows']) == len(list((tmp_path / 'trials' / 'uav_flyby').glob('solve_*.csv')))
