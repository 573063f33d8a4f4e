"""`pedestal calibrate pointing`: the pointing model of a control unit from measured offsets."""
import dataclasses
import datetime
import pathlib
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from numpy.typing import ArrayLike

from pedestal_common.geometry.pointing_report import residual_text
from pedestal_common.quantities import Degrees, Ints, Json, Pairs, Row
from pedestal_common.text_files.text_table import Cell, TextTable
from pedestal_recording import bag as bags
from pedestal_results.intervals import estimated, row
from pedestal_results.report.figures import FILTERED_COLOUR, INK_COLOUR, RAW_COLOUR, TRUTH_COLOUR, Spec, new_panels
from pedestal_results.tracking import rms
from pedestal_workbench.calibration import collect, fit, offsets, terms
from pedestal_workbench.calibration.calibration import Calibration, CalibrationError, named

FORMS = {'linear': fit.linear, 'exact': fit.exact}  # {form of the model: its fit}
EXACT_GAIN = 0.95  # ratio of the leave-one-out rms of both forms below which the exact form is chosen [-]
MAX_POINTS = 1000  # largest number of points from one recording
TERM_DECIMALS = 9  # decimals of the terms in a parameter file
ARROW_LENGTH_DEG = 12.0  # length on the plot of the arrow whose residual is stated as its scale [deg of elevation]


def _sky(axes: PolarAxes) -> None:
    """Prepare polar axes as a view of the sky from below: north above, east to the right, the zenith in the middle."""
    axes.set_theta_zero_location('N')
    axes.set_theta_direction(-1)
    axes.set_rlim(0.0, 90.0)
    axes.set_rgrids((0.0, 30.0, 60.0), ('90', '60', '30'), fontsize=7)


def _arrows(axes: PolarAxes, directions: Pairs, vectors: Pairs, scale: Degrees, colour: str) -> None:
    """Draw arrows for vectors [deg] in cross-elevation and elevation at directions [deg]. scale: size of the vector
    whose arrow has the length ARROW_LENGTH_DEG"""
    az, el = np.radians(directions).T
    radius = 90.0 - directions[:, 1]
    # East and north on the plane of the plot: cross-elevation points along the azimuth, elevation to the middle.
    across = np.column_stack((np.cos(az), -np.sin(az)))
    upward = np.column_stack((-np.sin(az), -np.cos(az)))
    start = np.column_stack((radius * np.sin(az), radius * np.cos(az)))
    step = ARROW_LENGTH_DEG / scale * (vectors[:, :1] * across + vectors[:, 1:] * upward)
    for (x, y), (dx, dy) in zip(start, step):
        end = np.arctan2(x + dx, y + dy), np.hypot(x + dx, y + dy)
        axes.annotate('', xy=end, xytext=(np.arctan2(x, y), np.hypot(x, y)),
                      arrowprops={'arrowstyle': '->', 'color': colour, 'linewidth': 0.9, 'shrinkA': 0, 'shrinkB': 0})
    axes.plot(az, radius, '.', color=INK_COLOUR, markersize=3)


