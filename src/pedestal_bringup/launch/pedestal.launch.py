"""Launch file that starts the nodes of a scenario on a ROS 2 machine, for example

    ros2 launch pedestal_bringup pedestal.launch.py scenario:=uav_flyby

`ros2 launch pedestal_bringup pedestal.launch.py --show-args` lists the arguments. The launch ends when the drive ends.
"""
import sys

from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    RegisterEventHandler,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from launch import LaunchDescription
from pedestal_bringup.graph import launch_arguments
from pedestal_common.graph import nodes


def operator(context, scenario):
    """Return the process that sends the program track, in the namespace of the nodes. context: that of the launch;
    scenario: path of the scenario file."""
    namespace = context.launch_configurations.get('ros_namespace', '')
    remapped = ['--ros-args', '-r', f'__ns:=/{namespace.strip("/")}'] if namespace else []
    return [ExecuteProcess(cmd=[sys.executable, '-m', 'pedestal_bringup.graph.send_program', str(scenario), *remapped],
                           output='screen')]


def start(context):
    """Return the nodes of the scenario, with the parameters that `pedestal run` would give them, the sender of the
    program track, and the servers. context: that of the launch."""
    given = {argument.name: LaunchConfiguration(argument.name).perform(context)
             for argument in launch_arguments.ARGUMENTS}
    chosen = launch_arguments.load_scenario(given)
    servers = launch_arguments.servers(given, chosen)
    lines, file, whole = launch_arguments.prepare(given, chosen)
    actions = [LogInfo(msg=line) for line in launch_arguments.misspelt_arguments(context.launch_configurations)]
    actions += [LogInfo(msg=line) for line in lines]
    actions += [PushRosNamespace(given['namespace'])] if given['namespace'] else []
    for name in chosen.nodes:
        if name == 'operator':
            actions.append(OpaqueFunction(function=operator, args=[whole]))
            continue
        row = chosen.row(name)
        node = Node(package=row.package, executable=row.executable, name=nodes.plain(name),
                    namespace=nodes.beam_of(name), parameters=[str(file)], output='screen')
        actions.append(node)
        if name == nodes.DRIVE_NODE or chosen.header.pacing == 'lockstep':
            end = EmitEvent(event=Shutdown(reason=f'{name} has ended'))
            actions.append(RegisterEventHandler(OnProcessExit(target_action=node, on_exit=[end])))
    for server, parameters in servers:
        actions.append(Node(package=server.package, executable=server.executable, parameters=[parameters],
                            output='screen'))
    return [GroupAction(actions)]


def generate_launch_description():
    """Return the launch description of a scenario, for ros2 launch."""
    return LaunchDescription([
        *(DeclareLaunchArgument(argument.name, default_value=argument.default, description=argument.doc,
                                choices=argument.choices or None) for argument in launch_arguments.ARGUMENTS),
        OpaqueFunction(function=start)])
