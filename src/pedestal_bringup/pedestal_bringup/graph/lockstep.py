"""Watch of a lockstep run by `pedestal run`. Every node is needed for the next step, so a node that dies or is silent
ends the run. The error names this node."""
import time
from collections.abc import Callable, Mapping, Sequence

from rclpy.executors import SingleThreadedExecutor

from pedestal_bringup.graph.operator_node import Operator
from pedestal_bringup.graph.processes import Graph, exit_description
from pedestal_common.graph import nodes
from pedestal_common.node import middleware
from pedestal_common.quantities import Message, Seconds

ACCUSATION_TIME_S = 0.5
"""Time between a failure and the error message [s]. In this time the other nodes end, and name (accuse) the node for
which they waited."""

SELF_ENDING_NODES = (nodes.DRIVE_NODE, 'recorder')  # nodes that end by themselves at the end of the run


def watch(graph: Graph, operator: Operator, tracks: Mapping[str, Message],
          progress: Callable[[Seconds], object]) -> None:
    """Watch the nodes from their start to their end. The program tracks {topic: message} are sent once all nodes that
    read them are present. Raises RuntimeError."""
    header = graph.scenario.header
    sent = False
    executor = SingleThreadedExecutor()
    executor.add_node(operator)

    def stuck_nodes(names: Sequence[str]) -> list[str]:
        return operator.stuck(names, executor)

    while graph.ended().get(nodes.DRIVE_NODE) != 0:
        middleware.turn(executor, 0.1 if sent else 0.02)
        sent = sent or operator.send_to(graph.scenario.nodes, tracks)
        progress(operator.time)
        if any(code != 0 or node not in SELF_ENDING_NODES for node, code in graph.ended().items()):
            raise failure(graph, stuck_nodes, operator.silent(header.deadline))
        # The limit is twice the deadline. A node that waits in vain for another node ends by itself after one deadline
        # and names the other node, which is the better error.
        silent = operator.silent(2.0 * header.deadline)
        if silent:
            # A drive of the user publishes no diagnostics. No node waits for it, because its messages begin the steps.
            raise failure(graph, stuck_nodes, nodes.DRIVE_NODE if nodes.DRIVE_NODE in graph.scenario.own else silent)
    progress(header.duration)
    if not graph.stop():     # a node did not end with exit code 0
        raise failure(graph, stuck_nodes)


def failure(graph: Graph, stuck_nodes: Callable[[list[str]], list[str]],
            without_diagnostics: str | None = None) -> RuntimeError:
    """Return the RuntimeError of a run in which a node has ended too early, or is without diagnostics for too long.

    The error names the first node found in this order: a node killed by a signal, a stuck or accused node, a node that
    ended. A node that ends because it waited in vain accuses the node that it waited for, which may itself wait for
    the stuck node. Once the drive has ended without error, an end with exit code 0 is not too early.
    """
    time.sleep(ACCUSATION_TIME_S)
    ended = graph.ended()
    ending = graph.processes if ended.get(nodes.DRIVE_NODE) == 0 else SELF_ENDING_NODES
    early = {node: code for node, code in ended.items() if code != 0 or node not in ending}
    lines = {node: graph.last_lines(node) for node in graph.processes}
    accused = {name for node in early for name in graph.result(node).get('silent', ())}
    killed = [node for node, code in early.items() if code < 0]
    suspects = [node for node in graph.processes if node in accused and node not in early] or [
        node for node in (without_diagnostics,) if node is not None and node not in early]
    if suspects and not killed:
        stuck = stuck_nodes([node for node in graph.processes if node not in early])
        # A node that waits for the acknowledgement of the recorder does not answer either. Because the recorder waits
        # for no node, a stuck recorder is the cause and is named first.
        suspects = [node for node in stuck if node == 'recorder'] or [
            node for node in suspects if node in stuck] or stuck or suspects
    culprit = (killed or suspects or list(early))[0]
    if culprit in killed:
        reason = exit_description(early[culprit])
    elif culprit in suspects:
        reason = 'has fallen silent'
    else:
        reason = f'ended before the run did, with exit code {early[culprit]}'
    others = ''.join(f'\n  {node}: {lines[node][-1]}' for node in early if node != culprit and lines[node])
    return RuntimeError(graph.exit_report(culprit, reason) + others)
