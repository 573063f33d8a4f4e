"""Refraction in the control unit: the weather of parameters and of a weather station, and changes without a bump."""
import math

import numpy as np
import pytest

from acu_tracker.geometry import direction
from acu_tracker.params import AcuParameters
from acu_tracker.program import program_track
from acu_tracker.program.air import CHANGE_TIME_S, Air, RefractionParameters
from acu_tracker.program.prediction import PredictionParameters
from acu_tracker.unit import Acu
from acu_tracker.unit_law import JOINT_STATES_TOPIC
from pedestal_common.geometry import refraction
from pedestal_common.geometry.earth_orientation import EarthOrientationParameters
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.parameters import ParameterError
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command

LINES = ('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
         '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482')
START = '2019-12-10T09:25:00'
RADIO = RefractionParameters(kind='radio')
ELEVATION = math.radians(5.0)


def weather_message(topic, value, stamp):
    message = messages.template(topic)
    name = {'weather/pressure': 'fluid_pressure', 'weather/temperature': 'temperature',
            'weather/humidity': 'relative_humidity'}[topic]
    setattr(message, name, value)
    messages.put_stamp(message.header.stamp, round(stamp * 1e9))
    return message


def refraction_of(*weather):
    return refraction.refraction(refraction.of_weather(*weather), ELEVATION)


def level_track(interval=1.0, rows=2400):
    times = interval * np.arange(rows)
    return program_track.ProgramTrack(times, np.column_stack((0.0 * times, 0.0 * times + ELEVATION)))


def take(air, topic, value, stamp, now=None):
    air.take(topic, stamp, weather_message(topic, value, stamp), stamp if now is None else now)


def test_without_messages_the_parameters_hold():
    air = Air(RefractionParameters(kind='radio', pressure_hpa=960.0, temperature_celsius=30.0, humidity=0.9))
    raised = air.apparent(level_track()).angles[:, 1]
    assert np.allclose(raised, ELEVATION + refraction_of(960.0, 30.0, 0.9), atol=1e-15)
    assert not air.problems(1e6)
    off = Air(RefractionParameters())
    assert off.apparent(level_track()).angles[0, 1] == ELEVATION and off.diagnostic_values(0.0) == []


@pytest.mark.parametrize('interval', [1.0, 7.0, 30.0])
def test_a_new_weather_moves_the_direction_without_a_step(interval):
    """Between the tables before and after a message the direction and its rate at the time of change are equal. From
    there on the direction reaches the new refraction at a bounded rate."""
    air, track = Air(RADIO), level_track(interval)
    before = air.apparent(track)
    t = 400.3
    take(air, 'weather/pressure', 80000.0, t)
    air.update(t)
    after = air.apparent(track)
    old, new = (program_track.motion_at(table, t).elevation for table in (before, after))
    assert (new.angle, new.rate) == (old.angle, old.rate)
    there = t + CHANGE_TIME_S + 4.0 * interval
    assert program_track.motion_at(after, there).elevation.angle == pytest.approx(
        ELEVATION + refraction_of(800.0, 15.0, 0.5), abs=1e-12)
    path = np.array([program_track.motion_at(after, s).elevation.angle for s in np.arange(t, there, 0.05)])
    change = refraction_of(800.0, 15.0, 0.5) - refraction_of(1013.25, 15.0, 0.5)
    assert np.abs(np.diff(path)).max() / 0.05 < 1.5 * abs(change) / CHANGE_TIME_S


def test_changes_come_one_after_the_other_and_small_ones_are_left_out():
    air = Air(RADIO)
    take(air, 'weather/pressure', 101000.0, 10.0)
    air.update(10.0)
    assert air.revision == 1 and air.due == 10.0 + CHANGE_TIME_S
    for t in np.arange(11.0, 69.0):
        take(air, 'weather/pressure', 90000.0, t)
        air.update(t)
    assert air.revision == 1
    air.update(70.0)
    assert air.revision == 2
    take(air, 'weather/pressure', 90010.0, 130.0)
    air.update(130.0)
    assert air.revision == 2


def test_a_stale_reading_gives_way_to_the_parameter_and_is_named():
    air = Air(RefractionParameters(kind='radio', timeout=100.0))
    take(air, 'weather/pressure', 80000.0, 0.0)
    air.update(0.0)
    take(air, 'weather/temperature', 30.0, 50.0)
    assert ('pressure_hpa', '800, 60 s old') in air.diagnostic_values(60.0)
    air.update(120.0)
    assert air.problems(120.0) == ['weather/pressure: 120 s old, the parameter pressure_hpa holds']
    assert air._weather[-1] == (1013.25, 30.0, 0.5)
    assert ('pressure_hpa', '1013.25, parameter') in air.diagnostic_values(120.0)
    take(air, 'weather/pressure', 80000.0, 0.0, now=121.0)
    assert air.dropped['weather/pressure', 'stale'] == 1


