"""Filters in the graph as a user starts it: rate and range measured, models by probability, changed while tracking."""
import json

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.graph import layouts, topics
from pedestal_recording import bag as bags
from pedestal_recording import export
from pedestal_recording import recording as recordings
from pedestal_recording.bag import load
from pedestal_recording.verify import verify
from pedestal_results import consistency, tracking

SECONDS = 5.0
PARAMS = ['acu.tracker.lock_count=20', 'tracking_receiver.receiver.rate.measured=true',
          'tracking_receiver.receiver.ranging.measured=true', 'tracking_receiver.receiver.latency=0.01',
          'acu.azimuth.filter.rate_measurement=true',
          'acu.elevation.filter.kind=imm_ukf']


def switched(run, connect):
    """Change the filters of a running graph to interacting models once it tracks."""
    client = connect(run.domain_id)
    client.read('acu/mode')
    client.until(lambda: any(message.data == 'autotrack' for message in client.heard['acu/mode']))
    imm = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value='imm')
    request = SetParameters.Request(parameters=[Parameter(name=f'{axis}.filter.kind', value=imm)
                                                for axis in topics.AXES])
    return [result.successful for result in client.call('acu/set_parameters', SetParameters, request).results]


@pytest.fixture(scope='module')
def runs(start_run, connect):
    """A run with rate and range, on a ship, and one whose filters are changed on the way."""
    params = [word for param in PARAMS for word in ('--param', param)]
    measured = start_run('ship_pass', '--pacing', 'lockstep', '--duration', f'{SECONDS:g}', *params)
    result = measured.finish(180.0)  # the first run compiles the laws
    assert result.returncode == 0, result.stderr
    kinds = [word for axis in topics.AXES for word in ('--param', f'acu.{axis}.filter.kind=current_statistical')]
    changed = start_run('uav_flyby', '--pacing', 'lockstep', '--duration', '15', '--param', PARAMS[0], *kinds)
    assert switched(changed, connect) == [True, True]
    result = changed.finish()
    assert result.returncode == 0, result.stderr
    return {'measured': measured, 'switched': changed}


@pytest.fixture(scope='module')
def told(runs):
    """(Bag, Consistency) of the run with rate and range."""
    bag = bags.read(runs['measured'].bag)
    return bag, consistency.read(bag, tracking.read(bag))


@pytest.mark.thorough
def test_every_topic_is_recorded(runs):
    report = verify(load(runs['measured'].bag))
    assert report.complete, report.lines()
    assert {'tracking_receiver/angle_rate', 'tracking_receiver/range', 'acu/filter'} <= {
        topic.name for topic in report.topics}
    assert not {'tracking_receiver/angle_rate', 'tracking_receiver/range'} & {
        topic.name for topic in verify(load(runs['switched'].bag)).topics}


@pytest.mark.thorough
def test_recomputed_to_the_last_bit(runs, pedestal):
    for node in ('tracking_receiver', 'acu'):
        code, said, _ = pedestal('recompute', runs['measured'].bag, '--node', node, '--absolute', 0, '--relative', 0)
        assert code == 0 and said.splitlines()[-1] == f'{node}: identical'
    assert 'acu/filter' in said


@pytest.mark.thorough
def test_the_closed_loop_equals_the_run(told, differences):
    run = closed_loop.Loop(scenario.load('ship_pass', PARAMS, duration=SECONDS)).run()
    bag, consistency_of_it = told
    assert differences(run, bag) == {}
    for name in ('innovation', 'rate_innovation', 'nis', 'sigma'):
        assert np.array_equal(getattr(consistency_of_it, name), layouts.of_filter(run.steps, name), equal_nan=True)


@pytest.mark.thorough
def test_what_the_filter_tells(told):
    """Azimuth from angle and rate, elevation from angle and range, with the noise the filter expects, on a rolling
    deck."""
    bag, found = told
    on = found.tracking
    assert on.sum() > 200
    for i, freedoms in enumerate((2.0, 1.0)):
        assert np.all(found.freedoms[on, i] == freedoms)
        assert found.axes[i].nis == pytest.approx(freedoms, rel=0.2)
    probability = found.probability[on]
    assert np.nansum(probability, axis=2) == pytest.approx(1.0)
    assert [[name for name, there in zip(topics.MOTION_MODELS, np.isfinite(probability[:, i]).all(axis=0)) if there]
            for i in range(2)] == [
                ['cv', 'ca', *(f'ca_{rung}' for rung in range(2, 9))], ['cv', 'ca']]
    assert np.all(np.abs(found.correlation[on]) <= 1.0) and np.all(found.sigma[on] > 0.0)
    header = list(export.table(bag, 'acu/filter'))
    assert 'azimuth_rate_sigma.position [rad/s]' in header and 'elevation_nis.position' in header
    assert 'range [m]' in export.table(bag, 'tracking_receiver/range')


@pytest.mark.thorough
def test_rows_and_report(runs, told, run_process, pedestal):
    run = runs['measured']
    values = {row['metric']: row['value'] for row in json.loads(run.json.read_text())['rows']}
    for i, axis in enumerate(topics.AXES):
        judged = told[1].axes[i]
        assert (values[f'{axis}_nis_mean'], values[f'{axis}_nees_mean']) == (judged.nis, judged.nees)
    assert pedestal('report', run.bag)[0] == 0
    page = (run.bag / 'report.html').read_text()
    assert '<figure id="probabilities"><h3>Motion models</h3><figcaption>' in page
    assert 'Azimuth: ' in page and 'not judged: ' in page


@pytest.mark.thorough
def test_a_filter_changed_while_it_tracks_makes_no_bump(runs):
    bag = bags.read(runs['switched'].bag)
    found = consistency.read(bag, tracking.read(bag))
    changed = np.flatnonzero(np.isfinite(found.probability[:, 0, topics.MOTION_MODELS.index('cv')]))[0]
    assert bag.table('acu/mode')['data'] == ['program', 'autotrack']
    assert np.all(recordings.modes(bag, found.t)[changed - 1:] == 'autotrack')
    change = np.abs(np.diff(np.column_stack([bag.table('acu/rate_command')[f'{axis}.velocity']
                                             for axis in topics.AXES]), axis=0))
    # 0.05 s: what comes later is what the new models make of the measurements
    before, after = slice(changed - 50, changed - 1), slice(changed - 1, changed + 10)
    assert np.all(change[after].max(axis=0) < 5.0 * change[before].max(axis=0))
    assert np.all(np.abs(found.error[changed:changed + 50]) < 5.0 * found.sigma[changed:changed + 50])


@pytest.mark.parametrize('override, text', [
    ('acu.receiver_rate=true', 'acu: receiver_rate = True: must be False'),
    ('recorder.receiver_range=true', 'recorder: receiver_range = True: must be False'),
    ('acu.ins_error=true', 'acu: ins_error = True: must be False')])
def test_a_topic_nobody_measures_is_not_waited_for(override, text):
    with pytest.raises(ScenarioError, match=text):
        scenario.load('leo_pass', [override])


def test_a_model_of_an_ins_that_tells_its_error_is_refused():
    chosen = ['acu.tracker.attitude.tilt_noise=1e-4']
    with pytest.raises(ScenarioError, match='acu: tracker.attitude.tilt_noise: the INS publishes its errors; '
                                                     'this parameter needs ins.error_told = false'):
        scenario.load('ship_pass', chosen)
    assert scenario.load('ship_pass', [*chosen, 'ins.error_told=false']).node_parameters('acu').ins_error is False
