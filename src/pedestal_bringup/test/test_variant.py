"""Variants of a scenario: their changes, their command, and the scenario that they load."""
import shlex

import yaml

from pedestal_bringup.scenario.variant import Variant


def test_changes_replace_the_values_of_files_and_the_last_value_holds(tmp_path):
    file = tmp_path / 'my gains.yaml'
    file.write_text('adu:\n  ros__parameters:\n    azimuth.bias.torque: 2.0\n    elevation.bias.torque: 2.5\n')
    variant = Variant('servo_step', ('adu.azimuth.bias.torque=3.5',), (file,)).with_({'adu.azimuth.bias.torque': 4.0})
    assert variant.overrides() == ['adu.azimuth.bias.torque=2.0', 'adu.elevation.bias.torque=2.5',
                                   'adu.azimuth.bias.torque=3.5', 'adu.azimuth.bias.torque=4.0']
    drive = variant.load().node_parameters('adu')
    assert (drive.azimuth.bias.torque, drive.elevation.bias.torque) == (4.0, 2.5)


def test_a_variant_says_how_to_run_it_through_the_nodes():
    variant = Variant('servo_step', duration=2.0).with_({'adu.azimuth.bias.torque': 3.0})
    assert variant.command() == 'pedestal run servo_step --duration 2.0 --param adu.azimuth.bias.torque=3.0'
    assert variant.load().node_parameters('adu').azimuth.bias.torque == 3.0
    words = shlex.split(Variant('a b.yaml', files=('c d.yaml',)).with_(['acu.commands=1 stow'], seed=3).command())
    assert words == ['pedestal', 'run', 'a b.yaml', '--seed', '3', '--params-file', 'c d.yaml', '--param',
                     'acu.commands=1 stow']


def test_none_keeps_seed_and_duration():
    variant = Variant('leo_pass', seed=4, duration=6.0).with_({'scenario.ship': False})
    assert (variant.seed, variant.duration, variant.changes) == (4, 6.0, ('scenario.ship=false',))
    header = variant.with_(seed=5).load().header
    assert (header.seed, header.duration) == (5, 6.0)


def test_off_is_a_word():
    """YAML 1.1 takes off for false; a schedule of that name must survive, also in the file the nodes read."""
    loaded = Variant('servo_step').with_({'adu.azimuth.bias.schedule': 'off'}).load()
    assert loaded.node_parameters('adu').azimuth.bias.schedule == 'off'
    assert yaml.safe_load(loaded.as_yaml())['adu']['ros__parameters']['azimuth.bias.schedule'] == 'off'
