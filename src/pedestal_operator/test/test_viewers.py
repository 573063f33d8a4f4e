"""What viewers open: every path of a layout is in the messages of its topic, and the model points as the antenna."""
import json
import re
import xml.etree.ElementTree as ElementTree

import foxglove.layouts
import numpy as np
import pytest
import yaml
from ikpy.chain import Chain
from scipy.spatial.transform import Rotation

from pedestal_common.geometry import line_of_sight
from pedestal_common.graph import topics
from pedestal_common.wire import cdr, messages
from pedestal_operator import live_node
from pedestal_operator.viewers import frames

LAYOUTS = ('commissioning.json', 'tracking.json')
FRAMES = {'earth', 'base_link', *(joint.child for joint in frames.PEDESTAL_JOINTS)}
PANELS = {'Plot': foxglove.layouts.PlotConfig, 'StateTransitions': foxglove.layouts.StateTransitionsConfig,
          'RawMessages': foxglove.layouts.RawMessagesConfig, '3D': foxglove.layouts.ThreeDeeConfig,
          'DiagnosticSummary': foxglove.layouts.DiagnosticsSummaryConfig}
SERIES = {'Plot': foxglove.layouts.PlotSeries, 'StateTransitions': foxglove.layouts.StateTransitionsSeries}
TITLES = {'foxglovePanelTitle', 'lichtblickPanelTitle'}
"""Beside the configuration of a panel in a layout file, for the one viewer and the other."""


def layout(name):
    return json.loads((frames.VIEWER_FOLDER / name).read_text())


def panels(name):
    """[(kind, configuration)] of a layout."""
    return [(key.partition('!')[0], config) for key, config in layout(name)['configById'].items()]


def leaves(tree):
    """The panels that a layout puts on the screen."""
    return [tree] if isinstance(tree, str) else leaves(tree['first']) + leaves(tree['second'])


def numbers(topic):
    """The places of the numbers in a message of a topic, as its writer begins it."""
    return {path for path, _, _ in cdr.Places(messages.serialize(messages.template(topic)),
                                              topics.TOPIC_BY_NAME[topic].type).numbers}


def field(type_name, path):
    """The type of what a path of fields, 'status[:]' for example, leads to in a message type. Raises KeyError."""
    for part in path.split('.') if path else ():
        name, index, _ = part.partition('[')
        kind, what = dict(messages.ROS_TYPESTORE.fielddefs[type_name][1])[name]
        if index:
            kind, what = what[0]
        type_name = what if isinstance(what, str) else what[0]
    return type_name


def topic_of(path):
    """(row of topics, path of fields, function) of a message path. Raises KeyError where there is no such topic."""
    match = re.fullmatch(r'/([\w/]+)((?:\.\w+(?:\[[\d:]+\])?)*)(?:\.@(\w+))?', path)
    return topics.TOPIC_BY_NAME[match[1]], match[2].removeprefix('.'), match[3]


@pytest.mark.parametrize('name', LAYOUTS)
def test_every_series_of_a_plot_is_a_number_of_its_topic(name):
    paths = [series['value'] for kind, config in panels(name) if kind == 'Plot'
             for series in (*config['paths'], *([config['xAxisPath']] if 'xAxisPath' in config else []))]
    assert len(paths) >= 12
    for path in paths:
        row, fields, function = topic_of(path)
        assert fields in numbers(row.name) and function in (None, 'rad2deg'), path


@pytest.mark.parametrize('name', LAYOUTS)
def test_every_other_path_is_in_the_definition_of_its_topic(name):
    for kind, config in panels(name):
        if kind == 'StateTransitions':
            for series in config['paths']:
                row, fields, _ = topic_of(series['value'])
                assert row.rate == 'change' and field(row.type, fields) == 'string', series
        elif kind == 'RawMessages':
            row, fields, _ = topic_of(config['topicPath'])
            assert field(row.type, fields) == 'diagnostic_msgs/msg/DiagnosticStatus'
        elif kind == 'DiagnosticSummary':
            assert topic_of(config['topicToRender'])[0].type == 'diagnostic_msgs/msg/DiagnosticArray'
        elif kind == '3D':
            assert set(config['topics']) == {live_node.DESCRIPTION_CHANNEL}
            assert {key.removeprefix('frame:') for key in config['transforms']} == FRAMES
            assert config['followTf'] in FRAMES


