"""Damaged and hostile files to every verb that reads files: python test/hostile_files.py FOLDER [COUNT] [SEED].

Each file goes to each of its verbs in a child of its own, which may take TIME seconds of a core and, with what the
parent had imported, MEMORY bytes. A verb must do its work, or refuse the file by one line on stderr. What did
neither is listed; the exit code is 1 when anything is. Every second file is crafted, one of CRAFTED; the others are
sound ones with random damage.
"""
import collections
import contextlib
import importlib
import itertools
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import socket
import struct
import sys
import time

import foreign_bag
import zstandard
from mcap.writer import Writer as McapWriter

from pedestal import cli
from pedestal_bringup.scenario import scenario

TIME, WAITING = 60, 600.0
"""Seconds of a core, and of the clock beside a busy machine, after which a verb hangs."""

MEMORY = 500_000_000
ADDRESSES = 4_000_000_000
"""Addresses that a child may take beyond those of its parent, so that a claim of terabytes fails at once."""

REFERENCE = pathlib.Path(__file__).parent.parent / 'bags' / 'reference' / 'leo_pass'
TRACK = 'time_s,latitude_deg,longitude_deg,altitude_m\n' + ''.join(
    f'{t},{47.4 + 1e-3 * t:.6f},8.52,1500\n' for t in range(20))
OEM_HEAD = 'CCSDS_OEM_VERS = 2.0\n'
OEM_META = ('OBJECT_NAME = ISS\nOBJECT_ID = 1998-067A\nCENTER_NAME = EARTH\nREF_FRAME = ITRF\nTIME_SYSTEM = UTC\n'
            'INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 7\n')
OEM = OEM_HEAD + 'META_START\n' + OEM_META + 'META_STOP\n' + ''.join(
    f'2026-11-22T00:{k:02}:00 6800 {7 * k} 0 0 7 0\n' for k in range(20))
STK = 'stk.v.11.0\nBEGIN Ephemeris\nScenarioEpoch 1 Jan 2026 00:00:00.0\nEphemerisTimePosVel\n'
ADSB = 'time,icao24,lat,lon,geoaltitude\n'
MAGIC = b'\x89MCAP0\r\n'
STAMP = struct.Struct('<iI')


class Files:
    """Makes files in a folder, from a random.Random."""

    def __init__(self, folder, rng):
        self.folder, self.rng = folder, rng
        self.numbers = itertools.count()
        self.sound = (REFERENCE / 'leo_pass_0.mcap').read_bytes()

    def new(self, ending, content=None):
        """The path of a new file, with this content where given (bytes or text)."""
        path = self.folder / f'{next(self.numbers):03}{ending}'
        if content is not None:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def damaged(self, data):
        """Bytes with some of them changed, cut out, doubled, zeroed or put in."""
        data, rng = bytearray(data), self.rng
        for _ in range(rng.choice((1, 1, 3, 30))):
            at, size = rng.randrange(max(len(data), 1)), rng.choice((1, 1, 4, 100, 10_000))
            kind = rng.choice(('flip', 'random', 'zeros', 'cut', 'double', 'insert', 'end'))
            if kind == 'flip':
                data[at:at + 1] = bytes([data[at] ^ 1 << rng.randrange(8)]) if data else b''
            elif kind in ('random', 'zeros'):
                data[at:at + size] = rng.randbytes(size) if kind == 'random' else bytes(size)
            elif kind == 'end':
                del data[at if rng.random() < 0.2 else len(data) - size:]
            else:
                data[at:at + size * (kind == 'cut')] = {
                    'cut': b'', 'double': data[at:at + size], 'insert': rng.randbytes(size)}[kind]
        return bytes(data)

    def repacked(self, change):
        """The sound bag with the messages, schemas and metadata that change(kind, record) gives: checksums hold."""
        from mcap.reader import make_reader
        with open(REFERENCE / 'leo_pass_0.mcap', 'rb') as stream:
            reader = make_reader(stream)
            summary, metadata = reader.get_summary(), list(reader.iter_metadata())
            rows = [(channel, message) for _, channel, message in reader.iter_messages(log_time_order=False)]
        path = self.new('.mcap')
        with open(path, 'wb') as stream:
            writer = McapWriter(stream)
            writer.start('ros2', 'hostile')
            schemas = {number: writer.register_schema(*change('schema', (schema.name, schema.encoding, schema.data)))
                       for number, schema in summary.schemas.items()}
            channels = {number: writer.register_channel(*change('channel', (
                channel.topic, channel.message_encoding)), schemas[channel.schema_id], channel.metadata)
                for number, channel in summary.channels.items()}
            for record in metadata:
                writer.add_metadata(*change('metadata', (record.name, dict(record.metadata))))
            for channel, message in rows:
                number, *content = change('message', (channels[channel.id], message.log_time, message.data,
                                                      message.publish_time, message.sequence))
                writer.add_message(number, *content)
            writer.finish()
        return path

    def chunked(self, content, claim=None, times=1, compression='zstd', packed=None):
        """A bag of chunks that all hold the same content, which claim another size, or hold what is packed."""
        packed = zstandard.ZstdCompressor().compress(content) if packed is None else packed
        head = MAGIC + record(1, text('ros2') + text(''))
        chunk = struct.pack('<QQQI', 0, 0, len(content) if claim is None else claim, 0) + text(compression)
        end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
        return self.new('.mcap', head + record(6, chunk + struct.pack('<Q', len(packed)) + packed) * times + end)


