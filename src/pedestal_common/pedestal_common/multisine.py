"""Multisine: a sum of sines with equal amplitudes, which excites a loop at all of their frequencies at once."""
import dataclasses
import math

import numpy as np

from pedestal_common import reproducible
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Hertz, Ints, Seconds


@compiled
def value(bins: Ints, count: int, share: float) -> float:
    """Return the sum of `count` sines of amplitude 1 at a share of the period [-]. Their frequencies are the first
    bins divided by the period. Phases: Schroeder, IEEE Trans. Information Theory 16 (1970) 85; the peak is low."""
    total = 0.0
    for k in range(count):
        turns = bins[k] * share
        total += math.cos(2.0 * math.pi * (turns - math.floor(turns)) - math.pi * (k * (k + 1) / count))
    return total


@compiled
def _fill(bins: Ints, values: Floats) -> None:
    for k in range(len(values)):
        values[k] = value(bins, len(bins), k / len(values))


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A multisine that is added to a loop."""
    period: Seconds     # time after which the sum repeats; each sine has a whole number of periods in it
    lowest: Hertz       # lowest frequency
    highest: Hertz      # highest frequency
    points: int         # number of frequencies, logarithmically spaced
    dropped: int        # number of periods for settling
    kept: int           # number of measured periods
    peak: float         # largest value of the sum, in the unit of the signal of the loop

    def bins(self) -> Ints:
        """Return the frequencies as integer multiples of 1 / period [-]."""
        return np.unique(np.round(reproducible.geomspace(self.lowest, self.highest, self.points)
                                  * self.period).astype(np.int64))

    def frequencies(self) -> Floats:
        """Return the frequencies of the sines [Hz]: `points` of them, fewer if several round to one frequency."""
        return self.bins() / self.period

    def once(self, step: Seconds) -> Floats:
        """Return one period (n,) with one value per step."""
        one = np.empty(round(self.period / step))
        _fill(self.bins(), one)
        return self.peak / np.abs(one).max() * one

    def signal(self, step: Seconds) -> Floats:
        """Return the whole record (n,) with one value per step."""
        return np.tile(self.once(step), self.dropped + self.kept)
