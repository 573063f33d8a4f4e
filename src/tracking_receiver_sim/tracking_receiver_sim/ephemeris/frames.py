"""Conversion of frames of orbits to the earth-fixed frame, and of time systems of files to UTC.

The rotations are those of skyfield: IAU 2006 precession and IAU 2000A nutation, UT1 - UTC and leap seconds from its
built-in tables, no polar motion (up to 0.3", 9 m on the ground). Every ITRF is taken as WGS84; the difference is some
centimetres. For dates after the end of the tables of UT1, an orbit may be off by some metres.
"""
import functools
import re

import numpy as np

from pedestal_common.geometry.geodesy import EARTH_RATE

EARTH_FIXED_PATTERN = re.compile(r'ITRF(?:-?\d{2}|-?\d{4})?|WGS84')
INERTIAL_FRAMES = ('EME2000', 'GCRF', 'ICRF', 'TEME', 'TOD')
TIME_SYSTEM_OFFSETS_S = {'UTC': None, 'TAI': 0.0, 'TT': 32.184, 'GPS': -19.0}
"""{time system: its seconds ahead of TAI, None for UTC}."""

NUTATION_BATCH_SIZE = 2000
"""Number of instants whose nutation is computed at once: each takes 30 kB."""


def known(frame):
    """Return True if earth_fixed supports a frame."""
    return frame in INERTIAL_FRAMES or bool(EARTH_FIXED_PATTERN.fullmatch(frame))


def names():
    """Return a text for people that lists the supported frames."""
    return f'{", ".join(INERTIAL_FRAMES)} or ITRF with or without its year'


@functools.cache
def _timescale():
    from skyfield.api import load  # slow to import; not needed for an orbit in an earth-fixed frame and in UTC
    return load.timescale(builtin=True)


def ahead_of_utc(system, day):
    """Return the seconds that a time system of TIME_SYSTEM_OFFSETS_S is ahead of UTC on a day since 1970."""
    if TIME_SYSTEM_OFFSETS_S[system] is None:
        return 0.0
    leaps = round((_timescale().utc(1970, 1, 1 + day).tai - 2440587.5 - day) * 86400.0)
    return leaps + TIME_SYSTEM_OFFSETS_S[system]


def earth_fixed(frame, utc, r, v):
    """Return earth-fixed positions [m] and velocities against the earth [m/s], (n, 3) each.

    r, v (n, 3): positions and velocities in a supported frame; utc (n,): [s] since 1970.
    """
    if EARTH_FIXED_PATTERN.fullmatch(frame):
        return r, v
    positions, velocities = np.empty_like(r), np.empty_like(v)
    for at in range(0, len(utc), NUTATION_BATCH_SIZE):
        some = slice(at, at + NUTATION_BATCH_SIZE)
        mat = _to_fixed(frame, utc[some])
        positions[some] = np.einsum('ijn,nj->ni', mat, r[some])
        velocities[some] = np.einsum('ijn,nj->ni', mat, v[some]) - np.cross([0.0, 0.0, EARTH_RATE], positions[some])
    return positions, velocities


def _to_fixed(frame, utc):
    """Return the rotations (3, 3, n) from a frame to the earth-fixed one."""
    from skyfield.framelib import ICRS_to_J2000, itrs, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME
    days = np.floor(utc / 86400.0)
    t = _timescale().utc(1970, 1, 1 + days, 0, 0, utc - 86400.0 * days)
    from_icrf = {'EME2000': lambda: np.broadcast_to(ICRS_to_J2000[:, :, np.newaxis], (3, 3, len(utc))),
                 'TEME': lambda: TEME.rotation_at(t), 'TOD': lambda: true_equator_and_equinox_of_date.rotation_at(t)}
    fixed = itrs.rotation_at(t)
    return np.einsum('ikn,jkn->ijn', fixed, from_icrf[frame]()) if frame in from_icrf else fixed
