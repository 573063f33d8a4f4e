"""A recording in several files: its recorder was killed and started again. And runs that did not come to their end."""
import importlib.util
import itertools
import os
import pathlib
import struct

import pytest

from pedestal import cli
from pedestal_common.text_files import plain_yaml
from pedestal_common.wire import messages
from pedestal_recording import bag
from pedestal_recording.bag import load
from pedestal_recording.recover import recover
from pedestal_recording.verify import verify
from pedestal_recording.writer import Writer

_spec = importlib.util.spec_from_file_location('killed_writer', pathlib.Path(__file__).with_name('killed_writer.py'))
killed_writer = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(killed_writer)
NAMES, RECORDED = killed_writer._bag_test.NAMES, killed_writer._bag_test.RECORDED
SECOND = 1_000_000_000
METADATA = {'scenario': 'test', 'pacing': 'realtime', 'seed': 7, 'planned_end_ns': 4 * SECOND}


@pytest.fixture(scope='module')
def rows():
    return [row for row in itertools.islice(killed_writer.rows(), 12_000) if row[1] <= 4 * SECOND]


def record(path, rows, start, stop, killed=False, metadata=METADATA):
    """Record [start, stop) s of a run in a process of its own, which is killed after its last chunk or ends well."""
    child = os.fork()
    if not child:
        code = 1
        try:
            writer = Writer(path, RECORDED, metadata)
            for index, stamp, data in rows:
                if start * SECOND <= stamp < stop * SECOND:
                    writer.write(index, stamp, stamp, data)
            writer.flush()
            if not killed:
                writer.close()
            code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0


def information(path):
    return plain_yaml.read(path / 'metadata.yaml')['rosbag2_bagfile_information']


@pytest.fixture
def restarted(rows, tmp_path):
    path = tmp_path / 'run'
    record(path, rows, 0, 1, killed=True)
    assert not (path / 'metadata.yaml').exists()
    record(path, rows, 1, 2)
    record(path, rows, 2.5, 3, killed=True)
    record(path, rows, 3, 9)
    return path


def test_the_files_are_read_in_their_order(restarted, rows):
    expected = [(NAMES[index], stamp, stamp, data) for index, stamp, data in rows
                if not 2 * SECOND <= stamp < 2.5 * SECOND]
    content = bag.read(restarted)
    assert [file.name for file in content.files] == [f'run_{k}.mcap' for k in range(4)]
    assert list(content.raw()) == expected
    assert list(content.raw('clock')) == [row for row in expected if row[0] == 'clock']
    report = verify(load(restarted))
    assert not any('sequence' in problem for check in report.topics for problem in check.problems)
    *killed, away = report.problems
    assert [line.partition(':')[0] for line in killed] == ['run_0.mcap', 'run_2.mcap']
    assert away == 'nothing recorded from 1.995000 to 2.500000 s, between two files' and not report.aborted


def test_metadata_lists_the_files_in_their_order(restarted):
    told = information(restarted)
    assert told['relative_file_paths'] == [f'run_{k}.mcap' for k in range(4)]
    assert [file['path'] for file in told['files']] == told['relative_file_paths']
    assert sum(file['message_count'] for file in told['files']) == told['message_count'] == len(
        bag.read(restarted).index)
    assert told['custom_data']['finished'] == 'true'
    assert told['duration']['nanoseconds'] == 4 * SECOND


def test_recover_makes_one_file_of_them(restarted):
    found = recover(restarted)
    whole = bag.read(found.path)
    assert list(whole.raw()) == list(bag.read(restarted).raw()) and len(whole.files) == 1
    assert not any('sequence' in problem for check in verify(load(found.path)).topics for problem in check.problems)
    assert found.lines()[0] == 'nothing is missing'


