"""The arguments of pedestal.launch.py as its texts; test/test_colcon.py starts it where there is a `ros2`."""
import pytest

from pedestal_bringup.graph import launch_arguments, operator_servers
from pedestal_bringup.graph.start import parameters_of_all
from pedestal_bringup.scenario import program, scenario
from pedestal_common.text_files import parameter_file, plain_yaml


def given(**texts):
    return {**{argument.name: argument.default for argument in launch_arguments.ARGUMENTS}, **texts}


def test_every_argument_says_what_it_is():
    assert all(argument.doc for argument in launch_arguments.ARGUMENTS)
    names = [argument.name for argument in launch_arguments.ARGUMENTS]
    assert len(set(names)) == len(names) and set(operator_servers.SERVERS) <= set(names)


def test_what_is_said_takes_the_place_of_what_the_scenario_says(tmp_path):
    file = tmp_path / 'mine.yaml'
    file.write_text('/**/acu:\n  ros__parameters:\n    azimuth.filter.kind: ca\n')
    plain, changed = launch_arguments.load_scenario(given()), launch_arguments.load_scenario(given(
        pacing='realtime', duration='12.5', seed='7', params_file=str(file)))
    assert (plain.name, plain.header.pacing, plain.header.seed) == ('leo_pass', 'lockstep', 1)
    assert (changed.header.pacing, changed.header.duration, changed.header.seed) == ('realtime', 12.5, 7)
    assert changed.node_parameters('acu').azimuth.filter.kind == 'ca' != plain.node_parameters(
        'acu').azimuth.filter.kind


@pytest.mark.parametrize('section, namespaces', [
    ('acu', ['', 'ship_1']), ('/**/acu', ['', 'ship_1']), ('/ship_1/acu', ['ship_1', '/ship_1/']), ('/acu', ['']),
    ('/*/acu', ['ship_1'])])
def test_a_section_holds_in_the_namespace_of_ros_2(tmp_path, section, namespaces):
    file = tmp_path / 'mine.yaml'
    file.write_text(f'{section}:\n  ros__parameters:\n    azimuth.stow: 1\n')
    for namespace in ('', 'ship_1', '/ship_1/'):
        texts = given(params_file=str(file), namespace=namespace)
        if namespace in namespaces or namespace.strip('/') in namespaces:
            assert launch_arguments.load_scenario(texts).values['acu']['azimuth.stow'] == 1.0
        else:
            with pytest.raises(ValueError, match=r'write /\*\*/acu or acu$'):
                launch_arguments.load_scenario(texts)


def test_every_node_has_the_parameters_of_ros_2(tmp_path):
    """They reach the nodes, and their units know nothing of them."""
    file = tmp_path / 'mine.yaml'
    file.write_text('/**: {ros__parameters: {use_sim_time: true, qos_overrides./clock.publisher.depth: 5}}\n'
                    '/**/acu: {ros__parameters: {start_type_description_service: false}}\n')
    plain, chosen = (launch_arguments.load_scenario(given(**texts)) for texts in ({}, {'params_file': str(file)}))
    assert all(chosen.node_parameters(node) == plain.node_parameters(node) for node in ('acu', 'adu'))
    text = parameters_of_all(chosen, tmp_path / 'bag', 0)
    for node in ('acu', 'adu', 'tracking_receiver', 'recorder'):
        values = parameter_file.parse(text)[f'/**/{node}']
        assert values['use_sim_time'] is True and values['qos_overrides./clock.publisher.depth'] == 5
        assert values.get('start_type_description_service', True) is (node != 'acu')
    assert scenario.parse(chosen.name, chosen.as_yaml()) == chosen


@pytest.mark.parametrize('texts, told', [
    ({'scenario': 'leo_pas'}, "did you mean 'leo_pass'?"),
    ({'duration': 'long'}, 'duration:=long: must be a number of seconds'),
    ({'duration': '-3'}, 'duration = -3 s: must be 0.1 to 86400'),
    ({'seed': '1.5'}, 'seed:=1.5: must be a whole number'),
    ({'params_file': '/nowhere.yaml'}, '/nowhere.yaml: No such file or directory')])
def test_a_wrong_value_is_named(texts, told):
    with pytest.raises(ValueError) as refused:
        launch_arguments.load_scenario(given(**texts))
    assert told in str(refused.value) and '\n' not in str(refused.value)


@pytest.mark.parametrize('namespace', ['ship 1', '1ship', 'ship-1', '~', 'a//b', 'ä'])
def test_a_namespace_that_ros_2_refuses_is_named(namespace):
    with pytest.raises(ValueError, match=f'^namespace:={namespace}: must be letters, digits and _, for example '):
        launch_arguments.load_scenario(given(namespace=namespace))


