"""`pedestal bench`: ratios measured in one run on this machine, each against its floor."""
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import llvmlite.binding
import numba
import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from rich.console import Console
from rich.table import Table

from acu_tracker.estimation import axis_filter, unscented
from acu_tracker.estimation.measurement import AxisMeasurement, AxisVariances, Estimate, Measurement
from acu_tracker.estimation.params import FilterParameters, UkfParameters
from acu_tracker.geometry.motion import AxisMotion, Motion
from adu_drive import axis, drive_unit
from adu_drive.params import AduParameters
from pedestal_bringup.again import recompute, replay
from pedestal_bringup.bags import bag
from pedestal_bringup.bags.verify import verify
from pedestal_bringup.bench import bare_ring, solve_ivp_axis
from pedestal_bringup.run import closed_loop, graph, scenario
from pedestal_common import messages
from pedestal_common.compiled import compiled
from pedestal_common.parameters import build

ROUNDS = 3
RING_STEPS = 3000
RUN_SECONDS = 15.0
LATENCY_SECONDS = 10.0
CORE_SECONDS = 20.0
BAG_SECONDS = 30.0
TRAFFIC = 5.0
"""Times the traffic of the demo in real time that the recorder is given."""
DISK_BYTES = 200_000_000


def row(case, metric, value, unit, target=None):
    return {'case': case, 'metric': metric, 'value': value, 'unit': unit, 'paper': None, 'target': target}


def show(title, rows):
    table = Table(title=title, title_justify='left')
    for column in ('case', 'metric', 'value', 'unit', 'target'):
        table.add_column(column, justify='right' if column in ('value', 'target') else 'left')
    for r in rows:
        table.add_row(r['case'], r['metric'], f'{r["value"]:.4g}', r['unit'], r['target'] or '')
    Console().print(table)


