import importlib.util
import itertools
import pathlib
import subprocess
import sys

import foreign_bag
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rosbags.highlevel import AnyReader

from pedestal_recording import bag
from pedestal_recording.bag import load
from pedestal_recording.recover import recover
from pedestal_recording.verify import verify
from pedestal_recording.writer import Writer

_spec = importlib.util.spec_from_file_location('killed_writer', pathlib.Path(__file__).with_name('killed_writer.py'))
killed_writer = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(killed_writer)
NAMES = killed_writer._bag_test.NAMES
RECORDED = killed_writer._bag_test.RECORDED
METADATA = killed_writer._bag_test.METADATA
SECOND = 1_000_000_000


@pytest.fixture(scope='module')
def made():
    return [(NAMES[index], stamp, data) for index, stamp, data in
            itertools.islice(killed_writer.rows(), killed_writer.ROWS)]


def held(path):
    return [(name, log, data) for name, log, _, data in bag.read(path).raw()]


@pytest.mark.thorough
def test_twenty_deaths_lose_at_most_the_last_second(tmp_path, made):
    done = subprocess.run([sys.executable, killed_writer.__file__, tmp_path, '1', '20'], check=True, timeout=120,
                          text=True, stdout=subprocess.PIPE)
    lengths = []
    for number, line in enumerate(done.stdout.splitlines()):
        written, flushed = map(int, line.split())
        path = tmp_path / str(number)
        if not flushed:
            with pytest.raises(bag.BagError):
                recover(path)
            assert not (tmp_path / f'{number}-recovered').exists()
            assert not written or made[written - 1][1] <= SECOND
            continue
        [file] = path.glob('*.mcap')
        before = file.read_bytes()
        found = recover(path)
        got = held(found.path)
        assert got == made[:len(got)] and len(got) >= flushed
        assert written and made[written - 1][1] - got[-1][1] <= SECOND
        assert (found.last, sum(found.counts.values()), found.lost) == (got[-1][1], len(got), {})
        assert file.read_bytes() == before and {entry.name for entry in path.iterdir()} <= {file.name, 'metadata.yaml'}
        lengths.append(len(got))
        if number % 10 < 2:
            report = verify(load(found.path))
            assert report.complete, report.lines()
            assert 'recovered (0 messages lost in the middle)' in report.made
    assert len(lengths) > 10 and len(set(lengths)) > 5, lengths


