"""The fit of the pointing model against katpoint's, leave-one-out by refits, a published TPOINT fit, and the truth."""
import pathlib
import warnings

import katpoint
import numpy as np
import pytest

from pedestal_workbench.calibration import fit, offsets, plan, pointing, terms
from pedestal_workbench.calibration.calibration import CalibrationError

TRUTH = {'P1': 0.3, 'P3': 0.03, 'P4': 0.05, 'P5': 0.08, 'P6': -0.06, 'P7': -0.3, 'P8': -0.05}
"""Errors of a newly built station [deg]."""
NAMES, VALUES = tuple(TRUTH), np.array(list(TRUTH.values()))
SIGMA_DEG = 0.004
EVERYTHING = tuple(terms.TERM_BY_NAME)


def sky(seed, count=40):
    rng = np.random.default_rng(seed)
    return np.column_stack((rng.uniform(0.0, 360.0, count), rng.uniform(10.0, 80.0, count))), rng


def by_katpoint(names, directions, values, sigma):
    """Return (terms, sigmas) [deg, -] of katpoint's fit to offsets on the sky."""
    az, el = np.radians(directions).T
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        found, spread = katpoint.PointingModel().fit(
            az, el, np.radians(values[:, 0]) / np.cos(el), np.radians(values[:, 1]), np.radians(sigma[:, 0]),
            np.radians(sigma[:, 1]), [int(name[1:]) for name in names])
    scale = np.array([1.0 if terms.TERM_BY_NAME[name].factor else np.degrees(1.0) for name in names])
    places = [int(name[1:]) - 1 for name in names]
    return scale * found[places], scale * spread[places]


