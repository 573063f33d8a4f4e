"""Header of a scenario: its section `scenario`, the parameters that belong to no single node."""
import dataclasses
import shlex

from pedestal_bringup.scenario.link import DishParameters, LinkParameters
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.graph.graph_parameters import GraphParameters
from pedestal_common.quantities import Value


@dataclasses.dataclass(frozen=True)
class ProgramParameters(parameters.Parameters):
    """Parameters of the program track that the operator sends to the control unit (ACU) before the run."""
    source: str = parameters.choice('target', ('target', 'none'), 'source of the program track; none: no track')
    interval: float = parameters.parameter(1.0, 0.002, 60.0, 's', 'time between two points')
    time_offset: float = parameters.parameter(0.0, -60.0, 60.0, 's', 'time by which the prediction lags the target; '
                                              'negative: it leads')
    azimuth_offset: float = parameters.parameter(0.0, -0.2, 0.2, 'rad', 'error of the predicted azimuth')
    elevation_offset: float = parameters.parameter(0.0, -0.2, 0.2, 'rad', 'error of the predicted elevation')
    refractivity: float = parameters.parameter(0.0, 0.0, 500.0, 'N', 'measured refractivity of the air, whose '
                                               'refraction is added to the prediction; 0: no refraction; only for an '
                                               'ACU with refraction.kind none or refraction.program apparent')
    light_time: bool = parameters.flag(False, 'travel time of the wave is part of the prediction')


RECEIVERS = 'simulated', 'simulated-iq'     # the simulated receivers

PROGRAM_ERRORS = {'program.time_offset': 's', 'program.azimuth_offset': 'rad', 'program.elevation_offset': 'rad'}


@dataclasses.dataclass(frozen=True)
class RestartParameters(parameters.Parameters):
    """Parameters of the restarts of nodes whose process dies in a realtime `pedestal run`. In lockstep a dead node
    ends the run."""
    attempts: int = parameters.parameter(5, 0, 1_000_000, '', 'largest number of restarts of a node in the time '
                                         '`within`; 0: no restart')
    within: float = parameters.parameter(60.0, 1.0, 86400.0, 's', 'time in which the restarts of a node are counted')
    delay: float = parameters.parameter(0.5, 0.0, 60.0, 's', 'delay that each further restart in `within` adds; the '
                                        'first restart has none')
    silence: float = parameters.parameter(30.0, 0.0, 3600.0, 's', 'time without diagnostics after which a node is '
                                          'killed and started again; 0: never')


@dataclasses.dataclass(frozen=True)
class OwnParameters(parameters.Parameters):
    """Parameters that name programs of the user, ROS 2 nodes which `pedestal run` starts in the place of its own."""
    receiver: str = parameters.text('', 'program in the place of the receiver: FILE.py or PACKAGE/EXECUTABLE, and its '
                                    'arguments')
    ship: str = parameters.text('', 'program in the place of the ship and its IMU, likewise')
    ins: str = parameters.text('', 'program in the place of the INS, likewise')
    drive: str = parameters.text('', 'program in the place of the drive, likewise; it makes the steps')

    def check(self) -> None:
        """Raise ParameterError for a text that names no program."""
        for option, program in parameters.as_dict(self).items():
            try:
                file = (shlex.split(program) or [''])[0]
            except ValueError as error:
                raise parameters.ParameterError(f'{option} = {program!r}: {error}') from None
            if program and not file.endswith('.py') and file.count('/') != 1:
                raise parameters.ParameterError(f'{option} = {program!r}: must begin with FILE.py or '
                                                'PACKAGE/EXECUTABLE')


def _of_graph(name: str) -> Value:
    """Return a field of the header for the parameter graph.NAME, which the header gives to every node."""
    field = GraphParameters.__dataclass_fields__[name]
    return dataclasses.field(default=field.default, metadata=field.metadata)


