"""What a user can get wrong: parameters, files, disks, domains, stamps. One clear line each; never a traceback."""
import math
import signal
import sys
import time

import pytest

from pedestal import cli
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

TRACK_PATH = 'tracking_receiver.target.track_file.path'
TRACK = 'time_s,latitude_deg,longitude_deg,altitude_m\n'
ROWS = [f'{t},{47.4 + 1e-3 * t:.6f},8.52,1500' for t in range(20)]


def refused(capsys, one_line, *arguments, code=2):
    """The line with which `pedestal` refuses these arguments."""
    assert cli.main([str(argument) for argument in arguments]) == code
    return one_line(capsys.readouterr().err)


COMMAND_LINES = {
    'unknown scenario': (['leo_pas'], ["unknown scenario 'leo_pas'; did you mean 'leo_pass'?", 'uav_flyby']),
    'misspelt key': (['leo_pass', '--param', 'acu.azimuth.feedforward.bandwith=20'],
                     ["unknown parameter 'azimuth.feedforward.bandwith'",
                      "did you mean 'azimuth.feedforward.bandwidth'?"]),
    'misspelt node': (['leo_pass', '--param', 'acuu.period=0.005'], ["'acuu' is no node"]),
    'no value': (['leo_pass', '--param', 'acu.period'], ['must be node.key=value']),
    'broken value': (['leo_pass', '--param', 'acu.period=[1'], ['acu.period=[1']),
    'range': (['leo_pass', '--param', 'adu.period=0.5'], ['adu: period = 0.5 s: must be 0.001 to 0.02']),
    'NaN': (['leo_pass', '--param', 'tracking_receiver.receiver.cn0_dbhz=.nan'],
            ['receiver.cn0_dbhz = nan dB-Hz: must be 0 to 120']),
    'type': (['leo_pass', '--param', 'acu.azimuth.stow=fast'], ["azimuth.stow = 'fast': must be a number"]),
    'group': (['leo_pass', '--param', 'acu.azimuth=1'], ["unknown parameter 'azimuth'"]),
    'list for a number': (['leo_pass', '--param', 'acu.azimuth.stow=[1.0]'], ['azimuth.stow = ']),
    'mapping for a text': (['leo_pass', '--param', 'recorder.scenario={a: 1}'], ['scenario = ']),
    'duration': (['leo_pass', '--duration', 'nan'], ['duration = nan s: must be 0.1 to 86400']),
    'seed': (['leo_pass', '--seed', '-1'], ['seed = -1']),
    'no TLE': (['leo_pass', '--tle', '/nowhere/iss.tle'], ['TLE file /nowhere/iss.tle: No such file']),
    'old TLE': (['leo_pass', '--pass', 'next'], ['--pass next: the TLE of satellite 25544 is of 2019-12-09']),
    'no such pass': (['leo_pass', '--pass', '99'], ['--pass 99: there are 27 passes above 10 deg']),
    'station': (['leo_pass', '--station', '47.4,8.5'], ["--station '47.4,8.5': must be LATITUDE,LONGITUDE,HEIGHT"]),
    'latitude': (['leo_pass', '--station', '95,8.5,0'], ['target.station.latitude_deg = 95 deg: must be -90 to 90']),
    'pass of a UAV': (['uav_flyby', '--pass', '1'], ['the target of uav_flyby is a flyby, must be a satellite']),
    'pass of an array': (['phased_array_four', '--pass', '1'], ['phased_array_four has 4 beams']),
    'a file that is no scenario': ([__file__], ['is no scenario, whose file ends in .yaml; a track: pedestal run ']),
    'no file': (['/nowhere/run.yaml'], ['/nowhere/run.yaml: No such file']),
}


@pytest.mark.parametrize('case', COMMAND_LINES)
def test_command_line(case, capsys, one_line, tmp_path):
    arguments, texts = COMMAND_LINES[case]
    line = refused(capsys, one_line, 'run', *arguments, '--bag', tmp_path / 'bag')
    assert line.startswith('pedestal: error: ')
    for text in texts:
        assert text in line
    assert list(tmp_path.iterdir()) == []


