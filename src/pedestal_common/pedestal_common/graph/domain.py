"""ROS domain of a run: a domain of a machine has one run at a time. A run reserves its domain by an abstract Unix
socket, which the kernel closes however the run ends. Discovery alone is too slow for this check on a busy machine."""
import contextlib
import os
import pathlib
import socket
from collections.abc import Iterator

from pedestal_common.graph.steps import GraphError

VARIABLE = 'ROS_DOMAIN_ID'
DEFAULT_DOMAIN = 0
MAX_CHOSEN_DOMAIN = 101
"""Largest domain that a run chooses by itself. Up to this domain, the ports lie below the ephemeral ports of Linux."""

MAX_DOMAIN = 232  # largest domain of DDS

_SOCKET_NAME = 'pedestal-domain-'

DDS_PROFILES = {'LOCALHOST': 'fastdds.xml', 'SUBNET': 'fastdds_subnet.xml'}
"""{ROS_AUTOMATIC_DISCOVERY_RANGE: the DDS profile for it}."""


def set_defaults() -> None:
    """Set the DDS profile of this process and its children by ROS_AUTOMATIC_DISCOVERY_RANGE, unless the user names a
    profile.

    Not set, or LOCALHOST: the graph stays on the loopback of this machine. rclpy then gets SYSTEM_DEFAULT, because
    under LOCALHOST rmw_fastrtps opens transports of its own on every interface. SUBNET: the graph may spread over
    several hosts, by UDP.
    """
    scope = os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if scope in DDS_PROFILES:
        profile = str(pathlib.Path(__file__).parents[1] / DDS_PROFILES[scope])
        chosen = os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', profile)
        if (scope, chosen) == ('LOCALHOST', profile):
            os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SYSTEM_DEFAULT'


def another_graph(domain_id: int) -> GraphError:
    """Return the GraphError of a ROS domain on which another graph runs."""
    return GraphError(f'another graph runs on {VARIABLE} {domain_id}; set a free one')


@contextlib.contextmanager
def of_run() -> Iterator[int]:
    """Reserve the ROS domain of a run as a context, before rclpy is initialised, and give it to this process and its
    children.

    This is the domain of the user, else the first free one; a line on stdout names a domain other than the default.
    Raises GraphError if another run holds the domain, ValueError for a domain that is no number of DDS. The DDS
    profile is also set here, because the programs of the user do not set it.
    """
    before = os.environ.get(VARIABLE)
    with _reserved(before) as domain_id, _given(domain_id):
        if not before and domain_id != DEFAULT_DOMAIN:
            print(f'this run has {VARIABLE} {domain_id}, because another run has {DEFAULT_DOMAIN}; commands to it: '
                  f'{VARIABLE}={domain_id} pedestal status', flush=True)
        yield domain_id


@contextlib.contextmanager
def of_child() -> Iterator[int]:
    """Give this process and its children the domain of a run that a child will start, as a context. The run reserves
    the domain itself. The domain is chosen, and errors are raised, as in `of_run`."""
    with _reserved(os.environ.get(VARIABLE)) as domain_id:
        pass
    with _given(domain_id):
        yield domain_id


@contextlib.contextmanager
def _given(domain_id: int) -> Iterator[None]:
    set_defaults()
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(domain_id)
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


@contextlib.contextmanager
def _reserved(given: str | None) -> Iterator[int]:
    candidates = [_number(given)] if given else range(DEFAULT_DOMAIN, MAX_CHOSEN_DOMAIN + 1)
    for domain_id in candidates:
        with socket.socket(socket.AF_UNIX) as holder:
            try:
                holder.bind(f'\0{_SOCKET_NAME}{domain_id}')
            except OSError:
                continue
            yield domain_id
            return
    raise another_graph(candidates[0])


def _number(text: str) -> int:
    if not text.isdecimal() or int(text) > MAX_DOMAIN:
        raise ValueError(f'{VARIABLE} {text}: must be a whole number from 0 to {MAX_DOMAIN}')
    return int(text)


def hint(domain_id: int) -> str:
    """Return the end of an error about a domain without a node: the domains of the runs of this machine."""
    others = _of_other_runs(domain_id)
    runs = f' This machine has runs on {VARIABLE} {", ".join(map(str, others))}' if others else ''
    return f'is a graph running?{runs}'


def _of_other_runs(domain_id: int) -> list[int]:
    try:
        names = pathlib.Path('/proc/net/unix').read_text().split()
    except OSError:     # a system without this file
        return []
    numbers = (name.removeprefix(f'@{_SOCKET_NAME}') for name in names if name.startswith(f'@{_SOCKET_NAME}'))
    return sorted({int(number) for number in numbers if number.isdecimal()} - {domain_id})
