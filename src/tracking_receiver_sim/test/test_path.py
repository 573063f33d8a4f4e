"""The way from target to receiver: refraction against tables, light time and UT1 by other routes, the image in the
ground against complex voltages written out, scintillation against its own statistics."""
import cmath
import math

import numpy as np
import pytest

from pedestal_common.geometry import geodesy, orbit
from pedestal_common.geometry.line_of_sight import earth_direction
from pedestal_common.parameters import build
from receiver_law import monopulse
from tracking_receiver_sim import target, wave_path
from tracking_receiver_sim.params import PathParameters, PolarisationParameters, TargetParameters

PERIOD, BEAMWIDTH = 0.005, 0.0175
FIXED = {'target.kind': 'step', 'target.angle.azimuth': 0.3, 'target.angle.elevation': 0.6,
         'target.angle.start': 1e6, 'receiver.range_exponent': 0.0}
QUIET = FIXED | {'receiver.cn0_dbhz': 110.0}

FIELD_SYSTEM = {1: .49890, 2: .35506, 5: .18429, 10: .09838, 20: .04875, 45: .01785, 60: .01031}
"""{elevation: refraction} [deg] that katpoint's copy of the VLBI Field System gives at 15 C, 1013.25 hPa, 50 %."""

N = 77.6 * (1013.25 + 4810.0 * 1.33289 * 6.5525 / 288.0) / 288.0
"""The refractivity that it takes then: 6.5525 mm Hg of water vapour, from its dew point of 5.14 C."""

ERFA = {10: .09786, 20: .04867, 45: .01784, 60: .01031}
"""The same air by erfa.refco for radio waves, A tan z + B tan^3 z."""


@pytest.mark.parametrize('elevation', FIELD_SYSTEM)
def test_refraction_of_the_field_system(elevation):
    bent, _ = wave_path.refraction(N, math.radians(elevation))
    assert math.degrees(bent) == pytest.approx(FIELD_SYSTEM[elevation], rel=5e-4)


@pytest.mark.parametrize('elevation', ERFA)
def test_refraction_against_erfa(elevation):
    bent, _ = wave_path.refraction(311.4, math.radians(elevation))
    assert math.degrees(bent) == pytest.approx(ERFA[elevation], rel=0.01)


def test_refraction_stays_below_one_degree():
    assert wave_path.refraction(N, -0.1) == (wave_path.refraction(N, wave_path.MIN_ELEVATION_RAD)[0], 0.0)


def errors(out):
    return np.stack([out['cross_elevation'], out['elevation']], axis=1)


PATH = build(PathParameters, {'refractivity': 320.0, 'light_time': True})


def test_a_target_is_seen_higher_and_late():
    """Position and velocity: against the angles of the target as it was r / c ago, and their differences."""
    p0, v, h = np.array([400e3, -700e3, 120e3]), np.array([-5e3, 3e3, 4e3]), 1e-2

    def at(t):
        r = p0 + v * t
        early = r - v * np.linalg.norm(r) / 299792458.0
        azimuth, elevation = math.atan2(early[0], early[1]), math.asin(early[2] / np.linalg.norm(early))
        bent, _ = wave_path.refraction(320.0, elevation)
        return np.linalg.norm(early) * np.array(earth_direction(azimuth, elevation + bent))

    r, w = wave_path.seen(wave_path.path_constants(PATH)[0], tuple(p0), tuple(v))
    assert r == pytest.approx(at(0.0), rel=1e-9)
    # The light time of a target changes with its range: 2e-5 of the velocity, which `seen` leaves out.
    assert w == pytest.approx((at(h) - at(-h)) / (2.0 * h), abs=1e-4 * np.linalg.norm(v))
    assert wave_path.all_seen(PATH, p0[None], v[None])[0] == pytest.approx(r)


def test_the_receiver_sees_the_refracted_target(Bench):
    bench = Bench(QUIET | {'path.refractivity': 320.0})
    bench.point(0.3, 0.6 + wave_path.refraction(320.0, 0.6)[0])
    out = bench.run(60)
    assert np.abs([out['true_cross_elevation'], out['true_elevation']]).max() < 1e-12
    assert np.abs(errors(out)[40:]).max() < 1e-9


def test_ut1_turns_the_earth_under_the_orbit():
    """UT1 ahead by d is the station moved east by the angle that the earth turns in d."""
    def look(values):
        p = build(TargetParameters, {'kind': 'leo_pass', 'leo_pass.start_time': '2019-12-10T08:10:00', **values})
        satrec = orbit.satellite(p.leo_pass)
        return orbit.enu(satrec, p.station, *target._start(p, satrec, 0.0), np.arange(0.0, 600.0, 60.0),
                                     p.leo_pass.ut1_offset)[0]
    moved = 8.5 + math.degrees(0.5 * geodesy.EARTH_RATE)
    ahead = look({'leo_pass.ut1_offset': 0.5})
    assert ahead == pytest.approx(look({'station.longitude_deg': moved}), abs=1e-3)
    assert np.linalg.norm(ahead - look({}), axis=1).min() > 50.0


def test_boresight_offset_is_what_the_loop_nulls(Bench):
    offset = 0.1 * BEAMWIDTH
    bench = Bench(QUIET | {'antenna.boresight_cross_elevation': offset, 'antenna.boresight_elevation': -offset})
    bench.point(0.3 - offset / math.cos(0.6), 0.6 + offset)
    out = bench.run(60)
    assert np.abs(errors(out)[40:]).max() < 2e-3 * offset
    assert out['true_cross_elevation'] == pytest.approx(offset, rel=0.01)


