"""The wind: spectrum and variance against the formulas by another route, seeds, and what reaches the loads."""
import math

import numpy as np
import pytest
from scipy import integrate, signal

from adu_drive.plant import wind
from drive_law.params import AduParameters, GustParameters, WindParameters
from pedestal_common.parameters import build

V, SIGMA, L = 15.0, 0.2 * 15.0, 120.0


def formula(kind, f):
    """Density [m2/s] of v."""
    if kind == 'davenport':
        return SIGMA ** 2 * 2.0 * (1200.0 / V) ** 2 * f / (3.0 * (1.0 + (1200.0 * f / V) ** 2) ** (4.0 / 3.0))
    return 4.0 * SIGMA ** 2 * (L / V) / (1.0 + 70.8 * (f * L / V) ** 2) ** (5.0 / 6.0)


def record(kind, seed, t):
    """v [m/s] of one seed at the times t."""
    p = WindParameters(azimuth=500.0, gust=GustParameters(kind=kind, speed=V, intensity=0.2, length=L, seed=seed))
    c = wind.constants(p)[0]
    return np.array([V * wind.turbulence(x, c['amplitude'], c['omega'], c['phase']) for x in t])


@pytest.mark.parametrize('kind', ['davenport', 'von_karman'])
def test_spectrum_and_variance(kind):
    """scipy's Welch estimate over half decades and seeds, and the variance of long records."""
    rate, count = 2.0 * wind.MAX_GUST_FREQUENCY_HZ, 60000
    t = np.arange(count) / rate
    paths = [record(kind, seed, t) for seed in range(8)]
    f, density = np.mean([signal.welch(v, rate, nperseg=20000) for v in paths], axis=0)
    edges = np.geomspace(wind.MIN_GUST_FREQUENCY_HZ, wind.MAX_GUST_FREQUENCY_HZ, wind.SPECTRAL_LINE_COUNT
                         + 1)[50:110:12]      # 0.012 to 1.2 Hz
    for low, high in zip(edges, edges[1:]):
        power = np.trapezoid(density[(f >= low) & (f <= high)], dx=f[1])
        assert power == pytest.approx(integrate.quad(lambda x: formula(kind, x), low, high)[0], rel=0.1)
    covered = integrate.quad(lambda u: math.exp(u) * formula(kind, math.exp(u)), math.log(wind.MIN_GUST_FREQUENCY_HZ),
                             math.log(wind.MAX_GUST_FREQUENCY_HZ), limit=200)[0]
    amplitude = V * wind.constants(WindParameters(azimuth=1.0, gust=GustParameters(
        kind=kind, speed=V, intensity=0.2, length=L)))[0]['amplitude']
    assert np.sum(amplitude ** 2) / 2.0 == pytest.approx(covered, rel=1e-3)
    assert covered == pytest.approx(SIGMA ** 2, rel=0.03)
    assert np.mean([np.var(v) for v in paths]) == pytest.approx(covered, rel=0.1)


def test_seeds_and_times():
    t = np.arange(50) * 0.1
    assert record('davenport', 4, t).tobytes() == record('davenport', 4, t).tobytes()
    assert np.abs(record('davenport', 4, t) - record('davenport', 5, t)).max() > 1.0
    assert record('davenport', 4, t[::-1])[::-1].tobytes() == record('davenport', 4, t).tobytes()


def torques(p, t):
    return wind.torques.py_func(wind.constants(p).view(np.recarray)[0], t)


def test_both_axes_feel_the_same_gust():
    p = WindParameters(azimuth=-500.0, elevation=200.0, gust=GustParameters(kind='von_karman', intensity=0.5))
    path = np.array([torques(p, 7.3 * k) for k in range(20000)])
    assert path[:, 0] == pytest.approx(-2.5 * path[:, 1])
    assert path[:, 0].mean() == pytest.approx(-500.0 * (1.0 + 0.5 ** 2), rel=0.03)      # mean of (1 + v / V)^2


def test_step_and_sine():
    step = WindParameters(azimuth=100.0, gust=GustParameters(kind='step', azimuth=50.0, elevation=-20.0, start=2.0))
    assert torques(step, 1.999) == (100.0, 0.0) and torques(step, 2.0) == (150.0, -20.0)
    sine = WindParameters(gust=GustParameters(kind='sine', azimuth=50.0, elevation=-20.0, start=2.0, frequency=0.5))
    assert torques(sine, 1.0) == (0.0, 0.0) and torques(sine, 2.5) == pytest.approx((50.0, -20.0))
    assert torques(WindParameters(elevation=7.0), 5.0) == (0.0, 7.0)


def test_wind_bends_a_stiff_axis_as_its_torque(drive):
    """Motors that hold still: the load moves with the torque over the stiffness of both meshes."""
    p = build(AduParameters, {'initial_elevation': 0.7, 'wind.azimuth': 800.0, 'wind.gust.kind': 'davenport',
                              'wind.gust.speed': 20.0, 'azimuth.speed_loop.disturbance_observer': 300.0})
    d = drive(p).run(6.0, azimuth=0.0)
    a = d.log['azimuth']
    expected = np.array([torques(p.wind, t)[0] for t in d.times - p.period])
    bending = a['load_position'] - a['motor_position'].mean(axis=1) / 64.0
    slope = np.polyfit(expected, bending, 1)[0]
    assert np.ptp(expected) > 300.0 and slope == pytest.approx(1.0 / (2.0 * 5e6), rel=0.2)
    assert np.corrcoef(expected, bending)[0, 1] > 0.97
    first = drive(p).run(6.0, azimuth=0.0)
    assert first.log.tobytes() == d.log.tobytes()
