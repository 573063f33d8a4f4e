"""Orbits and tables of directions: an orbit of SGP4, as skyfield turns it into each frame, written as a file and read
back; the interpolation against beyond's; what files may not be."""
import datetime
import re

import numpy as np
import pytest
from beyond.io import ccsds
from skyfield.api import EarthSatellite, load, wgs84
from skyfield.framelib import ICRS_to_J2000, itrs, true_equator_and_equinox_of_date
from skyfield.sgp4lib import TEME

from pedestal_common.text_files import csv_table
from tracking_receiver_sim import target
from tracking_receiver_sim.params import (
    AngleParameters,
    LeoPassParameters,
    StationParameters,
    TargetParameters,
    TrackFileParameters,
)
from tracking_receiver_sim.tracks import files as track_files
from tracking_receiver_sim.tracks import oem
from tracking_receiver_sim.tracks.states import interpolated

SCALE = load.timescale(builtin=True)
ISS = EarthSatellite(LeoPassParameters().line_1, LeoPassParameters().line_2, 'ISS', SCALE)
STATION = StationParameters()
BEGIN = datetime.datetime(2019, 12, 9, 16, 30, 0)
FRAMES = {'GCRF': None, 'EME2000': None, 'TEME': TEME, 'TOD': true_equator_and_equinox_of_date, 'ITRF2014': itrs}


def instants(seconds):
    """skyfield's times at seconds after BEGIN."""
    return SCALE.utc(BEGIN.year, BEGIN.month, BEGIN.day, BEGIN.hour, BEGIN.minute, seconds)


def states(frame, step=60.0, count=30):
    """(seconds (n,), positions, velocities (n, 3) [km], [km/s]) of the ISS in a frame, from skyfield."""
    seconds = step * np.arange(count)
    at = ISS.at(instants(seconds))
    if FRAMES[frame] is not None:
        r, v = at.frame_xyz_and_velocity(FRAMES[frame])
        r, v = r.km.T, v.km_per_s.T
    else:
        r, v = at.position.km.T, at.velocity.km_per_s.T
        if frame == 'EME2000':
            r, v = r @ ICRS_to_J2000.T, v @ ICRS_to_J2000.T
    return seconds, r, v


def iso(seconds, ahead=0.0):
    when = BEGIN + datetime.timedelta(seconds=seconds + ahead)
    return when.isoformat(timespec='microseconds')


def oem_text(frame='EME2000', step=60.0, count=30, interpolation=('HERMITE', 7), system='UTC', ahead=0.0, **meta):
    seconds, r, v = states(frame, step, count)
    lines = ['CCSDS_OEM_VERS = 2.0', 'COMMENT made by a test', 'CREATION_DATE = 2019-12-09T00:00:00',
             'ORIGINATOR = TEST', 'META_START', 'OBJECT_NAME = ISS', 'OBJECT_ID = 1998-067-A', 'CENTER_NAME = EARTH',
             f'REF_FRAME = {frame}', f'TIME_SYSTEM = {system}', f'START_TIME = {iso(seconds[0], ahead)}',
             *(f'{key} = {value}' for key, value in meta.items()), f'STOP_TIME = {iso(seconds[-1], ahead)}',
             *((f'INTERPOLATION = {interpolation[0]}', f'INTERPOLATION_DEGREE = {interpolation[1]}')
               if interpolation else ()), 'META_STOP',
             *(f'{iso(t, ahead)} ' + ' '.join(f'{x:.9f}' for x in (*a, *b)) for t, a, b in zip(seconds, r, v)),
             'COVARIANCE_START', 'EPOCH = 2019-12-09T16:30:00', '1.0', 'COVARIANCE_STOP']
    return '\n'.join(lines) + '\n'


