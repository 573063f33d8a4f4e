"""Recordings that tools of ROS 2 have compressed, filtered, split, renamed or cut."""
import gzip
import pathlib
import shutil

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from pedestal import cli
from pedestal_recording import bag
from pedestal_recording.recover import recover
from pedestal_recording.verify import verify
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun

REFERENCE = pathlib.Path(__file__).parents[3] / 'bags' / 'reference' / 'leo_pass'
BARE = {'index_types': IndexType.NONE, 'repeat_channels': False, 'repeat_schemas': False, 'use_statistics': False,
        'use_summary_offsets': False}


def copied(folder, parts=((-1.0, 1e9),), pack=bytes, names=None, metadata=True, **options):
    """Copy the reference with the mcap library: a file for each part (from, to) [s]; messages keep their numbers."""
    folder.mkdir()
    with open(next(REFERENCE.glob('*.mcap')), 'rb') as stream:
        reader = make_reader(stream)
        summary, header = reader.get_summary(), reader.get_header()
        records = list(reader.iter_metadata()) if metadata else []
        rows = list(reader.iter_messages(log_time_order=False))
    for number, (begin, end) in enumerate(parts):
        name = names[number] if names else f'{folder.name}_{number}.mcap'
        with open(folder / name, 'wb') as stream:
            writer = Writer(stream, **options)
            writer.start(header.profile, header.library)
            for record in records:
                writer.add_metadata(record.name, record.metadata)
            schemas = {key: writer.register_schema(schema.name, schema.encoding, schema.data)
                       for key, schema in summary.schemas.items()}
            channels = {key: writer.register_channel(channel.topic, 'cdr', schemas[channel.schema_id],
                                                     channel.metadata)
                        for key, channel in summary.channels.items()}
            for _, channel, message in rows:
                if begin <= message.log_time / 1e9 < end:
                    writer.add_message(channels[channel.id], message.log_time, pack(message.data),
                                       message.publish_time, message.sequence)
            writer.finish()
    return folder


def verbs(path, capsys):
    """Return {verb: its last line of stderr}; each verb must refuse the bag in one line, and write nothing."""
    out = {}
    for verb in ('verify', 'report', 'recover', 'export', 'recompute'):
        assert cli.main([verb, str(path)]) == 1
        captured = capsys.readouterr()
        assert captured.out == '' and captured.err.count('\n') == 1, verb
        out[verb] = captured.err
    return out


def test_messages_compressed_one_by_one_are_refused_with_the_cure(tmp_path, capsys):
    packed = copied(tmp_path / 'packed', pack=zstandard.ZstdCompressor().compress)
    for path in (packed, packed / 'packed_0.mcap'):
        for text in verbs(path, capsys).values():
            assert 'packed_0.mcap' in text or f'{path}: ' in text
            assert 'its messages are compressed one by one (zstd); `ros2 bag convert -i ' in text
    assert not (tmp_path / 'packed-recovered').exists()


def test_metadata_file_states_compressed_messages(tmp_path, capsys):
    path = copied(tmp_path / 'plain')
    (path / 'metadata.yaml').write_text('rosbag2_bagfile_information: {compression_mode: MESSAGE, '
                                        'compression_format: fancy}\n')
    assert 'compressed one by one (fancy)' in verbs(path, capsys)['recover']


@pytest.mark.parametrize('name,pack,cure', [
    ('zstd', zstandard.ZstdCompressor().compress, 'compressed as a whole (zstd); `zstd -dc'),
    ('gz', gzip.compress, 'compressed as a whole (gzip); `gunzip -c')], ids=['zstd', 'gz'])
def test_file_compressed_as_a_whole_is_refused_with_the_cure(tmp_path, capsys, name, pack, cure):
    folder = copied(tmp_path / 'whole')
    plain = folder / 'whole_0.mcap'
    file = folder / f'whole_0.mcap.{name}'
    file.write_bytes(pack(plain.read_bytes()))
    plain.unlink()
    for path in (folder, file):
        for text in verbs(path, capsys).values():
            assert f'{file}: {cure} {file} > {plain}` decompresses it' in text
    renamed = shutil.copy(file, tmp_path / 'renamed.mcap')
    assert cure in verbs(renamed, capsys)['verify']


@pytest.mark.parametrize('options', [
    {'use_chunking': False}, {'use_chunking': False, **BARE}, {'chunk_size': 2000},
    {'compression': CompressionType.LZ4}, {'names': ['other.mcap']},
    {'parts': ((-1, 0.5), (0.5, 1), (1, 1e9))}, {'metadata': False}],
    ids=['unchunked', 'bare', 'small chunks', 'lz4', 'renamed', 'split', 'no metadata'])
def test_copies_of_other_tools_are_read(tmp_path, options):
    whole, copy = bag.read(REFERENCE), bag.read(copied(tmp_path / 'copy', **options))
    assert [row[3] for row in whole.raw()] == [row[3] for row in copy.raw()]
    check = verify(copy)
    assert (check.problems, check.complete) == (['metadata.yaml is missing'], False)
    assert not any(row.problems for row in check.topics)
    recovered = recover(copy.path)
    assert recovered.lines()[0] == 'nothing is missing' and verify(bag.read(recovered.path)).complete


def test_split_files_without_a_number_are_read_in_the_order_of_metadata(tmp_path, capsys):
    path = copied(tmp_path / 'b', parts=((-1, 1), (1, 1e9)), names=['x.mcap', 'a.mcap'])
    assert cli.main(['verify', str(path)]) == 1
    assert '2 .mcap files in it, must be one, or NAME_0.mcap' in capsys.readouterr().err
    (path / 'metadata.yaml').write_text('rosbag2_bagfile_information: {relative_file_paths: [x.mcap, a.mcap]}\n')
    assert [file.name for file in bag.read(path).files] == ['x.mcap', 'a.mcap']


def test_a_recording_cut_in_time_is_a_part_of_its_run(tmp_path, capsys):
    """The mode before the first change is in the diagnostics of the control unit; the first lock is unknown."""
    whole = results.measured(RecordedRun(bag.read(REFERENCE, '')).parts)
    [end] = {bag.read(REFERENCE).end}
    path = copied(tmp_path / 'cut', parts=((end - 1.0, 1e9),))
    assert cli.main(['verify', str(path)]) == 1
    lines = capsys.readouterr().out
    assert f'begins at {end - 1.0:.6f} s: {round((end - 1.0) * 200)} steps before it are not in the recording' in lines
    assert 'lost' not in lines and 'must be 1' not in lines
    cut = results.measured(RecordedRun(bag.read(path, '')).parts)
    assert whole['lock_time_s'][0] < end - 1.0 and whole['tracked_percent'][0] > 0.0
    assert str(cut['lock_time_s'][0]) == 'nan'
    assert cut['tracked_percent'][0] == 100.0 and cut['autotrack_time_s'][0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.thorough
def test_a_recording_without_a_mode_does_not_state_it(tmp_path, capsys):
    [end] = {bag.read(REFERENCE).end}
    path = copied(tmp_path / 'cut', parts=((end - 0.5, end - 0.1),))
    cut = results.measured(RecordedRun(bag.read(path, '')).parts)
    assert {str(cut[name][0]) for name in ('tracked_percent', 'autotrack_time_s', 'evaluated_time_s')} == {'nan'}
    assert cli.main(['report', str(path)]) == 0
    page = (path / 'report.html').read_text()
    assert 'does not state the mode of the ACU, so nothing was evaluated' in page and 'never in autotrack' not in page
