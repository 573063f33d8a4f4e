"""The nodes of the graph as one table: what runs them, what they read and write; and the graph they make.

An electronic array of several beams has the nodes `of_beam` and their topics once per beam, with the prefix `beam_1/`
... `beam_N/`; everything else is shared. No ROS here.
"""
import functools
import importlib
import re
import typing

from pedestal_common.graph.topics import TOPIC_BY_NAME, TOPICS

MAX_BEAMS = 16

REPLAY_NODE = 'replay'
"""The node that replays a recording to the others."""

DRIVE_NODE = 'adu'
"""The node that owns the time."""


class Node(typing.NamedTuple):
    """One node.

    name          in the graph
    module        that runs it, PACKAGE.EXECUTABLE; '' for one that has no process of its own
    parameters    module and name of its parameter class
    unit          module and name of its unit (unit.Unit); '' for one without a law
    reads         topics, of a unit the one first that begins its steps
    writes        topics, the one first that others wait for
    answer        topic by which it answers every step, stamped alike; '' of one that answers late
    obeys         topic of the commands it obeys, by whomever; replies: topic on which it tells what came of them
    doc           what it is; stands_for: what takes its place on a real antenna
    of_beam       whether each beam of an array has one of its own
    optional      whether the others do without it in a graph that does not name it
    """
    name: str
    module: str = ''
    parameters: str = ''
    unit: str = ''
    reads: tuple = ()
    writes: tuple = ()
    answer: str = ''
    obeys: str = ''
    replies: str = ''
    doc: str = ''
    stands_for: str = ''
    of_beam: bool = False
    optional: bool = False

    @property
    def package(self):
        """The ROS package that it is in."""
        return self.module.partition('.')[0]

    @property
    def executable(self):
        """The name of its executable in that package."""
        return self.module.rpartition('.')[2]

    def parameters_type(self):
        """Its parameter dataclass."""
        return _named(self.parameters)

    def unit_type(self):
        """Its unit, a class."""
        return _named(self.unit)


def _named(path):
    module, _, name = path.partition(':')
    return getattr(importlib.import_module(module), name)


NODES = (
    Node('ship_motion', 'ship_motion_sim.ship_motion_node', 'ship_motion_sim.params:ShipMotionParameters',
         'ship_motion_sim.ship_unit:ShipMotion',
         reads=('clock',),
         writes=('ship/truth', 'ship/imu/data_raw'),
         answer='ship/truth', obeys='ship_motion/inject', replies='ship_motion/injected',
         doc='ship on a seaway, its IMU', stands_for='ship and IMU', optional=True),
    Node('ins', 'ship_motion_sim.ins_node', 'ship_motion_sim.params:InsParameters', 'ship_motion_sim.ins_unit:Ins',
         reads=('ship/imu/data_raw',),
         writes=('ship/imu/data', 'ins/state', 'ins/error'),
         obeys='ins/inject', replies='ins/injected',
         doc='attitude with parametrised error and latency, or from its IMU: aligns by itself, then navigates',
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
                'acu/program_track'),
         writes=('acu/rate_command', 'acu/estimate', 'acu/reference', 'acu/filter', 'acu/mode', 'acu/keyhole',
                 'acu/blockage', 'acu/alarms', 'acu/stow_pins'),
         answer='acu/rate_command',
         obeys='acu/command', replies='acu/command_result',
         doc='antenna control unit: filter, modes, position loop', stands_for='the product itself', of_beam=True),
    Node(DRIVE_NODE, 'adu_drive.adu_node', 'adu_drive.params:AduNodeParameters', 'adu_drive.unit:Adu',
         reads=('clock', 'acu/rate_command', 'ship/truth', 'acu/stow_pins'),
         writes=('joint_states', 'adu/truth', 'clock', 'adu/motor_states', 'adu/state', 'adu/stow_pins'),
         answer='joint_states', obeys='adu/inject', replies='adu/injected',
         doc='antenna drive unit: two axes, two motors each, and the plant; owns the time',
         stands_for='servo drive and pedestal'),
    Node('recorder', 'pedestal_recording.recorder_node', 'pedestal_recording.recorder_params:RecorderParameters',
         doc='reads every topic, raw, into a rosbag2 directory'),
    Node('operator', reads=('diagnostics',), writes=('acu/program_track',),
         doc='sends the program track, listens to diagnostics: inside `pedestal run`, or `pedestal program`',
         stands_for='the operator'),
)
"""In the order in which a graph is started. Those with a unit write `diagnostics` as well."""