def record(opcode, content):
    return struct.pack('<BQ', opcode, len(content)) + content


def text(value):
    return struct.pack('<I', len(value.encode())) + value.encode()


def declared(topic='/diagnostics', kind='diagnostic_msgs/msg/DiagnosticArray'):
    """The records of a schema and a channel, number 1 both."""
    schema = struct.pack('<H', 1) + text(kind) + text('ros2msg') + struct.pack('<I', 0)
    return record(3, schema) + record(4, struct.pack('<HH', 1, 1) + text(topic) + text('cdr') + struct.pack('<I', 0))


def message(data=b'', stamp=0):
    return record(5, struct.pack('<HIQQ', 1, 0, stamp, stamp) + data)


def header(stamp=0):
    return b'\0\1\0\0' + STAMP.pack(*divmod(stamp, 10**9)) + text('') + b'\0\0\0'


def foreign(files, put, **options):
    return foreign_bag.write(files.new('.mcap'), put, **options)


def changed_messages(files, change):
    return files.repacked(lambda kind, content: change(content) if kind == 'message' else content)


def changed_metadata(files, name, **values):
    def change(kind, content):
        return (name, {**content[1], **values}) if kind == 'metadata' and content[0] == name else content
    return files.repacked(change)


def with_metadata_file(files, make):
    """A directory with the sound bag and the metadata.yaml that make(path) writes."""
    path = files.new('')
    shutil.copytree(REFERENCE, path)
    (path / 'metadata.yaml').unlink()
    make(path / 'metadata.yaml')
    return path


def special(files, ending, make):
    path = files.new(ending)
    make(path)
    return path


def sparse(path):
    with open(path, 'wb') as stream:
        stream.write(MAGIC)
        stream.truncate(1 << 40)


def listening(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


def strings(files, count, size):
    """Diagnostics of many empty texts: 4 bytes on the wire are an object each in memory."""
    return files.chunked(declared() + message(header() + struct.pack('<I', count) + bytes(size)))


def moved(content, stamp=None, sequence=None, log=None, data=None):
    number, logged, bytes_, publish, last = content
    if stamp is not None and len(bytes_) >= 12:
        bytes_ = bytes_[:4] + STAMP.pack(*stamp) + bytes_[12:]
    return (number, logged if log is None else log, bytes_ if data is None else data, publish,
            last if sequence is None else sequence)


BOMB = 'a: &a [x, x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{name}: &{name} [' + f'*{other}, ' * 9 + f'*{other}]\n' for other, name in itertools.pairwise('abcdefgh'))
DEEP = '[' * 100_000
SPECIAL = {'device': lambda path: path.symlink_to('/dev/zero'), 'pipe': os.mkfifo, 'hole': sparse,
           'socket': listening, 'folder': os.mkdir, 'loop': lambda path: path.symlink_to(path.name),
           'endless': lambda path: path.symlink_to('/dev/urandom')}

