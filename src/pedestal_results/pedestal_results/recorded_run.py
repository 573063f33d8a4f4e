"""Recorded run: a recording of one beam with its parts, each computed once, on first use."""
import contextlib
import functools
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from pedestal_common.graph import topics
from pedestal_common.quantities import Pairs, Radians, Seconds, Table
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import consistency, directions, events, isolation, known_attitude, mode_pointing, tracking
from pedestal_results import verdict as verdicts
from pedestal_results.consistency import Consistency
from pedestal_results.events import Event, ModeSpan
from pedestal_results.isolation import Isolation
from pedestal_results.known_attitude import KnownAttitude
from pedestal_results.tracking import Slew, Tracking

SHOWN_TOPICS = ('joint_states', 'target/truth', 'ship/truth', 'adu/motor_states', 'tracking_receiver/angle_error',
                'acu/filter', known_attitude.ATTITUDE_TOPIC)
"""Topics of the steps that the report shows over their stamps."""
COMPARED_TOPICS = ('ship/truth', 'acu/filter')  # topics among them that are shown only with the truth of the target


class Status(NamedTuple):
    """Status of a node in the diagnostics."""
    t: Seconds
    node: str
    level: int  # 0 OK, 1 WARN, 2 ERROR, 3 STALE
    message: str


