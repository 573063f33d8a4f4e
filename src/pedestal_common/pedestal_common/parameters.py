"""Parameters of the nodes as frozen dataclasses: one declaration gives default, unit, range and description. No ROS
here."""
import dataclasses
import difflib
import functools
import math
import operator
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping

if typing.TYPE_CHECKING:    # numpy is slow to import, and `pedestal scenarios` needs none
    from pedestal_common.quantities import DType, Records, Value

Field: typing.TypeAlias = 'dataclasses.Field[Value]'     # one parameter of a dataclass
_N = typing.TypeVar('_N', bound=float)


RELATIONS = {'below': operator.lt, 'above': operator.gt, 'at most': operator.le, 'at least': operator.ge}
"""{words of an error: comparison of a field with another field}."""


NOT_GIVEN = math.nan
"""Default of a number for which no default is right, such as the position of an antenna. Only a field with this
default may have this value."""


class ParameterError(ValueError):
    """Unknown parameter, or value outside its range; the message gives its name, its value and the allowed range."""


def parameter(default: _N, low: float, high: float, unit: str, doc: str,
              grid: tuple[float, float, int] | None = None, must_be: str = '') -> _N:
    """Declare a number (float or int, as annotated) between low and high inclusive.

    grid: (lowest, highest, number) of the values, evenly spaced in the logarithm, at which `pedestal tune` begins its
    search; None: not tuned. must_be: relation to another field, one of RELATIONS and the field, as in 'below high'.
    """
    return dataclasses.field(default=default, metadata={'low': low, 'high': high, 'unit': unit, 'doc': doc,
                                                        'grid': grid, 'must_be': must_be})


def choice(default: str, options: Iterable[str], doc: str) -> str:
    """Declare a string that must be one of the options."""
    return dataclasses.field(default=default, metadata={'options': tuple(options), 'doc': doc})


def flag(default: bool, doc: str) -> bool:
    """Declare a bool."""
    return dataclasses.field(default=default, metadata={'doc': doc})


def text(default: str, doc: str) -> str:
    """Declare a string that only the code that uses it can check (a file, a TLE line)."""
    return dataclasses.field(default=default, metadata={'doc': doc})


def group(cls: 'type[_P]', **changes: 'Value') -> '_P':
    """Declare a nested dataclass, with some of its defaults changed."""
    return dataclasses.field(default_factory=lambda: cls(**changes), metadata={'group': True})


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Base of every parameter dataclass; checks its fields when it is made, raising ParameterError."""
    REALTIME_ONLY: typing.ClassVar[str] = ''    # reason why its node cannot run in lockstep, the end of the error

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            _check_field(field, field.name, getattr(self, field.name))
        for field in dataclasses.fields(self):
            if field.metadata.get('must_be'):
                self._check_relation(field)
        self.check()

    def _check_relation(self, field: Field) -> None:
        relation, _, other = field.metadata['must_be'].rpartition(' ')
        value, limit = getattr(self, field.name), getattr(self, other)
        if not RELATIONS[relation](value, limit):
            unit = f' {field.metadata["unit"]}'.rstrip()
            raise ParameterError(f'{field.name} = {value:g}{unit}: must be {relation} {other} = {limit:g}{unit}')

    def check(self) -> None:
        """Check fields that limit each other; overridden where a `must_be` cannot state the relation."""

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError where parameters do not fit a graph; overridden where there are such parameters.

        beams: number of beams of an electronic array, 0 for a drive with motors.
        """
        if lockstep and self.REALTIME_ONLY:
            raise ParameterError(f'graph.pacing = lockstep: must be realtime{self.REALTIME_ONLY}')

    def remarks(self) -> list[str]:
        """Return the lines that a user reads at the start on parameters without their full effect; overridden where
        there are such parameters."""
        return []


AnyParameters: typing.TypeAlias = typing.Any    # instance of a parameter class that the node determines
_P = typing.TypeVar('_P', bound=Parameters)
_F = typing.TypeVar('_F', bound=Callable[..., object])


def _cached(function: _F) -> _F:
    """Return functools.cache of a function with its type: mypy takes the class of a dataclass for unhashable."""
    return typing.cast(_F, functools.cache(function))


@dataclasses.dataclass(frozen=True)
class RosParameters(Parameters):
    """The parameters that rclpy gives every node; the units read none of them."""
    use_sim_time: bool = flag(False, 'the ROS clock of the node is /clock; the steps of a node do not read this clock')
    start_type_description_service: bool = flag(True, 'the node describes its message types')


_ROS_PREFIX = 'qos_overrides.'  # beginning of the names of further parameters that rclpy gives every node


def without_ros(values: 'Mapping[str, Value]') -> 'dict[str, Value]':
    """Return {dotted name: value} without the parameters of every ROS 2 node. Raises ParameterError as rclpy would."""
    own = {name: value for name, value in values.items() if name in RosParameters.__dataclass_fields__}
    if own:
        RosParameters(**own)
    return {name: value for name, value in values.items() if name not in own and not name.startswith(_ROS_PREFIX)}


def is_absent(value: object) -> bool:
    """Return True for NOT_GIVEN."""
    return isinstance(value, float) and math.isnan(value)


def value_text(value: object) -> str:
    """Return the text of a value or default for people."""
    return 'not given' if is_absent(value) else f'{value:g}' if isinstance(value, float) else str(value)


def number_text(value: float) -> str:
    """Return the text of a number for an error: all digits of an integer, six digits of a float."""
    return str(value) if isinstance(value, int) else f'{value:g}'


