"""Targets against skyfield, SGP4 itself, and plain geometry; every way a target can be wrong."""
import datetime
import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from sgp4.io import compute_checksum
from skyfield.api import EarthSatellite, load, wgs84

from pedestal_common.geometry import orbit
from pedestal_common.parameters import build
from pedestal_common.text_files import csv_table
from tracking_receiver_sim import target
from tracking_receiver_sim.params import LeoPassParameters, TargetParameters

LINE_1, LINE_2 = LeoPassParameters().line_1, LeoPassParameters().line_2


def built(duration=120.0, **values):
    return target.build(build(TargetParameters, {name.replace('__', '.'): v for name, v in values.items()}), duration)


def states(made, times):
    """(valid, ENU position [m], velocity [m/s]) at times [s], (n, 7)."""
    made_states = (target.state(made.constants[0], made.breaks, made.coefficients, t) for t in times)
    return np.array([(state.valid, *state.position, *state.velocity) for state in made_states])


def vectors(azimuth, elevation):
    return np.stack([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)], -1)


def write_track(path, rows, header='time_s,latitude_deg,longitude_deg,altitude_m'):
    path.write_text('\n'.join([header, *(row if isinstance(row, str) else ','.join(map(repr, row)) for row in rows)]))
    return str(path)


def circle(n=60):
    """A turn of 1 km radius beside the station, one fix a second, 50 m/s."""
    phase = 0.05 * np.arange(n)
    return [(float(k), 47.41 + 0.009 * math.cos(p), 8.52 + 0.013 * math.sin(p), 800.0 + 2.0 * k)
            for k, p in enumerate(phase)]


# leo_pass

@pytest.fixture(scope='module')
def leo():
    return built()


@pytest.mark.parametrize('ut1_is_utc, allowed_mdeg, allowed_m', [(True, 0.5, 3.0), (False, 15.0, 80.0)])
def test_leo_pass_agrees_with_skyfield(leo, ut1_is_utc, allowed_mdeg, allowed_m):
    times = np.arange(0.0, 120.0, 3.7)
    scale = load.timescale(builtin=True)
    if ut1_is_utc:
        scale.delta_t_function = lambda tt: np.full(np.shape(tt), 32.184 + 37.0)
    start = datetime.datetime.fromisoformat(leo.start_time.replace('Z', '+00:00'))
    when = scale.utc(start.year, start.month, start.day, start.hour, start.minute,
                     start.second + 1e-6 * start.microsecond + times)
    oracle = (EarthSatellite(LINE_1, LINE_2, 'ISS', scale) - wgs84.latlon(47.4, 8.5, 500.0)).at(when).altaz()
    azimuth, elevation, distance = target.look_angles(leo, times)
    apart = np.linalg.norm(vectors(azimuth, elevation) - vectors(oracle[1].radians, oracle[0].radians), axis=1)
    assert 1e3 * np.degrees(apart.max()) < allowed_mdeg
    assert np.abs(distance - oracle[2].m).max() < allowed_m


def test_hermite_pieces_agree_with_sgp4(leo):
    params = TargetParameters()
    satrec = orbit.satellite(params.leo_pass)
    julian, fraction = target._start(params, satrec, 120.0)
    times = np.random.default_rng(1).uniform(-5.0, 125.0, 500)
    position, velocity = orbit.enu(satrec, params.station, julian, fraction, times)
    got = states(leo, times)
    assert np.linalg.norm(got[:, 1:4] - position, axis=1).max() < 2e-3
    assert np.linalg.norm(got[:, 4:7] - velocity, axis=1).max() < 0.03


def test_the_pieces_are_those_of_scipy_to_the_last_bit():
    rng = np.random.default_rng(1)
    x, (y, y_dot) = np.cumsum(rng.uniform(0.5, 2.0, 50)), rng.normal(0.0, 1e6, (2, 50, 3))
    assert np.array_equal(target._hermite(x, y, y_dot), CubicHermiteSpline(x, y, y_dot).c)


