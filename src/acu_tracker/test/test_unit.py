"""The control unit as a node sees it: its diagnosis, its program track, its requests."""
import json

import numpy as np
import pytest

from acu_tracker.alarms import machine, table
from acu_tracker.geometry import direction
from acu_tracker.params import AcuParameters
from acu_tracker.program.prediction import PredictionParameters
from acu_tracker.unit import Acu
from acu_tracker.unit_law import DRIVE_STATE_TOPIC, JOINT_STATES_TOPIC, MODE_TOPIC, RATE_COMMAND_TOPIC
from pedestal_common import parameters
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph import topics
from pedestal_common.graph.modes import MODES
from pedestal_common.wire import messages, records
from pedestal_common.wire.commands import Command

LINES = ('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
         '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482')
OMM = json.dumps({'NORAD_CAT_ID': '25544', 'EPOCH': '2019-12-09T16:38:29.363424', 'MEAN_MOTION': '15.50103472',
                  'ECCENTRICITY': '0.0007417', 'INCLINATION': '51.6439', 'RA_OF_ASC_NODE': '211.2001',
                  'ARG_OF_PERICENTER': '17.6667', 'MEAN_ANOMALY': '85.6398', 'BSTAR': '0.000038792'})


def test_diagnostics_show_whether_the_filter_is_honest():
    unit = Acu(AcuParameters(), ())
    outputs = unit.memory.record['outputs']
    outputs['gated'], outputs['rates_gated'], outputs['ranges_gated'] = 3, 5, 7
    outputs['innovation'], outputs['nis'] = [(np.radians(0.0123456), np.nan)], [(1.23456, np.nan)]
    values = dict(unit.diagnose().values)
    assert [values[f'{name} gated'] for name in ('errors', 'rates', 'ranges')] == ['3', '5', '7']
    assert (values['azimuth innovation_deg'], values['azimuth nis']) == ('0.01235', '1.235')
    assert (values['elevation innovation_deg'], values['elevation nis']) == ('nan', 'nan')
    assert (values['blocked'], values['keyhole']) == ('0', 'none')


def test_a_request_is_judged_by_what_the_drive_says_now():
    unit = Acu(AcuParameters(), ())
    unit.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
    unit.step(np.zeros(1, np.int64), unit.inputs, unit.outputs)
    assert unit.encode(MODE_TOPIC, int(unit.outputs[0][MODE_TOPIC])) == 'standby'
    assert unit.outputs[RATE_COMMAND_TOPIC]['stamp'] == 0
    assert unit.request('acu/stow') == (True, 'mode is stow')
    unit.take_text(DRIVE_STATE_TOPIC, 'stopping')
    assert unit.request('acu/preset') == (False, 'refused: drive not ready; mode is standby')
    assert dict(unit.diagnose().values)['drive'] == 'stopping'


@pytest.mark.parametrize('drive', ('enabled', 'emergency stop'))
def test_the_diagnosis_says_what_a_request_would_be_refused_for(drive):
    """Of every mode at once, as each is refused when it is asked for, and nothing changes by it."""
    def unit():
        made = Acu(AcuParameters(initial_mode='stop', prediction=PredictionParameters(
            line_1=LINES[0], line_2=LINES[1], start_time='2019-12-10T09:00:00', station=StationParameters())), ())
        made.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
        made.take_text(DRIVE_STATE_TOPIC, drive)
        made.step(np.zeros(1, np.int64), made.inputs, made.outputs)
        return made
    asked = unit()
    before = asked.memory.record.copy()
    refused = {key.removeprefix('refused '): why for key, why in asked.diagnose().values if key.startswith('refused ')}
    assert asked.memory.record.tobytes() == before.tobytes()
    for mode in MODES:
        reply = unit().request(f'acu/{mode}')
        assert reply.granted == (mode not in refused), mode
        assert reply.granted or reply.text.startswith(f'refused: {refused[mode].partition(":")[0]}'), reply
    assert refused['tle'] == ('below the horizon' if drive == 'enabled' else 'drive not ready: emergency stop')


