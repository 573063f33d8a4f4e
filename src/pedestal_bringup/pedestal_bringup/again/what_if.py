"""What a node's outputs are worth: old against new, for a recording recomputed with other parameters.

The recorded antenna does not move with the recomputed command, so the pointing that other parameters would give is not
in a recording. What is: the estimate against the recorded truth, its noise and lag, and how rough the command is.
"""
import math

import numpy as np

from pedestal_bringup.analysis import results

RIPPLE = 0.25
"""What is faster than a moving mean of this length [s] counts as noise of a command."""

NOTE = ('the recorded antenna does not move with the recomputed command: compared are the estimate against the '
        'recorded truth and the noise of estimate and command; for the pointing, run the scenario anew')


class Overlay:
    """A recording whose outputs of one node are replaced: topics, beams and table(topic) as of a bag.Bag."""

    def __init__(self, bag, outputs):
        self.path, self.beams, self.metadata = bag.path, bag.beams, bag.metadata
        self._bag, self._outputs = bag, outputs
        self.topics = {**bag.topics, **dict.fromkeys(outputs, '')}

    def table(self, topic):
        return self._outputs[topic].table(topic) if topic in self._outputs else self._bag.table(topic)


def numbers(bag, versions) -> dict:
    """{metric: ([value of each version], unit)} of an ACU's outputs; versions: [{topic: Output}].

    Over the time in which all of them are in autotrack and settled, so that they are judged on the same samples.
    """
    overlays = [Overlay(bag, outputs) for outputs in versions]
    estimates = [overlay.table('acu/estimate') for overlay in overlays]
    try:
        runs = [results.tracking(overlay) for overlay in overlays]
    except ValueError:
        runs = []
    modes = [results.modes(overlay, table['t']) for overlay, table in zip(overlays, estimates)]
    together = [times[np.isin(mode, 'autotrack')] for times, mode in ((table['t'], mode) for table, mode in
                                                                      zip(estimates, modes))]
    start = max((times[0] for times in together if times.size), default=math.inf) + results.SETTLING
    common = together[0]
    for times in together[1:]:
        common = np.intersect1d(common, times)
    common = common[common >= start]
    columns = [{'autotrack_from_s': (times[0] if times.size else math.nan, 's'),
                'tracked_percent': (100.0 * times.size / max(table['t'].size, 1), '%')}
               for times, table in zip(together, estimates)]
    for column, run, estimate in zip(columns, runs, estimates):
        column.update(_against_truth(run, estimate, common))
    for column, overlay, estimate in zip(columns, overlays, estimates):
        column.update(_ripples(overlay.table('acu/rate_command'), estimate, common))
        column['evaluated_time_s'] = common.size * float(np.median(np.diff(estimate['t']))), 's'
    return {name: ([column[name][0] for column in columns], unit) for name, (_, unit) in columns[0].items()}


def _against_truth(run, estimate, common):
    """Estimate and recorded antenna against the recorded truth at the stamps `common`."""
    degrees = math.degrees(1.0)
    on = np.isin(run.t, common)
    true = np.column_stack((run.cross_elevation, run.elevation_error))[on]
    raw, error = run.measured[on] - true, run.filtered[on] - true
    noise = results.rms(raw)
    lag, rate_error = _motion(run, estimate, on)
    return {
        'recorded_pointing_rms_deg': (results.rms(true) * degrees, 'deg'),
        'estimate_error_rms_deg': (results.rms(error) * degrees, 'deg'),
        'estimate_error_cross_elevation_rms_deg': (results.rms(error[:, 0]) * degrees, 'deg'),
        'estimate_error_elevation_rms_deg': (results.rms(error[:, 1]) * degrees, 'deg'),
        'estimate_error_max_deg': (float(np.nanmax(np.abs(error))) * degrees if error.size else math.nan, 'deg'),
        'single_sample_noise_deg': (noise * degrees, 'deg'),
        'noise_reduction': (noise / results.rms(error), ''),
        'estimate_lag_s': (lag, 's'),
        'estimate_rate_error_rms_deg_s': (rate_error * degrees, 'deg/s'),
    }


def _motion(run, estimate, on):
    """(lag [s], rms of the rate error [rad/s]) of the estimate behind the true direction, in earth angles.

    The lag is the one that explains most of the error e by the true rate w: - sum(e w) / sum(w w).
    """
    if on.sum() < 3:
        return math.nan, math.nan
    names = ('azimuth', 'elevation')
    _, here, there = np.intersect1d(np.round(run.t * 1e9), np.round(estimate['t'] * 1e9), return_indices=True)
    angle, rate = np.full((2, run.t.size, 2), math.nan)
    angle[here] = np.column_stack([estimate[f'{name}.position'] for name in names])[there]
    rate[here] = np.column_stack([estimate[f'{name}.velocity'] for name in names])[there]
    truth = np.column_stack((np.unwrap(run.target_earth[:, 0]), run.target_earth[:, 1]))
    scale = np.column_stack((np.cos(truth[:, 1]), np.ones(run.t.size)))
    true_rate = np.gradient(truth, run.t, axis=0) * scale
    error = ((angle - truth + math.pi) % (2.0 * math.pi) - math.pi) * scale
    known = on & np.isfinite(error).all(axis=1) & np.isfinite(true_rate).all(axis=1)
    e, w = error[known], true_rate[known]
    moving = np.sum(w * w)
    return (-float(np.sum(e * w) / moving) if moving > 0.0 else math.nan,
            results.rms((rate * scale - true_rate)[known]))


def _ripples(command, estimate, common):
    """rms of what is faster than RIPPLE in the rate command and in the estimate's rate."""
    return {name: (results.rms(np.concatenate([_ripple(table['t'], table[f'{axis}.velocity'], common)
                                               for axis in ('azimuth', 'elevation')])) * math.degrees(1.0), 'deg/s')
            for name, table in (('estimate_rate_noise_deg_s', estimate), ('command_noise_deg_s', command))}


def _ripple(t, values, common):
    on = np.isin(t, common)
    values = values[on]
    length = max(1, round(RIPPLE / np.median(np.diff(t)))) if t.size > 1 else 1
    if values.size < 2 * length:
        return np.full(1, math.nan)
    mean = np.convolve(values, np.full(length, 1.0 / length), 'valid')
    return values[length // 2:length // 2 + mean.size] - mean
