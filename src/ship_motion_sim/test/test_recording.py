"""A recorded motion against the waves it was sampled from, its own differences, and what is no recording."""
import math

import numpy as np
import pytest

from pedestal_common.parameters import ParameterError
from pedestal_common.text_files.csv_table import TableError
from ship_motion_sim import motion, recording
from ship_motion_sim.params import RecordedParameters, ShipParameters

SAMPLED = ShipParameters(sea_state=6, wave_angle_deg=60.0, heading_deg=358.0, speed=6.0)
PERIOD, LENGTH = 0.1, 60.0


def truth(constants, t):
    outputs = np.zeros(1, motion.Truth.dtype)
    motion.truth(constants[0], t, outputs[0])
    return outputs[0]


def recorded(path, speed=6.0, **changes):
    return motion.constants(ShipParameters(motion='recorded', speed=speed, recorded=RecordedParameters(
        path=str(path), **changes)))


@pytest.fixture(scope='module')
def waves():
    return motion.constants(SAMPLED)


@pytest.fixture(scope='module')
def path(waves, tmp_path_factory):
    """A minute of the waves at 10 Hz as an instrument writes them: signs of PASHR, time of its own."""
    path = tmp_path_factory.mktemp('recording') / 'ship.csv'
    lines = ['time_s,note,roll_deg,pitch_deg,heading_deg,surge_m,sway_m,heave_m']
    for t in np.arange(0.0, LENGTH + PERIOD / 2.0, PERIOD):
        ship = truth(waves, t)
        roll, pitch, heading = (math.degrees(value) for value in (ship['roll'], -ship['pitch'],
                                                                  0.5 * math.pi - ship['yaw']))
        surge, sway, heave = ship['freedoms'][0, :3]
        lines.append(f'{1.7e9 + t:.3f},ok,{roll:.12f},{pitch:.12f},{heading % 360.0:.12f},{surge:.12f},{sway:.12f},'
                     f'{heave:.12f}')
    path.write_text('\n'.join(lines) + '\n')
    return path


@pytest.mark.parametrize('t', [5.0, 17.37, 31.0, 54.99])
def test_a_sampled_sea_comes_back_with_its_rates_and_accelerations(waves, path, t):
    """Cubic spline, h = 0.1 s: errors of h^4 x''''/384, of the acceleration h^2 x''''/12, motions below 2 rad/s."""
    was, now = truth(waves, t), truth(recorded(path), t)
    for field, tolerance in (('quaternion', 1e-6), ('angular_velocity', 1e-5), ('angular_acceleration', 1e-3)):
        np.testing.assert_allclose(now[field], was[field], atol=tolerance, err_msg=field)
    for row, tolerance in enumerate((1e-6, 1e-4, 1e-2)):
        np.testing.assert_allclose(now['freedoms'][row, :3], was['freedoms'][row, :3], atol=tolerance)


def test_the_course_is_the_mean_heading_of_the_record(waves, path):
    yaw = [truth(waves, t)['yaw'] for t in np.arange(0.0, LENGTH + PERIOD / 2.0, PERIOD)]
    constants = recorded(path, speed=10.0)
    along = (truth(constants, 1000.0)['position'] - truth(constants, 900.0)['position'])[:2]
    np.testing.assert_allclose(along, 1000.0 * np.array([math.cos(np.mean(yaw)), math.sin(np.mean(yaw))]), atol=1e-6)


@pytest.mark.parametrize('t', [-4.0, 0.05, 33.333, LENGTH + 1.0, LENGTH + 4.9])
def test_rates_and_accelerations_are_derivatives_of_what_is_published(path, t):
    """In and outside the record."""
    constants, h = recorded(path), 0.005

    def difference(row):
        x = [truth(constants, t + i * h)['freedoms'][row].copy() for i in (-2, -1, 1, 2)]
        return (8.0 * (x[2] - x[1]) - (x[3] - x[0])) / (12.0 * h)

    now = truth(constants, t)['freedoms']
    np.testing.assert_allclose(difference(0), now[1], atol=1e-8)
    np.testing.assert_allclose(difference(1), now[2], atol=1e-7)


