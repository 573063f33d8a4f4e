"""What a flight is made of: held positions, smoothing against the Rauch-Tung-Striebel smoother of filterpy, limits,
and the station that stands beside it, judged by skyfield's earth."""
import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from skyfield.api import wgs84

from pedestal_common.geometry import geodesy
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.text_files import csv_table
from tracking_receiver_sim.params import TargetParameters, TrackFileParameters
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import fixes as logs
from tracking_receiver_sim.tracks import flight

STATION = StationParameters()
DEGREE = math.radians(1.0) * geodesy.EARTH_RADIUS_M


def log(time, east, north, up, latitude=47.4, longitude=8.5):
    """Fixes [m] about a place, exact to the earth's curvature."""
    return logs.Fixes('flight.csv', np.arange(len(time)) + 2, np.asarray(time, float),
                      latitude + np.asarray(north) / DEGREE,
                      longitude + np.asarray(east) / DEGREE / math.cos(math.radians(latitude)),
                      600.0 + np.asarray(up, float), False, 'flight.csv: CSV')


def circle(n=120, speed=50.0, radius=1000.0):
    phase = speed / radius * np.arange(n)
    return log(np.arange(n), radius * np.cos(phase), radius * np.sin(phase), np.zeros(n))


def noisy(n=200, sigma=8.0, seed=1):
    """A flight that turns, once every 0.5 to 1.5 s, with white noise."""
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.5, 1.5, n))
    east, north, up = 40.0 * time, 800.0 * np.sin(0.05 * time), 200.0 + 50.0 * np.cos(0.03 * time)
    return log(time, *(x + sigma * random.standard_normal(n) for x in (east, north, up)))


def track(**values):
    return TrackFileParameters(path='flight.csv', **values)


def test_geocentric_and_frame_agree_with_skyfield():
    station = StationParameters(latitude_deg=-33.2, longitude_deg=151.4, height=87.0)
    origin, to_enu = geodesy.station_frame(station)
    oracle = wgs84.latlon(-33.2, 151.4, 87.0)
    assert origin == pytest.approx(oracle.itrs_xyz.m, abs=1e-6)
    up = wgs84.latlon(-33.2, 151.4, 1087.0).itrs_xyz.m - oracle.itrs_xyz.m
    assert to_enu @ up == pytest.approx([0.0, 0.0, 1000.0], abs=1e-6)


@pytest.mark.parametrize('latitude', [0.0, 47.4, -89.99, 90.0])
def test_destination_is_as_far_and_in_the_direction_that_was_asked(latitude):
    for bearing in np.radians([0.0, 70.0, 200.0, 300.0]):
        there = geodesy.destination(latitude, 179.99, bearing, 5000.0)
        assert -180.0 <= there[1] <= 180.0
        apart = wgs84.latlon(*there).itrs_xyz.m - wgs84.latlon(latitude, 179.99).itrs_xyz.m
        assert np.linalg.norm(apart) == pytest.approx(5000.0, rel=0.007)
        if abs(latitude) < 89.0:
            east, north, _ = geodesy.station_frame(StationParameters(latitude, 179.99, 0.0))[1] @ apart
            assert math.remainder(math.atan2(east, north) - bearing, 2.0 * math.pi) == pytest.approx(0.0, abs=0.01)


# held positions

def test_held_positions_are_dropped_and_nothing_else():
    moving = circle()
    held = [*range(10), 9, 9, *range(12, 50), 49, *range(51, 118), 117, 117]
    repeated = moving._replace(latitude=moving.latitude[held], longitude=moving.longitude[held],
                               altitude=moving.altitude + 3.0 * np.arange(120))
    kept, dropped = flight.without_held(repeated, 10.0)
    assert dropped == 5 and kept.line.tolist() == [k + 2 for k in range(120) if k not in (10, 11, 50, 118, 119)]
    assert np.array_equal(kept.latitude, moving.latitude[kept.line - 2])
    laid = flight.lay_out(repeated, track(), STATION)
    assert '115 of 120 fixes, 5 held positions dropped' in laid.summary[0]
    assert np.array_equal(laid.coefficients, flight.lay_out(kept, track(), STATION).coefficients)
    assert laid.speed == pytest.approx(50.2, abs=0.5)


@pytest.mark.parametrize('begin, end, dropped', [(20, 30, 9), (20, 31, 0), (0, 120, 0)])
def test_a_target_that_stands_is_not_held(begin, end, dropped):
    """Of the positions begin to end - 1 all are the same; max_gap is 10 s."""
    still = circle()
    for name in ('latitude', 'longitude'):
        getattr(still, name)[begin:end] = getattr(still, name)[begin]
    assert flight.without_held(still, 10.0)[1] == dropped


