"""The figures of a report: what a run did, drawn from a Recording. Angles in degrees.

Grey is what was measured, blue what was filtered or commanded, orange the truth.
"""
import dataclasses
import re
import typing

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from pedestal_common import line_of_sight
from pedestal_common.compiled import compiled

INK = '#20242a'
RAW, FILTERED, TRUTH = '#8d949e', '#1f6fd1', '#e57a00'
MOTOR_1, MOTOR_2 = '#0b8f8c', '#a04fc4'
MODES = {'standby': '#9aa0a6', 'stow': '#a87b51', 'preset': '#8364c8', 'program': '#e0ac00', 'autotrack': '#2f9e5b'}
LEVELS = (('OK', '#a5d8b5'), ('WARN', '#f2772b'), ('ERROR', '#c81e1e'), ('STALE', '#9aa0a6'))
LOCKED = '#5f93c4'
WIDTH = 7.4
ZOOM = 2.0
"""Seconds of a zoomed figure."""

STYLE = {
    'font.size': 9.0, 'axes.titlesize': 9.5, 'axes.titlelocation': 'left', 'legend.fontsize': 8.5,
    'legend.frameon': False, 'axes.spines.top': False, 'axes.spines.right': False, 'axes.grid': True,
    'grid.color': '#88919c', 'grid.alpha': 0.25, 'grid.linewidth': 0.6, 'axes.edgecolor': INK, 'axes.labelcolor': INK,
    'xtick.color': INK, 'ytick.color': INK, 'text.color': INK, 'axes.facecolor': 'none', 'figure.facecolor': 'none',
    'lines.linewidth': 1.0, 'lines.solid_joinstyle': 'round', 'axes.formatter.useoffset': False,
    'axes.xmargin': 0.0, 'svg.fonttype': 'none',
}


@dataclasses.dataclass
class Recording:
    """What the figures draw. run: results.Tracking, None without truth; motors, receiver: tables, None when empty.

    modes: [(start, stop [s], mode)]; statuses: [(stamp [s], node, level, message)]; no_truth: why run is None;
    raw_angles (n, 2): earth angles of the target as measured [rad]; beamwidth [rad], NaN when the bag does not say;
    filter: consistency.Consistency, None without acu/filter; attitude: known_attitude.KnownAttitude, None ashore.
    """
    run: typing.Any
    no_truth: str
    raw_angles: typing.Any
    motors: typing.Any
    receiver: typing.Any
    modes: list
    statuses: list
    beamwidth: float
    filter: typing.Any = None
    attitude: typing.Any = None

    def lacks(self, need):
        """Why a figure that needs this cannot be drawn; '' when it can."""
        if need == 'truth':
            return self.no_truth
        if need == 'motors':
            return '' if self.motors else 'no message of adu/motor_states'
        if need == 'modes':
            return '' if self.modes or self.statuses else 'no message of acu/mode or diagnostics'
        if need == 'filter':
            return '' if self.filter is not None else 'no message of acu/filter'
        if need == 'attitude':
            return '' if self.attitude is not None else 'no INS in the run'
        if need == 'bank':
            return '' if self.filter is None or np.isfinite(self.filter.probability).sum(axis=2).max() > 1 else \
                'one model of motion alone'
        if not self.receiver:
            return 'no message of tracking_receiver/angle_error'
        return 'the receiver never locked' if need == 'lock' and not np.isfinite(self.receiver['x']).any() else ''


def thin(t, y, bins=1000):
    """Smallest and largest value of each of `bins` stretches, in order, and the first NaN of each: gaps stay gaps."""
    if t.size <= 2 * bins:
        return t, y
    edges = np.linspace(0, t.size, bins + 1).astype(int)
    low = np.where(np.isfinite(y), y, np.inf)
    high = np.where(np.isfinite(y), y, -np.inf)
    keep = {0, t.size - 1}
    for start, stop in zip(edges[:-1], edges[1:]):
        gap = np.flatnonzero(~np.isfinite(y[start:stop]))
        keep.update((start + np.argmin(low[start:stop]), start + np.argmax(high[start:stop]), *(start + gap[:1])))
    index = np.array(sorted(keep))
    return t[index], y[index]


