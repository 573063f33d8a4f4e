"""From the frames that orbits are given in to the earth-fixed one, and from the time systems of files to UTC.

skyfield turns them: IAU 2006 precession and IAU 2000A nutation, UT1 - UTC and the leap seconds from the tables that
come with it, no polar motion (up to 0.3", 9 m on the ground). All ITRF are taken for WGS84, from which they differ by
centimetres. Against the true UT1, where the tables are older than the date, an orbit may be off by some metres.
"""
import functools
import re

import numpy as np

from pedestal_common.geometry.geodesy import EARTH_RATE

EARTH_FIXED_PATTERN = re.compile(r'ITRF(?:-?\d{2}|-?\d{4})?|WGS84')
INERTIAL_FRAMES = ('EME2000', 'GCRF', 'ICRF', 'TEME', 'TOD')
TIME_SYSTEM_OFFSETS_S = {'UTC': None, 'TAI': 0.0, 'TT': 32.184, 'GPS': -19.0}
"""{time system: its seconds ahead of TAI}."""

NUTATION_BATCH_SIZE = 2000
"""Instants whose nutation is computed at once: it takes 30 kB for each."""


def known(frame):
    """Whether earth_fixed knows a frame."""
    return frame in INERTIAL_FRAMES or bool(EARTH_FIXED_PATTERN.fullmatch(frame))


def names():
    """The frames that are known, for people."""
    return f'{", ".join(INERTIAL_FRAMES)} or ITRF with or without its year'


@functools.cache
def _timescale():
    from skyfield.api import load  # an orbit in an earth-fixed frame and in UTC goes without
    return load.timescale(builtin=True)


def ahead_of_utc(system, day):
    """Seconds that a time system of TIME_SYSTEM_OFFSETS_S is ahead of UTC on a day since 1970."""
    if TIME_SYSTEM_OFFSETS_S[system] is None:
        return 0.0
    leaps = round((_timescale().utc(1970, 1, 1 + day).tai - 2440587.5 - day) * 86400.0)
    return leaps + TIME_SYSTEM_OFFSETS_S[system]


def earth_fixed(frame, utc, r, v):
    """Earth-fixed positions [m] and velocities against the earth [m/s], (n, 3) each, of those in a frame that is
    known, at UTC (n,) [s since 1970]."""
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
    """Rotations (3, 3, n) from a frame to the earth-fixed one."""
    from skyfield.framelib import ICRS_to_J2000, itrs, true_equator_and_equinox_of_date
    from skyfield.sgp4lib import TEME
    days = np.floor(utc / 86400.0)
    t = _timescale().utc(1970, 1, 1 + days, 0, 0, utc - 86400.0 * days)
    from_icrf = {'EME2000': lambda: np.broadcast_to(ICRS_to_J2000[:, :, np.newaxis], (3, 3, len(utc))),
                 'TEME': lambda: TEME.rotation_at(t), 'TOD': lambda: true_equator_and_equinox_of_date.rotation_at(t)}
    fixed = itrs.rotation_at(t)
    return np.einsum('ikn,jkn->ijn', fixed, from_icrf[frame]()) if frame in from_icrf else fixed
