"""The packages as pip installs them, and the rules of who may import whom."""
import ast
import pathlib
import shutil
import subprocess
import sys
import xml.etree.ElementTree
from importlib import metadata

import pytest

pytestmark = pytest.mark.every_case

ROOT = pathlib.Path(__file__).parents[1]
EXECUTABLES = {
    'pedestal_common': {},
    'receiver_law': {},
    'drive_law': {},
    'ship_motion_sim': {'ship_motion_node': 'pedestal_common.node.run:main',
                        'ins_node': 'pedestal_common.node.run:main'},
    'tracking_receiver_sim': {'tracking_receiver_node': 'pedestal_common.node.run:main'},
    'acu_tracker': {'acu_node': 'pedestal_common.node.run:main'},
    'adu_drive': {'adu_node': 'pedestal_common.node.run:main',
                  'beam_steering_node': 'pedestal_common.node.run:main'},
    'pedestal_operator': {'easycomm_node': 'pedestal_common.node.run:main',
                          'operator_page': 'pedestal_common.node.run:main',
                          'frames_node': 'pedestal_common.node.run:main',
                          'live_node': 'pedestal_common.node.run:main',
                          'rotctld_node': 'pedestal_common.node.run:main'},
    'pedestal_recording': {'pass_recorder_node': 'pedestal_common.node.run:main',
                           'recorder_node': 'pedestal_common.node.run:main'},
    'pedestal_results': {},
    'pedestal_hardware': {'drive_node': 'pedestal_common.node.run:main',
                          'monopulse_receiver_node': 'pedestal_common.node.run:main',
                          'ins_input_node': 'pedestal_common.node.run:main',
                          'level_receiver_node': 'pedestal_common.node.run:main',
                          'rotator_node': 'pedestal_common.node.run:main'},
    'equipment_sim': {'iq_node': 'pedestal_common.node.run:main',
                      'simulated_drives_node': 'pedestal_common.node.run:main'},
    'pedestal_bringup': {},
    'pedestal_workbench': {},
    'pedestal_station': {},
    'pedestal_studies': {},
    'pedestal': {'pedestal': 'pedestal.cli:main'},
}
PACKAGES = tuple(EXECUTABLES)
WITHOUT_ROS = PACKAGES[1:7]     # but for the nodes
BELOW = {'pedestal_common': (), 'receiver_law': ('pedestal_common',), 'drive_law': ('pedestal_common',),
         'ship_motion_sim': ('pedestal_common',),
         'tracking_receiver_sim': ('pedestal_common', 'receiver_law'), 'acu_tracker': ('pedestal_common',),
         'adu_drive': ('pedestal_common', 'drive_law'), 'pedestal_operator': ('pedestal_common',),
         'pedestal_recording': ('pedestal_common',)}
"""{package that does not stand on all packages above it in EXECUTABLES: those on which it stands}."""
MESSAGES = ('_msgs', '_interfaces', '_srvs')


def modules(package):
    return sorted((ROOT / 'src' / package / package).rglob('*.py'))


