"""`pedestal.filter`: filterpy's filter, the bits of the control unit, wraps, gaps, rejected rows, wrong arguments."""
import datetime
import math

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import KalmanFilter

import pedestal
from acu_tracker import control_unit, signals
from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.params import FilterParameters, TrackerParameters
from acu_tracker.params import AcuParameters, AxisParameters, ElevationParameters
from acu_tracker.program import program_track
from pedestal import estimate

SIGMA = 0.03    # deg


def measured(count=400, T=0.05, A=(350.0, 1.0), E=(30.0, 0.2), seed=3):
    """(t, azimuth with wraps, elevation): a start and a rate of each axis, with noise across the line of sight."""
    noise = np.random.default_rng(seed).normal(0.0, SIGMA, (2, count))
    t = T * np.arange(count)
    elevation = E[0] + E[1] * t
    return t, (A[0] + A[1] * t + noise[0] / np.cos(np.radians(elevation))) % 360.0, elevation + noise[1]


def test_cv_is_filterpys_kalman_filter():
    """Along the horizon, where the frame of the filter and the earth frame are the same to first order."""
    T, density, rate_sigma = 0.05, 0.1, math.degrees(0.1)
    t, A, E = measured(E=(0.0, 0.0), A=(20.0, 0.8))
    E[0] = 0.0
    made = pedestal.filter(t, A, E, 'cv', sigma=SIGMA, changes={'cv.noise': math.radians(density)})
    oracle = KalmanFilter(2, 1)
    oracle.x, oracle.P = np.array([[A[0]], [0.0]]), np.diag([SIGMA**2, rate_sigma**2])
    oracle.F, oracle.H, oracle.R = np.array([[1.0, T], [0.0, 1.0]]), np.array([[1.0, 0.0]]), np.array([[SIGMA**2]])
    oracle.Q = Q_continuous_white_noise(2, T, density**2)
    expected, trend, variance, calm, short, white, swing = [], 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    for y in A[1:]:
        oracle.predict()
        oracle.update(y)
        # The stated variances grow with the mean of the last innovations, for 0.4 of the gain of the angle. They are
        # smaller while its mean square over 20 s, or 12 / gain, is smaller than that of white innovations.
        nu, S, K = oracle.y.item(), oracle.S.item(), oracle.K[0, 0]
        trend, variance = trend + K / 2.5 * (nu - trend), (1.0 - K / 2.5)**2 * variance + (K / 2.5)**2 * S
        calm += min(T / 20.0, K / 12.0) * (trend**2 / variance - calm)
        factor = min(max(calm, 0.5), 1.0) + 2.0 * max(trend**2 - 2.0 * variance, 0.0) / oracle.P[0, 0]
        # They also grow with a mean of 0.1 s that is larger than the one of white innovations: at once if it is clear,
        # and for 20 s.
        gain = T / 0.1
        short, white = short + gain * (nu - short), (1.0 - gain)**2 * white + (gain * nu)**2
        swing += T / 20.0 * (min(short**2, 40.0 * white) - 1.14 * white - swing)
        more = max(swing, short**2 - 5.0 * white, 0.0) * np.array([1.0, 400.0])
        expected.append((*oracle.x[:, 0], *np.sqrt(factor * np.diag(oracle.P) + more), nu**2 / S))
    for column, wanted in zip(('position', 'rate', 'position_sigma', 'rate_sigma', 'nis'), np.transpose(expected)):
        np.testing.assert_allclose(made[f'azimuth.{column}'][1:], wanted, rtol=2e-5, atol=1e-6, err_msg=column)


@pytest.mark.every_case
@pytest.mark.parametrize('kind', ['imm', 'alpha_beta_gamma'])
def test_the_bits_are_those_of_the_control_unit(kind):
    """A beam in each step of the control unit, with the receiver error 0 at the C/N0 of sigma."""
    t, A, E = measured(T=0.005, A=(150.0, 5.0), E=(60.0, 2.0))
    params = FilterParameters(kind=kind)
    parameters = AcuParameters(azimuth=AxisParameters(filter=params), elevation=ElevationParameters(filter=params),
                               tracker=TrackerParameters(receiver=estimate.UNIT_RECEIVER))
    state, constants = control_unit.initial_state(parameters)[0], control_unit.constants(parameters)[0]
    inputs, outputs = signals.Inputs.zeros()[0], signals.Outputs.zeros()[0]
    inputs['encoder_valid'] = inputs['error_valid'] = inputs['error_came'] = 1
    inputs['range'], inputs['error_rate'] = math.nan, math.nan
    sigma = np.where(np.arange(len(t)) % 2, SIGMA, 1.5 * SIGMA)     # Equal messages would count as repeated.
    cn0_dbhz = estimate.cn0_of(np.radians(sigma))
    made, rows = pedestal.filter(t, A, E, kind, sigma=sigma), []
    for k in range(len(t)):
        inputs['stamp'], inputs['error_stamp'], inputs['cn0_dbhz'] = t[k], t[k], cn0_dbhz[k]
        inputs['position'] = np.radians((A[k], E[k]))
        control_unit.step(state, constants, inputs, outputs, program_track.NO_TABLES)
        rows.append([outputs[name].copy() for name in ('estimate', 'covariance', 'nis')])
    estimated, covariance, nis = (np.array(column) for column in zip(*rows))
    for i, axis in enumerate(('azimuth', 'elevation')):
        assert np.array_equal(made[f'{axis}.nis'], nis[:, i], equal_nan=True)
        assert np.array_equal(made[f'{axis}.rate'], np.degrees(estimated[:, i, 1]))
        assert np.array_equal(made[f'{axis}.position_sigma'], np.degrees(np.sqrt(covariance[:, i, 0])))
    assert np.array_equal(made['elevation.position'], np.degrees(estimated[:, 1, 0]))


