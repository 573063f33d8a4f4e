"""`pedestal recompute`: recorded inputs through the nodes' step functions and, once, through a node's process."""
import functools
import json
import math
import pathlib
import sys

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from shared import PEDESTAL

from pedestal_common.graph import nodes as graph
from pedestal_common.graph import topics
from pedestal_common.wire import messages
from pedestal_common.wire.commands import SERVICE_CLIENT, Command
from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify
from pedestal_recording.writer import Writer as BagWriter
from pedestal_results import results, tracking
from pedestal_workbench.again import difference, recompute, recompute_report
from pedestal_workbench.again.feed import FedRecording

REFERENCES = pathlib.Path(__file__).parent.parent / 'bags' / 'reference'
LIVE = pathlib.Path(__file__).with_name('recompute_live.py')
EXACT = ('--absolute', '0', '--relative', '0')
ESTIMATE, REFERENCE, MODE, ERROR = 'acu/estimate', 'acu/reference', 'acu/mode', 'tracking_receiver/angle_error'
OUTPUTS = ('acu/rate_command', ESTIMATE, REFERENCE, 'acu/filter', MODE)


@pytest.fixture(scope='module')
def runs(recorded):
    """A run ashore, 5 s, and one on a ship, 3 s, in which the ACU comes to autotrack."""
    return {'leo': recorded('leo_pass')[0], 'ship': recorded('ship_pass')[0]}


@pytest.fixture
def pedestal(pedestal):
    """That of all tests, with the verb of these."""
    return functools.partial(pedestal, 'recompute')


@pytest.fixture
def rewrite(tmp_path):
    """rewrite(bag, change, pacing=None, without=()) -> path of a copy that lacks some topics; change([(topic, log,
    publish, data)]) -> the rows of it."""
    def make(source, change, pacing=None, without=()):
        bag = bags.read(source)
        named = [topic for topic in topics.TOPICS if topic.name in bag.topics and topic.name not in without]
        index = {topic.name: number for number, topic in enumerate(named)}
        path = tmp_path / f'changed-{len(list(tmp_path.iterdir()))}'
        writer = BagWriter(path, named, {**bag.metadata, **({'pacing': pacing} if pacing else {})},
                             {name: content for name, content in bag.metadata_records.items() if name != 'pedestal'})
        for topic, log, publish, data in change([row for row in bag.raw() if row[0] in index]):
            writer.write(index[topic], log, publish, data)
        writer.close()
        return path
    return make


def where(rows, topic, number):
    """The place of the number-th message of a topic."""
    return [place for place, row in enumerate(rows) if row[0] == topic][number]


def changed(topic, number, change):
    """A change of rewrite: change(message) of one message."""
    def make(rows):
        place = where(rows, topic, number)
        name, log, publish, data = rows[place]
        message = messages.deserialize(data, topics.TOPIC_BY_NAME[topic].type)
        change(message)
        rows[place] = name, log, publish, messages.serialize(message)
        return rows
    return make


def lines_of(output, topic):
    """The line of a topic and those indented below it."""
    lines = output.splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith(topic + ' '))
    stop = next((number for number in range(start + 1, len(lines)) if not lines[number].startswith('  ')), None)
    return lines[start:stop]


