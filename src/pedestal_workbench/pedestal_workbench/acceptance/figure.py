"""Figure of a requirement in the report: its repetitions against the limit, and the motion in the first of them."""
import math
import pathlib
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.graph.topics import AXES
from pedestal_results.report import figures
from pedestal_results.tracking import DEG_PER_RAD
from pedestal_workbench.acceptance.exercise import Performed
from pedestal_workbench.acceptance.judgement import Judged
from pedestal_workbench.acceptance.specification import Requirement

HEIGHT_INCH = 1.7
MAX_SIGNAL_POINTS = 1000    # of a kept signal
HEADER = 'time_s', *(f'{axis}_deg' for axis in AXES)    # columns of a kept signal


class Shown(NamedTuple):
    """What the figure of a requirement shows."""
    requirement: Requirement
    judged: Judged
    signal: pathlib.Path    # of `keep_signal`; it may be missing


def keep_signal(performed: Performed, path: pathlib.Path) -> None:
    """Write the angles of an exercise as CSV, for the figure of its requirement."""
    table = performed.recording.table('joint_states')
    columns = np.column_stack([table['t'] - performed.begin,
                               *(table[f'{axis}.position'] * DEG_PER_RAD for axis in AXES)])
    path.parent.mkdir(exist_ok=True)
    np.savetxt(path, columns[::1 + len(columns) // MAX_SIGNAL_POINTS], fmt='%.6g', delimiter=',',
               header=','.join(HEADER), comments='')


def draw(shown: Shown) -> Figure:
    """Return the figure of a requirement: its repetitions against the limit, and the first recorded signal."""
    judged, count, signal = shown.judged, len(shown.judged.repetitions), shown.signal.is_file()
    drawn, panels = figures.new_panels(1, 2, height=HEIGHT_INCH, x=('repetition', 'time [s]'),
                                       y=shown.requirement.method.unit.removeprefix('1'), width_ratios=(1.0, 2.0))
    axes = panels[0, 0]
    known = [(i, *one) for i, one in enumerate(judged.repetitions, start=1) if all(map(math.isfinite, one))]
    if known:
        axes.errorbar(*zip(*known), fmt='o', color=figures.FILTERED_COLOUR, capsize=3.0)
    if math.isfinite(judged.value):
        axes.axhspan(judged.value - judged.uncertainty, judged.value + judged.uncertainty,
                     color=figures.FILTERED_COLOUR, alpha=0.15, linewidth=0.0)
    for end in filter(math.isfinite, shown.requirement.limit.ends):
        axes.axhline(end, color=figures.TRUTH_COLOUR)
    axes.set(xlim=(0.4, count + 0.6), xticks=range(1, count + 1, 1 + count // 10),
             title=f'measured, limit {shown.requirement.limit.text}')
    axes.margins(y=0.15)
    panels[0, 1].set(title='motion, repetition 1' if signal else 'no motion was recorded', ylabel='deg')
    if signal:
        t, *angles = np.loadtxt(shown.signal, delimiter=',', skiprows=1, ndmin=2).T
        for axis, angle, colour in zip(AXES, angles, (figures.FILTERED_COLOUR, figures.RAW_COLOUR)):
            figures.draw_line(panels[0, 1], t, angle - angle[0], color=colour, label=axis)
        panels[0, 1].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
    return drawn
