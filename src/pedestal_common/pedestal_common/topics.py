"""The graph as one table: every topic with its type, writer, readers, QoS and rate. No ROS here.

A topic with a flag is in a graph only where something measures it; the parameter of that name tells its readers (the
ACU, the recorder) that it is there.

Qos
    step    one message per drive step: reliable, keep all (nothing may be lost)
    state   latched: reliable, transient local, depth 1
    event   reliable, keep last 10
Rate
    step    one per drive step, stamped with the step (or the step it measured, where latency is modelled)
    once    one at stamp 0, before the first step
    second  one per writer at every whole second of the drive's time
    change  whenever the value changes; has no stamp, belongs to the step its writer answers next

An electronic array of several beams has the nodes BEAM_NODES and their topics once per beam, with the prefix `beam_1/`
... `beam_N/`; everything else is shared.
"""
import functools
import re
import typing


class Topic(typing.NamedTuple):
    name: str
    type: str
    writers: tuple
    readers: tuple
    qos: str
    rate: str
    doc: str
    flag: str = ''


NODES = ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder', 'operator')
"""Names of the nodes; `operator` is whoever sends the ACU its program track (`pedestal run`)."""

STAND_IN = 'replay'
"""The node that replays a recording to the others."""

BEAM_NODES = ('tracking_receiver', 'acu')
"""The nodes each beam of an array has of its own."""

MAX_BEAMS = 16

_ALL = NODES[:-2]

TOPICS = (
    Topic('clock', 'rosgraph_msgs/msg/Clock', ('adu',), ('ship_motion',), 'step', 'step',
          "the drive's time"),
    Topic('joint_states', 'sensor_msgs/msg/JointState', ('adu',), ('tracking_receiver', 'acu'), 'step', 'step',
          'azimuth, elevation: encoder angle [rad], rate [rad/s], torque on the load [Nm]'),
    Topic('adu/motor_states', 'sensor_msgs/msg/JointState', ('adu',), (), 'step', 'step',
          'azimuth_motor_1 ... elevation_motor_2: shaft angle [rad], rate [rad/s], torque [Nm]'),
    Topic('adu/state', 'std_msgs/msg/String', ('adu',), ('acu',), 'state', 'change',
          "'enabled' when the drive follows commands, otherwise why not"),
    Topic('ship/truth', 'nav_msgs/msg/Odometry', ('ship_motion',), ('tracking_receiver', 'adu'), 'step', 'step',
          'pose of base_link (FLU) in earth (ENU), twist in base_link'),
    Topic('ship/imu/data_raw', 'sensor_msgs/msg/Imu', ('ship_motion',), ('ins',), 'step', 'step',
          'specific force [m/s2] and angular rate [rad/s] (REP 145); orientation_covariance[0] = -1'),
    Topic('ship/imu/data', 'sensor_msgs/msg/Imu', ('ins',), ('acu',), 'step', 'step',
          'attitude deck -> earth and deck rate [rad/s] as the INS knows them'),
    Topic('ins/state', 'std_msgs/msg/String', ('ins',), ('acu',), 'state', 'change',
          'aligning, or aligned once the heading is known well enough; an INS that never says it counts as aligned'),
    Topic('tracking_receiver/angle_error', 'geometry_msgs/msg/Vector3Stamped', ('tracking_receiver',), ('acu',),
          'step', 'step', 'x cross-elevation error [rad], y elevation error [rad], z C/N0 [dB-Hz]; x, y NaN unlocked'),
    Topic('tracking_receiver/angle_rate', 'geometry_msgs/msg/Vector3Stamped', ('tracking_receiver',), ('acu',),
          'step', 'step', 'x cross-elevation, y elevation error rate [rad/s], NaN unlocked; z their 1-sigma',
          'receiver_rate'),
    Topic('tracking_receiver/range', 'sensor_msgs/msg/Range', ('tracking_receiver',), ('acu',), 'step', 'step',
          'range of the target [m], NaN unlocked, and its variance [m2]', 'receiver_range'),
    Topic('target/truth', 'nav_msgs/msg/Odometry', ('tracking_receiver',), (), 'step', 'step',
          'target position [m] and velocity [m/s] in the ENU frame of the station'),
    Topic('acu/rate_command', 'sensor_msgs/msg/JointState', ('acu',), ('adu',), 'step', 'step',
          'azimuth, elevation: velocity [rad/s], effort = feed-forward load torque [Nm]'),
    Topic('acu/estimate', 'trajectory_msgs/msg/JointTrajectory', ('acu',), (), 'step', 'step',
          'target azimuth, elevation as filtered (earth angles): angle [rad], rate, acceleration; NaN without one'),
    Topic('acu/reference', 'trajectory_msgs/msg/JointTrajectory', ('acu',), (), 'step', 'step',
          'what the position loop follows, deck angles: angle [rad], rate, acceleration'),
    Topic('acu/filter', 'sensor_msgs/msg/JointState', ('acu',), (), 'step', 'step',
          'named numbers, all in `position`: innovations, NIS, 1-sigmas, probabilities of the models; NaN: none'),
    Topic('acu/mode', 'std_msgs/msg/String', ('acu',), (), 'state', 'change',
          'standby, stow, preset, program or autotrack'),
    Topic('acu/keyhole', 'std_msgs/msg/String', ('acu',), (), 'state', 'change',
          'how the azimuth will go through the zenith of the deck, and what is lost'),
    Topic('acu/blockage', 'std_msgs/msg/String', ('acu',), (), 'state', 'change',
          'from when until when the superstructure will hide the target'),
    Topic('acu/program_track', 'trajectory_msgs/msg/JointTrajectory', ('operator',), ('acu',), 'state', 'once',
          'time-tagged azimuth, elevation (earth); one point is a preset (deck)'),
    Topic('diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', _ALL, ('operator',), 'event', 'second',
          'state of each node'),
)

