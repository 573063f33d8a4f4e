"""Figures of a report on a run: pointing, errors, angles, torques, signal, sky plot, modes and INS, in degrees.

Functions named draw_ draw into given axes of matplotlib, and are also used by the overview.
"""
import functools
import itertools
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes

from pedestal_common.graph import modes
from pedestal_common.quantities import Bools, Floats, Ints, Pairs
from pedestal_results.recorded_run import RecordedRun
from pedestal_results.report.figures import (
    FIGURE_WIDTH_INCH,
    FILTERED_COLOUR,
    INK_COLOUR,
    MOTOR_1_COLOUR,
    MOTOR_2_COLOUR,
    RAW_COLOUR,
    TRUTH_COLOUR,
    Spec,
    Window,
    draw_line,
    existing,
    new_panels,
    outside_legend,
    spans,
)
from pedestal_results.tracking import Tracking

MODE_COLOURS = dict(zip(modes.MODES, itertools.cycle((
    '#9aa0a6', '#a87b51', '#8364c8', '#b9a3e3', '#e0ac00', '#2f9e5b', '#3aa6b9', '#d1495b', '#e58a95', '#f2b84b',
    '#5b6abf', '#7a8b2a', '#c46aa8', '#4f4f4f'))))
"""{mode of the ACU: its colour}."""
LEVEL_COLOURS = (('OK', '#a5d8b5'), ('WARN', '#f2772b'), ('ERROR', '#c81e1e'), ('STALE', '#9aa0a6'))
"""(name, colour) of each level of the diagnostics, 0 to 3."""
LOCKED_COLOUR = '#5f93c4'
ZOOM_SPAN_S = 2.0  # span of a zoomed figure [s]
MIN_DRAWN_ERROR_DEG = 1e-4  # smallest attitude error drawn on the logarithmic scale [deg]
SKY_POINTS = 3000  # largest number of points of a path in the sky plot


def _continuous(angle: Floats, beside: Floats | None = None) -> Floats:
    """Return an angle [rad] in degrees without jumps at +-180, within half a turn of the angle `beside` [deg] if
    given.
    """
    angle = np.degrees(angle)
    if beside is not None:
        return beside + (angle - beside + 180.0) % 360.0 - 180.0
    out = angle.copy()
    finite = np.isfinite(angle)
    out[finite] = np.unwrap(angle[finite], period=360.0)
    return out


def _middle(run: Tracking) -> Window:
    """Return the ZOOM_SPAN_S in the middle of the evaluated part, else in the middle of the run."""
    t = run.t[run.tracking] if run.tracking.any() else run.t
    middle = 0.5 * (t[0] + t[-1])
    return middle - 0.5 * ZOOM_SPAN_S, middle + 0.5 * ZOOM_SPAN_S


def _slowest(run: Tracking, angles: Pairs) -> Window:
    """Return the ZOOM_SPAN_S of the evaluated part in which angles changed least."""
    steps = round(ZOOM_SPAN_S / np.median(np.diff(run.t)))
    if run.tracking.sum() <= steps or not 0 < steps < run.t.size:
        return _middle(run)
    change = np.abs(angles[steps:] - angles[:-steps]).sum(axis=1)
    change[~(run.tracking[steps:] & run.tracking[:-steps]) | ~np.isfinite(change)] = np.inf
    start = run.t[np.argmin(change)]
    return start, start + ZOOM_SPAN_S


def _scale_to(axes: Axes, curves: Sequence[Floats], tracking: Bools, unit: str = '°', centred: bool = True) -> None:
    """Scale the axes to the evaluated part of curves; add a note if values outside the part leave the frame."""
    whole = np.concatenate([values[np.isfinite(values)] for values in curves])
    shown = np.concatenate([values[tracking & np.isfinite(values)] for values in curves])
    low, high = _frame(shown, centred)
    if low == high:
        return
    axes.set_ylim(low, high)
    if whole.min() < low or whole.max() > high:
        extremes = (f'up to {np.abs(whole).max():.2g}{unit}' if centred else
                    f'{whole.min():.3g} to {whole.max():.3g}{unit}')
        axes.text(0.995, 0.04, f'off scale outside the evaluated part, {extremes}', ha='right', va='bottom',
                  fontsize=7.5, transform=axes.transAxes)


