import math

import numpy as np
import pytest
from scipy import integrate, signal

from pedestal_common.parameters import ParameterError
from pedestal_common.text_files import csv_table
from ship_motion_sim import motion, waves
from ship_motion_sim.params import HullParameters, ShipParameters

G = 9.81
HULL = HullParameters()


@pytest.mark.parametrize('hs, tp', waves.SEA_STATES.values())
@pytest.mark.parametrize('gamma', [1.0, 3.3, 7.0])
def test_spectrum_holds_the_variance_of_its_wave_height(hs, tp, gamma):
    low, high = waves.band(tp)
    peak = 2.0 * math.pi / tp
    variance = sum(integrate.fixed_quad(waves.spectrum, *span, (hs, tp, gamma), n=200)[0]
                   for span in ((low, peak), (peak, high)))
    assert variance == pytest.approx(hs ** 2 / 16.0, rel=1e-5)
    assert waves.spectrum(np.array([0.99 * low, 1.01 * high]), hs, tp, gamma).tolist() == [0.0, 0.0]


def test_gamma_1_is_the_bretschneider_spectrum_scaled_to_the_band():
    hs, tp = 3.25, 9.7
    low, high = waves.band(tp)
    wp = 2.0 * math.pi / tp
    w = np.linspace(low, high, 50)
    bretschneider = 5.0 / 16.0 * hs ** 2 * wp ** 4 / w ** 5 * np.exp(-1.25 * (wp / w) ** 4)
    inside = math.exp(-1.25 * (wp / high) ** 4) - math.exp(-1.25 * (wp / low) ** 4)     # its integral is closed form
    assert inside > 0.98
    np.testing.assert_allclose(waves.spectrum(w, hs, tp, 1.0), bretschneider / inside, rtol=1e-5)


def test_gamma_raises_the_peak_and_one_width_beside_it():
    wp = 2.0 * math.pi / 9.7
    for w, factor in ((wp, 3.3), (wp * 0.93, 3.3 ** math.exp(-0.5)), (wp * 1.09, 3.3 ** math.exp(-0.5))):
        assert waves.shape(w, 9.7, 3.3) / waves.shape(w, 9.7, 1.0) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize('state', waves.SEA_STATES)
def test_every_seed_has_exactly_the_wave_height(state):
    hs, tp = waves.SEA_STATES[state]
    for seed in range(20):
        w, amplitude, phase, _ = waves.seaway(ShipParameters(sea_state=state, seed=seed))
        assert np.sum(amplitude ** 2) / 2.0 == pytest.approx(hs ** 2 / 16.0, rel=1e-12)
        assert np.all(np.diff(w) > 0.0) and w[0] >= waves.band(tp)[0] and w[-1] <= waves.band(tp)[1]
        assert np.all((phase >= 0.0) & (phase < 2.0 * math.pi))


def test_own_height_and_period_replace_the_table():
    table = waves.build(ShipParameters(sea_state=4))
    own = waves.build(ShipParameters(sea_state=0, significant_height=2 * 1.88, peak_period=8.8))
    np.testing.assert_allclose(own.response, 2.0 * table.response, rtol=1e-12)


def _hull_answer(w, mu, speed):
    """Heave, roll and pitch by integrals over a box hull and scipy's oscillator: definition, not closed form."""
    k = w * w / G
    d_x, d_y = math.cos(mu), -math.sin(mu)
    w_e = w - k * speed * d_x
    x, y = np.linspace(-0.5, 0.5, 20001) * HULL.length, np.linspace(-0.5, 0.5, 2001) * HULL.beam
    along, across = np.exp(-1j * k * d_x * x), np.exp(-1j * k * d_y * y)
    level = math.exp(-0.5 * k * HULL.draught) * integrate.simpson(across, x=y) / HULL.beam
    mean = integrate.simpson(along, x=x) / HULL.length
    tilt = integrate.simpson(along * x, x=x) / integrate.simpson(x * x, x=x)        # least squares line

    def oscillator(period, damping):
        wn = 2.0 * math.pi / period
        _, h = signal.freqs([wn ** 2], [1.0, 2.0 * damping * wn, wn ** 2], worN=[abs(w_e)])
        return h[0] if w_e >= 0.0 else h[0].conj()

    heave = oscillator(HULL.heave_period, HULL.heave_damping) * level * mean
    roll = HULL.roll_gain * oscillator(HULL.roll_period, HULL.roll_damping) * level * mean * (-1j * k * d_y)
    pitch = -oscillator(HULL.pitch_period, HULL.pitch_damping) * level * tilt
    return w_e, heave, roll, pitch


