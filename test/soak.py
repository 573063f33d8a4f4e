"""Lets a realtime graph run for long and says what became of its memory, its steps and its latency.

    python test/soak.py [--hours 2] [--scenario leo_pass]

Memory is the resident set of each process, looked at every 10 s; latency is from the publication of joint_states(t_k)
to that of rate_command(t_k), by the writers' clocks, from the recording. Give it a ROS_DOMAIN_ID of its own.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import numpy as np
from kills import children

from pedestal_bringup.bags import bag as bags

EDGES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 50.0, np.inf)
"""Of the histogram of latencies [ms]."""


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
    parser.add_argument('--scenario', default='leo_pass')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bag, rows = pathlib.Path(folder) / 'soak', pathlib.Path(folder) / 'rows.json'
        process = subprocess.Popen([sys.executable, '-m', 'pedestal_bringup.cli', 'run', options.scenario, '--pacing',
                                    'realtime', '--duration', str(3600.0 * options.hours), '--bag', str(bag), '--json',
                                    str(rows)], stdout=subprocess.DEVNULL)
        sizes = watched(process)
        if process.returncode != 0:
            return 1
        results = {row['metric']: row['value'] for row in json.loads(rows.read_text())['rows']}
        delays = latencies(bags.read(bag))
    print(f'{options.hours:g} h of {options.scenario}, {len(delays)} steps answered, lost {results["lost_steps"]:g}, '
          f'restarts {results["restarts"]:g}')
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
