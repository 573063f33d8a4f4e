"""Watch of a lockstep run: every node is needed for the next step, so a node that dies or is silent ends the run with
its name."""
import time

from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.graph.processes import RunError, exit_description
from pedestal_common.graph import nodes

SELF_ENDING_NODES = (nodes.DRIVE_NODE, 'recorder')
"""Nodes that end by themselves at the end of the run."""


def watch(graph, operator, tracks, progress):
    """Watch the nodes from their start to their end. progress(the drive's time [s]). Raises RunError."""
    header = graph.scenario.header
    sent = False
    executor = SingleThreadedExecutor()
    executor.add_node(operator)

    def stuck(names):
        return operator.stuck(names, executor)

    while graph.ended().get(nodes.DRIVE_NODE) != 0:
        executor.spin_once(timeout_sec=0.1 if sent else 0.02)
        sent = sent or operator.send_to(graph.scenario.nodes, tracks)
        progress(operator.time)
        if any(code != 0 or node not in SELF_ENDING_NODES for node, code in graph.ended().items()):
            raise failure(graph, stuck, operator.silent(header.deadline))
        mute = operator.silent(2.0 * header.deadline)
        if mute:
            raise failure(graph, stuck, mute)
    progress(header.duration)
    if not graph.stop():
        raise failure(graph, stuck)


def failure(graph, stuck, unheard=None):
    """Return the error of a run in which a node has ended too early, or the node `unheard` is silent.

    stuck(names) -> nodes that do not answer. A node may accuse a node that itself waits for the stuck node. Once the
    drive has ended, all other nodes get a signal to end, so only an exit code other than 0 counts as too early.
    """
    time.sleep(0.5)
    ended = graph.ended()
    ending = graph.processes if ended.get(nodes.DRIVE_NODE) == 0 else SELF_ENDING_NODES
    early = {node: code for node, code in ended.items() if code != 0 or node not in ending}
    lines = {node: graph.last_lines(node) for node in graph.processes}
    accused = {name for node in early for name in graph.result(node).get('silent', ())}
    killed = [node for node, code in early.items() if code < 0]
    silent = [node for node in graph.processes if node in accused and node not in early] or [
        node for node in (unheard,) if node is not None and node not in early]
    if silent and not killed:
        mute = stuck([node for node in graph.processes if node not in early])
        # A node that waits for the recorder's acknowledgement does not answer either; the recorder waits for no node.
        silent = [node for node in mute if node == 'recorder'] or [
            node for node in silent if node in mute] or mute or silent
    culprit = (killed or silent or list(early))[0]
    if culprit in killed:
        reason = exit_description(early[culprit])
    elif culprit in silent:
        reason = 'has fallen silent'
    else:
        reason = f'ended before the run did, with exit code {early[culprit]}'
    others = ''.join(f'\n  {node}: {lines[node][-1]}' for node in early if node != culprit and lines[node])
    return RunError(graph.exit_report(culprit, reason) + others)
