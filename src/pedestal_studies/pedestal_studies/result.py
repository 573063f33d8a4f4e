"""The result of a study, which its function `run` returns and `pedestal study` prints and draws."""
import dataclasses


@dataclasses.dataclass
class Result:
    """Result of a study: rows as of intervals.row, figures {name: function that draws a Figure}, remarks in sentences.

    `shown`: the printed rows, if all rows are too many for a terminal; None for all rows.
    """
    rows: list
    figures: dict
    remarks: list = dataclasses.field(default_factory=list)
    shown: list | None = None
