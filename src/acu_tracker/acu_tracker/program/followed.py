"""What the modes program, tle, sun and slave follow: tables of directions, with refraction and commanded offset.

A compiled law cannot make these tables, so `unit.Acu` keeps a `Followed` and gives its tables to the law. `parts` are
the records of the law, as in pedestal_common.node.unit.Unit.parts.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker.geometry import direction
from acu_tracker.modes import Mode, Reason
from acu_tracker.program import program_track, segments
from acu_tracker.program.air import Air
from acu_tracker.program.prediction import Predicted, Predictor
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.graph.modes import Row as ModeRow
from pedestal_common.node.unit import NEVER_DUE_NS
from pedestal_common.quantities import AnyRecord, Message, Nanoseconds, Pairs, Radians, Seconds, Times
from pedestal_common.wire.records import NO_STAMP

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters

BEND_INTERVAL_S = 0.1  # time after which the refraction of a direction of the mode slave is computed again [s]

NEVER_VALID = NEVER_DUE_NS, NO_STAMP  # begin and end of the validity of tables that the next step must update


class Slave(NamedTuple):
    """Direction of the mode slave to which the refraction is added."""
    direction: AnyRecord    # as commanded, a direction.Direction; None: no direction
    due: Nanoseconds        # time at which the refraction is computed again


class Followed:
    """Segments of the program track, predictions of satellite and sun, and the direction of the mode slave, which is
    set only to restore it. tables: the Tables of the last `update`."""
    def __init__(self, parameters: 'AcuParameters') -> None:
        self.tables = program_track.NO_TABLES
        self._refraction = parameters.refraction
        self.segments = segments.Segments([(axis.limits.rate, axis.limits.acceleration)
                                           for axis in (parameters.azimuth, parameters.elevation)])
        self.air = Air(parameters.refraction)
        self.predictor = Predictor(parameters.prediction, air=self.air)
        self._predicted: dict[str, Predicted] = {}      # by name of the mode
        # {name of the mode: (track, revision of the air, track with apparent elevations)}
        self._apparent: dict[str, tuple[ProgramTrack, int, ProgramTrack]] = {}
        self._offset: tuple[Seconds, Radians, Radians] = (0.0, 0.0, 0.0)    # of time, azimuth and elevation
        self._valid: tuple[Nanoseconds, Nanoseconds] = NEVER_VALID          # since, until
        self.slave = Slave(None, NEVER_DUE_NS)

    @property
    def due(self) -> Nanoseconds:
        """Time of the next update of a table or of the refraction."""
        return min(self._valid[1], self.slave.due)

    def expire(self) -> None:
        """Let the next step update all tables."""
        self._valid = NEVER_VALID

    def predict_by(self, predictor: Predictor) -> None:
        """Replace the Predictor and discard its predictions."""
        self.predictor, self._predicted = predictor, {}
        self.expire()

    def take_weather(self, topic: str, stamp: Seconds | None, message: Message, now: Seconds | None) -> None:
        """Take a reading of the weather station; the arguments are those of Air.take."""
        self.air.take(topic, stamp, message, now)
        if self.air.due == -math.inf:
            self.expire()

    def append(self, parts: np.void, times: Times, angles: Pairs) -> None:
        """Append a segment (stamps; azimuth and elevation) to the program track; raise ValueError if it is refused."""
        state, inputs = parts['state'], parts['inputs']
        followed = state['mode']['now'] == Mode.PROGRAM
        try:
            self.segments.append(times, angles, float(state['stamp']) - self._offset[0], followed)
        except segments.TurnaroundError:
            inputs['turnaround'] = 1
            raise
        inputs['turnaround'] = 0
        self.expire()

    def shift(self, offset: tuple[Seconds, Radians, Radians]) -> None:
        """Shift all tables by an offset of time, azimuth and elevation."""
        self._offset = offset
        self.expire()

    def advance(self, parts: np.void, stamp: Nanoseconds) -> None:
        """Bring the tables and the refraction to the stamp of the next step."""
        since, until = self._valid
        if not since <= stamp < until:
            self.update(parts, int(stamp))
        if stamp >= self.slave.due:
            self._bend(parts, int(stamp) * 1e-9)

    def update(self, parts: np.void, stamp: Nanoseconds) -> None:
        """Bring the tables to a stamp: the piece of the program track that is due, and the predictions of satellite
        and sun. The refraction is added to true directions. All are shifted by the offset that an operator has
        commanded."""
        inputs, t = parts['inputs'], stamp * 1e-9
        self.air.update(t)
        for place, row in enumerate(program_track.TABLE_MODES):
            known = self._predicted.get(row.name)
            if row.predicted and (known is None or not known.since <= t < known.until):
                known = self._predicted[row.name] = getattr(self.predictor, row.predicted)(t)
            inputs['unpredicted'][place] = known.reason if known else Reason.NONE
        piece, inputs['gap'], ends = self.segments.at(t - self._offset[0])
        until = min(ends + self._offset[0], self.air.due, *(known.until for known in self._predicted.values()))
        self._valid = stamp, max(math.ceil(until * 1e9), stamp + 1) if until < math.inf else NEVER_DUE_NS
        self.tables = program_track.Tables(*(
            program_track.shifted(
                self._apparent_track(row, self._predicted[row.name].track if row.predicted else piece), self._offset)
            for row in program_track.TABLE_MODES))

    def _apparent_track(self, row: ModeRow, track: ProgramTrack) -> ProgramTrack:
        """Return the table of a row of TABLE_MODES with apparent elevations; the last result is kept. A new weather
        changes neither the first nor the last elevation of a table. The planner recognises a program by these rows
        (planner.another_program), and a new program would restart the mode."""
        if not self.air.on or not (row.predicted or self._refraction.program == 'geometric'):
            return track
        kept = self._apparent.get(row.name)
        if kept is not None and kept[0] is track and kept[1] == self.air.revision:
            return kept[2]
        apparent = self.air.apparent(track)
        if kept is not None and kept[0] is track and len(track.times):
            apparent.angles[[0, -1]] = kept[2].angles[[0, -1]]
        self._apparent[row.name] = track, self.air.revision, apparent
        return apparent

    def bend(self, parts: np.void, slave: AnyRecord) -> None:
        """Add the refraction to a direction of the mode slave (None: none), now and every BEND_INTERVAL_S."""
        self.slave = Slave(slave, NEVER_DUE_NS)
        if (slave is not None and math.isfinite(slave['stamp']) and self.air.on
                and self._refraction.slave == 'geometric'):
            self._bend(parts, float(slave['stamp']))

    def _bend(self, parts: np.void, t: Seconds) -> None:
        """Add the refraction to the direction of the mode slave for BEND_INTERVAL_S from t on. Between both times the
        elevation moves on a straight line, which meets the next one without a step."""
        slave, ends = self.slave.direction, t + BEND_INTERVAL_S
        times = np.array((t, ends))
        elevations = self.air.bent(np.ascontiguousarray(direction.moved(slave, times)[:, 1]), times)
        direction.set_chord(parts['state']['guidance']['slave'], 1, t, ends, elevations)
        self.slave = Slave(slave, round(ends * 1e9) if t <= slave['stamp'] + slave['holds'] else NEVER_DUE_NS)
