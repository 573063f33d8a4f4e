import os

import pytest

from pedestal_common.graph import domain
from pedestal_common.graph.steps import GraphError


@pytest.fixture
def names(monkeypatch):
    """Names of domains that no run of this machine has."""
    monkeypatch.setattr(domain, '_SOCKET_NAME', f'pedestal-domain-test-{os.getpid()}-')


def test_each_run_takes_the_first_free_domain(names, monkeypatch, capsys):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with domain.of_run() as first:
        assert (first, os.environ['ROS_DOMAIN_ID'], capsys.readouterr().out) == (0, '0', '')
        monkeypatch.setenv('ROS_DOMAIN_ID', '')
        with domain.of_run() as second:
            assert (second, os.environ['ROS_DOMAIN_ID']) == (1, '1')
            assert capsys.readouterr().out == ('this run has ROS_DOMAIN_ID 1, because another run has 0; commands to '
                                               'it: ROS_DOMAIN_ID=1 pedestal status\n')
            assert domain.hint(1) == 'is a graph running? This machine has runs on ROS_DOMAIN_ID 0'
        assert os.environ['ROS_DOMAIN_ID'] == ''
        assert domain.hint(0) == 'is a graph running?'
    with domain.of_run() as third:
        assert third == 0


def test_a_domain_of_the_user_is_kept_or_refused(names, monkeypatch, capsys):
    monkeypatch.setenv('ROS_DOMAIN_ID', '7')
    with domain.of_run() as chosen:
        assert chosen == 7
        with pytest.raises(GraphError, match='^another graph runs on ROS_DOMAIN_ID 7; set a free one$'):
            with domain.of_run():
                pass
    assert os.environ['ROS_DOMAIN_ID'] == '7' and capsys.readouterr().out == ''


def test_without_a_free_domain_the_run_is_refused(names, monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setattr(domain, 'MAX_CHOSEN_DOMAIN', 0)
    with domain.of_run(), pytest.raises(GraphError, match='another graph runs on ROS_DOMAIN_ID'):
        del os.environ['ROS_DOMAIN_ID']
        try:
            with domain.of_run():
                pass
        finally:
            os.environ['ROS_DOMAIN_ID'] = '0'


@pytest.mark.parametrize('text', ['-1', '233', 'seven', '1.5'])
def test_a_domain_that_is_no_number_of_dds_is_named(names, monkeypatch, text):
    monkeypatch.setenv('ROS_DOMAIN_ID', text)
    with pytest.raises(ValueError, match=f'^ROS_DOMAIN_ID {text}: must be a whole number from 0 to 232$'):
        with domain.of_run():
            pass
