"""A weather station that feeds a running control unit: its readings are used, recorded and recomputed, and bad ones
are named."""
import pytest

from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common.parameters import build
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_workbench.again import recompute
from pedestal_workbench.again.feed import FedRecording

pytestmark = pytest.mark.thorough

READINGS = {'weather/pressure': ('fluid_pressure', 96000.0), 'weather/temperature': ('temperature', 5.0),
            'weather/humidity': ('relative_humidity', 0.8)}


def reading(topic, value, stamp):
    message = messages.template(topic)
    setattr(message, READINGS[topic][0], value)
    messages.put_stamp(message.header.stamp, stamp)
    return message


@pytest.fixture(scope='module')
def run(start_run, connect):
    """A realtime run with a publisher of the weather: run.values, run.bad: values and text of the diagnostics."""
    run = start_run('leo_pass', '--pacing', 'realtime', '--duration', '20', '--param', 'acu.refraction.kind=radio',
                    '--param', 'scenario.priority=10')
    client = connect(run.domain_id, 'weather_station')
    client.read('joint_states')
    client.read('diagnostics')
    client.until(lambda: client.heard['joint_states'])
    client.write(*READINGS)

    def publish(topic, value):
        client.publish(topic, reading(topic, value, client.node.get_clock().now().nanoseconds))

    def values():
        for topic, (_, value) in READINGS.items():
            publish(topic, value)
        client.spin(0.3)
        found = [{value.key: value.value for value in status.values} for array in client.heard['diagnostics']
                 for status in array.status if status.name == 'acu']
        return next((of for of in reversed(found) if of.get('humidity', '').startswith('0.8')), None)
    run.values = client.until(values)
    publish('weather/humidity', 80.0)
    run.bad = client.diagnosed('weather/humidity').message
    publish('weather/humidity', float('nan'))
    client.diagnosed('dropped nan')
    client.close()
    run.result = run.interrupt()
    return run


def test_the_control_unit_uses_the_readings(run):
    assert run.values['pressure_hpa'].startswith('960, ') and run.values['temperature_celsius'].startswith('5, ')
    assert 'weather/humidity: dropped 80: must be 0 to 1' in run.bad


def test_the_readings_are_recorded_and_recomputed(run):
    bag = bags.read(run.bag)
    for topic, (field, value) in READINGS.items():
        assert (bag.table(topic)[field] == value).any(), topic
    recording = FedRecording(run.bag)
    acu = {key: value for key, value in bag.configuration['parameters']['acu'].items() if not key.startswith('graph.')}
    done = recompute.recompute(recording, 'acu', build(parameters_of('acu'), acu))
    assert done.unit.followed.air.revision == 1
    assert done.unit.followed.air.dropped['weather/humidity', 'out of range'] == 2