LOW = {**QUIET, 'target.angle.elevation': 0.01, 'path.multipath.height': 8.0, 'antenna.phase_error': 0.3}


@pytest.mark.parametrize('reflection, roughness, elevation', [(0.9, 0.0, 0.008), (0.4, 0.05, 0.012), (0.7, 1.0, 0.0)])
def test_multipath_is_the_sum_of_two_waves(Bench, reflection, roughness, elevation):
    """Complex voltages of the wave and of its image 2 E lower, both on the step's last sample."""
    bench = Bench(LOW | {'path.multipath.reflection': reflection, 'path.multipath.roughness': roughness,
                         'receiver.agc_time_constant': 1e-3, 'receiver.samples_per_step': 1})
    bench.point(0.3, elevation)
    measured = errors(bench.run(40))[-1]
    k, sin_E = 2.0 * math.pi / 0.0355, math.sin(0.01)
    gamma = -reflection * math.exp(-2.0 * (k * roughness * sin_E)**2) * cmath.exp(-2j * k * 8.0 * sin_E)
    voltages = [sum(g * np.array(monopulse.channels(0.0, (E - elevation) / BEAMWIDTH, 1.6, 1.0, 0.0))
                    for g, E in ((1.0, 0.01), (gamma, -0.01)))][0]
    ratio = (voltages[2] * cmath.exp(0.3j) * voltages[0].conjugate()).real / abs(voltages[0])**2
    expected = np.clip(BEAMWIDTH / 1.6 * ratio, -0.7 * BEAMWIDTH, 0.7 * BEAMWIDTH)
    assert measured[1] == pytest.approx(expected, rel=1e-3, abs=1e-8)
    assert abs(measured[0]) < 1e-7


def test_a_rough_sea_and_a_high_target_have_no_image(Bench):
    def measured(**values):
        bench = Bench(LOW | {f'path.multipath.{name}': value for name, value in values.items()})
        bench.point(0.3, 0.008)
        return errors(bench.run(20))[-1]
    assert measured(reflection=0.9, roughness=5.0) == pytest.approx(measured(), abs=1e-12)
    assert abs(measured(reflection=0.9) - measured())[1] > 1e-4


def test_scintillation_has_its_sigma_and_its_time(Bench):
    """Level and direction of a noiseless receiver on a target at 30 deg: sigma, and correlation over tau."""
    sin_E, tau = math.sin(0.6), 0.05
    bench = Bench(QUIET | {'path.scintillation.level_db': 0.2, 'path.scintillation.angle': 2e-4,
                           'path.scintillation.time_constant': tau, 'receiver.samples_per_step': 1,
                           'receiver.cn0_time_constant': 1e-3, 'receiver.agc_time_constant': 1e-3})
    rng = np.random.default_rng(1)
    out = bench.run(40000, rng)[50:]
    for i in range(2):
        e = errors(out)[:, i]
        assert e.std() == pytest.approx(2e-4 / math.sqrt(sin_E), rel=0.06)
        assert np.corrcoef(e[:-10], e[10:])[0, 1] == pytest.approx(math.exp(-10 * PERIOD / tau), abs=0.05)
    assert out['cn0_dbhz'].std() == pytest.approx(0.2 / sin_E**1.2, rel=0.06)
    assert (out['true_elevation'] == out['true_elevation'][0]).all()


def test_still_air_leaves_the_noise_of_the_receiver(Bench):
    plain, still = (Bench(FIXED | values).run(50, np.random.default_rng(7)) for values in (
        {}, {'path.multipath.height': 3.0, 'path.scintillation.time_constant': 3.0}))
    assert plain.tobytes() == still.tobytes()


@pytest.mark.parametrize('wave, antenna, efficiency', [
    ({}, {}, 1.0), ({}, {'sense': 'left'}, 0.0), ({'axial_ratio_db': 60.0}, {}, 0.5),
    ({'axial_ratio_db': 60.0, 'tilt': 0.5}, {'axial_ratio_db': 60.0}, math.cos(0.5)**2),
    ({'axial_ratio_db': 60.0, 'tilt': math.pi / 2}, {'axial_ratio_db': 60.0}, 0.0)])
def test_polarisation_in_its_limits(wave, antenna, efficiency):
    """Circular on circular, on the other sense, linear on circular, Malus' law; 60 dB are as good as linear."""
    found = wave_path.polarisation_efficiency(PolarisationParameters(**wave), PolarisationParameters(**antenna))
    assert found == pytest.approx(efficiency, abs=1.1e-3)


def test_polarisation_against_jones_vectors():
    def jones(p):
        e = 10.0**(0.05 * p.axial_ratio_db)
        ellipse = np.array([e, (1j if p.sense == 'right' else -1j)]) / math.hypot(e, 1.0)
        c, s = math.cos(p.tilt), math.sin(p.tilt)
        return np.array([[c, -s], [s, c]]) @ ellipse
    a, b = PolarisationParameters(3.0, 0.4, 'left'), PolarisationParameters(1.5, -0.8, 'left')
    assert wave_path.polarisation_efficiency(a, b) == pytest.approx(abs(np.vdot(jones(b), jones(a)))**2, rel=1e-12)


def test_polarisation_costs_level(Bench):
    def level(**values):
        return Bench(QUIET | {f'antenna.polarisation.{name}': value for name, value in values.items()}).run(
            400)['cn0_dbhz'][-1]
    assert level() - level(axial_ratio_db=60.0) == pytest.approx(10.0 * math.log10(2.0), abs=0.02)
