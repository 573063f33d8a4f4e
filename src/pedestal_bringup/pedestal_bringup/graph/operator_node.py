"""Operator inside `pedestal run` and `pedestal program`: sends the program tracks, receives the diagnostics."""
import contextlib
import socket
import time

from rcl_interfaces.srv import GetParameters

from pedestal_bringup.graph.processes import RunError
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.node.shell import Shell
from pedestal_common.wire import messages

DISCOVERY_TIME_S = 0.5
"""Time for which a run looks for another graph on its domain before it starts its own [s]."""

SERVICE_TIMEOUT_S = 2.0
"""Time in which a node must answer a parameter service, before it counts as stuck [s]."""


class Operator(Shell):
    """Node that sends the program tracks to a graph of `beams` (nodes.links), and receives its diagnostics.

    names: nodes whose diagnostics count. on_diagnostics(status, monotonic time [s]) is called for each of their
    DiagnosticStatus. time: of the graph, by the newest diagnostics [s]; latest: {node: monotonic time of its newest
    diagnostics [s]}.
    """

    def __init__(self, beams=0, names=()):
        super().__init__('operator', parameters.Parameters)
        self.links = nodes.links(beams)
        self._names = frozenset(names)
        self.time = 0.0
        self.latest = {}
        self.on_diagnostics = lambda status, now: None
        self._publish_by_topic = {}     # {topic: function that publishes bytes}
        self.message_reader('diagnostics', self._note_diagnostics)

    def send(self, tracks):
        """Publish the program tracks {topic: message}, latched."""
        self._open_publishers(tracks)
        for topic, message in tracks.items():
            self._publish_by_topic[topic](messages.serialize(message))

    def send_to(self, names, tracks):
        """Publish the program tracks once all their subscribers are present, and return True if they are published.
        Otherwise a short run might end before its recorder receives them."""
        self._open_publishers(tracks)
        if any(self._missing(publisher, nodes.readers(link, names))
               for link, publisher in self.publishers_by_link.items()):
            return False
        self.send(tracks)
        return True

    def _open_publishers(self, names):
        for name in names:
            if name not in self._publish_by_topic:
                self._publish_by_topic[name] = self.writer(name)

    def check_domain_free(self):
        """Raise RunError when the nodes of another graph are on this domain, because they would receive the messages
        of this one."""
        deadline = time.monotonic() + DISCOVERY_TIME_S
        while time.monotonic() < deadline:
            names = self.get_node_names()
            if names.count(self.name) > 1 or any(node.name in names for node in nodes.NODES if node.module):
                raise another_graph(self.context.get_domain_id())
            time.sleep(0.02)

    def _note_diagnostics(self, array):
        for status in array.status:
            if status.name in self._names:
                self.time = max(self.time, messages.nanoseconds(array.header.stamp) * 1e-9)
                self.latest[status.name] = time.monotonic()
                self.on_diagnostics(status, self.latest[status.name])

    def silent(self, limit):
        """Return the node with the oldest diagnostics, if they are older than limit [s]; else None."""
        last = min(self.latest, key=self.latest.get, default=None)
        return last if last is not None and time.monotonic() - self.latest[last] > limit else None

    def stuck(self, names, executor):
        """Return the nodes among these whose process does not even answer a parameter service.

        rclpy answers this service in the same thread as the steps, so a node without an answer is stuck in its code.
        """
        answers = self._get_parameters(names, GetParameters.Request(), executor)
        return [node for node in names if node not in answers]

    def graph_start(self, node, executor):
        """Return graph.start [ns UTC] of a running node. Raises RunError where it does not answer."""
        answers = self._get_parameters([node], GetParameters.Request(names=['graph.start']), executor)
        if node not in answers or not answers[node].values:
            raise RunError(f'{node} does not answer with graph.start, the beginning of its time: is it running on '
                           f'ROS_DOMAIN_ID {self.context.get_domain_id()}?')
        return answers[node].values[0].integer_value

    def _get_parameters(self, names, request, executor):
        """Return {node: its answer to a request for parameters} of the nodes that answer in time."""
        clients = {node: self.create_client(GetParameters, f'{node}/get_parameters') for node in names}
        calls = {}
        deadline = time.monotonic() + SERVICE_TIMEOUT_S
        while time.monotonic() < deadline and not (len(calls) == len(clients) and all(
                call.done() for call in calls.values())):
            for node, client in clients.items():
                if node not in calls and client.service_is_ready():
                    calls[node] = client.call_async(request)
            executor.spin_once(timeout_sec=0.02)
        return {node: call.result() for node, call in calls.items() if call.done()}


def another_graph(domain_id):
    """Return the RunError of a ROS domain on which another graph runs."""
    return RunError(f'another graph runs on ROS_DOMAIN_ID {domain_id}; set a free one')


@contextlib.contextmanager
def sole_run(domain_id):
    """Hold a ROS domain for one run on this machine, by an abstract socket that ends with its process in any case.

    Raises RunError when another run holds it; discovery alone is too slow for this on a busy machine.
    """
    with socket.socket(socket.AF_UNIX) as holder:
        try:
            holder.bind(f'\0pedestal-domain-{domain_id}')
        except OSError:
            raise another_graph(domain_id) from None
        yield
