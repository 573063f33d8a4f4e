"""Messages of the topics, as objects of the library rosbags: the same classes in a node, a bag and a test.

The serialiser of rclpy leaves the alignment padding of CDR undefined, so two recordings would never be identical: in
297 of 300 diagnostics, the padding had bytes of earlier messages. The serialiser of rosbags writes zeros there.
rosbags also reads a JointState in half the time.
"""
import struct
from collections.abc import Callable, Sequence

import numpy as np
from rosbags.typesys import Stores, get_typestore

from pedestal_common.graph import layouts, topics
from pedestal_common.quantities import Message, Nanoseconds

ROS_TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
_TYPES = ROS_TYPESTORE.types
_STAMP = struct.Struct('<iI')

CDR_HEADER_BYTES = 4
"""Length of the header of a CDR message [bytes]; the first field, in most types header.stamp, begins after it."""

MAX_CDR_BYTES = 8_000_000  # largest size of a message [bytes]; a program track of a whole day has 7 million

Clock = _TYPES['rosgraph_msgs/msg/Clock']
DiagnosticArray = _TYPES['diagnostic_msgs/msg/DiagnosticArray']
DiagnosticStatus = _TYPES['diagnostic_msgs/msg/DiagnosticStatus']
Duration = _TYPES['builtin_interfaces/msg/Duration']
FluidPressure = _TYPES['sensor_msgs/msg/FluidPressure']
Header = _TYPES['std_msgs/msg/Header']
Imu = _TYPES['sensor_msgs/msg/Imu']
JointState = _TYPES['sensor_msgs/msg/JointState']
JointTrajectory = _TYPES['trajectory_msgs/msg/JointTrajectory']
JointTrajectoryPoint = _TYPES['trajectory_msgs/msg/JointTrajectoryPoint']
KeyValue = _TYPES['diagnostic_msgs/msg/KeyValue']
Odometry = _TYPES['nav_msgs/msg/Odometry']
Point = _TYPES['geometry_msgs/msg/Point']
Pose = _TYPES['geometry_msgs/msg/Pose']
PoseWithCovariance = _TYPES['geometry_msgs/msg/PoseWithCovariance']
Range = _TYPES['sensor_msgs/msg/Range']
Quaternion = _TYPES['geometry_msgs/msg/Quaternion']
RelativeHumidity = _TYPES['sensor_msgs/msg/RelativeHumidity']
String = _TYPES['std_msgs/msg/String']
Temperature = _TYPES['sensor_msgs/msg/Temperature']
Time = _TYPES['builtin_interfaces/msg/Time']
Twist = _TYPES['geometry_msgs/msg/Twist']
TwistWithCovariance = _TYPES['geometry_msgs/msg/TwistWithCovariance']
Vector3 = _TYPES['geometry_msgs/msg/Vector3']
Vector3Stamped = _TYPES['geometry_msgs/msg/Vector3Stamped']


def serialize(message: Message) -> bytes:
    """Return the CDR bytes of a message. The padding is zero, because equal runs must give equal bytes."""
    return bytes(ROS_TYPESTORE.serialize_cdr(message, message.__msgtype__))


def deserialize(data: bytes, type_name: str) -> Message:
    """Return the message in CDR bytes, at most MAX_CDR_BYTES. Raises ValueError, which names the type."""
    if len(data) > MAX_CDR_BYTES:
        raise ValueError(f'{len(data)} bytes of a {type_name}, must be at most {MAX_CDR_BYTES}')
    try:
        return ROS_TYPESTORE.deserialize_cdr(data, type_name)
    except Exception as error:
        raise ValueError(f'{len(data)} bytes are no {type_name}: {error}') from None


def definition(type_name: str) -> bytes:
    """Return the definition of a message type and of the types in it, as a reader of `ros2msg` schemas needs it."""
    return ROS_TYPESTORE.generate_msgdef(type_name, ros_version=2)[0].encode()


