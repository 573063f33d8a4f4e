"""Record: a class that declares the fields of a numpy record, which compiled laws read and write.

    class State(Record):
        stamp: Seconds          # of the last step
        angle: Pair             # azimuth, elevation [rad]
        axis: BothAxes[Axis]

    @compiled
    def step(state: State, dt: Seconds) -> None:
        state.stamp += dt

    states = State.zeros()      # records (1,), whose type is State.dtype
    step(states[0], 0.01)

A field is a float, an int, an array with its shape, another record, or a group of parameters. The class is never
instantiated: a record is an element of an array.
"""
import typing
from typing import Annotated, ClassVar

import numpy as np

from pedestal_common.parameters import Parameters, record_type
from pedestal_common.quantities import DType, Records

_SCALARS = {float: 'f8', int: 'i8', complex: 'c16'}


class Record:
    """Base of declared records, with the fields of its base class first. align=False: no bytes between the fields;
    open=True: no type of its own, because its subclasses declare the shape of a field."""
    dtype: ClassVar[DType]

    def __init_subclass__(cls, align: bool = True, open: bool = False) -> None:
        if open:
            return
        hints = typing.get_type_hints(cls, include_extras=True)
        cls.dtype = np.dtype([(name, *_form(cls, name, hint)) for name, hint in hints.items() if name != 'dtype'],
                             align=align)

    @classmethod
    def zeros(cls, count: int = 1) -> Records:
        """Return records (count,) in which each number is 0."""
        return np.zeros(count, cls.dtype)

    @classmethod
    def of(cls, **values: object) -> Records:
        """Return a record (1,) with these values of its fields; a field without a value is 0."""
        record = cls.zeros()
        for name, value in values.items():
            record[name] = value
        return record


def _form(cls: type, name: str, hint: object) -> tuple[object, ...]:
    """Return (type,) or (type, shape) of a field for numpy. Raises TypeError for another type."""
    shape: tuple[int, ...] = ()
    if typing.get_origin(hint) is Annotated:
        hint, *notes = typing.get_args(hint)
        shape = next((note for note in notes if isinstance(note, tuple)), ())
        if typing.get_origin(hint) is not None:     # an array or a sequence: the type of its elements
            *_, hint = typing.get_args(hint)
            hint = next(iter(typing.get_args(hint)), hint)
            if not shape:
                raise TypeError(f'{cls.__name__}.{name} has no shape')
    if hint in _SCALARS:
        return _SCALARS[hint], shape
    if isinstance(hint, type) and issubclass(hint, np.generic):
        return hint, shape
    if isinstance(hint, type) and issubclass(hint, Record):
        return hint.dtype, shape
    if isinstance(hint, type) and issubclass(hint, Parameters):
        return record_type(hint), shape
    raise TypeError(f'{cls.__name__}.{name}: {hint} is no type of a field')
