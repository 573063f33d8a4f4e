"""Search for the interval of a table of increasing times that holds an instant."""
from pedestal_common.compiled import compiled


@compiled
def interval(breaks, t):
    """Return the row i with breaks[i] <= t < breaks[i + 1] of two or more breaks; outside them the first or last
    interval."""
    low, high = 0, len(breaks) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if breaks[middle] <= t:
            low = middle
        else:
            high = middle
    return low
