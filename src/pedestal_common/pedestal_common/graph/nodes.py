"""Table of the nodes of the graph: their executables, and the topics that they read and write. No ROS here.

In an electronic array of several beams the nodes `of_beam` and their topics exist once per beam, with the prefix
`beam_1/` ... `beam_N/`; all other nodes and topics are shared.
"""
import functools
import importlib
import json
import re
import typing
from collections.abc import Callable, Collection, Iterable

import numpy as np

from pedestal_common.graph.topics import REALTIME_RATES, STATION_RATE, TOPIC_BY_NAME, TOPICS
from pedestal_common.parameters import AnyParameters

MAX_BEAMS = 16  # largest number of beams of an electronic array
REPLAY_NODE = 'replay'  # name of the node that replays a recording to the other nodes
DRIVE_NODE = 'adu'  # name of the node that owns the time


class Node(typing.NamedTuple):
    """Row of the table: one node."""
    name: str                       # in the graph
    program: str = ''               # PACKAGE.EXECUTABLE; '' for a node without a process of its own
    parameters: str = ''            # module and name of its parameter class
    unit: str = ''                  # module and name of its unit (unit.Unit); '' for a node without a law
    reads: tuple[str, ...] = ()     # topics that it subscribes to; the first is the trigger, which begins its steps
    writes: tuple[str, ...] = ()    # topics that it publishes; other nodes wait for the first of these
    answer: str = ''                # topic with which it answers every step, with the same stamp; '': it answers late
    obeys: str = ''                 # topic of its commands, from any client
    replies: str = ''               # topic of its replies
    doc: str = ''                   # its task
    stands_for: str = ''            # the equipment that replaces it on a real antenna
    of_beam: bool = False           # each beam of an array has a node of its own
    optional: bool = False          # the other nodes run without it in a graph that does not name it
    runs: str = 'pedestal_common.node.unit_node:UnitNode'   # module and name of the class of its process

    @property
    def package(self) -> str:
        """ROS package of the node."""
        return self.program.partition('.')[0]

    @property
    def executable(self) -> str:
        """Name of its executable in that package."""
        return self.program.rpartition('.')[2]

    def node_type(self) -> Callable[['Node'], typing.Any]:      # a Shell, which this module must not import
        """Return the class of its process; node.run makes the node from its row."""
        return _named(self.runs)

    def parameters_type(self) -> type[AnyParameters]:
        """Return its parameter dataclass."""
        return _named(self.parameters)

    def unit_type(self) -> type[typing.Any]:    # a Unit, which this package must not import
        """Return the class of its unit."""
        return _named(self.unit)


def _named(path: str) -> type:
    module, _, name = path.partition(':')
    return getattr(importlib.import_module(module), name)