@pytest.mark.parametrize('topic, value, text', [
    ('weather/pressure', 1013.25, '1013.25: must be 30000 to 110000 Pa'),
    ('weather/pressure', math.nan, 'nan: must be 30000 to 110000 Pa'),
    ('weather/temperature', 288.15, '288.15: must be -90 to 60 deg C'),
    ('weather/temperature', -math.inf, '-inf: must be -90 to 60 deg C'),
    ('weather/humidity', 50.0, '50: must be 0 to 1 (0 to 1)'),
    ('weather/humidity', math.nan, 'nan: must be 0 to 1')])
def test_a_reading_out_of_range_is_dropped_counted_and_named(topic, value, text):
    air = Air(RADIO)
    take(air, topic, value, 1.0)
    air.update(1.0)
    assert air.revision == 0 and air.dropped[topic, 'out of range'] == 1
    [problem] = air.problems(1.0)
    assert problem.startswith(f'{topic}: dropped {text}')
    assert (f'dropped {topic}: out of range', '1') in air.diagnostic_values(1.0)
    good = {'weather/pressure': 95000.0, 'weather/temperature': 20.0, 'weather/humidity': 0.4}[topic]
    take(air, topic, good, 2.0)
    assert air.problems(2.0) == []


def test_a_reading_without_a_stamp_or_of_the_future_is_dropped():
    air = Air(RADIO)
    air.take('weather/humidity', None, weather_message('weather/humidity', 0.3, 0.0), 5.0)
    take(air, 'weather/humidity', 0.3, 20.0, now=5.0)
    assert air.dropped == {('weather/humidity', 'without stamp'): 1, ('weather/humidity', 'future'): 1}
    assert air.problems(5.0) == ['weather/humidity: dropped 15.0 s in the future: must be at most 1 s']


def acu(**values):
    unit = Acu(AcuParameters(initial_mode='stop', prediction=PredictionParameters(
        line_1=LINES[0], line_2=LINES[1], start_time=START, station=StationParameters()), **values), ())
    unit.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
    return unit


def run(unit, first, last, every=0.1):
    """Steps of the unit from first to last [s]; elevation of its table tle at each step [rad]."""
    elevations = []
    for t in np.arange(first, last, every):
        stamp = np.array([round(t * 1e9)])
        unit.inputs[JOINT_STATES_TOPIC]['stamp'] = stamp
        unit.step(stamp, unit.inputs, unit.outputs)
        elevations.append(program_track.motion_at(unit.memory.tables.tle, t).elevation.angle)
    return np.array(elevations)


def test_the_tables_of_the_unit_are_apparent_and_follow_the_weather():
    true, raised = acu(), acu(refraction=RADIO)
    a, b = run(true, 0.0, 0.5), run(raised, 0.0, 0.5)
    expected = [refraction.refraction(refraction.of_weather(1013.25, 15.0, 0.5), E) for E in a]
    assert b - a == pytest.approx(expected, abs=1e-8)
    message = weather_message('weather/pressure', 70000.0, 0.4)
    raised.decode('weather/pressure', message)
    a, b = run(true, 0.5, 80.0), run(raised, 0.5, 80.0)
    lifted = b - a
    assert lifted[0] == pytest.approx(expected[-1], rel=1e-3)
    assert lifted[-1] == pytest.approx(refraction.refraction(refraction.of_weather(700.0, 15.0, 0.5), a[-1]), abs=1e-7)
    assert np.abs(np.diff(lifted, 2)).max() < 1e-6      # no bump on the way [rad in 0.1 s]
    assert 'refractivity' in dict(raised.diagnose().values)


def test_a_program_is_true_or_apparent_as_the_parameter_says():
    for kind, added in (('geometric', refraction_of(1013.25, 15.0, 0.5)), ('apparent', 0.0)):
        unit = acu(refraction=RefractionParameters(kind='radio', program=kind))
        unit.followed.append(unit.parts, *level_track())
        unit.update_tables()
        assert unit.memory.tables.program.angles[10, 1] == pytest.approx(ELEVATION + added, abs=1e-15)


def slave_path(unit, first, last, every=0.02):
    """Steps of the unit from first to last [s]; the times [s] and the elevations of its direction slave [rad]."""
    times, elevations = np.arange(first, last, every), []
    for t in times:
        stamp = np.array([round(t * 1e9)])
        unit.inputs[JOINT_STATES_TOPIC]['stamp'] = stamp
        unit.step(stamp, unit.inputs, unit.outputs)
        slave = unit.parts['state']['guidance']['slave'].view(np.recarray)
        elevations.append(direction.motion_at(slave, t).elevation.angle)
    return times, np.array(elevations)