def stk_text(frame='J2000', step=60.0, unit=1000.0, method=('Lagrange', 7), velocity=True):
    seconds, r, v = states({'J2000': 'EME2000', 'Fixed': 'ITRF2014', 'TEMEOfDate': 'TEME'}[frame], step)
    lines = ['stk.v.11.0', '# WrittenBy a test', 'BEGIN Ephemeris', f'NumberOfEphemerisPoints {len(seconds)}',
             f'ScenarioEpoch            {BEGIN.day} {BEGIN:%b %Y %H:%M:%S}.000',
             f'InterpolationMethod {method[0]}',
             f'InterpolationSamplesM1 {method[1]}', 'CentralBody Earth',
             f'CoordinateSystem {frame}',
             *(('DistanceUnit Kilometers',) if unit == 1.0 else ()),
             'BEGIN SegmentBoundaryTimes', ' 0.0', 'END SegmentBoundaryTimes',
             'EphemerisTimePosVel' if velocity else 'EphemerisTimePos',
             *(f'{t:.3f} ' + ' '.join(f'{x * unit:.9e}' for x in ((*a, *b) if velocity else a))
               for t, a, b in zip(seconds, r, v)), 'END Ephemeris']
    return '\n'.join(lines) + '\n'


def flown(path, text, seconds=600.0, start=300.0, **track):
    """The target.Target of a file with this text."""
    path.write_text(text) if isinstance(text, str) else path.write_bytes(text)
    return target.build(TargetParameters(kind='track_file', track_file=TrackFileParameters(
        path=str(path), start=start, **track)), seconds)


def apart(built, times, start=300.0):
    """Largest distance [m] from the orbit as skyfield sees it from the station."""
    place = wgs84.latlon(STATION.latitude_deg, STATION.longitude_deg, STATION.height)
    seen = (ISS - place).at(instants(start + times))
    elevation, azimuth, distance = seen.altaz()
    a, e, r = azimuth.radians, elevation.radians, distance.m
    true = np.column_stack((r * np.cos(e) * np.sin(a), r * np.cos(e) * np.cos(a), r * np.sin(e)))
    ours = np.array([target.on_track(built.breaks, built.coefficients, t).position for t in times])
    return np.linalg.norm(ours - true, axis=1).max()


TIMES = np.array([0.0, 3.3, 77.7, 200.0, 311.1, 455.5, 600.0])
CONSISTENT = 'LAGRANGE', 9
"""Without velocities: those of SGP4 are 10 mm/s off the derivative of its positions, 7 cm in 60 s of HERMITE."""


@pytest.mark.parametrize('frame', FRAMES)
def test_an_oem_is_where_skyfield_says_in_every_frame(frame, tmp_path):
    built = flown(tmp_path / 'iss.oem', oem_text(frame, interpolation=CONSISTENT))
    assert apart(built, TIMES) < 0.01
    assert built.start_time == '2019-12-09T16:35:00.000Z'
    assert built.summary[0] == f'iss.oem: CCSDS OEM of ISS (1998-067-A): 30 states in {frame}, LAGRANGE of degree 9'
    assert 'highest 69.' in built.summary[1]


@pytest.mark.parametrize('method, degree, step, error', [
    ('HERMITE', 7, 60.0, 0.07), ('', 0, 60.0, 0.07), ('HERMITE', 3, 60.0, 0.33), ('LAGRANGE', 7, 60.0, 2.4e-4),
    ('LAGRANGE', 5, 60.0, 3.1e-3), ('LINEAR', 1, 1.0, 9.2)])
def test_the_interpolation_is_that_of_the_file(method, degree, step, error, tmp_path):
    """Its error is what it must be, so that no other one was taken."""
    text = oem_text(interpolation=(method, degree) if method else None, step=step, count=int(1800 / step))
    assert 0.5 * error < apart(flown(tmp_path / 'iss.oem', text), TIMES) < 2.0 * error


