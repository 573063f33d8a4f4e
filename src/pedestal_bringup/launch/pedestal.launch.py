"""ros2 launch pedestal_bringup pedestal.launch.py scenario:=uav_flyby [pacing:=lockstep] [duration:=60.0] [bag:=D]"""
import pathlib
import tempfile

from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from pedestal_bringup.run import graph, scenario
from pedestal_common import nodes


def start(context):
    """The nodes of the scenario with the parameters `pedestal run` would give them."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ('scenario', 'pacing', 'duration', 'bag')}
    chosen = scenario.load(given['scenario'], pacing=given['pacing'] or None,
                           duration=float(given['duration']) if given['duration'] else None)
    file = pathlib.Path(tempfile.mkdtemp(prefix='pedestal-')) / 'parameters.yaml'
    file.write_text(graph.parameters_of_all(chosen, given['bag'] or graph.free_bag(chosen.name),
                                         graph.begins(chosen)))
    actions = []
    for name in chosen.nodes:
        if name == 'operator':
            send = ['pedestal', 'program', given['scenario'], '--duration', str(chosen.header.duration)]
            actions.append(ExecuteProcess(cmd=send, output='screen'))
            continue
        row = chosen.row(name)
        node = Node(package=row.package, executable=row.executable, name=nodes.plain(name),
                    namespace=nodes.beam_of(name), parameters=[str(file)], output='screen')
        actions.append(node)
        if name == 'adu':
            end = OnProcessExit(target_action=node, on_exit=[EmitEvent(event=Shutdown())])
            actions.append(RegisterEventHandler(end))
    return actions


def generate_launch_description():
    """The launch description of a scenario, as ros2 launch asks for it."""
    return LaunchDescription([
        DeclareLaunchArgument('scenario', default_value='leo_pass'),
        DeclareLaunchArgument('pacing', default_value=''),
        DeclareLaunchArgument('duration', default_value=''),
        DeclareLaunchArgument('bag', default_value=''),
        OpaqueFunction(function=start)])