def command_slave(unit, **arguments):
    assert unit.command(Command('slave', arguments={'azimuth': '0.3', **arguments}))[0]


def test_a_slave_direction_is_true_or_apparent_as_the_parameter_says():
    for kind, added in (('geometric', refraction_of(1013.25, 15.0, 0.5)), ('apparent', 0.0)):
        unit = acu(refraction=RefractionParameters(kind='radio', slave=kind))
        run(unit, 0.0, 0.1)
        command_slave(unit, elevation=str(ELEVATION), elevation_rate='0.01', moves='10')
        motion = direction.motion_at(unit.parts['state']['guidance']['slave'].view(np.recarray), 0.0).elevation
        assert motion.angle == pytest.approx(ELEVATION + added, abs=1e-15)


def test_a_moving_slave_direction_keeps_the_refraction_of_its_place():
    """From 0.5 to 4.5 deg the refraction falls by 0.3 deg; a straight line along its slope would be 0.29 deg off."""
    unit = acu(refraction=RADIO)
    run(unit, 0.0, 0.1)
    low, rate, moves = math.radians(0.5), math.radians(1.0), 4.0
    command_slave(unit, elevation=str(low), elevation_rate=str(rate), moves=str(moves), holds='5')
    times, elevations = slave_path(unit, 0.1, 4.9)
    air = refraction.of_weather(1013.25, 15.0, 0.5)
    true = low + rate * np.minimum(times, moves)
    expected = [E + refraction.refraction(air, E) for E in true]
    assert np.degrees(np.abs(elevations - expected)).max() < 3e-4
    assert elevations[-1] == pytest.approx(expected[-1], abs=1e-12)
    assert np.degrees(np.abs(np.diff(elevations[times < moves], 2))).max() < 1e-3     # no step where it is bent again


def test_a_direction_at_rest_follows_the_weather_until_it_expires():
    unit = acu(refraction=RADIO)
    run(unit, 0.0, 0.1)
    command_slave(unit, elevation=str(ELEVATION), holds='100')
    unit.decode('weather/pressure', weather_message('weather/pressure', 70000.0, 0.05))
    times, elevations = slave_path(unit, 0.1, 80.0, 0.1)
    assert elevations[0] == pytest.approx(ELEVATION + refraction_of(1013.25, 15.0, 0.5), abs=1e-6)
    assert elevations[-1] == pytest.approx(ELEVATION + refraction_of(700.0, 15.0, 0.5), abs=1e-12)
    assert unit.next_due < 81e9
    run(unit, 80.0, 102.0, 1.0)
    assert unit.next_due > 102e9


def test_the_horizon_is_the_apparent_one():
    def rise(unit):
        run(unit, 0.0, 0.1)
        reply = unit.request('acu/tle').text
        return reply.partition('next rise at ')[2].partition(';')[0]
    late = '2019-12-10T06:00:00'
    true, raised = (rise(Acu(AcuParameters(initial_mode='stop', refraction=kind, prediction=PredictionParameters(
        line_1=LINES[0], line_2=LINES[1], start_time=late, station=StationParameters())), ()))
        for kind in (RefractionParameters(), RADIO))
    assert '2019-12-10' in raised and raised < true


def test_the_diagnosis_names_what_is_wrong(tmp_path):
    file = tmp_path / 'finals2000A.all'
    file.write_text('\n'.join(f'{"":7}{mjd:8.2f} I {0.1:9.6f}{0:9.6f} {0.3:9.6f}{0:9.6f}  I{-0.1:10.7f}'.ljust(187)
                              for mjd in (58000.0, 58001.0)))
    unit = Acu(AcuParameters(initial_mode='stop', refraction=RADIO, prediction=PredictionParameters(
        start_time=START, station=StationParameters(),
        earth_orientation=EarthOrientationParameters(file=str(file)))), ())
    unit.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
    run(unit, 0.0, 0.1)
    unit.decode('weather/humidity', weather_message('weather/humidity', 55.0, 0.05))
    level, text, values = unit.diagnose()
    assert level == 1
    assert text.endswith('earth_orientation: finals2000A.all expired on 2017-09-05; its last row holds; '
                         'weather/humidity: dropped 55: must be 0 to 1 (0 to 1)'), text
    values = dict(values)
    assert values['ut1_utc_s'] == '-0.1000' and values['dropped weather/humidity: out of range'] == '1'
    assert values['earth_orientation'].startswith('finals2000A.all, measured until 2017-09-05, age ')


def test_a_missing_file_ends_the_start_with_its_name():
    with pytest.raises(ParameterError, match=r"earth_orientation.file = '/none': No such file"):
        Acu(AcuParameters(prediction=PredictionParameters(earth_orientation=EarthOrientationParameters(file='/none'))),
            ())
