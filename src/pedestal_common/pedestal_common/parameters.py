"""Parameters as frozen dataclasses: one declaration gives default, unit, range and description.

The ROS side (declare, refuse, read) is in shell.py; this file knows no ROS.
"""
import dataclasses
import difflib
import functools
import math
import operator
import typing

import numpy as np


class ParameterError(ValueError):
    """A parameter is unknown or outside its range; the message names it, its value and what is allowed."""


def parameter(default, low, high, unit, doc, grid=None):
    """A number (float or int, as annotated) between low and high inclusive. grid: (lowest, highest, points), even in
    its logarithm, on which a search for its best value begins; None: it is not searched for."""
    return dataclasses.field(default=default, metadata={'low': low, 'high': high, 'unit': unit, 'doc': doc,
                                                        'grid': grid})


def choice(default, options, doc):
    """A string out of options."""
    return dataclasses.field(default=default, metadata={'options': tuple(options), 'doc': doc})


def flag(default, doc):
    """A bool."""
    return dataclasses.field(default=default, metadata={'doc': doc})


def text(default, doc):
    """A string that only its reader can judge (a file, a TLE line)."""
    return dataclasses.field(default=default, metadata={'doc': doc})


def group(cls, **changes):
    """A nested dataclass, its defaults changed where named."""
    return dataclasses.field(default_factory=lambda: cls(**changes), metadata={'group': True})


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Base of every parameter dataclass; checks each field's range when it is made.

    A subclass adds its cross-checks in `check`, raising ParameterError.
    """

    def __post_init__(self):
        for field in dataclasses.fields(self):
            _check_field(field, field.name, getattr(self, field.name))
        self.check()

    def check(self):
        """Cross-checks between fields; overridden where two fields limit each other."""

    def check_graph(self, beams, lockstep):
        """Overridden where parameters must fit the graph; beams as in nodes.links, lockstep: its pacing. Raises
        ParameterError."""


@dataclasses.dataclass(frozen=True)
class RosParameters(Parameters):
    """The parameters that rclpy gives every node; the units read none of them."""
    use_sim_time: bool = flag(False, 'the ROS clock of the node is /clock; the steps of a node do not read this clock')
    start_type_description_service: bool = flag(True, 'the node describes its message types')


_ROS_PREFIX = 'qos_overrides.'


def without_ros(values):
    """Return {dotted name: value} without the parameters of every ROS 2 node. Raises ParameterError for a value that
    rclpy would refuse."""
    own = {name: value for name, value in values.items() if name in RosParameters.__dataclass_fields__}
    if own:
        RosParameters(**own)
    return {name: value for name, value in values.items() if name not in own and not name.startswith(_ROS_PREFIX)}


def _check_field(field, name, value):
    meta = field.metadata
    if 'low' in meta:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ParameterError(f'{name} = {value!r}: must be a number')
        if field.type is int and not isinstance(value, int):
            raise ParameterError(f'{name} = {value!r}: must be a whole number')
        if not (math.isfinite(value) and meta['low'] <= value <= meta['high']):
            raise ParameterError(f'{name} = {value:g} {meta["unit"]}: must be {meta["low"]:g} to {meta["high"]:g}')
    elif 'options' in meta and value not in meta['options']:
        raise ParameterError(f'{name} = {value!r}: must be one of {", ".join(meta["options"])}')
    elif field.type is bool and not isinstance(value, bool):
        raise ParameterError(f'{name} = {value!r}: must be true or false')
    elif field.type is str and not isinstance(value, str):
        raise ParameterError(f'{name} = {value!r}: must be text')


@functools.cache
def _group_type(field):
    """The dataclass of a group."""
    return type(field.default_factory())


def flatten(cls, prefix=''):
    """Every leaf of a parameter dataclass as (dotted name, field); groups are walked."""
    for field in dataclasses.fields(cls):
        name = prefix + field.name
        if field.metadata.get('group'):
            yield from flatten(_group_type(field), name + '.')
        else:
            yield name, field


@functools.cache
def _default(cls):
    """An instance of a parameter dataclass with every default."""
    return cls()


def defaults(cls):
    """{dotted name: default} of a parameter dataclass, a group's own defaults included."""
    return as_dict(_default(cls))


@functools.cache
def _readers(cls):
    """[(dotted name, function that reads it from an instance)] of every leaf of a parameter dataclass."""
    return [(name, operator.attrgetter(name)) for name, _ in flatten(cls)]


def as_dict(instance, prefix=''):
    """{dotted name: value} of an instance."""
    return {prefix + name: read(instance) for name, read in _readers(type(instance))}


def did_you_mean(name, known):
    """' did you mean ...?' with the known name most like one that is not known; '' where none is."""
    near = difflib.get_close_matches(name, known, n=1)
    return f' did you mean {near[0]!r}?' if near else ''


def build(cls, values, prefix=''):
    """An instance from {dotted name: value}, every name beginning with `prefix`; names left out keep their default.

    Raises ParameterError for an unknown name (with the nearest known one) or a refused value.
    """
    _check_names(dict(flatten(cls, prefix)), values)
    return _replace(_default(cls), values, prefix)


def check_each(cls, values):
    """Raise ParameterError for the first of {dotted name: value} that `build` would refuse by itself."""
    known = dict(flatten(cls))
    _check_names(known, values)
    for name, value in values.items():
        _check_field(known[name], name, typed(known[name], value))


def _check_names(known, values):
    for name in values:
        if name not in known:
            hint = did_you_mean(name, known)
            raise ParameterError(f'unknown parameter {name!r}' + (f';{hint}' if hint else ''))


def typed(field, value):
    """Return the value of a field, a whole number as a float where the field is one."""
    return float(value) if field.type is float and type(value) is int else value


def _replace(instance, values, prefix):
    changes = {}
    for field in dataclasses.fields(instance):
        name = prefix + field.name
        if field.metadata.get('group'):
            changes[field.name] = _replace(getattr(instance, field.name), values, name + '.')
        elif name in values:
            changes[field.name] = typed(field, values[name])
    try:
        return dataclasses.replace(instance, **changes)
    except ParameterError as error:
        raise ParameterError(f'{prefix}{error}') from None


@functools.cache
def record_type(cls) -> np.dtype:
    """The numpy record of a parameter dataclass: float -> f8, int and bool -> i8, a choice -> i8 (its
    index among the options), a group -> nested record; free text is left out."""
    fields = []
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        if field.metadata.get('group'):
            fields.append((field.name, record_type(_group_type(field))))
        elif 'options' in field.metadata or hints[field.name] in (int, bool):
            fields.append((field.name, 'i8'))
        elif hints[field.name] is float:
            fields.append((field.name, 'f8'))
    return np.dtype(fields, align=True)


def _record_values(instance, cls):
    values = []
    for field in dataclasses.fields(cls):
        value = getattr(instance, field.name)
        if field.metadata.get('group'):
            values.append(_record_values(value, _group_type(field)))
        elif 'options' in field.metadata:
            values.append(field.metadata['options'].index(value))
        elif isinstance(value, (bool, int, float)):
            values.append(value)
    return tuple(values)


def record(instance, cls=None) -> np.ndarray:
    """An instance as a record array of shape (1,): the form the compiled steps take. cls: only the fields of this
    base class, where the instance has more."""
    cls = cls or type(instance)
    return np.array([_record_values(instance, cls)], record_type(cls))
