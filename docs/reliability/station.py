"""A realtime graph of single nodes that are started, stopped and killed by hand, as on a permanent station."""
import os
import pathlib
import signal
import subprocess
import time

import yaml

from pedestal_bringup.graph import processes
from pedestal_bringup.scenario import scenario
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.steps import NS_PER_SECOND

NODES = ('tracking_receiver', 'acu', 'adu')
"""Of a station ashore with one antenna."""


def reads(chosen, node):
    """The topics that a node of a Scenario hears from others, as the graph names them."""
    told = chosen.node_parameters(node)
    heard = nodes.reads(chosen.row(node), chosen.nodes, [flag for flag in topics.TOPIC_FLAGS
                                                         if getattr(told, flag, False)])
    return [link.name for link in nodes.links(chosen.header.graph_beams).values()
            if node in link.readers and nodes.plain(link.name) in heard]


class Station:
    """The nodes of a scenario in realtime, its time 0 at `start` [ns UTC]. changes: texts node.key=value.

    nodes: all of them but the operator and the recorder, in the order in which they are started.
    """

    def __init__(self, folder, domain_id, name='leo_pass', changes=(), start=None):
        self.folder, self.domain_id = pathlib.Path(folder), domain_id
        self.scenario = scenario.load(name, changes)
        self.nodes = tuple(node for node in self.scenario.nodes if node not in ('operator', 'recorder'))
        self.start_time = time.time_ns() // NS_PER_SECOND * NS_PER_SECOND if start is None else start
        self.processes = {}
        self.file = self.folder / 'parameters.yaml'
        names = dict.fromkeys(map(nodes.plain, (*self.nodes, 'operator')))
        told = {'graph.nodes': ','.join(names), 'graph.beams': self.scenario.header.graph_beams,
                'graph.priority': self.scenario.header.priority, 'graph.start': self.start_time,
                'graph.simulated': True}
        given = {node: {**self.scenario.given(node), **told} for node in (*self.nodes, 'recorder')}
        given[nodes.DRIVE_NODE]['duration'] = given['recorder']['duration'] = 0.0    # until they are told to stop
        given['recorder']['bag'] = str(self.folder / 'bag')
        self.file.write_text(yaml.safe_dump({node: {'ros__parameters': values} for node, values in given.items()}))
        self.environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain_id), 'ROS_LOG_DIR': str(self.folder / 'ros_log')}

    def start(self, *names):
        """Start nodes, again if they have ended."""
        for node in names:
            with open(self._log_of(node), 'ab') as log:
                self.processes[node] = subprocess.Popen(
                    processes.command_line(node, self.scenario.row(node).executable, self.file),
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

    def _log_of(self, node):
        return self.folder / f'{node.replace("/", ".")}.log'

    def log(self, node):
        return self._log_of(node).read_text(errors='replace')

    def close(self):
        for process in self.processes.values():
            if process.poll() is None:
                process.kill()
            process.wait()
