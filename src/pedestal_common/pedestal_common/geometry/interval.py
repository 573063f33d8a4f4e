"""Search in a table of increasing times for the interval that holds a time."""
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats


@compiled
def interval(breaks: Floats, t: float) -> int:
    """Return the index i with breaks[i] <= t < breaks[i + 1], 0 before the first of n breaks, n - 2 after the last."""
    low, high = 0, len(breaks) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if breaks[middle] <= t:
            low = middle
        else:
            high = middle
    return low
