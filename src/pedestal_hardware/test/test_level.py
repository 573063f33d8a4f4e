"""Receivers with a level only: format strings, lines, and a device that sends half lines, vanishes and returns."""
import contextlib
import os
import pty
import socket
import threading
import time
import tty

import pytest

from pedestal_common import stream
from pedestal_common.parameters import ParameterError, build
from pedestal_hardware.level.line_format import LineFormat
from pedestal_hardware.level.unit import LevelReceiverParameters, LevelUnit
from pedestal_hardware.lines import reader
from pedestal_hardware.lines.reader import LineReader, LineSplitter


@pytest.mark.parametrize('form, line, level', [
    ('{level}', b'-65.33', -65.33),                                     # sat-nms LBRX by UDP
    ('{level}', b' 46.5 ', 46.5), ('{level}', b'+4.65e1', 46.5), ('{level}', b'.5', 0.5),
    ('{level} dBm', b'-65.3   dBm', -65.3), ('L={level}dBm', b'l=-65.3dBm', -65.3),
    ('$SIG,{skip},{level},{skip}', b'$SIG,,12.5,x', 12.5),
    ('{skip} {skip} {level:x}', b'+0012a -00003 -0fde8', -65000.0),     # GD/Vertex DTR, mode 0
])
def test_a_format_finds_the_level(form, line, level):
    assert LineFormat(form).level(line) == pytest.approx(level)


@pytest.mark.parametrize('form, line', [
    ('{level}', b''), ('{level}', b'-65,33'), ('{level}', b'-65.33 dBm'), ('{level} dBm', b'-65.3'),
    ('{level}', b'-6-65.3'), ('{level}', '-６５'.encode()), ('{skip},{level}', b'1,2,3'), ('{level}', b'\xff' * 40)])
def test_a_line_of_another_form_is_refused(form, line):
    with pytest.raises(ValueError, match='is not of the form'):
        LineFormat(form).level(line)


@pytest.mark.parametrize('form, reason', [
    ('{lvl} dBm', r'field \{lvl\}: must be \{level\}'), ('{level:.2f}', r'field \{level:.2f\}: must be'),
    ('{level!r}', r'field \{level!r\}: must be'), ('{}', r'field \{\}: must be'), ('dBm', r'\{level\}: is missing'),
    ('', 'is missing'), ('{level},{level}', 'must occur once'), ('{level', "expected '}'"), ('}', "Single '}'"),
    ('{skip}a{level}', r'field \{skip\}: must be followed by a comma'), ('{skip}{level}', 'must be followed by')])
def test_a_wrong_format_is_named_at_the_start(form, reason):
    with pytest.raises(ParameterError, match=reason):
        build(LevelReceiverParameters, {'format': form})


def test_a_format_of_many_fields_is_fast():
    """Two skips between the same separators would need a time that grows with a power of the length."""
    form, begin = LineFormat(','.join(['{skip}'] * 20 + ['{level}'])), time.process_time()
    with pytest.raises(ValueError, match='form'):
        form.level(b'a' * reader.MAX_LINE_BYTES)
    assert time.process_time() - begin < 1.0


@pytest.mark.parametrize('given, reason', [
    ({'url': 'tcp://x:1'}, 'tcp: must be udp://HOST:PORT'), ({'url': 'udp://127.0.0.1'}, 'with a port'),
    ({'url': 'udp://127.0.0.1:70000'}, 'with a port'), ({'url': 'ttyS0'}, 'must be udp'),
    ({'lowest': 5.0, 'highest': 5.0}, 'highest = 5 dB: must be above'), ({'scale': 0.0}, 'must not be 0'),
    ({'baud_rate': 0}, 'baud_rate = 0 Bd: must be 50')])
def test_wrong_parameters_are_named(given, reason):
    with pytest.raises(ParameterError, match=reason):
        build(LevelReceiverParameters, given)


def test_a_graph_in_lockstep_is_refused():
    with pytest.raises(ParameterError, match='must be realtime'):
        LevelReceiverParameters().check_graph(0, True)


def test_levels_and_dropped_lines_are_counted_and_named():
    unit = LevelUnit(build(LevelReceiverParameters, {'scale': 2.0, 'offset': 1.0, 'latency': 0.1, 'lowest': -100.0}))
    assert unit.take(b'20', 10**9) == (9 * 10**8, 41.0)
    for line, kind, reason in ((b'x', 'unreadable', 'not of the form'), (b'nan', 'not_finite', 'finite'),
                               (b'-inf', 'not_finite', 'finite'), (b'-60', 'out_of_range', 'level -119 dB: must be'),
                               (b'1e999', 'not_finite', 'finite')):
        before = unit.drops.counts[kind]
        assert unit.take(line, 2 * 10**9) is None and unit.drops.counts[kind] == before + 1
        diagnosis = unit.diagnose(2 * 10**9)
        assert diagnosis.level == 1 and reason in diagnosis.message
    assert unit.take(b'20', 10**9) is None and unit.drops.counts['not_newer'] == 1
    assert unit.take(b'21', 5 * 10**9).level == 43.0 and unit.diagnose(5 * 10**9).level == 0