NODES = (
    Node('ship_motion', 'ship_motion_sim.ship_motion_node', 'ship_motion_sim.params:ShipMotionParameters',
         'ship_motion_sim.ship_unit:ShipMotion',
         reads=('clock',),
         writes=('ship/truth', 'ship/imu/data_raw'),
         answer='ship/truth', obeys='ship_motion/inject', replies='ship_motion/injected',
         doc='ship on a seaway, its IMU', stands_for='ship and IMU', optional=True,
         runs='ship_motion_sim.ship_motion_node:ShipMotionNode'),
    Node('ins', 'ship_motion_sim.ins_node', 'ship_motion_sim.params:InsParameters', 'ship_motion_sim.ins_unit:Ins',
         reads=('ship/imu/data_raw',),
         writes=('ship/imu/data', 'ins/state', 'ins/error'),
         obeys='ins/inject', replies='ins/injected',
         doc='attitude and deck rate: the true attitude with a parametrised error, or strapdown alignment and '
         'navigation with the data of the IMU',
         stands_for='INS', optional=True),
    Node('tracking_receiver', 'tracking_receiver_sim.tracking_receiver_node',
         'tracking_receiver_sim.params:TrackingReceiverNodeParameters', 'tracking_receiver_sim.unit:TrackingReceiver',
         reads=('adu/truth', 'ship/truth'),
         writes=('tracking_receiver/angle_error', 'tracking_receiver/angle_rate', 'tracking_receiver/range',
                 'target/truth'),
         answer='target/truth', obeys='tracking_receiver/inject', replies='tracking_receiver/injected',
         doc='target and monopulse receiver', stands_for='receiver and RF', of_beam=True),
    Node('acu', 'acu_tracker.acu_node', 'acu_tracker.params:AcuParameters', 'acu_tracker.unit:Acu',
         reads=('joint_states', 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate',
                'tracking_receiver/range', 'ship/imu/data', 'ins/error', 'adu/state', 'adu/stow_pins', 'ins/state',
                'acu/program_track', 'weather/pressure', 'weather/temperature', 'weather/humidity'),
         writes=('acu/rate_command', 'acu/estimate', 'acu/reference', 'acu/filter', 'acu/mode', 'acu/keyhole',
                 'acu/blockage', 'acu/alarms', 'acu/stow_pins', 'acu/pointing'),
         answer='acu/rate_command',
         obeys='acu/command', replies='acu/command_result',
         doc='antenna control unit: filter, modes, position loop',
         stands_for='nothing: this node is the real control unit', of_beam=True,
         runs='acu_tracker.acu_node:AcuNode'),
    Node(DRIVE_NODE, 'adu_drive.adu_node', 'drive_law.params:AduNodeParameters', 'adu_drive.unit:Adu',
         reads=('clock', 'acu/rate_command', 'ship/truth', 'acu/stow_pins'),
         writes=('joint_states', 'adu/truth', 'clock', 'adu/motor_states', 'adu/state', 'adu/stow_pins'),
         answer='joint_states', obeys='adu/inject', replies='adu/injected',
         doc='antenna drive unit: two axes, two motors each, with the simulated mechanics; its clock sets the steps '
         'of all nodes',
         stands_for='servo drive and pedestal', runs='adu_drive.adu_node:AduNode'),
    Node('recorder', 'pedestal_recording.recorder_node', 'pedestal_recording.recorder_params:RecorderParameters',
         doc='writes the messages of every topic, as received, into a rosbag2 directory',
         runs='pedestal_recording.recorder_node:RecorderNode'),
    Node('operator', reads=('diagnostics',), writes=('acu/program_track',),
         doc='sends the program track, receives diagnostics; runs inside `pedestal run`, or as `pedestal program`',
         stands_for='the operator'),
    Node('weather_station', writes=('weather/pressure', 'weather/temperature', 'weather/humidity'),
         doc='measures the weather for the refraction; no program of this project, and not simulated',
         stands_for='the weather station'),
    Node('station', writes=('station/night', 'station/log'), obeys='station/command',
         replies='station/command_result',
         doc='takes the passes of a plan one after another; is `pedestal station`, a program beside the graph',
         stands_for='the operator'),
)
"""Rows of the nodes, in the order in which a graph is started. Nodes with a unit also publish `diagnostics`."""

ARRAY_DRIVE = Node(DRIVE_NODE, 'adu_drive.beam_steering_node', 'adu_drive.array.params:BeamParameters',
                   'adu_drive.array.beam_unit:Beam',
                   reads=('clock', 'acu/reference'),
                   writes=('joint_states', 'adu/truth', 'clock', 'adu/state'),
                   answer='joint_states',
                   doc='electronically steered array in place of the drive (`beam: true`), without motors',
                   stands_for='beam steering computer and array', runs='adu_drive.beam_steering_node:BeamSteeringNode')
"""Drive of an array: it follows angles instead of rates, and the motion of the ship exerts no torque on it."""