def _frame(shown: Floats, centred: bool) -> tuple[float, float]:
    if not shown.size:
        return 0.0, 0.0
    if centred:
        limit = 1.25 * np.abs(shown).max()
        return -limit, limit
    margin = 0.1 * np.ptp(shown)
    return shown.min() - margin, shown.max() + margin


AXIS_TITLES = (('cross-elevation', 'azimuth'), ('elevation', 'elevation'))
"""(name of the error, name of the angle) of each axis."""


def draw_errors(axes: Axes, data: RecordedRun, i: int, window: Window | None = None) -> None:
    """Draw the receiver error and the filtered error [deg] of axis i; in a window also the true error."""
    run = data.tracking
    raw, filtered = np.degrees(run.measured[:, i]), np.degrees(run.filtered[:, i])
    draw_line(axes, run.t, raw, window, color=RAW_COLOUR, linewidth=0.7, label='receiver, before the filter')
    if window is not None:
        truth = np.degrees(run.error[:, i])
        draw_line(axes, run.t, truth, window, color=TRUTH_COLOUR, label='truth')
    else:
        _scale_to(axes, [raw], run.tracking)
    draw_line(axes, run.t, filtered, window, color=FILTERED_COLOUR, linewidth=1.2, label='after the filter')
    axes.set_ylabel('error [deg]')
    axes.set_title(AXIS_TITLES[i][0])


def error(data: RecordedRun, window: Window | None = None) -> Figure:
    """Return the figure of receiver error and filtered error on both axes [deg]."""
    figure, panels = new_panels(2, sharex=True)
    for i in range(2):
        draw_errors(panels[i, 0], data, i, window)
    return outside_legend(figure, panels[0, 0])


def error_zoom(data: RecordedRun) -> Figure:
    """Return the figure `error` over ZOOM_SPAN_S in the middle of the evaluated part, with the true error."""
    return error(data, _middle(data.tracking))


def angle(data: RecordedRun, zoomed: bool = False) -> Figure:
    """Return the figure of the measured and the filtered line of sight in earth angles [deg].

    zoomed: True for the ZOOM_SPAN_S in which the target moved least, with the true line of sight.
    """
    run = data.tracking
    figure, panels = new_panels(2, y=[f'{name} [deg]' for _, name in AXIS_TITLES], sharex=True)
    # In azimuth the branch is that of the beam, as in `azimuth`.
    truth = np.column_stack((_continuous(run.target_earth[:, 0], _continuous(run.beam_earth[:, 0])),
                             _continuous(run.target_earth[:, 1])))
    window = _slowest(run, truth) if zoomed else None
    for i, axes in enumerate(panels[:, 0]):
        filtered = _continuous(run.estimate_earth[:, i], truth[:, i])
        measured = _continuous(data.raw_angles[:, i], truth[:, i])
        draw_line(axes, run.t, measured, window, color=RAW_COLOUR, linewidth=0.8 if zoomed else 2.5,
                  label='measured, before the filter')
        if zoomed:
            draw_line(axes, run.t, truth[:, i], window, color=TRUTH_COLOUR, label='truth')
        else:
            _scale_to(axes, [measured, filtered], run.tracking, centred=False)
        draw_line(axes, run.t, filtered, window, color=FILTERED_COLOUR, linewidth=1.2, label='after the filter')
    return outside_legend(figure, panels[0, 0])


def draw_azimuth(axes: Axes, data: RecordedRun) -> None:
    """Draw the azimuth of antenna and target in earth angles [deg]."""
    run = data.tracking
    beam = _continuous(run.beam_earth[:, 0])
    draw_line(axes, run.t, _continuous(run.target_earth[:, 0], beam), color=TRUTH_COLOUR, linewidth=2.5,
              label='target')
    draw_line(axes, run.t, beam, color=FILTERED_COLOUR, label='antenna')
    axes.set_xlabel('time [s]')
    axes.set_ylabel('azimuth [deg]')


