"""`pedestal calibrate sensitivity`: beamwidth and squint, and with the flux of the source G/T."""
import dataclasses
import math
import pathlib
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from pedestal_common.quantities import Decibels, Degrees, Hertz, Json, Pair, Row
from pedestal_recording import bag as bags
from pedestal_results.intervals import estimated, row
from pedestal_results.report.figures import FILTERED_COLOUR, RAW_COLOUR, Spec, new_panels
from pedestal_workbench.calibration.calibration import Calibration, named
from pedestal_workbench.calibration.sensitivity import beam, levels

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

    def check(self) -> None:
        """Raise ValueError for an option out of its range, and for a flux without a frequency."""
        for name, (low, high, unit) in OPTION_RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f'--{name} {value:g}: must be {low:g} to {high:g} {unit}')
        if (self.flux is None) != (self.frequency is None):
            raise ValueError('--flux and --frequency: G/T needs both')


@dataclasses.dataclass(frozen=True)
class Sensitivity(Calibration):
    """Result of a beam cut."""
    STEP = 'sensitivity'

    levels: levels.Levels
    beam: beam.Beam
    diameter: Degrees   # of the source
    null: Pair | None   # offset at which the errors of the receiver are 0 [deg]
    ratio: float        # (Y - 1) L [-], NaN if unknown
    g_over_t: float     # G/T [dB/K], NaN without a flux

    def rows(self) -> list[Row]:
        """Return beamwidth, peak, squint, Y factor and G/T, as far as they are known."""
        fitted, count = self.beam, int(self.beam.used.sum())

        def with_interval(name: str, value: float, half: float, unit: str) -> Row:
            return estimated(self.STEP, name, (value, value - half, value + half), unit, count)

        # The relative interval of the amplitude as one in dB.
        half_db = 10.0 * math.log10(1.0 + fitted.half['amplitude'])
        listed = [with_interval(f'beamwidth_{axis}_deg', value, fitted.half[f'beamwidth_{key}'], 'deg')
                  for axis, key, value in zip(('cross_elevation', 'elevation'), 'xy', fitted.width)]
        listed += [with_interval(f'peak_{axis}_deg', value, fitted.half[f'squint_{key}'], 'deg')
                   for axis, key, value in zip(('cross_elevation', 'elevation'), 'xy', fitted.place)]
        if self.null is not None:
            listed += [row(self.STEP, f'squint_{axis}_deg', value, 'deg')
                       for axis, value in zip(('cross_elevation', 'elevation'), fitted.place - self.null)]
        if math.isfinite(self.ratio):
            listed += [row(self.STEP, 'y_factor_db', 10.0 * math.log10(1.0 + self.ratio / fitted.correction), 'dB'),
                       row(self.STEP, 'size_correction_db', 10.0 * math.log10(fitted.correction), 'dB')]
        if math.isfinite(self.g_over_t):
            listed.append(with_interval('g_over_t_db_k', self.g_over_t, half_db, 'dB/K'))
        return [*listed, row(self.STEP, 'residual_percent', 100.0 * fitted.residual, '%'),
                row(self.STEP, 'levels', count)]

    def details(self) -> dict[str, Json]:
        """Return the parameters of the --json file."""
        return {'parameters': self.parameters()}

    def lines(self) -> list[str]:
        """Return a line for each known property."""
        fitted, (b_x, b_y), (x, y) = self.beam, self.beam.width, self.beam.place
        half = fitted.half
        said = [f'{len(self.levels.power)} levels of {self.source}, {fitted.used.sum()} fitted, source of '
                f'{self.diameter:g} deg', '',
                f'beamwidth   cross-elevation {b_x:.4f} +- {half["beamwidth_x"]:.4f} deg, elevation {b_y:.4f} +- '
                f'{half["beamwidth_y"]:.4f} deg',
                f'peak        cross-elevation {x:.4f} +- {half["squint_x"]:.4f} deg, elevation {y:.4f} +- '
                f'{half["squint_y"]:.4f} deg off the source']
        if self.null is not None:
            squint = fitted.place - self.null
            said.append(f'squint      cross-elevation {squint[0]:.4f} deg, elevation {squint[1]:.4f} deg, from the '
                        'null of the errors to the peak')
        if math.isfinite(self.ratio):
            said.append(f'Y factor    {10.0 * math.log10(1.0 + self.ratio / fitted.correction):.2f} dB on the source')
            classic = 10.0 * math.log10(1.0 + 0.38 * (self.diameter**2 / (b_x * b_y)))
            said.append(f'size        correction {10.0 * math.log10(fitted.correction):.2f} dB (ITU-R S.733 for a '
                        f'source below the beamwidth: {classic:.2f} dB)')
        if math.isfinite(self.g_over_t):
            said.append(f'G/T         {self.g_over_t:.2f} +- {10.0 * math.log10(1.0 + half["amplitude"]):.2f} dB/K')
        said.append(f'residuals   {100.0 * fitted.residual:.2f} % rms of the power')
        return said

    def parameters(self) -> dict[str, dict[str, Json]]:
        """Return the beamwidth, for control unit and simulated receiver. The peak off the source is an error of the
        pointing, which the pointing model corrects."""
        width = round(math.radians(math.sqrt(float(np.prod(self.beam.width)))), 8)
        return {'acu': {'tracker.receiver.beamwidth': width}, 'tracking_receiver': {'antenna.beamwidth': width}}

    def cuts(self) -> Figure:
        """Draw the levels over both offsets from the peak, and the fitted cuts."""
        figure, panels = new_panels(1, 2, height=3.0, x=('cross-elevation from the peak [deg]',
                                                        'elevation from the peak [deg]'), y='level over the peak [dB]')
        fitted = self.beam
        points, off = beam.disk(self.diameter), self.levels.offsets - fitted.place
        top = fitted.floor + fitted.peak
        measured = 10.0 * np.log10(self.levels.power / top)
        for i, axes in enumerate(panels.flat):
            along = np.linspace(off[:, i].min(), off[:, i].max(), 200)
            place = np.zeros((200, 2))
            place[:, i] = along
            power = fitted.floor + fitted.amplitude * beam.pattern(place, np.zeros(2), fitted.width, points)
            near = np.abs(off[:, 1 - i]) < 0.25 * fitted.width[1 - i]
            axes.plot(off[near, i], measured[near], 'o', color=RAW_COLOUR, markersize=4)
            axes.plot(along, 10.0 * np.log10(np.maximum(power / top, 1e-4)), color=FILTERED_COLOUR)
            axes.set_ylim(min(float(measured.min()), -10.0) - 1.0, 1.0)
        return figure

    FIGURES: ClassVar = (
        Spec('cuts', 'Cuts through the beam', 'Points: levels within a quarter of a beamwidth of each cut. Lines: '
             'Gaussian beam, convolved with the disk of the source.', (), cuts),)