SCENARIO_FILES = {
    'misspelt key': ('scenario: {ros__parameters: {}}\nacu:\n  ros__parameters:\n    azimuth:\n      stwo: 1.0\n',
                     "did you mean 'azimuth.stow'?"),
    'misspelt header': ('acu: {ros__parameters: {}}\n', 'the section `scenario` is missing'),
    'section': ('scenario: {ros__parameters: {}}\nantenna: {ros__parameters: {}}\n', "section 'antenna' is no node"),
    'no ros__parameters': ('scenario: {duration: 2.0}\n', "section 'scenario' must hold ros__parameters"),
    'ros__parameters no mapping': ('scenario: {ros__parameters: 3}\n', "section 'scenario' must hold ros__parameters"),
    'no YAML': ('scenario: {ros__parameters: [}\n', 'no valid YAML'),
    'empty': ('', 'must hold a section for a node'),
    'number as key': ('scenario: {ros__parameters: {1: 2}}\n', "unknown parameter '1'"),
    'no text': (b'\xff\xfe\x00scenario', 'no valid'),
    'namespace': ('scenario: {ros__parameters: {}}\n/ship_1/acu: {ros__parameters: {}}\n', 'write /**/acu or acu'),
}


@pytest.mark.parametrize('case', SCENARIO_FILES)
def test_scenario_file(case, capsys, one_line, tmp_path):
    content, text = SCENARIO_FILES[case]
    file = tmp_path / 'mine.yaml'
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    line = refused(capsys, one_line, 'run', file, '--bag', tmp_path / 'bag')
    assert 'mine' in line and text in line


PARAMETER_FILES = {
    'quoted number': ('/**/acu: {ros__parameters: {azimuth.stow: "1"}}', "acu: azimuth.stow = '1': must be a number"),
    'octal number': ('/**/acu: {ros__parameters: {azimuth.stow: 010}}', "acu: azimuth.stow = '010': must be a number"),
    'range': ('/**/adu: {ros__parameters: {period: 1}}', 'adu: period = 1 s: must be 0.001 to 0.02'),
    'misspelt key': ('acu: {ros__parameters: {azimuth: {stwo: 1}}}', "acu: unknown parameter 'azimuth.stwo'; did you "
                     "mean 'azimuth.stow'?"),
    'alias': ('acu: {ros__parameters: {azimuth: &a {stow: 1}, elevation: *a}}', 'the alias *a is refused'),
    'tab': ('acu:\n\tros__parameters: {}', 'a tab; indent with blanks at line 2, column 1'),
    'flag': ('/**: {ros__parameters: {use_sim_time: "true"}}', "section '/**': use_sim_time = 'true': must be true or "
             'false'),
    'namespace': ('/ship_1/acu: {ros__parameters: {azimuth.stow: 1}}', "section '/ship_1/acu' is for no node of a "
                  'graph without a namespace; write /**/acu or acu'),
    'every node': ('/**: {ros__parameters: {azimuth.stow: 1}}', "section '/**' is for every node: azimuth.stow: write "
                   'it in the section /**/acu'),
    'node': ('/**/antenna: {ros__parameters: {azimuth.stow: 1}}', "section '/**/antenna' is no node; there are "
             'ship_motion, ins, tracking_receiver, acu, adu, recorder'),
    'missing': (None, 'No such file or directory'),
}


@pytest.mark.parametrize('case', PARAMETER_FILES)
def test_parameter_file(case, capsys, one_line, tmp_path):
    content, text = PARAMETER_FILES[case]
    file = tmp_path / 'mine.yaml'
    if content is not None:
        file.write_text(content)
    line = refused(capsys, one_line, 'run', 'leo_pass', '--params-file', file, '--bag', tmp_path / 'bag')
    assert line.startswith(f'pedestal: error: --params-file {file}') and text in line


TRACKS = {
    'gap': ([*ROWS[:5], *ROWS[16:]], ['line 7', 'max_gap = 10 s']),
    'unordered': ([*ROWS[:5], ROWS[7], ROWS[6], *ROWS[8:]], ['line 8', 'must be above 0']),
    'text': ([*ROWS[:5], '5,north,8.52,1500', *ROWS[6:]], ['line 7', 'north']),
    'NaN': ([*ROWS[:5], '5,nan,8.52,1500', *ROWS[6:]], ['line 7', 'nan']),
    'short row': ([*ROWS[:5], '5,47.4', *ROWS[6:]], ['line 7']),
    'no rows': ([], ['0 fixes']),
}


@pytest.mark.parametrize('case', TRACKS)
def test_track_file(case, capsys, one_line, tmp_path):
    rows, texts = TRACKS[case]
    file = tmp_path / 'flight.csv'
    file.write_text(TRACK + '\n'.join(rows) + '\n')
    line = refused(capsys, one_line, 'run', 'track_file', '--param', f'{TRACK_PATH}={file}', '--duration', '5',
                   '--bag', tmp_path / 'bag')
    assert str(file) in line
    for text in texts:
        assert text in line, line