def _check_field(field: Field, name: str, value: object) -> None:
    meta = field.metadata
    if 'low' in meta:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            unit = f', in {meta["unit"]}' if meta['unit'] else ''
            raise ParameterError(f'{name} = {value!r}: must be a number{unit}')
        if field.type is int and not isinstance(value, int):
            raise ParameterError(f'{name} = {value!r}: must be a whole number')
        absent = is_absent(value) and is_absent(field.default)
        if not absent and not (meta['low'] <= value <= meta['high'] and math.isfinite(value)):
            given, low, high = (number_text(number) for number in (value, meta['low'], meta['high']))
            unit = f' {meta["unit"]}'.rstrip()
            raise ParameterError(f'{name} = {given}{unit}: must be {low} to {high}')
    elif 'options' in meta and value not in meta['options']:
        raise ParameterError(f'{name} = {value!r}: must be one of {", ".join(meta["options"])}')
    elif field.type is bool and not isinstance(value, bool):
        raise ParameterError(f'{name} = {value!r}: must be true or false')
    elif field.type is str and not isinstance(value, str):
        raise ParameterError(f'{name} = {value!r}: must be text')


@_cached
def _group_type(field: Field) -> type[Parameters]:
    assert field.default_factory is not dataclasses.MISSING
    return type(field.default_factory())


def flatten(cls: type[Parameters], prefix: str = '') -> Iterator[tuple[str, Field]]:
    """Yield (dotted name, field) of every parameter of a dataclass, including those in its groups."""
    for field in dataclasses.fields(cls):
        name = prefix + field.name
        if field.metadata.get('group'):
            yield from flatten(_group_type(field), name + '.')
        else:
            yield name, field


@_cached
def _default(cls: type[_P]) -> _P:
    return cls()


def defaults(cls: type[Parameters]) -> 'dict[str, Value]':
    """Return {dotted name: default} of a parameter dataclass, with the changed defaults of its groups."""
    return as_dict(_default(cls))


@_cached
def _readers(cls: type[Parameters]) -> 'list[tuple[str, Callable[[Parameters], Value]]]':
    """Return [(dotted name, function that reads the value from an instance)] of every parameter of a dataclass."""
    return [(name, operator.attrgetter(name)) for name, _ in flatten(cls)]


def as_dict(instance: Parameters, prefix: str = '') -> 'dict[str, Value]':
    """Return {dotted name: value} of an instance."""
    return {prefix + name: read(instance) for name, read in _readers(type(instance))}


def option_of(name: str) -> str:
    """Return the option of a field of options: --params-file for params_file."""
    return f'--{name.replace("_", "-")}'


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ' did you mean ...?' with the known name most like an unknown name; '' without a similar name."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f' did you mean {near[0]!r}?' if near else ''


def build(cls: type[_P], values: 'Mapping[str, Value]', prefix: str = '') -> _P:
    """Return an instance with values {dotted name: value}, in which every name begins with `prefix`, and defaults.
    Raises ParameterError for an unknown name (with the nearest known name) or a refused value."""
    _check_names(dict(flatten(cls, prefix)), values)
    return _replace(_default(cls), values, prefix)


def check_each(cls: type[Parameters], values: 'Mapping[str, Value]') -> None:
    """Raise ParameterError for the first of {dotted name: value} that `build` would refuse whatever the others are.
    Relations between fields are not checked."""
    known = dict(flatten(cls))
    _check_names(known, values)
    for name, value in values.items():
        _check_field(known[name], name, typed(known[name], value))


def _check_names(known: Mapping[str, Field], values: Iterable[str]) -> None:
    for name in values:
        if name not in known:
            hint = did_you_mean(name, known)
            raise ParameterError(f'unknown parameter {name!r}' + (f';{hint}' if hint else ''))


def typed(field: Field, value: 'Value') -> 'Value':
    """Return the value of a field; a whole number in the range of a field of type float is returned as a float."""
    is_whole = field.type is float and type(value) is int
    return float(value) if is_whole and field.metadata['low'] <= value <= field.metadata['high'] else value


def _replace(instance: _P, values: 'Mapping[str, Value]', prefix: str) -> _P:
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


@_cached
def record_type(cls: type[Parameters]) -> 'DType':
    """Return the type of the numpy record of a parameter dataclass. A float becomes f8; an int, a bool, or the index
    of a choice i8; a group a nested record. Other texts are left out."""
    fields: list[tuple[str, str | DType]] = []
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        if field.metadata.get('group'):
            fields.append((field.name, record_type(_group_type(field))))
        elif 'options' in field.metadata or hints[field.name] in (int, bool):
            fields.append((field.name, 'i8'))
        elif hints[field.name] is float:
            fields.append((field.name, 'f8'))
    import numpy as np
    return np.dtype(fields, align=True)


def _record_values(instance: Parameters, cls: type[Parameters]) -> tuple[object, ...]:
    values: list[object] = []
    for field in dataclasses.fields(cls):
        value = getattr(instance, field.name)
        if field.metadata.get('group'):
            values.append(_record_values(value, _group_type(field)))
        elif 'options' in field.metadata:
            values.append(field.metadata['options'].index(value))
        elif isinstance(value, (bool, int, float)):
            values.append(value)
    return tuple(values)


def record(instance: Parameters, cls: type[Parameters] | None = None) -> 'Records':
    """Return an instance as a record array of shape (1,), the form in which compiled laws read parameters. cls: base
    class of the instance, whose fields alone are in the record."""
    cls = cls or type(instance)
    import numpy as np
    return np.array([_record_values(instance, cls)], record_type(cls))