def test_run_is_centred_on_the_culmination(leo):
    times = np.arange(0.0, 120.01, 0.1)
    _, elevation, _ = target.look_angles(leo, times)
    assert times[np.argmax(elevation)] == pytest.approx(60.0, abs=0.55)
    assert 30.0 < np.degrees(elevation.max()) < 70.0


def test_pass_finder_takes_the_first_that_fits():
    params = build(TargetParameters, {'leo_pass.culmination_low_deg': 40.0, 'leo_pass.culmination_high_deg': 60.0})
    satrec = orbit.satellite(params.leo_pass)
    when = target.culmination(params, satrec)
    scale = load.timescale(builtin=True)
    sky = EarthSatellite(LINE_1, LINE_2, 'ISS', scale)
    station = wgs84.latlon(47.4, 8.5, 500.0)
    moments, kinds = sky.find_events(station, sky.epoch, sky.epoch + 3.0, altitude_degrees=10.0)
    peaks = [(86400.0 * (moment - sky.epoch), (sky - station).at(moment).altaz()[0].degrees)
             for moment, kind in zip(moments, kinds) if kind == 1]
    first = next(time for time, elevation in peaks if 40.0 <= elevation <= 60.0)
    assert peaks[0][1] > 60.0 and when == pytest.approx(first, abs=0.5)


@pytest.mark.parametrize('text', ['2019-12-09T16:40:03', '2019-12-09T16:40:03.000Z', '2019-12-09T17:40:03+01:00'])
def test_start_time_may_be_named(leo, text):
    named = built(leo_pass__start_time=text)
    assert named.start_time == leo.start_time == '2019-12-09T16:40:03.000Z'
    assert np.array_equal(named.coefficients, leo.coefficients)


def altered(line, first, text):
    """A TLE line with columns replaced and its checksum made right again."""
    line = line[:first] + text + line[first + len(text):]
    return line[:68] + str(compute_checksum(line))


@pytest.mark.parametrize('line_1, line_2, message', [
    (LINE_1[:-1] + '2', LINE_2, "TLE line 1: checksum '2', must be '1'"),
    (LINE_1, LINE_2.replace('51.6439', '51.6438'), "TLE line 2: checksum '2', must be '1'"),
    (LINE_1[:60], LINE_2, 'TLE line 1: 60 characters, must be 69'),
    ('', '', 'TLE line 1: 0 characters'),
    (LINE_2, LINE_1, "TLE line 1: line number '2 '"),
    (LINE_1, LINE_1, "TLE line 2: line number '1 '"),
    (LINE_1, altered(LINE_2, 2, '25545'), "TLE line 2: satellite '25545', must be '25544'"),
    (LINE_1, altered(LINE_2, 8, ' 5x.6439'), "TLE line 2: inclination ' 5x.6439' is not a number"),
    (altered(LINE_1, 20, 'abc.69339541'), LINE_2, "TLE line 1: epoch day 'abc.69339541' is not a number"),
    (LINE_1, altered(LINE_2, 52, '17.50103472'), 'TLE .*25544.*: mrt is less than 1.0|decayed'),
    (LINE_1, altered(LINE_2, 26, '9999999'), 'TLE .*25544')])
def test_broken_tle(line_1, line_2, message):
    with pytest.raises(orbit.TargetError, match=message) as raised:
        built(leo_pass__line_1=line_1, leo_pass__line_2=line_2)
    assert '\n' not in str(raised.value)


@pytest.mark.parametrize('values, message', [
    ({'station__latitude_deg': 80.0}, r'no culmination between 30 and 70 deg within 3 days .* latitude 80'),
    ({'station__latitude_deg': 89.0}, 'the satellite does not rise'),
    ({'leo_pass__start_time': 'yesterday'}, "start_time = 'yesterday': must be UTC as ISO 8601"),
    ({'leo_pass__start_time': '2026-01-01T00:00:00'}, 'days from the TLE epoch 2019-12-09T16:38:29.363Z, must be'),
    ({'leo_pass__start_time': '2019-12-09T17:20:00'}, 'below the horizon from 2019-12-09T17:20:00.000Z for 120 s')])