BAGS = {
    **{f'bag: {name}': lambda files, make=make: special(files, '.mcap', make) for name, make in SPECIAL.items()},
    'bag: bomb of zeros': lambda files: files.chunked(bytes(200_000_000)),
    'bag: bombs of zeros': lambda files: files.chunked(bytes(30_000_000), times=100),
    'bag: bomb of empty messages': lambda files: files.chunked(declared() + message() * 900_000),
    'bag: bombs of empty messages': lambda files: files.chunked(declared() + message() * 400_000, times=30),
    'bag: claims 16 EB': lambda files: files.chunked(b'', claim=2**63),
    'bag: claims 8 GB': lambda files: files.chunked(declared(), claim=8 << 30),
    'bag: claims nothing': lambda files: files.chunked(declared() + message() * 10, claim=0),
    'bag: frame claims 8 GB': lambda files: files.chunked(
        b'', claim=1000, packed=struct.pack('<IBQ', 0xfd2fb528, 0xe0, 8 << 30) + bytes(50)),
    'bag: lz4 bomb': lambda files: files.chunked(b'', claim=1000, compression='lz4', packed=__import__(
        'lz4.frame').frame.compress(bytes(500_000_000))),
    'bag: unknown compression': lambda files: files.chunked(declared(), compression='xz'),
    'bag: message longer than its chunk': lambda files: files.chunked(
        declared() + b'\5' + struct.pack('<QHIQQ', 1 << 40, 1, 0, 0, 0)),
    'bag: message shorter than its head': lambda files: files.chunked(declared() + record(5, bytes(3)) * 50),
    'bag: undeclared channel': lambda files: files.chunked(message() * 9),
    'bag: message of 30 MB': lambda files: files.chunked(declared() + message(header() + bytes(30_000_000))),
    'bag: millions of statuses': lambda files: strings(files, 1_000_000, 25_000_000),
    'bag: claims 4 billion statuses': lambda files: strings(files, 2**32 - 1, 100_000),
    'bag: image': lambda files: files.chunked(declared('/camera', 'sensor_msgs/msg/Image') + message(
        header() + struct.pack('<II', 1, 1) + text('') + bytes(7) + struct.pack('<I', 20_000_000)
        + bytes(20_000_000))),
    'bag: other names in each message': lambda files: foreign(files, lambda writer, channel: [
        writer.add_message(number, k, header() + struct.pack('<I', 1) + text(f'{k:07}\0') + struct.pack('<Id', 1, 1.0)
                           + bytes(8), k) for number in [channel('/joint_states', 'sensor_msgs/msg/JointState')]
        for k in range(30_000)]),
    'bag: other lengths of messages': lambda files: foreign(files, lambda writer, channel: [
        writer.add_message(number, k, header() + struct.pack('<I', 0) * 4 + bytes(k), k)
        for number in [channel('/joint_states', 'sensor_msgs/msg/JointState')] for k in range(3_000)]),
    'bag: names of topics': lambda files: foreign(files, lambda writer, channel: [
        writer.add_message(channel(name, 'std_msgs/msg/String'), 1, b'\0\1\0\0\2\0\0\0x\0', 1)
        for name in ('/../../etc/x', '/' + 'n' * 5000, '/ ', '/[bold]', '/beam_99999/acu/mode', '//x', '/\u202e')]),
    'bag: topic with a line break': lambda files: foreign(files, lambda writer, channel: writer.add_message(
        channel('/a\nb\x1b[2J', 'std_msgs/msg/String'), 1, b'', 1)),
    'bag: 60,000 channels': lambda files: foreign(files, lambda writer, channel: [
        channel(f'/t{k}', 'std_msgs/msg/String') for k in range(60_000)]),
    'bag: records outside of chunks': lambda files: foreign(files, lambda writer, channel: [
        writer.add_message(number, 2**63 + k, b'', k) for number in [channel('/clock', 'rosgraph_msgs/msg/Clock')]
        for k in range(1000)], use_chunking=False),
    'bag: log times beyond 2^63': lambda files: changed_messages(files, lambda row: moved(row, log=2**64 - 1)),
    'bag: stamps of all times': lambda files: changed_messages(files, lambda row: moved(
        row, stamp=(files.rng.randrange(-2**31, 2**31), files.rng.randrange(2**32)))),
    'bag: stamps a nanosecond apart, and years': lambda files: changed_messages(files, lambda row: moved(
        row, stamp=(0, files.rng.randrange(9)) if files.rng.random() < 0.9 else (2**31 - 1, 0))),
    'bag: sequence numbers': lambda files: changed_messages(files, lambda row: moved(
        row, sequence=files.rng.randrange(2**32))),
    'bag: numbers': lambda files: changed_messages(files, lambda row: moved(
        row, data=row[2][:12] + files.rng.randbytes(len(row[2]) - 12) if files.rng.random() < 0.3 else None)),
    'bag: nan and infinity': lambda files: changed_messages(files, lambda row: moved(
        row, data=row[2].replace(row[2][-8:], struct.pack('<d', files.rng.choice(
            (float('nan'), float('inf'), 1e308)))) if len(row[2]) > 60 else None)),
    'bag: types of each other': lambda files: files.repacked(lambda kind, content: (
        files.rng.choice(('sensor_msgs/msg/JointState', 'std_msgs/msg/String', 'nav_msgs/msg/Odometry', 'x')),
        *content[1:]) if kind == 'schema' else content),
    'bag: parameters that are a bomb': lambda files: changed_metadata(files, 'parameters', acu=BOMB),
    'bag: parameters in depth': lambda files: changed_metadata(files, 'parameters', acu=DEEP, recorder=DEEP),
    'bag: parameters that are none': lambda files: changed_metadata(files, 'parameters', acu='[1]', adu='x',
                                                                    recorder='duration: [1]'),
    'bag: parameters of other types': lambda files: changed_metadata(
        files, 'parameters', tracking_receiver='{lever_arm.x: far, antenna.beamwidth: [1, 2]}'),
    'bag: a billion beams': lambda files: changed_metadata(files, 'pedestal', beams='999999999'),
    'bag: beams in words': lambda files: changed_metadata(files, 'pedestal', beams='many', beamwidth='x'),
    'bag: planned end': lambda files: changed_metadata(files, 'pedestal', planned_end_ns='9' * 5000),
    'bag: pacing and seed': lambda files: changed_metadata(files, 'pedestal', pacing='[red]', seed='\x1b[31m'),
    'bag: scenario that is a bomb': lambda files: changed_metadata(files, 'scenario', yaml='scenario:\n' + BOMB),
    'bag: scenario of another': lambda files: changed_metadata(files, 'scenario', yaml='x: [1, 2'),
    'bag: metadata.yaml is a bomb': lambda files: with_metadata_file(files, lambda path: path.write_text(BOMB)),
    'bag: metadata.yaml in depth': lambda files: with_metadata_file(files, lambda path: path.write_text(DEEP)),
    'bag: metadata.yaml of other types': lambda files: with_metadata_file(files, lambda path: path.write_text(
        'rosbag2_bagfile_information: {topics_with_message_count: 3, relative_file_paths: 4, message_count: x}')),
    **{f'bag: metadata.yaml is a {name}': lambda files, make=make: with_metadata_file(files, make)
       for name, make in SPECIAL.items()},
}