def bare_lap():
    """Lap time [us] of the bare ring: as many processes, the same messages, no work."""
    processes = {role: subprocess.Popen([sys.executable, '-m', bare_ring.__name__, role, str(RING_STEPS)],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                 for role in bare_ring.ROLES}
    try:
        said, complaint = processes['adu'].communicate(timeout=120.0)
    except subprocess.TimeoutExpired:
        raise RuntimeError('the bare ring did not close within 120 s') from None
    finally:
        for process in processes.values():
            process.kill()
            process.wait()
    if not said:
        raise RuntimeError(f'the bare ring failed: {complaint.strip()}')
    return json.loads(said.splitlines()[-1])['lap_us']


def graph_run(folder, number, pacing, seconds):
    """(Outcome, bag folder) of a run of the demo scenario."""
    path = pathlib.Path(folder) / f'run-{number}'
    return graph.run(scenario.load('leo_pass', pacing=pacing, duration=seconds), path, lambda seconds: None), path


def latencies(path):
    """Wall-clock times [s] from the publication of joint_states(t_k) to that of rate_command(t_k), a realtime bag."""
    sent = {topic: {log: published for _, log, published, _ in bag.read(path).raw(topic)}
            for topic in ('joint_states', 'acu/rate_command')}
    return np.array([(published - sent['joint_states'][stamp]) * 1e-9
                     for stamp, published in sent['acu/rate_command'].items() if stamp in sent['joint_states']])


def bench_graph():
    """Lap of the lockstep graph against the bare ring, interleaved; latency in realtime."""
    bare, laps, factors = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(ROUNDS):
            bare.append(bare_lap())
            outcome, _ = graph_run(folder, number, 'lockstep', RUN_SECONDS)
            laps.append(outcome.drive['wall_s'] / outcome.drive['steps'] * 1e6)
            factors.append(outcome.drive['realtime_factor'])
        outcome, path = graph_run(folder, 'realtime', 'realtime', LATENCY_SECONDS)
        latency = latencies(path)
    lap, floor = statistics.median(laps), statistics.median(bare)
    rows = [row('graph', 'lap_us', lap, 'us'), row('graph', 'bare_ring_us', floor, 'us'),
            row('graph', 'ratio', lap / floor, '', '<= 1.6'),
            row('graph', 'realtime_factor', statistics.median(factors), '', '>= 4'),
            row('realtime', 'latency_p50_us', float(np.percentile(latency, 50)) * 1e6, 'us'),
            row('realtime', 'latency_p99_us', float(np.percentile(latency, 99)) * 1e6, 'us'),
            row('realtime', 'lost_steps', outcome.drive['lost_steps'], '')]
    show(f'lockstep ring, median of {ROUNDS} interleaved rounds, {len(os.sched_getaffinity(0))} cores', rows)
    return rows


def best_of(function, repeats=5):
    """Shortest wall time [s] of some calls."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        function()
        times.append(time.perf_counter() - begun)
    return min(times)


SUBSTEPS = 2 * 100
"""Plant sub-steps of both axes in one drive step of 5 ms."""
SOLVE_IVP_TICKS = 100


@compiled
def _drive_steps(state, constants, inputs, outputs, count):
    for _ in range(count):
        drive_unit.step(state[0], constants[0], inputs[0], outputs[0])


FILTER_STEPS = 20_000
FILTERPY_STEPS = 500
FILTER_PERIOD = 0.01


def filter_step(kind):
    """Time [us] of one prediction and correction of an axis_filter kind on a noisy ramp."""
    constants = axis_filter.constants(build(FilterParameters, {'kind': kind}))
    t = FILTER_PERIOD * np.arange(FILTER_STEPS)
    y = 0.02 * t + 5e-4 * np.random.default_rng(1).standard_normal(FILTER_STEPS)
    variance, state = np.full(FILTER_STEPS, 2.5e-7), np.zeros(1, axis_filter.FILTER)
    _filter_steps(state, constants, t, y, variance)
    return best_of(lambda: _filter_steps(state, constants, t, y, variance)) / FILTER_STEPS * 1e6


@compiled
def _filter_steps(state, constants, t, y, R):
    f, c = state[0], constants[0]
    axis_filter.start(f, c, y[0], R[0], 0.1)
    for k in range(1, len(y)):
        axis_filter.predict(f, c, t[k] - t[k - 1])
        axis_filter.correct(f, c, AxisMeasurement(y[k], R[k], math.nan, math.nan))


def unscented_step():
    """Time [us] of one prediction and correction of both Cartesian filters, azimuth, elevation and range measured."""
    state, constants = np.zeros(1, unscented.STATE), unscented.constants(UkfParameters())
    noise = np.random.default_rng(1).standard_normal((FILTER_STEPS, 3)) * (5e-4, 5e-4, 1.0)
    measured = noise + np.outer(FILTER_PERIOD * np.arange(FILTER_STEPS), (0.001, 0.0, 0.0)) + (0.0, 0.3, 500.0)
    _unscented_steps(state, constants, measured)
    return best_of(lambda: _unscented_steps(state, constants, measured)) / FILTER_STEPS * 1e6


@compiled
def _unscented_steps(state, constants, measured):
    s, c = state[0], constants[0]
    R = 2.5e-7
    known = AxisVariances(R, 0.0, 0.01)
    first = Estimate(Motion(AxisMotion(0.0, 0.0, 0.0), AxisMotion(0.3, 0.0, 0.0)), (known, known))
    unscented.start(s, c, first, 500.0, 1.0)
    for k in range(len(measured)):
        A, E, r = measured[k]
        unscented.predict(s, c, FILTER_PERIOD)
        m = Measurement(0.0, (AxisMeasurement(A, R, math.nan, math.nan), AxisMeasurement(E, R, math.nan, math.nan)),
                        r, 1.0)
        unscented.innovation(s, m)
        unscented.correct(s, m)


def filterpy_unscented():
    """filterpy's IMMEstimator of two UnscentedKalmanFilter of nine states, three numbers measured."""
    def one():
        made = UnscentedKalmanFilter(
            9, 3, FILTER_PERIOD, lambda x: np.array([np.arctan2(x[0], x[1]), np.arctan2(x[2], np.hypot(x[0], x[1])),
                                                     np.linalg.norm(x[:3])]),
            lambda x, dt: F @ x, MerweScaledSigmaPoints(9, unscented.ALPHA, unscented.BETA, unscented.KAPPA))
        made.x = np.array([0.0, 478.0, 148.0, 0.5, *np.zeros(5)])
        made.Q, made.R = 0.01 * np.eye(9), np.diag([2.5e-7, 2.5e-7, 1.0])
        return made

    T = FILTER_PERIOD
    F = np.kron([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]], np.eye(3))
    return IMMEstimator([one(), one()], np.full(2, 0.5), np.array([[0.998, 0.002], [0.002, 0.998]]))