@dataclasses.dataclass(frozen=True)
class ScenarioParameters(parameters.Parameters):
    """Header of a scenario: its section `scenario`, the parameters that belong to no single node."""
    title: str = parameters.text('', 'description in one line')
    duration: float = parameters.parameter(60.0, 0.1, 86400.0, 's', "length of the run in the drive's time")
    pacing: str = parameters.choice('lockstep', ('lockstep', 'realtime'), 'pacing of the steps: by the '
                                    'messages of the nodes, or by the clock')
    seed: int = parameters.parameter(1, 0, 2**31 - 1, '', 'seed of every noise stream')
    ship: bool = parameters.flag(False, 'the pedestal is on a ship: the nodes ship_motion and ins take part')
    beam: bool = parameters.flag(False, 'the drive is an electronically steered array: beam_steering_node')
    drives: str = parameters.choice('adu', ('adu', 'simulated'), 'adu: the drive unit with its simulated mechanics; '
                                    'simulated: drive_node with four simulated CiA 402 drives on a CAN bus')
    receiver: str = parameters.choice('simulated', RECEIVERS, 'simulated: the receiver with its '
                                      'simulated target; simulated-iq: monopulse_receiver_node with simulated I/Q '
                                      'samples')
    beams: int = parameters.parameter(1, 1, nodes.MAX_BEAMS, '', 'number of beams of the array; with several beams, '
                                      'each has receiver and ACU in a namespace beam_1 ...')
    deadline: float = _of_graph('deadline')
    priority: int = _of_graph('priority')
    program: ProgramParameters = parameters.group(ProgramParameters)
    dish: DishParameters = parameters.group(DishParameters)
    link: LinkParameters = parameters.group(LinkParameters)
    restart: RestartParameters = parameters.group(RestartParameters)
    own: OwnParameters = parameters.group(OwnParameters)

    def check(self) -> None:
        """Raise ParameterError for several beams of a drive with motors, for servo drives or I/Q of an array, and for
        a program of the user that does not fit the graph."""
        if self.servo and self.beam:
            raise parameters.ParameterError(f'drives = {self.drives}: must be adu with beam = true')
        if self.iq and self.beam:
            raise parameters.ParameterError(f'receiver = {self.receiver}: must be simulated with beam = true')
        if self.beams > 1 and not self.beam:
            raise parameters.ParameterError(f'beams = {self.beams}: must be 1 unless beam = true')
        own = self.own
        for option, fits, needed in (
                ('ship', self.ship, 'ship = true'), ('ins', self.ship, 'ship = true'),
                ('receiver', not self.iq, 'receiver = simulated'), ('receiver', self.beams == 1, 'beams = 1'),
                ('drive', not self.servo, 'drives = adu'), ('drive', not self.beam, 'beam = false')):
            if getattr(own, option) and not fits:
                raise parameters.ParameterError(f'own.{option} = {getattr(own, option)}: needs {needed}')

    @property
    def servo(self) -> bool:
        """True if drive_node takes the place of the drive unit."""
        return self.drives != 'adu'

    @property
    def iq(self) -> bool:
        """True if monopulse_receiver_node takes the place of the simulated receiver."""
        return self.receiver != 'simulated'

    @property
    def simulated_parts(self) -> tuple[str, ...]:
        """Nodes that simulate a part of the equipment for a node that is made for real equipment."""
        return ((nodes.SIMULATED_DRIVES.name,) if self.servo else ()) + ((nodes.SIMULATED_IQ.name,) if self.iq else ())

    @property
    def own_programs(self) -> dict[str, str]:
        """{node: program of the user in its place, with its arguments}."""
        return {nodes.OWN_PLACES[option]: program for option, program in parameters.as_dict(self.own).items()
                if program}

    @property
    def graph_beams(self) -> int:
        """Number of beams of an electronically steered array, 0 for a drive with motors (the convention of
        nodes.links)."""
        return self.beams if self.beam else 0
