"""ROS node of a client, outside the graph: it receives the state of the antenna, sends commands and receives
replies."""
import datetime
import getpass
import itertools
import math
import os
import socket
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future
from std_srvs.srv import Trigger

from pedestal_common import parameters
from pedestal_common.graph import domain, nodes
from pedestal_common.graph.steps import GraphError
from pedestal_common.node import middleware
from pedestal_common.node.shell import Shell
from pedestal_common.quantities import Message, Nanoseconds, Seconds, Value
from pedestal_common.wire import commands, messages, records
from pedestal_common.wire.commands import HELD_REFUSAL, Command, Reply
from pedestal_operator.antenna import POINTING_TOPIC, Antenna
from pedestal_operator.state import ANGLE_ERROR_TOPIC

JOG_REPEAT_PERIOD_S = 0.2  # period of a jog [s], less than half of the jog timeout of the control unit
MAX_KEPT_REQUESTS = 1000  # largest number of requests kept, because some replies are never read


class Requests:
    """Requests without a reply, and unread replies. prefix: start of their numbers, unique to this program."""
    _pending: dict[str, Command]    # by number
    _replies: dict[str, Reply]

    def __init__(self, prefix: str) -> None:
        self._numbers = (f'{prefix}-{count}' for count in itertools.count(1))
        self._pending, self._replies = {}, {}

    def __len__(self) -> int:
        return len(self._pending)

    def add(self, verb: str, who: str, arguments: Mapping[str, object] | None = None) -> Command:
        """Return the command of a new request. who: name of the sender; arguments: {argument: value}."""
        command = Command(verb, who, next(self._numbers), {
            name: f'{value:.9g}' if isinstance(value, float) else str(value)
            for name, value in (arguments or {}).items()})
        self._pending[command.number] = command
        if len(self._pending) > MAX_KEPT_REQUESTS:
            self._remove(next(iter(self._pending)))
        return command

    def pending_command(self, number: str) -> Command:
        """Return the command of a request without a reply. Raises KeyError for any other number."""
        return self._pending[number]

    def take(self, command: Command, reply: Reply) -> None:
        """Keep a reply if its command is one of these requests."""
        pending = self._pending.get(command.number)
        if pending and pending.who == command.who:
            self._replies[command.number] = reply

    def replied(self, number: str) -> Reply | None:
        """Return the reply to a request once, None before it arrives."""
        return self._remove(number) if number in self._replies else None

    def _remove(self, number: str) -> Reply | None:
        del self._pending[number]
        return self._replies.pop(number, None)


NUMBER_TOPICS = ('joint_states', 'acu/reference', ANGLE_ERROR_TOPIC)

TEXT_TOPICS = ('acu/mode', 'adu/state', 'acu/keyhole', POINTING_TOPIC)  # topics of text that every client receives
REPLY_TIMEOUT_S = 5.0  # longest wait for the reply to a command [s]
DISCOVERY_MARGIN_S = 0.05  # for the discovery by the commanded node, after its own discovery [s]
RETRY_PERIOD_S = 1.0  # time until a command is repeated [s], because discovery may be incomplete

GRAPH_PARAMETERS = 'graph.scenario', 'graph.start'  # of every node, which name its graph
GRAPH_REPLY_TIMEOUT_S = 1.0     # longest wait for them [s]

_R = TypeVar('_R')
_S = TypeVar('_S', bound='RemoteSession')


def user() -> str:
    """Return the name of the person at the terminal: login@host."""
    try:
        name = getpass.getuser()
    except (KeyError, OSError):
        name = str(os.getuid())
    return f'{name}@{socket.gethostname()}'


def _double(value: ParameterValue) -> float:
    return value.double_value


