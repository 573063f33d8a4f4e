"""Tracking data messages, read back by two readers of others: ccsds_ndm (Rust, strict) and beyond."""
import datetime
import math
import pathlib
import re

import ccsds_ndm
import numpy as np
import pytest
from beyond.io import ccsds

from pedestal import cli
from pedestal_common.graph import topics
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording.writer import Writer
from pedestal_results import tdm, tracking

REFERENCE = pathlib.Path(__file__).parents[3] / 'bags' / 'reference'
CREATED = datetime.datetime(2026, 11, 22, 6, 0, 0)
BEGIN = 1_795_000_000_000_000_000
T = 50_000_000


def made(path, count=40, start=BEGIN, **metadata):
    """A recording in realtime of a beam that turns through north while the target is 2 mrad beside it; out of lock at
    every tenth step, in autotrack from the fifth on, the range measured at every second."""
    writer = Writer(path, topics.TOPICS, {'scenario': 'test', 'pacing': 'realtime', 'start': str(start), **metadata})
    names = [topic.name for topic in topics.TOPICS]

    def write(name, k, message):
        stamp = start + k * T
        if hasattr(message, 'header'):
            messages.put_stamp(message.header.stamp, stamp)
        writer.write(names.index(name), stamp, stamp, messages.serialize(message))

    for k in range(count):
        joints = messages.template('joint_states')
        joints.position[:] = 4.0 * math.pi - 0.02 + 1e-3 * k, 0.5
        write('joint_states', k, joints)
        if k in (0, 5):
            write('acu/mode', k, messages.String(data='autotrack' if k else 'program'))
        off = math.nan if k % 10 == 9 else 2e-3
        write('tracking_receiver/angle_error', k, messages.Vector3Stamped(
            header=messages.header('beam'), vector=messages.vector3(0.0, off, 46.4)))
        if k % 2:
            distance = messages.template('tracking_receiver/range')
            distance.range = 650e3
            write('tracking_receiver/range', k, distance)
    writer.close()
    return path


def by_rust(file):
    """(message, {keyword: (times, values)}) as ccsds_ndm reads them."""
    message = ccsds_ndm.Tdm.from_file(str(file))
    rows = {}
    for segment in message.body.segments:
        for observation in segment.data.observations:
            rows.setdefault(observation.keyword, []).append((observation.epoch, observation.value))
    return message, {keyword: (np.array([time for time, _ in of], 'M8[us]'), np.array([value for _, value in of]))
                     for keyword, of in rows.items()}


def by_beyond(file):
    """[(time, name, number)] as beyond reads them: it knows no C/N0, which is left out."""
    text = '\n'.join(line for line in file.read_text().splitlines() if not line.startswith('PC_N0'))
    sets = ccsds.loads(text)
    measures = [measure for of in ([sets] if hasattr(sets[0], 'value') else sets) for measure in of]
    return [(np.datetime64(measure.date.datetime, 'us'), type(measure).__name__, measure.value)
            for measure in measures]


@pytest.mark.parametrize('name', ['leo_pass', 'ship_pass'])
def test_two_readers_read_what_the_truth_says(name, tmp_path):
    [(file, records)] = tdm.export(REFERENCE / name, CREATED, tmp_path, 50.0)
    message, rows = by_rust(file)
    assert file == tmp_path / f'{name}.tdm' and message.header.creation_date == '2026-11-22T06:00:00'
    meta = message.body.segments[0].metadata
    assert (meta.participant_1, meta.participant_2, str(meta.path), meta.time_system) == (
        'PEDESTAL', '1998-067A', '2,1', 'UTC')
    times, azimuth = rows['ANGLE_1']
    elevation = rows['ANGLE_2'][1]
    assert len(times) == len(elevation) == len(rows['PC_N0'][1]) == records > 100
    run = tracking.read(bags.read(REFERENCE / name))
    zero = np.datetime64(bags.read(REFERENCE / name).last_values('tracking_receiver')['stamp_0_utc'].removesuffix('Z'))
    there = np.searchsorted(np.round(run.t * 1e6).astype(int), (times - zero).astype('m8[us]').astype(int))
    assert (run.mode[there] == 'autotrack').all()
    true = np.degrees(run.target_earth[there])
    across = (azimuth - true[:, 0] + 180.0) % 360.0 - 180.0
    noise = np.nanstd(run.noise)
    for off in (across * np.cos(np.radians(elevation)), elevation - true[:, 1]):
        assert abs(off.mean()) < 0.5 * noise and np.abs(off).max() < 5.0 * noise
    measures = by_beyond(file)
    assert len(measures) == 2 * records
    for (time, kind, value), when, a in zip(measures[::2], times, azimuth):
        assert (time, kind) == (when, 'Azimut') and -math.degrees(value) == pytest.approx(a, abs=1e-9)
    assert [math.degrees(value) for _, kind, value in measures if kind == 'Elevation'] == pytest.approx(elevation)


