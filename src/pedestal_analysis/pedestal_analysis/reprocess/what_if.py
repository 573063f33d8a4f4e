"""What a node's outputs are worth: old against new, for a recording recomputed with other parameters.

The recorded antenna does not move with the recomputed command, so the pointing that other parameters would give is not
in a recording. Three things are: the error of the estimate against the recorded truth, its noise and lag, and how
rough the command is.
"""
import dataclasses
import functools
import math

import numpy as np

from pedestal_analysis.results import results, tracking
from pedestal_analysis.results.results import Result
from pedestal_analysis.results.tracking import DEG_PER_RAD, known_rms, largest
from pedestal_common.graph.topics import AXES

RIPPLE_WINDOW_S = 0.25
"""What is faster than a moving mean of this length [s] counts as noise of a command."""

COMPARISON_NOTE = ('the recorded antenna does not move with the recomputed command: compared are the estimate against the '
                   'recorded truth and the noise of estimate and command; for the pointing, run the scenario anew')


class Overlay:
    """A recording whose outputs of one node are replaced: what analysis/ reads of a bag.Bag."""

    def __init__(self, bag, outputs):
        self.path, self.beam, self.beams, self.metadata = bag.path, bag.beam, bag.beams, bag.metadata
        self.configuration = bag.configuration
        self._bag, self._outputs = bag, outputs
        self.topics = {**bag.topics, **dict.fromkeys(outputs, '')}

    def table(self, topic):
        """{column: array (n,)} of a topic."""
        return self._outputs[topic].table(topic) if topic in self._outputs else self._bag.table(topic)

    @property
    def start(self):
        """Time 0 of the scenario in the stamps [ns]."""
        return self._bag.start

    def messages(self, topic):
        """Iterator of (topic, log time, publish time [ns], message) of a recorded topic."""
        return self._bag.messages(topic)


class RecomputedAcu:
    """What an ACU answered in an Overlay. estimate, command: tables of acu/estimate and acu/rate_command; autotrack:
    stamps [s] of its estimates in autotrack; known: number of its
    estimates with a known mode; common: stamps [s] at which it is judged."""

    def __init__(self, overlay):
        self.estimate, self.command = overlay.table('acu/estimate'), overlay.table('acu/rate_command')
        t = self.estimate['t']
        mode = tracking.modes(overlay, t)
        self.autotrack, self.known = t[mode == 'autotrack'], int(np.sum(mode != ''))
        self.common = t[:0]

    def ripple(self, table):
        """Rms [rad/s] of what is faster than RIPPLE_WINDOW_S in the velocities of a table."""
        return known_rms(np.concatenate([_ripple(table['t'], table[f'{axis}.velocity'], self.common)
                                         for axis in AXES]))


