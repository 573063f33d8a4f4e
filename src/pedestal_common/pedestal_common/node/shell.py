"""Shell: base class of every ROS node of the project, and `main`, which runs the process of a node."""
import array
import contextlib
import ctypes
import gc
import inspect
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import FrameType
from typing import TYPE_CHECKING, NoReturn, Protocol, TextIO, TypeVar

import rclpy
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.timer import Timer
from rclpy.topic_endpoint_info import TopicEndpointInfo

from pedestal_common import ignored_stop, parameters
from pedestal_common.graph import antenna_values, nodes
from pedestal_common.graph.graph_parameters import GraphParameters
from pedestal_common.graph.steps import NS_PER_SECOND, SECONDS_PER_DAY, GraphError
from pedestal_common.node import middleware
from pedestal_common.node.diagnostics import Diagnose, Diagnostics
from pedestal_common.node.subscriptions import (
    LockstepSubscriber,
    TopicSubscriber,
    subscribe,
    two_argument_callback,
)
from pedestal_common.quantities import Json, Message, Nanoseconds, Seconds, Value
from pedestal_common.realtime import utc
from pedestal_common.wire import messages

START_DEADLINE_S = 300.0
"""Longest time that a node waits for its graph, whose other nodes may compile their laws for the first time [s]."""

OWN_MATCHING_TIME_S = 2.0
"""Time before the first step of a lockstep run with a program of the user, in which DDS connects its publishers to the
other nodes [s]. Such a program does not wait for its subscribers, and its first message would be lost."""

ACKNOWLEDGE_TIMEOUT_S = 1.0  # longest time that a node waits at its end for the acknowledgement of its messages [s]
TIMEX_BYTES, TIME_ERROR = 256, 5  # at least the size of struct timex; result of adjtimex for an unsynchronised clock
EXIT_DELAY_S = 0.1  # time for which a process stays after its publishers and subscribers have left the graph [s]


class Stopped(BaseException):  # noqa: N818  not an error: a signal stops the node
    """Arrival of a signal while a node waits or compiles. Like KeyboardInterrupt it is no Exception, because numba
    would take an Exception for an error of the law that it compiles."""


EXPECTED_ERRORS = (parameters.ParameterError, GraphError, ValueError, OSError, InvalidParameterTypeException,
                   InvalidParameterValueException, Stopped)
"""Errors that end a node with one line; any other error is a defect and shows its traceback."""

_M = TypeVar('_M')      # a decoded message


class Unprepared(Protocol):
    """What has laws to compile: a unit."""

    def prepare(self) -> None:
        """Compile the laws."""


_stop: list[bool] = []  # not empty after SIGINT or SIGTERM
_compiling: list[bool] = []  # not empty while the process compiles, which a signal may interrupt

STOP_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGALRM
"""Signals that stop a node; the last is sent only by the node itself, see ignored_stop."""


def _on_signal(_number: int, frame: FrameType | None) -> None:
    _stop.append(True)
    if _compiling:
        ignored_stop.raise_stop(Stopped, frame)


def stop_on_signals() -> None:
    """Let the STOP_SIGNALS stop the node of this process."""
    for number in STOP_SIGNALS:
        signal.signal(number, _on_signal)
    ignored_stop.retry(Stopped)


def readings() -> tuple[Nanoseconds, Nanoseconds]:
    """Return readings (steady clock, system clock), taken again at most twice if they lie 0.1 ms apart."""
    for _ in range(3):
        steady, system = time.monotonic_ns(), time.time_ns()
        if time.monotonic_ns() - steady < 100_000:
            break
    return steady, system


def is_clock_synchronised() -> bool:
    """Return False if the kernel counts the clock of this host as not synchronised by NTP or PTP (adjtimex(2))."""
    return ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(TIMEX_BYTES)) != TIME_ERROR


