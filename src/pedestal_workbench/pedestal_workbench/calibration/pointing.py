"""`pedestal calibrate pointing`: the pointing model of a control unit from measured offsets.

The result is a table of the terms, rows for --json, a page with the residuals, and a ROS 2 parameter file with the
parameters acu.pointing.*. The file states where the model comes from: source, date and rms.
"""
import dataclasses
import datetime
import pathlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pedestal_common.geometry.pointing_report import residual_text
from pedestal_common.quantities import Ints, Json, Row
from pedestal_common.text_files.text_table import TextTable
from pedestal_recording import bag as bags
from pedestal_results.intervals import estimated, row
from pedestal_results.tracking import rms
from pedestal_workbench.calibration import (
    collect,
    distribution,
    exact,
    fit,
    offsets,
    output_files,
    pointing_page,
    terms,
)

CASE_NAME = 'pointing'  # case of the rows
FORMS = {'linear': fit.linear, 'exact': exact.exact}  # {form of the model: its fit}
EXACT_GAIN = 0.95  # ratio of the leave-one-out rms of both forms below which the exact form is chosen [-]
MAX_POINTS = 1000  # largest number of points from one recording
TERM_DECIMALS = 9  # decimals of the terms in a parameter file


@dataclasses.dataclass(frozen=True)
class Calibration:
    """Pointing model that was fitted to offsets."""
    offsets: offsets.Offsets
    fit: fit.Fit                # of the terms that were kept
    dropped: list[tuple[str, float, float]]     # (name, value, sigma) of the terms whose sigma exceeds their value
    outliers: Ints              # places of the outliers among the offsets, the largest first
    date: str                   # of the measurement, '' if unknown
    notes: tuple[str, ...]      # sentences on the choice of the form


def calibrate(measured: offsets.Offsets, names: Sequence[str], form: str = '', keep_all: bool = False,
              date: str = '') -> Calibration:
    """Return the Calibration of offsets with the terms `names`. Raises FitError.

    form       one of FORMS; '': linear, unless the exact form converges and has a leave-one-out rms below EXACT_GAIN
               of that of the linear form
    keep_all   keep the terms whose sigma exceeds their value
    date       replaces the date of the offsets
    """
    distribution.check(names, measured.directions)
    offsets_of = measured.directions, measured.values, measured.sigma
    notes: set[str] = set()

    def fitted(chosen: Sequence[str]) -> fit.Fit:
        if form:
            return FORMS[form](chosen, *offsets_of)
        found = fit.linear(chosen, *offsets_of)
        try:
            also = exact.exact(chosen, *offsets_of)
        except fit.FitError as error:
            notes.add(f'the linear form is taken: {error}')
            return found
        return also if rms(also.left_out) < EXACT_GAIN * rms(found.left_out) else found

    found, dropped = (fitted(names), []) if keep_all else fit.without_doubtful(names, fitted)
    outliers = found.outliers(measured.sigma)
    size = np.hypot(*(found.left_out[outliers] / measured.sigma[outliers]).T)
    return Calibration(measured, found, dropped, outliers[np.argsort(-size)], date or measured.date,
                       tuple(sorted(notes)))


def rows(found: Calibration) -> list[Row]:
    """Return the rows for --json: terms with their intervals, then the residuals."""
    count, fitted = len(found.offsets.places), found.fit
    half = fitted.interval * fitted.sigma
    of_terms = [estimated(CASE_NAME, name, (value, value - width, value + width), terms.TERM_BY_NAME[name].unit, count)
                for name, value, width in zip(fitted.names, fitted.values, half)]
    residuals = fitted.residuals
    measured: dict[str, ArrayLike] = {
        'raw_rms_deg': rms(found.offsets.values), 'residual_rms_deg': rms(residuals),
        'residual_cross_elevation_rms_deg': rms(residuals[:, 0]), 'residual_elevation_rms_deg': rms(residuals[:, 1]),
        'leave_one_out_rms_deg': rms(fitted.left_out),
        'model_error_deg': fit.model_error(fitted.names, fitted.covariance, found.offsets.directions)}
    return [*of_terms, *(row(CASE_NAME, name, value, 'deg') for name, value in measured.items()),
            row(CASE_NAME, 'condition', fitted.condition), row(CASE_NAME, 'points', count)]


def content(found: Calibration) -> dict[str, Json]:
    """Return the content of the --json file."""
    fitted = found.fit
    return {'name': 'calibrate pointing', 'rows': rows(found), 'source': found.offsets.source,
            'format': found.offsets.format, 'date': found.date, 'form': fitted.form, 'terms': list(fitted.names),
            'sigma': fitted.sigma.tolist(), 'correlation': fitted.correlation.tolist(),
            'dropped': [{'term': name, 'value': value, 'sigma': sigma} for name, value, sigma in found.dropped],
            'indistinct': [[*pair] for pair in fitted.correlated()],
            'outliers': [found.offsets.places[place] for place in found.outliers]}


def term_lines(found: Calibration) -> list[str]:
    """Return the lines of the table of the terms, with a title."""
    measured, fitted = found.offsets, found.fit
    half = fitted.interval * fitted.sigma
    rows = []
    for name, value, sigma, width in zip(fitted.names, fitted.values, fitted.sigma, half):
        term = terms.TERM_BY_NAME[name]
        rows.append((name, value, sigma, f'{value - width:.5f} to {value + width:.5f}', term.unit,
                     f'{term.meaning} ({term.tpoint} of TPOINT)'))
    table = TextTable((('term', '<5'), ('value', '>10.5f'), ('sigma', '>9.5f'), ('95 % interval', '<23'),
                       ('unit', '<4'), 'meaning'), rows)
    return [f'{len(measured.places)} offsets of {measured.source} ({measured.format})'
            f'{f" of {found.date}" if found.date else ""}, {fitted.form} form', '', *table.lines(), '']