def azimuth(data: RecordedRun) -> Figure:
    """Return the figure of the azimuth of antenna and target in earth angles [deg]."""
    figure, panels = new_panels(1, height=2.9)
    draw_azimuth(panels[0, 0], data)
    return outside_legend(figure, panels[0, 0])


def _shade_modes(axes: Axes, data: RecordedRun) -> None:
    for start, stop, mode in data.modes:
        axes.axvspan(start, stop, color=MODE_COLOURS.get(mode, RAW_COLOUR), alpha=0.10, linewidth=0.0)


def draw_pointing(axes: Axes, data: RecordedRun, i: int) -> None:
    """Draw the true pointing error [deg] of axis i. Dashed lines mark a tenth of the beamwidth."""
    run = data.tracking
    error = np.degrees(run.error[:, i])
    draw_line(axes, run.t, error, color=TRUTH_COLOUR, linewidth=0.8)
    _scale_to(axes, [error], run.tracking)
    if np.isfinite(data.beamwidth):
        for sign in (-0.1, 0.1):
            axes.axhline(sign * np.degrees(data.beamwidth), color=INK_COLOUR, linewidth=0.8, linestyle='--')
    axes.set_title(AXIS_TITLES[i][0])
    axes.set_ylabel('error [deg]')


def pointing(data: RecordedRun) -> Figure:
    """Return the figure of the true pointing error, and of the angle from the beam to the target [deg], over the
    modes.
    """
    run = data.tracking
    figure, panels = new_panels(3, sharex=True)
    distance = np.degrees(run.distance)
    for i in range(2):
        draw_pointing(panels[i, 0], data, i)
    axes = panels[2, 0]
    draw_line(axes, run.t, np.where(distance > 0.0, distance, np.nan), color=TRUTH_COLOUR, linewidth=0.8)
    axes.set_yscale('log' if np.any(distance > 0.0) else 'linear')
    axes.set_title('angle between beam and target, whole run')
    axes.set_ylabel('off axis [deg]')
    for axes in panels[:, 0]:
        _shade_modes(axes, data)
    _mode_legend(figure, data)
    return figure


def _mode_legend(figure: Figure, data: RecordedRun) -> None:
    names = dict.fromkeys(mode for _, _, mode in data.modes)
    if names:
        figure.legend([Patch(color=MODE_COLOURS.get(name, RAW_COLOUR), alpha=0.45, linewidth=0.0) for name in names],
                      list(names), loc='outside upper right', ncols=len(names))


def draw_torques(axes: Axes, data: RecordedRun, axis: str, window: Window | None = None) -> None:
    """Draw the torques of both motors of an axis, and their bias torque [Nm]; without a window scaled to the evaluated
    part.
    """
    motors = existing(data.motors)
    first, second = motors[f'{axis}_motor_1.effort'], motors[f'{axis}_motor_2.effort']
    width = 0.7 if window is None else 1.0
    draw_line(axes, motors['t'], first, window, color=MOTOR_1_COLOUR, linewidth=width, label='motor 1')
    draw_line(axes, motors['t'], second, window, color=MOTOR_2_COLOUR, linewidth=width, label='motor 2')
    draw_line(axes, motors['t'], 0.5 * (first - second), window, color=INK_COLOUR, linewidth=0.9, linestyle='--',
              label='bias, half the difference')
    if window is None and not data.no_truth:
        run = data.tracking
        tracking = np.isin(motors['t'], run.t[run.tracking])
        _scale_to(axes, [first, second], tracking, ' Nm')
    axes.set_ylabel('torque [Nm]')
    axes.set_title(axis)


def _start(data: RecordedRun) -> Window:
    start = existing(data.motors)['t'][0]
    return start, start + ZOOM_SPAN_S


