"""Electronic beams as real nodes in lockstep: four beams of one array on four targets, one beam on a swaying ship at
10 ms, and by the law of type 1 at 1 ms, against the closed loop, and the array's node alone."""
import itertools
import json
import math
import signal
import time

import numpy as np
import pytest
from shared import PEDESTAL

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording import export
from pedestal_recording.bag import load
from pedestal_recording.verify import verify
from pedestal_results import tracking
from pedestal_results.report.page import write as write_report
from pedestal_workbench.again import difference, recompute

pytestmark = pytest.mark.thorough

FOUR, SWAY = 'phased_array_four', 'phased_array_sway'
BEAMS = [f'beam_{i}' for i in range(1, 5)]
FAST = ('--param', 'acu.tracker.lock_count=20')
LENGTH = {'four': 3.0, 'sway': 2.0, 'type 1, 1 ms': 1.0}
TYPE_1 = ['adu.period=0.001', *(f'acu.{axis}.beam.{key}' for axis in ('azimuth', 'elevation')
                                for key in ('form=type_1', 'rate_compensation=0.85'))]


@pytest.fixture(scope='module')
def runs(start_run):
    """Finished runs by name."""
    started = {'four': start_run(FOUR, '--duration', '3', *FAST, '--param',
                                 'beam_2/tracking_receiver.antenna.beamwidth=0.04')}
    done = started['four'].finish()
    assert done.returncode == 0, done.stderr
    started['sway'] = start_run(SWAY, '--duration', '2', *FAST)
    started['type 1, 1 ms'] = start_run(SWAY, '--duration', '1', *FAST, *(f'--param={value}' for value in TYPE_1))
    for name in ('sway', 'type 1, 1 ms'):
        done = started[name].finish()
        assert done.returncode == 0, done.stderr
    return started


@pytest.fixture(scope='module')
def views(runs):
    return {beam: bags.read(runs['four'].bag, beam) for beam in BEAMS}


def test_each_beam_tracks_its_own_target(views):
    tracked = {beam: tracking.read(view) for beam, view in views.items()}
    for run in tracked.values():
        assert run.mode[-1] == 'autotrack' and run.tracking.any()
        error = run.error[run.tracking]
        assert np.abs(error).max() < math.radians(0.06)  # a fiftieth of the beamwidth
    for one, other in itertools.combinations(tracked.values(), 2):
        assert math.hypot(*(one.encoders[-1] - other.encoders[-1])) > 0.1
        both = np.isfinite(one.measured[:, 1] + other.measured[:, 1])
        noise = [(run.measured[:, 1] - run.error[:, 1])[both] for run in (one, other)]
        assert abs(np.corrcoef(*noise)[0, 1]) < 0.3  # the noise of each is its own


def test_one_bag_holds_all_beams_and_is_complete(runs):
    check = verify(load(runs['four'].bag))
    assert check.complete, check.lines()
    assert check.steps == 301
    counts = {topic.name: topic.count for topic in check.topics}
    assert {counts[f'{beam}/{name}'] for beam in BEAMS for name in ('joint_states', 'adu/truth', 'acu/reference')} == {
        301}
    assert counts['clock'] == 301 and 'adu/motor_states' not in counts and 'joint_states' not in counts
    speakers = {array.status[0].name for *_, array in bags.read(runs['four'].bag).messages('diagnostics')}
    assert speakers == {'adu', *(f'{beam}/{node}' for beam in BEAMS for node in ('acu', 'tracking_receiver'))}


def test_the_results_are_told_by_beam(runs):
    rows = json.loads(runs['four'].json.read_text())['rows']
    assert {row['case'] for row in rows} == {FOUR, *(f'{FOUR}/{beam}' for beam in BEAMS)}
    assert {row['metric'] for row in rows if row['case'] == FOUR} == {'lost_steps', 'realtime_factor', 'messages'}


def test_the_same_run_gives_the_same_file(runs, run_process, tmp_path):
    done = run_process([*PEDESTAL, 'rerun', runs['four'].bag, '--bag', tmp_path / 'again'], 90.0)
    assert (done.returncode, done.stderr) == (0, '')
    assert ': equal to the last byte, ' in done.stdout


@pytest.mark.parametrize('name, beam', [('four', 'beam_1'), ('four', 'beam_4'), ('sway', ''),
                                        ('type 1, 1 ms', '')])
def test_every_node_of_a_beam_recomputes_identically(runs, name, beam):
    recording = recompute.FedRecording(runs[name].bag, beam=beam)
    nodes = recompute.chosen(recording, (), None)
    assert set(nodes) >= {'tracking_receiver', 'acu', 'adu'}
    for node in nodes:
        done = recompute.recompute(recording, node, recompute.parameters_of(recording, node))
        compared = recompute.compare(recording, done.outputs, done.unit, difference.Tolerance())
        assert compared and all(topic.identical for topic in compared), [topic.lines() for topic in compared]
        assert recompute.idle(recording, done) == ''