def test_lagrange_agrees_with_beyond_and_both_with_a_polynomial_orbit(tmp_path):
    path = tmp_path / 'iss.oem'
    path.write_text(oem_text(interpolation=('LAGRANGE', 9)))
    segment = oem.read(str(path)).segments[0]
    theirs = ccsds.loads(path.read_text().partition('COVARIANCE_START')[0])
    times = np.array([3.3, 77.7, 400.0, 911.1, 1700.0])
    ours, _ = interpolated(segment, segment.t[0] + times)
    for t, r in zip(times.tolist(), ours):
        state = theirs.interpolate(theirs.start + datetime.timedelta(seconds=t))
        assert np.asarray(state.base[:3]) == pytest.approx(r, abs=0.01)
    t = np.cumsum(np.random.default_rng(1).uniform(20.0, 60.0, 12))
    curve = np.polynomial.Polynomial([7e6, 3e3, -4.0, 1e-2, -3e-5, 2e-8, 1e-11, -4e-14])
    made = segment._replace(t=t, r=np.column_stack([curve(t)] * 3), v=np.column_stack([curve.deriv()(t)] * 3))
    for method in ('HERMITE', 'LAGRANGE'):
        between = np.linspace(t[0], t[-1], 50)
        r, v = interpolated(made._replace(method=method, degree=7), between)
        assert r[:, 0] == pytest.approx(curve(between), abs=1e-6) and v[:, 0] == pytest.approx(
            curve.deriv()(between), abs=1e-6)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'cp1252', 'utf-16'])
def test_a_mark_and_accents_in_comments_are_read(encoding, tmp_path):
    for name, text in (('iss.oem', oem_text(interpolation=CONSISTENT).replace('made by a test', 'fait à Zürich')),
                       ('iss.e', stk_text().replace('a test', 'à Zürich'))):
        assert apart(flown(tmp_path / name, text.encode(encoding)), TIMES) < 0.1, name


@pytest.mark.parametrize('system, ahead', [('TAI', 37.0), ('TT', 69.184), ('GPS', 18.0)])
def test_the_time_system_is_that_of_the_file(system, ahead, tmp_path):
    built = flown(tmp_path / 'iss.oem', oem_text('ITRF2014', interpolation=CONSISTENT, system=system, ahead=ahead))
    assert apart(built, TIMES) < 0.02


@pytest.mark.parametrize('options', [
    {}, {'frame': 'Fixed', 'unit': 1.0}, {'frame': 'TEMEOfDate'}, {'method': ('Hermite', 3)}, {'velocity': False}])
def test_an_stk_ephemeris_is_where_skyfield_says(options, tmp_path):
    built = flown(tmp_path / 'iss.e', stk_text(**options))
    assert apart(built, TIMES) < 0.1
    assert built.start_time == '2019-12-09T16:35:00.000Z' and 'STK ephemeris: 30 states' in built.summary[0]


def test_segments_join_where_they_abut_and_the_object_is_chosen(tmp_path):
    """Two segments of one object that meet, and one of another."""
    head, _, rest = oem_text().partition('META_START')
    meta, _, data = rest.partition('META_STOP\n')
    lines = data.splitlines()[:30]
    text = head + ''.join(f'META_START{of}META_STOP\n' + '\n'.join(part) + '\n' for of, part in (
        (meta, lines[:12]), (meta, lines[11:]), (meta.replace('ISS', 'OTHER').replace('067', '068'), lines[:10])))
    assert apart(flown(tmp_path / 'a.oem', text, aircraft='iss'), TIMES) < 0.2
    with pytest.raises(csv_table.TableError, match='must name one of the 2 objects in the file: ISS 1998-067-A, OT'):
        flown(tmp_path / 'a.oem', text)
    apart_text = text.replace('\n'.join(lines[11:]), '\n'.join(lines[13:]))
    with pytest.raises(csv_table.TableError, match=r'a.oem: line \d+: gap of 120 s above this state, in the'):
        flown(tmp_path / 'a.oem', apart_text, aircraft='1998-067-A')


def test_what_a_scenario_leaves_open_is_the_first_pass(tmp_path):
    path = tmp_path / 'iss.oem'
    path.write_text(oem_text('TEME', count=120))
    of = TargetParameters(kind='track_file', track_file=TrackFileParameters(path=str(path)))
    found = track_files.derived_parameters(of, set())
    zero = found['target.track_file.start']
    t = SCALE.utc(2019, 12, 9, 16, 30, 0), SCALE.utc(2019, 12, 9, 18, 0, 0)
    when, events = ISS.find_events(wgs84.latlon(47.4, 8.5, 500.0), *t, altitude_degrees=0.0)
    rise, down = ((86400.0 * (when[i] - t[0])) for i in (0, 2))
    assert list(events[:3]) == [0, 1, 2] and 0.0 <= zero - rise < 1.1 and zero == round(zero, 6)
    assert 0.0 <= down - zero - found['duration'] < 0.2
    assert 2.2e6 < found['receiver.reference_range'] < 2.8e6 and found['target.station.latitude_deg'] == 47.4
    later = track_files.derived_parameters(TargetParameters(kind='track_file', track_file=TrackFileParameters(
        path=str(path), start=zero + 100.0)), {'target.track_file.start'})
    assert later['duration'] == pytest.approx(found['duration'] - 100.0, abs=0.11)
    with pytest.raises(csv_table.TableError, match='the orbit does not climb above 10 deg at latitude -80'):
        track_files.derived_parameters(TargetParameters(kind='track_file',
                                                        station=StationParameters(latitude_deg=-80.0),
                                         track_file=TrackFileParameters(path=str(path))), set())