@pytest.mark.every_case
@pytest.mark.parametrize('kind', FILTER_KINDS)
def test_every_kind_follows_through_a_wrap_and_a_gap(kind):
    t, A, E = measured()
    kept = (t < 8.0) | (t > 8.9)
    made = pedestal.filter(t[kept], A[kept], E[kept], kind, sigma=np.full(kept.sum(), SIGMA))
    error = made['azimuth.position'] - (350.0 + t[kept])
    assert np.abs(error[200:]).max() < 3.0 * SIGMA and np.sqrt((error[200:]**2).mean()) < 0.8 * SIGMA
    assert np.abs(made['azimuth.measured'] - made['azimuth.position']).max() < 6.0 * SIGMA
    assert made.gaps == [(pytest.approx(8.0, abs=0.06), pytest.approx(8.9, abs=0.06), True)]
    assert made['outcome'].tolist() == ['started'] + ['accepted'] * (kept.sum() - 1)
    assert made.units['azimuth.rate'] == 'deg/s' and all(len(column) == kept.sum() for column in made.values())


def test_long_gaps_outliers_and_a_wrong_sigma_are_reported():
    t, A, E = measured()
    A[100] += 3.0
    kept = (t < 8.0) | (t > 12.0)
    made = pedestal.filter(t[kept], A[kept], E[kept], sigma=SIGMA)
    assert made['outcome'][100] == 'rejected' and (made['outcome'] == 'rejected').sum() == 1
    assert [bridged for *_, bridged in made.gaps] == [False] and made['outcome'][160] == 'started'
    assert '1 rejected' in made.verdict and 'gaps: 1, 0 bridged' in made.verdict
    bridged = pedestal.filter(t[kept], A[kept], E[kept], sigma=SIGMA, gap=10.0)
    assert [bridged for *_, bridged in bridged.gaps] == [True]
    for factor in (1.0, 2.0):
        made = pedestal.filter(t, A, E, sigma=factor * SIGMA)
        mean = [np.nanmean(made[f'{axis}.nis'][made['outcome'] == 'accepted']) for axis in ('azimuth', 'elevation')]
        assert factor**2 * np.array(mean) == pytest.approx(1.0, abs=0.2)
        assert f'azimuth {mean[0]:.2f}, elevation {mean[1]:.2f}, expected 1 +- 0.1' in made.verdict
    panels = made.plot().axes
    assert len(panels) == 6 and all(axes.lines for axes in panels)


@pytest.mark.parametrize('of', [
    lambda t: np.datetime64('2026-11-29T10:00', 'ms') + np.round(1000.0 * t).astype('timedelta64[ms]'),
    lambda t: np.round(1000.0 * t).astype('timedelta64[ms]'),
    lambda t: [datetime.datetime(2026, 11, 29, 10, tzinfo=datetime.timezone.utc) + datetime.timedelta(seconds=second)
               for second in t]], ids=['dates', 'durations', 'datetimes with a zone'])
def test_dates_count_in_seconds_from_the_first(of):
    t, A, E = measured()
    made, of_dates = (pedestal.filter(times, A, E, sigma=SIGMA) for times in (t, of(t)))
    assert of_dates['t'] == pytest.approx(t - t[0], abs=1e-9)
    assert of_dates['azimuth.rate'] == pytest.approx(made['azimuth.rate'], abs=1e-9)