def test_pass_that_cannot_be(values, message):
    with pytest.raises(orbit.TargetError, match=message):
        built(**values)


@pytest.mark.parametrize('values, message', [
    ({'kind': 'flyby', 'flyby__height': -100.0}, 'target flyby: below the horizon for 120 s: highest -4.0 deg'),
    ({'kind': 'ramp', 'angle__elevation': 0.0, 'angle__elevation_rate': -0.01}, ''),
    ({'kind': 'ramp', 'angle__elevation': 0.0, 'angle__elevation_amplitude': -0.1, 'angle__start': 0.0}, ''),
    ({'kind': 'step', 'angle__elevation': 0.0, 'angle__elevation_amplitude': -0.1}, 'target step: .* highest -5.7')])
def test_a_target_below_the_horizon_throughout_is_refused(values, message):
    if not message:
        built(**values)
        return
    with pytest.raises(orbit.TargetError, match=message):
        built(**values)
    params = build(TargetParameters, {name.replace('__', '.'): value for name, value in values.items()})
    target.build(params, 120.0, horizon_mask=-0.2)      # an antenna on a mountain looks down


@pytest.mark.parametrize('content, message', [
    ('time_s,latitude_deg,longitude_deg,altitude_m\n' + ''.join(f'{k},{47.4 + 1e-3 * k:.4f},8.52,1500\n'
                                                                for k in range(20)),
     'a.csv: below the horizon for 3 s at latitude 8.52, longitude 47.4 deg: highest -25.5 deg'),
    ('utc,az,el\n' + ''.join(f'2026-06-01T12:00:{k:02}Z,{120 + 0.1 * k:.1f},-40\n' for k in range(20)),
     'a.csv: below the horizon from 2026-06-01T12:00:00.000Z for 3 s at latitude 8.52, .*: highest -40.0 deg')])
def test_a_file_below_the_horizon_throughout_is_refused(content, message, tmp_path):
    """The latitude and the longitude of the station were exchanged; the angles of a table are below the horizon."""
    path = tmp_path / 'a.csv'
    path.write_text(content)
    with pytest.raises(orbit.TargetError, match=message):
        built(3.0, kind='track_file', track_file__path=str(path), station__latitude_deg=8.52,
              station__longitude_deg=47.4, station__height=1200.0)


# track_file

def test_track_file_passes_through_its_fixes(tmp_path):
    rows = circle()
    made = built(60.0, kind='track_file', track_file__path=write_track(tmp_path / 'a.csv', rows))
    time, latitude, longitude, altitude = np.array(rows).T
    fixes = wgs84.latlon(latitude, longitude, altitude).itrs_xyz.m
    station = wgs84.latlon(47.4, 8.5, 500.0).itrs_xyz.m
    _, _, distance = target.look_angles(made, time)
    assert distance == pytest.approx(np.linalg.norm(fixes - station[:, None], axis=0), abs=1e-3)
    azimuth, elevation, _ = target.look_angles(made, time[:1])
    bearing = math.atan2(0.02 * math.cos(math.radians(47.4)), 0.019)
    assert azimuth[0] == pytest.approx(bearing, abs=0.004)
    assert 0.0 < elevation[0] < 0.2


def test_track_file_velocity_and_acceleration_are_continuous(tmp_path):
    made = built(60.0, kind='track_file', track_file__path=write_track(tmp_path / 'a.csv', circle()))
    knots = made.breaks[1:-1]
    before, after = states(made, knots - 1e-6), states(made, knots + 1e-6)
    assert np.abs(after[:, 4:] - before[:, 4:]).max() < 1e-4
    speed = np.linalg.norm(states(made, np.arange(1.0, 58.0, 0.1))[:, 4:6], axis=1)
    assert speed == pytest.approx(np.full(len(speed), 50.0), rel=0.05)