# smoothing

@pytest.mark.parametrize('noise', [0.3, 3.0])
def test_smoothing_is_the_rts_smoother(noise):
    fixes = noisy()
    time, enu = fixes.time, np.column_stack((40.0 * fixes.time, fixes.latitude * 1e5, fixes.altitude))
    enu -= enu[0]
    spline = flight.smoothed(time, enu, track(smooth=True, sigma_horizontal=8.0, sigma_vertical=2.0,
                                              acceleration_noise=noise))
    assert np.array_equal(spline.x, time)
    for axis, sigma in enumerate((8.0, 8.0, 2.0)):
        kalman = KalmanFilter(dim_x=2, dim_z=1)
        kalman.x, kalman.P = np.array([[enu[0, axis]], [0.0]]), np.diag([1e8, 1e8])
        kalman.H, kalman.R = np.array([[1.0, 0.0]]), np.array([[sigma**2]])
        steps = [0.0, *np.diff(time)]
        F = [np.array([[1.0, T], [0.0, 1.0]]) for T in steps]
        Q = [noise**2 * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]) for T in steps]
        means, covariances, _, _ = kalman.batch_filter(enu[:, axis], Fs=F, Qs=Q)
        x, _, _, _ = kalman.rts_smoother(means, covariances, Fs=F, Qs=Q)
        assert spline(time)[:, axis] == pytest.approx(x[:, 0, 0], abs=1e-3)
        assert spline(time, 1)[:, axis] == pytest.approx(x[:, 1, 0], abs=1e-3)


def test_smoothing_comes_nearer_to_the_flight():
    exact, fixes = noisy(sigma=0.0), noisy(sigma=8.0)
    truth = flight.lay_out(exact, track(), STATION)
    with pytest.raises(csv_table.TableError):
        flight.lay_out(fixes, track(), STATION)
    raw = flight.lay_out(fixes, track(max_acceleration=1000.0), STATION)
    smooth = flight.lay_out(fixes, track(smooth=True, sigma_horizontal=8.0, sigma_vertical=8.0), STATION)
    off = [np.sqrt(np.mean((laid.coefficients[3] - truth.coefficients[3])**2)) for laid in (raw, smooth)]
    assert off[0] == pytest.approx(8.0, rel=0.1) and off[1] < 5.0


def test_the_residual_is_stated():
    fixes = noisy()
    rough = flight.lay_out(fixes, track(max_acceleration=1000.0), STATION)
    smooth = flight.lay_out(fixes, track(smooth=True), STATION)
    apart = np.linalg.norm(rough.coefficients[3] - smooth.coefficients[3], axis=1)
    said = smooth.summary[0].partition('off the fixes by ')[2].split()
    assert float(said[0]) == pytest.approx(np.sqrt(np.mean(apart**2)), rel=0.02) and said[1:3] == ['m', 'rms,']
    assert float(said[3]) == pytest.approx(apart.max(), rel=0.01)


# limits

def test_peaks_of_a_circle():
    laid = flight.lay_out(circle(speed=50.0, radius=500.0), track(), STATION)
    assert laid.speed == pytest.approx(50.0, rel=0.02)
    assert 'at most 50' in laid.summary[1] and ' 119 s, ' in f' {laid.summary[1]}'
    acceleration = float(laid.summary[1].partition(' m/s and ')[2].split()[0])
    assert acceleration == pytest.approx(50.0**2 / 500.0, rel=0.05)


def test_an_impossible_fix_is_refused_with_its_line():
    fixes = circle()
    fixes.latitude[60] += 300.0 / DEGREE
    with pytest.raises(csv_table.TableError, match='flight.csv: line 62: acceleration = .* m/s2 at this fix: must be '
                       'at most max_acceleration = 50 m/s2 or smoothed by smooth = true'):
        flight.lay_out(fixes, track(), STATION)
    smooth = flight.lay_out(fixes, track(smooth=True, sigma_horizontal=30.0), STATION)
    assert smooth.speed < 120.0
    with pytest.raises(csv_table.TableError, match='line 6.: .* = .* m/s2 after smoothing'):
        flight.lay_out(fixes, track(smooth=True, max_acceleration=1.0), STATION)


def test_what_is_too_fast_is_refused():
    fast = log(np.arange(10), 900.0 * np.arange(10), np.zeros(10), np.zeros(10))
    with pytest.raises(csv_table.TableError, match='line .*: speed = 90.* m/s at this fix: must be at most max_speed'):
        flight.lay_out(fast, track(), STATION)
    assert flight.lay_out(fast, track(max_speed=1000.0), STATION).speed == pytest.approx(900.0, rel=0.01)


