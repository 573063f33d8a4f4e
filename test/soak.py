"""Lets a realtime graph run for long and says what became of its memory, its steps and its latency.

    python test/soak.py [--hours 2] [--priority 0] [--bag soak]

A UAV flies ovals beside the antenna, a pass every 87 s, and is to be in its beam throughout. Memory is the resident
set of each process, looked at every 10 s; latency is from the publication of joint_states(t_k) to that of
rate_command(t_k), by the writers' clocks, from the recording. Give it a ROS_DOMAIN_ID of its own.
"""
import argparse
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import numpy as np
from kills import children
from shared import PEDESTAL

from pedestal_recording import bag as bags

EDGES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 50.0, np.inf)
"""Of the histogram of latencies [ms]."""

STRAIGHT, RADIUS, SPEED = 3000.0, 700.0, 60.0
"""Of the ovals [m, m, m/s]."""


def flight(path, seconds):
    """Write a track of ovals, a fix each second."""
    turn = np.pi * RADIUS
    with path.open('w', newline='') as file:
        rows = csv.writer(file)
        rows.writerow(('time_s', 'latitude_deg', 'longitude_deg', 'altitude_m'))
        for t in range(int(seconds) + 10):
            half, along = divmod(SPEED * t, STRAIGHT + turn)
            angle = max(along - STRAIGHT, 0.0) / RADIUS
            east = min(along, STRAIGHT) - STRAIGHT / 2.0 + RADIUS * np.sin(angle)
            north = -RADIUS * np.cos(angle)
            if half % 2:
                east, north = -east, -north
            rows.writerow((t, 47.4 + np.degrees(north / 6.371e6),
                           8.5 + np.degrees(east / 6.371e6 / np.cos(np.radians(47.4))), 900.0))


def resident(pid):
    """Resident set of a process [MB]; None where it is gone."""
    try:
        return int(re.search(r'VmRSS:\s+(\d+)', pathlib.Path(f'/proc/{pid}/status').read_text())[1]) / 1024.0
    except (OSError, TypeError):
        return None


def watched(process):
    """{node: resident set every 10 s} until a run ends."""
    sizes = {}
    while process.poll() is None:
        for node, pid in {**children(process.pid), 'pedestal run': process.pid}.items():
            size = resident(pid)
            if size is not None:
                sizes.setdefault(node, []).append(size)
        time.sleep(10.0)
    return sizes


def latencies(bag):
    """[ms] of every step that was answered."""
    sent = {topic: {stamp: published for _, stamp, published, _ in bag.raw(topic)}
            for topic in ('joint_states', 'acu/rate_command')}
    return np.array([(published - sent['joint_states'][stamp]) * 1e-6
                     for stamp, published in sent['acu/rate_command'].items() if stamp in sent['joint_states']])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--hours', type=float, default=2.0)
    parser.add_argument('--priority', type=int, default=0, help='scenario.priority, 0 to 98')
    parser.add_argument('--bag', type=pathlib.Path, help='keep the recording in this folder')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bag, rows, track = (pathlib.Path(folder) / name for name in ('soak', 'rows.json', 'flight.csv'))
        bag = options.bag or bag
        seconds = 3600.0 * options.hours
        flight(track, seconds)
        process = subprocess.Popen([*PEDESTAL, 'run', 'track_file', '--param',
                                    f'tracking_receiver.target.track_file.path={track}', '--pacing', 'realtime',
                                    '--duration', str(seconds), '--bag', str(bag), '--json', str(rows),
                                    '--param', f'scenario.priority={options.priority}'],
                                   stdout=subprocess.DEVNULL)
        sizes = watched(process)
        if not rows.exists():
            return 1
        results = {row['metric']: row['value'] for row in json.loads(rows.read_text())['rows']}
        delays = latencies(bags.read(bag))
    print(f'{options.hours:g} h, {len(delays)} steps answered, lost {results["lost_steps"]:g}, restarts '
          f'{results["restarts"]:g}, in autotrack for {results["tracked_percent"]:.2f} %, pointing '
          f'{results["pointing_rms_deg"]:.4f} deg rms')
    print(f'{"resident set [MB]":20} {"after 1 min":>12} {"half-way":>10} {"at the end":>10} {"largest":>10}')
    for node, found in sizes.items():
        print(f'{node:20} {found[min(6, len(found) - 1)]:12.1f} {found[len(found) // 2]:10.1f} {found[-2]:10.1f} '
              f'{max(found):10.1f}')
    print(f'latency [ms]: p50 {np.percentile(delays, 50):.2f}, p99 {np.percentile(delays, 99):.2f}, p99.9 '
          f'{np.percentile(delays, 99.9):.2f}, largest {delays.max():.1f}')
    counts, _ = np.histogram(delays, EDGES)
    for low, high, count in zip(EDGES, EDGES[1:], counts):
        print(f'  {low:5.1f} to {high:5.1f}  {count:9}  {100.0 * count / len(delays):7.3f} %')
    return 0


if __name__ == '__main__':
    sys.exit(main())
