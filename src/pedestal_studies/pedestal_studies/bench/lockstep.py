"""Benchmark `pedestal bench graph`: lap time of the graph in lockstep, and latency of the graph in realtime.

A lap is one step of the lockstep. Its lower bound is the lap of the bare ring (bare_ring.py), whose nodes compute
nothing. Runs of the graph and of the bare ring alternate, so that other load of the machine affects both alike.
"""
import contextlib
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

import numpy as np

from pedestal_bringup.graph import graph
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_recording import bag
from pedestal_results.results import row
from pedestal_studies.bench import bare_ring
from pedestal_studies.bench.table import show

ROUND_COUNT = 3  # number of rounds; a round is a run of the bare ring and a run of the graph
RING_STEPS = 3000  # measured laps of the bare ring in a round, as many as steps of 5 ms in RUN_DURATION_S
RUN_DURATION_S, LATENCY_DURATION_S = 15.0, 10.0
"""Simulated durations of a run of the graph in lockstep and in realtime [s]."""


def bare_lap():
    """Return the lap time [us] of the bare ring: as many processes and the same messages, without any work."""
    processes = {role: subprocess.Popen([sys.executable, '-m', bare_ring.__name__, role, str(RING_STEPS)],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                 for role in bare_ring.RING_NODES}
    try:
        output, error_text = processes['adu'].communicate(timeout=120.0)
    except subprocess.TimeoutExpired:
        raise RuntimeError('the bare ring did not finish within 120 s') from None
    finally:
        for process in processes.values():
            process.kill()
            process.wait()
    if not output:
        raise RuntimeError(f'the bare ring failed: {error_text.strip()}')
    return json.loads(output.splitlines()[-1])['lap_us']


def graph_run(folder, number, pacing, seconds):
    """Return (start.Outcome, bag folder) of a run of the demo scenario."""
    path = pathlib.Path(folder) / f'run-{number}'
    chosen = scenario.load('leo_pass', pacing=pacing, duration=seconds)
    return graph.run(Plan(chosen), path, contextlib.nullcontext(lambda seconds: None)), path


def latencies(path):
    """Return the latencies (n,) [s] of the graph in a bag, by the wall clock.

    A latency is the time from the publication of joint_states to the publication of the acu/rate_command with the same
    stamp.
    """
    sent = {topic: {log: published for _, log, published, _ in bag.read(path).raw(topic)}
            for topic in ('joint_states', 'acu/rate_command')}
    return np.array([(published - sent['joint_states'][stamp]) * 1e-9
                     for stamp, published in sent['acu/rate_command'].items() if stamp in sent['joint_states']])


def run():
    """Print the table and return its rows."""
    bare, laps, factors = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(ROUND_COUNT):
            bare.append(bare_lap())
            result, _ = graph_run(folder, number, 'lockstep', RUN_DURATION_S)
            laps.append(result.drive['wall_s'] / result.drive['steps'] * 1e6)
            factors.append(result.drive['realtime_factor'])
        result, path = graph_run(folder, 'realtime', 'realtime', LATENCY_DURATION_S)
        latency = latencies(path)
    lap, floor = statistics.median(laps), statistics.median(bare)
    rows = [row('graph', 'lap_us', lap, 'us'), row('graph', 'bare_ring_us', floor, 'us'),
            row('graph', 'ratio', lap / floor, '', '<= 1.25'),
            row('graph', 'realtime_factor', statistics.median(factors), '', '>= 4'),
            row('realtime', 'latency_p50_us', float(np.percentile(latency, 50)) * 1e6, 'us'),
            row('realtime', 'latency_p99_us', float(np.percentile(latency, 99)) * 1e6, 'us'),
            row('realtime', 'lost_steps', result.drive['lost_steps'], '')]
    show(f'lockstep ring, median of {ROUND_COUNT} interleaved rounds, {len(os.sched_getaffinity(0))} cores', rows)
    return rows