def test_track_straight_up_is_straight_up(tmp_path):
    rows = [(10.0 + k, 47.4, 8.5, 600.0 + 3.0 * k) for k in range(10)]
    made = built(5.0, kind='track_file', track_file__path=write_track(tmp_path / 'a.csv', rows), track_file__start=2.0)
    got = states(made, [-2.0, 0.0, 4.25])
    assert got[:, 1:4] == pytest.approx(np.array([[0, 0, 100.0], [0, 0, 106.0], [0, 0, 118.75]]), abs=1e-6)
    assert states(made, [-2.01, 7.01])[:, 0].tolist() == [0.0, 0.0]


GOOD = [(float(k), 47.4, 8.5, 600.0) for k in range(6)]


@pytest.mark.parametrize('rows, message', [
    (GOOD[:4] + [(3.0, 47.4, 8.6, 600.0)], r'line 6: time_s = 3: 0 s after the row before, must be above 0'),
    (GOOD[:3] + [(2.0, 47.4, 8.5, 600.0)], r'3 fixes, .* passed over 1 x row that repeats time and place'),
    (GOOD[:3] + [(1.5, 47.4, 8.5, 600.0)], r'line 5: time_s = 1.5: -0.5 s after'),
    (GOOD[:3] + [(60.0, 47.4, 8.5, 600.0)], r'line 5: time_s = 60: 58 s after .* at most max_gap = 10 s'),
    (GOOD[:3] + ['3.0,47.4,east,600'], r"line 5: longitude_deg = 'east': must be a number"),
    (GOOD[:3] + ['3.0,47.4,8.5'], r"line 5: the row ends before the column 'altitude_m'"),
    (GOOD[:3] + ['3.0,47.4,8.5,'], r"line 5: altitude_m = '': must be a number"),
    (GOOD[:3] + ['nan,47.4,8.5,600'], r'line 5: time_s = nan: must be'),
    (GOOD[:3] + ['3.0,47.4,inf,600'], r'line 5: longitude_deg = inf: must be -180 to 360'),
    (GOOD[:3] + [(3.0, 95.0, 8.5, 600.0)], r'line 5: latitude_deg = 95: must be -90 to 90'),
    (GOOD[:3] + [(3.0, 47.4, -200.0, 600.0)], r'line 5: longitude_deg = -200'),
    (GOOD[:3] + [(3.0, 47.4, 8.5, -9000.0)], r'line 5: altitude_m = -9000'),
    (GOOD[:3], r'3 fixes, must be at least 4'),
    ([], r'0 fixes')])
def test_broken_track(tmp_path, rows, message):
    path = write_track(tmp_path / 'broken.csv', rows)
    with pytest.raises(csv_table.TableError, match='broken.csv: ' + message) as raised:
        built(kind='track_file', track_file__path=path)
    assert '\n' not in str(raised.value)


def test_broken_track_files(tmp_path):
    def message(path, **values):
        with pytest.raises(ValueError) as raised:
            built(kind='track_file', track_file__path=str(path), **values)
        assert '\n' not in str(raised.value)
        return str(raised.value)

    assert 'track_file.path is empty: give --param tracking_receiver.target.track_file.path=FILE' in message('')
    assert 'No such file' in message(tmp_path / 'none.csv')
    assert 'not a regular file' in message(tmp_path)
    assert "column 'altitude_m' is missing" in message(
        write_track(tmp_path / 'a.csv', ['1,2,3'], 'time_s,latitude_deg,longitude_deg'))
    (tmp_path / 'empty.csv').write_text('')
    assert "column 'time_s' is missing" in message(tmp_path / 'empty.csv')
    (tmp_path / 'binary.csv').write_bytes(b'\x89\xff\x00\x01' * 100)
    assert 'line 1: byte 0x00: must be text in UTF-8' in message(tmp_path / 'binary.csv')
    assert 'start = 5 s: must be before the end of the track at 5 s' in message(
        write_track(tmp_path / 'short.csv', GOOD), track_file__start=5.0)


