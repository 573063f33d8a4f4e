"""`pedestal study servo|backlash|bode --scenario`: your own plant, through the command line and against the tuned
antennas."""
import json
import math

import pytest

from pedestal_bringup.scenario.variant import Variant
from pedestal_studies import plant_studies
from pedestal_workbench.tuning import loops


def values(path):
    return {(row['case'], row['metric']): row['value'] for row in json.loads(path.read_text())['rows']}


@pytest.mark.thorough
def test_the_loops_of_a_tuned_antenna_have_their_margins(pedestal, tmp_path):
    code, output, errors = pedestal('study', 'bode', '--scenario', 'ship_terminal_1m2', '--json', 'rows.json')
    assert (code, errors) == (0, '')
    found = values(tmp_path / 'rows.json')
    for axis in loops.AXES:
        assert found[f'speed/{axis}', 'phase_margin_deg'] >= 45.0 and found[f'speed/{axis}', 'gain_margin_db'] >= 6.0
        assert found[f'position/{axis}', 'phase_margin_deg'] >= 45.0
    assert (tmp_path / 'studies' / 'bode' / 'speed.png').stat().st_size > 10_000


@pytest.mark.thorough
def test_a_plant_steps_is_pushed_and_follows_a_sine(pedestal, tmp_path):
    """The step settles without overshoot; a gust moves the dish less than it would a free one within 0.1 s."""
    code, output, errors = pedestal('study', 'servo', '--scenario', 'leo_station_7m', '--json', 'rows.json')
    assert (code, errors) == (0, '')
    found = values(tmp_path / 'rows.json')
    plants = loops.Loops(Variant('leo_station_7m')).plants
    for axis in loops.AXES:
        own = {metric: value for (case, metric), value in found.items() if case == f'leo_station_7m/{axis}'}
        assert own['step_overshoot_percent'] < 1.0 and 0.05 < own['step_settling_2percent_s'] < 1.0
        free = 0.5 * own['gust_torque_nm'] / plants[axis].whole_inertia * 0.1**2
        assert 0.0 < own['gust_peak_rad'] < free
        assert 0.0 < own['sine_rms_error_rad'] < 1e-3 * plant_studies.SINE_AMPLITUDE_RAD
    assert sorted(path.name for path in (tmp_path / 'studies' / 'servo').iterdir()) == ['gust.png', 'sine.png',
                                                                                       'step.png']


@pytest.mark.thorough
def test_bias_takes_the_backlash_out_of_a_plant(pedestal, tmp_path):
    """With its bias an axis stands within steps of its encoder and reverses better; without it the load is loose in
    the lash."""
    code, output, errors = pedestal('study', 'backlash', '--scenario', 'leo_station_7m', '--json', 'rows.json')
    assert (code, errors) == (0, '')
    found = values(tmp_path / 'rows.json')
    plants = loops.Loops(Variant('leo_station_7m')).plants
    for axis in loops.AXES:
        case, step = f'leo_station_7m/{axis}', 2.0 * math.pi / 2**plants[axis].axis.encoder.load_bits
        assert found[case, 'standstill_peak_to_peak_rad'] < 2.0 * step
        assert found[case, 'reversal_error_rad'] < found[f'{case}/bias-off', 'reversal_error_rad']
        assert found[case, 'lash_rad'] == plants[axis].axis.gear_train.lash
    assert sorted(path.name for path in (tmp_path / 'studies' / 'backlash').iterdir()) == ['sine.png',
                                                                                          'standstill.png']


@pytest.mark.parametrize('arguments, expected', [
    (('pareto', '--scenario', 'leo_pass'),
     'study pareto has the plant of the papers; must be one of backlash, bode, servo'),
    (('bode', '--scenario', 'phased_array_sway'), 'an electronic beam has no loops'),
    (('bode', '--scenario', 'leo_pass', '--runs', '3'), '--runs: does not go with --scenario'),
    (('servo', '--scenario', 'leo_pas'), "did you mean 'leo_pass'?")])
def test_refused(pedestal, arguments, expected):
    code, output, errors = pedestal('study', *arguments)
    assert (code, output) == (2, '') and expected in errors and errors.count('\n') == 1
