"""Data of the report on a recording: its run against the truth, if recorded, and its topics."""
import dataclasses
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from pedestal_common.graph import topics
from pedestal_common.quantities import Pairs, Radians, Seconds, Table
from pedestal_recording import bag as bags
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import consistency, known_attitude, measured_direction, tracking
from pedestal_results.report import events


class Status(NamedTuple):
    """Status of a node in the diagnostics."""
    t: Seconds
    node: str
    level: int  # 0 OK, 1 WARN, 2 ERROR, 3 STALE
    message: str


@dataclasses.dataclass
class RunData:
    """Data of a recording for the page and the figures of its report."""
    run: tracking.Tracking | None   # None if there is no truth
    no_truth: str   # reason why there is no truth, or ''
    raw_angles: Pairs | None    # measured earth angles of the target [rad], without the filter; None without `run`
    motors: Table | None    # adu/motor_states, None without a message
    receiver: Table | None  # tracking_receiver/angle_error, None without a message
    modes: list[events.ModeSpan]    # of the ACU, in order
    statuses: list[Status]
    events: list[events.Event]  # in the order of time
    beamwidth: Radians  # half-power, NaN if the bag does not state it
    filter: consistency.Consistency | None = None   # None without acu/filter
    attitude: known_attitude.KnownAttitude | None = None    # None ashore

    def lacks(self, needs: Iterable[str]) -> str:
        """Return the reasons why a figure with some needs (keys of _NEEDS) cannot be drawn, '' if it can be drawn."""
        reasons = [_NEEDS[need](self) for need in needs]
        return '; '.join(dict.fromkeys(filter(None, reasons)))


def _no_receiver(data: RunData) -> str:
    return '' if data.receiver else 'no message of tracking_receiver/angle_error'


_NEEDS: dict[str, Callable[[RunData], str]] = {
    'truth': lambda data: data.no_truth,
    'motors': lambda data: '' if data.motors else 'no message of adu/motor_states',
    'modes': lambda data: '' if data.modes or data.statuses else 'no message of acu/mode or diagnostics',
    'filter': lambda data: '' if data.filter is not None else 'no message of acu/filter',
    'attitude': lambda data: '' if data.attitude is not None else 'no INS in the run',
    'bank': lambda data: '' if data.filter is None or np.isfinite(data.filter.probability).sum(axis=2).max() > 1 else
    'the filter has only one motion model',
    'receiver': _no_receiver,
    'lock': lambda data: '' if data.receiver and np.isfinite(data.receiver['x']).any() else (
        _no_receiver(data) or 'the receiver never locked'),
}
"""{need of a figure: function of RunData -> reason why the need is not met, else ''}."""


def read(bag: Recording) -> RunData:
    """Return the RunData of a recording of one beam. Raises bag.BagError if stamps of the steps go back."""
    run, no_truth = _tracking(bag)
    raw = _raw_angles(run, table(bag, 'ship/truth')) if run is not None else None
    motors = table(bag, 'adu/motor_states')
    if motors and not {f'{motor}.effort' for motor in topics.MOTOR_NAMES} <= set(motors):
        motors = None
    statuses = [Status(t, status.name, int(status.level), status.message)
                for t, status in recordings.diagnostics(bag)]
    modes = _modes(bag)
    return RunData(run, no_truth, raw, motors, table(bag, 'tracking_receiver/angle_error'), modes, statuses,
                   events.read(bag, modes), recordings.beamwidth(bag), _filter(bag, run), _attitude(bag))


def table(bag: Recording, topic: str) -> Table | None:
    """Return the columns of a topic; None without a message or if the type is not that of the graph.

    Because a plot over stamps that go back would be wrong, raises bag.BagError for such a topic of the steps.
    """
    if bag.topics.get(topic) != topics.TOPIC_BY_NAME[topic].type or not bag.rows(topic).size:
        return None
    columns = bag.table(topic)
    t = columns['t']
    back = np.flatnonzero(np.diff(t) < 0.0) if topics.TOPIC_BY_NAME[topic].rate == 'step' else np.zeros(0, int)
    if back.size:
        file = getattr(bag, 'file', bag.path)   # only a recording of files may have such stamps
        raise bags.BagError(f'{file}: the stamps of {topic} go back, the first from {t[back[0]]:.6f} to '
                            f'{t[back[0] + 1]:.6f} s; `pedestal verify` lists all problems')
    return columns


def _tracking(bag: Recording) -> tuple[tracking.Tracking | None, str]:
    """Return (Tracking, '') of a recording, or (None, reason)."""
    absent = [name for name in ('joint_states', 'target/truth') if table(bag, name) is None]
    if absent:
        return None, f'no message of {" and ".join(absent)}'
    if bag.rows('joint_states').size < 2:
        return None, 'fewer than two steps'
    try:
        return tracking.read(bag), ''
    except KeyError as error:
        return None, f'a topic has no number {error.args[0]}'


def _raw_angles(run: tracking.Tracking, ship: Table | None) -> Pairs:
    """Return the measured earth angles [rad] of the target at the steps of a Tracking, without the filter.

    ship: table of ship/truth, None for an antenna ashore.
    """
    quaternions = None
    if ship is not None:
        at = np.searchsorted(ship['t'], run.t - 1e-9).clip(0, ship['t'].size - 1)
        quaternions = np.column_stack([ship[f'orientation.{axis}'][at] for axis in 'xyzw'])
    return measured_direction.earth_angles(run.encoders, run.measured, quaternions)


def _filter(bag: Recording, run: tracking.Tracking | None) -> consistency.Consistency | None:
    """Return the Consistency of a recording; None without truth, or without the numbers of the filter."""
    try:
        return consistency.read(bag, run) if run is not None and table(bag, 'acu/filter') is not None else None
    except KeyError:
        return None


def _attitude(bag: Recording) -> known_attitude.KnownAttitude | None:
    """Return the KnownAttitude of a recording; None ashore, or without the numbers of the INS."""
    try:
        return known_attitude.read(bag) if table(bag, 'ship/imu/data') is not None else None
    except KeyError:
        return None


def _modes(bag: Recording) -> list[events.ModeSpan]:
    """Return the modes of the ACU; the first begins with the recording."""
    stated = table(bag, 'acu/mode')
    changes = list(zip(stated['t'].tolist(), stated['data'])) if stated else []
    joints = table(bag, 'joint_states')
    if joints is not None and (before := str(recordings.modes(bag, joints['t'][:1])[0])):
        changes.insert(0, (joints['t'][0].item(), before))
    starts: list[Seconds] = []
    names: list[str] = []
    for start, name in changes:
        if not names or names[-1] != name:
            starts.append(start)
            names.append(name)
    return list(zip(starts, [*starts[1:], float(bag.end)], names)) if changes else []
