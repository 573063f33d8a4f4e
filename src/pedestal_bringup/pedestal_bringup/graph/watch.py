"""Watch of a run by the process `pedestal run`, which takes part in the graph as the node `operator`: it sends the
program track and watches the other nodes.

In lockstep a node that dies or is silent ends the run with an error that names the node (module lockstep). In realtime
such a node is started again (module supervisor).
"""
import rclpy
from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.graph import lockstep, supervisor
from pedestal_bringup.graph.operator_node import Operator, sole_run
from pedestal_bringup.graph.start import Outcome, begins, parameters_of_all
from pedestal_common.graph import nodes
from pedestal_common.node import middleware
from pedestal_common.wire import messages


def run(graph, tracks, progress):
    """Let the held nodes (child.Child) of a graph begin, watch the nodes to their end or until Ctrl-C, and return the
    Outcome.

    graph: processes.Graph; tracks: {topic: program track}; progress: function of the time of the run [s]. Raises
    RunError.
    """
    middleware.initialise([])
    try:
        operator = Operator(graph.scenario.header.graph_beams, graph.scenario.nodes)
        try:
            with sole_run(operator.context.get_domain_id()):
                operator.check_domain_free()
                realtime = graph.scenario.header.pacing == 'realtime'
                return (_in_realtime if realtime else _in_lockstep)(graph, operator, tracks, progress)
        finally:
            operator.destroy_node()
    finally:
        rclpy.try_shutdown()


def _in_lockstep(graph, operator, tracks, progress):
    """Run a graph in lockstep and return its Outcome; arguments as of `run`, operator: Operator."""
    graph.begin(parameters_of_all(graph.scenario, graph.bag, 0))
    try:
        lockstep.watch(graph, operator, tracks, progress)
    except KeyboardInterrupt:
        graph.stop()
        return Outcome(graph.result(nodes.DRIVE_NODE), graph.result('recorder'), stopped=True)
    return Outcome(graph.outcome(nodes.DRIVE_NODE), graph.outcome('recorder'))


def _in_realtime(graph, operator, tracks, progress):
    """Run a graph in realtime and return its Outcome; arguments as of `run`, operator: Operator."""
    supervisor.prepare(graph.scenario)
    start = begins(graph.scenario)
    for track in tracks.values():
        messages.put_stamp(track.header.stamp, start)
    graph.begin(parameters_of_all(graph.scenario, graph.bag, start))
    supervised = supervisor.Supervisor(graph, operator, start)
    try:
        supervised.watch(tracks, progress)
        stopped = False
    except KeyboardInterrupt:
        stopped = True
    graph.stop()
    recorder = graph.result('recorder') if stopped else graph.outcome('recorder')
    return Outcome(graph.result(nodes.DRIVE_NODE), recorder, supervised.restarts.count, supervised.losses.count,
                   stopped)


def send_program(plan, start=None, ros_arguments=()) -> int:
    """Send the program track of a program.Plan to a running ACU and keep it latched until Ctrl-C.

    start: UTC at which the time of the track is 0 [ns]; None: the graph.start of the ACU, which is requested from it.
    ros_arguments: arguments of ROS for the sending node, such as the namespace of the graph.
    """
    beams = plan.scenario.header.graph_beams
    middleware.initialise(ros_arguments)
    try:
        operator = Operator(beams)
        executor = SingleThreadedExecutor()
        executor.add_node(operator)
        tracks = plan.tracks
        if start is None:
            acu = nodes.members(('acu',), beams)[0]
            print(f'requests graph.start of {acu} on ROS_DOMAIN_ID {operator.context.get_domain_id()}', flush=True)
            start = operator.graph_start(acu, executor)
        for track in tracks.values():
            messages.put_stamp(track.header.stamp, start)
        operator.send(tracks)
        print(f'{", ".join(tracks) or "no program track"} sent; latched for late joiners until Ctrl-C', flush=True)
        while True:
            executor.spin_once(timeout_sec=0.2)
    except KeyboardInterrupt:
        return 0
    finally:
        rclpy.try_shutdown()
