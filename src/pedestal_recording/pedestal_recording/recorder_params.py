"""Parameters of the recorder node."""
import dataclasses

from pedestal_common.graph import topics
from pedestal_common.graph.graph_parameters import topic_flags
from pedestal_common.parameters import ParameterError, parameter, text


@dataclasses.dataclass(frozen=True)
class RecorderParameters(topic_flags(topics.TOPIC_BY_NAME)):  # type: ignore[misc]  # a field per flag of the topics
    """Destination of the recording, and a description of the run for the metadata of the bag."""
    bag: str = text('recording',
                    'directory of the bag; must not exist, or hold the unfinished recording of this realtime run')
    duration: float = parameter(0.0, 0.0, 86400.0, 's', 'run time at which the recording ends; 0: no limit')
    scenario: str = text('', 'name of the scenario')
    beamwidth: float = parameter(0.0175, 1e-4, 0.5, 'rad', 'half-power beamwidth, for the scale of the report')
    seed: int = parameter(1, 0, 2**31 - 1, '', 'seed of the run')
    scenario_yaml: str = text('', 'scenario of the run as a ROS 2 parameter file')
    parameters_yaml: str = text('', 'parameters of all nodes of the run as YAML, {node: {name: value}}')

    def check(self) -> None:
        """Raise ParameterError if `bag` is empty."""
        if not self.bag:
            raise ParameterError("bag = '': must be a directory that does not exist")