def torques(data: RecordedRun) -> Figure:
    """Return the figure of the torques of both motors of each axis [Nm]: whole run and first ZOOM_SPAN_S."""
    window = _start(data)
    figure, panels = new_panels(2, 2, height=4.5, sharex='col', width_ratios=(3, 2))
    for row, axis in zip(panels, ('azimuth', 'elevation')):
        draw_torques(row[0], data, axis)
        draw_torques(row[1], data, axis, window)
        row[1].set_title(f'{axis}, first {ZOOM_SPAN_S:g} s')
        row[1].set_ylabel('')
    return outside_legend(figure, panels[0, 0])


def draw_carrier(axes: Axes, data: RecordedRun) -> None:
    """Draw C/N0 [dB-Hz]; shade the times with a locked receiver."""
    table = existing(data.receiver)
    draw_line(axes, table['t'], table['z'], color=RAW_COLOUR, linewidth=0.8, label='C/N0')
    for first, last in spans(np.isfinite(table['x'])):
        axes.axvspan(table['t'][first], table['t'][last], color=LOCKED_COLOUR, alpha=0.15, linewidth=0.0)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('C/N0 [dB-Hz]')


def carrier(data: RecordedRun) -> Figure:
    """Return the figure of C/N0 [dB-Hz] and of the lock of the receiver."""
    figure, panels = new_panels(1, height=2.7)
    draw_carrier(panels[0, 0], data)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend([*handles, Patch(color=LOCKED_COLOUR, alpha=0.3, linewidth=0.0)], [*labels, 'locked'],
                  loc='outside upper right', ncols=2)
    return figure


def _along(angles: Pairs) -> Ints:
    """Return the indices of at most SKY_POINTS of angles [rad], evenly spread over path and time together.

    A fast slew has few samples in a part of the time, so an even spread over time alone would draw it as chords.
    """
    from_zenith = 0.5 * np.pi - angles[:, 1]
    turn = (np.diff(angles[:, 0]) + np.pi) % (2.0 * np.pi) - np.pi
    steps = np.nan_to_num(np.hypot(np.diff(from_zenith), turn * from_zenith[1:]))
    place = np.concatenate(((0.0,), np.cumsum(steps)))
    both = place / (place[-1] or 1.0) + np.linspace(0.0, 1.0, place.size)
    return np.unique(np.searchsorted(both, np.linspace(0.0, both[-1], SKY_POINTS)))


def draw_sky(axes: Axes, data: RecordedRun) -> None:
    """Draw target and beam over the station, north up, on polar axes."""
    run = data.tracking
    assert isinstance(axes, PolarAxes)
    axes.set_theta_zero_location('N')
    axes.set_theta_direction(-1)
    for angles, colour, width, label in ((run.target_earth, TRUTH_COLOUR, 3.0, 'target'),
                                         (run.beam_earth, FILTERED_COLOUR, 1.1, 'beam')):
        path = angles[_along(angles)]
        axes.plot(path[:, 0], 90.0 - np.degrees(path[:, 1]), color=colour, linewidth=width, label=label)
        known = angles[np.isfinite(angles).all(axis=1)]
        for row, marker in ((0, 'o'), (-1, 's')) if known.size else ():
            axes.plot(known[row, 0], 90.0 - np.degrees(known[row, 1]), marker, color=colour, markersize=6,
                      markerfacecolor='white' if row == 0 else colour)
    axes.plot([], [], 'o', color=INK_COLOUR, markersize=6, markerfacecolor='white', label='start')
    axes.plot([], [], 's', color=INK_COLOUR, markersize=6, label='end')
    axes.set_rlim(0.0, 90.0)
    axes.set_rgrids((30.0, 60.0), ('60°', '30°'), angle=22.5, fontsize=8)
    axes.set_thetagrids(range(0, 360, 45), ('N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'))


def sky(data: RecordedRun) -> Figure:
    """Return the sky plot of target and beam over the station, north up."""
    figure = Figure(figsize=(FIGURE_WIDTH_INCH, 4.2), layout='constrained')
    axes = figure.subplots(subplot_kw={'projection': 'polar'})
    draw_sky(axes, data)
    axes.legend(loc='center left', bbox_to_anchor=(1.2, 0.5))
    return figure