@compiled
def _displaced(azimuth, elevation, errors, quaternions, earth):
    """Earth angles (n, 2) of the direction a receiver at deck angles sees at `errors` (n, 2)."""
    mat_ed = np.empty((3, 3))
    for k in range(azimuth.size):
        line_of_sight.rotation(quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3], mat_ed)
        at, up = line_of_sight.displaced(azimuth[k], elevation[k], errors[k, 0], errors[k, 1])
        x, y, z = line_of_sight.direction(at, up)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        earth[k, 0], earth[k, 1] = line_of_sight.earth_angles(east, north, height)


def raw_angles(run, ship):
    """Earth angles (n, 2) [rad] of the target as measured, before any filter. ship: table of ship/truth or None."""
    quaternions = np.tile(np.array(line_of_sight.ASHORE), (run.t.size, 1))
    if ship is not None:
        at = np.searchsorted(ship['t'], run.t - 1e-9).clip(0, ship['t'].size - 1)
        quaternions = np.column_stack([ship[f'orientation.{axis}'][at] for axis in 'xyzw'])
    earth = np.empty((run.t.size, 2))
    _displaced(run.azimuth, run.elevation, run.measured, quaternions, earth)
    return earth


def _continuous(angle, beside=None):
    """Degrees without the jump at +-180; beside: a continuous angle [deg] to stay within half a turn of."""
    angle = np.degrees(angle)
    if beside is not None:
        return beside + (angle - beside + 180.0) % 360.0 - 180.0
    out = angle.copy()
    finite = np.isfinite(angle)
    out[finite] = np.unwrap(angle[finite], period=360.0)
    return out