# flyby and angle targets

@pytest.mark.parametrize('heading', [90.0, 0.0, -140.0])
def test_flyby_geometry(heading):
    made = built(60.0, kind='flyby', flyby__closest_distance=400.0, flyby__height=300.0, flyby__speed=20.0,
                 flyby__heading=math.radians(heading), flyby__closest_time=25.0)
    times = np.arange(0.0, 60.0, 0.5)
    azimuth, elevation, distance = target.look_angles(made, times)
    assert times[np.argmin(distance)] == 25.0 and distance.min() == pytest.approx(500.0)
    abeam = math.radians(heading - 90.0)
    bearing = np.angle(np.exp(1j * (azimuth - abeam)))
    assert bearing == pytest.approx(np.arctan2(20.0 * (times - 25.0), 400.0), abs=1e-12)
    assert elevation.max() == pytest.approx(math.atan2(300.0, 400.0))


@pytest.mark.parametrize('kind', ['sine', 'step', 'ramp'])
def test_angle_targets(kind):
    made = built(kind=kind, angle__azimuth=1.0, angle__elevation=0.5, angle__start=2.0, angle__range=5e3,
                 angle__azimuth_amplitude=0.2, angle__elevation_amplitude=-0.1, angle__frequency=0.25,
                 angle__azimuth_rate=0.03, angle__elevation_rate=0.02)
    times = np.arange(0.0, 8.0, 0.25)
    tau = np.maximum(times - 2.0, 0.0)
    shape = {'sine': np.sin(0.5 * math.pi * tau), 'step': np.where(times >= 2.0, 1.0, 0.0)}.get(kind)
    expected = (1.0 + 0.03 * tau, 0.5 + 0.02 * tau) if kind == 'ramp' else (1.0 + 0.2 * shape, 0.5 - 0.1 * shape)
    azimuth, elevation, distance = target.look_angles(made, times)
    assert azimuth == pytest.approx(expected[0], abs=1e-12) and elevation == pytest.approx(expected[1], abs=1e-12)
    assert distance == pytest.approx(np.full(len(times), 5e3))


@pytest.mark.parametrize('kind', ['leo_pass', 'track_file', 'flyby', 'sine', 'step', 'ramp'])
def test_velocity_is_the_derivative_of_position(tmp_path, kind):
    made = built(50.0, kind=kind, track_file__path=write_track(tmp_path / 'a.csv', circle()), angle__start=1.0,
                 angle__elevation_rate=0.01)
    times = np.random.default_rng(2).uniform(2.0, 48.0, 100)
    times = times[np.abs(times - np.round(times)) > 0.01]
    h = 1e-3
    slope = (states(made, times + h)[:, 1:4] - states(made, times - h)[:, 1:4]) / (2.0 * h)
    velocity = states(made, times)[:, 4:7]
    assert velocity == pytest.approx(slope, abs=1e-5 * max(1.0, np.abs(velocity).max()))
    if kind != 'step':
        assert np.abs(velocity).max() > 10.0


@pytest.mark.parametrize('kind', ['leo_pass', 'flyby'])
def test_outside_its_track_a_target_is_nowhere(kind):
    made = built(60.0, kind=kind)
    inside, outside = states(made, [-5.0, 65.0]), states(made, [-5.01, 66.01, 1e9, math.nan])
    assert np.all(inside[:, 0] == 1) and np.all(np.isfinite(inside))
    assert np.all(outside[:, 0] == 0) and np.all(np.isnan(outside[:, 1:]))
    azimuth, elevation, distance = target.look_angles(made, [1e4])
    assert np.isnan([azimuth[0], elevation[0], distance[0]]).all()