def scenario_file(files, content):
    return files.new('.yaml', content)


def header_of(line):
    return f'scenario: {{ros__parameters: {{duration: 0.2, {line}}}}}\n'


YAML = {
    **{f'yaml: {name}': lambda files, make=make: special(files, '.yaml', make) for name, make in SPECIAL.items()},
    **{f'yaml: {name}': lambda files, content=content: scenario_file(files, content) for name, content in {
        'bomb of aliases': BOMB, 'bomb in a section': 'scenario: {ros__parameters: &x {a: *x}}\n' + BOMB,
        'merge keys': 'a: &a {k: 1}\nscenario:\n  <<: [' + '*a, ' * 3000 + '*a]\n',
        'depth': DEEP, 'depth of sections': '{a: ' * 50_000, 'depth of blocks': '- ' * 50_000,
        'long line': 'a: ' + 'x' * 1_500_000, 'too long': 'a: 1\n' * 1_000_000,
        '320 digits': header_of('seed: ' + '9' * 320), '5000 digits': header_of('seed: ' + '9' * 5000),
        'number beyond a float': header_of('deadline: 1.0e+999'), 'sexagesimal': 'scenario: {ros__parameters: '
        '{duration: 1:30}}\n', 'octal': header_of('seed: 010'), 'date': header_of('seed: 2024-01-01'),
        'numeric section': '5: {ros__parameters: {}}\n' + header_of('seed: 1'),
        'section is a list': '[1, 2]: {ros__parameters: {}}\n', 'section is empty': '"": {ros__parameters: {}}\n'
        + header_of('seed: 1'), 'tag': 'scenario: !!python/object/apply:os.system [exit]\n',
        'binary': header_of('title: !!binary aGFsbG8='), 'markup in a title': header_of('title: "[/bold] [link=x]"')
        + 'acu: {ros__parameters: {nonsense: 1}}\n', 'same key twice': header_of('seed: 1, seed: 2'),
        'zero byte': 'a: \0', 'surrogate': header_of('title: "\\ud800"'), 'control': header_of('title: "\\e[2J"')
        + 'x: 1', 'UTF-16': header_of('seed: 1').encode('utf-16'), 'latin': b'title: \xe9\xff', 'two documents':
        '--- {}\n--- {}\n', 'text': 'hello', 'number': '3', 'list': '- 1\n- 2\n', 'empty': '', 'null': '~',
        'lists for numbers': header_of('seed: [[1]]'), 'names of nodes': 'beam_99999/acu: {ros__parameters: {a: 1}}\n'
        + header_of('beam: true, beams: 4'), 'a million beams': header_of('beam: true, beams: 1000000'),
        'long name': f'{"n" * 100_000}: {{ros__parameters: {{}}}}\n' + header_of('seed: 1')}.items()},
}

