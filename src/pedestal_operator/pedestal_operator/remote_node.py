"""A node that stands outside the graph: it hears what the antenna tells, asks, and waits for the reply."""
import getpass
import math
import os
import socket
import time

from rcl_interfaces.srv import GetParameters

from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.steps import GraphError
from pedestal_common.node import middleware
from pedestal_common.node.shell import Shell
from pedestal_common.wire import commands, messages, records
from pedestal_common.wire.commands import Reply
from pedestal_operator.antenna import Antenna
from pedestal_operator.requests import Requests

NUMBER_TOPICS = ('joint_states', 'acu/reference', 'tracking_receiver/angle_error')
TEXT_TOPICS = ('acu/mode', 'adu/state', 'acu/keyhole')

MAX_MESSAGE_AGE_S = 2.5
"""Time [s] after which what was heard last is no longer told as the present state."""

REPLY_TIMEOUT_S = 5.0
"""Time [s] within which a node replies to a command, or is silent."""

RETRY_PERIOD_S = 1.0
"""Time [s] without a reply after which a command is said again: the node may not have discovered us before."""


def user():
    """The name by which a person at a terminal asks: login@host."""
    try:
        name = getpass.getuser()
    except (KeyError, OSError):
        name = str(os.getuid())
    return f'{name}@{socket.gethostname()}'


class Remote(Shell, Antenna):
    """Hears the graph and asks it. who: by which name it asks from now on; node: whose commands it can ask for.

    numbers: {topic: numbers of its last message, as `records` orders them}; texts: {topic: its last text};
    status: {node: its last DiagnosticStatus}; heard: {topic or node: when [s, steady]}.
    """

    def __init__(self, name, who, node='acu', beam='', parameters_type=parameters.Parameters):
        super().__init__(name, parameters_type)
        self.links = nodes.links(nodes.MAX_BEAMS if beam else 0)
        self.beam = f'{beam}/' if beam else ''
        self.who, self.node = who, nodes.row(node)
        self.numbers, self.texts, self.status, self.heard = {}, {}, {}, {}
        self._requests = Requests(f'{os.getpid()}.{time.time_ns()}')
        for topic in NUMBER_TOPICS:
            self.hear(topic)
        for topic in TEXT_TOPICS:
            self.message_reader(topic, self._text_taker(topic))
        self.message_reader('diagnostics', self._take_status)
        self.message_reader(self.node.replies, self._take_reply)
        self._asks = self.writer(self.node.obeys)

    def hear(self, topic):
        """Hear the numbers of one more topic."""
        decoder = records.Decoder(topic, records.empty(records.of(topic), 1))

        def take(message, _anew):
            self.numbers[topic], self.heard[topic] = message, time.monotonic()
        self.reader(topic, decoder.decoded, take)

    def _text_taker(self, topic):
        def take(message):
            self.texts[topic], self.heard[topic] = message.data, time.monotonic()
        return take

    def _take_status(self, array):
        for status in array.status:
            self.status[status.name], self.heard[status.name] = status, time.monotonic()

    def _take_reply(self, status):
        try:
            command, reply = commands.of_reply(status)
        except ValueError:
            return
        self._requests.take(command, reply)

    def ask(self, verb, arguments=None) -> str:
        """Ask for a verb with {argument: value}: the number of the request, by which `replied` finds its reply."""
        number = self._requests.add(verb, self.who, arguments).number
        self.ask_again(number)
        return number

    def ask_again(self, number):
        """Say a request once more, under its number: what came of the first one may be told twice."""
        self._asks(messages.serialize(commands.message(self._requests.asked(number))))

    def replied(self, number) -> Reply | None:
        """The Reply to a request, once; None as long as there is none."""
        return self._requests.replied(number)

    def present(self, name):
        """Whether a topic or node was heard lately."""
        return name in self.heard and time.monotonic() - self.heard[name] < MAX_MESSAGE_AGE_S

    def query(self, names):
        """The Query for parameters of the node that is asked."""
        return Query(self.create_client(GetParameters, f'{self.beam}{self.node.name}/get_parameters'), names)


class Query:
    """Numbers that a node has as parameters. values: [number], None until the node has told them."""

    def __init__(self, client, names):
        self._client, self._request = client, GetParameters.Request(names=names)
        self._asked, self._future = -math.inf, None
        self.values = None

    def look(self):
        """Ask for them, again and again until they are told."""
        now = time.monotonic()
        if self.values is None and self._future and self._future.done():
            self.values = [value.double_value for value in self._future.result().values] or None
        elif self.values is None and now - self._asked > REPLY_TIMEOUT_S and self._client.service_is_ready():
            self._asked, self._future = now, self._client.call_async(self._request)


class RemoteSession:
    """A Remote with its executor, as a context. Raises GraphError where no node of the graph is heard. arguments: of
    ROS 2, for the Remote."""

    def __init__(self, make, arguments=()):
        self._make, self._arguments = make, arguments

    def __enter__(self):
        middleware.initialise(self._arguments)
        self.remote = self._make()
        self._executor = middleware.make_executor()
        self._executor.add_node(self.remote)
        return self

    def __exit__(self, *_):
        import rclpy
        self.remote.destroy_node()
        rclpy.try_shutdown()

    def spin(self, seconds):
        """Hear for so long, or until something has come."""
        self._executor.spin_once(timeout_sec=seconds)

    def until(self, condition, seconds):
        """What a condition gave as soon as it was true, or at last after so many seconds."""
        deadline = time.monotonic() + seconds
        while not (value := condition()) and time.monotonic() < deadline:
            self.spin(0.05)
        return value

    def find(self, seconds=REPLY_TIMEOUT_S):
        """Wait until the node that is asked hears us and we hear its replies. Raises GraphError."""
        row, remote = self.remote.node, self.remote
        _, asked = remote._link(row.obeys)
        _, replies = remote._link(row.replies)
        if not self.until(lambda: remote.count_subscribers(asked) > 0 and remote.count_publishers(replies) > 0,
                          seconds):
            raise GraphError(f'no {remote.beam}{row.name} on ROS_DOMAIN_ID {remote.context.get_domain_id()} within '
                             f'{seconds:g} s: is a graph running?')
        self.until(lambda: False, 0.2)  # the other side of the discovery

    def ask(self, verb, arguments=None, seconds=REPLY_TIMEOUT_S) -> Reply:
        """Ask and wait for the Reply. Raises GraphError."""
        number, deadline = self.remote.ask(verb, arguments), time.monotonic() + seconds
        while (reply := self.until(lambda: self.remote.replied(number),
                                   min(RETRY_PERIOD_S, deadline - time.monotonic()))) is None:
            if time.monotonic() > deadline:
                raise GraphError(f'{self.remote.node.name} did not reply to {verb} within {seconds:g} s')
            self.remote.ask_again(number)
        return reply
