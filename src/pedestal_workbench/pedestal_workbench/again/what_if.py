"""Effect of other parameters of the ACU on a recorded run, for `pedestal recompute --param`.

Because the recorded antenna does not move with the recomputed command, the comparison cannot show the pointing that
the other parameters would give. It shows error, noise and lag of the estimate, and the noise of the command.
"""
import dataclasses
import functools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import (
    Bools,
    Floats,
    Ints,
    Message,
    Nanoseconds,
    Pairs,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Table,
    Times,
)
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_results import intervals, results, sensor_frame, tracking
from pedestal_results.results import Result
from pedestal_results.tracking import DEG_PER_RAD, known_rms, largest
from pedestal_workbench.again.difference import Output

RIPPLE_WINDOW_S = 0.25  # length of the moving mean of a rate [s]. The rate minus this mean counts as noise.

MIN_STRETCHES, MAX_STRETCHES, MIN_STRETCH_S = 5, 20, 1.0
"""Number of stretches of a recording by which `significance` judges a difference, and their least length [s]."""

COMPARISON_NOTE = ('the recorded antenna does not move with the recomputed command, so the table compares the '
                   'estimate with the recorded truth, and the noise of estimate and command; for the pointing, run '
                   'the scenario again')
"""Note above the table of old and new results."""