TRACKS = {
    **{f'track: {name}': lambda files, make=make: special(files, '.csv', make) for name, make in SPECIAL.items()},
    **{f'track: {name}': lambda files, content=content: files.new('.csv', content) for name, content in {
        'empty': '', 'head only': TRACK.splitlines()[0], 'zero bytes': TRACK.replace('8.52', '8.\x005'),
        'open quote': TRACK.replace('8.52', '"8.52', 1), 'long field': TRACK + '9' * 500_000 + ',1,1,1\n',
        '320 digits': TRACK + '9' * 320 + ',47,8,1500\n', 'nan': TRACK + 'nan,47,8,1500\n',
        'infinity': TRACK + '1e999,47,8,1500\n', 'back': TRACK + '3,47,8,1500\n', 'missing column': TRACK.replace(
            'longitude', 'long'), 'column twice': TRACK.replace('altitude_m', 'time_s'), 'latin': b'\xe9\xff' * 100,
        'UTF-16': TRACK.encode('utf-16'), 'no line break': 'x' * 3_000_000, 'too long': b'1' * 70_000_000,
        'rows of commas': TRACK + ',' * 100_000 + '\n', 'sqlite': b'SQLite format 3\0' + bytes(1000)}.items()},
    **{f'track: {name}': lambda files, content=content: files.new('.csv', content()) for name, content in {
        'million aircraft': lambda: ADSB + ''.join(f'1532340000,{k:06x},47,8,1500\n' for k in range(1_000_000)),
        'impossible': lambda: ADSB + ''.join(f'{1532340000 + k},4b1812,{47 + k % 2},8,1500\n' for k in range(100)),
        'GPX of entities': lambda: '<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a0 "aaaaaaaaaa">' + ''.join(
            f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(12)) + ']><gpx><name>&a12;</name></gpx>',
        'GPX with a file in it': lambda: '<!DOCTYPE gpx [<!ENTITY a SYSTEM "file:///etc/passwd">]><gpx>&a;</gpx>',
        'GPX of elements': lambda: '<gpx>' + '<trk>' * 10_000_000,
        'GPX of one text': lambda: '<gpx><trk><name>' + 'a' * 60_000_000,
        'GPX of one attribute': lambda: '<gpx><trk a="' + 'a' * 60_000_000,
        'GPX of no points': lambda: '<gpx>' + '<trk></trk>' * 5_000_000 + '</gpx>',
        'GPX cut off': lambda: '<gpx><trk><trkseg><trkpt lat="47"', 'NMEA of one line': lambda: '$' * 60_000_000,
        'NMEA of commas': lambda: '$GPGGA,' + ',' * 900 + '\n', 'NMEA of empty lines': lambda: '$\n' * 30_000_000,
        'NMEA of GGA': lambda: '$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n' * 900_000,
        }.items()},
}
PREDICTED = {
    'OEM head only': lambda: OEM.partition('META_STOP')[0], 'OEM of keywords': lambda: OEM.replace(
        'META_STOP', 'X = 1\n' * 900_000 + 'META_STOP'), 'OEM of segments': lambda: OEM_HEAD + (
        'META_START\n' + OEM_META + 'META_STOP\n') * 100_000, 'OEM of objects': lambda: OEM_HEAD + ''.join(
        f'META_START\n{OEM_META.replace("ISS", str(k))}META_STOP\n' for k in range(100_000)),
    'OEM in one line': lambda: OEM.replace('META_STOP\n', 'META_STOP\n' + '1 ' * 30_000_000),
    'OEM of nan': lambda: OEM.replace(' 6800 ', ' nan '), 'OEM of one time': lambda: OEM.replace('T00:1', 'T00:0'),
    'OEM of the year 0': lambda: OEM.replace('2026', '0000'),
    'OEM of 320 digits': lambda: OEM.replace('6800', '9' * 320),
    'OEM, degree 99': lambda: OEM.replace('DEGREE = 7', 'DEGREE = 99'),
    'OEM, degree of 900 digits': lambda: OEM.replace('DEGREE = 7', 'DEGREE = ' + '9' * 900),
    'OEM of the moon': lambda: OEM.replace('EARTH', 'MOON'), 'OEM and zeros': lambda: OEM + '\0' * 1_000_000,
    'OEM of many states': lambda: OEM_HEAD + 'META_START\n' + OEM_META + 'META_STOP\n' + ''.join(
        f'2026-{1 + k // 86400:03}T{k // 3600 % 24:02}:{k // 60 % 60:02}:{k % 60:02} 6800 0 0 0 7 0\n'
        for k in range(200_000)),
    'STK head only': lambda: 'stk.v.11.0\nBEGIN Ephemeris\n', 'STK of blocks': lambda: 'stk.v.11.0\n' + (
        'BEGIN X\n' * 900_000), 'STK of segments': lambda: STK + '0 6800000 0 0 0 7000 0\n' * 300_000,
    'STK of an epoch of digits': lambda: STK.replace('2026', '9' * 900),
    'program of one day': lambda: '2461000.5 10 20\n' * 900_000, 'program of 900 digits': lambda: (
        f'2461000.{"5" * 900} 10 20\n' * 9), 'program of words': lambda: '2461000.5 10 20\nx\n',
    'directions of commas': lambda: 'utc,az,el\n' + ',' * 1_000_000, 'directions of nan': lambda: (
        'utc,az,el\n' + ''.join(f'{k},nan,{k}\n' for k in range(9))), 'directions of 320 digits': lambda: (
        'utc,az,el\n' + f'{"9" * 320},1,1\n' * 9), 'directions far apart': lambda: 'utc,az,el\n' + ''.join(
        f'{k},{150 * k % 360},1\n' for k in range(99))}