def _ripple(t, values, common):
    values = values[np.isin(t, common)]
    length = max(1, round(RIPPLE_WINDOW_S / np.median(np.diff(t)))) if t.size > 1 else 1
    if values.size < 2 * length:
        return np.full(1, math.nan)
    mean = np.convolve(values, np.full(length, 1.0 / length), 'valid')
    return values[length // 2:length // 2 + mean.size] - mean


@dataclasses.dataclass
class TruthComparison:
    """The estimate of Answers and the recorded antenna in a tracking.Tracking, against the recorded truth."""
    answers: RecomputedAcu
    run: tracking.Tracking

    @functools.cached_property
    def judged(self):
        """Which steps (n,) bool of the run are judged."""
        return np.isin(self.run.t, self.answers.common)

    @functools.cached_property
    def true(self):
        """True pointing error (k, 2) [rad] of the recorded antenna."""
        return np.column_stack((self.run.cross_elevation, self.run.elevation_error))[self.judged]

    @functools.cached_property
    def error(self):
        """Estimate less truth (k, 2) [rad]: cross-elevation, elevation."""
        return self.run.filtered[self.judged] - self.true

    @property
    def noise(self):
        """Rms [rad] of the receiver's error less the true one."""
        return known_rms(self.run.measured[self.judged] - self.true)

    @functools.cached_property
    def motion(self):
        """(lag [s], rms of the rate error [rad/s]) of the estimate behind the true direction, in earth angles.

        The lag is the one that explains most of the error e by the true rate w: - sum(e w) / sum(w w).
        """
        if self.judged.sum() < 3:
            return math.nan, math.nan
        t, estimate = self.run.t, self.answers.estimate
        _, here, there = np.intersect1d(np.round(t * 1e9), np.round(estimate['t'] * 1e9), return_indices=True)
        angle, rate = np.full((2, t.size, 2), math.nan)
        angle[here] = np.column_stack([estimate[f'{axis}.position'] for axis in AXES])[there]
        rate[here] = np.column_stack([estimate[f'{axis}.velocity'] for axis in AXES])[there]
        truth = np.column_stack((np.unwrap(self.run.target_earth[:, 0]), self.run.target_earth[:, 1]))
        scale = np.column_stack((np.cos(truth[:, 1]), np.ones(t.size)))
        true_rate = np.gradient(truth, t, axis=0) * scale
        error = ((angle - truth + math.pi) % (2.0 * math.pi) - math.pi) * scale
        known = self.judged & np.isfinite(error).all(axis=1) & np.isfinite(true_rate).all(axis=1)
        e, w = error[known], true_rate[known]
        moving = np.sum(w * w)
        return (-float(np.sum(e * w) / moving) if moving > 0.0 else math.nan,
                known_rms((rate * scale - true_rate)[known]))


COMPARISON_RESULTS = (
    Result('autotrack_from_s', 's', 'answers', lambda acu: acu.autotrack[0] if acu.autotrack.size else math.nan,
           'When the ACU came to autotrack.'),
    Result('tracked_percent', '%', 'answers',
           lambda acu: 100.0 * acu.autotrack.size / acu.known if acu.known else math.nan,
           'Share of the steps in autotrack.'),
    Result('recorded_pointing_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.true) * DEG_PER_RAD,
           'Rms of the true pointing error of the recorded antenna, both axes together.'),
    Result('estimate_error_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.error) * DEG_PER_RAD,
           'Rms of estimate less truth, both axes together.'),
    Result('estimate_error_cross_elevation_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.error[:, 0])
           * DEG_PER_RAD,
           'Rms of estimate less truth in cross-elevation.'),
    Result('estimate_error_elevation_rms_deg', 'deg', 'truth', lambda acu: known_rms(acu.error[:, 1]) * DEG_PER_RAD,
           'Rms of estimate less truth in elevation.'),
    Result('estimate_error_max_deg', 'deg', 'truth', lambda acu: largest(acu.error) * DEG_PER_RAD,
           'Largest of estimate less truth on either axis.'),
    Result('single_sample_noise_deg', 'deg', 'truth', lambda acu: acu.noise * DEG_PER_RAD,
           "Rms of the receiver's error less the true one."),
    Result('noise_reduction', '-', 'truth', lambda acu: acu.noise / known_rms(acu.error),
           "The receiver's noise over the error of the estimate."),
    Result('estimate_lag_s', 's', 'truth', lambda acu: acu.motion[0], 'How late the estimate is.'),
    Result('estimate_rate_error_rms_deg_s', 'deg/s', 'truth', lambda acu: acu.motion[1] * DEG_PER_RAD,
           "Rms of the estimate's rate less the true one."),
    Result('estimate_rate_noise_deg_s', 'deg/s', 'answers', lambda acu: acu.ripple(acu.estimate) * DEG_PER_RAD,
           f"Rms of what is faster than {RIPPLE_WINDOW_S:g} s in the estimate's rate."),
    Result('command_noise_deg_s', 'deg/s', 'answers', lambda acu: acu.ripple(acu.command) * DEG_PER_RAD,
           f'Rms of what is faster than {RIPPLE_WINDOW_S:g} s in the rate command.'),
    Result('evaluated_time_s', 's', 'answers',
           lambda acu: acu.common.size * float(np.median(np.diff(acu.estimate['t']))),
           'How long all versions were in autotrack and settled.'),
)


def numbers(bag, versions) -> dict:
    """{metric: ([value of each version], unit)} of an ACU's outputs; versions: [{topic: Output}].

    Over the time in which all of them are in autotrack and settled, so that they are judged on the same samples.
    """
    overlays = [Overlay(bag, outputs) for outputs in versions]
    answers = [RecomputedAcu(overlay) for overlay in overlays]
    try:
        truths = [TruthComparison(acu, tracking.read(overlay)) for acu, overlay in zip(answers, overlays)]
    except ValueError:
        truths = [None] * len(versions)
    common = functools.reduce(np.intersect1d, [acu.autotrack for acu in answers])
    start = (max((acu.autotrack[0] for acu in answers if acu.autotrack.size), default=math.inf)
             + tracking.HANDOVER_SETTLING_S)
    for acu in answers:
        acu.common = common[common >= start]
    columns = [results.measured({'answers': acu, 'truth': truth}, COMPARISON_RESULTS) for acu,
               truth in zip(answers, truths)]
    return {name: ([column[name][0] for column in columns], unit) for name, (_, unit) in columns[0].items()}