def timeline(data: RecordedRun) -> Figure:
    """Return the figure of the ACU mode, the lock of the receiver, and the reported level of each node."""
    rows = [('ACU mode', [(start, stop - start, MODE_COLOURS.get(mode, RAW_COLOUR))
                          for start, stop, mode in data.modes])] if data.modes else []
    if data.receiver:
        t = data.receiver['t']
        rows.append(('receiver locked', [(t[first], t[last] - t[first], LOCKED_COLOUR)
                                         for first, last in spans(np.isfinite(data.receiver['x']))]))
    end = max([stop for _, stop, _ in data.modes] + [stamp for stamp, *_ in data.statuses])
    for node in dict.fromkeys(node for _, node, *_ in data.statuses):
        own = [(stamp, level) for stamp, name, level, _ in data.statuses if name == node]
        own = [own[0], *(after for before, after in zip(own, own[1:]) if after[1] != before[1])]
        stops = [stamp for stamp, _ in own[1:]] + [end]
        rows.append((f'{node} diagnostics', [(start, stop - start, LEVEL_COLOURS[min(level, 3)][1])
                                             for (start, level), stop in zip(own, stops)]))
    figure, panels = new_panels(1, height=0.85 + 0.3 * len(rows))
    axes = panels[0, 0]
    for i, (_, bars) in enumerate(rows):
        for colour in dict.fromkeys(colour for *_, colour in bars):
            axes.broken_barh([(start, width) for start, width, own in bars if own == colour], (i - 0.32, 0.64),
                             color=colour, linewidth=0.0)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis='y', visible=False)
    keys = [(mode, MODE_COLOURS.get(mode, RAW_COLOUR)) for mode in dict.fromkeys(mode for _, _, mode in data.modes)]
    keys += [LEVEL_COLOURS[level] for level in sorted({min(level, 3) for _, _, level, _ in data.statuses})]
    figure.legend([Patch(color=colour, linewidth=0.0) for _, colour in keys], [name for name, _ in keys],
                  loc='outside upper right', ncols=len(keys))
    return figure


def overview(data: RecordedRun) -> Figure:
    """Return one wide figure of a run: sky plot, error before and after the filter, pointing error, motor torques."""
    figure = Figure(figsize=(13.0, 7.0), layout='constrained')
    grid = figure.add_gridspec(4, 3, width_ratios=(1.05, 1.0, 1.0))
    polar = figure.add_subplot(grid[:2, 0], projection='polar')
    draw_sky(polar, data)
    polar.set_anchor('W')
    bottom = []
    for i, axis in enumerate(('azimuth', 'elevation')):
        axes = figure.add_subplot(grid[2 + i, 0])
        draw_torques(axes, data, axis, _start(data))
        axes.set_title(f'{axis}: motor torques, first {ZOOM_SPAN_S:g} s')
        if i == 0:
            axes.tick_params(labelbottom=False)
    bottom.append(axes)
    handles, labels = axes.get_legend_handles_labels()
    first = polar.legend(loc='upper left', bbox_to_anchor=(1.05, 1.0))
    polar.add_artist(first)
    second = polar.legend(handles, [label.partition(',')[0] for label in labels], loc='lower left',
                          bbox_to_anchor=(1.05, -0.05))
    for legend in (first, second):
        legend.set_in_layout(False)
    for i in range(2):
        column = [figure.add_subplot(grid[2 * i:2 * i + 2, 1]), figure.add_subplot(grid[2 * i:2 * i + 2, 2])]
        draw_errors(column[0], data, i)
        column[0].set_title(f'{AXIS_TITLES[i][0]}: measured error')
        draw_pointing(column[1], data, i)
        column[1].set_title(f'{AXIS_TITLES[i][0]}: true pointing error')
        if i == 0:
            column[0].legend(loc='upper right')
        else:
            bottom += column
    for axes in bottom:
        axes.set_xlabel('time [s]')
    return figure


