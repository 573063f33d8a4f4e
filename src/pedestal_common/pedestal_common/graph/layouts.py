"""Layouts of the messages: names, units and tolerances of the numbers in a message of each type. A column is one
number in the messages of a topic, for example 'azimuth.velocity' of joint_states."""
import math
import re
import typing
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from pedestal_common.graph import topics
from pedestal_common.quantities import Bools, Floats, Pairs, Records


class Field(typing.NamedTuple):
    """Group of numbers of a message."""
    name: str                           # of the field in a record
    path: str                           # of its numbers in the message, a pattern whose group 1 is the component
    components: tuple[str, ...] | None  # values of group 1, in the order of the record; None: indices of Topic.names
    column: str                         # name of a column, with {} for the component (or the name of the joint)
    unit: str = ''                      # of the numbers where the topic gives none
    tolerance: float = 1e-9             # largest accepted difference of recorded and recomputed numbers, in that unit
    recorded: bool = True               # the field is part of the records of the graph's topics


_XYZ, _XYZW = ('x', 'y', 'z'), ('x', 'y', 'z', 'w')

LAYOUTS = {
    'sensor_msgs/msg/JointState': (
        Field('position', r'position\[(\d+)\]', None, '{}.position', 'rad', 1e-9),
        Field('velocity', r'velocity\[(\d+)\]', None, '{}.velocity', 'rad/s', 1e-8),
        Field('effort', r'effort\[(\d+)\]', None, '{}.effort', 'Nm', 1e-6)),
    'trajectory_msgs/msg/JointTrajectory': (
        Field('position', r'points\[0\]\.positions\[(\d+)\]', None, '{}.position', 'rad', 1e-9),
        Field('velocity', r'points\[0\]\.velocities\[(\d+)\]', None, '{}.velocity', 'rad/s', 1e-8),
        Field('acceleration', r'points\[0\]\.accelerations\[(\d+)\]', None, '{}.acceleration', 'rad/s2', 1e-6),
        Field('effort', r'points\[0\]\.effort\[(\d+)\]', None, '{}.effort', 'Nm', 1e-6, recorded=False)),
    'sensor_msgs/msg/Range': (
        Field('range', r'(range)', ('range',), '{}', 'm'),
        Field('variance', r'(variance)', ('variance',), '{}', 'm2')),
    'sensor_msgs/msg/FluidPressure': (
        Field('fluid_pressure', r'(fluid_pressure)', ('fluid_pressure',), '{}', 'Pa'),
        Field('variance', r'(variance)', ('variance',), '{}', 'Pa2', recorded=False)),
    'sensor_msgs/msg/Temperature': (
        Field('temperature', r'(temperature)', ('temperature',), '{}', 'deg C'),
        Field('variance', r'(variance)', ('variance',), '{}', 'K2', recorded=False)),
    'sensor_msgs/msg/RelativeHumidity': (
        Field('relative_humidity', r'(relative_humidity)', ('relative_humidity',), '{}'),
        Field('variance', r'(variance)', ('variance',), '{}', recorded=False)),
    'geometry_msgs/msg/Vector3Stamped': (
        Field('vector', r'vector\.([xyz])', _XYZ, '{}'),),
    'nav_msgs/msg/Odometry': (
        Field('position', r'pose\.pose\.position\.([xyz])', _XYZ, 'position.{}', 'm'),
        Field('orientation', r'pose\.pose\.orientation\.([xyzw])', _XYZW, 'orientation.{}'),
        Field('twist_linear', r'twist\.twist\.linear\.([xyz])', _XYZ, 'twist.linear.{}', 'm/s'),
        Field('twist_angular', r'twist\.twist\.angular\.([xyz])', _XYZ, 'twist.angular.{}', 'rad/s')),
    'sensor_msgs/msg/Imu': (
        Field('orientation', r'orientation\.([xyzw])', _XYZW, 'orientation.{}'),
        Field('angular_velocity', r'angular_velocity\.([xyz])', _XYZ, 'angular_velocity.{}', 'rad/s'),
        Field('linear_acceleration', r'linear_acceleration\.([xyz])', _XYZ, 'linear_acceleration.{}', 'm/s2'),
        Field('orientation_variance', r'orientation_covariance\[([048])\]', ('0', '4', '8'),
              'orientation_variance.{}', 'rad2')),
    'rosgraph_msgs/msg/Clock': (),
}
"""{message type: its Fields}. The orientation_variance of an Imu is the variance of the attitude that an INS
states."""


Absent: typing.TypeAlias = Callable[..., bool | Bools]
"""Function of numbers of a message, scalars or arrays: True where there is no data."""


class NoDataMark(typing.NamedTuple):
    """The convention by which a message states that it has no data for a field."""
    field: str                  # its name
    paths: tuple[str, ...]      # paths of the numbers in the message that state whether there is data
    absent: Absent              # function of these numbers


def _negative(variance: float | Floats) -> bool | Bools:
    return variance < 0.0


def _out_of_range(distance: float | Floats, least: float | Floats, largest: float | Floats) -> bool | Bools:
    """Return True where a range is infinite (REP 117), or outside the limits of its sensor where there are limits."""
    outside = (largest > least) & ((distance < least) | (distance > largest))
    return (np.abs(distance) == math.inf) | outside