TRACKS.update({f'track: {name}': lambda files, content=content: files.new('.csv', content())
               for name, content in PREDICTED.items()})

ELEMENTS = {
    **{f'elements: {name}': lambda files, make=make: special(files, '.tle', make) for name, make in SPECIAL.items()},
    **{f'elements: {name}': lambda files, content=content: files.new('.tle', content()) for name, content in {
        'empty': lambda: '', 'line of 60 MB': lambda: '1' * 60_000_000, 'too long': lambda: b'1' * 70_000_000,
        'lines without a satellite': lambda: '1 x\n' * 900_000, 'million pairs': lambda: '1 x\n2 x\n' * 450_000,
        'zeros': lambda: bytes(1_000_000), 'UTF-16': lambda: '1 2'.encode('utf-16'), 'latin': lambda: b'\xe9\xff' * 99,
        'JSON in depth': lambda: '[' * 10_000_000, 'JSON of objects in depth': lambda: '{"a":' * 1_000_000,
        'JSON of empty objects': lambda: '[' + '{},' * 3_000_000 + '{}]', 'JSON of lists': lambda: '[[1],' * 1000,
        'JSON of a long number': lambda: '[{"MEAN_MOTION": ' + '9' * 1_000_000 + '}]', 'JSON cut': lambda: '[{"a": "',
        'JSON of commas': lambda: '[' + ',' * 60_000_000, 'JSON of values': lambda: '{"EPOCH": {"a": [1, {}]}}',
        'XML of elements': lambda: '<omm>' + '<a>' * 10_000_000, 'XML of one text': lambda: (
            '<omm><segment><EPOCH>' + 'a' * 60_000_000), 'XML of entities': lambda: (
            '<!DOCTYPE x [<!ENTITY a "b">]><x>&a;'),
        'XML of empty segments': lambda: '<omm>' + '<segment></segment>' * 1_000_000 + '</omm>',
        'KVN of heads': lambda: 'CCSDS_OMM_VERS = 2.0\n' * 900_000, 'KVN of nothing': lambda: 'CCSDS_OMM_VERS\n',
        'CSV of empty rows': lambda: 'EPOCH,NORAD_CAT_ID\n' + ',\n' * 3_000_000, 'CSV of a long field': lambda: (
            'EPOCH,NORAD_CAT_ID\n' + '9' * 500_000 + ',1\n')}.items()},
}
CRAFTED = {**BAGS, **YAML, **TRACKS, **ELEMENTS}