SERVO_DRIVE = Node(DRIVE_NODE, 'pedestal_hardware.drive_node', 'pedestal_hardware.params:ServoDriveParameters',
                   'pedestal_hardware.unit:ServoDrives',
                   reads=('clock', 'acu/rate_command'),
                   writes=('joint_states', 'clock', 'adu/motor_states', 'adu/state'),
                   answer='joint_states', replies='adu/injected',
                   doc='four CiA 402 servo drives on a CAN bus in place of the drive; two drives for each axis',
                   stands_for='nothing: this node commands the real drives',
                   runs='pedestal_hardware.drive_node:DriveNode')
"""Drive of an antenna with servo drives on a bus. Real drives publish no true direction of the dish."""

SIMULATED_DRIVES = Node('drives', 'equipment_sim.simulated_drives_node',
                        'pedestal_hardware.params:ServoDriveParameters',
                        'equipment_sim.drives.unit:SimulatedDrives',
                        reads=('clock', 'ship/truth'), writes=('adu/truth',),
                        obeys='adu/inject', replies='adu/injected',
                        doc='four simulated CiA 402 drives with the simulated mechanics, on a socketcand server',
                        stands_for='servo drives and pedestal', runs='equipment_sim.drives.drives_node:DrivesNode')
"""Simulated drives of SERVO_DRIVE. A graph that names them has servo drives."""

ROTATOR_DRIVE = Node(DRIVE_NODE, 'pedestal_hardware.rotator_node',
                     'pedestal_hardware.rotator_params:RotatorParameters', 'pedestal_hardware.rotator.unit:Rotator',
                     reads=('clock', 'acu/reference', 'acu/mode'),
                     writes=('joint_states', 'clock', 'adu/state'),
                     answer='joint_states',
                     doc='rotator with its own position loop in place of the drive, by rotctld, GS-232, EasyComm or '
                     'Rot2Prog',
                     stands_for='nothing: this node drives a real rotator',
                     runs='pedestal_hardware.rotator_node:RotatorNode')
"""Drive of a rotator: it follows angles, as an array does."""

MONOPULSE_RECEIVER = Node('tracking_receiver', 'pedestal_hardware.monopulse_receiver_node',
                          'pedestal_hardware.monopulse.params:MonopulseParameters',
                          'pedestal_hardware.monopulse.unit:MonopulseReceiver',
                          reads=('clock',), writes=('tracking_receiver/angle_error',),
                          doc='monopulse receiver of I/Q samples (VITA 49, GNU Radio by ZMQ, SigMF) in place of the '
                          'simulated receiver',
                          stands_for='nothing: this node receives the samples of a real front end',
                          runs='pedestal_hardware.monopulse.monopulse_receiver_node:MonopulseReceiverNode')
"""Receiver of the I/Q samples of an antenna."""

SIMULATED_IQ = Node('iq', 'equipment_sim.iq_node',
                    'pedestal_hardware.monopulse.params:MonopulseParameters',
                    'equipment_sim.iq.unit:SimulatedIq',
                    reads=('adu/truth', 'ship/truth'), writes=('target/truth',),
                    obeys='tracking_receiver/inject', replies='tracking_receiver/injected',
                    doc='simulated I/Q samples of target, antenna and front end, sent to the monopulse receiver',
                    stands_for='feed, front end and RF', runs='equipment_sim.iq.iq_node:IqNode')
"""Simulated samples for MONOPULSE_RECEIVER. A graph that names them has such a receiver."""

DRIVE_ROWS = (ARRAY_DRIVE, SERVO_DRIVE, SIMULATED_DRIVES, ROTATOR_DRIVE)
"""Rows of the nodes that take the place of the drive in NODES, or simulate a part of it."""


class DriveRequest(typing.NamedTuple):
    """Row of DRIVE_REQUESTS: one service of every drive."""
    name: str           # on the command line
    service: str
    key: str            # in the console
    doc: str
    free: bool = False  # True if it is open to every client at any time