NO_DATA_MARKS = {
    'sensor_msgs/msg/Imu': tuple(NoDataMark(field, (f'{field}_covariance[0]',), _negative)
                                 for field in ('orientation', 'angular_velocity', 'linear_acceleration')),
    'sensor_msgs/msg/Range': (NoDataMark('range', ('range', 'min_range', 'max_range'), _out_of_range),),
}
"""{message type: its NoDataMarks}. By the definition of Imu and REP 145, element 0 of a covariance is -1 without data.
Because no variance is negative, every negative number counts as this mark. By the definition of Range, a range outside
min_range to max_range must be discarded."""


def no_data(type_name: str, numbers: Iterable[tuple[str, int, str]],
            texts: Mapping[str, str]) -> list[tuple[list[str], list[tuple[int, str]], Absent]]:
    """Return [(names of the columns of a field, [(first byte, dtype)] of the numbers of its mark, NoDataMark.absent)].
    numbers, texts: places in a message of the type, as in cdr.Places."""
    places = {path: (start, dtype) for path, start, dtype in numbers}
    marks = NO_DATA_MARKS.get(type_name, ())
    patterns = {field.name: field.path for field in LAYOUTS.get(type_name, ())}
    return [([name for path in places if re.fullmatch(patterns[mark.field], path)
              and (name := column(type_name, path, texts)) is not None],
             [places[path] for path in mark.paths], mark.absent) for mark in marks]


def blank_no_data(type_name: str, table: dict[str, Floats]) -> dict[str, Floats]:
    """Return a table {column: array (n,)} with NaN where its messages mark a field as no data. A mark is applied only
    if all its numbers are columns of the table."""
    for mark in NO_DATA_MARKS.get(type_name, ()):
        numbers = [table.get(column(type_name, path, {}) or '') for path in mark.paths]
        if all(number is not None for number in numbers):
            absent = mark.absent(*numbers)
            table |= {name: np.where(absent, np.nan, values) for name, values in table.items()
                      if name.partition('.')[0] == mark.field}
    return table


_JOINTS = {'sensor_msgs/msg/JointState': 'name', 'trajectory_msgs/msg/JointTrajectory': 'joint_names'}
"""{message type: its field with the names of the joints}."""


class Column(typing.NamedTuple):
    """One number of a topic's messages."""
    name: str
    field: str          # name of its Field
    unit: str
    tolerance: float    # as in Field


def fields(topic: str) -> tuple[Field, ...]:
    """Return the Fields of a topic of the table, whose numbers make its record; () for a text."""
    row = topics.TOPIC_BY_NAME[topic]
    return tuple(field for field in LAYOUTS.get(row.type, ())
                 if field.recorded and field.name in (row.only or (field.name,)))


def _names(field: Field, row: topics.Topic) -> tuple[str, ...]:
    if field.components is None:
        return row.names
    # A digit is the index of a diagonal element of a covariance (3, 3), stored by rows: 0, 4 and 8 belong to x, y, z.
    return tuple('xyz'[int(c) // 4] if c.isdigit() else c for c in field.components)


def columns(topic: str) -> tuple[Column, ...]:
    """Return the Columns of a topic of the table, in the order of its record."""
    row = topics.TOPIC_BY_NAME[topic]
    return tuple(Column(name := field.column.format(part), field.name, row.units.get(name, field.unit),
                        field.tolerance)
                 for field in fields(topic) for part in _names(field, row))


def column(type_name: str, path: str, texts: Mapping[str, str]) -> str | None:
    """Return the name of the column of a number at a path in a message; None for header and covariances."""
    for field in LAYOUTS.get(type_name, ()):
        match = re.fullmatch(field.path, path)
        if match:
            part = match[1]
            if field.components is None:
                part = texts.get(f'{_JOINTS[type_name]}[{part}]', part)
            return field.column.format('xyz'[int(part) // 4] if field.name == 'orientation_variance' else part)
    if path.startswith('header.') or 'covariance' in path or type_name == 'trajectory_msgs/msg/JointTrajectory':
        return None
    return path


def unit(topic: str, type_name: str, column: str) -> str:
    """Return the unit of a column of a topic with messages of this type; '' if there is no unit, or none is known."""
    row = topics.TOPIC_BY_NAME.get(topic)
    if row is None or row.type != type_name:
        return ''
    if column in row.units:
        return row.units[column]
    for field in LAYOUTS.get(type_name, ()):
        head, _, tail = field.column.partition('{}')
        if field.unit and column.startswith(head) and column.endswith(tail):
            return field.unit
    return 's' if column.endswith('time_from_start') else ''


def of_filter(steps: Records, name: str) -> Pairs:
    """Return one number (topics.FILTER_UNITS) of the filters of both axes from records with the topic acu/filter."""
    numbers = steps['acu/filter']['position'].reshape(len(steps), len(topics.AXES), len(topics.FILTER_UNITS))
    return numbers[:, :, list(topics.FILTER_UNITS).index(name)]