BY_NAME = {topic.name: topic for topic in TOPICS}
FLAGS = tuple(topic.flag for topic in TOPICS if topic.flag)


def beam_of(name):
    """'beam_2' of a node or topic 'beam_2/...'; '' of one without a beam."""
    found = re.match(r'beam_[1-9]\d*(?=/)', name)
    return found[0] if found else ''


def plain(name):
    """The name of a node or topic without its beam."""
    return name[len(beam_of(name)) + 1:] if beam_of(name) else name


def prefixes(beams):
    """What the names of each beam's nodes and topics begin with: nothing where there is one only."""
    return tuple(f'beam_{i}/' for i in range(1, beams + 1)) if beams > 1 else ('',)


def members(nodes, beams):
    """The nodes of a graph, each of BEAM_NODES once per beam."""
    return tuple(prefix + node for node in nodes for prefix in (prefixes(beams) if node in BEAM_NODES else ('',)))


def of_beam(name):
    """Whether each beam has a topic of this (plain) name of its own."""
    return name in ('joint_states', 'target/truth') or name.partition('/')[0] in BEAM_NODES


def _of_array(topic):
    """The row where the drive is an electronic array: it obeys angles instead of rates and does not feel the ship."""
    readers = tuple(node for node in topic.readers if node != 'adu')
    return topic._replace(readers=(*readers, 'adu') if topic.name == 'acu/reference' else readers)


@functools.cache
def graph(beams=0):
    """{name: Topic} of a graph; beams 0: the drive has motors, else it is an electronic array of so many beams."""
    rows = [_of_array(topic) for topic in TOPICS if topic.name != 'adu/motor_states'] if beams else TOPICS
    found = {}
    for topic in rows:
        for prefix in prefixes(beams) if of_beam(topic.name) else ('',):
            writers, readers = (tuple(name for name in members(nodes, beams) if beam_of(name) in ('', prefix[:-1])
                                      or not prefix) for nodes in (topic.writers, topic.readers))
            found[prefix + topic.name] = topic._replace(name=prefix + topic.name, writers=writers, readers=readers)
    return found


def read_by(node, nodes, flags=(), beams=0):
    """The topics `node` reads for which a graph of these nodes has a writer; the recorder reads every one.

    flags: those of FLAGS that are set.
    """
    return [topic for topic in graph(beams).values()
            if (node in topic.readers or node == 'recorder') and any(w in nodes for w in topic.writers)
            and (not topic.flag or topic.flag in flags)]


def readers(topic, nodes):
    """The nodes that must read a topic before a graph of these nodes may start."""
    return [node for node in nodes if node in topic.readers or node == 'recorder']
