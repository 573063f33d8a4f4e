"""Lockstep runs as a user starts them: the same every time, complete, equal to the closed loop, open to readers."""
import hashlib
import json
import pathlib

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from shared import PEDESTAL

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import parameters_of
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

PARAM = 'acu.tracker.lock_count=20'
LENGTH = {'leo_pass': 5.0, 'ship_pass': 3.0}
METRICS = {'pointing_rms_deg', 'pointing_max_deg', 'lost_steps', 'realtime_factor', 'single_sample_noise_deg',
           'lock_time_s', 'noise_reduction'}


def digest(run):
    [file] = run.bag.glob('*.mcap')
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.fixture(scope='module')
def runs(recorded):
    """Finished runs by name: a leo_pass and a ship_pass."""
    done = {}
    for name, case in (('first', 'leo_pass'), ('ship', 'ship_pass')):
        done[name], done[name].output = recorded(case)
    return done


@pytest.fixture(scope='module')
def others(start_run):
    """Finished runs by name, side by side: a leo_pass and a ship_pass of the seed of `runs`, and a leo_pass of another
    seed."""
    def start(name, *more):
        return start_run(name, '--pacing', 'lockstep', '--duration', LENGTH[name], '--param', PARAM, *more)

    done = {'under_load': start('leo_pass'), 'other_seed': start('leo_pass', '--seed', '2'),
            'ship_again': start('ship_pass')}
    for run in done.values():
        result = run.finish()
        assert result.returncode == 0, result.stderr
    return done


@pytest.mark.thorough
@pytest.mark.parametrize('first, second', [('first', 'under_load'), ('ship', 'ship_again')])
def test_same_seed_gives_the_same_file(runs, others, first, second):
    assert digest(runs[first]) == digest(others[second])


@pytest.mark.parametrize('name', ['first', 'ship'])
def test_the_recording_says_how_it_was_made(runs, name):
    """The scenario in the bag is the scenario that ran; its parameters are all of them, as the nodes had them."""
    bag = bags.read(runs[name].bag)
    case = bag.metadata['scenario']
    chosen = scenario.load(case, [PARAM], duration=LENGTH[case], pacing='lockstep')
    assert scenario.parse(case, bag.configuration['scenario']) == chosen
    said = bag.configuration['parameters']
    assert set(said) == set(chosen.nodes) - {'operator'}
    for node in set(said) - {'recorder'}:
        assert parameters.build(parameters_of(node), said[node]) == chosen.node_parameters(node)
        assert set(said[node]) == set(parameters.defaults(parameters_of(node)))
    assert {'git', 'version.python', 'version.numpy', 'version.numba', 'version.rclpy'} <= set(bag.metadata)
    made = f'made by: scenario {case}, lockstep, seed 1, git '
    assert any(line.startswith(made) for line in verify(load(runs[name].bag)).lines())


@pytest.mark.thorough
def test_another_seed_gives_another_file(runs, others):
    assert digest(runs['first']) != digest(others['other_seed'])


def test_rerun_makes_the_same_file_again(runs, run_process, tmp_path):
    done = run_process([*PEDESTAL, 'rerun', runs['first'].bag, '--bag', tmp_path / 'again'], 90.0)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout == f'{tmp_path}/again: equal to the last byte, sha256 {digest(runs["first"])}\n'


@pytest.mark.parametrize('name', ['first', 'ship'])
def test_rows_and_hash(runs, name):
    content = json.loads(runs[name].json.read_text())
    assert {row['case'] for row in content['rows']} == {content['name']}
    values = {row['metric']: row['value'] for row in content['rows']}
    assert METRICS <= set(values)
    assert values['lost_steps'] == 0
    assert content['mcap_sha256'] == digest(runs[name])
    assert content['mcap_sha256'] in runs[name].output.replace('\n', '')


def test_a_run_that_tracks_has_all_numbers(runs):
    rows = json.loads(runs['first'].json.read_text())['rows']
    assert [row['metric'] for row in rows if row['value'] is None] == []


