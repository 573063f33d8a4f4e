"""The table of topics: the graph of a drive, of one electronic beam, of several."""
import pytest

from pedestal_common import topics

SHARED = {'clock', 'adu/state', 'ship/truth', 'ship/imu/data_raw', 'ship/imu/data', 'ins/state',
          'diagnostics'}


def test_a_graph_with_a_drive_is_the_table_itself():
    assert list(topics.graph(0).values()) == list(topics.TOPICS)
    assert topics.members(topics.NODES, 0) == topics.members(topics.NODES, 1) == topics.NODES


def test_one_beam_keeps_every_name_and_obeys_the_reference():
    graph = topics.graph(1)
    assert set(topics.BY_NAME) - set(graph) == {'adu/motor_states'}
    assert {name for name, topic in graph.items() if 'adu' in topic.readers} == {'acu/reference'}
    assert all(graph[name].writers == topics.BY_NAME[name].writers for name in graph)


def test_several_beams_share_what_belongs_to_the_ship_and_the_clock():
    graph = topics.graph(3)
    assert {name for name in graph if '/' not in name or not name.startswith('beam_')} == SHARED
    own = [name for name in topics.graph(1) if name not in SHARED]
    assert [name for name in graph if name.startswith('beam_2/')] == [f'beam_2/{name}' for name in own]
    assert graph['beam_3/acu/reference'].writers == ('beam_3/acu',)
    assert graph['beam_3/joint_states'] == topics.BY_NAME['joint_states']._replace(
        name='beam_3/joint_states', readers=('beam_3/tracking_receiver', 'beam_3/acu'))
    assert graph['ship/imu/data'].readers == ('beam_1/acu', 'beam_2/acu', 'beam_3/acu')


@pytest.mark.parametrize('name, beam, plain', [
    ('beam_2/acu/mode', 'beam_2', 'acu/mode'), ('beam_16/acu', 'beam_16', 'acu'), ('beam_2', '', 'beam_2'),
    ('acu/mode', '', 'acu/mode'), ('beam_0/acu', '', 'beam_0/acu'), ('my_beam_2/acu', '', 'my_beam_2/acu')])
def test_a_beam_is_a_prefix(name, beam, plain):
    assert (topics.beam_of(name), topics.plain(name)) == (beam, plain)
