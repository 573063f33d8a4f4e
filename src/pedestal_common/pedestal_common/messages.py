"""Messages as rosbags builds them: the same classes in a node, a bag and a test.

Nodes publish bytes that rosbags serialised. rclpy's own serialiser leaves the alignment padding of CDR
undefined (measured: stale bytes of earlier messages, in 297 of 300 diagnostics), so that no recording of
it could be the same twice; rosbags writes zeros there, and reads a JointState in half the time.
"""
import numpy as np
from rosbags.typesys import Stores, get_typestore

TYPESTORE = get_typestore(Stores.ROS2_JAZZY)
_TYPES = TYPESTORE.types

Clock = _TYPES['rosgraph_msgs/msg/Clock']
DiagnosticArray = _TYPES['diagnostic_msgs/msg/DiagnosticArray']
DiagnosticStatus = _TYPES['diagnostic_msgs/msg/DiagnosticStatus']
Duration = _TYPES['builtin_interfaces/msg/Duration']
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
String = _TYPES['std_msgs/msg/String']
Time = _TYPES['builtin_interfaces/msg/Time']
Twist = _TYPES['geometry_msgs/msg/Twist']
TwistWithCovariance = _TYPES['geometry_msgs/msg/TwistWithCovariance']
Vector3 = _TYPES['geometry_msgs/msg/Vector3']
Vector3Stamped = _TYPES['geometry_msgs/msg/Vector3Stamped']

AXES = ('azimuth', 'elevation')
MODELS = ('cv', 'ca', 'singer', 'current_statistical')
"""Motion models of the ACU's filters, in the order of their probabilities."""
FILTER = tuple(f'{axis}_{name}' for axis in AXES for name in (
    'innovation', 'rate_innovation', 'nis', 'sigma', 'rate_sigma', 'correlation', 'innovation_sigma', *MODELS))
"""Names of the numbers on acu/filter."""
MOTORS = ('azimuth_motor_1', 'azimuth_motor_2', 'elevation_motor_1', 'elevation_motor_2')


def serialize(message) -> bytes:
    """CDR bytes of a message, padding zeroed."""
    return bytes(TYPESTORE.serialize_cdr(message, message.__msgtype__))


def deserialize(data, type_name):
    """The message in CDR bytes; raises ValueError naming the type when they do not hold one."""
    try:
        return TYPESTORE.deserialize_cdr(data, type_name)
    except Exception as error:
        raise ValueError(f'{len(data)} bytes are no {type_name}: {error}') from None


def nanoseconds(stamp) -> int:
    """A Time as integer nanoseconds."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def put_stamp(stamp, ns):
    """Write integer nanoseconds into a Time."""
    stamp.sec, stamp.nanosec = divmod(ns, 1_000_000_000)


def header(frame_id) -> Header:
    return Header(stamp=Time(sec=0, nanosec=0), frame_id=frame_id)


def joint_state(names, frame_id='base_link') -> JointState:
    """A JointState with zeros for every name."""
    n = len(names)
    return JointState(header=header(frame_id), name=list(names), position=np.zeros(n), velocity=np.zeros(n),
                      effort=np.zeros(n))


def named_numbers(names, frame_id='') -> JointState:
    """A JointState as a vector of named numbers, all in `position`."""
    return JointState(header=header(frame_id), name=list(names), position=np.zeros(len(names)), velocity=np.zeros(0),
                      effort=np.zeros(0))


def trajectory_point() -> JointTrajectoryPoint:
    size = len(AXES)
    return JointTrajectoryPoint(positions=np.zeros(size), velocities=np.zeros(size), accelerations=np.zeros(size),
                                effort=np.zeros(0), time_from_start=Duration(sec=0, nanosec=0))


def joint_trajectory(frame_id, points) -> JointTrajectory:
    return JointTrajectory(header=header(frame_id), joint_names=list(AXES), points=points)


def vector3(x=0.0, y=0.0, z=0.0) -> Vector3:
    return Vector3(x=x, y=y, z=z)


def vector3_stamped(frame_id) -> Vector3Stamped:
    return Vector3Stamped(header=header(frame_id), vector=vector3())


def range_message(frame_id, field_of_view) -> Range:
    """A Range of radio, which the type has no code for (its 0 is the other one that is no light); any distance."""
    return Range(header=header(frame_id), radiation_type=0, field_of_view=field_of_view, min_range=0.0,
                 max_range=float('inf'), range=0.0, variance=0.0)


def odometry(frame_id, child_frame_id) -> Odometry:
    """An Odometry at rest in the origin, covariances zero (unknown)."""
    pose = Pose(position=Point(x=0.0, y=0.0, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))
    return Odometry(header=header(frame_id), child_frame_id=child_frame_id,
                    pose=PoseWithCovariance(pose=pose, covariance=np.zeros(36)),
                    twist=TwistWithCovariance(twist=Twist(linear=vector3(), angular=vector3()),
                                              covariance=np.zeros(36)))


def imu(frame_id) -> Imu:
    """An Imu without orientation (REP 145: covariance[0] = -1)."""
    unknown = np.zeros(9)
    unknown[0] = -1.0
    return Imu(header=header(frame_id), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
               orientation_covariance=unknown, angular_velocity=vector3(), angular_velocity_covariance=np.zeros(9),
               linear_acceleration=vector3(), linear_acceleration_covariance=np.zeros(9))


def by_name(names, values, wanted) -> tuple:
    """values in the order of the wanted joint names; NaN where a name or a value is missing."""
    return tuple(float(values[names.index(name)]) if name in names and names.index(name) < len(values)
                 else float('nan') for name in wanted)