def node_of(info: TopicEndpointInfo, root: str = '/') -> str:
    """Return the name in the graph of the node that owns a publisher or subscriber, 'beam_2/acu' for example. root:
    namespace of the graph, with a '/' at its end."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'.removeprefix(root)


def _descriptor(field: parameters.Field, read_only: bool) -> ParameterDescriptor:
    meta = field.metadata
    unit = f' [{meta["unit"]}]' if meta.get('unit') else ''
    descriptor = ParameterDescriptor(description=meta['doc'] + unit, read_only=read_only)
    if 'options' in meta:
        descriptor.additional_constraints = 'one of ' + ', '.join(meta['options'])
    elif parameters.is_absent(field.default):     # no range of ROS contains .nan
        descriptor.additional_constraints = f'{meta["low"]:g} to {meta["high"]:g}, or .nan: not given'
    elif 'low' in meta and field.type is int:
        descriptor.integer_range = [IntegerRange(from_value=int(meta['low']), to_value=int(meta['high']), step=0)]
    elif 'low' in meta:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(meta['low']), to_value=float(meta['high']), step=0.0)]
    return descriptor


class Shell(Node):
    """Node of the graph. The fields of its parameters become ROS parameters of the same dotted names.

    live: prefixes of parameters that may change while the node runs; the node then implements `reconfigure()`. Raises
    ParameterError for an unknown or refused parameter.
    """
    parameters: parameters.AnyParameters

    def __init__(self, name: str, parameters_type: type[parameters.Parameters], live: Sequence[str] = ()) -> None:
        super().__init__(name)
        self._parameters_type = parameters_type
        self._declare(live)
        self.links = nodes.links_of(self.graph.members, self.graph.beams, self.graph.own)
        self._root, self.beam = self._place(name)
        self.name = self.beam + name
        self.finished = False       # True ends the node in `main`
        self.failure: BaseException | None = None       # error that ends the node
        self.result: dict[str, Json] = {}       # {name: value} that `main` prints at the end
        self.publishers_by_link: dict[nodes.Link, Publisher] = {}
        self._next_second = 0
        self._stamp = 0
        self._started = False
        self.diagnostics: Diagnostics | None = None
        self.utc = utc.Utc(*readings())
        self._epoch = 0 if self.graph.lockstep else self.graph.start or None
        self.listeners: list[TopicSubscriber[Message]] = []

    if TYPE_CHECKING:
        def get_logger(self) -> RcutilsLogger:
            """Return the logger of the node; rclpy does not state its type."""

        def destroy_node(self) -> None:
            """Take the node from the graph; rclpy does not state the type."""

    def _place(self, name: str) -> tuple[str, str]:
        """Return (namespace of the graph, prefix of this node's beam or ''), each with a '/' at its end."""
        namespace = self.get_namespace().rstrip('/') + '/'
        prefix = next((prefix for prefix in nodes.prefixes(self.graph.beams) if name in nodes.NODE_NAMES
                       and nodes.row(name).of_beam and namespace.endswith('/' + prefix)), '')
        return namespace.removesuffix(prefix), prefix

    def _declare(self, live: Sequence[str]) -> None:
        """Check the given ROS parameters, store them, and declare them in ROS."""
        given = {name: given.value for name, given in self._parameter_overrides.items()}
        given = parameters.without_ros({name: list(value) if isinstance(value, array.array) else value
                                        for name, value in given.items()})
        graph = {name: given.pop(name) for name in list(given) if name.startswith('graph.')}
        self.parameters = parameters.build(self._parameters_type, given)
        self.graph = parameters.build(GraphParameters, graph, 'graph.')
        self.parameters.check_graph(self.graph.beams, self.graph.lockstep)
        self._declare_all(parameters.as_dict(self.graph, 'graph.'), parameters.flatten(GraphParameters, 'graph.'), ())
        self._declare_all(parameters.as_dict(self.parameters), parameters.flatten(self._parameters_type), live)
        if middleware.parameter_files(sys.argv) and not self._parameter_overrides:
            name = self.get_name()
            self.get_logger().warning(f'no parameter of {self.get_fully_qualified_name()} is in the parameter file: a '
                                      f'section /**/{name} is for {name} in any namespace, {name} for one without')
        if live:
            self.add_pre_set_parameters_callback(self._typed)
            self.add_on_set_parameters_callback(self._on_set)
            self.add_post_set_parameters_callback(self._post_set)

    def antenna_lines(self) -> Iterable[str]:
        """Return the lines on the values for an antenna that are not given, and the remarks on the parameters; none in
        a simulated graph."""
        if self.graph.lockstep or self.graph.simulated:
            return ()
        return (*antenna_values.lines(self.get_name(), self.parameters, self._parameter_overrides, self.graph.members,
                                      is_clock_synchronised()), *self.parameters.remarks())

    def _declare_all(self, values: Mapping[str, Value], fields: Iterable[tuple[str, parameters.Field]],
                     live: Sequence[str]) -> None:
        for name, field in fields:
            self.declare_parameter(name, values[name], _descriptor(field, not name.startswith(tuple(live))),
                                   ignore_override=True)

    def _typed(self, changes: Iterable[Parameter]) -> list[Parameter]:
        """Return changed ROS parameters, in which a whole number has become a float if the parameter is a float."""
        fields = dict(parameters.flatten(self._parameters_type))
        return [Parameter(change.name, value=parameters.typed(fields[change.name], change.value))
                if change.name in fields else change for change in changes]

    def _changed(self, changes: Iterable[Parameter]) -> parameters.Parameters:
        values = parameters.as_dict(self.parameters)
        values.update({change.name: change.value for change in changes if change.name in values})
        changed = parameters.build(self._parameters_type, values)
        changed.check_graph(self.graph.beams, self.graph.lockstep)
        return changed

    def _on_set(self, changes: Iterable[Parameter]) -> SetParametersResult:
        try:
            self._changed(changes)
        except parameters.ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _post_set(self, changes: Iterable[Parameter]) -> None:
        self.parameters = self._changed(changes)
        self.reconfigure()

    def reconfigure(self) -> None:
        """Take the changed `self.parameters`; overridden by a node with live parameters."""

    def _link(self, name: str) -> tuple[nodes.Link, str]:
        """Return (nodes.Link, ROS name) of a topic, which a node of a beam names without the prefix of its beam."""
        link = self.links.get(self.beam + name) or self.links[name]
        return link, self._root + link.name if self.beam else link.name

    def clock(self) -> tuple[Nanoseconds, Nanoseconds]:
        """Return (time of the steady clock, UTC) now."""
        steady, system = readings()
        return steady, self.utc.at(steady, system)

    def epoch(self, stamp: Nanoseconds) -> Nanoseconds:
        """Return the stamp at which the time of the units is 0. In lockstep this is 0. In realtime it is the parameter
        `graph.start` or, if that is 0, the beginning of the UTC day of the first `stamp`."""
        if self._epoch is None:
            self._epoch = stamp // (SECONDS_PER_DAY * NS_PER_SECOND) * SECONDS_PER_DAY * NS_PER_SECOND
        return self._epoch

    @property
    def run_start(self) -> Nanoseconds:
        """Return the UTC at which the run begins, 0 without one: `graph.start`, or the time that equipment has chosen
        in its place."""
        return self.graph.start and (self._epoch or 0)

    def writer(self, name: str) -> Callable[[bytes], None]:
        """Return a function that publishes the CDR bytes of a message on a topic of the graph."""
        link, ros_name = self._link(name)
        publisher = self.create_publisher(middleware.message_class(link.type), ros_name,
                                          middleware.qos(link.rate, 'lockstep' if self.graph.lockstep else 'written'))
        self.publishers_by_link[link] = publisher
        return publisher.publish

    def reader(self, name: str, decode: Callable[[bytes], tuple[Nanoseconds | None, _M]],
               take: Callable[[_M, bool], None]) -> None:
        """Subscribe to a topic of the graph, and call take(message, after_gap) for every message. after_gap: True if
        messages may be missing before this message.

        decode(CDR bytes) returns (stamp or None, message), and raises ValueError for other bytes. In lockstep such
        bytes from a node of the graph end this node. In all other cases they are dropped, as are the messages that a
        PublisherGate refuses.
        """
        link, ros_name = self._link(name)

        if self.graph.lockstep:
            subscriber = LockstepSubscriber(self, link, ros_name, decode, take)
            self.create_subscription(middleware.message_class(link.type), ros_name,
                                     two_argument_callback(self._guarded(subscriber.callback)),
                                     middleware.qos(link.rate), raw=True)
        else:
            listener = TopicSubscriber(self, link, ros_name, decode, take)
            self.listeners.append(listener)
            listener.open(lambda: subscribe(self, link, ros_name, self._guarded(listener.callback), 'read'))

    def warn_of_foreign(self, link: nodes.Link, data: bytes) -> None:
        """Log the first foreign message of a topic in lockstep. The recording has all foreign messages."""
        self.get_logger().warning(f'{link.name}: a foreign message of {len(data)} bytes dropped at '
                                  f'{self._stamp / NS_PER_SECOND:.6f} s')

    def publishers_of(self, ros_name: str) -> list[str]:
        """Return the names of the nodes that publish a topic now."""
        return [node_of(info, self._root) for info in self.get_publishers_info_by_topic(ros_name)]

    def message_reader(self, name: str, take: Callable[[Message], None]) -> None:
        """Subscribe to a topic of the graph, and call take(message) for every message."""
        type_name = self._link(name)[0].type
        self.reader(name, lambda data: (None, messages.deserialize(data, type_name)),
                    lambda message, after_gap: take(message))

    def sample_reader(self, name: str, take: Callable[[Message], None]) -> None:
        """Subscribe to a topic of rate `sample`. Unlike message_reader this also drops messages whose stamp is in the
        future, or not newer than the last one."""
        type_name = self._link(name)[0].type
        self.reader(name, lambda data: (messages.stamp_of(data) or None, messages.deserialize(data, type_name)),
                    lambda message, after_gap: take(message))

    def every(self, period: Seconds, function: Callable[[], object]) -> Timer:
        """Return a timer that calls a function at a period of the steady wall clock."""
        return self.create_timer(period, self._guarded(function), clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _guarded(self, function: Callable[..., object]) -> Callable[..., None]:
        """Return a callback that stores an expected error of `function` for `main`, before rclpy prints a traceback.
        """
        def call(*args: object) -> None:
            try:
                function(*args)
            except EXPECTED_ERRORS as error:
                self.failure = self.failure or error
                self.finished = True
        vars(call)['__signature__'] = inspect.signature(function)
        return call

    def diagnose_with(self, diagnose: Diagnose) -> None:
        """Publish the diagnostics that diagnose() returns: in lockstep at every whole second of the drive's time, in
        realtime once a second of the wall clock and in `diagnose_now`."""
        self.diagnostics = Diagnostics(self, diagnose)

    def diagnose_now(self) -> bool:
        """Publish the diagnostics in realtime, unless the last are too new. Return True if they were published."""
        return self.diagnostics is not None and not self.graph.lockstep and self.diagnostics.publish_urgent()

    def begin_step(self, stamp: Nanoseconds) -> None:
        """Note the stamp t_k of a step, before any message of the step is published. In lockstep the first call waits
        for the graph, and diagnostics are published at every whole second."""
        self._stamp = stamp
        if not self._started:
            self._started = True
            if self.graph.lockstep:
                self.await_graph()
                self._next_second = -(-stamp // NS_PER_SECOND) * NS_PER_SECOND
            self.get_logger().info('runs')
        if self.graph.lockstep and stamp >= self._next_second:
            self._next_second = (stamp // NS_PER_SECOND + 1) * NS_PER_SECOND
            assert self.diagnostics
            self.diagnostics.publish(stamp)

    def restart(self) -> None:
        """Treat the next step as the first step."""
        self._started, self._stamp, self._next_second = False, 0, 0

    def prepare(self, unit: Unprepared) -> None:
        """Compile the laws of a unit, which may take half a minute. Raises Stopped after a signal."""
        _compiling.append(True)
        try:
            if _stop:
                raise Stopped
            unit.prepare()
        finally:
            _compiling.clear()

    def await_acknowledged(self) -> None:
        """Wait until every subscriber has received all messages of this node. Raises GraphError after graph.deadline,
        with the recorder as silent: in lockstep all other nodes have answered the step before."""
        for link, publisher in self.publishers_by_link.items():
            if not publisher.wait_for_all_acked(Duration(seconds=self.graph.deadline)):
                raise GraphError(f'a subscriber of {link.name} took no message in {self.graph.deadline:g} s',
                                 ('recorder',))

    def announce(self, publish: Callable[[bytes], None], message: Message) -> None:
        """Publish a message without a stamp. In lockstep all messages before and after it are acknowledged first, so
        that the order is deterministic."""
        if self.graph.lockstep:
            self.await_acknowledged()
        publish(messages.serialize(message))
        if self.graph.lockstep:
            self.await_acknowledged()

    def await_graph(self) -> None:
        """Wait until every topic that this node publishes has all its subscribers among the nodes of the graph. Raises
        GraphError after START_DEADLINE_S, or when another graph publishes the same topics."""
        deadline = time.monotonic() + START_DEADLINE_S
        for link, publisher in self.publishers_by_link.items():
            wanted = nodes.readers(link, self.graph.members)
            while missing := self._missing(publisher, wanted):
                if time.monotonic() > deadline:
                    raise GraphError(f'{link.name} lacks the subscribers {", ".join(missing)} after '
                                     f'{START_DEADLINE_S:g} s')
                if _stop:
                    raise Stopped
                time.sleep(0.01)
        if self.graph.own and self.name == nodes.DRIVE_NODE:
            time.sleep(OWN_MATCHING_TIME_S)
        for link, publisher in self.publishers_by_link.items():
            if len(link.writers) == 1 and self.count_publishers(publisher.topic_name) > 1:
                raise GraphError(f'{link.name} already has a publisher: another graph runs on ROS_DOMAIN_ID '
                                 f'{self.context.get_domain_id()}; set a free one')

    def _missing(self, publisher: Publisher, wanted: Sequence[str]) -> list[str]:
        """Return the wanted subscribers that a topic lacks. Only a replay replaces a wanted subscriber."""
        if not wanted:
            return []
        subscribers = self.get_subscriptions_info_by_topic(publisher.topic_name)
        names = {node_of(info, self._root) for info in subscribers}
        missing = [name for name in wanted if name not in names and nodes.REPLAY_NODE not in names]
        # The graph may list a subscriber to which the publisher is not connected yet.
        return missing or (list(wanted) if publisher.get_subscription_count() < len(subscribers) else [])

    def spin(self, executor: Executor) -> None:
        """Take one turn of the executor; overridden by a node that makes steps of its own."""
        executor.spin_once(timeout_sec=0.1)

    @property
    def awaits(self) -> str:
        """Text that names the inputs for which a ready node waits; overridden by a node with other inputs."""
        return 'messages'

    def draining(self) -> bool:
        """Return True while a finished node must go on receiving before `close`; overridden by the recorder."""
        return False

    def close(self) -> None:
        """Wait a little for the acknowledgement of the last messages, which would be lost with the node; overridden by
        a node with data to store."""
        deadline = time.monotonic() + ACKNOWLEDGE_TIMEOUT_S
        for publisher in self.publishers_by_link.values():
            publisher.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))


def _write_line(stream: TextIO, line: str) -> None:
    """Write a last line without a buffer. A full disk or a closed pipe must not change the reason of the end."""
    with contextlib.suppress(OSError):
        os.write(stream.fileno(), f'{line}\n'.encode())


def _end_process(node: Node, code: int) -> NoReturn:
    """End the process as soon as the publishers and subscribers of its node have left the graph.

    The DDS participant of the process is not destroyed. In 1 of 100 ends of a graph, Fast DDS 2.14 hangs in the
    destructor while other participants leave. DomainParticipant::set_listener then waits for a callback and holds the
    mutex that the callback needs. The process stays for EXIT_DELAY_S, because a node that misses the departure of a
    subscriber waits for it until its DDS lease ends, 20 s.
    """
    with node.handle, contextlib.suppress(OSError):
        node.destroy_node()
        sys.stdout.flush()
    time.sleep(EXIT_DELAY_S)
    os._exit(code)


def main(make_node: Callable[[], Shell], args: Sequence[str] | None = None) -> int:
    """Run the node of make_node() until it is finished or a signal stops it, and end the process.

    The exit code is 0, or 1 after an error, which is one line on stderr. The node's `result` is printed on stdout as a
    JSON object; an error adds {'error': the line, 'silent': the silent nodes}.
    """
    stop_on_signals()
    node, code = None, 0
    name = os.path.basename(sys.argv[0])
    try:
        middleware.initialise(args)
        node = make_node()
        name = node.get_name()
        executor = middleware.make_executor()
        executor.add_node(node)
        # This avoids that a garbage collection in the middle of a step visits all imported modules.
        gc.freeze()
        for line in (*node.antenna_lines(), f'ready, waits for {node.awaits}'):
            node.get_logger().info(line)
        while not (_stop or node.finished) or node.draining():
            node.spin(executor)
        node.close()
        if node.failure is not None:
            raise node.failure
        if node.result:
            _write_line(sys.stdout, json.dumps(node.result))
    except Stopped:
        pass
    except EXPECTED_ERRORS as error:
        code = 1
        result = node.result if node is not None else {}
        _write_line(sys.stdout, json.dumps({**result, 'error': str(error), 'silent': getattr(error, 'silent', ())}))
        _write_line(sys.stderr, f'{name}: error: {error}')
    # Python would restore the default action of late signals at its end, which would kill the process.
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    if node is not None:
        _end_process(node, code)
    rclpy.try_shutdown()
    return code