class RecordedRun:
    """A recording of one beam, and its parts, from which results, verdict and report are made. A part is computed on
    first use.
    """

    def __init__(self, bag: Recording) -> None:
        self.bag = recordings.Decoded(bag)
        self._file = getattr(bag, 'file', bag.path)     # a recording in memory has no file

    def holds(self, topic: str) -> bool:
        """Return True if the recording has a message of a topic, and the type of the topic is that of the graph."""
        return self.bag.topics.get(topic) == topics.TOPIC_BY_NAME[topic].type and recordings.holds(self.bag, topic)

    def table(self, topic: str) -> Table | None:
        """Return the columns of a topic, None for a topic that the recording does not hold."""
        return self.bag.table(topic) if self.holds(topic) else None

    def check_stamps(self) -> None:
        """Raise bag.BagError if the stamps of a topic go back, because a plot over them would be wrong."""
        for topic in SHOWN_TOPICS:
            columns = None if topic in COMPARED_TOPICS and self.no_truth else self.table(topic)
            t = columns['t'] if columns else np.zeros(0)
            back = np.flatnonzero(np.diff(t) < 0.0)
            if back.size:
                raise bags.BagError(f'{self._file}: the stamps of {topic} go back, the first from {t[back[0]]:.6f} to '
                                    f'{t[back[0] + 1]:.6f} s; `pedestal verify` lists all problems')

    @functools.cached_property
    def tracking(self) -> Tracking:
        """The run against the truth. Raises ValueError without joint_states or target/truth."""
        return tracking.read(self.bag)

    @functools.cached_property
    def evaluated(self) -> Tracking:
        """The run against the truth or, where the true target is missing, against nothing but the measured errors.
        Raises ValueError without joint_states."""
        return self.tracking if self.holds('target/truth') else tracking.read(self.bag, needs_truth=False)

    @functools.cached_property
    def no_truth(self) -> str:
        """Reason why there is no `tracking`, or ''."""
        absent = [name for name in ('joint_states', 'target/truth') if not self.holds(name)]
        if absent:
            return f'no message of {" and ".join(absent)}'
        if self.bag.rows('joint_states').size < 2:
            return 'fewer than two steps'
        try:
            _ = self.tracking   # of which an older recording may lack a number
        except KeyError as error:
            return f'a topic has no number {error.args[0]}'
        return ''

    @functools.cached_property
    def filter(self) -> Consistency | None:
        """Consistency of the target filter; None without truth, or without acu/filter."""
        known = self.holds('acu/filter') and not self.no_truth
        return consistency.read(self.bag, self.tracking) if known else None

    @functools.cached_property
    def attitude(self) -> KnownAttitude | None:
        """Errors of the INS; None ashore, or without the numbers of the INS."""
        with contextlib.suppress(KeyError):
            return known_attitude.read(self.bag) if self.holds(known_attitude.ATTITUDE_TOPIC) else None
        return None

    @functools.cached_property
    def keyholes(self) -> list[Slew]:
        """The slews through a keyhole that the ACU predicted."""
        return tracking.keyholes(self.bag)

    @functools.cached_property
    def isolation(self) -> Isolation | None:
        """Isolation from the rotation of the ship; None ashore, without truth, or for too short a run."""
        return None if self.no_truth else isolation.read(self.bag, self.tracking, self.keyholes)

    @functools.cached_property
    def parts(self) -> dict[str, object]:
        """The parts by name for results.measured; a missing part is absent, None or empty. Raises ValueError like
        `evaluated`.
        """
        return {**self.evaluated.parts, **mode_pointing.read(self.bag, self.evaluated), 'filter': self.filter,
                'keyholes': self.keyholes, 'isolation': self.isolation, 'attitude': self.attitude}

    @functools.cached_property
    def verdict(self) -> verdicts.Verdict:
        """The Verdict on the run. Raises ValueError like `evaluated`."""
        return verdicts.of(self.bag, self.evaluated)

    @functools.cached_property
    def raw_angles(self) -> Pairs:
        """Measured earth angles [rad] of the target at the steps, without the filter."""
        run, ship, quaternions = self.tracking, self.table('ship/truth'), None
        if ship is not None:
            at = np.searchsorted(ship['t'], run.t - 1e-9).clip(0, ship['t'].size - 1)
            quaternions = np.column_stack([ship[f'orientation.{axis}'][at] for axis in 'xyzw'])
        return directions.of_target(run.encoders, run.measured, quaternions)

    @functools.cached_property
    def pointing_errors(self) -> Table:
        """Pointing error at the steps by column: `true`, target minus beam, where the recording holds the truth, and
        `measured` by the receiver. Each in azimuth, in elevation, and in cross-elevation, which is the error of the
        azimuth times cos(elevation). Raises ValueError like `evaluated`."""
        run = self.evaluated
        shrink = np.cos(run.encoders[:, 1])
        parts = {'measured': run.measured} if self.no_truth else {'true': run.error, 'measured': run.measured}
        return {'t [s]': run.t, 'stamp [ns]': np.round(run.t * 1e9).astype(np.int64) + self.bag.start, **{
            f'{kind}.{axis} [rad]': values for kind, error in parts.items() for axis, values in (
                ('azimuth', error[:, 0] / shrink), ('elevation', error[:, 1]), ('cross_elevation', error[:, 0]))}}

    @functools.cached_property
    def motors(self) -> Table | None:
        """Columns of adu/motor_states, None without a message or without torques."""
        motors = self.table('adu/motor_states')
        return motors if motors and {f'{motor}.effort' for motor in topics.MOTOR_NAMES} <= set(motors) else None

    @property
    def receiver(self) -> Table | None:
        """Columns of tracking_receiver/angle_error, None without a message."""
        return self.table('tracking_receiver/angle_error')

    @functools.cached_property
    def modes(self) -> list[ModeSpan]:
        """The modes of the ACU in their order; the first begins with the recording."""
        stated, joints = self.table('acu/mode'), self.table('joint_states')
        changes = list(zip(stated['t'].tolist(), stated['data'])) if stated else []
        if joints is not None and (before := str(recordings.modes(self.bag, joints['t'][:1])[0])):
            changes.insert(0, (joints['t'][0].item(), before))
        starts: list[Seconds] = []
        names: list[str] = []
        for start, name in changes:
            if not names or names[-1] != name:
                starts.append(start)
                names.append(name)
        return list(zip(starts, [*starts[1:], float(self.bag.end)], names)) if changes else []

    @functools.cached_property
    def statuses(self) -> list[Status]:
        """The statuses in the diagnostics."""
        return [Status(t, status.name, int(status.level), status.message)
                for t, status in recordings.diagnostics(self.bag)]

    @functools.cached_property
    def events(self) -> list[Event]:
        """The events in the order of time."""
        return events.read(self.bag, self.modes)

    @property
    def beamwidth(self) -> Radians:
        """Half-power beamwidth, NaN if the recording does not state it."""
        return recordings.beamwidth(self.bag)

    def lacks(self, needs: Iterable[str]) -> str:
        """Return the reasons why a figure with some needs (keys of _NEEDS) cannot be drawn, '' if it can be drawn."""
        reasons = [_NEEDS[need](self) for need in needs]
        return '; '.join(dict.fromkeys(filter(None, reasons)))


def _no_receiver(run: RecordedRun) -> str:
    return '' if run.receiver else 'no message of tracking_receiver/angle_error'


_NEEDS: dict[str, Callable[[RecordedRun], str]] = {
    'truth': lambda run: run.no_truth,
    'motors': lambda run: '' if run.motors else 'no message of adu/motor_states',
    'modes': lambda run: '' if run.modes or run.statuses else 'no message of acu/mode or diagnostics',
    'filter': lambda run: '' if run.filter is not None else 'no message of acu/filter',
    'attitude': lambda run: '' if run.attitude is not None else 'no INS in the run',
    'bank': lambda run: '' if run.filter is None or np.isfinite(run.filter.probability).sum(axis=2).max() > 1 else
    'the filter has only one motion model',
    'receiver': _no_receiver,
    'lock': lambda run: '' if run.receiver and np.isfinite(run.receiver['x']).any() else (
        _no_receiver(run) or 'the receiver never locked'),
}
"""{need of a figure: function of RecordedRun -> reason why the need is not met, else ''}."""