class Remote(Shell, Antenna):
    """Client of a graph."""
    who: str                        # name of the person or program in the next commands
    node: nodes.Node                # which receives the commands
    arrivals: dict[str, Seconds]    # {topic or node: time of its last message, monotonic clock}
    stamps: dict[str, Nanoseconds]  # {topic of numbers: stamp of its last message}

    def __init__(self, name: str, who: str, node: str = 'acu', beam: str = '',
                 parameters_type: type[parameters.Parameters] = parameters.Parameters) -> None:
        super().__init__(name, parameters_type)
        self.links = nodes.links(nodes.MAX_BEAMS if beam else 0)
        self.beam = f'{beam}/' if beam else ''
        self.who, self.node = who, nodes.row(node)
        self.numbers, self.texts, self.status, self.arrivals, self.alarms, self.stamps = {}, {}, {}, {}, [], {}
        self._requests = Requests(f'{os.getpid()}.{time.time_ns()}')
        for topic in NUMBER_TOPICS:
            self.subscribe_numbers(topic)
        for topic in TEXT_TOPICS:
            self.message_reader(topic, self._text_taker(topic))
        self.message_reader('acu/alarms', self._take_alarms)
        self.message_reader('diagnostics', self._take_status)
        self.message_reader(self.node.replies, self._take_reply)
        self._send_command = self.writer(self.node.obeys)
        self._drive: dict[str, Client] = {}     # {service of the drive: its client}, see connect_drive
        self._called: set[str] = set()          # numbers of the requests that were sent to the drive

    def subscribe_numbers(self, topic: str) -> None:
        """Subscribe to a further topic of numbers."""
        decoder = records.Decoder(topic, records.empty(records.of(topic), 1))

        def decode(data: bytes) -> tuple[Nanoseconds, records.Decoded]:
            message = decoder.decoded(data)
            return message[0], message

        def take(message: records.Decoded, _: bool) -> None:
            self.stamps[topic], self.numbers[topic] = message
            self.arrivals[topic] = time.monotonic()
        self.reader(topic, decode, take)

    def _text_taker(self, topic: str) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            self.texts[topic], self.arrivals[topic] = message.data, time.monotonic()
        return take

    def _take_alarms(self, array: Message) -> None:
        self.alarms, self.arrivals['acu/alarms'] = array.status, time.monotonic()

    def _take_status(self, array: Message) -> None:
        for status in array.status:
            self.status[status.name], self.arrivals[status.name] = status, time.monotonic()

    def _take_reply(self, status: Message) -> None:
        try:
            command, reply = commands.of_reply(status)
        except ValueError:
            return
        self._requests.take(command, reply)

    def request(self, verb: str, arguments: Mapping[str, object] | None = None) -> str:
        """Send a command with {argument: value}. Return the number of the request, for `replied`."""
        number = self._requests.add(verb, self.who, arguments).number
        self.repeat_request(number)
        return number

    def repeat_request(self, number: str) -> None:
        """Send a request again under its number; its reply may then arrive twice. A request to the drive is sent once
        its service is there, and not again."""
        command = self._requests.pending_command(number)
        if command.verb in nodes.DRIVE_SERVICES:
            self._call_drive(command)
        else:
            self._send_command(messages.serialize(commands.message(command)))

    def connect_drive(self) -> None:
        """Make the clients of the services of the drive, which `request` needs for them."""
        self._drive = {service: self.create_client(Trigger, service) for service in nodes.DRIVE_SERVICES}

    def reaches_drive(self) -> bool:
        """Return True if the services of the drive are there."""
        return all(client.service_is_ready() for client in self._drive.values())

    def _call_drive(self, command: Command) -> None:
        """Call the service of a command. Because the drive does not know who has control, this function refuses the
        request of another client, as the control unit refuses its commands."""
        holder = self.diagnostics_of('acu').get('control', '')
        free = next(row.free for row in nodes.DRIVE_REQUESTS if row.service == command.verb)
        if not free and holder not in ('', command.who):
            self.take_drive_reply(command, Reply(False, f'refused: {HELD_REFUSAL} {holder}'))
        elif command.number not in self._called and self._drive[command.verb].service_is_ready():
            self._called.add(command.number)
            self._drive[command.verb].call_async(Trigger.Request()).add_done_callback(
                lambda done: self.take_drive_reply(command, Reply(done.result().success, done.result().message)))

    def take_drive_reply(self, command: Command, reply: Reply) -> None:
        """Take the reply of the drive; overridden by a client that also logs it."""
        self._called.discard(command.number)
        self._requests.take(command, reply)

    def replied(self, number: str) -> Reply | None:
        """Return the reply to a request once, None before it arrives."""
        return self._requests.replied(number)

    def age(self, name: str) -> Seconds:
        """Return the age of the last message of a topic or node, infinite before the first."""
        return time.monotonic() - self.arrivals.get(name, -math.inf)

    def exists(self, name: str) -> bool:
        """Return True if a topic has a publisher, or had one."""
        return name in self.arrivals or self.count_publishers(self._link(name)[1]) > 0

    def query(self, names: Sequence[str], read: Callable[[ParameterValue], object] = _double,
              node: str = '') -> 'Query':
        """Return a Query for parameters of a node; '': of the commanded node."""
        name = node or f'{self.beam}{self.node.name}'
        return Query(self.create_client(GetParameters, f'{name}/get_parameters'), names, read)


class Query:
    """Request for parameters of a node. read: function that returns the content of a ParameterValue."""
    values: list[Any] | None    # as `read` returns them; None before the reply of the node

    def __init__(self, client: Client, names: Sequence[str], read: Callable[[ParameterValue], object]) -> None:
        self._client, self._request, self._read = client, GetParameters.Request(names=names), read
        self._request_time = -math.inf
        self.values = None

    def look(self) -> None:
        """Request the parameters, and repeat the request until the reply arrives."""
        now = time.monotonic()
        if self.values is None and now - self._request_time > RETRY_PERIOD_S and self._client.service_is_ready():
            self._request_time = now
            self._client.call_async(self._request).add_done_callback(self._take)

    def answered(self) -> bool:
        """Request the parameters as `look` does; return True after the reply."""
        self.look()
        return self.values is not None

    def _take(self, future: Future) -> None:
        """The reply may be that of an earlier request."""
        self.values = self.values or [self._read(value) for value in future.result().values] or None


