"""The result of a study."""
import dataclasses


@dataclasses.dataclass
class Result:
    """The result of a study: rows as of intervals.row, figures {name: function that draws a Figure}, remarks in
    sentences.

    shown: the rows that are printed, where they are too many for a terminal; None: all.
    """
    rows: list
    figures: dict
    remarks: list = dataclasses.field(default_factory=list)
    shown: list | None = None
