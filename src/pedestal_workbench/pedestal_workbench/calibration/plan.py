"""Plan of directions in which pointing offsets are measured: spread over the sky, within the travel of the axes."""
import math
import pathlib

import numpy as np

from pedestal_bringup.scenario import scenario
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Degrees, Pairs
from pedestal_workbench.calibration import fit, terms

MAX_POINTS = 500  # largest number of directions of a plan
TRAVEL_RANGE_DEG = (-270.0, 270.0)  # travel of the azimuth axis without a scenario [deg]
PLAN_ELEVATION_RANGE_DEG = (10.0, 80.0)
"""Elevations of a plan [deg]. Below, the refraction changes from day to day; above, the azimuth has little effect."""
EDGE_DEG = 2.0  # distance of the directions from the ends of the travel [deg]

_GOLDEN_RATIO = 0.5 * (1.0 + 5.0**0.5)


def directions(count: int, azimuths: tuple[Degrees, Degrees] = TRAVEL_RANGE_DEG,
               elevations: tuple[Degrees, Degrees] = PLAN_ELEVATION_RANGE_DEG) -> Pairs:
    """Return encoder directions [deg] in the order of a slew along the azimuth travel. Raises ValueError.

    They are a lattice of the golden ratio over the travel of both axes. A travel of more than a turn is covered as a
    whole, so a part of the sky is measured in both turns of the wrap.
    """
    if not fit.MIN_POINTS <= count <= MAX_POINTS:
        raise ValueError(f'--plan {count}: must be {fit.MIN_POINTS} to {MAX_POINTS}')
    low, high = azimuths[0] + EDGE_DEG, azimuths[1] - EDGE_DEG
    lowest, highest = (float(np.clip(edge, elevations[0] + EDGE_DEG, elevations[1] - EDGE_DEG))
                       for edge in PLAN_ELEVATION_RANGE_DEG)
    if (high - low < 360.0 - fit.MAX_AZIMUTH_GAP_DEG
            or highest - lowest < fit.MIN_ELEVATION_SPAN_DEG):
        raise ValueError(f'--plan {count}: the travel, azimuth {azimuths[0]:.4g} to {azimuths[1]:.4g} deg and '
                         f'elevation {elevations[0]:.4g} to {elevations[1]:.4g} deg, is too small for a model')
    i = np.arange(count)
    azimuth = low + (high - low) * (i + 0.5) / count
    elevation = lowest + (highest - lowest) * np.mod((i + 0.5) * _GOLDEN_RATIO, 1.0)
    return np.column_stack((azimuth, elevation))


def noise_gain(planned: Pairs) -> float:
    """Return the rms error of the default model over the sky of a plan, divided by the noise of one offset [-]."""
    az, el = np.meshgrid(np.arange(0.0, 360.0, 10.0), np.linspace(*PLAN_ELEVATION_RANGE_DEG, 15))
    sky = np.column_stack((az.ravel(), el.ravel()))
    return fit.model_error(terms.DEFAULT_TERMS, fit.unit_covariance(terms.DEFAULT_TERMS, planned), sky)


def travel(name: str) -> tuple[tuple[Degrees, Degrees], tuple[Degrees, Degrees]]:
    """Return the range of azimuth and of elevation of the drive of a scenario. Raises ValueError."""
    drive = scenario.load(name).node_parameters('adu')
    if not hasattr(drive, AXES[0]):
        raise ValueError(f'--scenario {name}: must have a drive with motors')
    azimuth, elevation = ((math.degrees(axis.limits.lower), math.degrees(axis.limits.upper))
                          for axis in (getattr(drive, axis) for axis in AXES))
    return azimuth, elevation


def main(count: int, scenario_name: str | None, output: pathlib.Path | None) -> list[str]:
    """Plan directions and write them to a file. Return the lines to print, the table itself without a file. Raises
    ValueError."""
    limits = travel(scenario_name) if scenario_name else (TRAVEL_RANGE_DEG, (0.0, 90.0))
    planned = directions(count, *limits)
    said = (f'{count} directions, azimuth {planned[0, 0]:.1f} to {planned[-1, 0]:.1f} deg of the encoder; with '
            f'the default terms the error of the model is {noise_gain(planned):.2f} times the noise of one offset')
    table = ['az_deg,el_deg', *(f'{az:.3f},{el:.3f}' for az, el in planned)]
    if not output:
        return [f'# {said}', *table]
    output.write_text('\n'.join((f'# {said}', *table)) + '\n')
    return [said, f'written: {output}']
