"""Tracking from a moving deck: the rows of the ship's scenarios, and what a run sends to equipment on board."""
import dataclasses
import json
import math
import socket
import threading
import time
import types

import numpy as np
import pynmea2
import pytest

from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.graph import layouts
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_results import isolation, known_attitude, results, tracking
from pedestal_workbench.again import difference, recompute
from pedestal_workbench.again.feed import FedRecording
from ship_motion_sim import motion
from tracking_receiver_sim import target


def track(name, *overrides):
    """(scenario, Run of its closed loop, bool: evaluated): the lockstep run to the last bit (test_lockstep)."""
    chosen = scenario.load(name, overrides)
    run = closed_loop.Loop(chosen).run()
    automatic = run['acu/mode'] == Mode.AUTOTRACK
    return chosen, run, automatic & (run.t >= run.t[automatic][0] + tracking.HANDOVER_SETTLING_S)


def test_a_recorded_motion_sets_its_own_heading(tmp_path):
    """The heading of the file in place of the scenario's 60 deg; a heading given beside the file is refused."""
    file = tmp_path / 'ship.csv'
    file.write_text('time_s,roll_deg,pitch_deg,heading_deg\n' + ''.join(f'{t},0,0,200\n' for t in range(9)))
    recorded = ('ship_motion.ship.motion=recorded', f'ship_motion.ship.recorded.path={file}')
    chosen = scenario.load('ship_pass', recorded, duration=2.0)
    x, y, z, w = closed_loop.Loop(chosen).run()['ship/truth']['orientation'][-1]
    yaw = math.degrees(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    assert (90.0 - yaw) % 360.0 == pytest.approx(200.0)
    with pytest.raises(ScenarioError, match='heading_deg = 30 deg: must be 0 with motion = recorded'):
        scenario.load('ship_pass', (*recorded, 'ship_motion.ship.heading_deg=30'))


def pointing(name, *overrides):
    """Pointing error [deg] rms of a scenario."""
    _, run, on = track(name, *overrides)
    return math.degrees(tracking.known_rms(run.truth['error'][on]))


def isolated(name, *overrides):
    """The isolation.Isolation of a scenario."""
    chosen, run, on = track(name, *overrides)
    constants = motion.constants(chosen.node_parameters('ship_motion').ship)
    truth = np.zeros(on.sum(), motion.Truth.dtype)
    t = run.t[on]
    for k in range(t.size):
        motion.truth(constants[0], t[k], truth[k])
    built = target.build(chosen.node_parameters('tracking_receiver').target, chosen.header.duration)
    azimuth, elevation, distance = target.look_angles(built, t)
    seen = np.column_stack((np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation),
                            np.sin(elevation))) * distance[:, None] - truth['position']
    return isolation.measure(t[1] - t[0], run.truth['error'][on], seen, truth['quaternion'],
                             truth['angular_velocity'])


@pytest.fixture(scope='module')
def ashore():
    return pointing('leo_pass')


@pytest.mark.parametrize('name, overrides, times', [
    ('ship_pass', (), 1.3), ('ship_pass', ('ins.latency=0.02',), 1.5), ('ship_pass_ss6', (), 1.5)])
def test_a_ship_points_nearly_as_well_as_the_shore(ashore, name, overrides, times):
    assert pointing(name, *overrides) <= times * ashore


@pytest.mark.parametrize('cn0_dbhz', [40, 60, 80, 110])
@pytest.mark.parametrize('name', ['ship_pass', 'ship_pass_ss6'])
def test_a_signal_of_any_strength_is_tracked_by_a_filter_that_knows_its_errors(name, cn0_dbhz):
    """Where the receiver's noise has gone the attitude's is left. A filter that knew nothing of it refused every error
    from 80 dB-Hz on. There autotrack begins after 2 to 4 s, because a filter that started while the dish still slewed
    is begun anew only after a second."""
    _, run, on = track(name, f'tracking_receiver.receiver.cn0_dbhz={cn0_dbhz}', 'scenario.duration=30')
    assert on.mean() > 0.80
    nis = np.nanmean(layouts.of_filter(run.steps, 'nis')[on], axis=0)
    assert (nis > 0.8).all() and (nis < 1.2).all()