def crafted(files, name):
    """(name, path)."""
    return name, CRAFTED[name](files)


def damaged(files):
    """(name, path) of a sound file with random damage."""
    kind = files.rng.choice(('bag', 'bag', 'bag', 'directory', 'content', 'yaml', 'track'))
    if kind == 'bag':
        return 'damaged bag', files.new('.mcap', files.damaged(files.sound))
    if kind == 'directory':
        return 'damaged bag with metadata.yaml', with_metadata_file(files, lambda path: path.write_bytes(
            files.damaged((REFERENCE / 'metadata.yaml').read_bytes())))
    if kind == 'content':
        share = files.rng.choice((0.0005, 0.01, 1.0))
        return 'bag with damaged messages', changed_messages(files, lambda row: moved(
            row, data=files.damaged(row[2])[:100_000] if files.rng.random() < share else None))
    if kind == 'yaml':
        return 'damaged yaml', files.new('.yaml', files.damaged(scenario.load('ship_pass').as_yaml().encode()))
    return 'damaged track', files.new('.csv', files.damaged(TRACK.encode()))


def commands(path, output):
    """{verb: arguments} for a file. What would go on to run a graph is stopped by a place that is taken."""
    taken, path = str(REFERENCE), str(path)
    if path.endswith('.yaml'):
        return {'run': [path, '--bag', taken],
                'run --params-file': ['leo_pass', '--params-file', path, '--bag', taken],
                'recompute --params-file': [taken, '--node', 'ship_motion', '--params-file', path],
                'tune': [path, '--filter', 'none']}
    if path.endswith('.csv'):
        return {name: ['leo_pass' if 'ship' in name else 'track_file', '--duration', '0.2', '--param', f'{key}={path}',
                       '--bag', f'{output}/bag', *more] for name, key, more in (
            ('run, target', 'tracking_receiver.target.track_file.path', ()),)}
    if path.endswith('.tle'):
        return {'run, TLE': ['leo_pass', '--tle', path, '--satellite', 'ISS', '--bag', taken]}
    return {'verify': [path], 'recover': [path, '--output', f'{output}/recovered'],
            'report': [path, '--output', f'{output}/report.html'], 'export': [path, '--output', f'{output}/tables'],
            'export, TDM': [path, '--format', 'tdm', '--output', f'{output}/pass.tdm'],
            'recompute': [path, '--output', f'{output}/again'], 'rerun': [path, '--bag', taken],
            'replay': [path, '--deadline', '0.3', '--duration', '0.1'],
            'tune': [path, '--filter', 'cv', '--axis', 'azimuth', '--output', f'{output}/tuned.yaml']}


def child(verb, arguments, errors):
    """Run a verb in this process, a child, and end it."""
    code = 99
    try:
        with open('/proc/self/statm') as stream:
            addresses = int(stream.read().split()[0]) * resource.getpagesize() + ADDRESSES
        resource.setrlimit(resource.RLIMIT_AS, (addresses, addresses))
        resource.setrlimit(resource.RLIMIT_CPU, (TIME, TIME))
        with open(os.devnull) as nothing, open(errors, 'w') as stream, open(os.devnull, 'w') as sink:
            for source, target in ((nothing, 0), (sink, 1), (stream, 2)):
                os.dup2(source.fileno(), target)
            try:
                code = cli.main([verb.split()[0].rstrip(','), *arguments])
            except SystemExit as exit:
                code = exit.code
            except BaseException:
                import traceback
                traceback.print_exc()
            sys.stderr.flush()
    finally:
        os._exit(code)


