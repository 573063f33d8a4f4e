"""Benchmark `pedestal bench graph`: lap time of the graph in lockstep, and latency of the graph in realtime.

A lap is one step of the lockstep.
"""
import contextlib
import os
import pathlib
import statistics
import tempfile

import numpy as np

from pedestal_bringup.graph import graph
from pedestal_bringup.graph.start import Outcome
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.program import Plan
from pedestal_common.quantities import Floats, Seconds
from pedestal_recording import bag
from pedestal_results.intervals import single
from pedestal_studies.bench import Measured

ROUND_COUNT = 3  # number of runs in lockstep, of which the median counts
RUN_DURATION_S, LATENCY_DURATION_S = 15.0, 10.0  # of the graph in lockstep and in realtime [s]


def graph_run(folder: str, number: int | str, pacing: str, seconds: Seconds) -> tuple[Outcome, pathlib.Path]:
    """Return (outcome, bag folder) of a run of the demo scenario."""
    path = pathlib.Path(folder) / f'run-{number}'
    chosen = scenario.load('leo_pass', pacing=pacing, duration=seconds)
    return graph.run(Plan(chosen), path, contextlib.nullcontext(lambda seconds: None)), path


def lap(folder: str, number: int) -> tuple[float, float]:
    """Return the lap time [us] and the real-time factor of a run of the graph in lockstep."""
    drive = graph_run(folder, number, 'lockstep', RUN_DURATION_S)[0].drive
    return drive['wall_s'] / drive['steps'] * 1e6, drive['realtime_factor']


def latencies(path: pathlib.Path) -> Floats:
    """Return the latencies [s] of the graph in a bag, by the wall clock: from the publication of joint_states to that
    of the acu/rate_command with the same stamp."""
    sent = {topic: {log: published for _, log, published, _ in bag.read(path).raw(topic)}
            for topic in ('joint_states', 'acu/rate_command')}
    return np.array([(published - sent['joint_states'][stamp]) * 1e-9
                     for stamp, published in sent['acu/rate_command'].items() if stamp in sent['joint_states']])


def run() -> Measured:
    """Run the benchmark."""
    with tempfile.TemporaryDirectory() as folder:
        laps, factors = zip(*(lap(folder, number) for number in range(ROUND_COUNT)))
        result, path = graph_run(folder, 'realtime', 'realtime', LATENCY_DURATION_S)
        latency = latencies(path)
    rows = [single('graph', 'lap_us', statistics.median(laps), 'us'),
            single('graph', 'realtime_factor', statistics.median(factors), '', '>= 4'),
            single('realtime', 'latency_p50_us', float(np.percentile(latency, 50)) * 1e6, 'us'),
            single('realtime', 'latency_p99_us', float(np.percentile(latency, 99)) * 1e6, 'us'),
            single('realtime', 'lost_steps', result.drive['lost_steps'], '')]
    return Measured(f'lockstep ring, median of {ROUND_COUNT} runs, {len(os.sched_getaffinity(0))} cores', rows)