def directions(count=61, step=10.0, start=300.0):
    """(seconds, azimuth, elevation [deg]) of the ISS from the station."""
    seconds = start + step * np.arange(count)
    place = wgs84.latlon(STATION.latitude_deg, STATION.longitude_deg, STATION.height)
    elevation, azimuth, _ = (ISS - place).at(instants(seconds)).altaz()
    return seconds, azimuth.degrees, elevation.degrees


def program_text():
    julian = 2458827.1875
    return '# made by a test\n\n' + ''.join(f'{julian + t / 86400.0:.10f}\t{a:.5f}  {e:.5f} 0.0\n'
                                           for t, a, e in zip(*directions()))


def table_text(head='time_utc,azimuth_deg,elevation_deg\n', time=lambda t: iso(t) + 'Z'):
    return head + ''.join(f'{time(t)},{a:.5f},{e:.5f}\n' for t, a, e in zip(*directions()))


TABLES = {'program.txt': program_text, 'utc.csv': table_text,
          'named.csv': lambda: table_text('El [deg], name, UTC, Az [deg]\n').replace('\n', '\n', 1),
          'seconds.csv': lambda: table_text('t,az,el\n', lambda t: f'{t:.3f}'),
          'bare.csv': lambda: table_text('', lambda t: f'{t:.3f}'), 'bare utc.csv': lambda: table_text('')}


@pytest.mark.parametrize('name', TABLES)
def test_a_table_of_directions_is_followed(name, tmp_path):
    text = TABLES[name]()
    if name == 'named.csv':
        head, *rows = text.splitlines()
        text = '\n'.join([head, *(f'{e},x,{t},{a}' for t, a, e in (row.split(',') for row in rows))])
    path = tmp_path / name
    path.write_text(text)
    of = TargetParameters(kind='track_file', angle=AngleParameters(range=7e5), track_file=TrackFileParameters(
        path=str(path)))
    built = target.build(of, 590.0)
    seconds, azimuth, elevation = directions(118, 5.0, 302.0)
    a, e, r = target.look_angles(built, seconds - 300.0)
    off = np.hypot((np.degrees(a) - azimuth + 180.0) % 360.0 - 180.0, np.degrees(e) - elevation)
    assert off.max() < 0.01 and r == pytest.approx(7e5, rel=2e-4)
    dated = 'seconds' not in name and name != 'bare.csv'
    assert built.start_time == ('2019-12-09T16:35:00.000Z' if dated else '')
    found = track_files.derived_parameters(of, set())
    assert found['duration'] == pytest.approx(599.95, abs=0.06) and found['receiver.reference_range'] == 7e5


def test_an_oem_that_begins_with_a_comment_and_repeats_states(tmp_path):
    text = swapped(oem_text(interpolation=CONSISTENT), ROW, lambda m: m[0] + '\n' + m[0])
    built = flown(tmp_path / 'iss.oem', 'COMMENT of an exporter\n\nCOMMENT = 2\n' + text)
    assert apart(built, TIMES) < 0.01
    assert built.summary[0].endswith(': 30 states in EME2000, LAGRANGE of degree 9, passed over 1 x state that '
                                     'repeats the one above')


def swapped(text, old, new, count=1):
    assert re.search(old, text), old
    return re.sub(old, new, text, count=count)


