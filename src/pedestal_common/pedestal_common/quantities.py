"""Types of numbers and arrays: what a number means, its unit or its shape. numba and Python ignore both; a reader and
mypy do not. A shape such as `Vector3` also gives the size of an array in a record (record.Record)."""
from collections.abc import Sequence
from typing import Annotated, Any, TypeAlias, TypedDict, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Bytes: TypeAlias = NDArray[np.uint8]
Complexes: TypeAlias = NDArray[np.complex128]
Texts: TypeAlias = NDArray[np.str_]
Records: TypeAlias = NDArray[np.void]               # records of one declared type (record.Record)
DType: TypeAlias = np.dtype[np.void]                # of a record

Radians: TypeAlias = Annotated[float, 'rad']
RadiansPerSecond: TypeAlias = Annotated[float, 'rad/s']
RadiansPerSecond2: TypeAlias = Annotated[float, 'rad/s2']
RadiansPerSecond3: TypeAlias = Annotated[float, 'rad/s3']     # a jerk
Radians2: TypeAlias = Annotated[float, 'rad2']      # a variance
Degrees: TypeAlias = Annotated[float, 'deg']
Seconds: TypeAlias = Annotated[float, 's']
Nanoseconds: TypeAlias = Annotated[int, 'ns']       # since the Unix epoch or the start of a run: a stamp; or a time
Hertz: TypeAlias = Annotated[float, 'Hz']
DegreesPerSecond: TypeAlias = Annotated[float, 'deg/s']
RadiansPerSample: TypeAlias = Annotated[float, 'rad']
Meters: TypeAlias = Annotated[float, 'm']
MetersPerSecond: TypeAlias = Annotated[float, 'm/s']
MetersPerSecond2: TypeAlias = Annotated[float, 'm/s2']
NewtonMeters: TypeAlias = Annotated[float, 'Nm']
KilogramMeters2: TypeAlias = Annotated[float, 'kg m2']
Amperes: TypeAlias = Annotated[float, 'A']
Volts: TypeAlias = Annotated[float, 'V']
Decibels: TypeAlias = Annotated[float, 'dB']
DecibelHertz: TypeAlias = Annotated[float, 'dB-Hz']  # C/N0
Days: TypeAlias = Annotated[float, 'd']
Bit: TypeAlias = int                                # 0 or 1; a record has no bool

Pair: TypeAlias = Annotated[Floats, (2,)]           # azimuth and elevation, or cross-elevation and elevation
Vector3: TypeAlias = Annotated[Floats, (3,)]
Quaternion: TypeAlias = Annotated[Floats, (4,)]     # x, y, z, w
Matrix3: TypeAlias = Annotated[Floats, (3, 3)]
Xyz: TypeAlias = tuple[float, float, float]         # a vector in a law, in place of an array
Xyzw: TypeAlias = tuple[float, float, float, float]     # a quaternion in a law, in place of an array
Pairs: TypeAlias = Annotated[Floats, '(n, 2)']
Vectors3: TypeAlias = Annotated[Floats, '(n, 3)']
Quaternions: TypeAlias = Annotated[Floats, '(n, 4)']
Rotations: TypeAlias = Annotated[Floats, '(n, 3, 3)']
Times: TypeAlias = Annotated[Floats, '(n,) s']
Stamps: TypeAlias = Annotated[Ints, '(n,) ns']
Direction: TypeAlias = tuple[Radians, Radians]     # azimuth and elevation, of a law

Estimate: TypeAlias = tuple[float, float, float]    # a value, and the low and the high end of its confidence interval

_R = TypeVar('_R')
BothAxes: TypeAlias = Annotated[Sequence[_R], (2,)]     # a record of each axis: azimuth, elevation

AnyRecord: TypeAlias = Any  # a record whose fields depend on data, as those of a node depend on its topics
Message: TypeAlias = Any    # a ROS message, whose class is made by ROS without types
Json: TypeAlias = Any       # what a JSON or YAML file holds; the code that takes a value from it checks the value
Value: TypeAlias = Any      # of a parameter or of an argument of a command, whose declaration states the type
Table: TypeAlias = dict[str, Any]   # {column: Floats} with a row per message of a topic; a column of texts is a list


class SingleRow(TypedDict):
    """Row of a --json file: one measured number."""
    case: str
    metric: str
    value: float | None     # None if the number could not be measured
    unit: str
    paper: float | None     # number that a paper prints
    target: str | None      # for pedestal_results.intervals.meets


class Coverage(TypedDict, total=False):
    """Fields of a row of trials that some of them did not measure."""
    of: int     # number of all trials
    left_out: dict[str, int]    # {first word of a verdict: number of trials without the result}


class Row(SingleRow, Coverage, total=False):
    """Row of a --json file. A row of several runs states their mean and its confidence interval."""
    ci_low: float | None
    ci_high: float | None
    runs: int
    mean_loss_s: float | None   # mean of the result loss_s of the trials
    text: str       # of the value
    alarms: list[str]
