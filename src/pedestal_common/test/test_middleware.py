"""Quality of service by rate and role: what a stopped or slow reader can do to a writer."""
import pytest

pytest.importorskip('rclpy')
import rclpy  # noqa: E402
from rclpy.qos import (  # noqa: E402
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,  # noqa: E402
    ReliabilityPolicy,
    qos_check_compatible,
)

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