def counted():
    return {'lines': 0, 'cut_lines': 0, 'long_lines': 0, 'connections': 0}


def test_the_first_half_line_of_a_stream_is_discarded():
    splitter = LineSplitter(counted())
    splitter.begin(whole=False)
    assert splitter.take(b'5.33\r\n-65.', 0.0) == []
    assert splitter.take(b'34\r\n', 0.1) == [b'-65.34']


def test_a_line_that_stops_is_no_line():
    splitter = LineSplitter(counted())
    splitter.begin(whole=False)
    assert splitter.take(b'\n-6', 0.0) == []
    assert splitter.take(b'', reader.LINE_TIMEOUT_S + 0.1) == []
    assert splitter.take(b'5.33\n-65.34\n', 9.0) == [b'-65.34'] and splitter.counts['cut_lines'] == 1
    splitter.take(b'-6', 9.1)
    splitter.begin(whole=False)         # the device vanished in the middle of a line
    assert splitter.take(b'5.3\n-65.35\n', 9.2) == [b'-65.35'] and splitter.counts['cut_lines'] == 2


def test_lines_are_bounded():
    splitter = LineSplitter(counted())
    splitter.begin(whole=False)
    splitter.take(b'\n', 0.0)
    for _ in range(1000):
        assert splitter.take(b'7' * 1000, 0.0) == []
    assert splitter.take(b'8\n9\n', 0.0) == [b'9'] and splitter.counts['long_lines'] == 1
    assert splitter.take(b'1\0' + b'7' * 300 + b'\0' + b'2\n', 0.0) == [b'1', b'2']
    assert splitter.counts['long_lines'] == 2


def wait_until(condition):
    deadline = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@contextlib.contextmanager
def reading(url):
    lines = []
    device = LineReader(url, 9600, lines.append)
    device.start()
    try:
        yield device, lines
    finally:
        device.close()


def test_datagrams(free_udp_port):
    with reading(f'udp://127.0.0.1:{free_udp_port}') as (device, lines), \
            socket.socket(type=socket.SOCK_DGRAM) as sender:
        wait_until(lambda: device.counts['connections'])
        for datagram in (b'-65.33\0', b'-65.34', b'1\r\n2\r\n', bytes(60000), b''):
            sender.sendto(datagram, ('127.0.0.1', free_udp_port))
        wait_until(lambda: lines == [b'-65.33', b'-65.34', b'1', b'2'])


def test_a_port_in_use_is_named(free_udp_port):
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind(('127.0.0.1', free_udp_port))
        with reading(f'udp://127.0.0.1:{free_udp_port}') as (device, _):
            wait_until(lambda: 'in use' in device.silence)
            other.close()
            wait_until(lambda: device.silence == '')


def test_a_server_that_vanishes_and_returns():
    with socket.create_server(('127.0.0.1', 0)) as server, \
            reading(f'socket://127.0.0.1:{server.getsockname()[1]}') as (device, lines):
        for count in (1, 2):
            connection, _ = server.accept()
            connection.sendall(b'old\n-65.3%d\n-6' % count)
            wait_until(lambda count=count: len(lines) == count)
            connection.close()
            wait_until(lambda: 'closed the connection' in device.silence)
        assert lines == [b'-65.31', b'-65.32'] and device.counts['cut_lines'] == 1


@pytest.fixture
def free_udp_port():
    with socket.socket(type=socket.SOCK_DGRAM) as free:
        free.bind(('127.0.0.1', 0))
        return free.getsockname()[1]


def test_a_serial_device_that_vanishes_and_returns(tmp_path):
    path = tmp_path / 'device'

    def plugged():
        end, device = pty.openpty()
        tty.setraw(device)
        path.symlink_to(os.ttyname(device))
        return end, device

    ends = plugged()
    with reading(str(path)) as (device, lines):
        wait_until(lambda: device.counts['connections'] == 1)
        os.write(ends[0], b'.3\n-65.31\n-6')
        wait_until(lambda: lines == [b'-65.31'])
        path.unlink()
        for end in ends:
            os.close(end)
        wait_until(lambda: device.silence)
        ends = plugged()
        wait_until(lambda: device.counts['connections'] == 2)
        os.write(ends[0], b'5.3\n-65.32\n')
        wait_until(lambda: lines == [b'-65.31', b'-65.32'])
    for end in ends:
        os.close(end)


def test_a_tcp_device_that_falls_silent_is_opened_again(monkeypatch):
    monkeypatch.setattr(reader, 'TCP_SILENCE_S', 0.3)
    monkeypatch.setattr(stream, 'RETRY_PERIOD_S', 0.05)
    with socket.create_server(('127.0.0.1', 0)) as server:
        kept = []
        threading.Thread(target=lambda: [kept.append(server.accept()) for _ in range(2)], daemon=True).start()
        with reading(f'socket://127.0.0.1:{server.getsockname()[1]}') as (device, _):
            wait_until(lambda: len(kept) == 2 and device.counts['connections'] == 2)


