"""Settings of the middleware (rclpy and DDS) of every node."""
import contextlib
import importlib
import os
import re
import sys
from collections.abc import Mapping, Sequence

import rclpy
import yaml
from rclpy._rclpy_pybind11 import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException
from rclpy.executors import Executor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_namespace import validate_namespace

from pedestal_common import ignored_stop
from pedestal_common.graph import domain, topics
from pedestal_common.quantities import Seconds, Value
from pedestal_common.text_files import parameter_file, plain_yaml
from pedestal_common.text_files.files import FilePath


def qos(rate: str, role: str = 'lockstep') -> QoSProfile:
    """Return the quality of service of the topics of a rate. role: `lockstep`, or a field of topics.Qos."""
    row = topics.QOS_BY_RATE[rate]
    depth, reliable = getattr(row, role), role != 'read' or row.reliable
    return QoSProfile(history=HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL, depth=depth or 1,
                      reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL if row.latched else DurabilityPolicy.VOLATILE)


def message_class(type_name: str) -> type:
    """Return the rclpy class of 'package/msg/Name'."""
    package, _, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def namespace(option: str, name: str) -> str:
    """Return the namespace of a name such as ship_1, with a slash before it; '' for none. option: beginning of the
    error, such as '--namespace '. Raises ValueError."""
    place = f'/{name.strip("/")}'.rstrip('/')
    try:
        validate_namespace(place or '/')
    except InvalidNamespaceException:
        raise ValueError(f'{option}{name}: must be letters, digits and _, for example ship_1') from None
    return place


def initialise(args: Sequence[str] | None = None) -> None:
    """Initialise rclpy and DDS in this process; signals are left to the caller. Logs go to stderr only, which needs
    neither a home nor a disk. Raises ValueError for arguments that rcl refuses."""
    domain.set_defaults()
    given = list(sys.argv if args is None else args)
    stated = _stated(given)
    for place in parameter_files(given):
        given[place] = _as_read(given[place], stated)
    try:
        rclpy.init(args=[*given, '--ros-args', '--disable-external-lib-logs'],
                   signal_handler_options=SignalHandlerOptions.NO)
    except (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError) as error:
        raise ValueError(re.sub(r', at \S+:\d+', '', ' '.join(str(error).split()))) from None


def parameter_files(arguments: Sequence[str]) -> list[int]:
    """Return the places of the parameter files among the arguments of a process."""
    return _values_of(arguments, '--params-file')


def _values_of(arguments: Sequence[str], *options: str) -> list[int]:
    places, of_ros = [], False
    for place, argument in enumerate(arguments):
        of_ros = argument == '--ros-args' or of_ros and argument != '--'
        if of_ros and arguments[place - 1] in options:
            places.append(place)
    return places


def _stated(arguments: Sequence[str]) -> dict[str, Value]:
    """Return {name: value} of the options -p NAME:=VALUE. rcl itself reports a text that is none."""
    found = {}
    for place in _values_of(arguments, '-p', '--param'):
        name, assigns, text = arguments[place].partition(':=')
        with contextlib.suppress(yaml.YAMLError):
            if assigns:
                found[name] = plain_yaml.parse(text)
    return found


def _as_read(path: FilePath, stated: Mapping[str, Value]) -> str:
    """Return the path of a copy of a parameter file in memory, which states the values as parameter_file reads them.
    Without the copy, rcl would read 010 as 8 and `on` as true. stated: values of -p. They replace those of the file,
    because rcl gives a section for one node precedence over -p. Raises ParameterFileError."""
    sections = {section: {name: stated.get(name, value) for name, value in values.items()}
                for section, values in parameter_file.read(path).items()}
    copy = os.memfd_create('parameters')
    with open(copy, 'w', closefd=False) as stream:
        stream.write(parameter_file.dumped(sections))
    return f'/proc/self/fd/{copy}'


def turn(executor: Executor, seconds: Seconds) -> None:
    """Receive messages for some seconds, or until the first callback. A stop of `pedestal` follows at its end."""
    with ignored_stop.uninterrupted():
        executor.spin_once(timeout_sec=seconds)


def make_executor(context: Context | None = None) -> Executor:
    """Return the executor that every node runs in."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
        return EventsExecutor(context=context)
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor
        return SingleThreadedExecutor(context=context)