@pytest.mark.every_case
@pytest.mark.parametrize('name, wrong, said', [
    ('t', [0.0, 1.0, 1.0, 2.0], r't = \.\.\. \[1.0, 1.0\] \.\.\.: must be two or more times that increase'),
    ('t', [0.0], 'two or more'), ('t', [0.0, math.inf, 1.0, 2.0], r't\[1\] = inf: must be -1e\+11 to 1e\+11 s'),
    ('t', ['a', 'b', 'c', 'd'], 't = .*must be numbers'), ('t', np.zeros((2, 2)), r't has the shape \(2, 2\)'),
    ('az', [1.0, math.nan, 1.0, 1.0], r'az\[1\] = nan: must be -36000 to 36000 deg'),
    ('az', [1.0, 2.0], r'az has the shape \(2,\): must be \(4,\)'),
    ('el', [1.0, 1.0, 91.0, 1.0], r'el\[2\] = 91: must be -90 to 90 deg'),
    ('sigma', 0.0, r'sigma\[0\] = 0: must be 1e-06 to 5 deg'), ('sigma', [0.1, -1.0, 0.1, 0.1], r'sigma\[1\] = -1'),
    ('sigma', [0.1, 0.1], 'sigma has the shape'), ('gap', 0.0, r'gap\[0\] = 0: must be 1e-09 to 1e\+12 s'),
    ('gap', 'long', 'gap = .*long.*must be numbers'),
    ('kind', 'inm', "kind = 'inm': did you mean 'imm'[?] must be one of alpha_beta, "),
    ('changes', {'imm.dwel': 1.0}, "did you mean 'imm.dwell'"), ('changes', {'imm.dwell': -1.0}, 'dwell = -1')])
def test_wrong_arguments_are_named(name, wrong, said):
    given = {'t': [0.0, 1.0, 2.0, 3.0], 'az': np.ones(4), 'el': np.ones(4), 'sigma': 0.1, name: wrong}
    with pytest.raises(ValueError, match=said):
        pedestal.filter(**given)


ANGLES = 't,az,el\n' + ''.join(f'{0.1 * k:.1f},{(350.0 + k) % 360.0:.2f},{40.0 + 0.01 * k:.2f}\n'
                               for k in range(40) if not 12 <= k < 16)


@pytest.mark.every_case
@pytest.mark.parametrize('kind', ['imm', 'ca'])
def test_the_verb_writes_what_the_library_returns(kind, pedestal, tmp_path):
    (tmp_path / 'angles.csv').write_text(ANGLES)
    code, said, errors = pedestal('filter', 'angles.csv', '--sigma', 0.03, '--kind', kind, '--plot', 'track.png')
    assert code == 0 and 'gap from 1.1 to 1.6 s: bridged' in said and (tmp_path / 'track.png').stat().st_size, errors
    with open(tmp_path / 'angles-filtered.csv') as file:
        names, *rows = [line.strip().split(',') for line in file]
    t, az, el = np.loadtxt(tmp_path / 'angles.csv', delimiter=',', skiprows=1, unpack=True)
    made = estimate.filter(t, az, el, kind, sigma=0.03)
    for column, unit in made.units.items():
        written = [row[names.index(f'{column} [{unit}]' if unit else column)] for row in rows]
        assert written == made[column].tolist() if column == 'outcome' else np.array_equal(
            np.array(written, float), made[column], equal_nan=True)
    assert list(made.to_pandas()['azimuth.position']) == made['azimuth.position'].tolist()


@pytest.mark.every_case
@pytest.mark.parametrize('text, options, error', [
    (ANGLES.replace('40.02', '400.2'), ('--sigma', 0.03), 'line 4: el = 400.2: must be -90 to 90'),
    (ANGLES.replace('40.02', ''), ('--sigma', 0.03), "line 4: el = '': must be a number"),
    (ANGLES.replace('\n0.3', '\n0.1'), ('--sigma', 0.03), 'line 5: t = 0.1: -0.1 s after the row before'),
    (ANGLES.replace('az', 'bearing'), ('--sigma', 0.03), "line 1: column 'azimuth' is missing"),
    (ANGLES, (), 'has no column sigma_deg; give --sigma DEG'),
    (ANGLES, ('--sigma', 9.0), '--sigma 9: must be 1e-06 to 5 deg'),
    (ANGLES, ('--sigma', 0.03, '--plot', 'a.jpg'), '--plot a.jpg: must end with .png, .svg, .pdf'),
    ('', ('--sigma', 0.03), "line 1: column 'time' is missing")])
def test_the_verb_names_what_is_wrong(text, options, error, pedestal, tmp_path):
    (tmp_path / 'angles.csv').write_text(text)
    code, _, errors = pedestal('filter', 'angles.csv', *options)
    assert code and error in errors, errors


def test_units_dates_and_a_sigma_of_each_row(tmp_path):
    file = tmp_path / 'angles.csv'
    file.write_text('utc;az_rad;el_rad;sigma_mrad\n2020-01-01T00:00:01.5;0,5;0,25;1\n2020-01-01T00:00:02.5;0,6;0,25;2\n'
                    '2020-01-01T00:00:02.5;0,6;0,25;2\n')
    found = estimate.read(file)
    assert found.t.tolist() == [1.5, 2.5] and 'passed over 1' in found.description
    assert np.allclose(np.radians([found.azimuth, found.sigma]), [[0.5, 0.6], [0.001, 0.002]])