@pytest.mark.parametrize('change', ['ship_motion.ship.sea_state=6', 'ins.latency=0.1'])
def test_a_parameter_of_a_node_that_takes_no_part_is_refused(change):
    with pytest.raises(ValueError, match=f'^scenario leo_pass: {change.partition("=")[0]}: has no effect, because '):
        scenario.load('leo_pass', [change])
    assert 'ship_motion' in scenario.load('leo_pass', [change, 'scenario.ship=true']).nodes


@pytest.mark.parametrize('pacing, texts, told', [
    ('lockstep', {'page': 'true'}, 'page:= needs pacing:=realtime'),
    ('realtime', {'rotctld': '70000'}, 'rotctld:=70000: must be false, true or a port, 1 to 65535'),
    ('realtime', {'page': 'yes'}, 'page:=yes: must be false, true or a port')])
def test_a_wrong_server_is_named(pacing, texts, told):
    asked = given(pacing=pacing, **texts)
    with pytest.raises(ValueError) as refused:
        launch_arguments.servers(asked, launch_arguments.load_scenario(asked))
    assert told in str(refused.value)


def test_servers_are_those_that_were_asked_for():
    asked = given(pacing='realtime', page='true', rotctld='4600', frames='true')
    started = {server.executable: values for server, values in launch_arguments.servers(asked,
                                                                                        launch_arguments.load_scenario(asked))}
    assert started == {'operator_page': {'graph.beams': 0, 'port': 8080}, 'frames_node': {'graph.beams': 0},
                       'rotctld_node': {'graph.beams': 0, 'port': 4600}}
    assert launch_arguments.servers(given(), launch_arguments.load_scenario(given())) == []


def test_a_misspelt_argument_is_told_apart_from_those_of_other_launch_files():
    assert launch_arguments.misspelt_arguments(['scenaro', 'scenario', 'rviz_config']) == [
        "no argument scenaro:=; did you mean 'scenario'?"]


def test_the_lines_of_a_launch_are_those_of_a_run(tmp_path, monkeypatch):
    """A limit that is wider than that of the drive, and the columns of the files of ship and target."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'a.csv').write_text('t,az,el\n' + ''.join(f'{k},{k},40\n' for k in range(21)))
    (tmp_path / 'ship.csv').write_text('time [s];Roll_deg;pitch [rad];heading_deg\n'
                                       + ''.join(f'{k};1,5;0;{k}\n{k};1,5;0;{k}\n' for k in range(21)))
    (tmp_path / 'mine.yaml').write_text(
        'acu: {ros__parameters: {azimuth.limits.high: 6.2832}}\n'
        'ship_motion: {ros__parameters: {ship: {motion: recorded, recorded.path: ship.csv}}}\n'
        'tracking_receiver: {ros__parameters: {target: {kind: track_file, track_file.path: a.csv}}}\n')
    asked = given(scenario='ship_pass', params_file='mine.yaml', duration='5')
    _, limit, ship, target, *_ = launch_arguments.prepare(asked, launch_arguments.load_scenario(asked))[0]
    assert limit.startswith('acu.azimuth.limits.high = 6.2832 rad is wider than the travel of the drive')
    assert ship == ('ship.csv: columns time [s] in s, Roll_deg in deg, pitch [rad] in rad, heading_deg in deg: '
                    '21 rows, passed over 21 x row that repeats the row before')
    assert target.startswith('a.csv: table of azimuth and elevation, columns t in s, az in deg, el in deg: 21 rows')


def test_what_the_nodes_start_with_lies_beside_the_bag(tmp_path, monkeypatch):
    """The operator is given the scenario whole, with every change, under its name."""
    monkeypatch.chdir(tmp_path)
    asked = given(scenario='uav_flyby', seed='7', bag='mine')
    chosen = launch_arguments.load_scenario(asked)
    lines, file, whole = launch_arguments.prepare(asked, chosen)
    assert lines == ['antenna at 47.40 N 8.50 E, 500 m: the default'] == program.Plan(chosen).announced()
    assert plain_yaml.read(file)['/**/recorder']['ros__parameters']['bag'] == 'mine'
    assert launch_arguments.load_scenario(given(scenario=str(whole))) == chosen
    (tmp_path / 'mine').mkdir()
    with pytest.raises(ValueError, match='bag mine exists already'):
        launch_arguments.prepare(asked, chosen)
