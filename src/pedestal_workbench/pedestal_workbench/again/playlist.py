"""Playlist of a replay: the recorded messages in the order of stamps; a message without a header has its log time.

Messages with equal stamps are in this order:

1. latched topics. All subscribers acknowledge such a message before the next message, as with Shell.announce.
2. the other topics of the table of topics, in the order of the table
3. topics outside the table
4. within a topic, the order of the file
"""
import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pedestal_common.graph import nodes, topics
from pedestal_common.graph.nodes import Link
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import Nanoseconds, Seconds
from pedestal_recording import bag as bags


def reads(graph: Mapping[str, Link], node: str, name: str) -> bool:
    """Return True if a node of the graph subscribes to a topic; the recorder subscribes to all topics."""
    return node == 'recorder' or name in graph and node in graph[name].readers


def writes(graph: Mapping[str, Link], node: str, name: str) -> bool:
    """Return True if a node of the graph publishes a topic."""
    return name in graph and node in graph[name].writers


def latched(graph: Mapping[str, Link], name: str) -> bool:
    """Return True if a topic of the graph is latched."""
    return name in graph and topics.QOS_BY_RATE[graph[name].rate].latched


def selected_topics(bag: bags.Bag, input_nodes: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return the topics to replay: those of `names`, or else the inputs of `input_nodes` that none of these nodes
    publishes, or else all.

    Raises ValueError for an unknown node, BagError for a topic or all inputs of a node that are not in the bag.
    """
    if names:
        return bags.chosen_topics(bag, names)
    if not input_nodes:
        return list(bag.topics)
    chosen: list[str] = []
    graph, known = bag.graph, nodes.members(nodes.NODE_NAMES, bag.beams)
    for node in input_nodes:
        if node not in known:
            raise ValueError(f'--node {node}: unknown node;{did_you_mean(node, known)} must be one of '
                             f'{", ".join(known)}')
        inputs = [name for name in bag.topics
                  if reads(graph, node, name) and not any(writes(graph, other, name) for other in input_nodes)]
        if not inputs:
            wanted = ', '.join(name for name in graph if reads(graph, node, name))
            raise bags.BagError(f'{bag.path}: no input of node {node} in the bag; its inputs are {wanted}')
        chosen += inputs
    return list(dict.fromkeys(chosen))


class Playlist:
    """Messages of some topics of a bag, in the order that the module states. start: counted from `origin`.

    Because a latched message stays valid, the last message of each latched topic before the start comes first.
    Raises BagError if there are no messages, ValueError if there are none from the start on.
    """

    def __init__(self, bag: bags.Bag, names: Sequence[str], start: Seconds, duration: Seconds | None) -> None:
        self.bag, self.names = bag, names
        rows_of, stamps_of, ranks_of = [], [], []
        # The rank of a latched topic is negative, so latched topics come first among equal stamps.
        rank = {name: number - len(bag.graph) * latched(bag.graph, name) for number, name in enumerate(bag.graph)}
        for name in names:
            rows = bag.where(name)
            rows_of.append(rows)
            stamps_of.append(bag.index.stamp[rows])
            ranks_of.append(np.full(rows.size, rank.get(name, len(rank))))
        where, stamps, ranks = np.concatenate(rows_of), np.concatenate(stamps_of), np.concatenate(ranks_of)
        if not where.size:
            raise bags.BagError(f'{bag.path}: no message of {", ".join(names)}')
        order = np.lexsort((where, ranks, stamps))
        where, stamps, ranks = where[order], stamps[order], ranks[order]
        # of the first message of a topic that is not latched, and of the last message of the bag
        self.origin = int(stamps[ranks >= 0][0] if (ranks >= 0).any() else stamps[0])
        self.end = int(stamps[-1])
        begin = self.origin + round(start * NS_PER_SECOND)
        stop = begin + round(duration * NS_PER_SECOND) if duration is not None else self.end
        # The last message of each latched topic before the beginning is moved to the first stamp.
        before = np.flatnonzero((ranks < 0) & (stamps < begin))
        held = np.array([before[ranks[before] == topic][-1] for topic in np.unique(ranks[before])], int)
        inside = np.flatnonzero((stamps >= begin) & (stamps <= stop))
        if not inside.size:
            raise ValueError(f'--start {start:g} s: {bag.path} has no message from there on; the recording is '
                             f'{(self.end - self.origin) / NS_PER_SECOND:g} s long')
        self.first, self.last = int(stamps[inside[0]]), int(stamps[inside[-1]])
        stamps[held] = self.first
        chosen = np.concatenate((held, inside))
        self._where, self._stamps = where[chosen], stamps[chosen]

    def steps(self) -> Iterator[tuple[Nanoseconds, Iterator[tuple[str, bytes]]]]:
        """Yield (stamp, iterator of (topic, CDR bytes)) for each stamp in order."""
        rows = zip(self._stamps.tolist(), self.bag.take(self.bag.index[self._where]))
        for stamp, group in itertools.groupby(rows, lambda row: row[0]):
            yield stamp, ((name, data) for _, (name, _, _, data) in group)