def test_steps_without_lock_or_autotrack_are_left_out_and_segments_are_short(tmp_path, monkeypatch):
    monkeypatch.setattr(tdm, 'SEGMENT_STEPS', 7)
    [(file, records)] = tdm.export(made(tmp_path / 'a'), CREATED, tmp_path / 'b.tdm', 1000.0, ('ZURICH', 'X-1'))
    message, rows = by_rust(file)
    assert len(message.body.segments) == 6 and records == 40 - 5 - 4
    meta = message.body.segments[-1].metadata
    assert (meta.participant_1, meta.participant_2, meta.range_units) == ('ZURICH', 'X-1', 'km')
    times, azimuth = rows['ANGLE_1']
    k = (times - np.datetime64(BEGIN // 1000, 'us')).astype(int) // (T // 1000)
    assert k.tolist() == [k for k in range(5, 40) if k % 10 != 9]
    assert azimuth == pytest.approx(np.degrees(1e-3 * k - 0.02) % 360.0, abs=1e-6) and azimuth.max() < 360.0
    assert rows['ANGLE_2'][1] == pytest.approx(math.degrees(0.502), abs=1e-6)
    assert rows['RANGE'][1] == pytest.approx(650.0) and len(rows['RANGE'][1]) == sum(k % 2)
    assert {kind for _, kind, _ in by_beyond(file)} == {'Azimut', 'Elevation', 'Range'}


@pytest.mark.parametrize('rate, step', [(10.0, 2), (1.0, 20), (0.5, 40)])
def test_the_rate_is_at_most_what_is_asked(tmp_path, rate, step):
    made(tmp_path / 'a', 200)
    [(file, _)] = tdm.export(tmp_path / 'a', CREATED, None, rate)
    times = by_rust(file)[1]['ANGLE_1'][0]
    k = (times - np.datetime64(BEGIN // 1000, 'us')).astype(int) // (T // 1000)
    assert (k % step == 0).all() and len(k) > 3 * (step < 40) and file == tmp_path / 'a' / 'export' / 'a.tdm'


@pytest.mark.parametrize('arguments, message', [
    ((), 'exists already; --overwrite replaces'), (('--rate', '0'), '--rate 0: must be 0.001 to 1000'),
    (('--rate', 'nan'), '--rate nan: must be'), (('--topics', 'clock'), '--topics: a tdm is made of'),
    (('--participants', 'a\nb', 'c'), '--participants .*: must be 1 to 80 ASCII characters')])
def test_what_cannot_be_is_refused_in_one_line(tmp_path, capsys, arguments, message):
    made(tmp_path / 'a')
    assert cli.main(['export', str(tmp_path / 'a'), '--format', 'tdm']) == 0
    capsys.readouterr()
    assert cli.main(['export', str(tmp_path / 'a'), '--format', 'tdm', *arguments]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.search(message, line)


def test_a_recording_without_a_date_or_without_autotrack_is_refused(tmp_path):
    with pytest.raises(ValueError, match='servo_sine: the bag has no date'):
        list(tdm.export(REFERENCE / 'servo_sine', CREATED, tmp_path / 'x'))
    with pytest.raises(ValueError, match='nothing to export'):
        list(tdm.export(made(tmp_path / 'a', 5), CREATED, tmp_path / 'x'))
    assert not list((tmp_path / 'x').glob('*'))
