"""ROS node that serves the page of the operator to browsers.

In the folder page, page_server.py serves the browsers, page_state.py makes the content, page_requests.py executes the
commands.
"""
import collections
import contextlib
import dataclasses
import socket
import time
from collections.abc import Callable, Mapping, Sequence

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.task import Future

from pedestal_common import parameters
from pedestal_common.graph.nodes import Node
from pedestal_common.quantities import Json, Message, Seconds
from pedestal_common.wire import commands
from pedestal_operator.page import page_security, page_sky, page_state
from pedestal_operator.page.page_log import Log
from pedestal_operator.page.page_passes import UpcomingPasses
from pedestal_operator.page.page_requests import PageRequests
from pedestal_operator.page.page_server import PageServer
from pedestal_operator.remote_node import Remote

STATE_PERIOD_S, POLL_PERIOD_S, SLOW_STATE_PERIOD_S = 0.05, 0.01, 1.0
"""Periods of the state sent to the pages, of the check for their commands, and of the slow part of the state [s]."""


@dataclasses.dataclass(frozen=True)
class PageParameters(parameters.Parameters):
    """Parameters of the page server."""
    address: str = parameters.text('127.0.0.1', 'address of the server')
    port: int = parameters.parameter(8080, 0, 65535, '', 'TCP port; 0: a free port, which the node prints')
    names: str = parameters.text('', 'further host names of the server in a browser, separated by commas')
    clients: int = parameters.parameter(32, 1, 256, '', 'largest number of open pages')


class PageNode(Remote, page_state.PageAntenna):
    """Client of the graph for all pages; a command carries the name of the user of its page."""
    awaits = 'pages'

    parameters: PageParameters
    _server: PageServer
    _history: collections.deque[list[float]]                                # rows of the strip charts
    _parameter_requests: dict[str, tuple[Client | None, Future | None]]     # {node: client, pending request}
    _sent_log_revision: int | None
    _night: dict[str, Json] | None      # of a station, page_state.night

    def __init__(self, row: Node) -> None:
        super().__init__(row.name, 'page', parameters_type=PageParameters)
        self.path, self.configuration, self.log = None, {}, Log()
        self._history = collections.deque(maxlen=round(page_state.CHART_SPAN_S / page_state.CHART_PERIOD_S))
        self._beam_history, self._upcoming_passes = page_sky.BeamHistory(page_state.CHART_SPAN_S), UpcomingPasses()
        self._pages = PageRequests(self._request_for, self.replied,
                                   lambda client, message: self._server.reply(client, message),
                                   lambda: self.texts.get('acu/mode') == 'rate')
        self._parameter_requests, self._sent_log_revision, self._night = {}, None, None
        self.connect_drive()
        p = self.parameters
        names = [name.strip() for name in p.names.split(',') if name.strip()]
        if not page_security.is_loopback(p.address):
            names.append(socket.gethostname())
            self.get_logger().warning(f'listens on {p.address}: every person with a token can operate the antenna '
                                      'from another machine; the connection is not encrypted')
        self._server = PageServer(p.address, p.port, names, p.clients, self._history.copy)
        for topic in page_state.EXTRA_NUMBER_TOPICS:
            self.subscribe_numbers(topic)
        self.message_reader('ins/state', self._text_taker('ins/state'))
        self.message_reader('acu/blockage', self._text_taker('acu/blockage'))
        self.message_reader('acu/program_track', self._take_program)
        self.message_reader(page_state.NIGHT_TOPIC, self._take_night)
        for role in page_security.PAGE_ROLES:
            print(f'page, {role}: {self._server.access.url(role)}', flush=True)
        self.every(POLL_PERIOD_S, self._take_commands)
        self.every(STATE_PERIOD_S, self._send_state)
        self.every(page_state.CHART_PERIOD_S, self._add_chart_point)
        self.every(SLOW_STATE_PERIOD_S, self._send_slow_state)

    @property
    def now(self) -> Seconds:
        """Time in UTC."""
        return self.clock()[1] * 1e-9

    def _request_for(self, client: str, command: str, arguments: Mapping[str, object]) -> str:
        self.who = client
        return self.request(command, arguments)

    def _take_reply(self, status: Message) -> None:
        super()._take_reply(status)
        with contextlib.suppress(ValueError):
            self.log.replied(self.now, *commands.of_reply(status))

    def take_drive_reply(self, command: commands.Command, reply: commands.Reply) -> None:
        """Take the reply of the drive, and log it."""
        super().take_drive_reply(command, reply)
        self.log.replied(self.now, command, reply)

    def _text_taker(self, topic: str) -> Callable[[Message], None]:
        take = super()._text_taker(topic)

        def logged(message: Message) -> None:
            take(message)
            self.log.text(self.now, topic, message.data)
        return logged

    def _take_alarms(self, array: Message) -> None:
        super()._take_alarms(array)
        self.log.alarms(self.now, page_state.alarms(self))

    def _take_program(self, message: Message) -> None:
        path = page_sky.path(message, page_state.epoch(self))
        self.path = self.path if path is None else path

    def _take_night(self, message: Message) -> None:
        self._night = page_state.night(message.data)

    def _take_commands(self) -> None:
        now = time.monotonic()
        while not self._server.requests.empty():
            self._pages.take(self._server.requests.get_nowait(), now)
        self._pages.look(now)     # forwards replies, and ends the jogs of silent pages

    def _send_state(self) -> None:
        if not self._server.pages:
            return
        sections = {'now': page_state.now(self), 'status': page_state.status_section(self),
                    'alarms': page_state.alarms(self)}
        if self._sent_log_revision != self.log.revision:
            sections['log'], self._sent_log_revision = list(self.log.lines), self.log.revision
        self._server.publish(sections)

    def _add_chart_point(self) -> None:
        if self.present('joint_states'):
            self._history.append(page_state.history_row(page_state.now(self)))

    def _send_slow_state(self) -> None:
        for node, names in page_state.SHOWN_PARAMETERS.items():
            self._request_parameters(node, names)
        if self.present('joint_states'):
            self._beam_history.add(self.now, page_state.now(self)['beam'])
        # The last message of a station that has ended is latched in this node, but no longer valid.
        night = self._night if self.publishers_of(self.resolve_topic_name(page_state.NIGHT_TOPIC)) else None
        self._server.publish({'fixed': page_state.fixed(self), 'past': self._beam_history.places, 'night': night,
                              'sky': page_state.sky(self, self._upcoming_passes.look(self))})

    def _request_parameters(self, node: str, names: Sequence[str]) -> None:
        """Request them when the node appears, and again after each time in which it was silent."""
        client, future = self._parameter_requests.get(node) or (None, None)
        if not self.present(node):
            self._parameter_requests[node] = client, None
            return
        client = client or self.create_client(GetParameters, f'{node}/get_parameters')
        if future is None and client.service_is_ready():
            future = client.call_async(GetParameters.Request(names=list(names)))
            future.add_done_callback(lambda done: self._take_parameters(names, done.result()))
        self._parameter_requests[node] = client, future

    def _take_parameters(self, names: Sequence[str], response: Message) -> None:
        for name, value in zip(names, response.values):
            content = {ParameterType.PARAMETER_INTEGER: value.integer_value,
                       ParameterType.PARAMETER_DOUBLE: value.double_value,
                       ParameterType.PARAMETER_STRING: value.string_value}.get(value.type)
            if content is not None:
                self.configuration[name] = content

    def close(self) -> None:
        """Close the server, then the node."""
        self._server.close()
        self._upcoming_passes.close()
        super().close()
