"""The table of nodes: the graph of a drive, of one electronic beam, of several; what each row names exists."""

import pytest

from pedestal_common.graph import nodes, topics
from pedestal_common.node import unit

SHARED = {'clock', 'adu/state', 'ship/truth', 'ship/imu/data_raw', 'ship/imu/data', 'ins/state', 'ins/error',
          'diagnostics', 'weather/pressure', 'weather/temperature', 'weather/humidity',
          *(f'{node}/{name}' for node in ('ship_motion', 'ins') for name in ('inject', 'injected')),
          *(f'station/{name}' for name in ('command', 'command_result', 'night', 'log'))}


def test_every_topic_is_written_by_one_node_and_every_name_is_in_the_table_of_topics():
    for topic in topics.TOPICS:
        writers = [node.name for node in nodes.NODES if topic.name in (*node.writes, node.replies)]
        assert len(writers) == (0 if topic.name == 'diagnostics' or topic.rate == 'command' else 1), topic.name
    for node in (*nodes.NODES, nodes.ARRAY_DRIVE):
        assert set(node.reads) | set(node.writes) <= set(topics.TOPIC_BY_NAME), node.name
        assert node.answer in ('', *node.writes)


@pytest.mark.parametrize('node', [node for node in (*nodes.NODES, nodes.ARRAY_DRIVE) if node.program],
                         ids=lambda n: n.program)
def test_what_a_row_names_exists(node):
    pytest.importorskip('rclpy')
    pytest.importorskip(node.package)
    assert callable(node.node_type())
    assert hasattr(node.parameters_type(), 'check')
    if node.unit:
        assert unit.Unit in node.unit_type().__mro__ and node.unit_type().NODE == node


def test_a_graph_with_a_drive_holds_every_topic():
    graph = nodes.links()
    assert list(graph) == list(topics.TOPIC_BY_NAME)
    assert graph['joint_states'].readers == ('acu',) and graph['clock'].readers == ('ship_motion',)
    assert graph['adu/truth'].readers == ('tracking_receiver',)
    assert graph['diagnostics'].writers == ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu')
    assert nodes.members(nodes.NODE_NAMES, 0) == nodes.members(nodes.NODE_NAMES, 1) == nodes.NODE_NAMES


def test_one_beam_keeps_every_name_and_obeys_the_reference():
    graph = nodes.links(1)
    assert set(topics.TOPIC_BY_NAME) - set(graph) == {'adu/motor_states', 'adu/stow_pins', 'adu/inject',
                                                      'adu/injected'}
    assert {name for name, link in graph.items() if 'adu' in link.readers} == {'acu/reference'}
    assert all(graph[name].writers == link.writers for name, link in nodes.links().items() if name in graph)


def test_several_beams_share_what_belongs_to_the_ship_and_the_clock():
    graph = nodes.links(3)
    assert {name for name in graph if '/' not in name or not name.startswith('beam_')} == SHARED
    own = [name for name in nodes.links(1) if name not in SHARED]
    assert [name for name in graph if name.startswith('beam_2/')] == [f'beam_2/{name}' for name in own]
    assert graph['beam_3/acu/reference'].writers == ('beam_3/acu',)
    for name, reader in (('joint_states', 'acu'), ('adu/truth', 'tracking_receiver')):
        assert graph[f'beam_3/{name}'] == nodes.links()[name]._replace(
            name=f'beam_3/{name}', readers=(f'beam_3/{reader}',))
    assert graph['ship/imu/data'].readers == ('beam_1/acu', 'beam_2/acu', 'beam_3/acu')


def test_a_node_hears_what_may_be_real_equipment_and_no_ship_where_none_is_named():
    acu = nodes.row('acu')
    ashore = ('joint_states', 'tracking_receiver/angle_error', 'adu/state', 'acu/program_track', 'weather/pressure',
              'weather/temperature', 'weather/humidity')
    assert nodes.reads(acu, ()) == ashore == nodes.reads(acu, ('acu', 'adu', 'recorder'))
    aboard = nodes.reads(acu, ('beam_1/acu', 'ins'), ('receiver_range',))
    assert set(aboard) - set(ashore) == {'ship/imu/data', 'ins/state', 'tracking_receiver/range'}
    assert 'ins/error' in nodes.reads(acu, ('acu', 'ins'), ('ins_error',))
    assert nodes.reads(nodes.row('ins'), ('ins', 'acu')) == ('ship/imu/data_raw',)


@pytest.mark.parametrize('name, beam, plain', [
    ('beam_2/acu/mode', 'beam_2', 'acu/mode'), ('beam_16/acu', 'beam_16', 'acu'), ('beam_2', '', 'beam_2'),
    ('acu/mode', '', 'acu/mode'), ('beam_0/acu', '', 'beam_0/acu'), ('my_beam_2/acu', '', 'my_beam_2/acu')])
def test_a_beam_is_a_prefix(name, beam, plain):
    assert (nodes.beam_of(name), nodes.plain(name)) == (beam, plain)