def _diameter_of_source(measured: levels.Levels, options: SensitivityOptions) -> Degrees:
    """Return the diameter of the options, of the sun with a flux, or of the recording. Raises ValueError."""
    if options.diameter is not None:
        return options.diameter
    if options.flux:
        return SUN_DIAMETER_DEG
    if math.isnan(measured.diameter):
        raise ValueError('--diameter: is needed without --flux: 0 deg for a beacon or a star, '
                         f'{SUN_DIAMETER_DEG:g} deg for the sun or the moon')
    return measured.diameter


def calibrate(measured: levels.Levels, options: SensitivityOptions) -> Sensitivity:
    """Return the result of levels. Raises CalibrationError and ValueError."""
    diameter = _diameter_of_source(measured, options)
    found = beam.fit(measured, diameter)
    scale = found.floor
    if measured.of_source:
        scale = options.bandwidth if options.bandwidth is not None else measured.bandwidth
        if options.flux and not math.isfinite(scale):
            raise ValueError('--bandwidth: is needed with --flux, because the recording states no noise bandwidth')
    ratio = found.amplitude / scale
    g_over_t = beam.g_over_t_db(ratio, options.flux, 1e9 * options.frequency,
                                options.attenuation or 0.0) if options.flux and options.frequency else math.nan
    null = beam.null(measured, found.place, found.width)
    return Sensitivity(measured.source, measured, found, diameter, null, ratio, g_over_t)


def calibrated(source: pathlib.Path, recorded: bool, options: SensitivityOptions) -> Sensitivity:
    """Return the calibration by a CSV file of levels or, if `recorded` is True, by the recording of a scan. Raises
    ValueError."""
    options.check()
    with named(source):
        measured = (levels.of_recording(bags.read(source, ''), str(source)) if recorded else
                    levels.read(source, options.elevation))
        return calibrate(measured, options)
