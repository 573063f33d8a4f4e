"""Benchmark `pedestal bench bag`: message rates of recorder, verify and recompute on this machine.

For comparison the benchmark measures the write rate of the disk and the rate of deserialisation alone.
"""
import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

from pedestal_common.node.run import command
from pedestal_common.quantities import Seconds
from pedestal_common.wire import messages
from pedestal_recording import bag
from pedestal_recording.verify import verify
from pedestal_results.intervals import single
from pedestal_studies.bench import Measured, best_of
from pedestal_studies.bench.lockstep import graph_run
from pedestal_workbench.again import recompute, replay

ROUND_COUNT = 3  # number of measurements of recompute, of which the median counts
BAG_DURATION_S = 30.0  # simulated duration of the run whose bag is used [s]
TRAFFIC_FACTOR = 5.0  # speed at which the bag of the run is replayed to the recorder, as a multiple of real time
DISK_TEST_BYTES = 200_000_000  # size of the file that is written for the rate of the disk [bytes]


def measure_recorder(path: pathlib.Path, again: str, rate: float) -> tuple[float, int, float]:
    """Return (messages/s, number of lost messages, CPU time over wall time) of a recorder that receives a replayed
    bag; again: its new bag; rate: multiple of real time."""
    with open(pathlib.Path(again).with_suffix('.log'), 'w+') as log:
        recorder = subprocess.Popen(
            command('recorder_node', '--ros-args', '--params-file',
                    str(path.with_name(path.name + '.log') / 'parameters.yaml'), '-p', f'recorder:bag:={again}'),
            stdout=log, stderr=subprocess.STDOUT)
        begun: list[float] = []     # wall time and CPU time of the recorder at the first message
        try:
            result = replay.replay(path, replay.ReplayOptions(rate=rate), lambda: begun.extend(
                (time.perf_counter(), _cpu_time(recorder.pid))))
            if result.ended != 'whole':     # Ctrl-C ended the replay, so it ends the benchmark too.
                raise KeyboardInterrupt
            _, status, used = os.wait4(recorder.pid, 0)
            wall = time.perf_counter() - begun[0]
            recorder.returncode = os.waitstatus_to_exitcode(status)
        finally:
            if recorder.returncode is None:
                recorder.kill()
                recorder.wait()
        log.seek(0)
        lines = log.read().splitlines()
    if recorder.returncode:
        raise RuntimeError(f'the recorder failed: {lines[-1] if lines else recorder.returncode}')
    report = json.loads(lines[-1])
    return report['messages'] / wall, report['lost'], (used.ru_utime + used.ru_stime - begun[1]) / wall


def _cpu_time(pid: int) -> Seconds:
    # The fields after the name in parentheses; utime and stime are the 12th and 13th of them (proc(5)).
    fields = pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    user_ticks, system_ticks = map(int, fields[11:13])
    return (user_ticks + system_ticks) / os.sysconf('SC_CLK_TCK')


def disk_rate(folder: str) -> float:
    """Return the rate [bytes/s] at which a file in the folder is written, until all bytes are on the disk."""
    block = os.urandom(1_000_000)

    def fill() -> None:
        with open(pathlib.Path(folder) / 'block', 'wb', buffering=0) as file:
            for _ in range(DISK_TEST_BYTES // len(block)):
                file.write(block)
            os.fsync(file.fileno())
    return DISK_TEST_BYTES / best_of(fill, 3)


def run() -> Measured:
    """Measure the recorder at TRAFFIC_FACTOR and at unlimited rate, verify, recompute."""
    with tempfile.TemporaryDirectory() as folder:
        _, path = graph_run(folder, 'demo', 'lockstep', BAG_DURATION_S)
        rate, lost, load = measure_recorder(path, f'{folder}/paced', TRAFFIC_FACTOR)
        limit, lost_at_limit, _ = measure_recorder(path, f'{folder}/flooded', 1e6)
        content = bag.read(path)
        raw = [(content.topics[name], data) for name, _, _, data in content.raw()]
        count, size = len(raw), content.file.stat().st_size
        checked = count / best_of(lambda: verify(bag.load(path)), 3)
        scanned = count / best_of(lambda: bag.read(path), 3)
        read = count / best_of(lambda: [messages.deserialize(data, kind) for kind, data in raw], 3)
        disk = disk_rate(folder)
        factor = statistics.median(recompute.measure(path) for _ in range(ROUND_COUNT))
    rows = [single('record', 'messages_per_s', rate, '1/s'), single('record', 'lost', lost, '', '0'),
            single('record', 'cpu_percent', 100.0 * load, '%'),
            single('record', 'bytes_per_message', size / count, 'B'),
            single('record', 'cdr_bytes_per_message', sum(len(data) for _, data in raw) / count, 'B'),
            single('record', 'limit_messages_per_s', limit, '1/s'),
            single('record', 'limit_lost', lost_at_limit, '', '0'),
            single('record', 'disk_messages_per_s', disk / (size / count), '1/s'),
            single('verify', 'messages_per_s', checked, '1/s'),
            single('verify', 'scan_messages_per_s', scanned, '1/s'),
            single('verify', 'deserialise_messages_per_s', read, '1/s'),
            single('recompute', 'realtime_factor', factor, '', '>= 100')]
    return Measured(
        f'bags: {count} messages of the demo, {BAG_DURATION_S:g} s, recorded again at {TRAFFIC_FACTOR:g} x real time',
        rows,
        f'record: with unlimited rate, the publisher and the recorder together reach {limit:.0f} messages/s, '
        f'{limit * BAG_DURATION_S / count:.0f} x the demo. The disk ({disk / 1e6:.0f} MB/s) could store '
        f'{disk * count / size:.0f} messages/s.\n'
        'The work per message of these two processes is the limit, at '
        f'{limit * size / count / disk:.2%} of the rate of the disk.\n'
        f'verify: {checked / scanned:.0%} of the rate at which the messages are found in the file. Deserialisation '
        f'of all messages would allow {read:.0f} messages/s.')
