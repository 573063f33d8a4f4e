"""Kills nodes of a running graph at random moments and says how the graph took it.

    python test/kills.py realtime [--kills 200]     in runs of `leo_pass`; each kill is waited out
    python test/kills.py lockstep [--kills 200]     a run for each kill, which ends it by name

Prints the numbers of docs/understand/evidence.md. Give it a ROS_DOMAIN_ID of its own.
"""
import argparse
import collections
import contextlib
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

import rclpy
from shared import PEDESTAL

from pedestal_common.graph import nodes, topics
from pedestal_common.node import middleware
from pedestal_common.wire import messages
from pedestal_recording import bag as bags

ANSWERS = {'adu': 'joint_states', 'tracking_receiver': 'tracking_receiver/angle_error', 'acu': 'acu/rate_command'}
"""{node: a topic that it writes in every step}."""

NODES = (*ANSWERS, 'recorder')

FRESH = 0.1
"""Age [s] up to which the last message of a topic of every step counts as flowing."""

STEADY = 0.3
"""Time [s] for which all must be well before a graph counts as recovered."""

LAST_WORDS = 0.2
"""Time [s] after a kill in which what the dead node had sent still comes in."""

PATIENCE = 60.0
"""Time [s] after which it counts as not recovered, or a run that does not end as hung."""


class Watcher:
    """Hears a graph: when each node spoke last and what mode the ACU is in. Times are those of time.monotonic."""

    def __init__(self, node, executor):
        """node: of rclpy, in the executor."""
        self.heard = dict.fromkeys(NODES, -1e9)
        self.mode = ''
        self._node, self._executor = node, executor
        for node, topic in ANSWERS.items():
            self._listen(topic, lambda _, node=node: self.heard.__setitem__(node, time.monotonic()))
        self._listen('acu/mode', self._on_mode)
        self._listen('diagnostics', self._on_diagnostics)

    def _listen(self, name, take):
        topic = topics.TOPIC_BY_NAME[name]
        self._node.create_subscription(middleware.message_class(topic.type), name, take,
                                       middleware.qos(topic.rate, 'read'), raw=True)

    def _on_mode(self, data):
        self.mode = messages.deserialize(data, 'std_msgs/msg/String').data

    def _on_diagnostics(self, data):
        for status in messages.deserialize(data, 'diagnostic_msgs/msg/DiagnosticArray').status:
            if status.name == 'recorder':
                self.heard['recorder'] = time.monotonic()

    def spin(self, seconds=0.0):
        deadline = time.monotonic() + seconds
        while True:
            self._executor.spin_once(timeout_sec=0.02)
            if time.monotonic() >= deadline:
                return

    def well(self, since):
        """Whether every node has spoken since a time, those of every step just now, and the target is tracked."""
        now = time.monotonic()
        return self.mode == 'autotrack' and all(time > since for time in self.heard.values()) and all(
            now - self.heard[node] < FRESH for node in ANSWERS)

    def recovery(self, since, node='', goes_on=lambda: True):
        """{'own': time until the node spoke again, 'graph': time until all was well} after a kill [s]; None after
        PATIENCE, or when it does not go on."""
        own = begun = None
        while time.monotonic() - since < PATIENCE and goes_on():
            self.spin()
            if own is None and (not node or self.heard[node] > since + LAST_WORDS):
                own = time.monotonic() - since
            if not self.well(since):
                begun = None
            elif begun is None:
                begun = time.monotonic()
            elif time.monotonic() - begun > STEADY:
                return {'own': own, 'graph': begun - since}
        return None

    def forget(self, node):
        """What a killed node said is no news."""
        if node == 'acu':
            self.mode = ''


def children(pid):
    """{node: pid} of the nodes that `pedestal run` runs: direct children, named by their executable."""
    found = {}
    for process in pathlib.Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError, IndexError):
            state, parent = (process / 'stat').read_text().rpartition(')')[2].split()[:2]
            arguments = (process / 'cmdline').read_text().split('\0')
            if int(parent) == pid and state != 'Z' and arguments[2] == 'pedestal_common.node.run':
                found[nodes.EXECUTABLES[arguments[3]].name] = int(process.name)
    return found


def orphans(log):
    """Processes that still run with the parameter file of a run."""
    left = []
    for process in pathlib.Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError):
            if str(log / 'parameters.yaml') in (process / 'cmdline').read_text().split('\0'):
                left.append(int(process.name))
    return left


def started(folder, pacing, *arguments):
    bag = pathlib.Path(folder) / f'run-{time.time_ns()}'
    command = [*PEDESTAL, 'run', 'leo_pass', '--pacing', pacing, '--bag', str(bag), *arguments]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               start_new_session=True)
    return process, bag, bag.with_name(bag.name + '.log')


def ended(process, counts):
    """What a run said when it ended by itself; one that does not is counted and killed."""
    try:
        return process.communicate(timeout=PATIENCE)[1]
    except subprocess.TimeoutExpired:
        counts['hangs'] += 1
        process.kill()
        return process.communicate()[1]