@pytest.mark.parametrize('w', [0.4, 0.65, 0.9])
@pytest.mark.parametrize('mu_deg', [10.0, 60.0, 120.0, 190.0, 300.0])
def test_heave_roll_and_pitch_against_integrals_over_the_hull(w, mu_deg):
    w_e, rao = waves.transfer(HULL, w, math.radians(mu_deg), 20.0, G)
    expected_w_e, heave, roll, pitch = _hull_answer(w, math.radians(mu_deg), 20.0)
    assert w_e == pytest.approx(expected_w_e, rel=1e-12)
    np.testing.assert_allclose([rao[waves.HEAVE], rao[waves.ROLL], rao[waves.PITCH]], [heave, roll, pitch], atol=2e-9)


@pytest.mark.parametrize('mu_deg', [0.0, 30.0, 90.0, 200.0, 315.0])
def test_on_a_very_long_wave_the_ship_rides_the_surface(mu_deg):
    w, mu = 0.01, math.radians(mu_deg)
    k = w * w / G
    _, rao = waves.transfer(HULL, w, mu, 0.0, G)

    def surface(x, y):
        return np.exp(-1j * k * (math.cos(mu) * x - math.sin(mu) * y))

    bow_up, port_up = surface(0.5, 0) - surface(-0.5, 0), surface(0, 0.5) - surface(0, -0.5)
    assert rao[waves.HEAVE] == pytest.approx(1.0, abs=2e-2)
    assert rao[waves.PITCH] == pytest.approx(-bow_up, abs=2e-2 * k)
    assert rao[waves.ROLL] == pytest.approx(0.75 * port_up, abs=2e-2 * k)
    ahead, port = (1j * w * rao[:2]).real           # velocity where the crest is, phase 0
    np.testing.assert_allclose([ahead, port], [w * math.cos(mu), -w * math.sin(mu)], atol=2e-2 * w)


def test_yaw_is_the_turn_of_the_sway_along_the_hull():
    w, mu = 0.02, math.radians(40.0)
    k = w * w / G
    _, rao = waves.transfer(HULL, w, mu, 0.0, G)
    sway_per_metre = -1j * k * math.cos(mu) * rao[waves.SWAY]
    assert rao[waves.YAW] == pytest.approx(0.9 * sway_per_metre, abs=0.1 * abs(sway_per_metre))


def test_a_ship_as_fast_as_the_wave_meets_it_with_frequency_zero():
    w_e, rao = waves.transfer(HULL, 0.8, 0.0, G / 0.8, G)
    assert w_e == pytest.approx(0.0, abs=1e-15)
    assert np.all(np.isfinite(rao))


@pytest.mark.thorough
@pytest.mark.parametrize('angle', [45.0, 90.0, 180.0])
def test_variance_of_many_seeds_is_the_integral_of_rao_squared_times_spectrum(angle):
    params = [ShipParameters(wave_angle_deg=angle, seed=seed) for seed in range(300)]
    gravity = waves.earth.gravity(math.radians(params[0].latitude_deg))
    drawn = np.array([np.sum(np.abs(waves.build(p).response) ** 2, axis=0) / 2.0 for p in params])
    hs, tp = waves.SEA_STATES[5]
    w = np.linspace(*waves.band(tp), 1201)[:, None]
    z, weight = np.polynomial.hermite_e.hermegauss(41)
    mu = np.radians(angle + 15.0 * z)[None, :]
    _, rao = waves.transfer(HULL, w, mu, 7.0, gravity)
    density = np.einsum('wmf,m->wf', np.abs(rao) ** 2, weight / weight.sum()) * waves.spectrum(w, hs, tp, 3.3)
    expected = integrate.simpson(density, x=w[:, 0], axis=0)
    error = drawn.std(axis=0) / math.sqrt(len(params))
    # four standard errors of the mean, and 1 % for the bins' width (energy is exact per bin, the RAO is not)
    np.testing.assert_array_less(np.abs(drawn.mean(axis=0) - expected), 4.0 * error + 0.01 * expected)


NAV_TABLE = [   # sea state, wave angle, degree of freedom, sigma [deg], at U = 7 m/s
    (3, 90, waves.ROLL, 0.20), (3, 45, waves.ROLL, 0.28), (3, 180, waves.PITCH, 0.05), (3, 135, waves.PITCH, 0.11),
    (4, 90, waves.ROLL, 0.66), (4, 45, waves.ROLL, 0.83), (4, 180, waves.PITCH, 0.26), (4, 135, waves.PITCH, 0.40),
    (5, 90, waves.ROLL, 1.49), (5, 45, waves.ROLL, 1.80), (5, 180, waves.PITCH, 0.66), (5, 135, waves.PITCH, 0.84),
    (6, 90, waves.ROLL, 3.89), (6, 45, waves.ROLL, 2.31), (6, 180, waves.PITCH, 1.41), (6, 135, waves.PITCH, 1.34)]


