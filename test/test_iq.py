"""Receiver of I/Q samples in realtime, with samples by UDP and ZMQ: a tracked pass, and each thing that fails."""
import itertools
import json
import math
import pathlib
import signal
import socket
import threading
import time

import numpy as np
import pytest
import zmq
from shared import free_port

from equipment_sim.iq import sinks
from pedestal_common import parameters
from pedestal_hardware.monopulse import sigmf, vita49
from pedestal_hardware.monopulse.params import CHANNELS, MonopulseParameters
from pedestal_recording.bag import load
from pedestal_recording.verify import verify

RATE, PERIOD = 50e3, 0.02
BLOCK = round(RATE * PERIOD)
CN0_DBHZ, OFFSET_HZ = 55.0, 7000.0
VALUES = {'source.rate': RATE, 'period': PERIOD, 'source.format': 'cf32', 'carrier.span': 40e3, 'carrier.bins': 1024}
ERROR = 'tracking_receiver/angle_error'


class FrontEnd(threading.Thread):
    """Sends samples of a target a tenth of a beamwidth to the right, one block per period. make: function of the
    samples that gives what is sent instead, None for nothing."""

    def __init__(self, p):
        super().__init__(daemon=True)
        self.sink, self.make, self.ended, self.number = sinks.opened(p), lambda samples: samples, False, 0
        self.rng, self.rate = np.random.default_rng(4), RATE

    def samples(self):
        t = (self.number + np.arange(BLOCK)) / RATE
        carrier = math.sqrt(10.0**(0.1 * CN0_DBHZ) / RATE) * np.exp(2j * math.pi * OFFSET_HZ * t)
        noise = self.rng.standard_normal((BLOCK, 6)).view(complex) / math.sqrt(2.0)
        return (noise + carrier[:, np.newaxis] * [1.0, 0.16, 0.0]).astype(np.complex64)

    def run(self):
        begin, k = time.time(), 0
        while not self.ended:
            samples = self.make(self.samples())
            if samples is not None:
                self.sink.send(samples, self.number, round((begin + k * PERIOD) * 1e9))
            self.number, k = self.number + BLOCK, k + 1
            time.sleep(max(begin + (k + 1) * PERIOD - time.time(), 0.0))
        self.sink.close()


