"""The sources as a ROS 2 workspace. `make colcon` builds it, sources its install/ and runs this file."""
import os
import pathlib
import shutil
import signal
import time

import pytest
import rclpy
from ament_index_python.packages import get_package_prefix

EXECUTABLES = {
    'ship_motion_sim': ['ins_node', 'ship_motion_node'],
    'tracking_receiver_sim': ['tracking_receiver_node'],
    'acu_tracker': ['acu_node'],
    'adu_drive': ['adu_node', 'beam_steering_node'],
    'pedestal_recording': ['pass_recorder_node', 'recorder_node'],
    'pedestal_hardware': ['drive_node', 'ins_input_node', 'level_receiver_node', 'monopulse_receiver_node',
                          'rotator_node'],
    'equipment_sim': ['iq_node', 'simulated_drives_node'],
    'pedestal': ['pedestal'],
}

if 'colcon' not in os.environ.get('COLCON_PREFIX_PATH', ''):
    pytest.skip('`make colcon` runs this', allow_module_level=True)


@pytest.fixture
def node_names(domain_id, environment, monkeypatch):
    """A function that tells the names of the nodes on the session's domain."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', environment['ROS_AUTOMATIC_DISCOVERY_RANGE'])
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain_id)
    observer = rclpy.create_node('observer', context=context)
    yield observer.get_node_names
    observer.destroy_node()
    context.try_shutdown()


@pytest.mark.parametrize('package', EXECUTABLES)
def test_ros2_run_finds_the_executables(package):
    """`ros2 run` takes the executable files of <prefix>/lib/<package>, the prefix that holds the ament marker."""
    folder = pathlib.Path(get_package_prefix(package)) / 'lib' / package
    assert sorted(path.name for path in folder.iterdir() if os.access(path, os.X_OK)) == EXECUTABLES[package]


def test_ros2_launch_finds_the_launch_and_scenario_files():
    share = pathlib.Path(get_package_prefix('pedestal_bringup')) / 'share' / 'pedestal_bringup'
    assert (share / 'launch' / 'pedestal.launch.py').is_file()
    assert (share / 'config' / 'leo_pass.yaml').is_file()


@pytest.mark.skipif(not shutil.which('ros2'), reason='no ros2: the wheels have none')
def test_ros2_launch_runs_a_scenario_in_a_namespace(start_process, tmp_path):
    """Started here, its arguments known; a wrong one is refused by name."""
    # They want mcap, which the environment of colcon has none of.
    from pedestal_bringup.graph import launch_arguments
    from pedestal_recording.bag import load
    from pedestal_recording.verify import verify
    command = ['ros2', 'launch', 'pedestal_bringup', 'pedestal.launch.py']
    shown = start_process([*command, '--show-args']).communicate(timeout=180.0)[0]
    assert all(f"'{argument.name}':" in shown for argument in launch_arguments.ARGUMENTS)
    refused = start_process([*command, 'duration:=long'])
    said = ''.join(refused.communicate(timeout=180.0))
    assert refused.returncode == 1 and 'duration:=long: must be a number of seconds' in said
    ran = start_process([*command, 'duration:=1', 'namespace:=ship_1', 'bag:=mine'])
    said = ''.join(ran.communicate(timeout=600.0))
    assert verify(load(tmp_path / 'mine')).complete, said


def test_a_node_starts_and_stops(start_process, node_names, complaints):
    process = start_process([pathlib.Path(get_package_prefix('acu_tracker'), 'lib', 'acu_tracker', 'acu_node')])
    deadline = time.monotonic() + 120.0
    while 'acu' not in node_names():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline, 'the node did not appear'
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30.0)
    assert (process.returncode, complaints(errors)) == (0, '')
