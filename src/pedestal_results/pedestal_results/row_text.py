"""Numbers of results as text, for terminals and pages."""
from __future__ import annotations

import math
import typing

if typing.TYPE_CHECKING:    # a verb that prints no result does not wait for numpy
    from pedestal_common.quantities import Row


def number(value: float | None) -> str:
    """Return a number in a row of a study as text, '-' for None."""
    return '-' if value is None else f'{value:.4g}'


def interval(row: Row) -> str:
    """Return the confidence interval in a row of a study as text, '' for a row of one run."""
    return f'{number(row["ci_low"])} to {number(row["ci_high"])}' if 'runs' in row else ''


def measured(value: float) -> str:
    """Return a result of a run as text: four digits, but all digits of a large whole number."""
    if not math.isfinite(value):
        return 'not measured'
    return f'{value:,.0f}' if abs(value) >= 1e4 and value == int(value) else number(value)
