"""Parameters of every node about its graph (ROS parameters `graph.*`). No ROS here."""
import dataclasses
from collections.abc import Iterable

from pedestal_common import parameters
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.nodes import MAX_BEAMS
from pedestal_common.graph.steps import NS_PER_SECOND


def topic_flags(names: Iterable[str]) -> type[parameters.Parameters]:
    """Return a base class for a parameter dataclass, with a field for the flag (Topic.flag) of each topic."""
    flagged: dict[str, list[str]] = {}
    for topic in map(topics.TOPIC_BY_NAME.__getitem__, names):
        if topic.flag:
            flagged.setdefault(topic.flag, []).append(topic.name)
    return dataclasses.make_dataclass('TopicFlags', [
        (name, bool, parameters.flag(False, f'the graph has {" and ".join(of_flag)}'))
        for name, of_flag in flagged.items()], bases=(parameters.Parameters,), frozen=True)


@dataclasses.dataclass(frozen=True)
class GraphParameters(parameters.Parameters):
    """Parameters of every node about the run (ROS parameters `graph.*`)."""
    pacing: str = parameters.choice('realtime', ('lockstep', 'realtime'), 'pacing of the steps: by the messages of '
                                    'the nodes, or by the clock')
    nodes: str = parameters.text('', 'names of the nodes of this run, comma separated; each waits for its '
                                 'subscribers among them')
    beams: int = parameters.parameter(0, 0, MAX_BEAMS, '', 'number of beams of an electronic array, each of several '
                                      'in its namespace beam_i; 0: a drive with motors')
    deadline: float = parameters.parameter(180.0, 0.1, 3600.0, 's', 'longest wait for a silent node, wall-clock time')
    start: int = parameters.parameter(0, 0, 2**31 * NS_PER_SECOND, 'ns', 'realtime: UTC at which the time of the '
                                      'scenario is 0; 0: beginning of the day')
    future: float = parameters.parameter(0.05, 1e-3, 10.0, 's', 'realtime: largest accepted lead of a stamp over the '
                                         'time of this node')
    silence: float = parameters.parameter(0.2, 0.02, 60.0, 's', 'realtime: time without the trigger after which a '
                                          'node reports its silence')
    priority: int = parameters.parameter(0, 0, 98, '', 'realtime: priority (SCHED_RR) of the nodes with a unit, where '
                                         'the system allows it, one more for the drive; 0: the default scheduling')

    scenario: str = parameters.text('', 'name of the scenario of the run; empty: a graph started by hand')
    own: str = parameters.text('', 'programs of the user in the place of nodes, which `pedestal run` has found: JSON '
                               '{node: [topics that it reads, topics that it publishes]}')
    simulated: bool = parameters.flag(False, 'simulated antenna, as in `pedestal run`; false: in realtime each node '
                                      'names at its start the values for an antenna that are not given')

    def check(self) -> None:
        """Raise ParameterError for a name in `nodes` that is no node, or an invalid `own`."""
        try:
            nodes.own_rows(self.own)
        except ValueError as error:
            raise parameters.ParameterError(str(error)) from None
        known = (*nodes.NODE_NAMES, *nodes.SIMULATED_PARTS)
        for name in self._names:
            if name not in known:
                raise parameters.ParameterError(f"nodes = '{self.nodes}': '{name}': must be one of "
                                                f'{", ".join(known)}')

    @property
    def members(self) -> tuple[str, ...]:
        """`nodes` as a tuple, with the nodes of every beam."""
        return nodes.members(self._names, self.beams)

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(name for name in self.nodes.replace(' ', '').split(',') if name)

    @property
    def lockstep(self) -> bool:
        """True if every step waits for all its inputs."""
        return self.pacing == 'lockstep'
