"""Quality of service by rate and role: what a stopped or slow reader can do to a writer."""
import pytest

pytest.importorskip('rclpy')
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