def nanoseconds(stamp: Message) -> Nanoseconds:
    """Return a Time as integer nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def stamp_of(data: bytes) -> Nanoseconds:
    """Return the stamp in the CDR bytes of a message that begins with a stamp. Raises ValueError for other bytes."""
    if len(data) >= CDR_HEADER_BYTES + _STAMP.size:
        seconds, nanosec = _STAMP.unpack_from(data, CDR_HEADER_BYTES)
        if seconds >= 0 and nanosec < 1_000_000_000:
            return seconds * 1_000_000_000 + nanosec
        raise ValueError(f'{seconds} s {nanosec} ns is no stamp')
    raise ValueError(f'{len(data)} bytes hold no stamp')


def put_stamp(stamp: Message, ns: Nanoseconds) -> None:
    """Write integer nanoseconds into a Time."""
    stamp.sec, stamp.nanosec = divmod(ns, 1_000_000_000)


def since(message: Message, epoch: Nanoseconds) -> Message:
    """Make the stamp in the header of a message count from an epoch, unless it is 0; return the message."""
    stamp = nanoseconds(message.header.stamp)
    put_stamp(message.header.stamp, stamp - epoch if stamp else 0)
    return message


def header(frame_id: str) -> Message:
    """Return a Header at stamp 0."""
    return Header(stamp=Time(sec=0, nanosec=0), frame_id=frame_id)


def vector3(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    """Return a Vector3."""
    return Vector3(x=x, y=y, z=z)


def trajectory_point(size: int) -> Message:
    """Return a point of `size` joints, all zero, without effort."""
    return JointTrajectoryPoint(positions=np.zeros(size), velocities=np.zeros(size), accelerations=np.zeros(size),
                                effort=np.zeros(0), time_from_start=Duration(sec=0, nanosec=0))


def _joint_state(row: topics.Topic) -> Message:
    sizes = {field.name: len(row.names) for field in layouts.fields(row.name)}
    return JointState(header=header(row.frame), name=list(row.names),
                      **{name: np.zeros(sizes.get(name, 0)) for name in ('position', 'velocity', 'effort')})


def _joint_trajectory(row: topics.Topic) -> Message:
    return JointTrajectory(header=header(row.frame), joint_names=list(row.names),
                           points=[trajectory_point(len(row.names))])


def _vector3_stamped(row: topics.Topic) -> Message:
    return Vector3Stamped(header=header(row.frame), vector=vector3())


def _range(row: topics.Topic) -> Message:
    """Return a Range at any distance. The type has no code for radio, so the code is 0 (ultrasound)."""
    return Range(header=header(row.frame), radiation_type=0, field_of_view=0.0, min_range=0.0, max_range=float('inf'),
                 range=0.0, variance=0.0)


def _odometry(row: topics.Topic) -> Message:
    """Return an Odometry at rest in the origin, covariances zero (unknown)."""
    pose = Pose(position=Point(x=0.0, y=0.0, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))
    return Odometry(header=header(row.frame), child_frame_id=row.child,
                    pose=PoseWithCovariance(pose=pose, covariance=np.zeros(36)),
                    twist=TwistWithCovariance(twist=Twist(linear=vector3(), angular=vector3()),
                                              covariance=np.zeros(36)))


def _imu(row: topics.Topic) -> Message:
    return Imu(header=header(row.frame), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
               orientation_covariance=np.zeros(9), angular_velocity=vector3(), angular_velocity_covariance=np.zeros(9),
               linear_acceleration=vector3(), linear_acceleration_covariance=np.zeros(9))


_TEMPLATES: dict[str, Callable[[topics.Topic], Message]] = {
              'sensor_msgs/msg/JointState': _joint_state, 'trajectory_msgs/msg/JointTrajectory': _joint_trajectory,
              'geometry_msgs/msg/Vector3Stamped': _vector3_stamped, 'sensor_msgs/msg/Range': _range,
              'nav_msgs/msg/Odometry': _odometry, 'sensor_msgs/msg/Imu': _imu,
              'sensor_msgs/msg/FluidPressure': lambda row: FluidPressure(header=header(row.frame), fluid_pressure=0.0,
                                                                         variance=0.0),
              'sensor_msgs/msg/Temperature': lambda row: Temperature(header=header(row.frame), temperature=0.0,
                                                                     variance=0.0),
              'sensor_msgs/msg/RelativeHumidity': lambda row: RelativeHumidity(
                  header=header(row.frame), relative_humidity=0.0, variance=0.0),
              'rosgraph_msgs/msg/Clock': lambda row: Clock(clock=Time(sec=0, nanosec=0))}


def template(topic: str) -> Message:
    """Return a message of a topic of topics.TOPIC_BY_NAME with a stamp: names and frames set, numbers zero."""
    row = topics.TOPIC_BY_NAME[topic]
    return _TEMPLATES[row.type](row)


def program_track(points: Sequence[Message]) -> Message:
    """Return an acu/program_track of JointTrajectoryPoints."""
    message = template('acu/program_track')
    message.points = points
    return message