DRIVE_REQUESTS = (
    DriveRequest('enable', 'adu/enable', 'e', 'release the brakes and follow commands; refused while a fault or an '
                 'emergency stop is latched'),
    DriveRequest('disable', 'adu/disable', 'd', 'stop both axes, engage the brakes, then remove the torque'),
    DriveRequest('emergency_stop', 'adu/emergency_stop', 'x', 'stop both axes, engage the brakes, and stay so until '
                 '`reset_faults`', free=True),
    DriveRequest('reset_faults', 'adu/reset_faults', 'f', 'reset latched faults and the emergency stop; refused while '
                 'an axis moves or a cause is present'))
"""Requests to the drive that a client sends without the control unit."""

DRIVE_SERVICES = tuple(request.service for request in DRIVE_REQUESTS)

LEVEL_RECEIVER = Node('tracking_receiver', 'pedestal_hardware.level_receiver_node',
                      'pedestal_hardware.level.unit:LevelReceiverParameters',
                      writes=('tracking_receiver/angle_error',),
                      doc='receiver with a level only, for step track: lines by UDP, TCP or a serial line',
                      stands_for='nothing: this node reads a real receiver', of_beam=True,
                      runs='pedestal_hardware.level.level_receiver_node:LevelReceiverNode')
"""Receiver without error channels."""

INS_INPUT = Node('ins', 'pedestal_hardware.ins_input_node', 'pedestal_hardware.ins.params:InsInputParameters',
                 writes=('ship/imu/data', 'ins/state'),
                 doc='attitude and deck rate of a real INS: NMEA sentences, or the `sensor_msgs/Imu` of its driver',
                 stands_for='nothing: this node reads a real INS', optional=True,
                 runs='pedestal_hardware.ins.ins_input_node:InsInputNode')
"""Input of a real INS. The INS publishes no statistics of its error."""

EQUIPMENT_ROWS = (LEVEL_RECEIVER, INS_INPUT)
"""Rows of the nodes that take the place of the simulated receiver or INS. They have no unit: each message of the
equipment becomes a message of the graph."""

HARDWARE_ROWS = (*DRIVE_ROWS, MONOPULSE_RECEIVER, SIMULATED_IQ, *EQUIPMENT_ROWS)
"""Rows of all nodes that take the place of a node in NODES, or simulate a part of it."""

SIMULATED_TOPICS = frozenset(topic for node in NODES for other in HARDWARE_ROWS if other.name == node.name
                             for topic in node.writes if topic not in other.writes)
"""Topics that not every node in place of a simulated one publishes, such as adu/truth."""

SIMULATED_PARTS = {SIMULATED_DRIVES.name: DRIVE_NODE, SIMULATED_IQ.name: MONOPULSE_RECEIVER.name}
"""{name of a node that simulates a part of the equipment: node that commands or receives this part}."""

SERVER_ROWS = (
    Node('rotctld', 'pedestal_operator.rotctld_node', 'pedestal_operator.rotctld_node:RotctldParameters',
         doc="serves the protocol of Hamlib's rotctld",
         runs='pedestal_operator.rotctld_node:RotctldNode'),
    Node('easycomm', 'pedestal_operator.easycomm_node', 'pedestal_operator.easycomm_node:EasycommParameters',
         doc='serves EasyComm I, II and III',
         runs='pedestal_operator.easycomm_node:EasycommNode'),
    Node('operator_page', 'pedestal_operator.operator_page', 'pedestal_operator.page_node:PageParameters',
         doc="serves the operator's page for a browser",
         runs='pedestal_operator.page_node:PageNode'),
    Node('live', 'pedestal_operator.live_node', 'pedestal_operator.live_node:LiveParameters',
         doc='serves every topic to Foxglove',
         runs='pedestal_operator.live_node:LiveNode'),
    Node('frames', 'pedestal_operator.frames_node', doc='publishes robot_description and tf, for RViz',
         runs='pedestal_operator.frames_node:FramesNode'))
"""Rows of the servers, which connect other programs to a graph and belong to none. Each reads the topics it needs."""

PASS_RECORDER = Node('pass_recorder', 'pedestal_recording.pass_recorder_node',
                     'pedestal_recording.recorder_params:RecorderParameters',
                     doc='recorder of one pass, which the station starts beside the recorder of the graph',
                     runs='pedestal_recording.recorder_node:RecorderNode')

