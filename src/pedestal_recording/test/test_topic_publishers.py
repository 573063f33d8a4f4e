"""Test of the publishers that the recorder distinguishes by their sequence numbers."""
import pytest

from pedestal_common.graph import nodes
from pedestal_recording.recorder_node import TopicPublishers

LINK = nodes.links(0)['acu/rate_command']


class Node:
    """Graph of the test: the clock, and the nodes that publish the topic."""
    graph = type('Graph', (), {'members': ('acu', 'adu')})

    def __init__(self):
        self.time, self.publishers = 0, ['acu']

    def clock(self):
        return self.time, self.time

    def publishers_of(self, ros_name):
        assert ros_name == LINK.name
        return self.publishers


@pytest.mark.parametrize('lead', [40, 120, 200])
def test_no_message_of_the_graph_is_marked_after_a_foreign_publisher_left_with_the_same_numbers(lead):
    """A foreign publisher of 200 Hz begins `lead` numbers behind the control unit of 100 Hz, and leaves near it."""
    node = Node()
    publishers = TopicPublishers(node, LINK)
    begin = lead * 10_000_000
    end = begin + 2 * lead * 5_000_000
    sent = [(time, 1 + number, True) for number, time in enumerate(range(0, end + 3_000_000_000, 10_000_000))]
    sent += [(time, 1 + number, False) for number, time in enumerate(range(begin + 2_000_000, end, 5_000_000))]
    marked = {True: 0, False: 0}
    for node.time, number, of_graph in sorted(sent):
        # DDS shows a publisher that left for some time after its last message.
        node.publishers = ['acu', 'stranger'] if begin <= node.time < end + 600_000_000 else ['acu']
        if not publishers.take(b'', {'publication_sequence_number': number, 'source_timestamp': node.time}):
            marked[of_graph] += 1
    assert marked[True] == 0
    assert marked[False] > 0
    assert publishers.lost == 0