@pytest.fixture(scope='module')
def whole(made, tmp_path_factory):
    """A bag of 7 chunks, and where they are in its bytes: [(start, stop)]."""
    path = tmp_path_factory.mktemp('bags') / 'whole'
    writer = Writer(path, RECORDED, {**METADATA, 'scenario': 'leo_pass'},
                        {'parameters': {'recorder': 'duration: 20.0'}})
    for name, stamp, data in made:
        if stamp >= 7 * SECOND:
            break
        writer.write(NAMES.index(name), stamp, stamp, data)
    writer.close()
    with open(writer.file, 'rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    return path, [(chunk.chunk_start_offset, chunk.chunk_start_offset + chunk.chunk_length) for chunk in chunks]


def damaged(whole, tmp_path, change):
    """A bare file: the bytes of the whole bag, changed."""
    [file] = whole[0].glob('*.mcap')
    data = bytearray(file.read_bytes())
    data = change(data) or data
    (tmp_path / 'damaged.mcap').write_bytes(data)
    return tmp_path / 'damaged.mcap'


def without_seconds(made, *missing):
    return [row for row in made if row[1] < 7 * SECOND and row[1] // SECOND not in missing]


def flip(places, value=0xff):
    def change(data):
        for place in places:
            data[place] ^= value
    return change


def test_a_chunk_that_is_broken_in_the_middle_is_left_out_and_said(whole, tmp_path, made):
    start, stop = whole[1][3]
    found = recover(damaged(whole, tmp_path, flip([stop - 100])))
    assert held(found.path) == without_seconds(made, 3)
    *lines, last = found.lines()
    assert lines[0] == f'bytes {start} to {stop} unused (a corrupted chunk), after 2.995000 s, before 4.000000 s'
    step = [topic.name for topic in RECORDED if topic.rate == 'step']
    diagnostics = sum(row[0] == 'diagnostics' and row[1] == 3 * SECOND for row in made)
    assert found.lost == {**dict.fromkeys(step, 200), 'diagnostics': diagnostics}
    total = 200 * len(step) + diagnostics
    assert lines[1].startswith(f'lost in the middle: 200 steps, {total} messages: 200 of clock, ')
    assert lines[2] == 'the recording ends after 6.995000 s, the planned end is 20.000000 s'
    assert last.endswith(f'0.000000 to 6.995000 s; {stop - start} bytes unused')
    problems = [problem for check in verify(load(found.path)).topics for problem in check.problems]
    assert 'missing 200 steps from 3.000000 to 3.995000 s' in problems


@pytest.mark.parametrize('what', ['length', 'opcode', 'zeros', 'length of the index', 'two'])
def test_after_broken_framing_the_next_whole_chunk_is_found(whole, tmp_path, made, what):
    start, stop = whole[1][3]
    change, missing = {
        'length': (flip([start + 4]), {3}),
        'opcode': (flip([start]), {3}),
        'zeros': (lambda data: data.__setitem__(slice(start, stop), bytes(stop - start)), {3}),
        'length of the index': (flip([stop + 3]), set()),
        'two': (flip([start + 4, whole[1][4][0] + 200]), {3, 4})}[what]
    found = recover(damaged(whole, tmp_path, change))
    assert held(found.path) == without_seconds(made, *missing)
    assert sum(found.lost.values()) == len(without_seconds(made)) - len(without_seconds(made, *missing))
    assert bool(found.gaps)


@pytest.mark.parametrize('tail', [b'', bytes(3_000), b'\xa5' * 100_000])
def test_a_file_cut_short_or_filled_up_with_rubbish_reads_to_its_last_chunk(whole, tmp_path, made, tail):
    start, stop = whole[1][5]
    found = recover(damaged(whole, tmp_path, lambda data: data[:stop - 1] + tail))
    assert held(found.path) == without_seconds(made, 5, 6)
    assert found.unused == stop - 1 - start + len(tail)
    assert 'the recording breaks off after 4.995000 s, the planned end is 20.000000 s' in found.lines()


def test_a_whole_bag_comes_back_with_everything_in_it(whole, tmp_path, made):
    found = recover(whole[0], tmp_path / 'again')
    assert held(tmp_path / 'again') == held(whole[0]) and (found.gaps, found.lost) == ([], {})
    ours, theirs = bag.read(tmp_path / 'again'), bag.read(whole[0])
    assert ours.metadata_records == {**theirs.metadata_records, 'recovered': {'messages_lost': '0',
                                                                              'bytes_unused': '0'}}
    stop = whole[1][-1][1]
    assert ours.file.read_bytes()[:stop] == theirs.file.read_bytes()[:stop]
    with AnyReader([tmp_path / 'again']) as reader:
        assert reader.message_count == len(without_seconds(made))
        qos = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
        assert qos['/acu/mode'] == 'TRANSIENT_LOCAL' and qos['/clock'] == 'VOLATILE'


def foreign(path, made, **options):
    def put(writer, channel):
        channels = {}
        for name, stamp, data in without_seconds(made):
            if name not in channels:
                channels[name] = channel('/' + name, f'pkg/msg/T{len(channels)}')
            writer.add_message(channels[name], stamp, data, stamp)
    return foreign_bag.write(path, put, b'float64 x', chunk_size=200_000, **options).read_bytes()


@pytest.mark.parametrize('options', [{}, {'compression': CompressionType.NONE}, {'use_chunking': False}], ids=str)
def test_a_foreign_bag(tmp_path, made, options):
    data = foreign(tmp_path / 'f.mcap', made, **options)
    found = recover(tmp_path / 'f.mcap', tmp_path / 'all')
    assert held(tmp_path / 'all') == without_seconds(made) and found.lines()[0] == 'nothing is missing'
    assert bag.read(tmp_path / 'all').topics == {name: f'pkg/msg/T{number}' for number, name in
                                                 enumerate(dict.fromkeys(row[0] for row in made))}
    (tmp_path / 'f.mcap').write_bytes(data[:len(data) // 2])
    recover(tmp_path / 'f.mcap', tmp_path / 'half')
    half = held(tmp_path / 'half')
    assert half == made[:len(half)] and len(half) > 0.3 * len(without_seconds(made))
    if options.get('use_chunking', True):
        (tmp_path / 'f.mcap').write_bytes(data[:1000] + b'\xff' + data[1001:])
        found = recover(tmp_path / 'f.mcap', tmp_path / 'headless')
        late = held(tmp_path / 'headless')
        assert late == without_seconds(made)[-len(late):] and len(late) > 0.9 * len(without_seconds(made))
        assert found.lost == {} and 'nothing is missing' not in found.lines()


def test_channels_declared_nowhere_are_said(tmp_path, made):
    data = foreign(tmp_path / 'f.mcap', made)
    (tmp_path / 'f.mcap').write_bytes(data[:1000] + b'\xff' + data[1001:-2000])
    with pytest.raises(bag.BagError, match='no message in it is readable'):
        recover(tmp_path / 'f.mcap')
    assert [entry.name for entry in tmp_path.iterdir()] == ['f.mcap']


def test_what_cannot_be_recovered_leaves_nothing_behind(whole, tmp_path):
    with pytest.raises(bag.BagError, match='exists already'):
        recover(whole[0], whole[0])
    writer = Writer(tmp_path / 'live', RECORDED, METADATA)
    with pytest.raises(bag.BagError, match='is being written'):
        recover(tmp_path / 'live')
    writer.close()
    with pytest.raises(bag.BagError, match='no message'):
        recover(tmp_path / 'live')
    command = ('import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)); '
               'from pedestal import cli; sys.exit(cli.main(["recover", sys.argv[1], "--output", "out"]))')
    done = subprocess.run([sys.executable, '-c', command, whole[0]], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f'pedestal: error: {tmp_path}/out/out_0.mcap: File too large\n'
    assert [entry.name for entry in tmp_path.iterdir()] == ['live']


def test_by_default_the_new_bag_lies_beside_the_old(whole, tmp_path, monkeypatch):
    file = damaged(whole, tmp_path, lambda data: data[:-1])
    monkeypatch.chdir(tmp_path)
    assert recover(pathlib.Path(file.name)).path == tmp_path / 'damaged-recovered'
    (tmp_path / 'v1.5').mkdir()
    file.rename(tmp_path / 'v1.5' / 'x.mcap')
    assert recover(pathlib.Path('v1.5')).path == tmp_path / 'v1.5-recovered'