def test_the_control_unit_believes_what_the_ins_says_of_its_error():
    """An INS three times as noisy as the control unit's parameters have it."""
    nis = {}
    for told in ('true', 'false'):
        _, run, on = track('ship_pass', 'ins.tilt_noise=1e-4', 'ins.heading_noise=1e-4', f'ins.error_told={told}',
                           'tracking_receiver.receiver.cn0_dbhz=60', 'scenario.duration=20')
        nis[told] = np.nanmean(layouts.of_filter(run.steps, 'nis')[on], axis=0)
    assert (nis['true'] > 0.8).all() and (nis['true'] < 1.2).all()
    assert (nis['false'] > 1.5).all()


@pytest.mark.parametrize('name', ['ship_pass', 'ship_pass_ss6'])
def test_the_ship_is_isolated_by_60_db(name):
    found = isolated(name)
    assert found.motion > math.radians(0.5)
    assert found.isolation >= 60.0 and found.limit >= 60.0


def test_without_noise_the_isolation_is_far_above_60_db():
    """A receiver and an INS without noise; a filter made for a satellite is told of 5e-4 rad, or it would follow every
    quirk."""
    found = isolated('ship_pass', 'tracking_receiver.receiver.cn0_dbhz=120', 'acu.tracker.receiver.sigma_floor=5e-4',
                     *(f'acu.{axis}.filter.{key}' for axis in ('azimuth', 'elevation')
                       for key in ('kind=current_statistical', 'current_statistical.a_max=0.002')),
                     *(f'ins.{name}=0' for name in ('tilt_noise', 'heading_noise', 'rate_noise', 'tilt_wander',
                                                    'heading_wander')))
    assert found.isolation > 80.0


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_the_loss_overhead_is_announced_beforehand(seed):
    """Following would take over 100 deg/s where the azimuth has 12; autotrack is kept all the same."""
    chosen = scenario.load('ship_overhead', seed=seed)
    run = closed_loop.Loop(chosen).run()
    automatic = run['acu/mode'] == Mode.AUTOTRACK
    first = np.argmax(automatic)
    plan = run.units['acu'].parts['state']['guidance']['lookahead']['slew']
    assert automatic[first:].all() and plan['needed'] > math.radians(100.0)
    off = np.hypot(*run.truth['error'].T)
    t = run.t
    lost = off > 0.5 * chosen.node_parameters('tracking_receiver').antenna.beamwidth
    loss = np.sum(lost[first:] & (t[first:] > t[first] + tracking.HANDOVER_SETTLING_S)) * 0.005
    assert plan['loss'] == pytest.approx(loss, rel=0.2) and loss > 10.0
    assert math.degrees(tracking.known_rms(off[t > plan['t2'] + 3.0])) < 0.02
    rate = run['acu/rate_command']['velocity'][first:, 0]
    assert abs(rate).max() <= chosen.node_parameters('acu').azimuth.limits.rate + 1e-12


