"""`pedestal study` as its user calls it: rows, figures, refusals."""
import functools
import json
import math
import subprocess

import pytest
from shared import PEDESTAL

import pedestal_studies

PNG = b'\x89PNG\r\n\x1a\n'


@pytest.fixture(scope='module')
def studied(tmp_path_factory):
    """studied(name) -> (folder, CompletedProcess) of one run of a study."""
    @functools.cache
    def study(name):
        folder = tmp_path_factory.mktemp(name)
        result = subprocess.run([*PEDESTAL, 'study', name, '--json', 'rows.json'], cwd=folder,
                                stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=200)
        assert result.returncode == 0, result.stderr
        return folder, result
    return study


@pytest.fixture(params=['servo', 'backlash'])
def done(request, studied):
    return request.param, *studied(request.param)


BOUNDS = {
    'servo': {
        ('paper-r1', 'step_overshoot_percent'): (10.5, 13.5), ('paper-r1', 'step_settling_2percent_s'): (0.17, 0.23),
        ('paper-r1', 'step_crossings'): (1, 1), ('paper-r1', 'sine_0p4hz_max_error_rad'): (0.0377, 0.0417),
        ('paper-r1', 'sine_0p4hz_rms_error_rad'): (0.0271, 0.0291),
        ('paper-r1', 'sine_0p4hz_amplitude_rad'): (0.868, 0.8695),
        ('paper-r1', 'sine_0p4hz_period_s'): (2.4999, 2.5001),
        ('paper-r2', 'sine_0p4rads_max_error_rad'): (0.0377, 0.0417),
        ('paper-r2', 'sine_0p4rads_rms_error_rad'): (0.0271, 0.0291),
        ('paper-r2', 'sine_0p4rads_amplitude_rad'): (0.868, 0.8695),
        ('paper-r2', 'step_settling_2percent_s'): (0.24, math.inf),
        ('paper-all', 'step_overshoot_percent'): (10.5, 13.5), ('paper-all', 'step_settling_2percent_s'): (0.17, 0.23),
        ('paper-all', 'step_crossings'): (1, 1), ('paper-all', 'sine_0p4hz_max_error_percent'): (4.3, 4.6),
        ('paper-all', 'sine_0p4hz_peak_error_percent'): (0.0, 0.12),
        ('paper-all', 'sine_0p4hz_rms_error_rad'): (0.0271, 0.0291),
        ('best', 'step_overshoot_percent'): (0.0, 0.5), ('best', 'step_settling_2percent_s'): (0.117, 0.15),
        ('best-inertia-plus', 'step_overshoot_percent'): (0.0, 0.5),
        ('best-inertia-plus', 'step_settling_2percent_s'): (0.117, 0.15),
        ('best-inertia-minus', 'step_overshoot_percent'): (0.0, 0.5),
        ('best-inertia-minus', 'step_settling_2percent_s'): (0.117, 0.15),
        ('best', 'sine_0p4rads_max_error_rad'): (0.0, 5e-5), ('best', 'sine_0p4hz_max_error_rad'): (0.0, 3e-4),
        ('best', 'gust_1000nm_peak_rad'): (1e-4, 3.4e-4)},
    'backlash': {
        ('bias-off', 'standstill_peak_to_peak_rad'): (5e-4, 3e-3),
        ('bias-on', 'standstill_peak_to_peak_rad'): (0.0, 2e-6),
        ('hold-fade', 'standstill_peak_to_peak_rad'): (0.0, 2e-6),
        ('bias-on', 'reversal_ratio_off_to_on'): (30.0, math.inf),
        ('hold-fade', 'sine_residual_rad'): (0.0, 1e-4), ('hold-fade', 'step_overshoot_percent'): (0.0, 2.5)}}
"""Of the rows that issue 3 names; the lower ends of ours are limits of the plant."""


@pytest.mark.thorough
@pytest.mark.parametrize('name, case, metric', [(name, *key) for name, rows in BOUNDS.items() for key in rows])
def test_rows_are_within_their_bounds(studied, name, case, metric):
    content = json.loads((studied(name)[0] / 'rows.json').read_text())
    [value] = [row['value'] for row in content['rows'] if (row['case'], row['metric']) == (case, metric)]
    low, high = BOUNDS[name][case, metric]
    assert low <= value <= high


@pytest.mark.thorough
def test_two_loops_fight_at_rest_where_one_does_not(studied):
    content = json.loads((studied('backlash')[0] / 'rows.json').read_text())
    values = {(row['case'], row['metric']): row['value'] for row in content['rows']}
    for metric in ('fight_torque_rms_nm', 'synchronism_error_rms_rad_s'):
        assert values['independent-loops', metric] > 20.0 * values['mean-speed', metric] > 0.0


@pytest.mark.thorough
def test_what_misses_its_target_is_marked(done):
    from pedestal_results.intervals import missed
    _, folder, result = done
    rows = json.loads((folder / 'rows.json').read_text())['rows']
    assert result.stdout.count('MISSED') == sum(map(missed, rows))


@pytest.mark.thorough
def test_rows_are_written_and_printed_one_a_line(done):
    name, folder, result = done
    content = json.loads((folder / 'rows.json').read_text())
    assert content['name'] == name
    lines = result.stdout.splitlines()
    for row in content['rows']:
        assert set(row) == {'case', 'metric', 'value', 'unit', 'paper', 'target'}
        assert isinstance(row['value'], float), row
        [line] = [line for line in lines if f' {row["case"]} ' in line and f' {row["metric"]} ' in line]
        assert f'{row["value"]:.4g}' in line


@pytest.mark.thorough
def test_a_figure_is_a_png_in_the_default_folder_and_is_named(done):
    name, folder, result = done
    files = sorted((folder / 'studies' / name).iterdir())
    assert len(files) >= 4
    for path in files:
        assert path.read_bytes().startswith(PNG)
        assert path.name in result.stdout


@pytest.mark.thorough
def test_a_pipe_gets_no_progress(done):
    assert done[2].stderr == ''


def test_without_a_name_the_studies_are_listed(pedestal, tmp_path):
    code, output, errors = pedestal('study')
    assert (code, errors) == (0, '')
    for name, line in pedestal_studies.descriptions().items():
        assert name in output and line in output
    assert list(tmp_path.iterdir()) == []


def test_a_misspelt_study_is_guessed(pedestal, tmp_path):
    assert pedestal('study', 'serov') == (2, '', "pedestal: error: unknown study 'serov'; did you mean 'servo'? "
                                          f'there are {", ".join(pedestal_studies.STUDY_NAMES)}\n')
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('option, place', [('--output', 'file/figures'), ('--json', 'nowhere/rows.json'),
                                           ('--json', '.')])
def test_a_place_that_cannot_be_written_is_refused_before_the_work(option, place, pedestal, tmp_path):
    (tmp_path / 'file').write_text('')
    code, output, errors = pedestal('study', 'servo', option, tmp_path / place)
    assert (code, output) == (2, '')
    assert len(errors.strip().splitlines()) == 1 and place.strip('.') in errors