def attitude(data: RecordedRun) -> Figure:
    """Return the figure of the heading and level errors of the INS [deg], and of their stated standard deviations."""
    known = existing(data.attitude)
    figure, panels = new_panels(2, y='error [deg]', sharex=True)
    # known.sigma is (n, 2): level per axis, heading. Both level axes together have sqrt(2) times the sigma of one.
    for axes, name, error, sigma in zip(panels[:, 0], ('heading', 'level, both axes'),
                                        (np.abs(known.heading), known.level),
                                        (known.sigma[:, 1], np.sqrt(2.0) * known.sigma[:, 0])):
        draw_line(axes, known.t, np.maximum(np.degrees(error), MIN_DRAWN_ERROR_DEG), color=TRUTH_COLOUR, linewidth=0.8,
                  label='error')
        draw_line(axes, known.t, np.maximum(np.degrees(sigma), MIN_DRAWN_ERROR_DEG), color=FILTERED_COLOUR,
                  label='1 sigma, stated by the INS')
        if np.isfinite(known.aligned) and known.aligned > known.t[0]:
            axes.axvline(known.aligned, color=INK_COLOUR, linewidth=0.8, linestyle='--', label='aligned')
        axes.set_yscale('log')
        axes.set_title(name)
    return outside_legend(figure, panels[0, 0])


FIGURES = (
    Spec('pointing', 'True pointing error', 'True angle from the beam axis to the target on both axes, and its size '
         'over the whole run. The background shows the mode of the ACU.', ('truth',), pointing, timed=True),
    Spec('error', 'Error before and after the filter', 'The receiver error (grey) changes '
         'from sample to sample. The position loop follows the filtered line of sight (blue): the true pointing '
         'error plus the error of the filter. Slow errors of encoders and INS are no error of the filter.',
         ('truth', 'lock'), error, timed=True, paper=7),
    Spec('error_zoom', 'Error, zoomed',
         f'The middle {ZOOM_SPAN_S:g} s of the evaluated part. The position loop holds the filtered error (blue) near '
         'zero. The true error (orange) is the rest of the noise (grey) after the filter.',
         ('truth', 'lock'), error_zoom, timed=True, paper=8),
    Spec('angle', 'Angle before and after the filter', 'Line of sight in earth angles: '
         'measured (grey: encoder plus receiver) and filtered (blue). At this scale both are one curve.',
         ('truth', 'lock'), angle, timed=True, paper=9),
    Spec('angle_zoom', 'Angle, zoomed',
         f'The {ZOOM_SPAN_S:g} s in which the target moved least, so that the noise shows best: filtered (blue), '
         'measured (grey) and true (orange).', ('truth', 'lock'), functools.partial(angle, zoomed=True),
         timed=True, paper=10),
    Spec('azimuth', 'Azimuth trajectory', 'The azimuth of the antenna (blue) reaches the '
         'azimuth of the target (orange) and stays on it.', ('truth',), azimuth, timed=True, paper=11),
    Spec('torques', 'Motor torques', 'Both motors of an axis share the load. The bias torque (dashed) pulls them '
         'against each other and closes the backlash; it fades at large load. Right: the start of the run.',
         ('motors',), torques, timed=True),
    Spec('carrier', 'Signal and lock', 'C/N0 at the receiver; shaded: receiver locked, with errors as output.',
         ('receiver',), carrier, timed=True),
    Spec('sky', 'Sky plot', 'Target and beam over the station: north up, azimuth clockwise, zenith in the middle, '
         'horizon on the rim.', ('truth',), sky),
    Spec('timeline', 'Modes and health', 'Mode of the ACU, lock of the receiver, and reported level of each node.',
         ('modes',), timeline, timed=True),
)
OVERVIEW_FIGURE = Spec('overview', '', '', ('truth', 'lock', 'motors'), overview, dpi=100)
ATTITUDE_FIGURES = (
    Spec('attitude', 'Attitude error of the INS', 'Error of the attitude that the control unit received (orange) and '
         'the standard deviation that the INS states (blue).', ('attitude',), attitude, timed=True),
)
