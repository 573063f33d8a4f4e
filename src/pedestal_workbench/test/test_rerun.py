"""Reruns: refusals and the comparison of two recordings; the run itself is tested in test/test_lockstep.py."""
import dataclasses

import pytest
import yaml

from pedestal_bringup.scenario import scenario
from pedestal_common.graph import nodes
from pedestal_common.wire import messages
from pedestal_recording import bag, configuration
from pedestal_recording.writer import Writer
from pedestal_workbench.again import rerun

NODES = ('tracking_receiver', 'acu', 'adu', 'recorder')
RECORDED = [topic for topic in nodes.recorded(NODES)
            if topic.name in ('clock', 'joint_states', 'acu/rate_command', 'acu/mode')]
NAMES = [topic.name for topic in RECORDED]
T = 5_000_000


def rows(steps=20, **changed):
    """[(topic, stamp, message)]; changed: {field of joint_states: (step, axis, value)}."""
    made = []
    for k in range(steps):
        for name in NAMES:
            if name == 'clock':
                message = messages.Clock(clock=messages.Time(sec=0, nanosec=k * T))
            elif name == 'acu/mode':
                message = messages.String(data='standby')
            else:
                message = messages.template('joint_states')
                message.header.stamp.nanosec = k * T
                message.position[:] = 0.1 * k
                for field, (step, axis, value) in changed.items():
                    if name == 'joint_states' and step == k:
                        getattr(message, field)[axis] = value
            if name != 'acu/mode' or k in (0, 10):
                made.append((name, k * T, message))
    return made


def write(path, made, more=(), **metadata):
    writer = Writer(path, RECORDED, {'scenario': 'leo_pass', 'pacing': 'lockstep', 'git': 'abc', **metadata}, more)
    for name, stamp, message in made:
        writer.write(NAMES.index(name), stamp, stamp, messages.serialize(message))
    writer.close()
    return bag.read(path)


def compared(tmp_path, now, **metadata):
    result = rerun.result(write(tmp_path / 'was', rows()), write(tmp_path / 'now', now, **metadata))
    *lines, verdict = result.lines()
    assert verdict.startswith(f'{tmp_path / "now"}: ')
    return result, lines, verdict.partition(': ')[2]


def test_equal_bytes(tmp_path):
    result, lines, verdict = compared(tmp_path, rows())
    assert result.same and result.equal and lines == []
    assert verdict == f'equal to the last byte, sha256 {result.sha256}'


def test_another_version_with_equal_messages_is_named_as_such(tmp_path):
    result, lines, verdict = compared(tmp_path, rows(), git='def-dirty', **{'version.numpy': '2.4.6'})
    assert result.equal and not result.same
    assert lines == ['pedestal.git: abc -> def-dirty', 'pedestal.version.numpy: none -> 2.4.6']
    assert verdict == 'messages equal, made by another version'


def test_other_metadata_is_no_other_version(tmp_path):
    result, lines, verdict = compared(tmp_path, rows(), seed='9')
    assert result.equal and lines == ['pedestal.seed: none -> 9'] and verdict == 'messages equal, metadata differ'


def test_the_first_difference_has_topic_stamp_and_field(tmp_path):
    result, lines, verdict = compared(tmp_path, rows(velocity=(7, 1, 0.25), effort=(9, 0, 3.0)))
    assert not result.equal and verdict == 'NOT equal'
    assert lines == ['joint_states: 20 messages, 2 differ, the first at 0.035000 s: velocity[1] 0.0 -> 0.25']


def test_missing_and_more_messages_come_in_the_order_of_their_stamps(tmp_path):
    now = [row for row in rows() if not (row[0] == 'clock' and row[1] == 19 * T)]
    now.append(('acu/mode', 19 * T, messages.String(data='preset')))
    now[1][2].name[1] = 'tilt'
    result, lines, _ = compared(tmp_path, now)
    assert not result.equal
    assert lines == ["joint_states: 20 messages, 1 differ, the first at 0.000000 s: name[1] 'elevation' -> 'tilt'",
                     'clock: 20 messages, now 19, 1 differ, the first at 0.095000 s: no new message',
                     'acu/mode: 2 messages, now 3, 1 differ, the first at 0.095000 s: not recorded']


def test_another_order_in_the_file_is_a_difference(tmp_path):
    now = rows()
    now[4], now[5] = now[5], now[4]
    result, lines, _ = compared(tmp_path, now)
    assert not result.equal
    assert lines == ['clock: 20 messages, 0 differ, the first at 0.005000 s: position in the file; '
                     'the new file has joint_states at 0.005000 s there']


def test_a_recording_that_breaks_off_is_equal_up_to_its_end(tmp_path):
    result = rerun.result(write(tmp_path / 'was', rows(12)), write(tmp_path / 'now', rows()))
    assert not result.equal
    assert result.lines() == [f'{tmp_path}/now: NOT equal, but equal up to 0.055000 s, the end of the recording']


@pytest.fixture
def recorded(tmp_path):
    """recorded(scenario, change of its parameters) -> Bag with this configuration."""
    def make(chosen, change=lambda values: None, **metadata):
        texts = configuration.recorder_parameters(chosen)
        values = yaml.safe_load(texts['parameters_yaml'])
        change(values)
        more = configuration.records(texts['scenario_yaml'], yaml.safe_dump(values))
        return write(tmp_path / 'b', rows(), more, **metadata)
    return make


def test_the_scenario_comes_back_from_the_recording(recorded):
    chosen = scenario.load('leo_pass', ['acu.azimuth.feedforward.bandwidth=12'], seed=3, duration=4.0)
    assert rerun.scenario_of_recording(recorded(chosen)) == chosen


def test_a_default_that_has_changed_since_is_set_as_it_was(recorded):
    chosen = scenario.load('leo_pass')
    changed = {'azimuth.feedforward.bandwidth': 19.0}
    again = rerun.scenario_of_recording(recorded(chosen, lambda values: values['acu'].update(changed)))
    values = {**chosen.values, 'acu': {**chosen.values['acu'], **changed}}
    assert again == dataclasses.replace(chosen, values=values)


def test_a_topic_that_the_recording_could_not_have_is_not_there(recorded):
    def older(values):
        for node, name in (('ins', 'error_told'), ('acu', 'ins_error'), ('recorder', 'ins_error')):
            del values[node][name]
    chosen = scenario.load('ship_pass', ['ins.error_told=false'])
    again = rerun.scenario_of_recording(recorded(scenario.load('ship_pass'), older, scenario='ship_pass'))
    assert all(again.node_parameters(node) == chosen.node_parameters(node) for node in ('ins', 'acu', 'recorder'))


def test_what_cannot_be_made_again_is_refused(tmp_path, recorded):
    with pytest.raises(bag.BagError, match='a_0.mcap: contains no configuration, so it cannot be rerun'):
        rerun.scenario_of_recording(write(tmp_path / 'a', rows()))
    with pytest.raises(bag.BagError, match="by a version with other parameters: acu: unknown parameter 'gone'"):
        rerun.scenario_of_recording(recorded(scenario.load('leo_pass'), lambda values: values['acu'].update(gone=1.0)))


def test_a_realtime_recording_is_refused(recorded):
    with pytest.raises(bag.BagError, match='pacing is realtime; must be lockstep to rerun'):
        rerun.scenario_of_recording(recorded(scenario.load('leo_pass', pacing='realtime'), pacing='realtime'))