@dataclasses.dataclass(frozen=True)
class PointingCalibration(Calibration):
    """Pointing model that was fitted to offsets."""
    STEP = 'pointing'

    offsets: offsets.Offsets
    fit: fit.Fit                # of the terms that were kept
    dropped: list[tuple[str, float, float]]     # (name, value, sigma) of the terms whose sigma exceeds their value
    outliers: Ints              # places of the outliers among the offsets, the largest first
    date: str                   # of the measurement, '' if unknown
    notes: tuple[str, ...]      # sentences on the choice of the form
    antenna: str = ''           # its name, which the control unit reports with the model
    file: str = ''              # name of the parameter file, which the control unit reports too

    def rows(self) -> list[Row]:
        """Return the terms with their intervals, then the residuals."""
        count, fitted = len(self.offsets.places), self.fit
        half = fitted.interval * fitted.sigma
        of_terms = [estimated(self.STEP, name, (value, value - width, value + width), terms.TERM_BY_NAME[name].unit,
                              count) for name, value, width in zip(fitted.names, fitted.values, half)]
        residuals = fitted.residuals
        measured: dict[str, ArrayLike] = {
            'raw_rms_deg': rms(self.offsets.values), 'residual_rms_deg': rms(residuals),
            'residual_cross_elevation_rms_deg': rms(residuals[:, 0]),
            'residual_elevation_rms_deg': rms(residuals[:, 1]), 'leave_one_out_rms_deg': rms(fitted.left_out),
            'model_error_deg': fit.model_error(fitted.names, fitted.covariance, self.offsets.directions)}
        return [*of_terms, *(row(self.STEP, name, value, 'deg') for name, value in measured.items()),
                row(self.STEP, 'condition', fitted.condition), row(self.STEP, 'points', count)]

    def details(self) -> dict[str, Json]:
        """Return the fit of the --json file."""
        fitted = self.fit
        return {'format': self.offsets.format, 'date': self.date, 'form': fitted.form, 'terms': list(fitted.names),
                'sigma': fitted.sigma.tolist(), 'correlation': fitted.correlation.tolist(),
                'dropped': [{'term': name, 'value': value, 'sigma': sigma} for name, value, sigma in self.dropped],
                'indistinct': [[*pair] for pair in fitted.correlated()],
                'outliers': [self.offsets.places[place] for place in self.outliers]}

    def lines(self) -> list[str]:
        """Return the table of the terms with a title, the residuals and the remarks."""
        measured, fitted = self.offsets, self.fit
        half = fitted.interval * fitted.sigma
        cells: list[Sequence[Cell]] = []
        for name, value, sigma, width in zip(fitted.names, fitted.values, fitted.sigma, half):
            term = terms.TERM_BY_NAME[name]
            cells.append((name, value, sigma, f'{value - width:.5f} to {value + width:.5f}', term.unit,
                          f'{term.meaning} ({term.tpoint} of TPOINT)'))
        table = TextTable((('term', '<5'), ('value', '>10.5f'), ('sigma', '>9.5f'), ('95 % interval', '<23'),
                           ('unit', '<4'), 'meaning'), cells)
        known = {item['metric']: item['value'] for item in self.rows()}
        return [
            f'{len(measured.places)} offsets of {measured.source} ({measured.format})'
            f'{f" of {self.date}" if self.date else ""}, {fitted.form} form', '', *table.lines(), '',
            f'rms of the offsets      {known["raw_rms_deg"]:.5f} deg',
            f'rms of the residuals    {known["residual_rms_deg"]:.5f} deg (cross-elevation '
            f'{known["residual_cross_elevation_rms_deg"]:.5f}, elevation {known["residual_elevation_rms_deg"]:.5f})',
            f'leave-one-out rms       {known["leave_one_out_rms_deg"]:.5f} deg, expected of an offset in a new '
            'direction',
            f'error of the model      {known["model_error_deg"]:.5f} deg, from the noise of the offsets',
            f'condition               {known["condition"]:.4g}', *self.remarks()]

    def remarks(self) -> list[str]:
        """Return sentences on dropped terms, correlated terms, outliers, and offsets that are few or badly stated."""
        measured, fitted = self.offsets, self.fit
        said = [*measured.notes, *self.notes]
        if 'P12' in fitted.names:
            said.append('P12: the azimuths must state the turn of the wrap; 10 and 370 deg are different angles of '
                        'the encoder')
        said += [f'{name}: dropped, because its sigma {sigma:.2g} exceeds its value {value:.2g}'
                 for name, value, sigma in self.dropped]
        said += [f'{first} and {second}: correlation {value:.2f}; the offsets hardly tell these terms apart, so only '
                 'their common effect is certain' for first, second, value in fitted.correlated()]
        for place in self.outliers:
            az, el = measured.directions[place]
            said.append(f'outlier in {measured.places[place]}: azimuth {az:.3f}, elevation {el:.3f} deg is off '
                        f'the model of the other points by {fitted.left_out[place, 0]:.4f} deg in cross-elevation and '
                        f'{fitted.left_out[place, 1]:.4f} deg in elevation; check it, and remove it if it is wrong')
        if len(self.outliers) > 1:
            said.append('the largest outlier stands first; remove only this outlier and fit again, because it may '
                        'make good points look like outliers')
        if len(measured.places) < fit.GOOD_POINTS:
            said.append(f'{len(measured.places)} points are few: {fit.GOOD_POINTS} to 40 points all over the sky '
                        'are recommended')
        if measured.has_sigma and not 0.5 < fitted.scale < 2.0:
            said.append(f'the residuals are {fitted.scale:.2g} times the stated sigmas; the intervals follow the '
                        'residuals')
        return said

    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return the model for the control unit, with its origin."""
        values = dict(zip(self.fit.names, self.fit.values))
        model = {name.lower(): round(float(values.get(name, 0.0)), TERM_DECIMALS) for name in terms.TERM_BY_NAME}
        stated = {'antenna': self.antenna, 'file': self.file, 'date': self.date,
                  'rms': round(float(rms(self.fit.residuals)), TERM_DECIMALS),
                  'residuals': residual_text(self.offsets.directions, self.fit.residuals)}
        return {'acu': {f'pointing.{name}': value for name, value in {**model, **stated}.items()}}

    def sky_plot(self) -> Figure:
        """Draw the directions on the sky; the colour is the size of offset and residual."""
        figure, panels = new_panels(1, 2, height=3.9, x='', subplot_kw={'projection': 'polar'})
        az, el = np.radians(self.offsets.directions).T
        for axes, vectors, title in zip(panels.flat, (self.offsets.values, self.fit.residuals),
                                        ('offsets', 'residuals')):
            _sky(axes)
            size = np.hypot(*vectors.T)
            marks = axes.scatter(az, np.degrees(0.5 * np.pi - el), c=size, cmap='viridis', s=22)
            figure.colorbar(marks, ax=axes, label=f'{title} [deg]', shrink=0.7)
            axes.plot(az[self.outliers], np.degrees(0.5 * np.pi - el[self.outliers]), 'o', color=TRUTH_COLOUR,
                      markersize=10, fillstyle='none')
        return figure

    def arrow_plot(self) -> Figure:
        """Draw the offsets and the residuals as arrows, each with its own scale."""
        figure, panels = new_panels(1, 2, height=4.1, x='', subplot_kw={'projection': 'polar'})
        for axes, vectors, colour, title in zip(panels.flat, (self.offsets.values, self.fit.residuals),
                                                (RAW_COLOUR, FILTERED_COLOUR), ('offsets', 'residuals')):
            _sky(axes)
            scale = max(float(np.hypot(*vectors.T).max()), 1e-12)
            _arrows(axes, self.offsets.directions, vectors, scale, colour)
            axes.set_title(f'{title}; longest arrow {scale:.4g} deg', fontsize=9)
        return figure

    def by_angle(self) -> Figure:
        """Draw the residuals of both axes over azimuth and elevation."""
        figure, panels = new_panels(2, 2, y=('cross-elevation [deg]', 'elevation [deg]'),
                                    x=('azimuth [deg]', 'elevation [deg]'))
        for axis in range(2):
            for angle in range(2):
                axes = panels[axis, angle]
                at, values = self.offsets.directions[:, angle], self.fit.residuals[:, axis]
                axes.plot(at, values, '.', color=FILTERED_COLOUR, markersize=4)
                axes.plot(at[self.outliers], values[self.outliers], 'o', color=TRUTH_COLOUR, fillstyle='none')
                axes.axhline(0.0, color=INK_COLOUR, linewidth=0.7)
                axes.margins(0.04)
        return figure

    FIGURES: ClassVar = (
        Spec('sky', 'Offsets and residuals on the sky', 'North is above, east to the right, the zenith in the middle. '
             'The colour is the size on the sky. Orange circles: outliers.', (), sky_plot),
        Spec('arrows', 'Offsets and residuals as arrows', 'The direction of an arrow is that on the sky. A pattern in '
             'the residuals is an effect that the terms do not describe.', (), arrow_plot),
        Spec('angles', 'Residuals over azimuth and elevation', 'Residuals of both axes. Orange circles: outliers.',
             (), by_angle))

    def tables(self) -> dict[str, TextTable]:
        """Return the correlation of the terms, and the points."""
        fitted, measured = self.fit, self.offsets
        correlation = [[name, *(f'{value:.2f}' for value in values)]
                       for name, values in zip(fitted.names, fitted.correlation)]
        numbers = np.hstack((measured.directions, measured.values, fitted.residuals, fitted.left_out))
        points = [[place, *(f'{value:.4f}' for value in values)] for place, values in zip(measured.places, numbers)]
        return {'Correlation of the terms': TextTable(('', *fitted.names), correlation),
                'Points': TextTable(('place', 'azimuth', 'elevation', 'xel offset', 'el offset', 'xel residual',
                                     'el residual', 'xel left out', 'el left out'), points)}


def calibrate(measured: offsets.Offsets, names: Sequence[str], form: str = '', keep_all: bool = False,
              date: str = '') -> PointingCalibration:
    """Return the calibration by offsets with the terms `names`. Raises CalibrationError.

    form       one of FORMS; '': linear, unless the exact form converges and has a leave-one-out rms below EXACT_GAIN
               of that of the linear form
    keep_all   keep the terms whose sigma exceeds their value
    date       replaces the date of the offsets
    """
    fit.check_distribution(names, measured.directions)
    offsets_of = measured.directions, measured.values, measured.sigma
    notes: set[str] = set()

    def fitted(chosen: Sequence[str]) -> fit.Fit:
        if form:
            return FORMS[form](chosen, *offsets_of)
        found = fit.linear(chosen, *offsets_of)
        try:
            also = fit.exact(chosen, *offsets_of)
        except CalibrationError as error:
            notes.add(f'the linear form is taken: {error}')
            return found
        return also if rms(also.left_out) < EXACT_GAIN * rms(found.left_out) else found

    found, dropped = (fitted(names), []) if keep_all else fit.without_doubtful(names, fitted)
    outliers = found.outliers(measured.sigma)
    size = np.hypot(*(found.left_out[outliers] / measured.sigma[outliers]).T)
    return PointingCalibration(measured.source, measured, found, dropped, outliers[np.argsort(-size)],
                               date or measured.date, tuple(sorted(notes)))


def collected(paths: Sequence[pathlib.Path], count: int | None) -> offsets.Offsets:
    """Return the offsets of recordings; count: points of each, None for the default. Raises ValueError."""
    parts, dates = [], []
    if count is not None and not 1 <= count <= MAX_POINTS:
        raise ValueError(f'--points {count}: must be 1 to {MAX_POINTS}')
    origins: dict[tuple[float, ...], pathlib.Path] = {}
    for path in paths:
        bag = bags.read(path, '')
        with named(f'--bag {path}'):
            points = collect.every_point(bag, count or collect.DEFAULT_POINTS)
        first = origins.setdefault((*points[0][2], *points[0][3]), path)
        if first is not path:
            raise ValueError(f'--bag {path}: has the same offsets as {first}; each recording must be given once')
        parts.append((path.name, points))
        # In lockstep the time of a recording begins at 0 and states no date.
        dates += [np.datetime64(int(bag.start), 'ns').astype('datetime64[D]').item().isoformat()] if bag.start else []
    joined = collect.joined(parts, ', '.join(path.name for path in paths))
    return joined._replace(date=max(dates, default=''))


@dataclasses.dataclass(frozen=True)
class PointingOptions:
    """Measured offsets and their fit."""
    offsets: pathlib.Path | None        # file of measured offsets
    bag: list[pathlib.Path]             # recordings of passes, in place of offsets
    points: int | None                  # number of offsets from each recording; None: the default
    collected: pathlib.Path | None      # new file of the offsets that were read
    terms: str | None                   # terms to fit, such as P1,P3; None: the default
    form: str | None                    # linear or exact; None: the better one
    keep_all: bool                      # no drop of terms whose sigma exceeds their value
    date: str | None                    # of the measurement
    antenna: str | None                 # its name
    output: pathlib.Path | None         # parameter file, whose name the model states


def calibrated(options: PointingOptions) -> PointingCalibration:
    """Return the calibration by the offsets of the options. Raises ValueError."""
    names = terms.chosen(options.terms) if options.terms is not None else terms.DEFAULT_TERMS
    today = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    date = offsets.valid_date(options.date, today) if options.date else ''
    measured = offsets.read(options.offsets, today) if options.offsets else collected(options.bag, options.points)
    if options.collected:
        options.collected.write_text(offsets.table(measured), encoding='utf-8')
    with named(options.offsets or measured.source):
        found = calibrate(measured, names, options.form or '', options.keep_all, date)
    return dataclasses.replace(found, antenna=options.antenna or '',
                               file=options.output.name if options.output else '')