ANNOUNCED = {'acu/keyhole', 'acu/blockage', 'acu/pointing', 'ins/state', *(
    name for node in nodes.NODES for name in (node.obeys, node.replies))}
"""Topics of words that neither run gives a reason to say, and nobody asks for anything."""


@pytest.mark.parametrize('name, topics', [('first', 21), ('ship', 28)])
def test_recording_is_complete(runs, name, topics, pedestal):
    code, said, _ = pedestal('verify', runs[name].bag)
    assert code == 0 and ': complete: ' in said
    report = verify(load(runs[name].bag))
    assert report.steps == round(LENGTH['leo_pass' if name == 'first' else 'ship_pass'] / 0.005) + 1
    assert len(report.topics) == topics
    assert {check.name for check in report.topics if not check.count} == ANNOUNCED & {check.name for check in
                                                                                      report.topics}


@pytest.mark.parametrize('name, scenario_name', [('first', 'leo_pass'), ('ship', 'ship_pass')])
def test_the_closed_loop_equals_the_run_to_the_last_bit(runs, name, scenario_name, differences):
    chosen = scenario.load(scenario_name, [PARAM], duration=LENGTH[scenario_name])
    assert differences(closed_loop.Loop(chosen).run(), bags.read(runs[name].bag)) == {}


def test_readers_of_others_see_the_same(runs):
    """rosbags and mcap with mcap-ros2-support open the bag of a real run: equal counts and numbers."""
    ours = bags.read(runs['ship'].bag)
    counts = {name: sum(1 for _ in ours.raw(name)) for name in ours.topics}
    with AnyReader([runs['ship'].bag]) as reader:
        assert {connection.topic.lstrip('/'): connection.msgcount for connection in reader.connections} == counts
        joints = [connection for connection in reader.connections if connection.topic == '/joint_states']
        theirs = np.array([reader.deserialize(data, connection.msgtype).position
                           for connection, _, data in reader.messages(joints)])
    [file] = pathlib.Path(runs['ship'].bag).glob('*.mcap')
    seen = dict.fromkeys(counts, 0)
    decoded = []
    with open(file, 'rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            seen[channel.topic.lstrip('/')] += 1
            if channel.topic == '/joint_states':
                decoded.append(list(message.position))
    assert seen == counts
    table = ours.table('joint_states')
    assert np.array_equal(theirs, np.column_stack((table['azimuth.position'], table['elevation.position'])))
    assert np.array_equal(theirs, decoded)


FOREIGN_BYTES = b'\0\1\0\0' + b'\xff' * 20


@pytest.mark.thorough
def test_foreign_messages_in_a_run_are_left_out_and_named(start_run, connect):
    """The run ends with its results, and its recording is complete without the foreign messages."""
    run = start_run('leo_pass', '--pacing', 'lockstep', '--duration', '20', '--param', PARAM)
    stranger = connect(run.domain_id, 'stranger')
    stranger.until(lambda: run.recorded(60_000))
    stranger.write('joint_states', 'acu/rate_command')
    rate_command = messages.template('acu/rate_command')
    messages.put_stamp(rate_command.header.stamp, 5 * 10**9)
    for name, data in (('joint_states', FOREIGN_BYTES), ('acu/rate_command', messages.serialize(rate_command))):
        for _ in range(3):
            stranger.publishers[name].publish(data)
            stranger.spin(0.05)
    result = run.finish()
    assert result.returncode == 0, result.stderr
    assert 'pointing_rms_deg' in result.stdout
    assert 'joint_states: 3 foreign messages left out, at ' in result.stdout + result.stderr
    assert 'acu/rate_command: 3 foreign messages left out, at ' in result.stdout + result.stderr
    content = load(run.bag)
    assert [line.partition(' left out')[0] for line in content.foreign] == [
        'joint_states: 3 foreign messages', 'acu/rate_command: 3 foreign messages']
    assert '(24 bytes)' in content.foreign[0]
    assert verify(content).complete
