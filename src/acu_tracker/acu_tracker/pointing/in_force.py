"""The pointing model that an operator sees: which one is in force, its reports on acu/pointing, why one is refused."""
import datetime
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from acu_tracker.pointing import model
from acu_tracker.pointing.params import PointingParameters
from pedestal_common.graph import topics
from pedestal_common.quantities import Nanoseconds, Value
from pedestal_common.wire.commands import Reply

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters


class ModelInForce:
    """The model in force, or the one that will be when its change is complete.

    refused: the reason why the model of the parameters is not in force; '' if it is. The `reports` of acu/pointing are
    in the order of the number `report` of model.PointingRecord, the `record` in the methods.
    """

    def __init__(self, parameters: 'AcuParameters') -> None:
        self._antenna, self._model, self.refused = parameters.antenna, parameters.pointing, ''
        self.reports = [self._model.report()]

    def begin(self, record: np.void) -> None:
        """Begin with the model at its last terms, as after a reset."""
        model.initialise(record, self._model.terms, self._model.named)
        self.reports = [self._model.report()]

    def check_date(self, record: np.void, utc: datetime.datetime | None) -> None:
        """Discard a model of the parameters whose date is later than now; the pedestal then counts as ideal. The date
        can be judged in realtime only, before the first step, when the epoch of the stamps is known."""
        try:
            self._model.check_date(utc)
        except ValueError as error:
            self.refused, self._model = str(error), PointingParameters()
            model.initialise(record, self._model.terms, False)

    def replace(self, record: np.void, arguments: Mapping[str, Value], now: Nanoseconds,
                utc: datetime.datetime | None) -> Reply:
        """Take another model, its fields by name, gradually. Raise ValueError if it is refused."""
        taken = PointingParameters(**arguments)
        taken.check_antenna(self._antenna)
        taken.check_date(utc)
        begins = now * 1e-9
        duration = model.replace(record, taken.terms, begins)
        changing = taken.report(record['before'], begins, begins + duration)
        self.reports = [*self.reports[:int(record['report'])], changing, taken.report()]
        self._model, self.refused = taken, ''
        unchecked = taken.unchecked(self._antenna)
        return Reply(True, f'pointing model {changing.title}; it is in force in {duration:.1f} s'
                     + (f'; {unchecked}' if unchecked else ''))

    def title(self, record: np.void) -> str:
        """Return the model in force, in words; '' without a model."""
        if record['report'] == topics.NO_TEXT_CODE:
            return ''
        return self.reports[int(record['report'])].title
