"""Smoothing of the angle errors of the receiver, in the interpretations of eq. (1) of Jia 2025.

    none            the mean of the samples of one step
    recursion       eq. (1) as printed: a first-order low-pass, x = (n - 1) / n x + 1 / n y. Its bandwidth (eq. 2) is
                    1 / ((n - 1) T) rad/s, its mean delay n - 1 samples
    moving_average  the text of the paper, not its eq. (1): the mean of the last n samples, delay (n - 1) / 2 samples

y: sample of the error; x: smoothed error; T: time between two samples.
"""
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Radians
from pedestal_common.record import Record

SMOOTHING_KINDS = ('none', 'recursion', 'moving_average')
SMOOTHING_NONE, SMOOTHING_RECURSION, SMOOTHING_MOVING_AVERAGE = range(len(SMOOTHING_KINDS))

MAX_WINDOW_SAMPLES = 256  # length of the longest moving average [samples]


class Smoother(Record):
    """State of a smoother."""
    low_pass: Radians           # output of the recursion
    sum: Radians                # of the samples of this step
    samples: Annotated[Floats, (MAX_WINDOW_SAMPLES,)]   # the last samples [rad]
    count: int                  # number of samples since the start


@compiled
def begin(smoother: Smoother) -> None:
    """Begin a drive step: reset the sum of its samples."""
    smoother.sum = 0.0


@compiled
def put(smoother: Smoother, y: Radians, gain: float) -> None:
    """Add one sample y; gain: 1/n of the recursion."""
    smoother.sum += y
    smoother.low_pass += gain * (y - smoother.low_pass)
    smoother.samples[smoother.count % MAX_WINDOW_SAMPLES] = y
    smoother.count += 1


@compiled
def smoothed(smoother: Smoother, kind: int, samples: int, n: int) -> Radians:
    """Return the smoothed error at the end of a step. n: length of the moving average, shorter at the start."""
    if kind == SMOOTHING_RECURSION:
        return smoother.low_pass
    if kind == SMOOTHING_NONE:
        return smoother.sum / samples
    length = min(n, smoother.count)
    total = 0.0
    for k in range(smoother.count - length, smoother.count):
        total += smoother.samples[k % MAX_WINDOW_SAMPLES]
    return total / length


def delay(kind: str, samples: int, n: int) -> float:
    """Return the mean delay of a kind in samples before the newest; samples: number of samples of a step."""
    return {'none': 0.5 * (samples - 1), 'recursion': n - 1.0, 'moving_average': 0.5 * (n - 1)}[kind]


def steps_back(kind: str, samples: int, n: int) -> float:
    """Return the mean age of the steps whose samples are in the result, in drive steps; 0 for the last step. A beam
    that is held within a step has one direction in each step. For the direction of the beam the control unit therefore
    needs the age in whole steps, and for the place of the target the age of the samples."""
    if kind == 'none':
        return 0.0
    if kind == 'recursion':
        # A step has `kept` times the weight of the next newer step; this is the mean age of a geometric series.
        kept = (1.0 - 1.0 / n)**samples
        return kept / (1.0 - kept)
    return sum(k // samples for k in range(n)) / n