@pytest.mark.thorough
def test_equipment_that_is_not_there_is_told_in_every_diagnosis(start_node, connect):
    """Where nobody listens the system refuses every other datagram only, 10 of them a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as gone:
        gone.bind(('127.0.0.1', 0))
        port = gone.getsockname()[1]
    node = start_node('ship_motion', '-p', f'nmea.port:={port}')
    client = connect(node.domain_id)
    client.write('clock')
    client.read('diagnostics')
    told = client.heard['diagnostics']
    k = 0

    def goes_on():
        nonlocal k
        k += 1
        client.publish('clock', messages.Clock(clock=messages.Time(sec=k // 10, nanosec=k % 10 * 100_000_000)))
        time.sleep(0.05)
        return len(told) >= 4
    client.until(goes_on)
    assert [array.status[0].message for array in told[1:]] == 3 * [f'NMEA to 127.0.0.1:{port}: Connection refused']


def test_announced_losses_are_counted_once():
    def array(*values):
        return messages.DiagnosticArray(header=messages.header(''), status=[messages.DiagnosticStatus(
            level=0, name='acu', message='', hardware_id='', values=[
                messages.KeyValue(key=key, value=value) for key, value in values])])

    def slew(begin, end, loss):
        return array(('keyhole', 'keyhole'), ('keyhole_begins_s', begin), ('keyhole_ends_s', end),
                     ('keyhole_loss_s', loss))
    none, planned = array(('keyhole', 'none')), slew('46.1', '63.4', '12.9')
    first, second = slew('45.8', '63.1', '12.6'), slew('900.1', '905.5', '0.4')
    cancelled = slew('1000.0', '1010.0', '5.0')
    said = [(10, array(('mode', 'program'))), (30, planned), (44, first), (50, first), (100, none), (890, second),
            (910, none), (985, cancelled), (986, none)]
    bag = types.SimpleNamespace(topics={'diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}, start=0,
                                messages=lambda topic: ((topic, t * 10**9, 0, m) for t, m in said))
    assert tracking.keyholes(bag) == [(45.8, 63.1, 12.6), (900.1, 905.5, 0.4)]
    assert results.measured({'keyholes': tracking.keyholes(bag)}) == {
        'keyhole_loss_predicted_s': (pytest.approx(13.0), 's')}
    del said[1:]
    assert results.measured({'keyholes': tracking.keyholes(bag)}) == {}


@dataclasses.dataclass
class Told:
    """A ship_align_and_track made short by asking less of the alignment: its bag, its rows, the datagrams it sent."""
    bag: bags.Bag
    rows: dict
    datagrams: list


SECONDS, DATAGRAMS, SIGMA = 69, 5, 0.019


@pytest.fixture(scope='module')
def told(start_run):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(('127.0.0.1', 0))
        ear.settimeout(1.0)
        heard, ended = [], threading.Event()

        def listen():
            while not ended.is_set():
                try:
                    heard.append(ear.recv(1024))
                except TimeoutError:
                    pass
        listener = threading.Thread(target=listen)
        listener.start()
        parameters = (f'ship_motion.nmea.port={ear.getsockname()[1]}', f'ship_motion.nmea.rate={DATAGRAMS}',
                      f'ins.alignment.aligned_sigma={SIGMA}', 'adu.period=0.01')
        run = start_run('ship_align_and_track', '--pacing', 'lockstep', '--duration', str(SECONDS),
                        *(part for parameter in parameters for part in ('--param', parameter)))
        try:
            result = run.finish(300.0)
        finally:
            ended.set()
            listener.join()
    assert result.returncode == 0, result.stderr
    rows = {row['metric']: row for row in json.loads(run.json.read_text())['rows']}
    return Told(bags.read(run.bag), rows, heard)


@pytest.mark.thorough
def test_the_chain_from_power_up_to_autotrack(told):
    """The control unit waits for the INS, whose heading is 180 deg wrong at first, then acquires and tracks."""
    known = known_attitude.read(told.bag)
    assert abs(math.degrees(known.heading[0])) == pytest.approx(180.0, abs=10.0)
    states, changes = told.bag.table('ins/state'), told.bag.table('acu/mode')
    assert states['data'] == ['aligning', 'aligned'] and changes['data'] == ['standby', 'program', 'autotrack']
    aligned = states['t'][1]
    assert aligned <= changes['t'][1] <= aligned + 0.02
    reasons = [(log / 1e9, value.value) for _, log, _, array in told.bag.messages('diagnostics')
               for status in array.status if status.name == 'acu' for value in status.values if value.key == 'reason']
    assert {reason for t, reason in reasons if 1.0 <= t < aligned} == {'INS aligning'}
    assert told.rows['aligned_s']['value'] == aligned
    progress = [(log / 1e9, status.level, status.message, {value.key for value in status.values})
                for _, log, _, array in told.bag.messages('diagnostics')
                for status in array.status if status.name == 'ins']
    assert progress[0][2] == 'aligning: heading unknown, navigation begins at 1.1 deg'
    for t, level, message, keys in progress[1:]:
        assert (level == 1 and message.startswith('aligning: heading known to ')) == (t < aligned)
        assert ('velocity_east' in keys) == (t >= aligned)
    heading = told.rows['heading_at_alignment_deg']['value']
    assert told.rows['heading_sigma_at_alignment_deg']['value'] <= math.degrees(SIGMA)
    assert abs(heading) < 3.0 * told.rows['heading_sigma_at_alignment_deg']['value']
    error = told.bag.table('ins/error')
    assert not error['heading.position'].any()
    assert np.unique([error[f'{angle}.velocity'] for angle in ('roll', 'pitch', 'heading')]) == [1.45e-6]
    assert told.rows['pointing_rms_deg']['value'] < 0.01 and told.rows['loss_s']['value'] == 0.0


@pytest.mark.thorough
def test_the_rows_of_a_run_say_its_isolation(told):
    found = isolation.read(told.bag, tracking.read(told.bag), tracking.keyholes(told.bag))
    assert told.rows['isolation_db']['value'] == found.isolation and told.rows['isolation_db']['target'] == '>= 60'
    assert told.rows['isolation_limit_db']['value'] == found.limit


@pytest.mark.thorough
def test_the_chain_is_recomputed_from_its_recording(told):
    """The INS that aligns and the control unit that waits for it answer the recorded messages with the same bits."""
    recording = FedRecording(told.bag.path)
    for node in ('ins', 'acu'):
        done = recompute.recompute(recording, node, recompute.parameters_of(recording, node))
        assert not done.requests and not done.feed.problem
        for topic in recompute.compare(recording, done.outputs, done.unit, difference.Tolerance()):
            assert topic.identical, topic.lines()


@pytest.mark.thorough
def test_datagrams_are_the_recorded_attitude_at_their_stamps(told):
    truth = told.bag.table('ship/truth')
    assert 0.9 * SECONDS * DATAGRAMS < len(told.datagrams) <= SECONDS * DATAGRAMS + 1      # UDP may lose some
    stamps = set()
    for datagram in told.datagrams:
        heading, attitude = (pynmea2.parse(line, check=True) for line in datagram.decode('ascii').splitlines())
        assert (heading.talker, heading.sentence_type, heading.hdg_true) == ('HE', 'HDT', 'T')
        clock = attitude.timestamp
        t = clock.hour * 3600 + clock.minute * 60 + clock.second + 1e-6 * clock.microsecond
        stamps.add(t)
        k = int(np.argmin(np.abs(truth['t'] - t)))
        assert truth['t'][k] == pytest.approx(t, abs=1e-6)
        x, y, z, w = (truth[f'orientation.{letter}'][k] for letter in 'xyzw')
        bow_north, bow_east = 2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)
        assert (float(heading.heading) - math.degrees(math.atan2(bow_east, bow_north)) + 180.0) % 360.0 - 180.0 == (
            pytest.approx(0.0, abs=1e-3))
        # The bow's height is pitch, port's is roll times cos(pitch); signs of instruments: bow up, port up.
        pitch = math.asin(2.0 * (x * z - w * y))
        roll = math.asin(2.0 * (y * z + w * x) / math.cos(pitch))
        assert attitude.true_heading == float(heading.heading)
        assert attitude.roll == pytest.approx(math.degrees(roll), abs=1e-3)
        assert attitude.pitch == pytest.approx(math.degrees(pitch), abs=1e-3)
        assert attitude.heave == pytest.approx(truth['position.z'][k], abs=1e-3)
    assert len(stamps) == len(told.datagrams)
