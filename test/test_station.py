"""The recipes of a permanent station in docs/station: they name what is installed, and start."""
import configparser
import importlib.metadata
import json
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys

import pytest
import yaml

STATION = pathlib.Path(__file__).parents[1] / 'docs' / 'station'
SERVICES = sorted(STATION.glob('*.service'))
COMMANDS = {entry.name for entry in importlib.metadata.entry_points(group='console_scripts')}


def unit(path):
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str
    parser.read(path)
    return parser


def started_by(path):
    """The command of ours that a service starts, by a shell or by itself."""
    words = shlex.split(unit(path)['Service']['ExecStart'])
    if words[0] == '/bin/sh':
        words = shlex.split(words[2].removeprefix('exec '))
    return pathlib.PurePath(words[0])


def test_there_is_a_service_for_each_part():
    assert [started_by(path).name for path in SERVICES] == [
        'acu_node', 'adu_node', 'drive_node', 'easycomm_node', 'ins_input_node', 'level_receiver_node',
        'operator_page', 'monopulse_receiver_node', 'recorder_node', 'rotator_node', 'rotctld_node']


@pytest.mark.parametrize('alike', [('adu', 'drive', 'rotator'), ('receiver', 'level-receiver')], ids='-'.join)
def test_one_service_alone_owns_the_drive_or_the_receiver(alike):
    units = {f'pedestal-{name}.service' for name in alike}
    for name in units:
        assert set(unit(STATION / name)['Unit']['Conflicts'].split()) == units - {name}


@pytest.mark.parametrize('path', SERVICES, ids=lambda path: path.stem)
def test_a_service_starts_an_installed_command_and_again(path):
    assert started_by(path).name in COMMANDS
    assert unit(path)['Service']['Restart'] == 'always'
    assert unit(path)['Unit']['StartLimitIntervalSec'] == '0'


@pytest.mark.skipif(shutil.which('systemd-analyze') is None, reason='there is no systemd-analyze')
def test_systemd_takes_the_units(tmp_path):
    ours = pathlib.Path(sys.executable).parent
    for path in (*SERVICES, *STATION.glob('*.target')):
        (tmp_path / path.name).write_text(path.read_text().replace('/opt/pedestal/bin', str(ours)))
    done = subprocess.run(['systemd-analyze', 'verify', *sorted(tmp_path.iterdir())], capture_output=True, text=True,
                          timeout=60)
    assert (done.returncode, done.stderr) == (0, '')


def test_the_container_starts_an_installed_command():
    recipe = (STATION / 'Containerfile').read_text()
    assert json.loads(re.search('^CMD (.*)$', recipe, re.M)[1])[0] in COMMANDS
    copied = re.findall(r'/tmp/(src/\w+)', recipe)
    assert set(copied) == {f'src/{path.parent.name}' for path in STATION.parents[1].glob('src/*/setup.py')}


PARAMETER_FILES = {
    'parameters.yaml': ('acu', 'adu', 'recorder'),
    'servo_drives.yaml': ('acu', 'drive', 'monopulse', 'recorder'),
    'rotator.yaml': ('acu', 'rotator', 'level_receiver', 'ins_input', 'recorder')}
"""{file of a kind of station: nodes that its services start}."""


@pytest.mark.parametrize('name', PARAMETER_FILES)
def test_the_position_stands_in_the_parameters(name):
    values = yaml.safe_load((STATION / name).read_text())['/**/acu']['ros__parameters']
    assert {f'prediction.station.{part}' for part in ('latitude_deg', 'longitude_deg', 'height')} <= set(values)


@pytest.mark.thorough
@pytest.mark.parametrize('name', PARAMETER_FILES)
def test_the_parameters_start_every_service(name, start_node, connect):
    started = [start_node(node, '--params-file', STATION / name) for node in PARAMETER_FILES[name]]
    for alone in started:
        client = connect(alone.domain_id)
        client.until(lambda client=client: client.node.count_publishers('diagnostics'))
        client.close()
        alone.process.send_signal(signal.SIGTERM)
    for alone in started:
        result = alone.finish(30.0)
        assert result.returncode == 0, result.stderr
