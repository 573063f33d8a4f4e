"""Streams of samples: VITA 49, SigMF, ZMQ. Good data arrive as sent, each wrong datum is named."""
import json
import socket
import struct
import time

import numpy as np
import pytest
import zmq

from pedestal_common import parameters
from pedestal_hardware.monopulse import blocks, sigmf, sources, vita49
from pedestal_hardware.monopulse.blocks import Blocks, Chunk, StreamError
from pedestal_hardware.monopulse.params import CHANNELS, SCANNED_CHANNELS, MonopulseParameters
from pedestal_hardware.monopulse.vita49 import Packet

RATE = 100e3
NOW = 1_575_981_300_123_456_789
STREAMS = 1, 2, 3


def noise(count, seed=1):
    return np.random.default_rng(seed).standard_normal((count, 6), np.float32).view(np.complex64)


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


def packets(first, samples, count=0, length=100):
    """Packets of three streams with these samples (n, 3)."""
    return [Packet(stream, count + k, NOW + round((first + k * length) * 1e9 / RATE),
                   samples[k * length:(k + 1) * length, channel].copy())
            for k in range(len(samples) // length) for channel, stream in enumerate(STREAMS)]


@pytest.mark.parametrize('kind, tolerance', [('cf32', 0.0), ('ci16', 64.0 / 32768.0)])
def test_a_packet_arrives_as_sent(kind, tolerance):
    packet = Packet(7, 12, NOW, noise(50)[:, 0].copy())
    found = vita49.decode(vita49.encode(packet, kind, 64.0), kind)
    scale = 64.0 if kind == 'ci16' else 1.0
    assert found[:3] == packet[:3]
    assert np.abs(found.samples * scale - packet.samples).max() <= tolerance


def test_the_words_of_a_packet():
    """Against the layout in ANSI/VITA 49.0, figures 6.1.1-1 and 6.1-1, by hand."""
    data = vita49.encode(Packet(0x0A0B0C0D, 5, 1_000_000_000 * 3 + 250, np.array([1.0 - 0.5j], np.complex64)), 'cf32')
    assert data == bytes.fromhex('10650007' '0A0B0C0D' '00000003' '000000000003D090' '3F800000' 'BF000000')
    # Class identifier and trailer are skipped.
    extended = bytes.fromhex('1C65000A' '0A0B0C0D' '00FFEEDD' '00010002' '00000003' '000000000003D090' '3F800000'
                             'BF000000' '40000000')
    assert vita49.decode(extended, 'cf32').samples.tolist() == [1.0 - 0.5j]
    assert vita49.decode(bytes.fromhex('41650001'), 'cf32') is None     # a context packet


@pytest.mark.parametrize('data, text', [
    (b'ab', 'packet of 2 bytes: must have a header'),
    (bytes.fromhex('30650007') + bytes(24), 'type 3: must be 1'),
    (bytes.fromhex('10650009') + bytes(24), 'states 36 bytes and has 28: cut'),
    (bytes.fromhex('10250007') + bytes(24), 'TSI 0, TSF 2: must be 1'),
    (bytes.fromhex('10650006') + bytes(20), 'payload of 4 bytes: must be a multiple of 8'),
    (bytes.fromhex('10650005') + bytes(16), 'payload of 0 bytes'),
    (struct.pack('>IIIQII', 0x10650007, 1, 3, 2 * 10**12, 0, 0), 'fraction of 2000000000000 ps')])
def test_a_wrong_packet_is_named(data, text):
    with pytest.raises(StreamError, match=text):
        vita49.decode(data, 'cf32')


def test_any_bytes_are_a_packet_or_named():
    rng = np.random.default_rng(3)
    for _ in range(3000):
        data = bytearray(vita49.encode(Packet(1, 0, NOW, noise(4)[:, 0].copy()), 'cf32')[:rng.integers(0, 60)])
        for _ in range(rng.integers(0, 4)):
            if data:
                data[rng.integers(len(data))] = rng.integers(256)
        try:
            vita49.decode(bytes(data), 'cf32')
        except StreamError as error:
            assert 'VITA 49' in str(error)


def test_packets_of_three_streams_join_in_any_order():
    samples, joiner = noise(400), vita49.Joiner(RATE, STREAMS)
    sent = packets(0, samples)
    order = [2, 0, 1, 5, 3, 4, 6, 8, 7, 9, 10, 11]
    chunks = [chunk for k in order if (chunk := joiner.put(sent[k]))]
    assert [chunk.first for chunk in chunks] == [0, 100, 200, 300]
    assert np.array_equal(np.concatenate([chunk.samples for chunk in chunks]), samples)


def test_a_lost_packet_is_a_gap():
    joiner, found = vita49.Joiner(RATE, STREAMS), Blocks(RATE, 100)
    made = []
    for k, packet in enumerate(packets(0, noise(600))):
        if k != 7:                                   # of the second stream
            chunk = joiner.put(packet)
            made += found.put(chunk) if chunk else []
    assert (found.gaps, found.lost, joiner.incomplete) == (1, 100, 1)
    assert [block.missing for block in made] == [0, 0, 100, 0, 0]


@pytest.mark.parametrize('wrong, text', [
    (lambda sent: [packet._replace(stream=9) for packet in sent], 'stream 9: must be one of 1, 2, 3'),
    (lambda sent: [packet for packet in sent if packet.stream != 3] * 30, 'no packet of stream 3'),
    (lambda sent: [packet._replace(utc=NOW - 10**9 * packet.counter) for packet in sent], 'time goes back by 1.0'),
    (lambda sent: [packet._replace(samples=packet.samples[:50 + packet.stream]) for packet in sent],
     'packets of 51, 52, 53 samples'),
    (lambda sent: [packet._replace(utc=NOW + 1_250_000 * packet.counter) for packet in sent],
     r'sample rate 80000 S/s by the times of the packets: must be 100000')],
    ids=['stream', 'channels', 'back', 'lengths', 'rate'])
def test_wrong_streams_are_named(wrong, text):
    joiner = vita49.Joiner(RATE, STREAMS)
    with pytest.raises(StreamError, match=text):
        for packet in wrong(packets(0, noise(7000))):
            joiner.put(packet)


def build(**values):
    return parameters.build(MonopulseParameters, {'source.rate': RATE, **values})


def test_messages_of_gnu_radio_with_tags_and_wrong_ones():
    address = f'tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}'
    p = build(**{'source.kind': 'zmq_pull', 'source.address': address})
    context = zmq.Context()
    sender = context.socket(zmq.PUSH)
    sender.setsockopt(zmq.LINGER, 0)
    sender.bind(address)
    source, samples = sources.opened(p, time.time_ns), noise(10)
    for first in (0, 10, 35):
        sender.send(struct.pack('<HBQQ', 0x5FF0, 1, first, 0) + samples.tobytes())
    assert [source.read(5.0).first for _ in range(3)] == [0, 10, 35]
    sender.send_multipart([b'key', samples.tobytes()])
    assert source.read(5.0).first == 45
    for data, text in ((samples.tobytes()[:-8], r'ZMQ message of 232 bytes: must be a multiple of 24, 3 interleaved'),
                       (b'', 'ZMQ message of 0 bytes'),
                       (struct.pack('<HBQQ', 0x5FF0, 1, 0, 2) + samples.tobytes(), 'with 2 tags: switch off')):
        sender.send(data)
        with pytest.raises(StreamError, match=text):
            source.read(5.0)
    sender.send(samples.tobytes())
    assert source.read(5.0).first > 55           # the refused messages are a gap
    source.close()
    sender.close()
    context.term()


def received_by_zmq(numbers, rate_of_sender=RATE, drift=0.0):
    """Send messages of 5 ms by ZMQ. numbers: numbers of the messages that arrive; drift: of the clock of the sender.
    Return (times [s] since the begin, errors of the stamps [s], Blocks, texts of the StreamErrors)."""
    address = f'tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}'
    now, rng, count = [0], np.random.default_rng(6), round(rate_of_sender * 0.005)
    source = sources.opened(build(**{'source.kind': 'zmq_pull', 'source.address': address}), lambda: now[0])
    samples, made, rows, texts = bytes(24 * count), Blocks(RATE, 50), [], set()
    with zmq.Context() as context, context.socket(zmq.PUSH) as sender:
        sender.setsockopt(zmq.LINGER, 0)
        sender.bind(address)
        for k in numbers:
            begin = 0.005 * k * (1.0 + drift)
            now[0] = NOW + round((begin + 0.005 + rng.exponential(0.001)) * 1e9)
            sender.send(samples)
            try:
                chunk = source.read(5.0)
            except StreamError as error:
                texts.add(str(error))
                continue
            made.put(chunk)
            rows.append((begin, (chunk.utc - NOW) * 1e-9 - begin))
    source.close()
    return *np.array(rows).T, made, texts


@pytest.mark.parametrize('lost', [1, 16, 90])
def test_lost_zmq_messages_are_a_gap_within_a_second(lost):
    """Of 5, 80 and 450 ms, all below source.silence."""
    numbers = [k for k in range(2000) if not 1000 <= k < 1000 + lost]
    times, errors, made, texts = received_by_zmq(numbers)
    assert np.abs(errors[(times > 0.5) & (times < 5.0)]).max() < 1e-3
    assert np.abs(errors[times > 6.0 + 0.005 * lost]).max() < 2e-3
    # A long loss first looks like a wrong rate, and its messages are refused.
    refused = len(numbers) - len(times)
    assert made.lost == pytest.approx(500 * (lost + refused), abs=100)
    assert refused == 0 if lost < 20 else refused < 200 and all('sample rate' in text for text in texts)


def test_a_clock_that_drifts_loses_no_samples_and_a_wrong_rate_is_no_gap():
    times, errors, made, texts = received_by_zmq(range(5000), drift=100e-6)
    assert (made.gaps, texts) == (0, set()) and np.abs(errors[times > 1.0]).max() < 3e-3
    *_, made, texts = received_by_zmq(range(600), 0.9 * RATE)
    assert made.gaps <= 1 and 'must be 100000 S/s (source.rate)' in texts.pop()


@pytest.mark.parametrize('feed, ratio, text', [
    ('three_channels', 2.0 / 3.0, 'the messages have 2 channels, must be 3 (feed.kind)'),
    ('one_channel', 1.5, 'the messages have 3 channels, must be 2 (feed.kind)')])
def test_a_wrong_number_of_channels_that_makes_a_wrong_rate_is_named(feed, ratio, text):
    p = build(**{'source.kind': 'zmq_pull', 'source.address': f'tcp://127.0.0.1:{free_port(socket.SOCK_STREAM)}',
                 'feed.kind': feed})
    now = [0]
    source = sources.opened(p, lambda: now[0])
    with zmq.Context() as context, context.socket(zmq.PUSH) as sender:
        sender.setsockopt(zmq.LINGER, 0)
        sender.bind(p.source.url)
        with pytest.raises(StreamError) as raised:
            for k in range(600):        # 600 samples in each 6 ms
                now[0] = NOW + 6_000_000 * (k + 1)
                sender.send(bytes(round(8 * len(p.feed.channels) * 600 * ratio)))
                source.read(5.0)
    source.close()
    assert str(raised.value).endswith(text) and 'must be 100000 S/s (source.rate)' in str(raised.value)


def test_samples_at_full_scale_are_counted():
    samples = np.zeros((100, 3), np.complex64)
    samples[:30, 0], samples[30:35, 0] = 0.99997, complex(0.0, -1.0)
    samples[:, 1] = 1.0                 # a reference may be at full scale
    assert blocks.saturated_share(samples, sources.FULL_SCALE) == pytest.approx(0.35)
    assert blocks.saturated_share(samples, None) == 0.0


def record(path, chunks):
    recorder, made = sigmf.Recorder(path, RATE, CHANNELS, 'test'), None
    made = Blocks(RATE, 50, recorder)
    found = [block for chunk in chunks for block in made.put(chunk)]
    recorder.close()
    return found


def test_a_recording_gives_the_same_blocks(tmp_path):
    """With gaps, a clock that is set again, and a drift below the tolerance."""
    rng, chunks, first, utc = np.random.default_rng(8), [], 5, NOW
    for k in range(200):
        count = int(rng.integers(1, 130))
        chunks.append(Chunk(noise(count, k), first, utc + int(rng.integers(-3000, 3000))))
        lost = int(rng.integers(1, 90)) if rng.random() < 0.1 else 0
        shift = int(rng.integers(-5_000_000, 5_000_000)) if rng.random() < 0.1 else 0
        first, utc = first + count + lost, utc + round((count + lost) * 1e9 / RATE) + shift
    path = tmp_path / 'a.sigmf-meta'
    live = record(path, chunks)
    made = Blocks(RATE, 50)
    again = [block for chunk in sigmf.Recording(path, CHANNELS, RATE).chunks() for block in made.put(chunk)]
    assert len(live) > 100 and any(block.missing for block in live)
    assert [block[1:] for block in again] == [block[1:] for block in live]
    assert all(np.array_equal(a.samples, b.samples) for a, b in zip(again, live))


def full_disk(recorder):
    """Let the samples of a recorder go to a device that is always full."""
    recorder.data.close()
    recorder.data = open('/dev/full', 'wb')


def test_a_full_disk_ends_the_recording_and_no_blocks(tmp_path):
    recorder = sigmf.Recorder(tmp_path / 'a.sigmf-meta', RATE, CHANNELS, 'test')
    made, found = Blocks(RATE, 50, recorder), []
    for k in range(60):
        if k == 3:
            full_disk(recorder)
        found += made.put(Chunk(noise(500), 500 * k, NOW + 5_000_000 * k))
    assert len(found) == 600 and (made.lost, made.recorder) == (0, None)
    assert made.recorder_fault == f'{tmp_path}/a.sigmf-meta: No space left on device'
    assert recorder.data.closed
    assert [start for start, *_ in sigmf.Recording(tmp_path / 'a.sigmf-meta', CHANNELS, RATE).captures] == [0]


def test_captures_are_noted_once_a_second_and_at_the_end(tmp_path):
    path = tmp_path / 'a.sigmf-meta'
    recorder = sigmf.Recorder(path, RATE, CHANNELS, 'test')
    samples, noted = noise(100), []
    for k in range(2500):                           # each chunk of 1 ms is a capture, because 1 ms is lost before it
        recorder.write(Chunk(samples, 200 * k, NOW + 2_000_000 * k), True)
        if k % 50 == 0 or k == 1001:
            noted.append(len(json.loads(path.read_text())['captures']))
    assert noted == [1] * 20 + [1001] * 21 + [2001] * 10
    recorder.close()
    captures = sigmf.Recording(path, CHANNELS, RATE).captures
    assert len(captures) == 2500 and captures[-1] == (249_900, 499_800, NOW + 2_000_000 * 2499)


def test_a_recording_with_too_many_captures_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(sigmf, 'MAX_CAPTURES', 10)
    recorder = sigmf.Recorder(tmp_path / 'a.sigmf-meta', RATE, CHANNELS, 'test')
    made = Blocks(RATE, 50, recorder)
    found = [block for k in range(30) for block in made.put(Chunk(noise(50), 100 * k, NOW + 1_000_000 * k))]
    assert (len(found), made.recorder) == (30, None) and '10 captures: a recording must have' in made.recorder_fault
    assert len(sigmf.Recording(tmp_path / 'a.sigmf-meta', CHANNELS, RATE).captures) == 10


def test_integers_of_other_recorders_are_read(tmp_path):
    numbers = np.arange(60, dtype='<i2').reshape(10, 6)
    (tmp_path / 'a.sigmf-data').write_bytes(numbers.tobytes())
    (tmp_path / 'a.sigmf-meta').write_text(json.dumps({
        'global': {'core:datatype': 'ci16_le', 'core:sample_rate': 1e5, 'core:version': '1.2.0',
                   'core:num_channels': 3},
        'captures': [{'core:sample_start': 0, 'core:datetime': '2019-12-10T12:35:00Z'}], 'annotations': []}))
    [chunk] = sigmf.Recording(tmp_path / 'a.sigmf-meta', CHANNELS, 1e5).chunks()
    assert np.array_equal(chunk.samples.view(np.float32) * 32768.0, numbers)
    assert chunk.utc == 1_575_981_300 * 10**9 and chunk.samples.dtype == np.complex64


@pytest.mark.parametrize('change, text', [
    (lambda m: m['global'].pop('core:datatype'), 'core:datatype = None: must be a text'),
    (lambda m: m['global'].update({'core:datatype': 'rf32_le'}), "core:datatype = 'rf32_le': must be one of cf32_le"),
    (lambda m: m['global'].update({'core:num_channels': 2}), 'core:num_channels = 2: must be 3'),
    (lambda m: m['global'].pop('core:num_channels'), 'core:num_channels = 1: must be 3'),
    (lambda m: m['global'].update({'core:sample_rate': 48000}), r'core:sample_rate = 48000 S/s: must be 100000 S/s'),
    (lambda m: m['global'].update({'core:sample_rate': '100 kHz'}), "core:sample_rate = '100 kHz': must be a number"),
    (lambda m: m['global'].update({'core:sample_rate': '1e5'}), "core:sample_rate = '1e5': must be a number"),
    (lambda m: m['global'].update({'core:dataset': 'other.bin'}), "core:dataset = 'other.bin': must be "),
    (lambda m: m['captures'][0].update({'core:header_bytes': 16}), 'core:header_bytes = 16: must be 0'),
    (lambda m: m['captures'][0].update({'core:trailing_bytes': 8}), 'core:trailing_bytes = 8: must be 0'),
    (lambda m: m.update(captures=[]), 'the first must have core:sample_start = 0'),
    (lambda m: m['captures'][0].update({'core:datetime': 'yesterday'}), "core:datetime = 'yesterday': must be like"),
    (lambda m: m['captures'].append({'core:sample_start': 9999, 'core:datetime': '2030-01-01T00:00:00Z'}),
     'core:sample_start = 9999: must be at most 200, .* the file is cut'),
    (lambda m: m.update({'global': []}), 'must have an object `global`')])
def test_a_wrong_meta_file_is_named(tmp_path, change, text):
    path = tmp_path / 'a.sigmf-meta'
    record(path, [Chunk(noise(200), 0, NOW)])
    meta = json.loads(path.read_text())
    change(meta)
    path.write_text(json.dumps(meta))
    with pytest.raises(StreamError, match=text):
        sigmf.Recording(path, CHANNELS, RATE)


def test_cut_and_missing_files_are_named(tmp_path):
    path = tmp_path / 'a.sigmf-meta'
    record(path, [Chunk(noise(200), 0, NOW)])
    with pytest.raises(StreamError, match='File exists; a recording is never overwritten'):
        record(path, [])
    data = tmp_path / 'a.sigmf-data'
    assert sigmf.free_path(path) == str(tmp_path / 'a-1.sigmf-meta')
    assert sigmf.free_path(tmp_path / 'b.sigmf-meta') == str(tmp_path / 'b.sigmf-meta')
    data.write_bytes(data.read_bytes()[:1001])
    cut = sigmf.Recording(path, CHANNELS, RATE)
    assert '1001 bytes are no multiple of 24: the file is cut' in cut.cut
    assert sum(len(chunk.samples) for chunk in cut.chunks()) == 41
    data.unlink()
    with pytest.raises(StreamError, match='a.sigmf-data: No such file'):
        sigmf.Recording(path, CHANNELS, RATE)
    path.write_text('{"global": ')
    with pytest.raises(StreamError, match='no JSON'):
        sigmf.Recording(path, CHANNELS, RATE)


def test_a_recording_is_played_in_the_time_of_the_clock(tmp_path):
    path = tmp_path / 'a.sigmf-meta'
    record(path, [Chunk(noise(20_000), 0, NOW)])
    p = build(**{'source.kind': 'sigmf', 'source.address': str(path)})
    source, begun = sources.opened(p, time.time_ns), time.time_ns()
    chunks = []
    while (chunk := source.read(0.0)) is not None:
        chunks.append(chunk)
    assert sum(len(chunk.samples) for chunk in chunks) == 20_000
    assert time.time_ns() - begun >= 200_000_000 and 0 <= chunks[0].utc - begun < 2_000_000_000
    assert blocks.Blocks(RATE, 500).put(chunks[0])


def test_a_recording_of_another_feed_is_refused(tmp_path):
    path = tmp_path / 'a.sigmf-meta'
    recorder = sigmf.Recorder(path, RATE, SCANNED_CHANNELS, 'received')
    recorder.write(Chunk(noise(100)[:, :2], 0, NOW), True)
    recorder.close()
    [chunk] = sigmf.Recording(path, SCANNED_CHANNELS, RATE).chunks()
    assert chunk.samples.shape == (100, 2)
    with pytest.raises(StreamError, match='core:num_channels = 2: must be 3: sum, cross-elevation difference'):
        sigmf.Recording(path, CHANNELS, RATE)
