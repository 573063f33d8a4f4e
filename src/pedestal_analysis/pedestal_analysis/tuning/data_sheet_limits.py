"""Refusal of a data sheet whose values contradict each other: the options of `pedestal new`, each with the range in
which the antenna can be made.

Because each range depends on the other values of the data sheet, each range is searched. An option takes values of
equal ratios up to the ends of its own range. The edges between refused and accepted values are bisected.
"""
import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

from pedestal_analysis import console
from pedestal_analysis.tuning.data_sheet_format import DataSheet
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import flatten
from pedestal_common.quantities import Json

GRID_COUNT, BISECTIONS, MAX_OPTIONS = 8, 10, 3
"""Number of tried values on each side of the refused value; number of bisections of an edge; largest number of options
in the refusal."""

NO_CAUSE = ('encoder_bits', 'cn0', 'lash')  # fields of the data sheet that contradict no other field


class SheetError(ValueError):
    """Error of a data sheet whose values contradict each other. Its text is one line that names options."""


def refusal(sheet: DataSheet, error: ValueError, make: Callable[[DataSheet], object]) -> SheetError:
    """Return the error with options for the error of a data sheet. make(sheet) raises ValueError for a refused one."""
    axis = _axis(error)

    def is_made(name: str, value: float) -> bool:
        """Return True if the data sheet with another value is made, or refused for another axis."""
        try:
            changes: dict[str, Json] = {name: value}
            make(dataclasses.replace(sheet, **changes))
        except ValueError as found:
            return bool(axis and _axis(found) and _axis(found) != axis)
        return True

    fields = [(name, field) for name, field in flatten(type(sheet)) if 'low' in field.metadata
              and name not in NO_CAUSE and getattr(sheet, name) > 0.0
              and not (axis and name.rpartition('_')[2] in AXES and not name.endswith(axis))]
    found: list[str] = []
    # The options that differ from the default come first, because the user gave them.
    for name, field in sorted(fields, key=lambda item: getattr(sheet, item[0]) == item[1].default):
        if len(found) == MAX_OPTIONS:
            break
        edges = _edges(name, getattr(sheet, name), field.metadata, is_made)
        if edges:
            value = f'{getattr(sheet, name):g} {field.metadata["unit"]}'.rstrip()
            found.append(f'{console.option_of(name)} {value}: must be {edges[0]:g} to {edges[1]:g}')
    if not found:
        return SheetError(f'the values of the data sheet contradict each other: {error}')
    return SheetError(f'{", or ".join(found)}, with the other values of the data sheet ({error})')


def _axis(error: ValueError) -> str:
    """Return the name of the axis in the text of an error, '' for none."""
    return next((name for name in AXES if f'{name}.' in str(error) or f'adu.{name}:' in str(error)), '')


def _edges(name: str, value: float, meta: Mapping[str, Json],
           is_made: Callable[[str, float], bool]) -> tuple[float, float] | None:
    """Return the lowest and highest accepted value next to a refused value of a field, None if there are none.

    meta: metadata of the field; is_made(name, value) returns True for an accepted value.
    """
    for end in (meta['high'], meta['low'] or 1e-4 * meta['high']):
        refused, accepted, last = value, 0.0, 0.0   # 0: no value was accepted
        for tried in np.geomspace(value, end, GRID_COUNT + 1)[1:].tolist() if end != value else ():
            tried = min(max(tried, meta['low']), meta['high'])
            if is_made(name, tried):
                accepted, last = accepted or tried, tried
            elif accepted:
                last = _bisected(last, tried, lambda one: is_made(name, one))
                break
            else:
                refused = tried
        if accepted:
            edge = _bisected(accepted, refused, lambda one: is_made(name, one))
            low, high = sorted((edge, last))
            return _rounded(low, math.ceil), _rounded(high, math.floor)
    return None


def _bisected(accepted: float, refused: float, is_made: Callable[[float], bool]) -> float:
    """Return the accepted value next to a refused value."""
    for _ in range(BISECTIONS):
        middle = math.sqrt(accepted * refused)
        accepted, refused = (middle, refused) if is_made(middle) else (accepted, middle)
    return accepted


def _rounded(value: float, direction: Callable[[float], int]) -> float:
    """Return a value with three digits; direction: math.ceil or math.floor."""
    size = 10.0**(math.floor(math.log10(value)) - 2)
    return float(f'{direction(value / size - 1e-9 if direction is math.ceil else value / size + 1e-9) * size:.3g}')
