"""A declared record has the bytes that its fields state, and compiled laws read it."""
from typing import Annotated

import numpy as np
import pytest

from pedestal_common.compiled import compiled
from pedestal_common.parameters import Parameters, parameter, record_type
from pedestal_common.quantities import Bit, BothAxes, Complexes, Floats, Ints, Pair, Radians, Records, Seconds
from pedestal_common.record import Record


class Gains(Parameters):
    """A group of parameters."""
    K_p: float = parameter(1.0, 0.0, 10.0, '1/s', 'gain')


class Axis(Record):
    """One axis."""
    angle: Radians
    held: Bit


class State(Record):
    """Both axes."""
    stamp: Seconds
    line: Pair
    axis: BothAxes[Axis]
    spectrum: Annotated[Complexes, (2,)]
    ring: Annotated[Ints, (3, 4)]
    gains: Gains


class Longer(State):
    """A state with one more field."""
    short: np.int16


class Line(Record, open=True):
    """Numbers whose count a subclass declares."""
    value: Floats
    count: int


class Three(Line):
    """Three numbers."""
    value: Annotated[Floats, (3,)]


def test_a_shape_that_a_subclass_declares():
    assert Three.dtype == np.dtype([('value', 'f8', (3,)), ('count', 'i8')], align=True)


def test_the_type_of_a_record():
    axis = np.dtype([('angle', 'f8'), ('held', 'i8')], align=True)
    fields = [('stamp', 'f8'), ('line', 'f8', (2,)), ('axis', axis, (2,)), ('spectrum', 'c16', (2,)),
              ('ring', 'i8', (3, 4)), ('gains', record_type(Gains))]
    assert State.dtype == np.dtype(fields, align=True)
    assert Longer.dtype == np.dtype([*fields, ('short', 'i2')], align=True)


def test_a_law_writes_a_record():
    @compiled
    def step(state: State, dt: Seconds) -> Seconds:
        state.stamp += dt
        state.axis[1].angle = 2.0 * state.line[0]
        return state.stamp

    states: Records = State.zeros(2)
    states['line'] = 3.0
    assert step(states[1], 0.5) == 0.5
    assert states['axis']['angle'].tolist() == [[0.0, 0.0], [0.0, 6.0]]
    assert states.shape == (2,) and not states['ring'].any()


@pytest.mark.parametrize('hint', [str, Floats, list, 'text'])
def test_what_is_no_field(hint):
    with pytest.raises((TypeError, NameError)):
        type('Wrong', (Record,), {'__annotations__': {'x': hint}})
