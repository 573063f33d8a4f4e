"""NIS and NEES of a recording against simulated filters of known consistency."""
import math

import numpy as np
import pytest
from scipy import signal, stats
from scipy.spatial.transform import Rotation

from acu_tracker.estimation.filters import motion_models
from acu_tracker.estimation.filters.measurement import error_variance
from acu_tracker.estimation.params import ReceiverModelParameters
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_common.parameters import build, record
from pedestal_results import consistency, results
from pedestal_results.recorded_run import RecordedRun
from tracking_receiver_sim import receiver, target
from tracking_receiver_sim.params import SMOOTHING_KINDS, TrackingReceiverParameters


def correlated(rng, n, size, memory):
    """A stationary Gaussian series (n, size) of unit variance, each sample remembering this much of the last."""
    noise = rng.standard_normal((n, size))
    noise[1:] *= math.sqrt(1.0 - memory * memory)
    return signal.lfilter([1.0], [1.0, -memory], noise, axis=0)


def made(rng, factor, n=6000, memory=0.98, freedoms=1):
    """A Consistency whose errors are `factor` times what it states."""
    sigma, rate_sigma, correlation = 2e-4, 3e-3, 0.6
    root = np.linalg.cholesky([[sigma**2, correlation * sigma * rate_sigma],
                               [correlation * sigma * rate_sigma, rate_sigma**2]])
    errors = [factor * correlated(rng, n, 2, memory) @ root.T for _ in range(2)]
    error, rate_error = (np.column_stack([axis[:, i] for axis in errors]) for i in range(2))
    nu = factor * rng.standard_normal((n, 2, freedoms))
    full = np.ones((n, 2))
    a, b = error / sigma, rate_error / rate_sigma
    nees = (a * a - 2.0 * correlation * a * b + b * b) / (1.0 - correlation**2)
    return consistency.Consistency(
        0.005 * np.arange(n), nu[..., 0], nu[..., -1] if freedoms == 2 else full * math.nan, (nu * nu).sum(axis=2),
        full * sigma, full * rate_sigma, full * correlation, np.full((n, 2, 4), 0.25), error, rate_error, nees,
        np.arange(n) > 100)


@pytest.mark.parametrize('factor, words', [(1.0, 'consistent:'), (2.0, 'too sure:'), (0.5, 'too careful:')])
@pytest.mark.parametrize('freedoms', [1, 2])
def test_a_filter_is_what_it_was_made(factor, words, freedoms):
    found = made(np.random.default_rng(1), factor, freedoms=freedoms)
    low, high = stats.chi2.ppf((0.025, 0.975), freedoms)
    for i in range(2):
        judged = found.axes[i]
        assert judged.verdict.startswith(words)
        assert judged.nis == pytest.approx(freedoms * factor**2, rel=0.05)
        assert judged.nis_expected == freedoms
        assert judged.nis_inside == pytest.approx(
            np.diff(stats.chi2.cdf(np.array([low, high]) / factor**2, freedoms))[0], abs=0.01)
        assert judged.nees == pytest.approx(2.0 * factor**2, rel=0.35)
    values = results.measured({'filter': found})
    assert values['azimuth_nis_mean'] == (found.axes[0].nis, '-')
    assert values['elevation_nees_mean'] == (found.axes[1].nees, '-')
    said = {1.0: None, 2.0: 'too sure', 0.5: 'too careful'}[factor]
    assert {results.marks({'filter': found}).get(f'{axis}_{name}_mean') for axis in ('azimuth', 'elevation')
            for name in ('nis', 'nees')} == {said}


@pytest.mark.parametrize('factor, n, said', [
    (1.0, 6000, []), (1.15, 6000, []), (0.85, 6000, []), (2.0, 6000, ['too sure', 'sigma_floor']), (2.0, 1900, []),
    (0.5, 6000, ['too careful', 'noise_bandwidth'])])
def test_a_line_on_the_filter_needs_much_data_and_has_a_cure(factor, n, said):
    """Errors of 0.85 to 1.15 times the stated ones are a healthy run, and 9 s are too little data."""
    found = made(np.random.default_rng(1), factor, n=n)
    lines = consistency.remarks(found)
    assert len(lines) == bool(said) and all(text in lines[0] for text in said)
    if n < 2000:
        assert found.axes[0].verdict.startswith('not judged: 8.99 s evaluated, 10 s are needed')
        assert results.marks({'filter': found}) == {}


@pytest.mark.parametrize('factor, said', [(2.0, ['too sure', 'pedestal tune SCENARIO --filter KIND']), (0.5, [])])
def test_errors_without_such_innovations_are_those_of_the_motion_model(factor, said):
    found = made(np.random.default_rng(1), factor)
    found.nis = found.nis / factor**2
    lines = consistency.remarks(found)
    assert len(lines) == bool(said) and all(text in lines[0] for text in said)


@pytest.mark.parametrize('name, changes, said', [
    ('leo_pass', (), ''), ('uav_flyby', (), ''), ('ship_pass', (), ''),
    ('ship_pass', ('ins.error_told=false', 'ins.tilt_noise=0.0005', 'ins.heading_noise=0.0005'), 'tracker.attitude'),
    ('leo_pass', ('tracking_receiver.receiver.smoothing=recursion',), 'noise_bandwidth')])
@pytest.mark.every_case
def test_a_healthy_run_has_no_line_on_its_filter(name, changes, said):
    run = RecordedRun(memory_recording.record(scenario.load(name, changes, duration=20.0)))
    lines = consistency.remarks(run.filter)
    assert len(lines) == bool(said) or name == 'ship_pass' and lines
    assert all(said in line for line in lines) and bool(lines) == bool(said)