def filterpy_steps():
    """Times [us] of predict and update of filterpy's KalmanFilter of three states, and of IMMEstimator of three such
    and of two unscented filters."""
    def three():
        made = KalmanFilter(3, 1)
        made.F = np.array([[1.0, FILTER_PERIOD, 0.5 * FILTER_PERIOD**2], [0.0, 1.0, FILTER_PERIOD], [0.0, 0.0, 1.0]])
        made.H, made.R, made.Q = np.array([[1.0, 0.0, 0.0]]), np.array([[2.5e-7]]), 1e-6 * np.eye(3)
        return made

    def run(estimator, measured):
        for _ in range(FILTERPY_STEPS):
            estimator.predict()
            estimator.update(measured)

    chain = 0.001 + 0.997 * np.eye(3)
    angle = np.zeros((1, 1))
    cases = ((three(), angle), (IMMEstimator([three() for _ in range(3)], np.full(3, 1 / 3), chain), angle),
             (filterpy_unscented(), np.array([0.0, 0.3, 500.0])))
    return [best_of(lambda case=case: run(*case), 3) / FILTERPY_STEPS * 1e6 for case in cases]


def filter_rows():
    """One step of one filter, of three interacting and of two unscented ones, against filterpy's in the same run."""
    steps = filter_step('current_statistical'), filter_step('imm'), unscented_step()
    rows = []
    for metric, ours, target, theirs in zip(('kalman', 'imm3', 'imm_ukf'), steps, ('<= 2', '<= 10', None),
                                            filterpy_steps()):
        rows += [row('core', f'{metric}_step_us', ours, 'us', target),
                 row('filterpy', f'{metric}_step_us', theirs, 'us'),
                 row('filterpy', f'{metric}_ratio', theirs / ours, '')]
    return rows


def bench_core():
    """The compiled core against its targets and against the same axis through scipy."""
    params = AduParameters(initial_elevation=0.7)
    state, constants = drive_unit.initial_state(params), drive_unit.constants(params)
    inputs, outputs = np.zeros(1, drive_unit.INPUTS), np.zeros(1, drive_unit.OUTPUTS)
    inputs['azimuth']['rate'], inputs['elevation']['rate'], inputs['enable'] = 0.02, -0.01, 1
    _drive_steps(state, constants, inputs, outputs, 200)
    count = 500
    substep = best_of(lambda: _drive_steps(state, constants, inputs, outputs, count)) / count / SUBSTEPS * 1e9

    loop = scenario.load('ship_pass', duration=CORE_SECONDS)
    closed_loop.Loop(loop).run()
    loops = [closed_loop.Loop(loop) for _ in range(5)]
    factor = CORE_SECONDS / best_of(lambda: loops.pop().run())

    tick = axis.CURRENT_PERIOD
    scipy_time = best_of(lambda: solve_ivp_axis.run(params.azimuth, SOLVE_IVP_TICKS, tick, (5.0, 5.0)), 3)
    scipy_substep = scipy_time / SOLVE_IVP_TICKS / 2 * 1e9
    rows = [row('core', 'substep_ns', substep, 'ns', '<= 45'),
            row('core', 'realtime_factor', factor, '', '>= 200'),
            row('solve_ivp', 'substep_ns', scipy_substep, 'ns'),
            row('solve_ivp', 'ratio', scipy_substep / substep, ''), *filter_rows()]
    show(f'compiled core, one core of {llvmlite.binding.get_host_cpu_name()}, numba {numba.__version__}', rows)
    return rows