def test_track_file_that_is_not_there(capsys, one_line, tmp_path):
    line = refused(capsys, one_line, 'run', 'track_file', '--param', f'{TRACK_PATH}={tmp_path}/no.csv', '--bag',
                   tmp_path / 'bag')
    assert f'{tmp_path}/no.csv' in line
    assert 'path' in refused(capsys, one_line, 'run', 'track_file', '--bag', tmp_path / 'bag2')


def test_recorded_ship_is_read_before_the_run(capsys, one_line, tmp_path):
    (tmp_path / 'ship.csv').write_text('time,roll\n0,1\n')
    changes = ('motion=recorded', 'sea_state=0', 'speed=0', f'recorded.path={tmp_path}/ship.csv')
    line = refused(capsys, one_line, 'run', 'ship_pass', '--bag', tmp_path / 'bag',
                   *(part for change in changes for part in ('--param', f'ship_motion.ship.{change}')))
    assert f"{tmp_path}/ship.csv: line 1: column 'time': must end with a known unit" in line
    assert not (tmp_path / 'bag.log').exists()


def test_tle_with_a_bad_checksum(capsys, one_line, tmp_path):
    line_1 = '1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9992'
    line = refused(capsys, one_line, 'run', 'leo_pass', '--bag', tmp_path / 'bag', '--param',
                   f'tracking_receiver.target.leo_pass.line_1={line_1}')
    assert 'TLE line 1: checksum' in line


@pytest.mark.parametrize('place', ['exists', 'under a file', 'under /proc'])
def test_place_of_the_bag(place, capsys, one_line, tmp_path, domain_id, monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain_id))
    (tmp_path / 'file').write_text('')
    (tmp_path / 'there').mkdir()
    bag = {'exists': tmp_path / 'there', 'under a file': tmp_path / 'file' / 'bag',
           'under /proc': '/proc/1/bag'}[place]
    line = refused(capsys, one_line, 'run', 'leo_pass', '--bag', bag, code=2 if place == 'exists' else 1)
    assert str(bag) in line


@pytest.mark.parametrize('place', ['missing/result.json', 'there'])
def test_place_of_the_rows_is_judged_before_the_run(place, capsys, one_line, tmp_path):
    (tmp_path / 'there').mkdir()
    line = refused(capsys, one_line, 'run', 'leo_pass', '--bag', tmp_path / 'bag', '--json', tmp_path / place)
    assert str(tmp_path / place) in line
    assert not (tmp_path / 'bag.log').exists()


@pytest.mark.parametrize('verb', ['verify', 'report'])
@pytest.mark.parametrize('what', ['nothing', 'empty folder', 'text'])
def test_a_bag_that_is_none(verb, what, capsys, one_line, tmp_path):
    bag = tmp_path / 'bag'
    if what == 'empty folder':
        bag.mkdir()
    elif what == 'text':
        bag = tmp_path / 'bag.mcap'
        bag.write_text('hello')
    assert cli.main([verb, str(bag)]) == 1
    assert str(bag) in one_line(capsys.readouterr().err)


@pytest.fixture(scope='module')
def graphs(start_run):
    """(run, result) of runs side by side: one on a disk that is full in its middle, another at its end, where no file
    grows beyond so many bytes; the first, which lasts in few steps and may still run, and the second on one domain."""
    def limit(size):
        return (sys.executable, '-c', 'import os, resource, sys; '
                f'resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size})); os.execv(sys.argv[1], sys.argv[1:])')

    first = start_run('leo_pass', '--pacing', 'realtime', '--duration', '30', '--param', 'adu.period=0.02', '--param',
                      'acu.period=0.02')
    full = start_run('leo_pass', '--pacing', 'lockstep', '--duration', '30', prefix=limit(650_000))
    at_its_end = start_run('leo_pass', '--pacing', 'lockstep', '--duration', '0.5', prefix=limit(70_000))
    deadline = time.monotonic() + 180.0
    while not first.recorded(10):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    second = start_run('uav_flyby', '--duration', '1', domain_id=first.domain_id)
    return {'first': (first, None), **{name: (run, run.finish()) for name, run in (
        ('second', second), ('full', full), ('full at its end', at_its_end))}}


@pytest.mark.thorough
@pytest.mark.parametrize('when, steps', [('full', 50), ('full at its end', 0)])
def test_full_disk(when, steps, graphs):
    """The run ends, names the file, and the rest is readable."""
    run, result = graphs[when]
    assert result.returncode == 1
    assert 'Traceback' not in result.stderr
    assert result.stderr.startswith('pedestal: error: recorder ended before the run did')
    assert 'File too large' in result.stderr and str(run.bag) in result.stderr
    assert len(bags.read(run.bag).table('joint_states')['t']) >= steps


