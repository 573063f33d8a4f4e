"""`pedestal calibrate sensitivity`: beamwidth and squint, and with the flux of the source G/T."""
import dataclasses
import math
import pathlib

import numpy as np

from pedestal_common.quantities import Decibels, Degrees, Hertz, Json, Pair, Row
from pedestal_recording import bag as bags
from pedestal_results.intervals import estimated, row
from pedestal_workbench.calibration import output_files
from pedestal_workbench.calibration.sensitivity import beam, levels, sensitivity_page

CASE_NAME = 'sensitivity'  # case of the rows
SUN_DIAMETER_DEG = 0.53  # diameter of the sun at radio frequencies above 3 GHz [deg]
OPTION_RANGES = {'flux': (1.0, 1e6, 'sfu'), 'frequency': (0.1, 300.0, 'GHz'), 'diameter': (0.0, 5.0, 'deg'),
                 'bandwidth': (1e3, 1e11, 'Hz'), 'attenuation': (0.0, 20.0, 'dB'), 'elevation': (0.0, 89.0, 'deg')}
"""{option: (low, high, unit)}."""


@dataclasses.dataclass(frozen=True)
class SensitivityOptions:
    """Properties of the source and of the receiver. None: the default."""
    flux: float | None = None               # flux density of the source [sfu]; None: no G/T
    frequency: float | None = None          # of the receiver [GHz]
    diameter: Degrees | None = None         # of the source
    bandwidth: Hertz | None = None          # noise bandwidth of the receiver in a recording
    attenuation: Decibels | None = None     # by the atmosphere towards the source
    elevation: Degrees | None = None        # of the source, for offsets in azimuth


@dataclasses.dataclass(frozen=True)
class Sensitivity:
    """Result of a beam cut."""
    levels: levels.Levels
    beam: beam.Beam
    diameter: Degrees   # of the source
    null: Pair | None   # offset at which the errors of the receiver are 0 [deg]
    ratio: float        # (Y - 1) L [-], NaN if unknown
    g_over_t: float     # G/T [dB/K], NaN without a flux


def diameter_of_source(measured: levels.Levels, options: SensitivityOptions) -> Degrees:
    """Return the diameter of the source of levels: that of the options, of the sun with a flux, or that which the
    recording states. Raises ValueError without any of them."""
    if options.diameter is not None:
        return options.diameter
    if options.flux:
        return SUN_DIAMETER_DEG
    if math.isnan(measured.diameter):
        raise ValueError('--diameter: is needed without --flux: 0 deg for a beacon or a star, '
                         f'{SUN_DIAMETER_DEG:g} deg for the sun or the moon')
    return measured.diameter


def calibrate(measured: levels.Levels, options: SensitivityOptions) -> Sensitivity:
    """Return the result of levels. Raises LevelError and ValueError."""
    diameter = diameter_of_source(measured, options)
    found = beam.fit(measured, diameter)
    scale = found.floor
    if measured.of_source:
        scale = options.bandwidth if options.bandwidth is not None else measured.bandwidth
        if options.flux and not math.isfinite(scale):
            raise ValueError('--bandwidth: is needed with --flux, because the recording states no noise bandwidth')
    ratio = found.amplitude / scale
    g_over_t = beam.g_over_t_db(ratio, options.flux, 1e9 * options.frequency,
                                options.attenuation or 0.0) if options.flux and options.frequency else math.nan
    return Sensitivity(measured, found, diameter, beam.null(measured, found.place, found.width), ratio, g_over_t)


def rows(found: Sensitivity) -> list[Row]:
    """Return the rows for --json."""
    fitted, count = found.beam, int(found.beam.used.sum())

    def with_interval(name: str, value: float, half: float, unit: str) -> Row:
        return estimated(CASE_NAME, name, (value, value - half, value + half), unit, count)

    # The relative interval of the amplitude as one in dB.
    half_db = 10.0 * math.log10(1.0 + fitted.half['amplitude'])
    listed = [with_interval(f'beamwidth_{axis}_deg', value, fitted.half[f'beamwidth_{key}'], 'deg')
              for axis, key, value in zip(('cross_elevation', 'elevation'), 'xy', fitted.width)]
    listed += [with_interval(f'peak_{axis}_deg', value, fitted.half[f'squint_{key}'], 'deg')
               for axis, key, value in zip(('cross_elevation', 'elevation'), 'xy', fitted.place)]
    if found.null is not None:
        listed += [row(CASE_NAME, f'squint_{axis}_deg', value, 'deg')
                   for axis, value in zip(('cross_elevation', 'elevation'), fitted.place - found.null)]
    if math.isfinite(found.ratio):
        listed += [row(CASE_NAME, 'y_factor_db', 10.0 * math.log10(1.0 + found.ratio / fitted.correction), 'dB'),
                   row(CASE_NAME, 'size_correction_db', 10.0 * math.log10(fitted.correction), 'dB')]
    if math.isfinite(found.g_over_t):
        listed.append(with_interval('g_over_t_db_k', found.g_over_t, half_db, 'dB/K'))
    return [*listed, row(CASE_NAME, 'residual_percent', 100.0 * fitted.residual, '%'),
            row(CASE_NAME, 'levels', count)]


