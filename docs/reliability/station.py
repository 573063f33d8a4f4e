"""A realtime graph of single nodes that are started, stopped and killed by hand, as on a permanent station."""
import os
import pathlib
import signal
import subprocess
import sys
import time

import yaml

from pedestal_bringup.run import scenario
from pedestal_common import nodes
from pedestal_common.steps import SECOND

NODES = ('tracking_receiver', 'acu', 'adu')


class Station:
    """Nodes of a scenario ashore in realtime, its time 0 at `start` [ns UTC]. changes: texts node.key=value."""

    def __init__(self, folder, domain_id, name='leo_pass', changes=(), start=None):
        self.folder, self.domain_id = pathlib.Path(folder), domain_id
        self.scenario = scenario.load(name, changes)
        self.start_time = time.time_ns() // SECOND * SECOND if start is None else start
        self.processes = {}
        self.file = self.folder / 'parameters.yaml'
        told = {'graph.nodes': 'tracking_receiver,acu,adu,operator', 'graph.start': self.start_time}
        given = {node: {**self.scenario.given(node), **told} for node in NODES}
        given['adu']['duration'] = 0.0    # it runs until it is told to stop
        self.file.write_text(yaml.safe_dump({node: {'ros__parameters': values} for node, values in given.items()}))
        self.environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain_id), 'ROS_LOG_DIR': str(self.folder / 'ros_log')}

    def start(self, *names):
        """Start nodes, again if they have ended."""
        for node in names:
            with open(self.folder / f'{node}.log', 'ab') as log:
                self.processes[node] = subprocess.Popen(
                    [sys.executable, '-m', nodes.row(node).module, '--ros-args', '--params-file', str(self.file)],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=self.environment, cwd=self.folder,
                    start_new_session=True)

    def signal(self, node, number):
        self.processes[node].send_signal(number)

    def kill(self, node):
        self.signal(node, signal.SIGKILL)
        self.processes[node].wait()

    def alive(self):
        """The nodes that run."""
        return {node for node, process in self.processes.items() if process.poll() is None}

    def log(self, node):
        return (self.folder / f'{node}.log').read_text(errors='replace')

    def close(self):
        for process in self.processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
