"""Quality of service by rate and role: what a stopped or slow reader can do to a writer."""
import signal

import pytest

pytest.importorskip('rclpy')
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.qos import (  # noqa: E402
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,  # noqa: E402
    ReliabilityPolicy,
    qos_check_compatible,
)

from pedestal_common import ignored_stop
from pedestal_common.graph import topics
from pedestal_common.node import middleware  # noqa: E402

ROLES = ('written', 'read', 'recorded')


@pytest.mark.parametrize('rate', topics.QOS_BY_RATE)
def test_lockstep_loses_nothing(rate):
    profile = middleware.qos(rate)
    assert profile.reliability == ReliabilityPolicy.RELIABLE
    if rate == 'step':
        assert profile.history == HistoryPolicy.KEEP_ALL


@pytest.mark.parametrize('rate', topics.QOS_BY_RATE)
@pytest.mark.parametrize('role', ROLES)
def test_realtime_keeps_a_bounded_history(rate, role):
    """A writer that keeps all waits for a reader that is stopped: 100 ms for each message after 5000, then an
    exception."""
    profile = middleware.qos(rate, role)
    assert profile.history == HistoryPolicy.KEEP_LAST and 0 < profile.depth < 5000


@pytest.mark.parametrize('rate', topics.QOS_BY_RATE)
@pytest.mark.parametrize('reader', ['read', 'recorded', 'lockstep'])
@pytest.mark.parametrize('writer', ['written', 'lockstep'])
def test_every_reader_hears_every_writer(rate, reader, writer):
    compatible, reason = qos_check_compatible(middleware.qos(rate, writer), middleware.qos(rate, reader))
    assert compatible != QoSCompatibility.ERROR, reason


def test_a_writer_that_does_not_latch_is_heard_where_a_person_writes():
    assert [rate for rate, row in topics.QOS_BY_RATE.items() if row.unlatched] == ['once']


@pytest.mark.parametrize('rate', ['once', 'change'])
def test_who_comes_late_gets_the_last(rate):
    for role in ROLES:
        assert middleware.qos(rate, role).durability == DurabilityPolicy.TRANSIENT_LOCAL


@pytest.mark.parametrize(('given', 'period', 'kind'), (
    ((), 0.2, 'imm'), (('-p', 'period:=0.3'), 0.3, 'imm'), (('-p', 'filter.kind:=ca', '-p', 'period:=0.4'), 0.4, 'ca'),
    (('-p', 'period:=0.3', '-p', 'period:=0.5'), 0.5, 'imm')))
def test_a_value_of_the_command_line_replaces_that_of_a_parameter_file(tmp_path, given, period, kind):
    """Also where the section of the file is for one node, to which rcl gives precedence."""
    file = tmp_path / 'station.yaml'
    file.write_text('/**/acu:\n  ros__parameters:\n    period: 0.2\n    filter.kind: imm\n')
    middleware.initialise(['--ros-args', *given[:2], '--params-file', str(file), *given[2:]])
    try:
        node = rclpy.create_node('acu', automatically_declare_parameters_from_overrides=True)
        assert [node.get_parameter(name).value for name in ('period', 'filter.kind')] == [period, kind]
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


@pytest.mark.parametrize('kind', ['events', 'single thread'])
def test_a_stop_waits_for_the_end_of_a_callback(kind):
    """Python would warn of a coroutine of rclpy that was never awaited, and rclpy of a failed callback."""
    calls = []

    def called():
        signal.raise_signal(signal.SIGUSR1)
        calls.append('whole')
    before = signal.signal(signal.SIGUSR1, lambda _, frame: ignored_stop.raise_stop(KeyboardInterrupt, frame))
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node('stopped', context=context)
        executor = (middleware.make_executor if kind == 'events' else SingleThreadedExecutor)(context=context)
        executor.add_node(node)
        node.create_timer(0.001, called)
        with pytest.raises(KeyboardInterrupt):
            while True:
                middleware.turn(executor, 1.0)
        assert calls == ['whole']
        with pytest.raises(KeyboardInterrupt):      # outside a turn at once
            called()
        assert calls == ['whole']
        node.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)
        signal.signal(signal.SIGUSR1, before)
