"""The accuracy that an alignment states, on the sea of the study `alignment`, and its price of speed."""
import json
import math

import numpy as np
import pytest

from pedestal_studies.p001_zhou_yang_qin import aligned_runs, alignment, methods

RUNS = 30


@pytest.fixture(scope='module')
def on_swell():
    """[(Increments, attitude at the start)] of RUNS runs on swell."""
    return [aligned_runs.simulated_run(aligned_runs.Batch('swell', 0, RUNS), run) for run in range(RUNS)]


@pytest.mark.thorough
@pytest.mark.parametrize('method', ['adrc', 'riccati_eso'])
def test_the_stated_sigma_is_honest_on_swell_without_log_or_gnss(on_swell, method):
    """Rms over the runs of the error in azimuth over its 1 sigma, from 150 s on: within a factor of 1.3 of 1."""
    constants = methods.constants(aligned_runs.INS_PARAMETERS, method,
                                  math.radians(aligned_runs.SHIP_PARAMETERS.latitude_deg))
    every, ratios = round(aligned_runs.EVALUATION_PERIOD_S / aligned_runs.IMU_PERIOD_S), []
    for (angle, force, attitude), start in on_swell:
        estimates = np.zeros(len(angle) // every, aligned_runs.AlignmentEstimate.dtype)
        aligned_runs.align(methods.initial_state(constants, start), constants, angle, force,
                           aligned_runs.IMU_PERIOD_S, every, estimates)
        error = aligned_runs.errors(estimates['quaternion'], attitude[every - 1::every])[:, 2]
        ratios.append(error / estimates['azimuth_sigma'])
    ratio = np.sqrt(np.mean(np.square(ratios), axis=0))
    shown = {t: round(float(alignment.value_at(ratio, t)), 2) for t in (150, 200, 250, 300)}
    print(f'{method}: error over its 1 sigma {shown}')
    assert all(1.0 / 1.3 < value < 1.3 for value in shown.values())


@pytest.mark.thorough
def test_higher_bandwidths_level_faster_and_less_precisely(pedestal, tmp_path):
    """Zhou 2011, section 6. White noise of the velocity: the noise of the tilt grows with the bandwidth^1.5."""
    code, _, errors = pedestal('study', 'alignment-speed', '--runs', 4, '--workers', 1, '--json', 'rows.json')
    assert (code, errors) == (0, '')
    values = {(row['case'], row['metric']): row['value']
              for row in json.loads((tmp_path / 'rows.json').read_text())['rows']}
    level = [values[f'adrc/{speed}', 'level_rms_arcmin'] for speed in ('0.5', '1', '2', '4')]
    settled = [values[f'adrc/{speed}', 'level_settling_s'] for speed in ('0.5', '1', '2', '4')]
    assert settled == sorted(settled, reverse=True) and level == sorted(level)
    assert level[3] / level[1] == pytest.approx(4.0**1.5, rel=0.15)
    assert values['adrc/4', 'time_to_12arcmin_rms_s'] > 0.25 * values['adrc/1', 'time_to_12arcmin_rms_s']