@pytest.mark.parametrize('state, angle, freedom, sigma', NAV_TABLE)
def test_roll_and_pitch_are_those_of_the_reference(state, angle, freedom, sigma):
    """Its table is one seaway, so it may lie anywhere in the scatter of ours over seeds: three standard deviations,
    and half of its last digit."""
    drawn = [np.sqrt(np.sum(np.abs(waves.build(ShipParameters(
        sea_state=state, wave_angle_deg=float(angle), seed=seed)).response[:, freedom]) ** 2) / 2.0)
        for seed in range(60)]
    drawn = np.degrees(drawn)
    assert abs(drawn.mean() - sigma) < 3.0 * drawn.std() + 0.005


def measured(path, **changes):
    return ShipParameters(spectrum='file', spectrum_file=str(path), **changes)


def test_a_measured_spectrum_keeps_its_energy_where_it_was(tmp_path):
    """Swell of 14 s beside a wind sea of 6 s; the height of all waves of a band is 4 sqrt(m0) of the band."""
    f = np.arange(0.04, 0.5, 0.01)
    density = 3.0 * np.exp(-0.5 * ((f - 1.0 / 14.0) / 0.01) ** 2) + 1.0 * np.exp(-0.5 * ((f - 1.0 / 6.0) / 0.02) ** 2)
    path = tmp_path / 'buoy.csv'
    path.write_text('frequency_hz,density_m2_per_hz\n' + ''.join(f'{x:.3f},{y:.6f}\n' for x, y in zip(f, density)))
    w, amplitude, _, _ = waves.seaway(measured(path))
    assert np.sum(0.5 * amplitude**2) == pytest.approx(integrate.trapezoid(density, f), rel=1e-4)
    swell, low = w < 2.0 * math.pi * 0.11, f < 0.11
    assert np.sum(0.5 * amplitude[swell]**2) == pytest.approx(integrate.trapezoid(density[low], f[low]), rel=0.05)


@pytest.mark.parametrize('names, frequency, density', [
    ('Frequency [Hz];Density [m2/Hz]', 1.0, 1.0),
    ('frequency (rad/s);density (m2 s/rad)', 2.0 * math.pi, 0.5 / math.pi)])
def test_a_spectrum_of_a_spreadsheet_is_read(names, frequency, density, tmp_path):
    path = tmp_path / 'buoy.csv'
    f = np.arange(0.05, 0.4, 0.05)
    rows = ''.join(f'{frequency * x:.12f};{density * 2.0:.12f}\n' for x in f)
    path.write_text(f'{names}\n' + rows.replace('.', ','))
    w, level = waves.density(measured(path))
    assert (w[0], w[-1]) == pytest.approx((2.0 * math.pi * f[0], 2.0 * math.pi * f[-1]))
    assert level == pytest.approx(np.full(len(w), 1.0 / math.pi))


@pytest.mark.parametrize('content, message', [
    ('frequency_hz,density_m2_per_hz\n0.1,1\n0.05,2\n', 'line 3: frequency_hz = 0.05: -0.05 hz after the row before'),
    ('frequency_hz,density_m2_per_hz\n0.1,-1\n0.2,1\n', 'line 2: density_m2_per_hz = -1: must be 0 to 10000'),
    ('frequency_hz\n0.1\n', "line 1: column 'density_m2_per_hz' is missing"),
    ('frequency_hz,density_m2_per_hz\n0.1,1\n', '1 rows, must be at least 2')])
def test_a_broken_spectrum_is_named(tmp_path, content, message):
    path = tmp_path / 'buoy.csv'
    path.write_text(content)
    with pytest.raises(csv_table.TableError, match=f'{path}: {message}'):
        waves.build(measured(path))


def test_a_spectrum_names_its_columns(tmp_path):
    path = tmp_path / 'buoy.csv'
    path.write_text('frequency [rad/s];density [m2 s/rad]\n' + '0,5;1\n' + 2 * '0,7;1\n')
    assert motion.summary(measured(path)) == ('buoy.csv: columns frequency [rad/s] in rad/s, density [m2 s/rad] in '
                                              'm2 s/rad: 2 rows, passed over 1 x row that repeats the row before',)
    assert motion.summary(ShipParameters()) == ()


def test_a_spectrum_has_no_effect_without_waves():
    with pytest.raises(ParameterError, match="^spectrum = 'file': has no effect with motion = plain"):
        measured('buoy.csv', motion='plain')


def test_a_spectrum_needs_its_file_and_a_file_its_spectrum():
    for values in ({'spectrum': 'file'}, {'spectrum_file': 'buoy.csv'}):
        with pytest.raises(ParameterError, match='spectrum_file'):
            ShipParameters(**values)
