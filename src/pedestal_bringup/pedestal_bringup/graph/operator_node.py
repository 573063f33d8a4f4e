"""Node `operator` inside `pedestal run` and `pedestal program`: it sends the program tracks to the control units, and
receives the diagnostics of the other nodes."""
import time
from collections.abc import Callable, Iterable, Mapping, Sequence

from rcl_interfaces.srv import GetParameters
from rclpy.executors import Executor
from rclpy.task import Future

from pedestal_common import parameters
from pedestal_common.graph import domain, nodes
from pedestal_common.node import middleware
from pedestal_common.node.shell import Shell
from pedestal_common.quantities import Message, Nanoseconds, Seconds
from pedestal_common.wire import messages

DISCOVERY_TIME_S = 0.5  # time for which a run looks for another graph on its domain before it starts its own [s]
SERVICE_TIMEOUT_S = 2.0  # time in which a node must answer a parameter service, before it counts as stuck [s]


class Operator(Shell):
    """Node that sends the program tracks to a graph and receives the diagnostics of the nodes `names`."""
    on_diagnostics: Callable[[Message, Seconds], None]  # called with each DiagnosticStatus of these nodes and the
                                                        # monotonic time at which it arrived
    time: Seconds               # of the graph, by the newest diagnostics
    latest: dict[str, Seconds]  # {node: monotonic time at which its newest diagnostics arrived}

    def __init__(self, beams: int = 0, names: Iterable[str] = ()) -> None:
        super().__init__('operator', parameters.Parameters)
        self.links = nodes.links(beams)
        self._names = frozenset(names)
        self.time = 0.0
        self.latest = {}
        self.on_diagnostics = lambda status, now: None
        self._publish_by_topic: dict[str, Callable[[bytes], None]] = {}
        self.message_reader('diagnostics', self._note_diagnostics)

    def send(self, tracks: Mapping[str, Message]) -> None:
        """Publish the program tracks {topic: message} on latched topics, which also deliver them to late joiners."""
        self._open_publishers(tracks)
        for topic, message in tracks.items():
            self._publish_by_topic[topic](messages.serialize(message))

    def send_to(self, names: Sequence[str], tracks: Mapping[str, Message]) -> bool:
        """Publish the program tracks if all their subscribers are present, and return True then. Because a short run
        may end before a late recorder receives a track, nothing is published while a subscriber is missing."""
        self._open_publishers(tracks)
        if any(self._missing(publisher, nodes.readers(link, names))
               for link, publisher in self.publishers_by_link.items()):
            return False
        self.send(tracks)
        return True

    def _open_publishers(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self._publish_by_topic:
                self._publish_by_topic[name] = self.writer(name)

    def check_domain_free(self) -> None:
        """Raise GraphError if nodes of another graph, which would receive the messages of this graph, are on this
        domain."""
        deadline = time.monotonic() + DISCOVERY_TIME_S
        while time.monotonic() < deadline:
            names = self.get_node_names()
            if names.count(self.name) > 1 or any(node.name in names for node in nodes.NODES if node.program):
                raise domain.another_graph(self.context.get_domain_id())
            time.sleep(0.02)

    def _note_diagnostics(self, array: Message) -> None:
        for status in array.status:
            if status.name in self._names:
                self.time = max(self.time, messages.nanoseconds(array.header.stamp) * 1e-9)
                self.latest[status.name] = time.monotonic()
                self.on_diagnostics(status, self.latest[status.name])

    def silent(self, limit: Seconds) -> str | None:
        """Return the node with the oldest diagnostics if these are older than a limit, otherwise None."""
        last = min(self.latest, key=self.latest.__getitem__, default=None)
        return last if last is not None and time.monotonic() - self.latest[last] > limit else None

    def stuck(self, names: Sequence[str], executor: Executor) -> list[str]:
        """Return those of the named nodes that do not answer a request for parameters. A node answers it in the thread
        that also runs the steps, so a node without an answer is stuck in its code."""
        answers = self._get_parameters(names, GetParameters.Request(), executor)
        return [node for node in names if node not in answers]

    def graph_start(self, node: str, executor: Executor) -> Nanoseconds:
        """Return graph.start of a running node, the UTC at which its time is 0. Raises RuntimeError without an answer.
        """
        answers = self._get_parameters([node], GetParameters.Request(names=['graph.start']), executor)
        if node not in answers or not answers[node].values:
            domain_id = self.context.get_domain_id()
            raise RuntimeError(f'{node} on ROS_DOMAIN_ID {domain_id} does not answer with graph.start, the beginning '
                               f'of its time: {domain.hint(domain_id)}')
        return answers[node].values[0].integer_value

    def _get_parameters(self, names: Sequence[str], request: Message, executor: Executor) -> dict[str, Message]:
        clients = {node: self.create_client(GetParameters, f'{node}/get_parameters') for node in names}
        calls: dict[str, Future] = {}
        deadline = time.monotonic() + SERVICE_TIMEOUT_S
        while time.monotonic() < deadline and not (len(calls) == len(clients) and all(
                call.done() for call in calls.values())):
            for node, client in clients.items():
                if node not in calls and client.service_is_ready():
                    calls[node] = client.call_async(request)
            middleware.turn(executor, 0.02)
        return {node: call.result() for node, call in calls.items() if call.done()}