ROW = r'(?m)^2019-12-09T16:38:00\.000000 .*$'
REFUSED = {
    'frame': (lambda: swapped(oem_text(), 'EME2000', 'MOON_ME'), 'line 9, column 13: REF_FRAME = MOON_ME: must be'),
    'centre': (lambda: swapped(oem_text(), 'EARTH', 'MARS'), 'line 8, column 15: CENTER_NAME = MARS: must be EARTH'),
    'time system': (lambda: swapped(oem_text(), 'UTC', 'SCLK'), 'column 15: TIME_SYSTEM = SCLK: must be UTC'),
    'frame of an epoch': (lambda: oem_text(REF_FRAME_EPOCH='2019-12-09T00:00:00'), 'column 19: REF_FRAME_EPOCH'),
    'even degree': (lambda: oem_text(interpolation=('HERMITE', 8)), 'INTERPOLATION_DEGREE = 8: must be an odd number'),
    'interpolation': (lambda: oem_text(interpolation=('SPLINE', 7)), 'INTERPOLATION = SPLINE: must be HERMITE or'),
    'few states': (lambda: oem_text(count=3), 'line 15: 3 states in the segment that begins'),
    'back': (lambda: swapped(oem_text(), ROW, lambda m: m[0].replace('16:38', '16:36')),
             r'line 24, column 1: the time is -60 s after that of the state above'),
    'two states': (lambda: swapped(oem_text(), ROW, lambda m: m[0] + '\n' + m[0][:-1] + '7'),
                   'line 25, column 1: the state differs from the one above, at the same epoch; must be one state'),
    'sp3': (lambda: '#dP2019 12  9  0  0  0.00000000      96 ORBIT IGS14 HLM  IGS\n',
            'an SP3 file of precise orbits: convert the orbit of one satellite to a CCSDS OEM'),
    'gap': (lambda: re.sub(r'(?m)^2019-12-09T16:(38|39|40|41).*\n', '', oem_text()), 'line 24: gap of 300 s'),
    'nan': (lambda: swapped(oem_text(), ROW, lambda m: m[0][:27] + 'nan 1 1 1 1 1'),
            r"line 24, column 28: x = 'nan': must be a number"),
    'infinity': (lambda: swapped(oem_text(), ROW, lambda m: m[0][:27] + '1e999 1 1 1 1 1'), 'column 28: x = inf'),
    'unit behind a state': (lambda: swapped(oem_text(), ROW, lambda m: m[0] + ' [m]'),
                            r"line 24, column \d+: '\[m\]': must be a number; a unit is not allowed here"),
    'stk unit behind a state': (lambda: swapped(stk_text(), r'(?m)^180\.000 .*$', lambda m: m[0] + ' km'),
                                "line 17, column .*: 'km': must be a number; a unit"),
    'program unit': (lambda: swapped(program_text(), r'(?m)(\d)$', r'\1 rad'), "'rad': must be a number; a unit"),
    'missing number': (lambda: swapped(oem_text(), ROW, lambda m: m[0][:60]), r'line 24, column \d+: \w+ is'),
    'metres': (lambda: swapped(oem_text(), ROW, lambda m: '2019-12-09T16:38:00 6.7 0 0 1 1 1'),
               'line 24: 6.7 km from the centre of the earth, must be 6300'),
    'wild': (lambda: swapped(oem_text(), ROW, lambda m: re.sub(r' (-?)\d', r' \g<1>5', m[0], count=1)),
             r'line 2[345]: acceleration = \d+'),
    'time': (lambda: swapped(oem_text(), 'T16:38:00', 'T16:61:00'), "line 24, column 1: epoch = '2019-12-09T16:61"),
    'no end of the metadata': (lambda: oem_text().partition('META_STOP')[0], 'the file ends inside the metadata'),
    'no segment': (lambda: 'CCSDS_OEM_VERS = 2.0\n', 'META_START is missing'),
    'no object': (lambda: swapped(oem_text(), 'OBJECT_NAME = ISS\n', ''), 'OBJECT_NAME is missing in the metadata'),
    'no keyword': (lambda: swapped(oem_text(), 'OBJECT_NAME = ISS', 'OBJECT_NAME: ISS'), 'must be KEYWORD = '),
    'binary': (lambda: oem_text().encode() + b'\xff\xfe\x00' * 9, 'line 50: byte 0x00: must be text in UTF-8, UTF-16'),
    'long line': (lambda: oem_text() + '1' * 2_000_000, 'line 50: longer than 1024 characters'),
    'useable': (lambda: oem_text(USEABLE_START_TIME='2019-12-09T16:31:00', USEABLE_STOP_TIME='2019-12-09T16:44:00'),
                'must be inside the usable time of the file, 2019-12-09T16:31:00.000Z to 2019-12-09T16:44'),
    'outside': (lambda: oem_text(count=12), r'line 27: the run from 2019-12-09T16:35:00.000Z to'),
    'stk frame': (lambda: stk_text().replace('J2000', 'MeanOfDate'), r"line 9, column 18: .*'MeanOfDate': must"),
    'stk unit': (lambda: stk_text(unit=1.0).replace('Kilometers', 'Feet'), "'Feet': must be meters or kilometers"),
    'stk method': (lambda: stk_text(method=('LagrangeVOP', 7)), "'LagrangeVOP': must be lagrange or hermite"),
    'stk samples': (lambda: stk_text(method=('Lagrange', 77)), "'77': must give a polynomial of a degree"),
    'stk no velocity': (lambda: stk_text(method=('Hermite', 3), velocity=False), 'must be Lagrange, because'),
    'stk epoch': (lambda: stk_text().replace(' Dec ', ' Dez '), 'ScenarioEpoch = .* must be UTC such as 1 Jun 2026'),
    'stk data': (lambda: stk_text().replace('EphemerisTimePosVel', 'EphemerisLLATimePosVel'),
                 'line 13, column 1: .* height are not supported: must be one of ephemeristime'),
    'stk positions': (lambda: stk_text(velocity=False).replace('EphemerisTimePos', 'EphemerisLLATimePos'),
                      "'ephemerisllatimepos': states in latitude, longitude and height are not supported"),
    'oem xml': (lambda: '<?xml version="1.0"?>\n<oem id="CCSDS_OEM_VERS" version="2.0"></oem>',
                "line 2: element 'oem': must be gpx; an OEM must be in the notation KEYWORD = value, not XML"),
    'stk number': (lambda: stk_text().replace('180.000 ', '180.000 x'), r"line 17, column 9: x = 'x.*': must"),
    'stk empty': (lambda: 'stk.v.11.0\n', 'the keyword of the states is missing, must be one of ephemeristimepos'),
    'table back': (lambda: table_text().replace('T16:37:00', 'T16:36:30'), 'line 14, column 1: the time is -20'),
    'table gap': (lambda: re.sub(r'(?m)^2019-12-09T16:37.*\n', '', table_text()), 'line 14: a gap of 70 s'),
    'table nan': (lambda: swapped(table_text(), r'(?m)^(2019-12-09T16:37:00.000000Z),[^,]*', r'\1,nan'),
                  'line 14: azimuth_deg = nan: must be -720 to 720'),
    'table mixed': (lambda: swapped(table_text(), '2019-12-09T16:37:00.000000Z', '17'), "= '17': must be UTC"),
    'table jump': (lambda: swapped(table_text(), r'(?m)^(2019-12-09T16:36:00.000000Z,[^,]*),.*$', r'\1,-80'),
                   'deg from the row above: must be at most 20 deg'),
    'table short': (lambda: 'utc,az,el\n', '0 rows, must be at least 4'),
    'program back': (lambda: program_text() + program_text(), r'line 66, column 1: the time is -600 s after'),
    'program word': (lambda: program_text() + '2458827.9 high 3\n', r"line 64, column 11: azimuth = 'high': must be"),
    'program low': (lambda: program_text() + '2458827.9 3 -91\n', 'column 13: elevation = -91: must be -90 to 90')}


@pytest.mark.parametrize('case', REFUSED)
def test_what_does_not_do_is_refused_by_line_and_column(case, tmp_path):
    make, message = REFUSED[case]
    with pytest.raises(csv_table.TableError) as refused:
        flown(tmp_path / 'utc.csv', make())
    assert re.search(message, str(refused.value)) and 'utc.csv: ' in str(refused.value)
    assert '\n' not in str(refused.value) and len(str(refused.value)) < 400