def spans(flags):
    """[(first, last index)] of the stretches where flags are true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist()))


def _middle(run):
    """The ZOOM seconds in the middle of what was evaluated, else of the run."""
    t = run.t[run.tracking] if run.tracking.any() else run.t
    middle = 0.5 * (t[0] + t[-1])
    return middle - 0.5 * ZOOM, middle + 0.5 * ZOOM


def _slowest(run, angles):
    """The ZOOM seconds of what was evaluated in which the angles (n, 2) changed least."""
    steps = round(ZOOM / np.median(np.diff(run.t)))
    if run.tracking.sum() <= steps or not 0 < steps < run.t.size:
        return _middle(run)
    change = np.abs(angles[steps:] - angles[:-steps]).sum(axis=1)
    change[~(run.tracking[steps:] & run.tracking[:-steps]) | ~np.isfinite(change)] = np.inf
    start = run.t[np.argmin(change)]
    return start, start + ZOOM


def new_panels(rows, columns=1, height=1.75, **options):
    figure = Figure(figsize=(WIDTH, 0.5 + height * rows), layout='constrained')
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def draw_line(axes, t, y, window=None, **options):
    if window is not None:
        inside = (t >= window[0]) & (t <= window[1])
        t, y = t[inside], y[inside]
    axes.plot(*thin(t, y), **options)
    if t.size > 1:
        axes.set_xlim(t[0], t[-1])


def outside_legend(figure, axes, **options):
    figure.legend(*axes.get_legend_handles_labels(), loc='outside upper right', ncols=4, **options)


def _scale_to(axes, t, values, tracking):
    """A frame for the evaluated part; a note where the approach before it leaves the frame."""
    shown = np.abs(values[tracking & np.isfinite(values)])
    whole = np.abs(values[np.isfinite(values)])
    if not shown.size or shown.max() == 0.0:
        return
    limit = 1.25 * shown.max()
    axes.set_ylim(-limit, limit)
    if whole.max() > limit:
        axes.text(0.995, 0.04, f'off scale outside the evaluated part, up to {whole.max():.2g}°', ha='right',
                  va='bottom', fontsize=7.5, transform=axes.transAxes)


AXES = (('cross-elevation', 'azimuth'), ('elevation', 'elevation'))


def _draw_errors(axes, recording, i, window=None):
    run = recording.run
    raw, filtered = np.degrees(run.measured[:, i]), np.degrees(run.filtered[:, i])
    draw_line(axes, run.t, raw, window, color=RAW, linewidth=0.7, label='receiver, before the filter')
    if window is not None:
        truth = np.degrees((run.cross_elevation, run.elevation_error)[i])
        draw_line(axes, run.t, truth, window, color=TRUTH, label='truth')
    else:
        _scale_to(axes, run.t, raw, run.tracking)
    draw_line(axes, run.t, filtered, window, color=FILTERED, linewidth=1.2, label='after the filter')
    axes.set_ylabel('error [deg]')
    axes.set_title(AXES[i][0])


def _errors(recording, window=None):
    figure, panels = new_panels(2, sharex=True)
    for i in range(2):
        _draw_errors(panels[i, 0], recording, i, window)
    panels[1, 0].set_xlabel('time [s]')
    outside_legend(figure, panels[0, 0])
    return figure


def error(recording):
    return _errors(recording)


def error_zoom(recording):
    return _errors(recording, _middle(recording.run))


def _angles(recording, zoomed):
    run = recording.run
    figure, panels = new_panels(2, sharex=True)
    truth = np.column_stack([_continuous(run.target_earth[:, i]) for i in range(2)])
    window = _slowest(run, truth) if zoomed else None
    for i, axes in enumerate(panels[:, 0]):
        beam = _continuous(run.beam_earth[:, i], truth[:, i])
        scale = np.cos(run.beam_earth[:, 1] + run.filtered[:, 1]) if i == 0 else 1.0
        filtered = beam + np.degrees(run.filtered[:, i] / scale)
        draw_line(axes, run.t, _continuous(recording.raw_angles[:, i], truth[:, i]), window, color=RAW,
              linewidth=0.8 if zoomed else 2.5, label='measured, before the filter')
        if zoomed:
            draw_line(axes, run.t, truth[:, i], window, color=TRUTH, label='truth')
        draw_line(axes, run.t, filtered, window, color=FILTERED, linewidth=1.2, label='after the filter')
        axes.set_ylabel(f'{AXES[i][1]} [deg]')
    axes.set_xlabel('time [s]')
    outside_legend(figure, panels[0, 0])
    return figure


def angle(recording):
    return _angles(recording, False)


def angle_zoom(recording):
    return _angles(recording, True)


def azimuth(recording):
    run = recording.run
    figure, panels = new_panels(1, height=2.4)
    axes = panels[0, 0]
    beam = _continuous(run.beam_earth[:, 0])
    draw_line(axes, run.t, _continuous(run.target_earth[:, 0], beam), color=TRUTH, linewidth=2.5, label='target')
    draw_line(axes, run.t, beam, color=FILTERED, label='antenna')
    axes.set_xlabel('time [s]')
    axes.set_ylabel('azimuth [deg]')
    outside_legend(figure, axes)
    return figure


def _shade_modes(axes, recording):
    for start, stop, mode in recording.modes:
        axes.axvspan(start, stop, color=MODES.get(mode, RAW), alpha=0.10, linewidth=0.0)
    for start, _, _ in recording.modes[1:]:
        axes.axvline(start, color=INK, linewidth=0.6, linestyle=':')


def _draw_pointing(axes, recording, i):
    run = recording.run
    error = np.degrees((run.cross_elevation, run.elevation_error)[i])
    draw_line(axes, run.t, error, color=TRUTH, linewidth=0.8)
    _scale_to(axes, run.t, error, run.tracking)
    if np.isfinite(recording.beamwidth):
        for sign in (-0.1, 0.1):
            axes.axhline(sign * np.degrees(recording.beamwidth), color=INK, linewidth=0.8, linestyle='--')
    axes.set_title(AXES[i][0])
    axes.set_ylabel('error [deg]')


def pointing(recording):
    run = recording.run
    figure, panels = new_panels(3, sharex=True)
    off = np.degrees(np.hypot(run.cross_elevation, run.elevation_error))
    for i in range(2):
        _draw_pointing(panels[i, 0], recording, i)
    axes = panels[2, 0]
    draw_line(axes, run.t, np.where(off > 0.0, off, np.nan), color=TRUTH, linewidth=0.8)
    axes.set_yscale('log' if np.any(off > 0.0) else 'linear')
    axes.set_title('angle between beam and target, whole run')
    axes.set_ylabel('off axis [deg]')
    axes.set_xlabel('time [s]')
    for axes in panels[:, 0]:
        _shade_modes(axes, recording)
    _mode_legend(figure, recording)
    return figure


def _mode_legend(figure, recording):
    names = dict.fromkeys(mode for _, _, mode in recording.modes)
    if names:
        figure.legend([Patch(color=MODES.get(name, RAW), alpha=0.45, linewidth=0.0) for name in names], list(names),
                      loc='outside upper right', ncols=len(names))


def _draw_torques(axes, recording, axis, window=None):
    motors = recording.motors
    first, second = motors[f'{axis}_motor_1.effort'], motors[f'{axis}_motor_2.effort']
    width = 0.7 if window is None else 1.0
    draw_line(axes, motors['t'], first, window, color=MOTOR_1, linewidth=width, label='motor 1')
    draw_line(axes, motors['t'], second, window, color=MOTOR_2, linewidth=width, label='motor 2')
    draw_line(axes, motors['t'], 0.5 * (first - second), window, color=INK, linewidth=0.9, linestyle='--',
          label='bias, half their difference')
    axes.set_ylabel('torque [Nm]')
    axes.set_title(axis)


def _start(recording):
    start = recording.motors['t'][0]
    return start, start + ZOOM


def torques(recording):
    window = _start(recording)
    figure, panels = new_panels(2, 2, height=2.0, sharex='col', sharey='row', width_ratios=(3, 2))
    for row, axis in zip(panels, ('azimuth', 'elevation')):
        _draw_torques(row[0], recording, axis)
        _draw_torques(row[1], recording, axis, window)
        row[1].set_title(f'{axis}, first {ZOOM:g} s')
        row[1].set_ylabel('')
    for axes in panels[1]:
        axes.set_xlabel('time [s]')
    outside_legend(figure, panels[0, 0])
    return figure


def carrier(recording):
    table = recording.receiver
    figure, panels = new_panels(1, height=2.2)
    axes = panels[0, 0]
    draw_line(axes, table['t'], table['z'], color=RAW, linewidth=0.8, label='C/N0')
    for first, last in spans(np.isfinite(table['x'])):
        axes.axvspan(table['t'][first], table['t'][last], color=LOCKED, alpha=0.15, linewidth=0.0)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend([*handles, Patch(color=LOCKED, alpha=0.3, linewidth=0.0)], [*labels, 'locked'],
                  loc='outside upper right', ncols=2)
    axes.set_xlabel('time [s]')
    axes.set_ylabel('C/N0 [dB-Hz]')
    return figure


def _draw_sky(axes, recording):
    run = recording.run
    axes.set_theta_zero_location('N')
    axes.set_theta_direction(-1)
    for angles, colour, width, label in ((run.target_earth, TRUTH, 3.0, 'target'),
                                         (run.beam_earth, FILTERED, 1.1, 'beam')):
        path = angles[::max(1, run.t.size // 1500)]
        axes.plot(path[:, 0], 90.0 - np.degrees(path[:, 1]), color=colour, linewidth=width, label=label)
        seen = angles[np.isfinite(angles).all(axis=1)]
        for row, marker in ((0, 'o'), (-1, 's')) if seen.size else ():
            axes.plot(seen[row, 0], 90.0 - np.degrees(seen[row, 1]), marker, color=colour, markersize=6,
                      markerfacecolor='white' if row == 0 else colour)
    axes.plot([], [], 'o', color=INK, markersize=6, markerfacecolor='white', label='start')
    axes.plot([], [], 's', color=INK, markersize=6, label='end')
    axes.set_rlim(0.0, 90.0)
    axes.set_rgrids((30.0, 60.0), ('60°', '30°'), angle=22.5, fontsize=8)
    axes.set_thetagrids(range(0, 360, 45), ('N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'))


def sky(recording):
    figure = Figure(figsize=(WIDTH, 4.2), layout='constrained')
    axes = figure.subplots(subplot_kw={'projection': 'polar'})
    _draw_sky(axes, recording)
    axes.legend(loc='center left', bbox_to_anchor=(1.2, 0.5))
    return figure


def timeline(recording):
    rows = ([('ACU mode', [(start, stop - start, MODES.get(mode, RAW)) for start, stop, mode in recording.modes])]
            if recording.modes else [])
    if recording.receiver:
        t = recording.receiver['t']
        rows.append(('receiver locked', [(t[first], t[last] - t[first], LOCKED)
                                         for first, last in spans(np.isfinite(recording.receiver['x']))]))
    end = max([stop for _, stop, _ in recording.modes] + [stamp for stamp, *_ in recording.statuses])
    for node in dict.fromkeys(node for _, node, *_ in recording.statuses):
        own = [(stamp, level) for stamp, name, level, _ in recording.statuses if name == node]
        own = [own[0], *(after for before, after in zip(own, own[1:]) if after[1] != before[1])]
        stops = [stamp for stamp, _ in own[1:]] + [end]
        rows.append((f'{node} diagnostics', [(start, stop - start, LEVELS[min(level, 3)][1])
                                             for (start, level), stop in zip(own, stops)]))
    figure, panels = new_panels(1, height=0.35 + 0.3 * len(rows))
    axes = panels[0, 0]
    for i, (_, bars) in enumerate(rows):
        for colour in dict.fromkeys(colour for *_, colour in bars):
            axes.broken_barh([(start, width) for start, width, own in bars if own == colour], (i - 0.32, 0.64),
                             color=colour, linewidth=0.0)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis='y', visible=False)
    axes.set_xlabel('time [s]')
    keys = [(mode, MODES.get(mode, RAW)) for mode in dict.fromkeys(mode for _, _, mode in recording.modes)]
    keys += [LEVELS[level] for level in sorted({min(level, 3) for _, _, level, _ in recording.statuses})]
    figure.legend([Patch(color=colour, linewidth=0.0) for _, colour in keys], [name for name, _ in keys],
                  loc='outside upper right', ncols=len(keys))
    return figure


def overview(recording):
    """One wide picture of a run: sky, error before and after the filter, pointing error, motor torques."""
    figure = Figure(figsize=(13.0, 7.0), layout='constrained')
    grid = figure.add_gridspec(4, 3, width_ratios=(1.05, 1.0, 1.0))
    polar = figure.add_subplot(grid[:2, 0], projection='polar')
    _draw_sky(polar, recording)
    polar.set_anchor('W')
    bottom = []
    for i, axis in enumerate(('azimuth', 'elevation')):
        axes = figure.add_subplot(grid[2 + i, 0])
        _draw_torques(axes, recording, axis, _start(recording))
        axes.set_title(f'{axis}: motor torques, first {ZOOM:g} s')
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
        _draw_errors(column[0], recording, i)
        column[0].set_title(f'{AXES[i][0]}: measured error')
        _draw_pointing(column[1], recording, i)
        column[1].set_title(f'{AXES[i][0]}: pointing error against truth')
        if i == 0:
            column[0].legend(loc='upper right')
        else:
            bottom += column
    for axes in bottom:
        axes.set_xlabel('time [s]')
    return figure


class Spec(typing.NamedTuple):
    """key: name of its PNG; needs: see Recording.lacks."""
    key: str
    title: str
    caption: str
    needs: tuple
    draw: typing.Callable


FIGURES = (
    Spec('pointing', 'Pointing error against truth', 'True angle from the beam axis to the target on both axes, and '
         'its size over the whole run; background and dotted lines show the mode of the ACU.', ('truth',), pointing),
    Spec('error', 'Error before and after the filter (figure 7 of the paper)', 'The error the receiver put out (grey) '
         'jumps from sample to sample; the filtered line of sight less the encoder (blue) is what the position loop '
         'gets instead, on a ship shifted by the attitude error of its INS.',
         ('truth', 'lock'), error),
    Spec('error_zoom', 'Error, zoomed (figure 8 of the paper)', f'The middle {ZOOM:g} s of the evaluated part: the '
         'position loop holds the filtered error (blue) near zero; the true one (orange) is what the filter leaves of '
         'the noise (grey).', ('truth', 'lock'), error_zoom),
    Spec('angle', 'Angle before and after the filter (figure 9 of the paper)', 'Line of sight in earth angles as '
         'measured (grey: encoder plus receiver) and as filtered (blue): one curve at this scale.',
         ('truth', 'lock'), angle),
    Spec('angle_zoom', 'Angle, zoomed (figure 10 of the paper)', f'The {ZOOM:g} s in which the target moved least, '
         'where the noise stands out best: filtered (blue) against measured (grey) and true (orange).',
         ('truth', 'lock'), angle_zoom),
    Spec('azimuth', 'Azimuth trajectory (figure 11 of the paper)', "The antenna's azimuth (blue) comes to the "
         "target's (orange) and stays on it.", ('truth',), azimuth),
    Spec('torques', 'Motor torques', 'Both motors of an axis share the load and pull against each other by the bias '
         '(dashed) that closes the backlash and fades where the load is large; right: the start of the run.',
         ('motors',), torques),
    Spec('carrier', 'Signal and lock', 'C/N0 at the receiver; shaded where it was locked and put out errors.',
         ('receiver',), carrier),
    Spec('sky', 'Sky plot', 'Target and beam over the station: north up, azimuth clockwise, zenith in the middle, '
         'horizon on the rim.', ('truth',), sky),
    Spec('timeline', 'Modes and health', 'Mode of the ACU, lock of the receiver and the level each node reported.',
         ('modes',), timeline),
)
OVERVIEW = Spec('overview', '', '', ('truth', 'lock', 'motors'), overview)


def render(spec, recording, output):
    """Draw one figure into a path or stream: .png white on its own, SVG transparent. The same bytes every time."""
    with matplotlib.rc_context({**STYLE, 'svg.hashsalt': spec.key}):
        figure = spec.draw(recording)
        if str(output).endswith('.png'):
            figure.savefig(output, dpi=100 if spec is OVERVIEW else 150, facecolor='white',
                           metadata={'Software': None})
        else:
            figure.savefig(output, format='svg', transparent=True,
                           metadata={'Date': None, 'Creator': None, 'Format': None, 'Type': None})


def inline(svg):
    """An SVG file as an element of an HTML page: no prolog, no names, the page's ink, coordinates to 0.01 pt."""
    svg = svg[svg.index('<svg'):]
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', '', svg)
    svg = re.sub(r'<g id="[^"]*"', '<g', svg)
    svg = re.sub(r'<[^>]*>', lambda tag: re.sub(r'(\d\.\d\d)\d+', r'\1', tag[0]), svg)
    return svg.replace(INK, 'currentColor')