@pytest.mark.parametrize('names', [NAMES, ('P1', 'P7'), NAMES[:-1], EVERYTHING])
@pytest.mark.parametrize('seed', range(3))
def test_the_linear_form_is_that_of_katpoint(names, seed):
    directions, rng = sky(seed, 80)
    sigma = rng.uniform(0.5, 2.0, (80, 2)) * SIGMA_DEG
    values = terms.design(NAMES, directions) @ VALUES + sigma * rng.normal(size=(80, 2))
    ours = fit.linear(names, directions, values, sigma)
    theirs, spread = by_katpoint(names, directions, values, sigma)
    np.testing.assert_allclose(ours.values, theirs, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(ours.sigma / ours.scale, spread, rtol=1e-6)


def test_the_effects_are_those_of_katpoint():
    """The reference vectors, printed by katpoint 0.10."""
    model = {'P1': .1, 'P3': .02, 'P4': .03, 'P5': .015, 'P6': -.01, 'P7': .05, 'P8': -.04}
    vectors = {(0, 10): (.074827, .025608), (45, 30): (.087112, .018895), (120, 60): (.088481, .013840),
               (200, 45): (.063046, .011041), (300, 85): (-.106941, .062674)}
    directions = np.array(list(vectors), float)
    found = terms.design(tuple(model), directions) @ np.array(list(model.values()))
    found[:, 0] /= np.cos(np.radians(directions[:, 1]))
    np.testing.assert_allclose(found, list(vectors.values()), atol=1e-6)


def test_the_exact_form_differs_by_the_second_order():
    """Large errors of a new station: the forms differ by the products of the terms, and by no more."""
    directions, _ = sky(5)
    values = fit.exact_offsets(NAMES, VALUES, directions)
    ones = np.ones_like(values)
    best = fit.exact(NAMES, directions, values, ones)
    np.testing.assert_allclose(best.values, VALUES, atol=1e-9)
    first = fit.linear(NAMES, directions, values, ones)
    size = np.radians(np.abs(VALUES).sum()) * np.abs(VALUES).sum() * np.tan(np.radians(directions[:, 1])).max()
    assert 1e-5 < np.abs(first.values - best.values).max() < size
    # With terms ten times smaller the difference is a hundred times smaller.
    small = fit.exact_offsets(NAMES, 0.1 * VALUES, directions)
    difference = (fit.linear(NAMES, directions, small, ones).values
                  - fit.exact(NAMES, directions, small, ones).values)
    np.testing.assert_allclose(100.0 * difference, first.values - best.values, atol=0.1 * size)


def test_leave_one_out_is_that_of_refits():
    directions, rng = sky(7)
    sigma = rng.uniform(0.5, 2.0, (40, 2)) * SIGMA_DEG
    values = terms.design(NAMES, directions) @ VALUES + sigma * rng.normal(size=(40, 2))
    whole = fit.linear(NAMES, directions, values, sigma)
    for i in (0, 13, 39):
        keep = np.arange(40) != i
        part = fit.linear(NAMES, directions[keep], values[keep], sigma[keep])
        expected = values[i] - (terms.design(NAMES, directions[i:i + 1]) @ part.values)[0]
        np.testing.assert_allclose(whole.left_out[i], expected, atol=1e-12)


def test_the_intervals_hold_the_truth():
    """Over 300 seeds: 95 % of the intervals hold the truth, and 3 sigma hold it in 99 %."""
    inside, near = [], []
    for seed in range(300):
        directions, rng = sky(1000 + seed)
        values = terms.design(NAMES, directions) @ VALUES + SIGMA_DEG * rng.normal(size=(40, 2))
        found = fit.linear(NAMES, directions, values, np.ones((40, 2)))
        error = np.abs(found.values - VALUES) / found.sigma
        inside.append(error < found.interval)
        near.append(error < 3.0)
    # 2100 values: the standard deviation of the first share is 0.5 %, a little more because the terms are correlated.
    assert 0.93 < np.mean(inside) < 0.97
    assert np.mean(near) >= 0.99


def test_the_default_is_exact_where_the_data_show_it():
    directions, rng = sky(3)
    ones = np.ones((40, 2))
    measured = offsets.Offsets(directions, fit.exact_offsets(NAMES, VALUES, directions), ones, False, [''] * 40, '',
                               'CSV', '')
    assert pointing.calibrate(measured, NAMES).fit.form == 'exact'
    noisy = measured._replace(values=measured.values + 0.01 * rng.normal(size=(40, 2)))
    assert pointing.calibrate(noisy, NAMES).fit.form == 'linear'
    assert pointing.calibrate(noisy, NAMES, 'exact').fit.form == 'exact'


def measured_with(values, directions):
    places = [f'line {2 + i}' for i in range(len(values))]
    return offsets.Offsets(directions, values, np.ones_like(values), False, places, 'a.csv', 'CSV', '')


def test_a_doubtful_term_is_dropped_and_the_rest_fitted_again():
    """A term that is 0 in truth is below its sigma in 68 % of all cases, a term far above its sigma in none."""
    without = tuple(name for name in NAMES if name != 'P5')
    known, dropped = np.array([TRUTH[name] for name in without]), []
    for seed in range(100):
        directions, rng = sky(seed)
        values = terms.design(without, directions) @ known + 0.25 * SIGMA_DEG * rng.normal(size=(40, 2))
        found = pointing.calibrate(measured_with(values, directions), NAMES, 'linear')
        if found.dropped:
            dropped.append(seed)
            assert [name for name, _value, _sigma in found.dropped] == ['P5']
            alone = fit.linear(without, directions, values, np.ones_like(values))
            np.testing.assert_allclose(found.fit.values, alone.values, atol=1e-12)
            whole = fit.linear(NAMES, directions, values, np.ones_like(values))
            kept = [NAMES.index(name) for name in without]
            np.testing.assert_allclose(found.fit.sigma, np.maximum(whole.sigma[kept], alone.sigma), rtol=1e-12)
    assert 55 <= len(dropped) <= 80
    directions, rng = sky(dropped[0])
    values = terms.design(without, directions) @ known + 0.25 * SIGMA_DEG * rng.normal(size=(40, 2))
    measured = measured_with(values, directions)
    assert any(line.startswith('P5: dropped, because its sigma')
               for line in pointing.calibrate(measured, NAMES).remarks())
    assert 'P5' in pointing.calibrate(measured, NAMES, keep_all=True).fit.names


def test_terms_with_the_same_effect_are_named():
    directions, _ = sky(2)
    directions[:, 1] = 30.0
    with pytest.raises(CalibrationError, match='cannot tell these terms apart: P1, P3, P4, P7, P8'):
        fit.linear(NAMES, directions, np.zeros((40, 2)), np.ones((40, 2)))
    with pytest.raises(CalibrationError, match='P12: has no effect'):
        fit.linear(('P12',), np.column_stack((np.zeros(40), directions[:, 1])), np.zeros((40, 2)), np.ones((40, 2)))


def test_correlated_terms_are_named():
    directions, rng = sky(2)
    values = terms.design(NAMES, directions) @ VALUES + SIGMA_DEG * rng.normal(size=(40, 2))
    found = fit.linear(NAMES, directions, values, np.ones((40, 2)))
    pairs = {(first, second) for first, second, _ in found.correlated()}
    assert ('P1', 'P4') in pairs and ('P3', 'P4') in pairs and ('P5', 'P6') not in pairs


def test_an_outlier_is_named_and_nothing_else():
    directions, rng = sky(4)
    values = terms.design(NAMES, directions) @ VALUES + SIGMA_DEG * rng.normal(size=(40, 2))
    assert pointing.calibrate(measured_with(values, directions), NAMES).outliers.size == 0
    values[17, 1] += 0.05
    found = pointing.calibrate(measured_with(values, directions), NAMES)
    assert found.outliers.tolist() == [17]
    assert sum(line.startswith('outlier in line 19: azimuth') for line in found.remarks()) == 1


def test_the_linear_form_remains_where_the_exact_form_has_no_result():
    """An offset of 5 deg near the zenith: the exact law does not converge, and the outlier is named all the same."""
    directions, rng = sky(4)
    values = terms.design(NAMES, directions) @ VALUES + SIGMA_DEG * rng.normal(size=(40, 2))
    directions[17], values[17] = (20.0, 88.0), (5.0, 0.0)
    with pytest.raises(CalibrationError, match='the exact fit has not converged'):
        pointing.calibrate(measured_with(values, directions), NAMES, 'exact')
    found = pointing.calibrate(measured_with(values, directions), NAMES)
    said = found.remarks()
    assert found.fit.form == 'linear' and found.outliers[0] == 17
    assert any(line.startswith('the linear form is taken: the exact fit has not converged') for line in said)


def spread(az=(0.0, 360.0), el=(10.0, 80.0), count=40):
    rng = np.random.default_rng(9)
    return np.column_stack((rng.uniform(*az, count), rng.uniform(*el, count)))


@pytest.mark.parametrize('directions, message', [
    (spread(count=9), '9 points, must be at least 10 for 7 terms'),
    (spread(el=(45.0, 45.0)), 'bad distribution: all elevations are within 45 to 45 deg, and must span at least '
                              '20 deg to tell P1, P3, P4 and P7, P8 apart'),
    (spread(el=(40.0, 55.0)), 'must span at least 20 deg'),
    (spread(az=(90.0, 270.0)), 'bad distribution: no point between azimuth 26'),
    (spread(az=(-90.0, 90.0)), 'a gap of 18')])
def test_a_bad_distribution_is_refused(directions, message):
    with pytest.raises(CalibrationError, match=message):
        fit.check_distribution(NAMES, directions)


def test_the_zeros_alone_need_no_full_turn():
    fit.check_distribution(('P1', 'P7'), spread(az=(90.0, 120.0), el=(44.0, 46.0)))


def test_a_published_fit_of_a_telescope():
    """The data of a TPOINT fit of the MMT, whose terms the source prints in arcseconds.

    Its azimuth counts from south through east, so the sign of AN is that of the other direction. The elevation terms
    IE, TF and TX of that fit are not compared, because TX has no counterpart here.
    """
    found = pointing.calibrate(offsets.read(pathlib.Path(__file__).with_name('mmt_2021.dat')), NAMES)
    published = {'P1': -1209.2612, 'P3': 3.4724, 'P4': -5.9455, 'P5': -2.4950, 'P6': 10.3347}
    for name, value in published.items():
        i = found.fit.names.index(name)
        assert abs(found.fit.values[i] - value / 3600.0) < 3.0 * found.fit.sigma[i], name
    assert found.date == '2021-08-21' and len(found.offsets.places) == 80
    assert pointing.rms(found.fit.left_out) < 1.1 / 3600.0


@pytest.mark.parametrize('count, gain', [(12, 0.98), (20, 0.68), (40, 0.43), (60, 0.36)])
def test_a_plan_is_better_than_random_directions(count, gain):
    """The gains are those of random directions, both axes together as the length of the error."""
    planned = plan.directions(count)
    assert planned[0, 0] < -180.0 and planned[-1, 0] > 180.0 and np.all(np.diff(planned[:, 0]) > 0.0)
    assert planned[:, 1].min() >= 10.0 and planned[:, 1].max() <= 80.0
    fit.check_distribution(NAMES, planned)
    assert np.sqrt(2.0) * plan.noise_gain(planned) < 1.1 * gain


@pytest.mark.parametrize('names', [NAMES, EVERYTHING])
def test_a_plan_determines_every_term(names):
    """Without noise each term is found, also all twenty of them in the directions of a plan."""
    directions = plan.directions(60)
    truth = np.random.default_rng(1).uniform(0.01, 0.1, len(names))
    found = fit.linear(names, directions, terms.design(names, directions) @ truth, np.ones((60, 2)))
    np.testing.assert_allclose(found.values, truth, atol=1e-9)
