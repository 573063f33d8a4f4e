"""Recorder of a part of a run in realtime: a process beside the recorder of the graph, with a log beside its bag."""
import contextlib
import itertools
import pathlib
import signal
import subprocess
from collections.abc import Iterable, Mapping

from pedestal_bringup.graph.child import Child
from pedestal_common.node import run
from pedestal_common.quantities import Seconds, Value

RECORDER_NODE = 'pass_recorder'  # name of its node


def start(bag: pathlib.Path, parameters: Mapping[str, Value], arguments: Iterable[str] = ()) -> Child:
    """Start a recorder. parameters: {name: value} in addition to `bag`; arguments: for ROS 2, as the namespace. Raises
    OSError."""
    values = [f'{name}:={value}' for name, value in {'bag': bag, **parameters}.items()]
    return logged_child(run.command('pass_recorder_node', *(tuple(arguments) or ('--ros-args',)),
                                    *(word for value in values for word in ('-p', value))), bag)


def logged_child(command: list[str], bag: pathlib.Path) -> Child:
    """Start a command that appends its output to the log of a bag. Raises OSError."""
    with open(log_of(bag), 'ab') as output:
        process = Child(command, output.fileno(), None)
    process.begin()
    return process


def end(process: Child, seconds: Seconds) -> None:
    """Let a process end in order, and kill it after some seconds."""
    process.send_signal(signal.SIGTERM)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    process.kill()
    process.wait()


def set_aside(bag: pathlib.Path, word: str) -> None:
    """Rename a bag that shall not be used, and its logs, to NAME.WORD-1, NAME.WORD-2 and so on."""
    for path in [bag.with_name(bag.name + suffix) for suffix in ('', '.log', '.logs')]:
        if path.exists():
            names = (path.with_name(f'{path.name}.{word}-{number}') for number in itertools.count(1))
            path.rename(next(name for name in names if not name.exists()))


def log_of(bag: pathlib.Path) -> pathlib.Path:
    """Return the log of the processes of a bag."""
    return bag.with_name(bag.name + '.log')