def realtime(kills, seed, folder, victims=NODES, duration=120.0):
    """Kill after kill in runs of `duration` [s]; (counts, {node: [recovery]})."""
    chance, counts, outages = random.Random(seed), collections.Counter(), collections.defaultdict(list)
    middleware.initialise([])
    executor = middleware.make_executor()
    executor.add_node(observer := rclpy.create_node('watcher'))
    watcher = Watcher(observer, executor)
    order = [node for _ in range(kills) for node in chance.sample(victims, len(victims))][:kills]
    while order:
        process, bag, log = started(folder, 'realtime', '--duration', str(duration), '--param',
                                    'scenario.restart.within=1')
        counts['runs'] += 1
        since = time.monotonic()
        if watcher.recovery(since) is None and watcher.recovery(since + PATIENCE) is None:
            process.terminate()
            raise RuntimeError(f'the graph did not begin: {log}: {ended(process, counts)}')
        last = time.monotonic() + duration - 40.0
        while order and time.monotonic() < last and process.poll() is None:
            watcher.spin(chance.uniform(0.0, 2.0))
            node = order.pop()
            running = children(process.pid)
            if node not in running:
                counts['not there'] += 1
                continue
            watcher.forget(node)
            since = time.monotonic()
            os.kill(running[node], signal.SIGKILL)
            counts['kills'] += 1
            recovery = watcher.recovery(since, node, lambda process=process: process.poll() is None)
            if recovery is None and process.poll() is not None:
                counts['run over meanwhile'] += 1
            elif recovery is None:
                counts['unrecovered'] += 1
                print(f'not recovered: {node}, mode {watcher.mode}, heard '
                      f'{ {name: round(time.monotonic() - at, 2) for name, at in watcher.heard.items()} }; {log}',
                      flush=True)
            else:
                outages[node].append(recovery)
                print(f'{node}: it speaks again after {recovery["own"]:.2f} s, all is well after '
                      f'{recovery["graph"]:.2f} s', flush=True)
        if not order and process.poll() is None:
            process.send_signal(signal.SIGTERM)    # a script in the background has SIGINT ignored
        said = ended(process, counts)
        if process.returncode not in (0, 130):
            counts['runs that failed'] += 1
            print(f'{log}: exit code {process.returncode}: {said}', flush=True)
        counts['orphans'] += len(orphans(log))
        print(dict(counts), flush=True)
    observer.destroy_node()
    rclpy.try_shutdown()
    return counts, outages


def lockstep(kills, seed, folder, victims=NODES):
    """A run for each kill: (counts, {})."""
    chance, counts = random.Random(seed), collections.Counter()
    for number in range(kills):
        node = victims[number % len(victims)]
        process, bag, log = started(folder, 'lockstep')
        begun = time.monotonic()
        while node not in children(process.pid):
            if process.poll() is not None or time.monotonic() - begun > PATIENCE:
                process.terminate()
                raise RuntimeError(f'the graph did not begin: {log}: {ended(process, counts)}')
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 8.0))
        victim = children(process.pid).get(node)
        if victim is None:
            counts['over before'] += 1
            ended(process, counts)
            continue
        os.kill(victim, signal.SIGKILL)
        counts['kills'] += 1
        said = ended(process, counts)
        named = process.returncode == 1 and said.startswith(f'pedestal: error: {node} died by signal SIGKILL')
        counts['ended by name'] += named
        if not named:
            print(f'{log}: {node}: exit code {process.returncode}: {said}', flush=True)
        counts['orphans'] += len(orphans(log))
        if any(file.stat().st_size for file in bag.glob('*.mcap')):
            counts['bags'] += 1
            with contextlib.suppress(bags.BagError):
                bags.load(bag)
                counts['bags that can be read'] += 1
        print(f'{node}: {dict(counts)}', flush=True)
    return counts, {}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('pacing', choices=('realtime', 'lockstep'))
    parser.add_argument('--kills', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--nodes', nargs='+', choices=NODES, default=NODES, help='that are killed')
    parser.add_argument('--folder', help='keep the recordings there')
    options = parser.parse_args()
    with contextlib.ExitStack() as stack:
        folder = options.folder or stack.enter_context(tempfile.TemporaryDirectory())
        counts, outages = {'realtime': realtime, 'lockstep': lockstep}[options.pacing](
            options.kills, options.seed, folder, options.nodes)
    print(f'{options.pacing}: ' + ', '.join(f'{name} {count}' for name, count in counts.items()))
    for node, recoveries in sorted(outages.items()):
        for what, key in (('it speaks again', 'own'), ('all is well', 'graph')):
            times = sorted(recovery[key] for recovery in recoveries)
            print(f'{node:20} {len(times):4} kills, until {what}: median {times[len(times) // 2]:.2f} s, longest '
                  f'{times[-1]:.2f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