ARRAY_DRIVE = Node(DRIVE_NODE, 'adu_drive.beam_steering_node', 'adu_drive.params:BeamParameters',
                   'adu_drive.array.beam_unit:Beam',
                   reads=('clock', 'acu/reference'),
                   writes=('joint_states', 'adu/truth', 'clock', 'adu/state'),
                   answer='joint_states',
                   doc='electronically steered array in the place of the drive (`beam: true`): no motors',
                   stands_for='beam steering computer and array')
"""The drive of an array: it obeys angles instead of rates and does not feel the ship."""

NODE_NAMES = tuple(node.name for node in NODES)
UNIT_NODES = (*(node for node in NODES if node.unit), ARRAY_DRIVE)

BEAM_TOPICS = frozenset(('joint_states', 'adu/truth', 'acu/program_track',
                         *(topic for node in NODES if node.of_beam
                           for topic in (*node.writes, node.obeys, node.replies) if topic)))
"""Topics that each beam of several has of its own: what its nodes write, and what shared nodes write for each."""


def row(name, array=False) -> Node:
    """The Node of a name, 'beam_2/acu' as well as 'acu'; array: of a graph whose drive is an electronic array."""
    if array and name == DRIVE_NODE:
        return ARRAY_DRIVE
    return NODES[NODE_NAMES.index(plain(name))]


def of_executable(module) -> Node:
    """The Node that a module runs."""
    return next(node for node in (*NODES, ARRAY_DRIVE) if node.module == module)


def beam_of(name):
    """'beam_2' of a node or topic 'beam_2/...'; '' of one without a beam."""
    match = re.match(r'beam_[1-9]\d*(?=/)', name)
    return match[0] if match else ''


def plain(name):
    """The name of a node or topic without its beam."""
    return name[len(beam_of(name)) + 1:] if beam_of(name) else name


def prefixes(beams):
    """What the names of each beam's nodes and topics begin with: nothing where there is one only."""
    return tuple(f'beam_{i}/' for i in range(1, beams + 1)) if beams > 1 else ('',)


def members(names, beams):
    """The nodes of a graph, each of those of a beam once per beam."""
    return tuple(prefix + name for name in names for prefix in (prefixes(beams) if row(name).of_beam else ('',)))


class Link(typing.NamedTuple):
    """A topic in a graph: its name there, its type, rate and flag (see Topic), the nodes that write and read it."""
    name: str
    type: str
    rate: str
    flag: str
    writers: tuple
    readers: tuple


@functools.cache
def links(beams=0) -> dict:
    """{name: Link} of a graph, in the order of TOPICS; beams 0: its drive has motors, else it is an electronic array
    of so many beams."""
    rows = [row(node.name, beams > 0) for node in NODES]
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


def recorded(names, flags=(), beams=0) -> list:
    """The Links that a graph of these nodes has a writer for, or that anybody may write; flags: those of topics.FLAGS
    that are set."""
    return [link for link in links(beams).values()
            if any(name in names for name in (link.readers if link.rate == 'command' else link.writers))
            and (not link.flag or link.flag in flags)]


def held(names) -> frozenset:
    """Those of these topics of a graph that hold (see Topic)."""
    return frozenset(name for name in names if TOPIC_BY_NAME[plain(name)].holds)


def readers(link, names):
    """The nodes of a graph that must read a topic before it may start; the recorder reads every one."""
    return [name for name in names if name in link.readers or name == 'recorder']


def reads(node, names, flags=()) -> tuple:
    """The topics that a Node hears in a graph of these nodes, in the order of its row, its trigger first.

    What is not in the graph may be real equipment, so all of its topics are heard, but those of an optional node that
    is not among the names, and those whose flag is not set.
    """
    plain_names = {plain(name) for name in names}

    def is_read(topic):
        writers = [other for other in NODES if topic in other.writes]
        absent = all(other.optional and other.name not in plain_names for other in writers)
        flag = TOPIC_BY_NAME[topic].flag
        return topic == node.reads[0] or not absent and (not flag or flag in flags)
    return tuple(topic for topic in node.reads if is_read(topic))