def test_report_and_export_of_one_beam(runs, tmp_path):
    page = write_report(runs['four'].bag, tmp_path / 'report.html', beam='beam_2').read_text()
    assert f'Tracking run: {FOUR}/beam_2' in page and 'No comparison' not in page
    name = 'beam_3/tracking_receiver/angle_error'
    [(file, rows, _)] = export.export(runs['four'].bag, output=tmp_path, names=[name])
    assert rows == 301 and file.read_text().splitlines()[0] == 't [s],stamp [ns],x [rad],y [rad],z [dB-Hz]'
    with pytest.raises(bags.BagError, match="beam 'beam_5': must be one of beam_1, beam_2, beam_3, beam_4"):
        bags.read(runs['four'].bag, 'beam_5')


def test_a_beam_has_the_beamwidth_of_its_own_antenna(views):
    assert [view.metadata['beamwidth'] for view in views.values()] == ['0.052', '0.04', '0.052', '0.052']


def test_a_node_of_another_beam_is_not_recomputed(runs):
    recording = recompute.FedRecording(runs['four'].bag, beam='beam_2')
    assert recompute.chosen(recording, ['beam_2/acu'], None) == ['acu']
    with pytest.raises(ValueError, match='--node beam_3/acu: .* use --beam beam_3 --node acu'):
        recompute.chosen(recording, ['beam_3/acu'], None)


def test_ctrl_c_ends_an_array_in_order(start_run):
    run = start_run(FOUR, *FAST, '--duration', '200')
    deadline = time.monotonic() + 60.0
    while not run.recorded():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    done = run.interrupt()
    assert (done.returncode, done.stderr) == (130, f'pedestal: stopped; the recorded part is in {run.bag}\n')
    assert run.pids() == {}
    recorded = bags.read(run.bag)
    assert all(len(recorded.rows(f'{beam}/joint_states')) > 50 for beam in BEAMS) and not recorded.damage


def test_an_acu_of_an_array_steers_beams(start_node, one_line):
    done = start_node('acu', '-p', 'graph.beams:=1').finish()
    assert done.returncode == 1
    assert one_line(done.stderr).endswith("azimuth.controller = 'feedforward': must be beam: the drive is an array")


@pytest.mark.parametrize('name, scenario_name, beam, more', [
    ('four', FOUR, 'beam_3', []), ('sway', SWAY, '', []), ('type 1, 1 ms', SWAY, '', TYPE_1)])
def test_the_closed_loop_equals_the_nodes(runs, name, scenario_name, beam, more, differences):
    chosen = scenario.load(scenario_name, [FAST[1], *more], duration=LENGTH[name])
    recorded = bags.read(runs[name].bag, beam)
    assert set(recorded.table('acu/mode')['data']) == {'program', 'autotrack'}
    assert differences(closed_loop.Loop(chosen, beam).run(), recorded) == {}


@pytest.fixture(scope='module')
def array(start_node, connect):
    """The array's node alone, obeying this test as its ACU."""
    node = start_node('beam_steering', '-p', 'period:=0.01', '-p', 'transport_delay:=0.02', '-p', 'graph.beams:=1',
                      '-p', 'command_timeout:=100')
    client = connect(node.domain_id, 'acu')
    client.read('joint_states')
    client.read('diagnostics')
    client.read('adu/state')
    client.write('acu/reference')
    return node, client


def test_the_array_obeys_stays_and_tells_why(array):
    node, client = array
    command = messages.template('acu/reference')
    [point] = command.points

    def hear(seconds):
        until = time.monotonic() + seconds
        client.until(lambda: time.monotonic() > until and client.heard['joint_states'])

    def newest():
        return client.heard['joint_states'][-1]

    def steer(azimuth):
        """Command this azimuth with the stamp of the newest joint states."""
        hear(0.1)
        command.header.stamp = newest().header.stamp
        point.positions[:] = azimuth, 0.5
        client.publish('acu/reference', command)

    def follows(azimuth):
        steer(azimuth)
        client.until(lambda: newest().position[0] == azimuth)

    def stays(azimuth):
        before = newest().position[0]
        steer(azimuth)
        hear(0.3)
        assert newest().position[0] == before

    follows(0.25)
    steer(math.nan)
    assert client.diagnosed('acu/reference holds NaN').message.endswith(': the beam stays')
    assert newest().position[0] == 0.25
    assert client.trigger('adu/disable') == (True, 'drive is disabled')
    stays(0.5)
    assert client.trigger('adu/enable') == (True, 'drive is enabled')
    follows(0.5)
    assert client.trigger('adu/emergency_stop') == (True, 'drive is emergency stop')
    assert client.trigger('adu/enable') == (
        False, 'refused: an emergency stop is latched (adu/reset_faults); drive is emergency stop')
    stays(0.75)
    assert client.trigger('adu/reset_faults') == (True, 'drive is enabled')
    client.diagnosed('no new acu/reference for 1 s: the beam stays')
    assert [message.data for message in client.heard['adu/state']] == [
        'enabled', 'disabled', 'enabled', 'emergency stop', 'enabled']
    node.process.send_signal(signal.SIGTERM)
    done = node.finish()
    assert (done.returncode, done.stderr) == (0, '')
