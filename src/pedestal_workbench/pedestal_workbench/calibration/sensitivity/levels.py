"""Levels at offsets about a source, from a CSV file or from a recording (docs/calibrate/receiver-drive-gt.md).

The level of a file is the total power, of source and system noise, in dB. The level of a recording is a C/N0 in dB-Hz:
the power of the source alone over the noise power in 1 Hz.
"""
import csv
import dataclasses
import itertools
import math
import pathlib

import numpy as np

from pedestal_common.quantities import Degrees, Floats, Hertz, Pairs
from pedestal_common.text_files import columns, csv_table
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_workbench.calibration import scan
from pedestal_workbench.calibration.calibration import CalibrationError

OFFSET_RANGE_DEG, LEVEL_RANGE_DB = (-30.0, 30.0), (-300.0, 300.0)  # ranges of the offsets and of the levels in a file
MAX_FOLLOWING_BEAMWIDTHS = 0.1  # largest following error of an antenna at rest [beamwidths]
_OFFSETS = (columns.Quantity('elevation_deg', {'elevation': '', 'el': ''}, 'deg'),
            columns.Quantity('cross_elevation_deg', {'cross elevation': '', 'xel': ''}, 'deg'),
            columns.Quantity('az_deg', {'az': '', 'azimuth': ''}, 'deg'))
_LEVEL = columns.Quantity('level_db', {'level': ''}, 'db')
NOISE_KINDS = 'sun', 'moon'  # kinds of simulated targets that are sources of noise


@dataclasses.dataclass(frozen=True)
class Levels:
    """Levels at n offsets."""
    offsets: Pairs      # cross-elevation and elevation of the beam from the source [deg]
    power: Floats       # (n,) total power, or of a recording the power of the source over the noise power in 1 Hz [Hz]
    of_source: bool     # True if the power is that of the source alone
    errors: Pairs       # of the receiver [deg], NaN where there are none
    bandwidth: Hertz    # noise bandwidth of the receiver that the recording states, NaN if unknown
    diameter: Degrees   # of the source, as the recording states it, NaN if unknown
    source: str         # name of the file or recording


def read(path: pathlib.Path, elevation: Degrees | None = None) -> Levels:
    """Return the levels of a CSV file. Raises TableError and CalibrationError. elevation: elevation of the source,
    with which an offset in azimuth becomes an offset in cross-elevation."""
    try:
        table = csv_table.Table(path, csv_table.text(path))
        up = table.column(_OFFSETS[0])
        in_azimuth = table.column(_OFFSETS[1], required=False) is None
        across = table.column(_OFFSETS[2 if in_azimuth else 1])
        level = table.column(_LEVEL)
        rows = [(table.number(across, row[across.name], *OFFSET_RANGE_DEG),
                 table.number(up, row[up.name], *OFFSET_RANGE_DEG),
                 table.number(level, row[level.name], *LEVEL_RANGE_DB)) for row in table]
    except csv.Error as error:
        raise csv_table.TableError(f'{path}: not a CSV text file: {error}') from None
    if not rows:
        raise CalibrationError('0 levels, must be at least 1')
    x, y, level = np.array(rows).T
    if in_azimuth:
        if elevation is None:
            raise CalibrationError('the offsets are in azimuth; --elevation must state the elevation of the source')
        x = x * math.cos(math.radians(elevation))
    elif elevation is not None:
        raise CalibrationError('--elevation: has no effect, because the offsets are in cross-elevation')
    return Levels(np.column_stack((x, y)), 10.0**(0.1 * level), False, np.full((x.size, 2), np.nan), math.nan,
                  math.nan, str(path))


def of_recording(bag: Recording, source: str) -> Levels:
    """Return the levels of a recording of one beam; source: its name. Raises CalibrationError."""
    if 'ship/imu/data' in bag.topics:
        raise CalibrationError('the recording is of a ship; its offsets contain the attitude of the deck')
    if missing := recordings.missing(bag, 'joint_states', 'tracking_receiver/angle_error', 'acu/reference'):
        raise CalibrationError(f'the recording holds no {missing}')
    joints, axes = bag.table('joint_states'), ('azimuth.position', 'elevation.position')
    t = joints['t']
    angles = np.column_stack([joints[name] for name in axes])
    following = recordings.at(bag, t, 'acu/reference', axes) - angles
    measured = recordings.of_equipment(bag, t, 'tracking_receiver/angle_error', ('x', 'y', 'z'))
    following[:, 0] *= np.cos(angles[:, 1])     # on the sky, in cross-elevation
    limit, found = MAX_FOLLOWING_BEAMWIDTHS * recordings.beamwidth(bag), []
    for dwell in itertools.chain.from_iterable(scan.scans(bag, t, recordings.modes(bag, t))):
        part = scan.at_rest(dwell)
        if not (np.abs(following[part]).max() < limit and np.isfinite(measured[part, 2]).any()):
            continue
        place = dwell.azimuth * math.cos(np.mean(angles[part, 1])), dwell.elevation
        off = np.array(place) - following[part].mean(0)
        known = np.isfinite(measured[part, 0])
        error = measured[part, :2][known].mean(0) if known.mean() > 0.9 else np.full(2, np.nan)
        power = np.nanmean(10.0**(0.1 * measured[part, 2]))
        found.append((*np.degrees(off), power, *np.degrees(error)))
    if not found:
        raise CalibrationError('the recording holds no command `offset` in the mode program, tle or sun, after which '
                               f'the antenna is at rest for {scan.MIN_DWELL_S:g} s')
    rows = np.array(found)
    receiver = recordings.parameters(bag, 'tracking_receiver')
    # The level of a carrier has no noise bandwidth.
    noise = receiver.get('target.kind') in NOISE_KINDS
    bandwidth = float(receiver.get('target.noise_source.bandwidth', math.nan)) if noise else math.nan
    disk = math.degrees(receiver.get('target.noise_source.diameter', math.nan)) if noise else 0.0
    return Levels(rows[:, :2], rows[:, 2], True, rows[:, 3:], bandwidth,
                  disk if 'target.kind' in receiver else math.nan, source)
