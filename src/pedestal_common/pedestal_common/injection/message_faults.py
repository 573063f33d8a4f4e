"""Injected faults that every simulated node can have: its message is dropped, or the numbers are frozen, NaN or noisy.

In each step a node first calls `clear`, then `apply` for each fault in force. It adds `noise` to the numbers of its
message, and then calls `numbers`, so that frozen numbers contain the noise of the first frozen step. The node itself
carries out the fault drop.
"""
import math
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.injection import table
from pedestal_common.quantities import Bit, Floats, Nanoseconds
from pedestal_common.record import Record

MAX_HELD_NUMBERS = 32  # largest number of values that a node freezes: the size of `held`


class MessageFault(Record):
    """Message faults of a node that are in force."""
    drop: Bit       # 1 while in force
    freeze: Bit     # the same
    nan: Bit        # the same
    holds: Bit      # 1 once the numbers of the first frozen step are stored
    held: Annotated[Floats, (MAX_HELD_NUMBERS,)]    # these numbers
    sigma: float    # 1 sigma of white noise, in the unit of the numbers, 0 for none
    seed: int       # of the noise


@compiled
def clear(faults: MessageFault) -> None:
    """End every fault of the message. `holds` becomes 1 if the step before had a freeze: a freeze that continues then
    uses the same held numbers."""
    faults.holds = faults.freeze
    faults.drop, faults.freeze, faults.nan, faults.sigma = 0, 0, 0, 0.0


def codes(node: str) -> tuple[int, ...]:
    """Return the codes of the faults that every message of a node can have: drop, freeze, nan, noise."""
    return tuple(table.code(node, name) for name in ('drop', 'freeze', 'nan', 'noise'))


@compiled
def apply(faults: MessageFault, codes: tuple[int, ...], fault: int, values: Floats) -> None:
    """Apply a fault if it is one of `codes`, the result of that function; other faults change nothing here."""
    drop, freeze, nan, noise = codes
    if fault == drop:
        faults.drop = 1
    elif fault == freeze:
        faults.freeze = 1
    elif fault == nan:
        faults.nan = 1
    elif fault == noise:
        faults.sigma, faults.seed = values[0], int(values[1])


@compiled
def numbers(faults: MessageFault, values: Floats, first: int) -> None:
    """Freeze values (n,) or make them NaN, in place. `held` stores them from its element `first` on."""
    for i in range(len(values)):
        if faults.freeze != 0:
            if faults.holds != 0:
                values[i] = faults.held[first + i]
            else:
                faults.held[first + i] = values[i]
        if faults.nan != 0:
            values[i] = math.nan


@compiled
def _mixed(x: np.uint64) -> np.uint64:
    """Return the 64 bits that the finaliser of SplitMix64 makes of 64 bits (Steele, Lea and Flood, OOPSLA 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@compiled
def _uniform(seed: int, stamp: Nanoseconds, i: int) -> float:
    """Return a random number in (0, 1) that depends only on (seed, stamp, i), of a counter-based generator (Salmon et
    al., SC 2011)."""
    x = _mixed(_mixed(_mixed(np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15)) ^ np.uint64(stamp)) ^ np.uint64(i))
    return (float(x >> np.uint64(11)) + 0.5) * 2.0**-53


@compiled
def noise(faults: MessageFault, stamp: Nanoseconds, i: int) -> float:
    """Return the white noise of number i of a message: sigma times a standard normal number (Box and Muller 1958)."""
    u, v = _uniform(faults.seed, stamp, 2 * i), _uniform(faults.seed, stamp, 2 * i + 1)
    return faults.sigma * math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)