def test_too_few_fixes_to_smooth():
    with pytest.raises(csv_table.TableError, match='4 fixes, must be at least 5 to be smoothed'):
        flight.lay_out(circle(4), track(smooth=True), STATION)


def test_quantisation_is_stated():
    coarse = circle()
    coarse.altitude[:] = np.round(7.62 * (80 + np.arange(120) // 3), 1)
    laid = flight.lay_out(coarse, track(max_acceleration=100.0), STATION)
    assert 'times in whole seconds (half of one is up to 2' in laid.summary[0]
    assert 'altitudes in steps of 25 ft' in laid.summary[0]
    fine = flight.lay_out(noisy(sigma=0.0), track(), STATION).summary[0]
    assert 'whole seconds' not in fine and 'steps' not in fine


def test_stamp_0_of_a_dated_flight():
    dated = circle()._replace(time=1532340000.0 + np.arange(120), dated=True)
    assert flight.lay_out(dated, track(start=30.5), STATION).start_time == '2018-07-23T10:00:30.500Z'
    assert flight.lay_out(circle(), track(), STATION).start_time == ''


# the station

SHAPES = {'circle': circle(), 'line': log(np.arange(100), 60.0 * np.arange(100), np.zeros(100), np.zeros(100)),
          'climb': log(np.arange(50), np.zeros(50), np.zeros(50), 5.0 * np.arange(50)),
          'to and fro': log(np.arange(100), 3e3 * np.sin(0.02 * np.arange(100)), 0.1 * np.arange(100), np.zeros(100)),
          'high': log(np.arange(200), 250.0 * np.arange(200), np.zeros(200), np.full(200, 10e3)),
          'pole': log(np.arange(100), np.zeros(100), 50.0 * np.arange(100), np.zeros(100), latitude=89.9),
          'date line': log(np.arange(100), -20.0 * np.arange(100), np.zeros(100), np.zeros(100), 10.0, -179.995)}


@pytest.mark.parametrize('shape', SHAPES)
def test_the_station_sees_the_whole_flight_and_can_follow_it(shape):
    fixes = SHAPES[shape]
    fixes = fixes._replace(longitude=(fixes.longitude + 180.0) % 360.0 - 180.0)
    station = flight.station_for(fixes, track())
    there = wgs84.latlon(station.latitude_deg, station.longitude_deg, station.height).itrs_xyz.m
    flown = wgs84.latlon(fixes.latitude, fixes.longitude, fixes.altitude).itrs_xyz.m.T - there
    e, n, u = (flown @ geodesy.station_frame(station)[1].T).T
    assert (u > 0.0).all()
    turned = np.abs(np.diff(np.unwrap(np.arctan2(e, n)))) / np.diff(fixes.time)
    assert turned.max() < 1.02 * flight.MAX_AZIMUTH_RATE_RAD_S
    least = np.hypot(e, n).min()
    speed = flight.lay_out(fixes, track(), station).speed
    assert least == pytest.approx(max(flight.MIN_RANGE_M, speed / flight.MAX_AZIMUTH_RATE_RAD_S), rel=0.02)


def test_what_is_open_follows_from_the_file(tmp_path):
    fixes = circle()
    path = tmp_path / 'flight.csv'
    rows = (f'{t:g},{a:.9f},{o:.9f},{h:.3f}' for t, a, o, h in zip(
        fixes.time, fixes.latitude, fixes.longitude, fixes.altitude))
    path.write_text('time_s,latitude_deg,longitude_deg,altitude_m\n' + '\n'.join(rows))
    target = TargetParameters(kind='track_file', track_file=TrackFileParameters(path=str(path), start=9.5))
    found = track_files.derived_parameters(target, set())
    assert tuple(found) == track_files.DERIVED_PARAMETERS and found['duration'] == 109.4
    station = StationParameters(*(found[name] for name in flight.STATION_FIELDS))
    assert station == flight.station_for(track_files.read(target.track_file)[1], target.track_file)
    there = wgs84.latlon(station.latitude_deg, station.longitude_deg, station.height).itrs_xyz.m
    flown = wgs84.latlon(fixes.latitude, fixes.longitude, fixes.altitude).itrs_xyz.m.T - there
    assert 0.0 <= found['receiver.reference_range'] - np.linalg.norm(flown, axis=1).max() < 10.0
    given = track_files.derived_parameters(target, {'target.station.latitude_deg', 'target.station.longitude_deg'})
    assert given['target.station.latitude_deg'] == 47.4 and given['target.station.longitude_deg'] == 8.5
    assert given['target.station.height'] == station.height