@pytest.mark.parametrize(('station', 'absent'), (
    ({}, ('latitude_deg', 'longitude_deg', 'height')), ({'latitude_deg': -33.9, 'longitude_deg': 18.4}, ('height',)),
    ({'latitude_deg': 47.4, 'longitude_deg': 8.5, 'height': 500.0}, ())))
def test_without_a_position_no_satellite_and_no_sun_are_followed(station, absent):
    """By service, by command and on the page: each refusal names the parameters. Nothing is predicted."""
    made = Acu(parameters.build(AcuParameters, {
        'initial_mode': 'stop', 'prediction.line_1': LINES[0], 'prediction.line_2': LINES[1],
        'prediction.start_time': '2019-12-10T09:25:00',
        **{f'prediction.station.{name}': value for name, value in station.items()}}), ())
    made.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
    made.take_text(DRIVE_STATE_TOPIC, 'enabled')
    made.step(np.zeros(1, np.int64), made.inputs, made.outputs)
    values = dict(made.diagnose().values)
    assert ('sun_azimuth_deg' in values) == (not absent)
    text = 'position of the antenna not given, set ' + ', '.join(f'`prediction.station.{name}`' for name in absent)
    for mode in ('tle', 'sun'):
        replies = made.request(f'acu/{mode}'), made.command(Command(mode))
        if absent:
            assert replies == 2 * ((False, f'refused: {text}; mode is {values["mode"]}'),)
            assert values[f'refused {mode}'] == text
        else:
            assert not any('position' in reply.text for reply in replies)
            assert 'position' not in values.get(f'refused {mode}', '')


def test_the_diagnosis_says_by_which_elements_it_predicts():
    unit = Acu(AcuParameters(), ())
    assert 'line_1' not in dict(unit.diagnose().values)
    assert unit.command(Command('elements', arguments={'line_1': LINES[0].replace(' ', '_'), 'line_2': LINES[1]}))[0]
    values = dict(unit.diagnose().values)
    assert (values['line_1'], values['line_2']) == LINES
    assert unit.command(Command('elements', arguments={'omm': OMM})) == (True, 'elements of satellite 25544')
    values = dict(unit.diagnose().values)
    assert values['omm'] == OMM and 'line_1' not in values


@pytest.mark.parametrize('arguments, text', [
    ({}, 'elements: must be line_1 and line_2, or omm'),
    ({'line_1': LINES[0], 'line_2': LINES[1], 'omm': OMM}, 'elements: must be line_1 and line_2, or omm'),
    ({'line_1': LINES[0]}, 'TLE line 2: 0 characters, must be 69 of ASCII'),
    ({'omm': '{}'}, 'omm: MEAN_MOTION is missing')])
def test_elements_that_are_refused(arguments, text):
    unit = Acu(AcuParameters(), ())
    granted, reason = unit.command(Command('elements', arguments=arguments))
    assert not granted and reason.startswith(f'refused: {text}')
    assert not {'line_1', 'omm'} & dict(unit.diagnose().values).keys()


def test_what_an_operator_waits_for_is_urgent():
    unit = Acu(AcuParameters(), ())
    unit.inputs[JOINT_STATES_TOPIC]['stamp'] = 0
    unit.step(np.zeros(1, np.int64), unit.inputs, unit.outputs)
    before = unit.urgent
    assert unit.urgent == before
    unit.inputs[DRIVE_STATE_TOPIC] = topics.TOPIC_BY_NAME[DRIVE_STATE_TOPIC].texts.index('emergency stop')
    unit.step(np.ones(1, np.int64), unit.inputs, unit.outputs)
    assert unit.urgent != before


def test_a_program_track_without_the_axes_is_refused():
    message = messages.template('acu/program_track')
    message.joint_names = ['azimuth', 'polarisation']
    with pytest.raises(ValueError, match='must hold azimuth and elevation'):
        Acu(AcuParameters(), ()).decode('acu/program_track', message)
    assert records.is_text(MODE_TOPIC)