class RemoteSession:
    """A Remote with its executor, as a context."""
    remote: Remote      # from the begin of the context

    def __init__(self, make: Callable[[], Remote], arguments: Sequence[str] = ()) -> None:
        """Keep the function that makes the Remote, and the arguments for ROS 2."""
        self._make, self._arguments = make, arguments

    def __enter__(self: _S) -> _S:
        middleware.initialise(self._arguments)
        self.remote = self._make()
        self._executor = middleware.make_executor()
        self._executor.add_node(self.remote)
        return self

    def __exit__(self, *_: object) -> None:
        from rclpy.utilities import try_shutdown
        self.remote.destroy_node()
        try_shutdown()

    def spin(self, seconds: Seconds) -> None:
        """Receive messages for some seconds, or until the first callback."""
        middleware.turn(self._executor, seconds)

    def until(self, condition: Callable[[], _R], seconds: Seconds) -> _R:
        """Receive messages until condition() is true, for some seconds at most. Return its last value."""
        deadline = time.monotonic() + seconds
        while not (value := condition()) and time.monotonic() < deadline:
            self.spin(0.05)
        return value

    def wait_for_node(self, seconds: Seconds = REPLY_TIMEOUT_S) -> None:
        """Wait for the connections to and from the commanded node. Raises GraphError after `seconds`."""
        row, remote = self.remote.node, self.remote
        _, command_topic = remote._link(row.obeys)
        _, reply_topic = remote._link(row.replies)
        if not self.until(lambda: remote.count_subscribers(command_topic) > 0
                          and remote.count_publishers(reply_topic) > 0, seconds):
            raise self._absent(remote.beam + row.name, seconds)
        self.until(lambda: False, DISCOVERY_MARGIN_S)

    def connect_drive(self, seconds: Seconds) -> None:
        """Wait for the services of the drive. Raises GraphError after `seconds`."""
        self.remote.connect_drive()
        if not self.until(self.remote.reaches_drive, seconds):
            raise self._absent(nodes.DRIVE_NODE, seconds)

    def _absent(self, name: str, seconds: Seconds) -> GraphError:
        domain_id = self.remote.context.get_domain_id()
        return GraphError(f'no {name} on ROS_DOMAIN_ID {domain_id} within {seconds:g} s: {domain.hint(domain_id)}')

    def graph(self) -> dict[str, str]:
        """Return what this client speaks to: the domain, the scenario, and the time since which it runs. A graph that
        was started by hand has no scenario. A graph in lockstep has no time. A program beside the graph has neither,
        so the control unit is queried in its place."""
        remote = self.remote
        query = remote.query(GRAPH_PARAMETERS, lambda value: value.string_value or value.integer_value,
                             '' if remote.node.program else f'{remote.beam}acu')
        self.until(query.answered, GRAPH_REPLY_TIMEOUT_S)
        found = {'domain': str(remote.context.get_domain_id())}
        if query.values:
            scenario, start = query.values
            found |= {'scenario': scenario} if scenario else {'started': 'by hand'}
            if start:
                since = datetime.datetime.fromtimestamp(start * 1e-9, datetime.timezone.utc)
                found['since'] = f'{since:%Y-%m-%d %H:%M:%S} UTC'
        return found

    def parameters(self, names: Iterable[str], node: str = '') -> dict[str, Value]:
        """Return {name: value} of parameters of a node; '': of the commanded node. Raises GraphError without a reply.
        """
        names = list(names)
        query = self.remote.query(names, parameter_value_to_python, node)
        self.until(query.answered, REPLY_TIMEOUT_S)
        if not query.values:
            raise GraphError(f'{node or self.remote.node.name} does not state its parameters within '
                             f'{REPLY_TIMEOUT_S:g} s')
        return dict(zip(names, query.values))

    def request(self, verb: str, arguments: Mapping[str, object] | None = None,
                seconds: Seconds = REPLY_TIMEOUT_S) -> Reply:
        """Send a command and wait for the reply. Raises GraphError after `seconds`."""
        number, deadline = self.remote.request(verb, arguments), time.monotonic() + seconds
        while (reply := self.until(lambda: self.remote.replied(number),
                                   min(RETRY_PERIOD_S, deadline - time.monotonic()))) is None:
            if time.monotonic() > deadline:
                name = nodes.DRIVE_NODE if verb in nodes.DRIVE_SERVICES else self.remote.node.name
                raise GraphError(f'{name} did not reply to {verb} within {seconds:g} s')
            self.remote.repeat_request(number)
        return reply

    def hold_jog(self, verb: str, arguments: Mapping[str, object], seconds: Seconds) -> Reply:
        """Repeat a jog for some seconds, then stop the axes, also if this program is stopped. Return the last reply.
        If the antenna has left the mode of the jog meanwhile, its new mode stays."""
        end = time.monotonic() + seconds
        try:
            while (reply := self.request(verb, arguments)).granted and (left := end - time.monotonic()) > 0.0:
                self.until(lambda: False, min(JOG_REPEAT_PERIOD_S, left))
        finally:
            if self.remote.texts.get('acu/mode') == verb:
                self.request(verb)
        return reply