@pytest.mark.parametrize('name', LAYOUTS)
def test_panels_are_configured_by_what_foxglove_knows(name):
    assert sorted(leaves(layout(name)['layout'])) == sorted(layout(name)['configById'])
    for kind, config in panels(name):
        assert set(config) <= TITLES | set(PANELS[kind]()._to_dict()), kind
        for series in config.get('paths', ()):
            assert set(series) <= set(SERIES[kind]()._to_dict())


def of_plotjuggler(topic):
    """The series that PlotJuggler makes of a topic: of a JointState /TOPIC/JOINT/position and so on, else the path."""
    found = set()
    for path in numbers(topic):
        match = re.fullmatch(r'(position|velocity|effort)\[(\d+)\]', path)
        place = f'{topics.TOPIC_BY_NAME[topic].names[int(match[2])]}/{match[1]}' if match else path.replace('.', '/')
        found.add(f'/{topic}/{place}')
    return found


def test_every_curve_for_plotjuggler_is_a_number_of_a_topic():
    curves = [curve.get('name') for curve in ElementTree.parse(frames.VIEWER_FOLDER / 'plotjuggler.xml').iter('curve')]
    stamped = [row.name for row in topics.TOPICS if row.rate == 'step']
    assert len(curves) >= 15
    assert set(curves) <= set().union(*map(of_plotjuggler, stamped))


def test_rviz_shows_our_frames_and_asks_for_a_latched_model():
    config = yaml.safe_load((frames.VIEWER_FOLDER / 'pedestal.rviz').read_text())['Visualization Manager']
    displays = {display['Name']: display for display in config['Displays']}
    assert config['Global Options']['Fixed Frame'] == 'earth'
    assert set(displays['Frames']['Frames']) - {'All Enabled'} == FRAMES
    assert displays['Pedestal']['Description Topic']['Value'] == '/robot_description'
    assert displays['Pedestal']['Description Topic']['Durability Policy'] == 'Transient Local'


@pytest.fixture(scope='module')
def chain(tmp_path_factory):
    """ikpy's forward kinematics of the model, from the deck to the beam."""
    file = tmp_path_factory.mktemp('model') / 'pedestal.urdf'
    file.write_text(frames.PEDESTAL_URDF)
    return Chain.from_urdf_file(str(file), base_elements=['base_link'],
                                active_links_mask=[False, True, True, False])


ANGLES = [(0.0, 0.0), (0.5, 0.0), (-0.5, 0.3), (2.0, 1.2), (-3.0, 0.7), (5.0, 1.6), (1.0, -0.08)]


@pytest.mark.parametrize('angles', ANGLES)
def test_the_model_turns_clockwise_and_upwards(chain, angles):
    """The x axis of the beam, by a library of robotics, is the direction of a mechanical azimuth and elevation."""
    place = chain.forward_kinematics([0.0, *angles, 0.0])
    assert place[:3, 0] == pytest.approx(line_of_sight.direction(*angles), abs=1e-12)


def composed(transforms):
    """(4, 4) place of the last frame in the first."""
    place = np.eye(4)
    for before, after in zip(transforms, transforms[1:]):
        assert before.child == after.parent
    for transform in transforms:
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = Rotation.from_quat(transform.rotation).as_matrix(), transform.translation
        place = place @ step
    return place


@pytest.mark.parametrize('angles', ANGLES)
def test_our_transforms_are_those_of_the_model(chain, angles):
    assert composed(frames.of_pedestal(angles)) == pytest.approx(chain.forward_kinematics([0.0, *angles, 0.0]),
                                                                 abs=1e-12)


def test_each_beam_of_an_array_has_frames_of_its_own_on_one_deck():
    of_beam = frames.of_pedestal((0.1, 0.2), 'beam_2/')
    assert [(given.parent, given.child) for given in of_beam] == [
        ('base_link', 'beam_2/azimuth'), ('beam_2/azimuth', 'beam_2/elevation'), ('beam_2/elevation', 'beam_2/beam')]


def test_the_message_on_tf_is_read_back():
    sent = frames.tf_message(7_000_000_005, [frames.of_deck(), *frames.of_pedestal((0.1, 0.2))])
    read = messages.deserialize(messages.serialize(sent), 'tf2_msgs/msg/TFMessage').transforms
    assert [(one.header.frame_id, one.child_frame_id) for one in read] == [
        ('earth', 'base_link'), ('base_link', 'azimuth'), ('azimuth', 'elevation'), ('elevation', 'beam')]
    assert {messages.nanoseconds(one.header.stamp) for one in read} == {7_000_000_005}
    turn = read[1].transform.rotation
    assert Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_rotvec() == pytest.approx([0.0, 0.0, -0.1])
