"""Where the axes are sent: the azimuth wrap that fits, and how far the beam is meant to be off the target."""
import numpy as np

from acu_tracker.geometry import azimuth_wrap
from acu_tracker.geometry.motion import AxisMotion, Motion
from acu_tracker.program import program_track
from pedestal_common.compiled import compiled

GUIDANCE = np.dtype([('azimuth', 'f8'), ('target_angles', 'f8', (2,)), ('pointing_offset', 'f8'),
                     ('overtravel', 'i8')], align=True)
"""azimuth: raw one of the last reference; target_angles: deck angles of its target; pointing_offset: intended angle
between beam and target [rad]; overtravel: 1: no azimuth wrap held the whole program."""


@compiled
def start_from(g, azimuth):
    """Choose the next wrap near an azimuth [rad]."""
    g.azimuth = azimuth


@compiled
def forget(g):
    """Follow no target."""
    g.overtravel, g.pointing_offset = 0, 0.0


@compiled
def aim(g, motion):
    """Take the Motion of the target on the deck."""
    g.target_angles[0], g.target_angles[1] = motion.azimuth.angle, motion.elevation.angle
    g.pointing_offset = 0.0


@compiled
def slew(g, motion, offset):
    """Return the Motion of a slew, which is off the target by an offset [rad]."""
    g.azimuth, g.pointing_offset = motion.azimuth.angle, offset
    return motion


@compiled
def follow(g, limits, motion, travel):
    """Return the Motion with the azimuth on the wrap that fits, for a program that begins with a Travel on one that
    holds all of it. limits: of the azimuth."""
    A = motion.azimuth
    g.azimuth = azimuth_wrap.nearest(A.angle, g.azimuth, limits.low, limits.high, travel)
    return Motion(AxisMotion(g.azimuth, A.rate, A.acceleration), motion.elevation)


@compiled
def begin_program(g, limits, motion, program, t):
    """`follow` a program that begins at t [s], and keep whether its wrap holds all of it."""
    travel = program_track.azimuth_travel(program, t)
    motion = follow(g, limits, motion, travel)
    g.overtravel = g.azimuth + travel.below < limits.low or g.azimuth + travel.above > limits.high
    return motion