def test_a_broken_file_in_the_middle_is_said_and_recovered(restarted):
    data = bytearray((restarted / 'run_1.mcap').read_bytes())
    data[len(data) // 2] ^= 0xff
    (restarted / 'run_1.mcap').write_bytes(data)
    with pytest.raises(bag.BagError, match='run_1.mcap: broken record.*`pedestal recover`'):
        bag.read(restarted)
    assert verify(load(restarted)).problems[-1].startswith('metadata.yaml counts')
    found = recover(restarted)
    assert found.gaps[0].line().startswith('bytes ') and ' of run_1.mcap unused (a corrupted chunk)' in \
        found.gaps[0].line()


@pytest.mark.parametrize('change, problem', [
    ({}, 'exists already; a recording is never overwritten'), ({'seed': 8}, 'of another run'),
    ({'planned_end_ns': 5 * SECOND}, 'of another run'), ({'pacing': 'lockstep'}, 'exists already')])
def test_a_bag_that_is_finished_or_of_another_run_is_left_alone(restarted, change, problem):
    before = {file: file.read_bytes() for file in restarted.iterdir()}
    with pytest.raises(bag.BagError, match=problem):
        Writer(restarted, RECORDED, {**METADATA, **change})
    assert {file: file.read_bytes() for file in restarted.iterdir()} == before


def test_a_bag_that_is_being_written_is_left_alone(rows, tmp_path):
    writer = Writer(tmp_path / 'run', RECORDED, METADATA)
    with pytest.raises(bag.BagError, match='run_0.mcap: is being written'):
        Writer(tmp_path / 'run', RECORDED, METADATA)
    writer.close()


def test_an_empty_file_of_a_recorder_that_died_at_once_is_replaced(rows, tmp_path):
    (tmp_path / 'run').mkdir()
    (tmp_path / 'run' / 'run_0.mcap').write_bytes(b'')
    record(tmp_path / 'run', rows, 0, 9)
    assert [file.name for file in bag.read(tmp_path / 'run').files] == ['run_0.mcap']


@pytest.mark.parametrize('pacing', ['realtime', 'lockstep'])
def test_an_aborted_run_is_no_finished_one(rows, tmp_path, capsys, pacing):
    record(tmp_path / 'run', rows, 0, 2, metadata={**METADATA, 'pacing': pacing})
    report = verify(load(tmp_path / 'run'))
    assert report.complete and report.aborted and not report.finished
    assert cli.main(['verify', str(tmp_path / 'run')]) == 1
    *_, ending, last = capsys.readouterr().out.splitlines()
    assert ending == 'aborted: ends at 1.995000 s, planned end 4.000000 s'
    assert 'aborted; up to its end complete: ' in last
    assert information(tmp_path / 'run')['custom_data']['finished'] == 'false'


def test_a_run_that_came_to_its_end_is_finished(rows, tmp_path, capsys):
    record(tmp_path / 'run', rows, 0, 9)
    assert verify(load(tmp_path / 'run')).finished
    assert cli.main(['verify', str(tmp_path / 'run')]) == 0
    assert 'abort' not in capsys.readouterr().out


def test_steps_that_the_drive_lost_are_said(tmp_path):
    def diagnostics(node, **values):
        return messages.serialize(messages.DiagnosticArray(header=messages.header(''), status=[
            messages.DiagnosticStatus(level=0, name=node, message='', hardware_id='', values=[
                messages.KeyValue(key=key, value=value) for key, value in values.items()])]))
    writer = Writer(tmp_path / 'run', RECORDED, METADATA)
    for k in range(101):
        message = messages.template('joint_states')
        messages.put_stamp(message.header.stamp, k * 5_000_000)
        writer.write(NAMES.index('joint_states'), k * 5_000_000, 0, messages.serialize(message))
    for values in ({'lost_steps': '7', 'step': '50'}, {'lost_steps': '53', 'step': '101'}):
        writer.write(NAMES.index('diagnostics'), 500_000_000, 0, diagnostics('adu', **values))
    writer.write(NAMES.index('diagnostics'), 500_000_000, 0, diagnostics('acu', lost_steps='9', step='9'))
    writer.close()
    report = verify(load(tmp_path / 'run'))     # of a graph started by hand: from the first diagnostics on
    assert 'lost steps: 46 of 51, made by the drive without the command for them' in report.lines()


def test_times_are_those_of_the_scenario(rows, tmp_path):
    """In realtime stamps are UTC, and the bag says where the time of the scenario is 0 in them."""
    start = 1_790_000_000 * SECOND
    writer = Writer(tmp_path / 'run', RECORDED, {**METADATA, 'start': start})
    for index, stamp, data in rows:
        if stamp < 2 * SECOND and RECORDED[index].rate == 'step':
            data = data[:4] + struct.pack('<iI', *divmod(start + stamp, SECOND)) + data[12:]
            writer.write(index, start + stamp, start + stamp, data)
    writer.close()
    content, report = bag.read(tmp_path / 'run'), verify(load(tmp_path / 'run'))
    assert (content.start, content.planned_end) == (start, start + 4 * SECOND)
    assert content.table('joint_states')['t'][-1] == 1.995
    assert report.ending == 'aborted: ends at 1.995000 s, planned end 4.000000 s'
    assert {check.last for check in report.topics if check.name == 'clock'} == {1.995}
    assert 'ends after 1.995000 s, the planned end is 4.000000 s' in recover(tmp_path / 'run').lines()[0]


@pytest.mark.parametrize('name', ['leo_pass', 'servo_sine', 'servo_step', 'ship_pass', 'uav_flyby'])
def test_a_recording_of_an_earlier_version_is_finished(name):
    report = verify(load(pathlib.Path(__file__).parents[3] / 'bags' / 'reference' / name))
    assert report.finished and report.planned_end == report.end, report.lines()
