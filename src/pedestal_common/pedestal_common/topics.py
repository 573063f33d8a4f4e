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
"""
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


def read_by(node, graph, flags=()):
    """The topics `node` reads for which the graph has a writer; the recorder reads every one. flags: those of FLAGS
    that are set."""
    return [topic for topic in TOPICS
            if (node in topic.readers or node == 'recorder') and any(w in graph for w in topic.writers)
            and (not topic.flag or topic.flag in flags)]


def readers(topic, graph):
    """The nodes that must read a topic before a graph of these nodes may start."""
    return [node for node in graph if node in topic.readers or node == 'recorder']