STANDALONE_NODES = {node.executable.removesuffix('_node').removeprefix('operator_'): node
                    for node in (*HARDWARE_ROWS, *SERVER_ROWS) if node.parameters}
"""{short name of an executable, such as rotator or page: its Node}, of the nodes that are no row of NODES."""

EXECUTABLES = {node.executable: node for node in (*NODES, *HARDWARE_ROWS, *SERVER_ROWS, PASS_RECORDER) if node.program}
"""{name of an executable: its Node}."""

NODE_NAMES = tuple(node.name for node in NODES)
UNIT_NODES = (*(node for node in NODES if node.unit), ARRAY_DRIVE)  # nodes that run a unit

BEAM_TOPICS = frozenset(('joint_states', 'adu/truth', 'acu/program_track',
                         *(topic for node in NODES if node.of_beam
                           for topic in (*node.writes, node.obeys, node.replies) if topic)))
"""Topics that exist once per beam of an array: those of the nodes `of_beam`, and those that shared nodes publish per
beam."""


def row(name: str, array: bool = False, servo: bool = False, iq: bool = False) -> Node:
    """Return the Node of a name, 'beam_2/acu' as well as 'acu', in a graph with an electronic array, with servo
    drives, or with a receiver of I/Q samples."""
    if name in SIMULATED_PARTS:
        return SIMULATED_DRIVES if name == SIMULATED_DRIVES.name else SIMULATED_IQ
    if name == MONOPULSE_RECEIVER.name and iq:
        return MONOPULSE_RECEIVER
    if name == DRIVE_NODE and (array or servo):
        return ARRAY_DRIVE if array else SERVO_DRIVE
    return NODES[NODE_NAMES.index(plain(name))]


OWN_PLACES = {'receiver': 'tracking_receiver', 'ship': 'ship_motion', 'ins': 'ins', 'drive': DRIVE_NODE}
"""{name of an option of `pedestal run`: node in whose place it starts a program of the user}."""


@functools.cache
def own_rows(text: str) -> dict[str, Node]:
    """Return {name: Node} of the programs of the user in a graph. text: parameter graph.own, JSON {node: [topics that
    it reads, topics that it publishes]}, '' for none. Raises ValueError."""
    try:
        found = {name: Node(name, reads=tuple(reads), writes=tuple(writes))
                 for name, (reads, writes) in json.loads(text or '{}').items()}
    except (AttributeError, TypeError, ValueError):
        raise ValueError(f'own = {text:.60}: must be JSON {{node: [topics read, topics published]}}') from None
    for name, node in found.items():
        for wrong in ([name] if name not in OWN_PLACES.values() else
                      [topic for topic in (*node.reads, *node.writes) if topic not in TOPIC_BY_NAME]):
            raise ValueError(f'own = {text:.60}: {wrong!r:.60}: is no such node or topic of a graph')
    return found


def beam_of(name: str) -> str:
    """Return the beam in the name of a node or topic, 'beam_2' for 'beam_2/acu'; '' for a name without a beam."""
    match = re.match(r'beam_[1-9]\d*(?=/)', name)
    return match[0] if match else ''


def plain(name: str) -> str:
    """Return the name of a node or topic without its beam."""
    return name[len(beam_of(name)) + 1:] if beam_of(name) else name


def prefixes(beams: int) -> tuple[str, ...]:
    """Return the prefix of each beam's nodes and topics; ('',) for at most one beam."""
    return tuple(f'beam_{i}/' for i in range(1, beams + 1)) if beams > 1 else ('',)


def members(names: Iterable[str], beams: int) -> tuple[str, ...]:
    """Return the nodes of a graph, each node `of_beam` once per beam."""
    return tuple(prefix + name for name in names for prefix in (prefixes(beams) if row(name).of_beam else ('',)))