@pytest.fixture(scope='module')
def bench(start_node, connect):
    """(Client, FrontEnd, NodeProcess) with a receiver that is locked."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(('127.0.0.1', 0))
        address = f'udp://127.0.0.1:{free.getsockname()[1]}'
    front_end = FrontEnd(parameters.build(MonopulseParameters, {**VALUES, 'source.address': address}))
    node = start_node('monopulse', *(part for key, value in {**VALUES, 'source.address': address}.items()
                                     for part in ('-p', f'{key}:={value}')))
    front_end.start()
    client = connect(node.domain_id)
    client.read(ERROR)
    client.read('diagnostics')
    locked(client)
    yield client, front_end, node
    front_end.ended = True
    front_end.join(10.0)


def locked(client):
    """Wait for an error that arrives from now on, and return it."""
    heard = client.heard[ERROR]
    first = len(heard)
    return client.until(lambda: [message for message in heard[first:] if math.isfinite(message.vector.x)])[-1]


def test_an_error_has_size_time_and_level(bench):
    client, _, _ = bench
    client.spin(1.0)
    heard = client.heard[ERROR][-20:]
    assert np.mean([m.vector.x for m in heard]) == pytest.approx(0.1 * 0.0175, rel=0.15)
    assert np.mean([m.vector.z for m in heard]) == pytest.approx(CN0_DBHZ, abs=0.5)
    stamp = heard[-1].header.stamp
    assert 0.0 < time.time() - stamp.sec - 1e-9 * stamp.nanosec < 5.0


def cut(front_end):
    """Return `make` that sends half a packet in the place of a packet."""
    def make(samples):
        front_end.sink.socket.sendto(bytes.fromhex('10650064') + bytes(100), front_end.sink.to)
        return samples
    return make


def not_finite(samples):
    samples[5, 1] = complex(0.0, math.inf)
    return samples


@pytest.mark.thorough
@pytest.mark.parametrize('fault, text', [
    ('vanishes', 'no samples for'), ('nan', 'samples hold NaN or infinity'),
    ('cut', 'packet states 400 bytes and has'),
    ('channel', 'no packet of stream 3'), ('rate', r'sample rate 40000 S/s by the times of the packets'),
    ('gap', '1000 samples are missing')])
def test_a_fault_of_the_samples_is_named_and_the_receiver_continues(bench, fault, text):
    client, front_end, node = bench
    streams, counter = front_end.sink.streams, itertools.count()
    front_end.make = {
        'vanishes': lambda samples: None, 'nan': not_finite, 'cut': cut(front_end),
        'channel': lambda samples: samples, 'rate': lambda samples: samples[:800],
        'gap': lambda samples: None if next(counter) % 50 == 0 else samples}[fault]
    if fault == 'channel':
        front_end.sink.streams = streams[:2]
    try:
        client.diagnosed(text)
    finally:
        front_end.make, front_end.sink.streams = (lambda samples: samples), streams
    assert node.process.poll() is None
    locked(client)


@pytest.mark.thorough
def test_a_silent_receiver_publishes_no_error(bench):
    client, front_end, _ = bench
    front_end.make = lambda samples: None
    client.diagnosed('no samples for')
    heard = len(client.heard[ERROR])
    client.spin(0.5)
    assert len(client.heard[ERROR]) == heard
    front_end.make = lambda samples: samples
    locked(client)


@pytest.mark.thorough
def test_messages_of_a_wrong_number_of_channels_and_rate(start_node, connect):
    """By ZMQ, whose messages contain neither the number of channels nor a time."""
    address = f'tcp://127.0.0.1:{free_port()}'
    values = {**VALUES, 'source.kind': 'zmq_pull', 'source.address': address}
    node = start_node('monopulse', *(part for key, value in values.items() for part in ('-p', f'{key}:={value}')))
    client = connect(node.domain_id)
    client.read('diagnostics')
    client.diagnosed('no samples so far')
    with zmq.Context() as context, context.socket(zmq.PUSH) as sender:
        sender.setsockopt(zmq.LINGER, 0)
        sender.bind(address)

        def send(length, period):
            while not done:
                sender.send(bytes(length))
                time.sleep(period)
        for length, text in ((16 * 1024, 'ZMQ message of 16384 bytes: must be a multiple of 24, 3 interleaved'),
                             (24 * 3000, r'S/s: must be 50000 S/s \(source.rate\)'.replace('\\', ''))):
            done = []
            thread = threading.Thread(target=send, args=(length, 0.02))
            thread.start()
            client.diagnosed(text)
            done.append(True)
            thread.join()
    node.process.send_signal(signal.SIGTERM)
    assert node.finish(40.0).returncode == 0


@pytest.mark.thorough
@pytest.mark.parametrize('change, text', [
    ('source.address:=udp://192.0.2.1:4991', 'source.address = udp://192.0.2.1:4991: Cannot assign'),
    ('graph.pacing:=lockstep', 'graph.pacing = lockstep: must be realtime for a receiver of I/Q samples')])
def test_a_start_that_cannot_be_is_named(start_node, change, text):
    result = start_node('monopulse', '-p', change).finish(60.0)
    assert result.returncode == 1 and text in result.stderr


@pytest.mark.thorough
@pytest.mark.parametrize('feed, limit', [('three_channels', 0.2), ('one_channel', 0.3), ('conical_scan', 0.3)])
def test_a_pass_is_tracked_from_samples_and_computed_again(start_run, patient, pedestal, feed, limit):
    run = start_run('leo_pass', '--pacing', 'realtime', '--receiver', 'simulated-iq', '--duration', '7', *patient,
                    '--param', 'scenario.priority=10', '--param', f'tracking_receiver.source.rate={RATE}',
                    '--param', 'tracking_receiver.carrier.span=40e3', '--param', 'tracking_receiver.carrier.bins=1024',
                    '--param', 'tracking_receiver.source.record=samples.sigmf-meta',
                    '--param', f'tracking_receiver.feed.kind={feed}', '--param', 'iq.simulated.carrier=1e9')
    result = run.finish()
    assert result.returncode in (0, 3), result.stderr      # 3: a busy machine, which lost steps
    rows = {row['metric']: row['value'] for row in json.loads(run.json.read_text())['rows']}
    assert rows['pointing_max_deg'] < limit
    recording = load(run.bag)
    assert verify(recording).complete and len(recording.table('target/truth')['t']) > 100
    samples = next(run.bag.parent.rglob('samples.sigmf-meta'))
    code, said, _ = pedestal('recompute', run.bag, '--iq', samples)
    assert code == 0 and 'tracking_receiver: identical' in said, said
    code, _, said = pedestal('recompute', run.bag, '--node', 'tracking_receiver')
    assert code == 2 and 'give their file with --iq' in said
    if feed != 'three_channels':
        code, _, said = pedestal('calibrate', 'receiver', '--bag', run.bag, '--iq', samples)
        assert code == 2 and f'feed.kind = {feed}: must be three_channels with --iq' in said
    # The samples of the last 2 s, of which some are later than the run, are cut off: the errors that need them are
    # missing, and are named.
    data = samples.with_suffix('.sigmf-data')
    data.write_bytes(data.read_bytes()[:-100 * 8 * (3 if feed == 'three_channels' else 2) * BLOCK - 7])
    code, said, _ = pedestal('recompute', run.bag, '--iq', samples)
    assert code == 1 and 'the file is cut' in said and '0 differ' in said and 'DIFFERS' in said


@pytest.mark.thorough
def test_the_calibration_matrix_is_measured_from_a_run_and_its_samples(start_run, patient, pedestal):
    """A shorter receiver_phasing: a cross of 0.1 and 0.3 beamwidths, then six points of the circle."""
    steps = ((0.001994, 0.5), (-0.001994, 0.5), (0.005982, 0.5), (-0.005982, 0.5), (0.0, 0.50525), (0.0, 0.49475),
             (0.003988, 0.5), (0.0, 0.5035), (-0.002824, 0.502475), (-0.003988, 0.5), (0.0, 0.4965),
             (0.002816, 0.497525))
    commands = '; '.join(f'{4 + 2 * k} preset azimuth={az:.6f} elevation={el:.6f}' for k, (az, el) in
                         enumerate(steps))
    run = start_run('receiver_phasing', '--pacing', 'realtime', '--receiver', 'simulated-iq', '--duration', '28',
                    *patient, *(word for change in (
                        'scenario.priority=10', f'acu.commands={commands}', f'tracking_receiver.source.rate={RATE}',
                        'tracking_receiver.carrier.bins=1024', 'tracking_receiver.source.record=samples.sigmf-meta',
                        'tracking_receiver.antenna.cross_coupling=0.3', 'iq.simulated.x_phase=0.9',
                        'iq.simulated.e_phase=-1.2') for word in ('--param', change)))
    result = run.finish()
    assert result.returncode in (0, 3), result.stderr      # 3: a busy machine, which lost steps
    samples = next(run.bag.parent.rglob('samples.sigmf-meta'))
    code, said, _ = pedestal('calibrate', 'receiver', '--bag', run.bag, '--iq', samples, '--json', 'found.json',
                             '--output', 'matrix.yaml')
    assert code == 0 and 'verified: the new matrix passes' in said, said
    found = {row['metric']: row['value'] for row in json.loads(pathlib.Path('found.json').read_text())['rows']}
    assert [found['x_from_x_phase'], found['e_from_e_phase']] == pytest.approx([-0.9, 1.2], abs=0.03)
    # The second element of a column has the phase of the channel and the sign of the turn.
    assert [found['x_from_e_phase'], found['e_from_x_phase']] == pytest.approx([1.2, math.pi - 0.9], abs=0.15)
    assert found['x_from_e_gain'] == pytest.approx(math.sin(0.3) / 1.02, abs=0.03)
    assert 'calibration.e_from_x_phase' in pathlib.Path('matrix.yaml').read_text()
    # Samples of another run, here with exchanged differences, give other errors than those in the recording.
    data = samples.with_suffix('.sigmf-data')
    np.fromfile(data, np.complex64).reshape(-1, 3)[:, [0, 2, 1]].tofile(data)
    code, _, said = pedestal('calibrate', 'receiver', '--bag', run.bag, '--iq', samples)
    assert code == 2 and 'differ by' in said and 'both must be of the same run' in said


def test_a_calibration_of_other_recordings_is_refused(pedestal):
    bag = pathlib.Path(__file__).parents[1] / 'bags' / 'reference' / 'leo_pass'
    code, _, said = pedestal('calibrate', 'receiver', '--bag', bag, '--iq', 'samples.sigmf-meta')
    assert code == 2 and '--iq: the receiver of this recording had no I/Q samples' in said
    code, _, said = pedestal('calibrate', 'receiver', '--bag', bag, '--iq', 'a.sigmf-meta', '--param', 'acu.period=1')
    assert code == 2 and '--param: has no effect with --bag' in said


@pytest.mark.thorough
def test_samples_at_full_scale_are_named(start_node, connect, tmp_path):
    count = 10 * round(RATE)
    carrier = 40e3 * np.exp(2j * math.pi * OFFSET_HZ / RATE * np.arange(count))
    parts = (carrier[:, np.newaxis] * [1.0, 0.1, 0.1]).view(float)
    (tmp_path / 'a.sigmf-data').write_bytes(np.clip(np.rint(parts), -32768, 32767).astype('<i2').tobytes())
    (tmp_path / 'a.sigmf-meta').write_text(json.dumps({
        'global': {'core:datatype': 'ci16_le', 'core:sample_rate': RATE, 'core:version': '1.0.0',
                   'core:num_channels': 3}, 'captures': [{'core:sample_start': 0}], 'annotations': []}))
    values = {**VALUES, 'source.kind': 'sigmf', 'source.address': tmp_path / 'a.sigmf-meta'}
    node = start_node('monopulse', *(part for key, value in values.items() for part in ('-p', f'{key}:={value}')))
    client = connect(node.domain_id)
    client.read('diagnostics')
    client.diagnosed('samples are at full scale: the signal is too strong for the front end')


def test_lockstep_and_the_simulated_receiver_have_no_samples(pedestal):
    code, _, said = pedestal('run', 'leo_pass', '--receiver', 'simulated-iq', '--pacing', 'lockstep')
    assert code == 2 and 'must be realtime for a receiver of I/Q samples' in said
    code, _, said = pedestal('run', 'leo_pass', '--param', 'tracking_receiver.source.rate=1e5')
    assert code == 2 and 'source.rate' in said
    slow = ('adu.period=0.002', 'tracking_receiver.feed.kind=conical_scan', 'tracking_receiver.feed.scan_rate=2')
    code, _, said = pedestal('run', 'leo_pass', '--pacing', 'realtime', '--receiver', 'simulated-iq',
                             *(word for change in slow for word in ('--param', change)))
    assert code == 2 and 'feed.scan_rate = 2 Hz: its errors are up to 0.253 s old, must be at most 0.12 s' in said
    code, _, said = pedestal('simulate', 'receiver', '--output', 'a.sigmf-meta', '--address', 'udp://127.0.0.1:4991')
    assert code == 2 and '--address udp://127.0.0.1:4991: has no effect with --output' in said
    code, _, said = pedestal('recompute', 'bag', '--iq', 'a.sigmf-meta', '--param', 'calibration.x_from_x_gain=2')
    assert code == 2 and '--param: has no effect with --iq' in said


@pytest.mark.thorough
def test_samples_of_a_scenario_are_written_and_streamed(pedestal, tmp_path, start_node, connect):
    arguments = ('--duration', '2', '--param', f'tracking_receiver.source.rate={RATE}', '--param', 'adu.period=0.02',
                 '--param', 'iq.simulated.carrier=1e9')
    code, said, _ = pedestal('simulate', 'receiver', '--output', 'pass.sigmf-meta', *arguments)
    assert code == 0 and f'{101 * BLOCK} samples of each channel' in said
    values = {**VALUES, 'source.kind': 'sigmf', 'source.address': tmp_path / 'pass.sigmf-meta'}
    node = start_node('monopulse', *(part for key, value in values.items() for part in ('-p', f'{key}:={value}')))
    client = connect(node.domain_id)
    client.read(ERROR)
    locked(client)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(('127.0.0.1', 0))
        address = f'udp://127.0.0.1:{receiver.getsockname()[1]}'
        code, said, _ = pedestal('simulate', 'receiver', '--stream', 'vita49', '--address', address, *arguments,
                                 '--param', 'tracking_receiver.source.format=cf32')
        assert code == 0 and address in said
        packet = vita49.decode(receiver.recv(vita49.MAX_PACKET_BYTES), 'cf32')
    recorded = next(sigmf.Recording(tmp_path / 'pass.sigmf-meta', CHANNELS, RATE).chunks())
    assert np.array_equal(packet.samples, recorded.samples[:len(packet.samples), packet.stream - 1])