def lines(found: Sensitivity) -> list[str]:
    """Return the printed lines."""
    fitted, (b_x, b_y), (x, y) = found.beam, found.beam.width, found.beam.place
    half = fitted.half
    said = [f'{len(found.levels.power)} levels of {found.levels.source}, {fitted.used.sum()} fitted, source of '
            f'{found.diameter:g} deg', '',
            f'beamwidth   cross-elevation {b_x:.4f} +- {half["beamwidth_x"]:.4f} deg, elevation {b_y:.4f} +- '
            f'{half["beamwidth_y"]:.4f} deg',
            f'peak        cross-elevation {x:.4f} +- {half["squint_x"]:.4f} deg, elevation {y:.4f} +- '
            f'{half["squint_y"]:.4f} deg off the source']
    if found.null is not None:
        squint = fitted.place - found.null
        said.append(f'squint      cross-elevation {squint[0]:.4f} deg, elevation {squint[1]:.4f} deg, from the '
                    'null of the errors to the peak')
    if math.isfinite(found.ratio):
        said.append(f'Y factor    {10.0 * math.log10(1.0 + found.ratio / fitted.correction):.2f} dB on the source')
        classic = 10.0 * math.log10(1.0 + 0.38 * (found.diameter**2 / (b_x * b_y)))
        said.append(f'size        correction {10.0 * math.log10(fitted.correction):.2f} dB (ITU-R S.733 for a '
                    f'source below the beamwidth: {classic:.2f} dB)')
    if math.isfinite(found.g_over_t):
        said.append(f'G/T         {found.g_over_t:.2f} +- {10.0 * math.log10(1.0 + half["amplitude"]):.2f} dB/K')
    said.append(f'residuals   {100.0 * fitted.residual:.2f} % rms of the power')
    return said


def parameters(found: Sensitivity) -> dict[str, dict[str, float]]:
    """Return {node: {parameter: value}}: the beamwidth, for control unit and simulated receiver.

    The peak off the source is an error of the pointing, which the pointing model corrects.
    """
    width = round(math.radians(math.sqrt(float(np.prod(found.beam.width)))), 8)
    return {'acu': {'tracker.receiver.beamwidth': width}, 'tracking_receiver': {'antenna.beamwidth': width}}


def check_options(options: SensitivityOptions) -> None:
    """Raise ValueError for an option out of its range, and for a flux without a frequency."""
    for name, (low, high, unit) in OPTION_RANGES.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise ValueError(f'--{name} {value:g}: must be {low:g} to {high:g} {unit}')
    if (options.flux is None) != (options.frequency is None):
        raise ValueError('--flux and --frequency: G/T needs both')


def main(source: pathlib.Path, recorded: bool, options: SensitivityOptions,
         files: output_files.ResultFiles) -> tuple[list[str], dict[str, Json]]:
    """Calibrate, write the files and return (lines, content). Raises ValueError.

    source: CSV file of offsets and levels, or if `recorded` is True, recording of a scan.
    """
    check_options(options)
    try:
        measured = (levels.of_recording(bags.read(source, ''), str(source)) if recorded else
                    levels.read(source, options.elevation))
        found = calibrate(measured, options)
    except levels.LevelError as error:
        raise ValueError(f'{source}: {error}') from None
    printed = lines(found)
    printed += output_files.write(files, printed, parameters(found),
                                  lambda: sensitivity_page.page(found, lines(found), files.command))
    return printed, {'name': 'calibrate sensitivity', 'rows': rows(found), 'source': measured.source,
                     'parameters': parameters(found)}