class Overlay:
    """A Recording in which the outputs of one node are replaced; outputs: those of each topic."""

    def __init__(self, bag: Recording, outputs: Mapping[str, Output]) -> None:
        self.path, self.beam, self.beams, self.metadata = bag.path, bag.beam, bag.beams, bag.metadata
        self.configuration = bag.configuration
        self._bag, self._outputs = bag, outputs
        self.topics = {**bag.topics, **dict.fromkeys(outputs, '')}

    def table(self, topic: str) -> Table:
        """Return the columns of a topic, as Bag.table."""
        return self._outputs[topic].table(topic) if topic in self._outputs else self._bag.table(topic)

    @property
    def start(self) -> Nanoseconds:
        """Stamp of time 0 of the scenario."""
        return self._bag.start

    @property
    def end(self) -> Seconds:
        """Time of the last message of the recording."""
        return self._bag.end

    def rows(self, topic: str) -> Records | Ints:
        """Return one element per message of a topic."""
        return np.arange(len(self._outputs[topic].stamps)) if topic in self._outputs else self._bag.rows(topic)

    def last_values(self, node: str) -> dict[str, str]:
        """Return {key: value} of the last recorded diagnostics of a node."""
        return self._bag.last_values(node)

    def messages(self, topic: str) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Return an iterator of (topic, log time, publish time, message) of a recorded topic, as Bag.messages."""
        return self._bag.messages(topic)


class RecomputedAcu:
    """Outputs of an ACU in an Overlay: recorded, or recomputed with some parameters."""

    def __init__(self, overlay: Overlay) -> None:
        self.estimate, self.command = overlay.table('acu/estimate'), overlay.table('acu/rate_command')
        self.filter = overlay.table('acu/filter') if 'acu/filter' in overlay.topics else None
        t: Times = self.estimate['t']
        mode = recordings.modes(overlay, t)
        self.autotrack = t[mode == 'autotrack']     # stamps of the estimates in autotrack
        self.known = int(np.sum(mode != ''))    # number of the estimates with a known mode
        self.common = t[:0]     # stamps at which the ACU is evaluated, set by `numbers`

    def ripple(self, table: Table) -> RadiansPerSecond:
        """Return the rms of the velocities in a table minus their moving mean over RIPPLE_WINDOW_S."""
        return known_rms(np.concatenate([_ripple(table['t'], table[f'{axis}.velocity'], self.common)
                                         for axis in AXES]))


    @property
    def innovations(self) -> Pairs:
        """Measured minus predicted angles [rad] at the common stamps: cross-elevation, elevation; NaN without one."""
        out = np.full((self.common.size, 2), math.nan)
        if self.filter is not None:
            _, here, there = np.intersect1d(self.common, self.filter['t'], return_indices=True)
            out[here] = np.column_stack([self.filter[f'{axis}_innovation.position'] for axis in AXES])[there]
            out[:, 0] *= np.cos(self.estimate['elevation.position'][np.isin(self.estimate['t'], self.common)])
        return out


def _ripple(t: Times, values: Floats, common: Times) -> Floats:
    """Return values minus their moving mean, at the stamps t that are in `common`."""
    values = values[np.isin(t, common)]
    length = max(1, round(RIPPLE_WINDOW_S / np.median(np.diff(t)))) if t.size > 1 else 1
    if values.size < 2 * length:
        return np.full(1, math.nan)
    mean = np.convolve(values, np.full(length, 1.0 / length), 'valid')
    return values[length // 2:length // 2 + mean.size] - mean


@dataclasses.dataclass
class TruthComparison:
    """Estimate of an ACU, and pointing of the recorded antenna, against the recorded truth. run: see Overlay."""
    acu: RecomputedAcu
    run: tracking.Tracking

    @functools.cached_property
    def evaluated(self) -> Bools:
        """The steps of the run that are evaluated."""
        return np.isin(self.run.t, self.acu.common)

    @functools.cached_property
    def true(self) -> Pairs:
        """True pointing error [rad] of the recorded antenna: cross-elevation, elevation."""
        return self.run.error[self.evaluated]

    @functools.cached_property
    def error(self) -> Pairs:
        """Estimate minus its truth [rad]: cross-elevation, elevation."""
        return self.run.estimate_error[self.evaluated]

    @property
    def noise(self) -> Radians:
        """Rms difference between receiver error and true pointing error minus boresight offset."""
        return known_rms(self.run.measured[self.evaluated] - (self.true - self.run.boresight))

    @functools.cached_property
    def motion(self) -> tuple[Seconds, RadiansPerSecond]:
        """(lag of the estimate behind the true direction, rms error of its rate), in earth angles.

        The lag is the least-squares fit of the error e of the angle to the true rate w: lag = - sum(e w) / sum(w w).
        The error e is against the truth in the frame of the sensors.
        """
        if self.evaluated.sum() < 3:
            return math.nan, math.nan
        t, estimate = self.run.t, self.acu.estimate
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(estimate['t'] * 1e9), return_indices=True)
        angle, rate = np.full((2, t.size, 2), math.nan)
        angle[here] = np.column_stack([estimate[f'{axis}.position'] for axis in AXES])[there]
        rate[here] = np.column_stack([estimate[f'{axis}.velocity'] for axis in AXES])[there]
        truth = np.column_stack((np.unwrap(self.run.target_earth[:, 0]), self.run.target_earth[:, 1]))
        scale = np.column_stack((np.cos(truth[:, 1]), np.ones(t.size)))
        true_rate = np.gradient(truth, t, axis=0) * scale
        error = ((angle - self.run.sensor_truth + math.pi) % (2.0 * math.pi) - math.pi) * scale
        known = self.evaluated & np.isfinite(error).all(axis=1) & np.isfinite(true_rate).all(axis=1)
        e, w = error[known], true_rate[known]
        moving = np.sum(w * w)
        return (-float(np.sum(e * w) / moving) if moving > 0.0 else math.nan,
                known_rms((rate * scale - true_rate)[known]))


COMPARISON_RESULTS = (
    Result('autotrack_from_s', 's', 'acu', lambda acu: acu.autotrack[0] if acu.autotrack.size else math.nan,
           'Time of the first step in autotrack.'),
    Result('autotrack_percent', '%', 'acu',
           lambda acu: 100.0 * acu.autotrack.size / acu.known if acu.known else math.nan,
           'Share of the steps in autotrack.'),
    Result('recorded_pointing_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.true) * DEG_PER_RAD,
           'Rms of the true pointing error of the recorded antenna, both axes together.'),
    Result('estimate_error_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.error) * DEG_PER_RAD,
           f'Rms of estimate minus truth, both axes together. {sensor_frame.DEFINITION}'),
    Result('estimate_error_cross_elevation_rms_deg', 'deg', 'truth',
           lambda acu: known_rms(acu.error[:, 0]) * DEG_PER_RAD,
           f'Rms of estimate minus truth in cross-elevation. {sensor_frame.DEFINITION}'),
    Result('estimate_error_elevation_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.error[:, 1]) * DEG_PER_RAD,
           f'Rms of estimate minus truth in elevation. {sensor_frame.DEFINITION}'),
    Result('estimate_error_max_deg', 'deg', 'truth', lambda acu: largest(acu.error) * DEG_PER_RAD,
           f'Largest absolute value of estimate minus truth on either axis. {sensor_frame.DEFINITION}'),
    Result('single_sample_noise_deg', 'deg', 'truth', lambda acu: acu.noise * DEG_PER_RAD,
           'Rms of the difference between receiver error and true pointing error minus boresight offset, both axes '
           'together.'),
    Result('noise_reduction', '-', 'truth', lambda acu: acu.noise / known_rms(acu.error),
           'Ratio of single_sample_noise_deg to estimate_error_rms_deg.'),
    Result('estimate_lag_s', 's', 'truth', lambda acu: acu.motion[0],
           f'Lag of the estimate behind the true direction. {sensor_frame.DEFINITION}'),
    Result('estimate_rate_error_rms_deg_s', 'deg/s', 'truth', lambda acu: acu.motion[1] * DEG_PER_RAD,
           'Rms of estimated rate minus true rate, both axes together.'),
    Result('estimate_rate_noise_deg_s', 'deg/s', 'acu', lambda acu: acu.ripple(acu.estimate) * DEG_PER_RAD,
           f'Rms of the estimated rate minus its moving mean over {RIPPLE_WINDOW_S:g} s.'),
    Result('command_noise_deg_s', 'deg/s', 'acu', lambda acu: acu.ripple(acu.command) * DEG_PER_RAD,
           f'Rms of the rate command minus its moving mean over {RIPPLE_WINDOW_S:g} s.'),
    Result('evaluated_time_s', 's', 'acu',
           lambda acu: acu.common.size * float(np.median(np.diff(acu.estimate['t']))),
           'Total time with the old and the new ACU in settled autotrack.'),
)


@dataclasses.dataclass
class Versions:
    """Several versions of the outputs of an ACU, evaluated on the samples in which all of them are in settled
    autotrack. truths: None for each version of a recording without truth."""
    acus: list[RecomputedAcu]
    truths: Sequence[TruthComparison | None]


def evaluated(bag: Recording, versions: Sequence[Mapping[str, Output]]) -> Versions:
    """Return the Versions of some outputs by topic."""
    overlays = [Overlay(bag, outputs) for outputs in versions]
    acus = [RecomputedAcu(overlay) for overlay in overlays]
    try:
        truths: list[TruthComparison | None] = [
            TruthComparison(acu, tracking.read(overlay)) for acu, overlay in zip(acus, overlays)]
    except ValueError:
        truths = [None] * len(versions)
    common = functools.reduce(np.intersect1d, [acu.autotrack for acu in acus])
    first = max((acu.autotrack[0] for acu in acus if acu.autotrack.size), default=math.inf)
    for acu in acus:
        acu.common = common[common >= first + tracking.HANDOVER_SETTLING_S]
    return Versions(acus, truths)


def numbers(versions: Versions) -> dict[str, tuple[list[float], str]]:
    """Return {metric: ([value of each version], unit)}."""
    columns = [results.measured({'acu': acu, 'truth': truth}, COMPARISON_RESULTS)
               for acu, truth in zip(versions.acus, versions.truths)]
    return {name: ([column[name][0] for column in columns], unit) for name, (_, unit) in columns[0].items()}


def significance(versions: Versions) -> str:
    """Return the sentence that compares a new with an old version: which has the smaller rms error of the estimate, by
    how much, and whether a difference of this size may be chance.

    The errors are those against the recorded truth or, without it, the innovations. The samples are cut into equal
    stretches, which are longer than the memory of the filter. The interval is that of the jackknife over the pairs of
    stretches.
    """
    truths = [truth for truth in versions.truths if truth is not None]
    old, new = [truth.error for truth in truths] if truths else [acu.innovations for acu in versions.acus]
    subject = 'rms error of the estimate' if truths else 'rms innovation (measured minus predicted angle)'
    known = np.isfinite(old).all(axis=1) & np.isfinite(new).all(axis=1)
    t = versions.acus[0].common
    period = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    count = min(MAX_STRETCHES, int(known.sum() * period / MIN_STRETCH_S))
    if count < MIN_STRETCHES:
        return (f'not judged: {known.sum() * period:.3g} s with both settings in settled autotrack, must be at least '
                f'{MIN_STRETCHES * MIN_STRETCH_S:g} s')
    squares = np.column_stack([np.sum(error[known]**2, axis=1) for error in (old, new)])
    if (squares[:, 0] == squares[:, 1]).all():
        return f'no difference: the {subject} is the same'
    parts = [part.mean(axis=0) for part in np.array_split(squares, count)]
    ratio, low, high = np.exp(intervals.interval(intervals.pseudo_values(
        parts, lambda some: 0.5 * float(np.log(np.divide(*np.mean(some, axis=0)[::-1]))))))
    size = (f'{ratio:.3g} times as large' if not 0.5 < ratio < 2.0 else
            f'{abs(ratio - 1.0):.1%} {"larger" if ratio > 1.0 else "smaller"}')
    word = 'no significant difference' if low <= 1.0 <= high else 'better' if ratio < 1.0 else 'worse'
    return (f'{word}: with the new setting the {subject} is {size} (new / old {ratio:.3g}, 95 % interval {low:.3g} to '
            f'{high:.3g}; {count} paired stretches of {known.sum() * period / count:.3g} s)')