@pytest.mark.parametrize('name, nodes', [
    ('leo', ('tracking_receiver', 'acu', 'adu')),
    ('ship', ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu'))])
def test_a_lockstep_recording_comes_out_the_same_to_the_last_bit(runs, name, nodes, pedestal, tmp_path):
    rows = tmp_path / 'rows.json'
    code, said, errors = pedestal(runs[name].bag, *EXACT, '--json', rows)
    assert code == 0, said + errors
    assert [line for line in said.splitlines() if line.endswith(': identical')] == [
        f'{node}: identical' for node in nodes]
    values = {(row['case'], row['metric']): row['value'] for row in json.loads(rows.read_text())['rows']}
    assert {case for case, _ in values} == set(nodes)
    recording = FedRecording(runs[name].bag)
    written = {name for name, link in graph.links().items()
               if set(link.writers) & set(nodes) and link.rate != 'second' and recording.has(name)} - {'acu/alarms'}
    assert {metric.split()[0] for _, metric in values} == written
    assert all(value == 0 for (_, metric), value in values.items() if metric.endswith(('differences', 'problems')))
    steps = round({'leo': 5.0, 'ship': 3.0}[name] / 0.005) + 1
    assert values['acu', 'acu/estimate recomputed'] == values['acu', 'acu/estimate recorded'] == steps


def test_a_wrong_number_is_named(runs, rewrite, pedestal):
    def change(message):
        message.points[0].velocities = message.points[0].velocities + (0.0, 0.25)
    code, said, _ = pedestal(rewrite(runs['leo'].bag, changed(ESTIMATE, 600, change)), '--node', 'acu')
    assert code == 1
    assert said.splitlines()[-1] == 'acu: DIFFERS'
    [_, line] = lines_of(said, ESTIMATE)
    assert line.split() == ['elevation.velocity', '1', '1', '0.25', '3.000000']
    assert lines_of(said, REFERENCE)[0].endswith('identical')


def test_tolerances_and_the_ignore_list(runs, rewrite, pedestal):
    def change(message):
        message.points[0].positions = message.points[0].positions + (1e-7, 0.0)
    path = rewrite(runs['leo'].bag, changed(ESTIMATE, 600, change))
    assert pedestal(path, '--node', 'acu')[0] == 1
    code, said, _ = pedestal(path, '--node', 'acu', '--absolute', '2e-7')
    assert code == 0 and said.splitlines()[-1] == 'acu: equal within tolerance'
    assert lines_of(said, ESTIMATE)[1].split()[:3] == ['azimuth.position', '1', '0']
    code, said, _ = pedestal(path, '--node', 'acu', '--ignore', 'acu/estimate.azimuth*')
    assert code == 0 and said.splitlines()[-1] == 'acu: identical'
    assert pedestal(path, '--node', 'acu', '--ignore', ESTIMATE)[0] == 0


def test_a_number_against_none_differs(runs, rewrite, pedestal):
    def change(message):
        message.points[0].positions = message.points[0].positions + (math.nan, 0.0)
    code, said, _ = pedestal(rewrite(runs['leo'].bag, changed(ESTIMATE, 600, change)), '--node', 'acu', '--absolute',
                             '1e9')
    assert code == 1
    assert lines_of(said, ESTIMATE)[1].split() == ['azimuth.position', '1', '1', 'other', '3.000000']


def test_a_wrong_frame_is_named(runs, rewrite, pedestal):
    def change(message):
        message.header.frame_id = 'mars'
    code, said, _ = pedestal(rewrite(runs['leo'].bag, changed(ESTIMATE, 7, change)), '--node', 'acu')
    assert code == 1
    assert lines_of(said, ESTIMATE)[1].split() == [*difference.REST_FIELD.split(), '1', '1', 'other', '0.035000']


def test_a_wrong_mode_is_named(runs, rewrite, pedestal):
    def change(message):
        message.data = 'stow'
    code, said, _ = pedestal(rewrite(runs['leo'].bag, changed(MODE, 0, change)), '--node', 'acu', '--ignore',
                             'acu/r*', '--ignore', 'acu/e*')
    assert code == 1
    assert any('acu/stow requested at 0.000000 s' in line for line in said.splitlines())
    assert 'DIFFERS' in said


def test_a_dropped_and_a_doubled_message_are_named(runs, rewrite, pedestal):
    def change(rows):
        del rows[where(rows, ESTIMATE, 500)]
        place = where(rows, REFERENCE, 300)
        return rows[:place] + [rows[place]] + rows[place:]
    code, said, _ = pedestal(rewrite(runs['leo'].bag, change), '--node', 'acu')
    assert code == 1
    assert lines_of(said, ESTIMATE)[1:] == ['  1000 messages recorded, 1001 recomputed',
                                            '  1 not recorded, the first at 2.500000 s']
    assert lines_of(said, REFERENCE)[1:] == ['  1002 messages recorded, 1001 recomputed',
                                             '  1 recorded more than once, the first at 1.500000 s']


def test_messages_in_the_wrong_order_are_named(runs, rewrite, pedestal):
    def change(rows):
        a, b = where(rows, ESTIMATE, 500), where(rows, ESTIMATE, 501)
        rows[a], rows[b] = rows[b], rows[a]
        return rows
    code, said, _ = pedestal(rewrite(runs['leo'].bag, change), '--node', 'acu')
    assert code == 1
    assert lines_of(said, ESTIMATE)[1:] == ['  order: 1 recorded stamps go back, the first from 2.505000 to '
                                            '2.500000 s']


def test_a_missing_input_is_named(runs, rewrite, pedestal):
    def change(rows):
        del rows[where(rows, ERROR, 500)]
        return rows
    code, said, _ = pedestal(rewrite(runs['leo'].bag, change), '--node', 'acu')
    assert code == 1
    assert f'NOT recomputed to the end: inputs: {ERROR} is stamped 2.505000 s where 2.500000 s is due' in said
    assert '501 not recomputed, the first at 2.500000 s' in said


def test_a_changed_parameter_is_reported_old_against_new(runs, pedestal, tmp_path):
    """A wilder target model follows faster and filters less."""
    path, rows = runs['leo'].bag, tmp_path / 'rows.json'
    wilder = [part for axis in ('azimuth', 'elevation') for change in ('kind=ca', 'ca.noise=1')
              for part in ('--param', f'acu.{axis}.filter.{change}')]
    code, said, _ = pedestal(path, *wilder, '--json', rows)
    assert code == 0
    assert 'the recorded antenna does not move with the recomputed command' in said
    assert said.startswith(('worse: ', 'not judged: ')) and 'acu/estimate' not in said
    assert 'acu/estimate' in pedestal(path, *wilder, '--fields')[1]
    values = {row['metric']: row['value'] for row in json.loads(rows.read_text())['rows']}
    assert values['recorded_pointing_rms_deg old'] == values['recorded_pointing_rms_deg new']
    assert values['noise_reduction new'] < 0.7 * values['noise_reduction old']
    for name in ('estimate_rate_noise_deg_s', 'command_noise_deg_s', 'estimate_rate_error_rms_deg_s'):
        assert values[f'{name} new'] > 2.0 * values[f'{name} old']
    assert values['evaluated_time_s old'] == values['evaluated_time_s new'] > 1.0


def test_the_numbers_of_a_recording_and_of_a_late_estimate(runs):
    """Those of the recording are what its run said; the recorded estimate, delayed by 20 ms, lags 20 ms more."""
    from pedestal_workbench.again import what_if
    recording = FedRecording(runs['leo'].bag)
    old = {name: recording.output(name) for name in OUTPUTS}
    late = difference.Output(old[ESTIMATE].stamps[4:], old[ESTIMATE].values[:-4])
    numbers = what_if.numbers(what_if.evaluated(recording.bag, [old, {**old, ESTIMATE: late}]))
    summary = results.measured(tracking.read(recording.bag).parts)
    for name, theirs in (('noise_reduction', 'noise_reduction'), ('recorded_pointing_rms_deg', 'pointing_rms_deg')):
        assert numbers[name][0][0] == pytest.approx(summary[theirs][0], rel=1e-9)
    (before, after), unit = numbers['estimate_lag_s']
    assert unit == 's'
    assert after - before == pytest.approx(0.02, abs=1e-3)


def test_a_recording_from_before_the_truth_is_read_by_its_encoders(runs, rewrite, pedestal):
    """Every verb that reads the truth of the dish takes joint_states for it and says so. The receiver then errs by the
    counts of the encoders."""
    path = rewrite(runs['leo'].bag, lambda rows: rows, without=('adu/truth',))
    assert verify(load(path)).finished
    old, whole = (results.measured(tracking.read(bags.read(bag)).parts) for bag in (
        path, runs['leo'].bag))
    assert not any(name.startswith('encoder_') for name in old)
    for name in ('pointing_rms_deg', 'pointing_max_deg', 'cross_elevation_rms_deg', 'elevation_max_deg'):
        assert old[name][0] == pytest.approx(whole[f'encoder_{name}'][0], rel=1e-12)
        assert old[name] != whole[name]
    code, said, _ = pedestal(path, '--node', 'tracking_receiver', '--absolute', '5e-3', '--relative', '0')
    assert code == 0 and 'no adu/truth in the recording: joint_states replaces it' in said
    assert said.splitlines()[-1] == 'tracking_receiver: equal within tolerance'
    assert pedestal(path, '--node', 'acu', *EXACT)[0] == pedestal(path, '--node', 'adu', *EXACT)[0] == 0
    _, said, _ = pedestal(path, '--param', 'acu.azimuth.filter.kind=ca')
    assert f'note: {tracking.ENCODER_BEAM_NOTE}' in said.splitlines()


@pytest.fixture
def inputs_only(runs, rewrite):
    return rewrite(runs['leo'].bag, lambda rows: [row for row in rows if row[0] in (
        'joint_states', ERROR, 'acu/program_track', 'target/truth')])


def test_a_bag_with_inputs_only_gets_its_outputs(inputs_only, runs, pedestal, tmp_path):
    output = tmp_path / 'with_outputs'
    code, said, _ = pedestal(inputs_only, '--node', 'acu', '--output', output)
    assert code == 0
    assert 'the recording has no output of the node, so there is no comparison' in said
    assert any(line.startswith('noise_reduction ') for line in said.splitlines())
    whole, made = bags.read(runs['leo'].bag), bags.read(output)
    for topic in OUTPUTS[:3]:
        assert [data for *_, data in made.raw(topic)] == [data for *_, data in whole.raw(topic)]
    assert [(log, message) for _, log, _, message in made.messages(MODE)] == [
        (log, message) for _, log, _, message in whole.messages(MODE)]
    assert made.configuration == whole.configuration
    assert pedestal(output, '--node', 'acu', *EXACT)[0] == 0


def test_a_changed_parameter_on_a_ship_and_rows_alone_on_the_standard_output(run_process):
    ship = pathlib.Path(__file__).parents[1] / 'bags' / 'reference' / 'ship_pass'
    done = run_process([*PEDESTAL, 'recompute', ship, '--param', 'acu.azimuth.filter.kind=ca', '--json', '-'],
                       120.0)
    assert done.returncode == 0, done.stderr
    metrics = {row['metric'] for row in json.loads(done.stdout)['rows']}
    assert any('pointing' in metric or 'estimate' in metric for metric in metrics), metrics
    assert 'acu: ' in done.stderr and 'Traceback' not in done.stderr


def test_a_parameter_with_its_recorded_value_is_named(runs, pedestal):
    same, other = 'azimuth.filter.kind=imm', 'elevation.filter.kind=ca'
    code, said, _ = pedestal(runs['leo'].bag, '--node', 'acu', '--param', same)
    assert code == 0
    assert ('nothing is changed: the recording has the same values (azimuth.filter.kind = imm); old: recorded'
            in said.splitlines())
    _, said, _ = pedestal(runs['leo'].bag, '--node', 'acu', '--param', same, '--param', other)
    assert ('changed: elevation.filter.kind = ca; the same as in the recording: azimuth.filter.kind = imm; '
            'old: recorded') in said.splitlines()


def test_a_bag_with_inputs_only_and_a_changed_parameter(inputs_only, pedestal):
    code, said, _ = pedestal(inputs_only, '--node', 'acu', '--param', 'azimuth.filter.imm.dwell=2',
                             '--fields')
    assert code == 0
    assert 'old: recomputed with unchanged parameters' in said
    assert lines_of(said, ESTIMATE)[1].split()[0] == 'azimuth.position'


def as_it_came(rows):
    """Rows of a lockstep recording in the order of arrival: the program track at once, a state before what its writer
    says in that step."""
    ranks = {'acu/program_track': -1e9, 'adu/state': -1.0, MODE: 1.0, 'acu/rate_command': 2.0, ESTIMATE: 2.0,
             REFERENCE: 2.0}

    def rank(row):
        return row[1] + ranks.get(row[0], 0.0)
    return sorted(rows, key=rank)


@pytest.fixture
def foreign(runs, tmp_path):
    """The run ashore as another program records it: one file of ours turned into one of rosbags', arrival times."""
    bag, path = bags.read(runs['leo'].bag), tmp_path / 'foreign'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {name: writer.add_connection('/' + name, kind, typestore=messages.ROS_TYPESTORE)
                       for name, kind in bag.topics.items()}
        for number, (topic, log, _, data) in enumerate(as_it_came(bag.raw())):
            writer.write(connections[topic], 1_700_000_000_000_000_000 + log + number, data)
    return path


def test_a_foreign_bag_with_the_parameters_of_its_run(foreign, runs, pedestal):
    code, said, _ = pedestal(foreign, '--params-file', runs['leo'].log / 'parameters.yaml', *EXACT)
    assert code == 0, said
    assert [line for line in said.splitlines() if line.endswith(': identical')] == [
        'tracking_receiver: identical', 'acu: identical', 'adu: identical']


def test_a_foreign_bag_without_parameters_says_so(foreign, pedestal):
    code, said, _ = pedestal(foreign)
    assert code == 1
    assert 'acu: 1001 steps, 0 to 5 s, realtime; DEFAULT parameters' in said
    assert 'acu: the recording is realtime' in said
    assert 'adu:' not in said


def test_a_recording_in_realtime_order(runs, rewrite, pedestal):
    """The same messages, matched by when they came."""
    path = rewrite(runs['leo'].bag, lambda rows: [(topic, log, number, data) for number, (topic, log, _, data)
                                                  in enumerate(as_it_came(rows))], pacing='realtime')
    code, said, _ = pedestal(path, *EXACT)
    assert code == 0, said
    assert ', realtime; ' in said


REQUESTS = {'acu': (MODE, {400: 'acu/standby', 500: 'acu/program'}, ['standby', 'program', 'autotrack']),
            'adu': ('adu/state', {400: 'adu/emergency_stop', 600: 'adu/reset_faults', 800: 'adu/disable',
                                  900: 'adu/enable'},
                    ['emergency stop', 'releasing brakes', 'enabled', 'stopping', 'engaging brakes', 'disabled',
                     'releasing brakes', 'enabled'])}


@pytest.fixture(params=REQUESTS)
def requested(runs, tmp_path, request):
    """(node, path) of the run ashore as it would have been recorded had someone asked something of a node."""
    recording, node = FedRecording(runs['leo'].bag), request.param
    requests = REQUESTS[node][1]
    done = recompute.recompute(recording, node, recompute.parameters_of(recording, node),
                               {step: [Command(service, SERVICE_CLIENT)] for step, service in requests.items()})
    assert done.requests == {step: [(Command(service, SERVICE_CLIENT), True)] for step, service in requests.items()}
    recompute_report.write(tmp_path / 'requested', recording, done.outputs, done.unit.messages, {})
    return node, tmp_path / 'requested'


def test_what_was_asked_for_is_found_and_asked_for_again(requested, pedestal):
    node, path = requested
    topic, requests, states = REQUESTS[node]
    code, said, _ = pedestal(path, '--node', node, *EXACT)
    assert code == 0, said
    for step, service in requests.items():
        assert f'{service} requested at {step * 0.005:.6f} s' in said
    assert f'{len(requests)} requests repeated' in said
    table = bags.read(path).table(topic)
    assert [text for text, t in zip(table['data'], table['t']) if t > 1.9][:len(states)] == states


@pytest.mark.thorough
def test_an_excitation_comes_out_the_same_to_the_last_bit(start_run, pedestal):
    """The command adds a multisine for 1 s, as the control unit of the graph did."""
    run = start_run('leo_pass', '--pacing', 'lockstep', '--duration', '6', '--param', 'acu.tracker.lock_count=20',
                    '--param', 'acu.commands=3 stop; 4 excite axis=azimuth peak=0.02 duration=1')
    run.finish()
    table = bags.read(run.bag).table('acu/rate_command')
    during, later = (table['azimuth.velocity'][(table['t'] > begin) & (table['t'] < begin + 0.9)]
                     for begin in (4.05, 5.1))
    assert np.ptp(during) > 0.015 > 10.0 * np.ptp(later)
    code, said, _ = pedestal(run.bag, *EXACT)
    assert code == 0, said


@pytest.mark.thorough
def test_the_process_of_the_node_says_the_same(requested, run_process, reserve_domain):
    """Inputs, program track and services, over DDS."""
    node, path = requested
    topic = REQUESTS[node][0]
    done = run_process([sys.executable, LIVE, path, node], 120.0, ROS_DOMAIN_ID=str(reserve_domain()))
    assert done.returncode == 0, done.stdout + done.stderr
    assert topic in done.stdout


def test_what_was_never_exercised_fails(runs, rewrite, pedestal):
    """The first 0.2 s: everything equal, nothing locked."""
    path = rewrite(runs['leo'].bag, lambda rows: [row for row in rows if row[1] <= 200_000_000])
    code, said, _ = pedestal(path)
    assert code == 1
    assert [line for line in said.splitlines() if 'NOT exercised' in line] == [
        'tracking_receiver: NOT exercised: the receiver never locked (allowed with --allow-idle)',
        'acu: NOT exercised: the receiver never locked (allowed with --allow-idle)']
    assert pedestal(path, '--allow-idle')[0] == 0


def test_locked_but_never_tracked_fails(runs, rewrite, pedestal):
    modes = bags.read(runs['leo'].bag).table(MODE)
    before = (modes['t'][modes['data'].index('autotrack')] - 0.01) * 1e9
    path = rewrite(runs['leo'].bag, lambda rows: [row for row in rows if row[1] <= before])
    code, said, _ = pedestal(path, '--node', 'acu')
    assert code == 1
    assert 'acu: NOT exercised: the ACU was never in autotrack' in said


def test_a_drive_that_was_never_told_to_move_fails(runs, rewrite, pedestal):
    def change(rows):
        still = messages.template('joint_states')
        for place, (topic, log, publish, _) in enumerate(rows):
            if topic == 'acu/rate_command':
                messages.put_stamp(still.header.stamp, log)
                rows[place] = topic, log, publish, messages.serialize(still)
        return rows
    code, said, _ = pedestal(rewrite(runs['leo'].bag, change), '--node', 'adu')
    assert code == 1
    assert 'adu: NOT exercised: no rate was ever commanded' in said


def test_speed_is_measured(runs):
    assert math.isfinite(recompute.measure(runs['leo'].bag))


BAD = {
    'no bag': ((), 'nowhere: No such file or directory'),
    'node': (('--node', 'radio'), '--node radio: must be one of ship_motion, ins, tracking_receiver, acu, adu'),
    'parameter': (('--node', 'acu', '--param', 'tracker.gates=9'), "did you mean 'tracker.gate'?"),
    'value': (('--node', 'acu', '--param', 'tracker.gate=-1'), 'tracker.gate = -1'),
    'no node of the parameter': (('--param', 'alpha=1'), "--param 'alpha=1': must be node.key=value"),
    'another node': (('--node', 'acu', '--param', 'adu.period=0.01'), 'adu is not recomputed; must be one of acu'),
    'file': (('--params-file', 'nowhere.yaml'), '--params-file nowhere.yaml: '),
    'node not there': (('--node', 'ins'), 'no ship/imu/data_raw in the bag, an input of the node'),
    'output': (('--output', '.'), '--output . exists already'),
}


@pytest.mark.parametrize('case', BAD)
def test_bad_input_is_one_line(case, runs, pedestal, one_line):
    arguments, text = BAD[case]
    code, _, errors = pedestal('nowhere' if case == 'no bag' else runs['leo'].bag, *arguments)
    assert code == (1 if case == 'no bag' else 2)
    assert text in one_line(errors)


def test_a_topic_of_another_type_is_refused(runs, pedestal, tmp_path, one_line):
    with Writer(tmp_path / 'other', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = [writer.add_connection(name, 'std_msgs/msg/String', typestore=messages.ROS_TYPESTORE)
                       for name in ('/joint_states', f'/{ERROR}')]
        for connection in connections:
            writer.write(connection, 0, messages.serialize(messages.String(data='well')))
    code, _, errors = pedestal(tmp_path / 'other')
    assert code == 2
    assert 'joint_states is std_msgs/msg/String; must be sensor_msgs/msg/JointState' in one_line(errors)


@pytest.mark.parametrize('name', sorted(path.name for path in REFERENCES.iterdir() if path.is_dir()))
def test_references_still_hold(name, pedestal):
    """A change that means to change them: make update-references. A servo scenario never tracks."""
    code, said, errors = pedestal(REFERENCES / name, *(['--allow-idle'] if name.startswith('servo_') else []))
    assert code == 0, said + errors
    assert sum(file.stat().st_size for file in (REFERENCES / name).iterdir()) < 1_000_000