def residual_lines(found: Calibration) -> list[str]:
    """Return the lines on the residuals."""
    known = {item['metric']: item['value'] for item in rows(found)}
    return [f'rms of the offsets      {known["raw_rms_deg"]:.5f} deg',
            f'rms of the residuals    {known["residual_rms_deg"]:.5f} deg (cross-elevation '
            f'{known["residual_cross_elevation_rms_deg"]:.5f}, elevation {known["residual_elevation_rms_deg"]:.5f})',
            f'leave-one-out rms       {known["leave_one_out_rms_deg"]:.5f} deg, expected of an offset in a new '
            'direction',
            f'error of the model      {known["model_error_deg"]:.5f} deg, from the noise of the offsets',
            f'condition               {known["condition"]:.4g}']


def remarks(found: Calibration) -> list[str]:
    """Return sentences on dropped terms, correlated terms, outliers, and offsets that are few or badly stated."""
    measured, fitted = found.offsets, found.fit
    said = [*measured.notes, *found.notes]
    if 'P12' in fitted.names:
        said.append('P12: the azimuths must state the turn of the wrap; 10 and 370 deg are different angles of '
                    'the encoder')
    said += [f'{name}: dropped, because its sigma {sigma:.2g} exceeds its value {value:.2g}'
            for name, value, sigma in found.dropped]
    said += [f'{first} and {second}: correlation {value:.2f}; the offsets hardly tell these terms apart, so only '
             'their common effect is certain' for first, second, value in fitted.correlated()]
    for place in found.outliers:
        az, el = measured.directions[place]
        said.append(f'outlier in {measured.places[place]}: azimuth {az:.3f}, elevation {el:.3f} deg is off '
                    f'the model of the other points by {fitted.left_out[place, 0]:.4f} deg in cross-elevation and '
                    f'{fitted.left_out[place, 1]:.4f} deg in elevation; check it, and remove it if it is wrong')
    if len(found.outliers) > 1:
        said.append('the largest outlier stands first; remove only this outlier and fit again, because it may make '
                    'good points look like outliers')
    if len(measured.places) < distribution.GOOD_POINTS:
        said.append(f'{len(measured.places)} points are few: {distribution.GOOD_POINTS} to 40 points all over the sky '
                    'are recommended')
    if measured.has_sigma and not 0.5 < fitted.scale < 2.0:
        said.append(f'the residuals are {fitted.scale:.2g} times the stated sigmas; the intervals follow the '
                    'residuals')
    return said


def parameters(found: Calibration, file: str, antenna: str = '') -> dict[str, Json]:
    """Return the parameters {name: value} of the control unit.

    file, antenna: names of the parameter file and of the antenna, which the control unit reports with the model
    """
    values = dict(zip(found.fit.names, found.fit.values))
    model = {name.lower(): round(float(values.get(name, 0.0)), TERM_DECIMALS) for name in terms.TERM_BY_NAME}
    stated = {'antenna': antenna, 'file': file, 'date': found.date,
              'rms': round(float(rms(found.fit.residuals)), TERM_DECIMALS),
              'residuals': residual_text(found.offsets.directions, found.fit.residuals)}
    return {f'pointing.{name}': value for name, value in {**model, **stated}.items()}


def collected(paths: Sequence[pathlib.Path], count: int | None) -> offsets.Offsets:
    """Return the offsets of recordings; count: points of each, None for the default. Raises ValueError."""
    parts, dates = [], []
    if count is not None and not 1 <= count <= MAX_POINTS:
        raise ValueError(f'--points {count}: must be 1 to {MAX_POINTS}')
    origins: dict[tuple[float, ...], pathlib.Path] = {}
    for path in paths:
        bag = bags.read(path, '')
        try:
            points = collect.every_point(bag, count or collect.DEFAULT_POINTS)
        except collect.CollectError as error:
            raise ValueError(f'--bag {path}: {error}') from None
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


def main(options: PointingOptions, files: output_files.ResultFiles) -> tuple[list[str], dict[str, Json]]:
    """Calibrate, write the files and return (lines to print, content for --json). Raises ValueError."""
    names = terms.chosen(options.terms) if options.terms is not None else terms.DEFAULT_TERMS
    today = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    date = offsets.valid_date(options.date, today) if options.date else ''
    measured = offsets.read(options.offsets, today) if options.offsets else collected(options.bag, options.points)
    if options.collected:
        options.collected.write_text(offsets.table(measured), encoding='utf-8')
    try:
        found = calibrate(measured, names, options.form or '', options.keep_all, date)
    except fit.FitError as error:
        raise ValueError(f'{options.offsets or measured.source}: {error}') from None
    notes, residuals = remarks(found), residual_lines(found)
    printed = [*term_lines(found), *residuals, *notes]
    values = parameters(found, files.output.name if files.output else '', options.antenna or '')
    printed += output_files.write(files, printed, {'acu': values},
                                  lambda: pointing_page.page(found, residuals, notes, files.command))
    return printed, content(found)
