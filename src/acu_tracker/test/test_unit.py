"""The control unit as a node sees it: its diagnosis, its program track, its requests."""
import numpy as np
import pytest

from acu_tracker.params import AcuParameters
from acu_tracker.program.prediction import PredictionParameters
from acu_tracker.unit import DRIVE_STATE_TOPIC, JOINT_STATES_TOPIC, MODE_TOPIC, RATE_COMMAND_TOPIC, Acu
from pedestal_common.graph import topics
from pedestal_common.graph.modes import MODES
from pedestal_common.wire import messages, records
from pedestal_common.wire.commands import Command

LINES = ('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
         '2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482')


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
            line_1=LINES[0], line_2=LINES[1], start_time='2019-12-10T09:00:00')), ())
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


def test_the_diagnosis_says_by_which_elements_it_predicts():
    unit = Acu(AcuParameters(), ())
    assert 'line_1' not in dict(unit.diagnose().values)
    assert unit.command(Command('elements', arguments={'line_1': LINES[0].replace(' ', '_'), 'line_2': LINES[1]}))[0]
    values = dict(unit.diagnose().values)
    assert (values['line_1'], values['line_2']) == LINES


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
