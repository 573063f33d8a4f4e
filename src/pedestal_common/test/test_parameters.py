"""Parameter dataclasses: ranges, names, records."""
import dataclasses
import math

import numpy as np
import pytest

from pedestal_common.compiled import compiled
from pedestal_common.parameters import (
    ParameterError,
    Parameters,
    as_dict,
    build,
    choice,
    flag,
    group,
    parameter,
    record,
    text,
)


@dataclasses.dataclass(frozen=True)
class Loop(Parameters):
    Kp: float = parameter(6.0, 0.0, 100.0, 'Nm s/rad', 'proportional gain')
    order: int = parameter(2, 1, 4, '', 'order')
    seed: int = parameter(1, 0, 2**31 - 1, '', 'seed')

    def check(self):
        if self.Kp > 50.0 and self.order > 3:
            raise ParameterError(f'order = {self.order}: must be at most 3 when Kp is above 50')


@dataclasses.dataclass(frozen=True)
class Axis(Parameters):
    name: str = text('', 'label')
    kind: str = choice('slow', ('slow', 'fast'), 'speed')
    inverted: bool = flag(False, 'sign')
    azimuth: Loop = group(Loop)
    elevation: Loop = group(Loop, Kp=3.0)


def test_build_changes_what_is_named_and_keeps_the_rest():
    axis = build(Axis, {'elevation.order': 4, 'kind': 'fast', 'azimuth.Kp': 7})
    assert axis == Axis(kind='fast', azimuth=Loop(Kp=7.0), elevation=Loop(Kp=3.0, order=4))
    assert build(Axis, as_dict(axis)) == axis


@pytest.mark.parametrize('values, words', [
    ({'azimuth.Kq': 1.0}, ["unknown parameter 'azimuth.Kq'", "'azimuth.Kp'"]),
    ({'azimuth.Kp': 101.0}, ['azimuth.Kp = 101', '0 to 100']),
    ({'azimuth.Kp': math.nan}, ['azimuth.Kp = nan', '0 to 100']),
    ({'azimuth.Kp': 'six'}, ["azimuth.Kp = 'six'", 'number']),
    ({'azimuth.Kp': '6 Nm s/deg'}, ["azimuth.Kp = '6 Nm s/deg': must be a number, in Nm s/rad"]),
    ({'azimuth.order': 1.5}, ['azimuth.order = 1.5', 'whole number']),
    ({'azimuth.seed': 2**31}, ['azimuth.seed = 2147483648: must be 0 to 2147483647']),
    ({'azimuth.Kp': 1e7}, ['azimuth.Kp = 1e+07 Nm s/rad: must be 0 to 100']),
    ({'kind': 'medium'}, ["kind = 'medium'", 'slow, fast']),
    ({'inverted': 1}, ['inverted = 1', 'true or false']),
    ({'name': 3}, ['name = 3', 'text']),
    ({'azimuth.Kp': 60.0, 'azimuth.order': 4}, ['azimuth.order = 4', 'at most 3']),
])
def test_refusals_name_field_value_and_range(values, words):
    with pytest.raises(ParameterError) as refusal:
        build(Axis, values)
    assert '\n' not in str(refusal.value)
    for word in words:
        assert word in str(refusal.value)


def test_record_is_what_compiled_code_reads():
    @compiled
    def read(p):
        return p[0].azimuth.Kp, p[0].elevation.Kp, p[0].kind, p[0].elevation.order, p[0].inverted

    arrays = record(build(Axis, {'kind': 'fast', 'inverted': True}))
    assert arrays.shape == (1,) and isinstance(arrays, np.ndarray)
    assert read(arrays) == (6.0, 3.0, 1, 2, 1)
