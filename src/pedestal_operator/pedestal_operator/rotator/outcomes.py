"""Outcomes of the requests of a rotator program, independent of its protocol."""

(OUTCOME_DONE, OUTCOME_REFUSED, OUTCOME_OUT_OF_REACH, OUTCOME_BUSY, OUTCOME_NO_REPLY,
 OUTCOME_NO_POSITION) = range(6)
"""Outcomes of a request. OUTCOME_BUSY: another client is in control. OUTCOME_NO_POSITION: the antenna publishes no
position, or its limits are unknown."""


class Refused(Exception):  # noqa: N818  no error of the server
    """A refused request. outcome: one of the outcomes above; reason: one line."""

    def __init__(self, outcome: int, reason: str) -> None:
        super().__init__(reason)
        self.outcome, self.reason = outcome, reason