def recorded(path, again, rate):
    """(messages/s, lost, CPU time over wall time) of a recorder given a bag's messages, rate times real time."""
    with open(pathlib.Path(again).with_suffix('.log'), 'w+') as log:
        recorder = subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.recorder_node', '--ros-args',
                                     '--params-file', str(path.with_name(path.name + '.log') / 'parameters.yaml'),
                                     '-p', f'recorder:bag:={again}'], stdout=log, stderr=subprocess.STDOUT)
        begun = []
        try:
            outcome = replay.replay(path, [], [], rate, ready=lambda: begun.extend((time.perf_counter(), _cpu_time(
                recorder.pid))))
            if outcome.ended != 'whole':
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
    said = json.loads(lines[-1])
    return said['messages'] / wall, said['lost'], (used.ru_utime + used.ru_stime - begun[1]) / wall


def _cpu_time(pid):
    """CPU time [s] a process has used."""
    fields = pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def disk_rate(folder):
    """Bytes/s that a file of the folder takes, all of it on the disk in the end."""
    block = os.urandom(1_000_000)

    def fill():
        with open(pathlib.Path(folder) / 'block', 'wb', buffering=0) as file:
            for _ in range(DISK_BYTES // len(block)):
                file.write(block)
            os.fsync(file.fileno())
    return DISK_BYTES / best_of(fill, 3)


def bench_bag():
    """The recorder under five times the demo's traffic, verify and recompute, against disk and deserialisation."""
    with tempfile.TemporaryDirectory() as folder:
        _, path = graph_run(folder, 'demo', 'lockstep', BAG_SECONDS)
        rate, lost, load = recorded(path, f'{folder}/paced', TRAFFIC)
        limit, lost_at_limit, _ = recorded(path, f'{folder}/flooded', 1e6)
        content = bag.read(path)
        raw = [(content.topics[name], data) for name, _, _, data in content.raw()]
        count, size = len(raw), content.file.stat().st_size
        checked = count / best_of(lambda: verify(path), 3)
        scanned = count / best_of(lambda: bag.read(path), 3)
        read = count / best_of(lambda: [messages.deserialize(data, kind) for kind, data in raw], 3)
        disk = disk_rate(folder)
        factor = statistics.median(recompute.measure(path) for _ in range(ROUNDS))
    rows = [row('record', 'messages_per_s', rate, '1/s'), row('record', 'lost', lost, '', '0'),
            row('record', 'cpu_percent', 100.0 * load, '%'),
            row('record', 'bytes_per_message', size / count, 'B'),
            row('record', 'cdr_bytes_per_message', sum(len(data) for _, data in raw) / count, 'B'),
            row('record', 'limit_messages_per_s', limit, '1/s'), row('record', 'limit_lost', lost_at_limit, '', '0'),
            row('record', 'disk_messages_per_s', disk / (size / count), '1/s'),
            row('verify', 'messages_per_s', checked, '1/s'),
            row('verify', 'scan_messages_per_s', scanned, '1/s'),
            row('verify', 'deserialise_messages_per_s', read, '1/s'),
            row('recompute', 'realtime_factor', factor, '', '>= 100')]
    show(f'bags: {count} messages of the demo, {BAG_SECONDS:g} s, recorded again at {TRAFFIC:g} x real time', rows)
    print(f'record: given all at once, the recorder and whoever feeds it reach {limit:.0f} messages/s, '
          f'{limit * BAG_SECONDS / count:.0f} x the demo; the disk ({disk / 1e6:.0f} MB/s) would take '
          f'{disk * count / size:.0f}.\n'
          f'The limit is their own work per message, at {limit * size / count / disk:.2%} of the disk.\n'
          f'verify: {checked / scanned:.0%} of what finding the messages in the file allows; to deserialise them all '
          f'would allow {read:.0f} messages/s.')
    return rows


BENCHES = {'core': bench_core, 'graph': bench_graph, 'bag': bench_bag}