def stepped(unit, decoders, k, **changes):
    """Step k of a unit by the bytes of one message of each topic; changes: {topic: change(message)}."""
    for topic, decoder in decoders.items():
        message = messages.template(topic)
        messages.put_stamp(message.header.stamp, k * 5_000_000)
        if topic in changes:
            changes[topic](message)
        decoder.put(*decoder.decoded(messages.serialize(message)))
    unit.step(np.full(1, k * 5_000_000, np.int64), unit.inputs, unit.outputs)


def marked(field):
    """Return a change that marks a field of an Imu as no data."""
    def change(message):
        getattr(message, f'{field}_covariance')[0] = -1.0
    return change


@pytest.mark.parametrize('field', ('orientation', 'angular_velocity'))
def test_an_attitude_without_orientation_or_rates_is_lost(field):
    """The INS publishes on, with the level deck of an empty message: the alarm comes after attitude_timeout."""
    unit = Acu(AcuParameters(initial_mode='slave'), ('joint_states', 'ship/imu/data'))
    decoders = {topic: records.Decoder(topic, unit.inputs) for topic in unit.reads}
    # The beam of the axes at rest, on a deck whose bow points east.
    direction.set_moving(unit.parts['state']['guidance']['slave'], 0.0, (0.5 * np.pi, 0.0), 0.0, 0.0, np.inf)
    for k in range(20):
        stepped(unit, decoders, k)
    assert unit.encode(MODE_TOPIC, int(unit.outputs[0][MODE_TOPIC])) == 'slave' and unit.diagnose().level == 0
    lost = []
    for k in range(20, 80):
        stepped(unit, decoders, k, **{'ship/imu/data': marked(field)})
        lost.append(unit.alarms['alarm'][table.ALARM_INDEX['INS lost']]['state'] != machine.State.NORMAL)
    assert lost.index(True) == pytest.approx(40, abs=2)
    diagnosis = unit.diagnose()
    assert diagnosis.level == 2
    assert diagnosis.message == f'invalid input: attitude; ship/imu/data: {field} missing'
    assert unit.request('acu/slave').text == (f'refused: attitude invalid, ship/imu/data: {field} missing; '
                                              'mode is standby')
    for k in range(80, 90):
        stepped(unit, decoders, k)
    unit.diagnose()
    assert unit.request('acu/slave').granted


@pytest.mark.parametrize('change, missing', (
    (lambda message: setattr(message, 'velocity', np.zeros(0)), 'velocity'),
    (lambda message: setattr(message, 'velocity', np.zeros(1)), 'elevation.velocity'),
    (lambda message: setattr(message, 'name', ['azimuth', 'tilt']), 'elevation.position, elevation.velocity'),
    (lambda message: setattr(message, 'name', []), 'position, velocity'),
    (lambda message: message.position.__setitem__(0, np.nan), 'azimuth.position')))
def test_a_number_that_joint_states_lacks_is_named(change, missing):
    unit = Acu(AcuParameters(), ('joint_states',))
    decoders = {'joint_states': records.Decoder('joint_states', unit.inputs)}
    stepped(unit, decoders, 0, joint_states=change)
    text = f'joint_states: {missing} missing'
    assert unit.diagnose().message == f'invalid input: encoder; {text}'
    assert unit.request('acu/preset').text == f'refused: encoder invalid, {text}; mode is standby'
    assert dict(unit.diagnose().values)['refused preset'] == f'encoder invalid, {text}'


def test_a_torque_that_joint_states_lacks_is_no_fault():
    unit = Acu(AcuParameters(), ('joint_states',))
    decoders = {'joint_states': records.Decoder('joint_states', unit.inputs)}
    stepped(unit, decoders, 0, joint_states=lambda message: setattr(message, 'effort', np.zeros(0)))
    assert unit.diagnose().level == 0 and unit.request('acu/preset').granted
