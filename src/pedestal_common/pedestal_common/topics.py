"""The topics of the graph as one table: type, rate, meaning of every number. Who writes and reads them is in `nodes`.

Rate
    step    one message per drive step, stamped with the step (or the step it measured, where latency is modelled)
    once    one before the first step
    second  one per writer at every whole second of the drive's time
    change  a text, whenever it changes; it has no stamp and belongs to the step that its writer answers next
The rate gives the quality of service: see QOS.
"""
import typing

AXES = ('azimuth', 'elevation')
MOTORS = tuple(f'{axis}_motor_{i}' for axis in AXES for i in (1, 2))
MOTION_MODELS = ('cv', 'ca', 'singer', 'current_statistical')
"""Motion models of the target that the ACU's filters know."""

FILTER = {'innovation': 'rad', 'rate_innovation': 'rad/s', 'nis': '', 'sigma': 'rad', 'rate_sigma': 'rad/s',
          'correlation': '', 'innovation_sigma': 'rad', **dict.fromkeys(MOTION_MODELS, '')}
"""{number: unit} that acu/filter tells of the filter of one axis; of a model its probability."""

SILENT = -1
"""In records the code of a text that was never published."""


class Qos(typing.NamedTuple):
    """Quality of service, always reliable. depth: messages kept; 0: all."""
    depth: int
    latched: bool


QOS = {'step': Qos(0, False), 'once': Qos(1, True), 'change': Qos(1, True), 'second': Qos(10, False)}


class Topic(typing.NamedTuple):
    """One topic.

    doc      what it tells
    names    of a JointState, JointTrajectory: whose numbers they are
    frame    header.frame_id; child: child_frame_id
    units    {column: unit} where the type alone does not tell (see layouts)
    texts    of a text: those that a reader tells apart, in the order of their codes
    flag     the parameter of its readers that says whether something measures it; '': it is always there
    """
    name: str
    type: str
    rate: str
    doc: str
    names: tuple = AXES
    frame: str = ''
    child: str = ''
    units: typing.Mapping = {}
    texts: tuple = ()
    flag: str = ''


TOPICS = (
    Topic('clock', 'rosgraph_msgs/msg/Clock', 'step', "the drive's time t_k"),
    Topic('joint_states', 'sensor_msgs/msg/JointState', 'step',
          'azimuth, elevation: encoder angle [rad], rate [rad/s], torque on the load [Nm]', frame='base_link'),
    Topic('adu/motor_states', 'sensor_msgs/msg/JointState', 'step',
          'azimuth_motor_1 ... elevation_motor_2: shaft angle [rad], rate [rad/s], torque [Nm]', names=MOTORS,
          frame='base_link'),
    Topic('adu/state', 'std_msgs/msg/String', 'change',
          "'enabled' when the drive follows commands, otherwise why not", texts=('enabled',)),
    Topic('ship/truth', 'nav_msgs/msg/Odometry', 'step',
          'pose of base_link (FLU) in earth (ENU), twist in base_link', frame='earth', child='base_link'),
    Topic('ship/imu/data_raw', 'sensor_msgs/msg/Imu', 'step',
          'specific force [m/s2] and angular rate [rad/s] (REP 145); orientation_covariance[0] = -1',
          frame='base_link'),
    Topic('ship/imu/data', 'sensor_msgs/msg/Imu', 'step',
          'attitude deck -> earth and deck rate [rad/s] as the INS knows them', frame='base_link'),
    Topic('ins/state', 'std_msgs/msg/String', 'change',
          'aligning, or aligned once the heading is known well enough; an INS that never says it counts as aligned',
          texts=('aligning', 'aligned')),
    Topic('tracking_receiver/angle_error', 'geometry_msgs/msg/Vector3Stamped', 'step',
          'x cross-elevation error [rad], y elevation error [rad], z C/N0 [dB-Hz]; x, y NaN unlocked', frame='beam',
          units={'x': 'rad', 'y': 'rad', 'z': 'dB-Hz'}),
    Topic('tracking_receiver/angle_rate', 'geometry_msgs/msg/Vector3Stamped', 'step',
          'x cross-elevation, y elevation error rate [rad/s], NaN unlocked; z their 1-sigma', frame='beam',
          units={'x': 'rad/s', 'y': 'rad/s', 'z': 'rad/s'}, flag='receiver_rate'),
    Topic('tracking_receiver/range', 'sensor_msgs/msg/Range', 'step',
          'range of the target [m], NaN unlocked, and its variance [m2]', frame='beam',
          units={'field_of_view': 'rad', 'min_range': 'm', 'max_range': 'm'}, flag='receiver_range'),
    Topic('target/truth', 'nav_msgs/msg/Odometry', 'step',
          'target position [m] and velocity [m/s] in the ENU frame of the station', frame='earth', child='target'),
    Topic('acu/rate_command', 'sensor_msgs/msg/JointState', 'step',
          'azimuth, elevation: velocity [rad/s], effort = feed-forward load torque [Nm]', frame='base_link'),
    Topic('acu/estimate', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'target azimuth, elevation as filtered (earth angles): angle [rad], rate, acceleration; NaN without one',
          frame='earth'),
    Topic('acu/reference', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'what the position loop follows, deck angles: angle [rad], rate, acceleration', frame='base_link'),
    Topic('acu/filter', 'sensor_msgs/msg/JointState', 'step',
          'named numbers, all in `position`: innovations, NIS, 1-sigmas, probabilities of the models; NaN: none',
          names=tuple(f'{axis}_{name}' for axis in AXES for name in FILTER), frame='earth',
          units={f'{axis}_{name}.position': unit for axis in AXES for name, unit in FILTER.items()}),
    Topic('acu/mode', 'std_msgs/msg/String', 'change', 'standby, stow, preset, program or autotrack'),
    Topic('acu/keyhole', 'std_msgs/msg/String', 'change',
          'how the azimuth will go through the zenith of the deck, and what is lost'),
    Topic('acu/blockage', 'std_msgs/msg/String', 'change',
          'from when until when the superstructure will hide the target'),
    Topic('acu/program_track', 'trajectory_msgs/msg/JointTrajectory', 'once',
          'time-tagged azimuth, elevation (earth); one point is a preset (deck)', frame='earth'),
    Topic('diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'second', 'state of each node'),
)

BY_NAME = {topic.name: topic for topic in TOPICS}
FLAGS = tuple(topic.flag for topic in TOPICS if topic.flag)