class Link(typing.NamedTuple):
    """Topic of a graph with the nodes at its two ends."""
    name: str                   # in the graph
    type: str                   # as in topics.Topic, as are rate and flag
    rate: str
    flag: str
    writers: tuple[str, ...]    # nodes that publish it
    readers: tuple[str, ...]    # nodes that subscribe to it


@functools.cache
def links(beams: int = 0, servo: bool = False, iq: bool = False, own: str = '') -> dict[str, Link]:
    """Return {name: Link} of a graph, in the order of TOPICS.

    beams: number of beams of an electronic array, 0 for a drive with motors; own: argument of `own_rows`.
    Simulated drives (servo) and simulated I/Q samples (iq) add their nodes.
    """
    rows = [own_rows(own).get(node.name) or row(node.name, beams > 0, servo, iq) for node in NODES]
    rows += [SIMULATED_DRIVES] * servo + [SIMULATED_IQ] * iq
    links = {}
    for topic in TOPICS:
        writers = [node.name for node in rows if topic.name in (*node.writes, node.replies)
                   or (topic.name == 'diagnostics' and node.unit)]
        readers = [node.name for node in rows if topic.name in (*node.reads, node.obeys)
                   and node.name not in writers]
        if not writers and not (readers and topic.rate == 'command'):
            continue
        for prefix in prefixes(beams) if topic.name in BEAM_TOPICS else ('',):
            of_this = [tuple(name for name in members(names, beams)
                             if not prefix or beam_of(name) in ('', prefix[:-1])) for names in (writers, readers)]
            links[prefix + topic.name] = Link(prefix + topic.name, topic.type, topic.rate, topic.flag, *of_this)
    return links


def links_of(names: Collection[str], beams: int = 0, own: str = '') -> dict[str, Link]:
    """Return {name: Link} of a graph of these nodes, see `links`."""
    return links(beams, SIMULATED_DRIVES.name in names, SIMULATED_IQ.name in names, own)


def recorded(names: Collection[str], flags: Collection[str] = (), beams: int = 0, own: str = '') -> list[Link]:
    """Return the Links that have a publisher in a graph of these nodes, or to which any client may publish. flags:
    those of topics.TOPIC_FLAGS that are set; own: argument of `own_rows`."""
    return [link for link in links_of(names, beams, own).values()
            if link.rate == STATION_RATE
            or any(name in names for name in (link.readers if link.rate in REALTIME_RATES else link.writers))
            and (not link.flag or link.flag in flags)]


def held(names: Iterable[str]) -> frozenset[str]:
    """Return those of these topics whose messages stay valid until the next message (Topic.holds)."""
    return frozenset(name for name in names if TOPIC_BY_NAME[plain(name)].holds)


def readers(link: Link, names: Iterable[str]) -> list[str]:
    """Return the nodes among `names` that must subscribe to a topic before the graph starts, with the recorder."""
    return [name for name in names if name in link.readers or name == 'recorder']


def reads(node: Node, names: Iterable[str], flags: Collection[str] = (), own: str = '') -> tuple[str, ...]:
    """Return the topics that a Node subscribes to in a graph of these nodes, its trigger first.

    A node that is not in the graph may be real equipment, so its topics are included. Excluded are the topics of an
    optional node that is not among the names, and topics whose flag is not set. Of a program of the user (`own_rows`),
    only the topics that it publishes are included.
    """
    plain_names = {plain(name) for name in names}

    def is_read(topic: str) -> bool:
        writers = [other for other in NODES if topic in own_rows(own).get(other.name, other).writes]
        absent = all(other.optional and other.name not in plain_names for other in writers)
        flag = TOPIC_BY_NAME[topic].flag
        return topic == node.reads[0] or not absent and (not flag or flag in flags)
    return tuple(topic for topic in node.reads if is_read(topic))


def noise(seed: int, node: str) -> np.random.Generator:
    """Return the noise of a simulated node for a run's seed, the same on every machine. It depends on the place of the
    node in NODES: a node that is inserted changes the noise of all nodes after it."""
    return np.random.default_rng((seed, NODE_NAMES.index(node)))
