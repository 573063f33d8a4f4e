"""What the nodes ask of the middleware: quality of service, discovery on this machine, the executor."""
import importlib
import os
import pathlib

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from pedestal_common import topics


def qos(rate, role='lockstep') -> QoSProfile:
    """The profile of topics of a rate: in lockstep for writers and readers, in realtime of a role `written`, `read` or
    `recorded` (see topics.Qos)."""
    row = topics.QOS[rate]
    depth, reliable = getattr(row, role), role != 'read' or row.reliable
    return QoSProfile(history=HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL, depth=depth or 1,
                      reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL if row.latched else DurabilityPolicy.VOLATILE)


def message_class(type_name):
    """The rclpy class of 'package/msg/Name'."""
    package, _, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def set_defaults():
    """What DDS of this process and its children does unless the user says otherwise: it talks to this machine only, on
    loopback sockets, and acknowledges promptly (fastdds.xml). To be called before rclpy.init."""
    if os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST') == 'LOCALHOST':
        profiles = pathlib.Path(__file__).with_name('fastdds.xml')
        os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(profiles))


def make_executor():
    """The executor every node runs in."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
        return EventsExecutor()
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor
        return SingleThreadedExecutor()
