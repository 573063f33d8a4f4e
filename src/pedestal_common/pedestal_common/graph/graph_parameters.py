"""What every node is told about its graph (ROS parameters `graph.*`). No ROS here."""
import dataclasses

from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.nodes import MAX_BEAMS
from pedestal_common.graph.steps import NS_PER_SECOND


def topic_flags(names):
    """Return the base of a parameter dataclass that has the flag of each of these topics that has one."""
    flagged = {}
    for topic in map(topics.TOPIC_BY_NAME.get, names):
        if topic.flag:
            flagged.setdefault(topic.flag, []).append(topic.name)
    return dataclasses.make_dataclass('TopicFlags', [
        (name, bool, parameters.flag(False, f'the graph has {" and ".join(of_flag)}'))
        for name, of_flag in flagged.items()], bases=(parameters.Parameters,), frozen=True)


@dataclasses.dataclass(frozen=True)
class GraphParameters(parameters.Parameters):
    """What every node is told about the run (ROS parameters `graph.*`)."""
    pacing: str = parameters.choice('realtime', ('lockstep', 'realtime'), 'who waits for whom')
    nodes: str = parameters.text('', 'names of the nodes of this run, comma separated; each waits for its readers '
                                 'among them')
    beams: int = parameters.parameter(0, 0, MAX_BEAMS, '', 'beams of an electronic array, each of several in '
                                      'its namespace beam_i; 0: a drive with motors')
    deadline: float = parameters.parameter(180.0, 0.1, 3600.0, 's', 'wall-clock time a silent node is waited for')
    start: int = parameters.parameter(0, 0, 2**31 * NS_PER_SECOND, 'ns',
                                      'realtime: UTC at which the time of the scenario is '
                                      '0; 0: the day begins')
    future: float = parameters.parameter(0.05, 1e-3, 10.0, 's', 'realtime: a stamp further ahead of the time of this '
                                         'node is refused')
    silence: float = parameters.parameter(0.2, 0.02, 60.0, 's', 'realtime: a node without its first input for this '
                                          'long says so')
    priority: int = parameters.parameter(0, 0, 98, '', 'realtime: priority (SCHED_RR) of the nodes that have a step '
                                         'to make, where the system allows it, one more of the drive; 0: that of any '
                                         'process')

    def check(self):
        """Raises ParameterError for a name in `nodes` that is no node."""
        for name in self._names:
            if name not in nodes.NODE_NAMES:
                raise parameters.ParameterError(f"nodes = '{self.nodes}': '{name}' is none of "
                                                f'{", ".join(nodes.NODE_NAMES)}')

    @property
    def members(self):
        """`nodes` as a tuple, with the nodes of every beam."""
        return nodes.members(self._names, self.beams)

    @property
    def _names(self):
        return tuple(name for name in self.nodes.replace(' ', '').split(',') if name)

    @property
    def lockstep(self):
        """Whether every step waits for everybody."""
        return self.pacing == 'lockstep'