@pytest.mark.parametrize('t', [0.0, 12.3, LENGTH, -recording.COME_TO_REST_TIME_S, LENGTH
                               + recording.COME_TO_REST_TIME_S])
def test_the_second_derivative_has_no_jumps(path, t):
    constants = recorded(path)
    before, after = (truth(constants, t + e)['freedoms'].copy() for e in (-1e-7, 1e-7))
    np.testing.assert_allclose(before, after, atol=1e-5)


def test_the_ship_rests_where_the_record_ends(path):
    constants = recorded(path, start=10.0)
    for t, end in ((-10.0 - recording.COME_TO_REST_TIME_S, -10.0), (-1e4, -10.0),
                   (LENGTH - 10.0 + recording.COME_TO_REST_TIME_S, LENGTH - 10.0),
                   (1e6, LENGTH - 10.0)):
        now = truth(constants, t)
        np.testing.assert_allclose(now['freedoms'][0], truth(constants, end)['freedoms'][0], atol=1e-12)
        np.testing.assert_allclose(now['freedoms'][1:], 0.0, atol=1e-12)
    np.testing.assert_array_equal(truth(constants, 5.0)['quaternion'], truth(recorded(path), 15.0)['quaternion'])


def test_signs_are_those_of_instruments_and_displacements_may_be_missing(tmp_path):
    path = tmp_path / 'still.csv'
    path.write_text('time_s,roll_deg,pitch_deg,heading_deg\n' + ''.join(f'{t},10,4,90\n' for t in range(5)))
    now = truth(recorded(path, speed=0.0), 2.5)
    np.testing.assert_allclose(now['position'], 0.0, atol=1e-15)
    np.testing.assert_allclose(now['mat_ed'][:, 0], [math.cos(math.radians(4.0)), 0.0, math.sin(math.radians(4.0))],
                               atol=1e-14)     # the bow points east and up
    assert now['mat_ed'][2, 1] > 0.0           # port is up


def test_a_log_of_a_spreadsheet_is_read(path, tmp_path):
    """Semicolons, decimal commas, units of its own, capitals, a mark."""
    names, *rows = path.read_text().splitlines()
    names = names.replace('time_s', 'Time [s]').replace('roll_deg', 'Roll [rad]').replace('heave_m', 'Heave [cm]')
    made = ['sep=;', '# by a logger', names.replace(',', ';')]
    for row in rows:
        time, note, roll, *middle, heave = row.split(',')
        cells = time, note, f'{math.radians(float(roll)):.15f}', *middle, f'{100.0 * float(heave):.12f}'
        made.append(';'.join(cells).replace('.', ','))
    other = tmp_path / 'ship.csv'
    other.write_text('\n'.join(made), encoding='utf-8-sig')
    for t in (5.0, 31.0):
        now, was = truth(recorded(other), t), truth(recorded(path), t)
        np.testing.assert_allclose(now['freedoms'], was['freedoms'], atol=1e-9)


def test_repeated_rows_are_passed_over_and_counted(path, tmp_path):
    """A logger that writes a row twice: the motion of the log without the repeated rows."""
    names, *rows = path.read_text().splitlines()
    other = tmp_path / 'ship.csv'
    other.write_text('\n'.join([names, *(row for i, row in enumerate(rows) for _ in range(1 + (i % 10 == 3)))]))
    for t in (5.0, 31.0):
        np.testing.assert_array_equal(truth(recorded(other), t)['freedoms'], truth(recorded(path), t)['freedoms'])
    [line] = motion.summary(ShipParameters(motion='recorded', recorded=RecordedParameters(path=str(other))))
    assert line == ('ship.csv: columns time_s in s, roll_deg in deg, pitch_deg in deg, heading_deg in deg, '
                    'surge_m in m, sway_m in m, heave_m in m: 601 rows, passed over 60 x row that repeats the row '
                    'before')