def imported(path):
    """Top-level names of everything a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.partition('.')[0]


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """A folder with the packages as `pip install` (not editable) lays them out.

    Built from copies, because setuptools leaves build/ in the sources it builds; needs no network.
    """
    folder = tmp_path_factory.mktemp('install')
    for package in PACKAGES:
        shutil.copytree(ROOT / 'src' / package, folder / 'src' / package,
                        ignore=shutil.ignore_patterns('build', '*.egg-info', '__pycache__', 'test'))
    done = subprocess.run(
        [sys.executable, '-m', 'pip', '--disable-pip-version-check', 'install', '--quiet', '--no-index', '--no-deps',
         '--no-build-isolation', '--target', folder / 'site', *(folder / 'src' / package for package in PACKAGES)],
        capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / 'site'


def manifest(package):
    return xml.etree.ElementTree.parse(ROOT / 'src' / package / 'package.xml').getroot()


@pytest.mark.thorough
@pytest.mark.parametrize('package', PACKAGES)
def test_pip_installs_commands_and_ros_files(installed, package):
    [distribution] = metadata.distributions(name=package, path=[str(installed)])
    commands = {entry.name: entry.value for entry in distribution.entry_points if entry.group == 'console_scripts'}
    assert commands == EXECUTABLES[package]
    assert all((installed / 'bin' / command).is_file() for command in commands)
    assert (installed / 'share' / 'ament_index' / 'resource_index' / 'packages' / package).is_file()
    assert (installed / 'share' / package / 'package.xml').is_file()
    assert not (installed / 'test').exists()


@pytest.mark.thorough
@pytest.mark.parametrize('package', PACKAGES)
def test_pip_and_ros_say_the_same(installed, package):
    [distribution] = metadata.distributions(name=package, path=[str(installed)])
    said = manifest(package)
    author = said.find('maintainer')
    assert (said.findtext('name'), said.findtext('version'), said.findtext('description'), said.findtext('license'),
            author.text, author.get('email')) == tuple(
        distribution.metadata[key]
        for key in ('Name', 'Version', 'Summary', 'License', 'Maintainer', 'Maintainer-email'))


def test_one_version():
    assert len({manifest(package).findtext('version') for package in PACKAGES}) == 1


@pytest.mark.thorough
def test_scenarios_and_launch_files_are_installed(installed):
    source = ROOT / 'src' / 'pedestal_bringup'
    scenarios = {path.name for path in (source / 'pedestal_bringup' / 'scenarios').glob('*.yaml')}
    launch = {path.name for path in (source / 'launch').glob('*.py')}
    assert 'leo_pass.yaml' in scenarios and 'pedestal.launch.py' in launch
    assert {path.name for path in (installed / 'pedestal_bringup' / 'scenarios').iterdir()} == scenarios
    assert {path.name for path in (installed / 'share' / 'pedestal_bringup' / 'config').iterdir()} == scenarios
    assert {path.name for path in (installed / 'share' / 'pedestal_bringup' / 'launch').glob('*.py')} == launch


@pytest.mark.thorough
def test_every_command_leads_to_a_function(installed, run_process):
    lines = ['import importlib, pathlib']
    for package, commands in EXECUTABLES.items():
        lines.append(f'assert pathlib.Path(importlib.import_module({package!r}).__file__)'
                     f'.is_relative_to({str(installed)!r})')
        for target in commands.values():
            module, _, function = target.partition(':')
            lines.append(f'assert callable(importlib.import_module({module!r}).{function})')
    done = run_process([sys.executable, '-c', '\n'.join(lines)], 120.0, PYTHONPATH=str(installed))
    assert done.returncode == 0, done.stderr


@pytest.mark.thorough
def test_the_installed_command_finds_its_scenarios(installed, run_process):
    done = run_process([installed / 'bin' / 'pedestal', 'scenarios'], 120.0, PYTHONPATH=str(installed))
    assert done.returncode == 0, done.stderr
    assert 'leo_pass' in done.stdout


@pytest.mark.parametrize('package', WITHOUT_ROS)
def test_only_nodes_know_ros(package):
    offenders = [f'{path.name} imports {name}' for path in modules(package) if not path.name.endswith('_node.py')
                 for name in imported(path) if name == 'rclpy' or name.endswith(MESSAGES)]
    assert offenders == []


def test_laws_load_without_ros(run_process):
    names = ['.'.join(path.relative_to(ROOT / 'src' / package).with_suffix('').parts)
             for package in WITHOUT_ROS for path in modules(package)
             if not path.name.endswith('_node.py') and path.stem != '__init__']
    assert {name.partition('.')[0] for name in names} == set(WITHOUT_ROS)
    code = f'import sys, importlib\nsys.modules["rclpy"] = None\nfor name in {names}: importlib.import_module(name)'
    done = run_process([sys.executable, '-c', code], 120.0)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize('package', PACKAGES)
def test_packages_import_only_what_is_below_them(package):
    """A column stands on the packages of BELOW; above the columns stands one package on the other."""
    allowed = {package, *BELOW.get(package, PACKAGES[:PACKAGES.index(package)])}
    offenders = [f'{path.name} imports {name}' for path in modules(package)
                 for name in imported(path) if name in PACKAGES and name not in allowed]
    assert offenders == []


def test_real_equipment_runs_no_law_of_a_simulator():
    """Of the simulated equipment, pedestal_hardware knows the parameters of the receiver only."""
    offenders = [f'{path.name} imports {node.module}' for path in modules('pedestal_hardware')
                 for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)
                 and node.module.startswith(('tracking_receiver_sim', 'ship_motion_sim', 'adu_drive'))
                 and node.module != 'tracking_receiver_sim.params']
    assert offenders == []


@pytest.mark.parametrize('package', PACKAGES)
def test_imports_are_declared(package):
    """Every ROS or sibling package that is imported stands in package.xml."""
    launch = sorted((ROOT / 'src' / package / 'launch').glob('*.py'))
    used = {name for path in modules(package) + launch for name in imported(path) if name != package}
    ros = {name for name in used if name in PACKAGES or name in ('rclpy', 'launch', 'launch_ros')
           or name.endswith(MESSAGES)}
    assert ros <= {entry.text for entry in manifest(package).findall('exec_depend')}