def test_the_band_holds_95_percent_of_consistent_filters():
    """Of many consistent filters with correlated errors 95 % are inside: the count of independent errors is right."""
    rng = np.random.default_rng(3)
    inside = 0
    for series in np.stack([correlated(rng, 3000, 300, 0.95) for _ in range(2)]).transpose(2, 1, 0):
        nees = (series * series).sum(axis=1)
        low, high = consistency.band(2, consistency.effective_count(nees))
        inside += low <= nees.mean() <= high
    assert 0.88 <= inside / 300 <= 0.98


def test_band_of_fifty_runs():
    """Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2: 50 runs of two degrees of freedom, 1.5 to 2.6."""
    assert consistency.band(2, 50) == pytest.approx((1.484, 2.591), abs=1e-3)


def test_independent_samples_of_a_series_with_known_memory():
    series = correlated(np.random.default_rng(5), 400_000, 1, 0.9)[:, 0]
    assert consistency.effective_count(series) == pytest.approx(400_000 * 0.1 / 1.9, rel=0.1)
    white = np.random.default_rng(6).standard_normal(20_000)
    assert consistency.effective_count(white) == pytest.approx(20_000, rel=0.1)
    assert consistency.effective_count(np.ones(10)) == 10.0


def test_nothing_evaluated():
    found = made(np.random.default_rng(1), 1.0, n=200)
    found.tracking[:] = False
    judged = found.axes[0]
    assert judged.verdict == 'nothing was evaluated'
    assert math.isnan(judged.nis) and math.isnan(judged.nees)
    assert results.measured({'filter': None}) == {}


def test_true_rates_seen_from_a_sailing_ship():
    """Against the difference of the angles; the ship's velocity is given in its own frame."""
    t = np.array([0.0, 1.5, 4.0])

    def angles(t):
        e, n, u = (np.array([800.0, -300.0, 200.0]) + t * np.array([-20.0, 90.0, 4.0])
                   - t * np.array([6.0, 2.0, 0.3]))
        return np.array([math.atan2(e, n), math.atan2(u, math.hypot(e, n))])

    attitude = [Rotation.from_euler('ZYX', [1.0 + 0.1 * s, 0.2, -0.1]) for s in t]
    ship = np.array([rotation.inv().apply([6.0, 2.0, 0.3]) for rotation in attitude])
    relative = np.array([800.0, -300.0, 200.0]) + t[:, None] * (np.array([-20.0, 90.0, 4.0]) - [6.0, 2.0, 0.3])
    rates = np.empty((3, 2))
    consistency._rates(relative, np.tile([-20.0, 90.0, 4.0], (3, 1)), np.array([r.as_quat() for r in attitude]), ship,
                       rates)
    expected = [(angles(s + 1e-4) - angles(s - 1e-4)) / 2e-4 for s in t]
    assert rates == pytest.approx(np.array(expected), abs=1e-9)


def test_names_are_those_of_the_models_and_axes():
    assert topics.MOTION_MODELS == motion_models.COLUMN_NAMES
    told = {f'{axis}_{name}' for axis in topics.AXES for name in (*consistency.FILTER_NUMBERS, *topics.MOTION_MODELS)}
    assert told | {f'{axis}_innovation_sigma' for axis in topics.AXES} == set(topics.TOPIC_BY_NAME['acu/filter'].names)


@pytest.mark.parametrize('smoothing', SMOOTHING_KINDS)
@pytest.mark.parametrize('cn0_dbhz', [42.0, pytest.param(55.0, marks=pytest.mark.thorough)])
def test_the_variance_the_control_unit_expects_is_the_receivers(smoothing, cn0_dbhz):
    """A filter averages many errors: what counts is the variance of their mean. A smoothed error itself has less, and
    its neighbours share it; unsmoothed it is that of each."""
    params = build(TrackingReceiverParameters, {
        'target.kind': 'step', 'target.angle.azimuth': 0.3, 'target.angle.elevation': 0.6, 'target.angle.start': 1e6,
        'receiver.range_exponent': 0.0, 'receiver.cn0_dbhz': cn0_dbhz, 'receiver.smoothing': smoothing})
    built = target.build(params.target, 1000.0)
    constants, state = receiver.constants(params, 0.005, built), receiver.initial_state()
    inputs, outputs = receiver.Inputs.zeros(), receiver.Outputs.zeros()
    inputs['mat_ed'], inputs['valid'] = line_of_sight.ashore_matrix(), 1
    inputs['azimuth'], inputs['elevation'] = 0.3, 0.6
    normals = np.random.default_rng(2).standard_normal((40_400, receiver.normals_per_step(params)))
    errors, expected, law = [], [], record(ReceiverModelParameters())[0]
    for k, row in enumerate(normals):
        inputs['stamp_ns'] = 5_000_000 * k
        receiver.step(state[0], constants[0], inputs[0], outputs[0], built.breaks, built.coefficients, row)
        if k >= 400:
            x, e, level = (float(outputs[name][0]) for name in ('cross_elevation', 'elevation', 'cn0_dbhz'))
            errors += [[x, e]]
            expected.append(error_variance(x, e, level, law))
    errors, variance = np.array(errors), np.mean(expected)
    means = errors.reshape(-1, 50, 2).mean(axis=1)
    assert 50 * means.var() == pytest.approx(variance, rel=0.15)
    assert errors.var() == pytest.approx(variance, rel=0.07) or smoothing != 'none'
