"""Coordinate frames of the pedestal for viewers, from the earth to the beam (x along it). No ROS here.

The frames are right-handed, with z up and x ahead (REP 103, REP 105); ashore the bow points north. All except the
first are joints of `viewers/files/pedestal.urdf`, with the names of joint_states. The azimuth turns about -z,
clockwise from above. The elevation turns about -y, upwards.
"""
import importlib.resources
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pedestal_common.geometry.line_of_sight import ASHORE_ATTITUDE
from pedestal_common.graph import topics
from pedestal_common.quantities import Message, Nanoseconds, Radians, Xyz, Xyzw
from pedestal_common.wire import messages

VIEWER_FOLDER = importlib.resources.files('pedestal_operator.viewers') / 'files'  # for viewers

PEDESTAL_URDF = (VIEWER_FOLDER / 'pedestal.urdf').read_text()


class Transform(NamedTuple):
    """Frame `child` in its `parent`."""
    parent: str
    child: str
    translation: Xyz        # place of its origin [m]
    rotation: Xyzw


class Joint(NamedTuple):
    """A joint of the model."""
    name: str
    parent: str
    child: str
    origin: Xyz             # place of the child in the parent [m]
    axis: Xyz | None        # axis of its turn in the frame of its child, None for a fixed joint


def _numbers(text: str) -> Xyz:
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def joints(description: str = PEDESTAL_URDF) -> tuple[Joint, ...]:
    """Return the joints of a URDF in its order. At angle 0 all frames must be parallel: the URDF has no `rpy`."""
    found = []
    for joint in ElementTree.fromstring(description).iter('joint'):
        parts = {part.tag: part.attrib for part in joint}
        found.append(Joint(joint.attrib['name'], parts['parent']['link'], parts['child']['link'],
                           _numbers(parts['origin']['xyz']),
                           _numbers(parts['axis']['xyz']) if 'axis' in parts else None))
    return tuple(found)


PEDESTAL_JOINTS = joints()


def _rotation(axis: Xyz, angle: Radians) -> Xyzw:
    """Return the quaternion of a turn about a unit vector."""
    sine = math.sin(0.5 * angle)
    return sine * axis[0], sine * axis[1], sine * axis[2], math.cos(0.5 * angle)


def of_deck(attitude: Sequence[float] = ASHORE_ATTITUDE) -> Transform:
    """Return the transform of the deck in the earth frame. attitude: quaternion (x, y, z, w) deck -> earth."""
    x, y, z, w = attitude
    return Transform('earth', 'base_link', (0.0, 0.0, 0.0), (x, y, z, w))


def of_pedestal(angles: Sequence[Radians], prefix: str = '') -> list[Transform]:
    """Return the transforms from the deck to the beam. prefix: that of one of several beams, such as beam_2/."""
    turned = dict(zip(topics.AXES, angles))
    return [Transform(joint.parent if joint.parent == 'base_link' else prefix + joint.parent, prefix + joint.child,
                      joint.origin, _rotation(joint.axis or (0.0, 0.0, 0.0), turned.get(joint.name, 0.0)))
            for joint in PEDESTAL_JOINTS]


def tf_message(stamp: Nanoseconds, transforms: Iterable[Transform]) -> Message:
    """Return the tf2_msgs/msg/TFMessage of transforms at a stamp."""
    types = messages.ROS_TYPESTORE.types
    stamped, transform = (types[f'geometry_msgs/msg/{name}'] for name in ('TransformStamped', 'Transform'))
    messages_of_frames = []
    for given in transforms:
        header = messages.header(given.parent)
        messages.put_stamp(header.stamp, stamp)
        messages_of_frames.append(stamped(header=header, child_frame_id=given.child, transform=transform(
            translation=messages.vector3(*given.translation),
            rotation=messages.Quaternion(**dict(zip('xyzw', given.rotation))))))
    return types['tf2_msgs/msg/TFMessage'](transforms=messages_of_frames)
