"""Conversion of orbits from other frames to the earth-fixed frame, and of the times of files to instants.

The rotations are those of skyfield: IAU 2006 precession and IAU 2000A nutation, with UT1 - UTC and leap seconds from
its built-in tables. They omit the polar motion (up to 0.3", 9 m on the ground). Every ITRF is taken as WGS84; the
difference is some centimetres. After the end of the tables of UT1, an orbit may be wrong by some metres.
"""
import re
from collections.abc import Callable

import numpy as np

from pedestal_common.geometry.geodesy import EARTH_RATE
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.quantities import Floats, Times, Vectors3
from tracking_receiver_sim.tracks import instant

EARTH_FIXED_PATTERN = re.compile(r'ITRF(?:-?\d{2}|-?\d{4})?|WGS84')
INERTIAL_FRAMES = ('EME2000', 'GCRF', 'ICRF', 'TEME', 'TOD')
TIME_SYSTEM_OFFSETS_S = {'UTC': None, 'TAI': 0.0, 'TT': 32.184, 'TDB': 32.184, 'GPS': -19.0}
"""{time system: time system minus TAI [s]}; None for UTC, whose offset varies. TDB differs from TT by up to 2 ms."""

NUTATION_BATCH_SIZE = 2000  # number of instants whose nutation is computed at once: each takes 30 kB


def known(frame: str) -> bool:
    """Return True if earth_fixed supports a frame."""
    return frame in INERTIAL_FRAMES or bool(EARTH_FIXED_PATTERN.fullmatch(frame))


def names() -> str:
    """Return a text for an error message that lists the supported frames."""
    return f'{", ".join(INERTIAL_FRAMES)} or ITRF with or without its year'


def instants(system: str, days: Floats, seconds: Times) -> Times:
    """Return the instants of days since 1970 and seconds of the day in a time system, of which UTC has leap seconds.
    Raises ValueError(index of the row) for second 86400 of a day without one."""
    offset = TIME_SYSTEM_OFFSETS_S[system]
    if offset is None:
        late = np.flatnonzero(seconds >= SECONDS_PER_DAY)
        for i in late:
            if instant.tai_offset(int(days[i]) + 1) == instant.tai_offset(int(days[i])):
                raise ValueError(i)
        leaps = {day: instant.tai_offset(int(day)) - instant.TAI_OFFSET_S for day in np.unique(days)}
        return SECONDS_PER_DAY * days + seconds + np.array([leaps[day] for day in days])
    if (seconds >= SECONDS_PER_DAY).any():
        raise ValueError(int(np.argmax(seconds >= SECONDS_PER_DAY)))
    time = SECONDS_PER_DAY * days + seconds - offset - instant.TAI_OFFSET_S
    if system == 'TDB':
        from skyfield.timelib import tdb_minus_tt
        time = time - tdb_minus_tt(instant.UNIX_EPOCH_JULIAN_DATE + days + seconds / SECONDS_PER_DAY)
    return time


def earth_fixed(frame: str, time: Times, r: Vectors3, v: Vectors3) -> tuple[Vectors3, Vectors3]:
    """Return earth-fixed positions [m] and velocities relative to the rotating earth [m/s] at instants."""
    if EARTH_FIXED_PATTERN.fullmatch(frame):
        return r, v
    positions, velocities = np.empty_like(r), np.empty_like(v)
    for first in range(0, len(time), NUTATION_BATCH_SIZE):
        some = slice(first, first + NUTATION_BATCH_SIZE)
        mat = _to_fixed(frame, time[some])
        positions[some] = np.einsum('ijn,nj->ni', mat, r[some])
        velocities[some] = np.einsum('ijn,nj->ni', mat, v[some]) - np.cross([0.0, 0.0, EARTH_RATE], positions[some])
    return positions, velocities


def _to_fixed(frame: str, time: Times) -> Floats:
    """Return the rotations (3, 3, n) from a frame."""
    from skyfield.framelib import ICRS_to_J2000, itrs, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME
    days = np.floor(time / SECONDS_PER_DAY)
    t = instant.timescale().tai_jd(instant.UNIX_EPOCH_JULIAN_DATE + days, (
        time - SECONDS_PER_DAY * days + instant.TAI_OFFSET_S) / SECONDS_PER_DAY)
    from_icrf: dict[str, Callable[[], Floats]] = {
        'EME2000': lambda: np.broadcast_to(ICRS_to_J2000[:, :, np.newaxis], (3, 3, len(time))),
        'TEME': lambda: TEME.rotation_at(t), 'TOD': lambda: true_equator_and_equinox_of_date.rotation_at(t)}
    fixed = itrs.rotation_at(t)
    return np.einsum('ikn,jkn->ijn', fixed, from_icrf[frame]()) if frame in from_icrf else fixed