@pytest.mark.thorough
def test_a_second_graph_on_the_domain_is_refused(graphs, one_line):
    run, result = graphs['second']
    assert result.returncode == 1
    assert f'another graph runs on ROS_DOMAIN_ID {run.domain_id}; set a free one' in one_line(result.stderr)
    assert not run.bag.exists()


def joints(stamp_ms, position=(0.1, 0.5)):
    message = messages.template('joint_states')
    messages.put_stamp(message.header.stamp, stamp_ms * 1_000_000)
    message.position[:] = position
    return message


STAMPS = {
    'acu back': ('acu', 'joint_states', [5, 0], 'joint_states stamp went back from 0.005000 to 0.000000 s'),
    'receiver back': ('tracking_receiver', 'adu/truth', [10, 5], 'adu/truth stamp went back from 0.010000 to '),
    'receiver jump': ('tracking_receiver', 'adu/truth', [0, 5, 25],
                      'adu/truth stamp jumped from 0.005000 to 0.025000 s; the period is 0.005000 s'),
    'drive': ('adu', 'acu/rate_command', [10], 'acu/rate_command is stamped 0.010000 s where 0.000000 s is due'),
}


@pytest.fixture(scope='module')
def misled(start_node, connect):
    """Results of lockstep nodes that got stamps in a wrong order."""
    started = {case: start_node(node, '-p', 'graph.pacing:=lockstep', '-p', 'graph.deadline:=5.0', *(
        ('-p', 'graph.nodes:=acu,adu') if node == 'adu' else ())) for case, (node, *_) in STAMPS.items()}
    results = {}
    for case, (_, topic, stamps, _) in STAMPS.items():
        client = connect(started[case].domain_id, 'acu')
        client.write(topic)
        if topic == 'acu/rate_command':
            client.read('joint_states')
            client.read('adu/state')
            client.until(lambda client=client: client.heard['joint_states'])
        for stamp in stamps:
            client.publish(topic, joints(stamp))
        results[case] = started[case].finish(30.0)
        client.close()
    return results


@pytest.mark.thorough
@pytest.mark.parametrize('case', STAMPS)
def test_lockstep_ends_on_a_wrong_stamp(misled, case, one_line):
    assert misled[case].returncode == 1
    assert STAMPS[case][3] in one_line(misled[case].stderr)


@pytest.mark.thorough
def test_receiver_names_bad_input_in_realtime(start_node, connect):
    node = start_node('tracking_receiver')
    client = connect(node.domain_id)
    client.write('adu/truth')
    client.read('tracking_receiver/angle_error')
    client.read('diagnostics')
    errors = client.heard['tracking_receiver/angle_error']

    def seen(stamp, position):
        client.publish('adu/truth', joints(stamp, position))
        client.until(lambda: errors and messages.nanoseconds(errors[-1].header.stamp) == stamp * 1_000_000)
        return errors[-1].vector

    # What it is sent before it knows who writes is dropped.
    stamps = iter(range(1, 1000))
    while not errors:
        client.publish('adu/truth', joints(next(stamps)))
        soon = time.monotonic() + 0.2
        client.until(lambda soon=soon: errors or time.monotonic() > soon)
    seen(1005, (0.1, 0.5))
    for stamp, bad in ((1010, math.nan), (1015, math.inf)):
        assert math.isnan(seen(stamp, (bad, 0.5)).x)
    seen(1020, (0.1, 0.5))
    client.until(lambda: any('direction of the beam not valid' in text for text in client.said(0)))
    client.publish('adu/truth', joints(1001))
    client.diagnosed('adu/truth: 1 dropped: stale: 0.019 s older than the last')
    node.process.send_signal(signal.SIGINT)
    result = node.finish(15.0)
    assert (result.returncode, result.stderr) == (0, '')


@pytest.mark.thorough
def test_the_first_graph_goes_on_to_its_end(graphs):
    """The last test of this file, because the others run while the graph does."""
    run, _ = graphs['first']
    result = run.finish()
    # 3: the machine was too busy for all steps.
    assert result.returncode in (0, 3), result.stderr
    assert verify(load(run.bag)).complete
    modes = list(bags.read(run.bag).table('acu/mode')['data'])
    assert modes[-1] == 'standby' and {'program', 'autotrack'} & set(modes)     # the drive stands before it ends
