"""The study structure: one of its cells in the loop, and its rows."""
import numpy as np
import pytest

from acu_tracker.params import AcuParameters
from pedestal_studies.result import FIRST_SEED
from pedestal_studies.system import structure as study


def test_the_default_holds_what_the_filter_before_held_and_all_models_lose(monkeypatch):
    """Half of the inertia at 8 Hz in gusts, 25 s: a control unit that takes its axes for rigid follows the swing with
    all its models, and diverges."""
    own = study.CASES['leo_pass/8Hz-0.4-gusts/default'].with_(
        [f'adu.{axis}.structure.inertia_share=0.5' for axis in ('azimuth', 'elevation')])
    monkeypatch.setattr(study, 'CASES', {
        'default': own, 'before': own.with_(study.FILTER_PARAMETERS['before']),
        'all models': own.with_([f'acu.{axis}.structure.inertia_share=0' for axis in ('azimuth', 'elevation')])})
    found = {name: study.tracked(name, 0) for name in study.CASES}
    assert found['default'][0] == found['before'][0] == 100.0 and found['all models'][0] < 20.0
    assert found['default'][1] < 0.07 and found['default'][1] <= study.MAX_POINTING_RATIO * found['before'][1]


@pytest.mark.parametrize('place, seed', [('leo_pass/14Hz-0.2-gusts', 4), ('ship_pass/20Hz-0.2-gusts', 9)])
def test_a_dish_that_swings_in_gusts_is_no_wrong_slope(place, seed):
    """The sums about the program took the swing of the dish for a wrong slope."""
    assert study.tracked(f'{place}/default', seed - FIRST_SEED)[0] == 100.0


@pytest.mark.thorough
@pytest.mark.parametrize('place', sorted({name.rpartition('/')[0] for name in study.CASES
                                          if any(f'/{cell}-' in name for cell in (
                                              *(f'{hz}Hz-{share}' for hz in (6, 8, 20) for share in (0.1, 0.4)),
                                              '11Hz-0.2', '14Hz-0.1'))}))
def test_no_cell_is_worse_than_before(place):
    default, before = (np.array([study.tracked(f'{place}/{name}', run) for run in range(2)])
                       for name in ('default', 'before'))
    if np.all(before[:, 0] == 100.0):
        assert np.all(default[:, 0] == 100.0)
        assert default[:, 1].mean() <= study.MAX_POINTING_RATIO * before[:, 1].mean()


def test_cases_declare_the_structure_in_the_drive_alone():
    """The control unit has it from there."""
    acu: AcuParameters = study.CASES['ship_pass/11Hz-0.1-calm/default'].load().node_parameters('acu')
    assert acu.azimuth.structure.frequency == acu.elevation.structure.frequency == 11.0
    assert acu.elevation.structure.inertia_share == 0.1


def test_rows_judge_the_runs_that_the_filter_before_held():
    held, lost = [[100.0, 0.02], [100.0, 0.04], [100.0, 0.02]], [[100.0, 0.02], [100.0, 0.05], [5.0, np.nan]]
    values = {'a/8Hz-0.1-calm/default': np.array(held) * [1.0, 0.5],
              'b/8Hz-0.1-calm/default': np.array(held) * [1.0, 2.0],
              'a/8Hz-0.4-calm/default': np.array(lost), 'a/9Hz-0.4-calm/default': np.array(lost)}
    values |= {name.replace('default', 'before'): np.array(held) for name in values}
    values['a/9Hz-0.4-calm/before'] = np.array([[0.0, np.nan]] * 3)
    table = {(row['case'], row['metric']): row for row in study.rows(values)}
    assert [table[case, 'lost_runs']['value'] for case in (
        'a/8Hz-0.1-calm/default', 'a/8Hz-0.4-calm/default', '8Hz-0.4-calm', '9Hz-0.4-calm', 'all')] == [0, 1, 1, 0, 1]
    assert [table[case, 'held_runs']['value'] for case in ('8Hz-0.1-calm', '9Hz-0.4-calm', 'all')] == [6, 0, 9]
    for case, value, runs in (('a/8Hz-0.1-calm/default', 0.5, 3), ('8Hz-0.1-calm', 1.25, 6)):
        ratio = table[case, 'pointing_to_before']
        assert (ratio['value'], ratio['target'], ratio['runs']) == (value, '<= 1.05', runs)
    assert ('8Hz-0.4-calm', 'pointing_to_before') not in table and ('9Hz-0.4-calm', 'pointing_to_before') not in table
    assert table['all', 'compared']['value'] == table['all', 'above_limit']['value'] == 1