def test_a_run_that_is_longer_than_the_record_states_its_end(path):
    ship = ShipParameters(motion='recorded', recorded=RecordedParameters(path=str(path), start=10.0))
    _, line = motion.summary(ship, 60.0)
    assert line == 'the recorded motion of the ship ends after 50 s of the run; the deck is at rest after it'
    assert len(motion.summary(ship, 50.0)) == 1


HEAD = 'time_s,roll_deg,pitch_deg,heading_deg\n'


@pytest.mark.parametrize('content, changes, message', [
    ('time_s,roll_deg,heading_deg\n', {}, "line 1: column 'pitch_deg' is missing"),
    (HEAD + '0,1,1,1\n1,1,1,1\n1,2,1,1\n', {}, 'line 4: time_s = 1: 0 s after the row before, must be above 0 and at '
                                               'most ship.recorded.max_gap = 2 s'),
    (HEAD + '0,1,1,1\n5,1,1,1\n', {}, 'line 3: time_s = 5: 5 s after the row before'),
    (HEAD.replace('roll_deg', 'roll'), {}, "line 1: column 'roll': must end with a known unit to be taken as roll"),
    (HEAD.replace(',pitch', ',heave,pitch'), {}, "line 1: column 'heave': must end with a known unit"),
    (HEAD + '0,nan,1,1\n', {}, 'line 2: roll_deg = nan: must be -80 to 80'),
    (HEAD + '0,1,1,1\n1,1\n', {}, "line 3: the row ends before the column 'pitch_deg'"),
    (HEAD.replace('time_s', 'time_utc') + '2026-06-01T12:00:00Z,1,1,1\n', {},
     "line 2: time_utc = '2026-06-01T12:00:00Z': must be a number of seconds, as in a column time_s"),
    (HEAD + '2026-06-01T12:00:00Z,1,1,1\n', {},
     "time_s = '2026-06-01T12:00:00Z': must be a number of seconds, as in a column time_s, because only tracks have "
     'dates: write the seconds since the first row'),
    (HEAD.replace('time_s', 'Timestamp') + '01.06.2026 12:00:00,1,1,1\n', {},
     "column 'time_s' is missing: write the seconds since the first row in it, because 'Timestamp' may hold dates"),
    (HEAD + '0,1,,1\n', {}, "line 2: pitch_deg = '': must be a number"),
    (HEAD + '0,1,1,1\n1,1,1,1\n', {}, '2 rows, must be at least 4'),
    (HEAD + 5 * '0,1,1,1\n', {}, '1 rows, must be at least 4, passed over 4 x row that repeats the row before'),
    (HEAD + ''.join(f'{t},1,1,1\n' for t in range(6)), {'start': 5.0},
     'ship.recorded.start = 5 s: must be below the length of the record, 5 s'),
    (HEAD + ''.join(f'{t},1,1,1\n' for t in range(recording.MAX_ROWS + 1)), {},
     f'must be at most {recording.MAX_ROWS}'),
])
def test_what_is_no_recording_is_named(tmp_path, content, changes, message):
    path = tmp_path / 'ship.csv'
    path.write_text(content)
    with pytest.raises(TableError) as error:
        recorded(path, **changes)
    assert str(error.value).startswith(f'{path}: ') and message in str(error.value)


def test_a_recorded_motion_needs_its_file_and_has_its_own_heading():
    for values in (dict(motion='recorded'), dict(recorded=RecordedParameters(path='ship.csv'))):
        with pytest.raises(ParameterError, match='recorded.path = '):
            ShipParameters(**values)
    with pytest.raises(ParameterError, match='heading_deg = 30 deg: must be 0'):
        ShipParameters(motion='recorded', heading_deg=30.0, recorded=RecordedParameters(path='ship.csv'))
