"""The result of a study: rows, and the targets they meet or miss."""
import dataclasses
import math


@dataclasses.dataclass
class Result:
    """The result of a study: rows as of `row`, figures {name: function that draws a Figure}, remarks in sentences.

    shown: the rows that are printed, where they are too many for a terminal; None: all.
    """
    rows: list
    figures: dict
    remarks: list = dataclasses.field(default_factory=list)
    shown: list | None = None


def row(case, metric, value, unit, paper=None, target=None):
    """One row of a study. paper: the printed number or None; target: a text that `meets` reads, or None."""
    return {'case': case, 'metric': metric, 'value': float(value) if math.isfinite(value) else None, 'unit': unit,
            'paper': paper, 'target': target}


def meets(value, target):
    """Whether a value meets a target: '<= 1', '>= 1', '< 1', '> 1', '1 +- 0.1' or '1 to 2'; None meets no target."""
    if value is None:
        return False
    first, word, last = ('', *target.split()) if len(target.split()) == 2 else target.split()
    last = float(last)
    return {'<=': lambda: value <= last, '>=': lambda: value >= last, '<': lambda: value < last,
            '>': lambda: value > last, '+-': lambda: abs(value - float(first)) <= last,
            'to': lambda: float(first) <= value <= last}[word]()


def missed(row):
    """Whether a row has a target and does not meet it."""
    return row['target'] is not None and not meets(row['value'], row['target'])