def outcome(verb, arguments, errors):
    """(what went wrong or '', seconds of a core, bytes) of a verb in a child."""
    begun = time.monotonic()
    number = os.fork()
    if not number:
        os.setpgid(0, 0)
        child(verb, arguments, errors)
    hung = False
    while True:
        done, status, usage = os.wait4(number, os.WNOHANG)
        if done:
            break
        if time.monotonic() - begun > WAITING:
            hung = True
            with contextlib.suppress(ProcessLookupError):
                os.killpg(number, signal.SIGKILL)
        time.sleep(0.002)
    seconds, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
    said = pathlib.Path(errors).read_text(errors='replace')
    notes = re.compile('pedestal: left out: |.*: [0-9]+ foreign messages? left out, ')
    lines = [line for line in said.splitlines() if not notes.match(line)]
    wrong = ''
    if hung:
        wrong = f'hangs, {seconds:.1f} s of a core in {WAITING:g} s'
    elif 'Traceback' in said or os.WIFSIGNALED(status) or os.WEXITSTATUS(status) not in (0, 1, 2):
        wrong = f'ends with {status}: {lines[-1] if lines else ""}'
    elif verb != 'run' and len(lines) > 1:
        wrong = f'{len(lines)} lines: {lines[0]} / {lines[1]}'
    elif len(said) > 10_000:
        wrong = f'a line of {len(said)} characters'
    elif memory > MEMORY:
        wrong = f'takes {memory / 1e6:.0f} MB'
    return wrong, seconds, memory


def warm(folder):
    """Import what the verbs need, once for all children. It is compiled in a child first, which takes memory."""
    child = os.fork()
    if not child:
        try:
            _do_all(folder / 'compiled')
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    _do_all(folder / 'warm')


def _do_all(output):
    for verb, arguments in commands(REFERENCE, output).items():
        if verb not in ('replay', 'rerun', 'tune'):
            with open(os.devnull, 'w') as sink, contextlib.redirect_stdout(sink):
                cli.main([verb.split(',')[0], *arguments])
    load('pedestal_workbench.again.replay', 'pedestal_workbench.tuning.tune', 'pedestal_bringup.graph.graph')


def load(*modules):
    """Import modules once for all children."""
    for name in modules:
        importlib.import_module(name)


def attack(folder, names, seed=1, verbs=None):
    """Make the files (of CRAFTED by their names, None: a damaged one) and give each to its verbs, or those named.

    Iterator of (file, verb, what went wrong or '', seconds of a core, bytes).
    """
    folder = pathlib.Path(folder)
    folder.mkdir(exist_ok=True)
    files = Files(folder, random.Random(seed))
    for number, name in enumerate(names):
        name, path = crafted(files, name) if name else damaged(files)
        for verb, arguments in commands(path, folder / 'out').items():
            if verbs is None or verb in verbs:
                (folder / 'out').mkdir(exist_ok=True)
                yield f'{number:03} {name}', verb, *outcome(verb, arguments, folder / 'errors')
                shutil.rmtree(folder / 'out')
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def main(folder, count=300, seed=1):
    """Attack and print a table of the verbs; the exit code."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True)
    warm(folder)
    rng, names = random.Random(seed), list(CRAFTED)
    rng.shuffle(names)
    chosen = [names[k // 2 % len(names)] if k % 2 == 0 else None for k in range(count)]
    by_verb = collections.defaultdict(list)
    for file, verb, wrong, seconds, memory in attack(folder / 'files', chosen, seed):
        by_verb[verb].append((wrong, seconds, memory))
        if wrong:
            print(f'{file}: {verb} {wrong}', flush=True)
    print(f'{count} files, {sum(map(len, by_verb.values()))} calls')
    print(f'{"verb":26} {"calls":>6} {"wrong":>6} {"most s":>10} {"most MB":>8}')
    for verb, of_verb in by_verb.items():
        wrongs, times, sizes = zip(*of_verb)
        print(f'{verb:26} {len(of_verb):6} {sum(map(bool, wrongs)):6} {max(times):10.1f} {max(sizes) / 1e6:8.0f}')
    return int(any(wrong for of_verb in by_verb.values() for wrong, _, _ in of_verb))


if __name__ == '__main__':
    sys.exit(main(sys.argv[1], *map(int, sys.argv[2:])))
