"""Parameters of the recorder node."""
import dataclasses

from pedestal_common.graph import topics
from pedestal_common.graph.graph_parameters import topic_flags
from pedestal_common.parameters import ParameterError, parameter, text


@dataclasses.dataclass(frozen=True)
class RecorderParameters(topic_flags(topics.TOPIC_BY_NAME)):
    """What is recorded where. All but `bag` and `duration` go into the bag, to say how it was made."""
    bag: str = text('recording', 'directory of the bag; must not exist, or be the unfinished one of this realtime run')
    duration: float = parameter(0.0, 0.0, 86400.0, 's', "end at this stamp of the drive's time; 0: when told to stop")
    scenario: str = text('', 'name of the scenario of the run')
    beamwidth: float = parameter(0.0175, 1e-4, 0.5, 'rad', "half-power beamwidth, for the report's scale")
    seed: int = parameter(1, 0, 2**31 - 1, '', 'seed of the run')
    scenario_yaml: str = text('', 'the scenario of the run as a ROS 2 parameter file')
    parameters_yaml: str = text('', 'every parameter of every node of the run as YAML, {node: {name: value}}')

    def check(self):
        """Raises ParameterError without a bag."""
        if not self.bag:
            raise ParameterError("bag = '': must be a directory that does not exist")
