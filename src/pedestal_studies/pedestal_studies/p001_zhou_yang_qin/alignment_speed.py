"""Zhou 2011's trade: an ADRC alignment with higher bandwidths is faster and less precise.

The paper (section 6) states that other parameters of the ADRC make the level converge faster and so shorten the
alignment of the azimuth, and that a faster convergence lowers the precision. It prints no number.

A case adrc/K is the method adrc with all its times divided by K. Its bandwidths are K times the default. The azimuth
uses the level commands after 1 / K of the default time. All cases get the same IMU samples.
"""
import dataclasses
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Floats, Seconds
from pedestal_results import metrics, tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies.p001_zhou_yang_qin import aligned_runs, alignment
from pedestal_studies.p001_zhou_yang_qin.aligned_runs import (
    EVALUATION_PERIOD_S,
    INS_PARAMETERS,
    LEVEL_COLUMNS,
    Accuracy,
)
from pedestal_studies.p001_zhou_yang_qin.methods import MethodParameters
from pedestal_studies.result import Result, legend
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 100  # runs of each case
SPEEDS = (0.5, 1.0, 2.0, 4.0)  # factors K by which the times of the method are divided [-]; 1: the default parameters

SETTLED_LEVEL_ARCMIN = 30.0  # rms over the runs below which the level counts as settled, a sixth of the initial tilt


def faster(speed: float) -> MethodParameters:
    """Return the parameters whose method adrc has all its times divided by `speed` [-]."""
    adrc = INS_PARAMETERS.adrc
    return dataclasses.replace(INS_PARAMETERS, adrc=dataclasses.replace(
        adrc, observer=speed * adrc.observer, control=speed * adrc.control, start=adrc.start / speed))


CASES = {f'adrc/{speed:g}': ('adrc', faster(speed)) for speed in SPEEDS}  # {case: method}


def level_over_runs(accuracy: Accuracy) -> Floats:
    """Return the rms of both level errors over the runs [arcmin]."""
    return tracking.rms(accuracy.rms[:, LEVEL_COLUMNS], axis=1)


def level_settling(accuracy: Accuracy) -> Seconds:
    """Return the interpolated time from which `level_over_runs` stays below SETTLED_LEVEL_ARCMIN, or NaN."""
    level = level_over_runs(accuracy)
    return metrics.settling_time(EVALUATION_PERIOD_S * np.arange(1, len(level) + 1, dtype=float), 1.0 + level, 1.0,
                                 SETTLED_LEVEL_ARCMIN)


METRICS = {  # {metric: (unit, function of an Accuracy)}
    'level_settling_s': ('s', level_settling),
    **{name: alignment.KIND_METRICS[''][name] for name in (
        'time_to_12arcmin_rms_s', 'azimuth_rms_arcmin_100s', 'azimuth_rms_arcmin_250s', 'level_rms_arcmin',
        'azimuth_rms_arcmin_600s')}}


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Align with every case, `runs` times."""
    accuracy = aligned_runs.accuracies({'': runs}, CASES, pool or monte_carlo.Pool(1), progress)['']
    rows = [row(case, metric, a.over_parts(value), unit, runs=a.whole.runs)
            for case, a in accuracy.items() for metric, (unit, value) in METRICS.items()]
    return Result(rows, {'speed': lambda: speed_figure(accuracy)}, [
        'Every number is a statistic over all runs; its interval comes from the jackknife over '
        f'{aligned_runs.JACKKNIFE_PARTS} parts of the runs.',
        f'The level counts as settled below {SETTLED_LEVEL_ARCMIN:g} arcmin. If its noise stays above this limit, it '
        'never settles, and the row has no value.'])


def speed_figure(accuracy: Mapping[str, Accuracy]) -> Figure:
    """Draw the rms of level and azimuth over the runs."""
    figure, axes = fig.new_panels(2, height=6.4, y=('level [arcmin]', 'azimuth [arcmin]'), sharex=True)
    for (case, a), shade in zip(accuracy.items(), np.linspace(0.3, 1.0, len(accuracy))):
        t = EVALUATION_PERIOD_S * np.arange(1, len(a.rms) + 1)
        for panel, values in zip(axes[:, 0], (level_over_runs(a), a.azimuth)):
            panel.semilogy(t, values, color=fig.FILTERED_COLOUR, alpha=shade, label=case)
    axes[0, 0].set_title('rms over the runs')
    axes[1, 0].axhline(alignment.SETTLED_AZIMUTH_ARCMIN, color=fig.INK_COLOUR, linewidth=0.8, linestyle='--')
    return legend(figure)
