"""The estimate of the target: conversion of measurements from the deck to the frame of the filter, and back.

The equator of the filter's frame passes through the target (`estimate_frame`). With a measured range the filter
estimates the line of sight from the INS, otherwise the one from the antenna (`lever_arm`). The module `tracking` calls
this module.

g     record of TARGET_DTYPE
p     record of SharedParameters
c     record of tracker.Constants
deck  record of ATTITUDE_DTYPE, except where a function states otherwise
"""
import math
from collections import namedtuple

import numpy as np

from acu_tracker.estimation import tracker
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import (
    NO_INNOVATION,
    AxisMeasurement,
    AxisVariances,
    Estimate,
    Measurement,
    attitude_variances,
    error_variance,
)
from acu_tracker.geometry import attitude, attitude_error, deck_reference, estimate_frame, lever_arm
from acu_tracker.geometry.deck_reference import ZERO_VECTOR, Attitude
from acu_tracker.geometry.motion import angles, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Vector, rotated, rotation
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.record import Record


class Target(Record):
    """tracker: the filter with its gates; frame: the frame of the filter; lever_arm: the vector from INS to antenna."""
    tracker: tracker.Tracker
    frame: estimate_frame.Frame
    lever_arm: lever_arm.LeverArm


OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY = tracker.OUTCOME_GATED, tracker.OUTCOME_STALE, tracker.OUTCOME_NOISY
OUTCOME_NO_ATTITUDE = OUTCOME_NOISY + 1
"""Outcome of `take` without an attitude; the other outcomes are those of the tracker."""

Source = namedtuple('Source', 'framed motion')
"""Target to which the antenna points.

framed  1 if the Motion is in the frame of the filter, 0 if it is in earth angles
motion  its Motion
"""


def initialise(g):
    """Start without an estimate; g (n,) of TARGET_DTYPE."""
    g['frame']['mat'] = np.eye(3)


@compiled
def _measured_direction(g, p, mat_ed, distance, azimuth, elevation):
    """Return (azimuth, elevation) [rad] of a measured direction in the frame of the filter.

    mat_ed              Rotation deck -> earth
    distance            measured range [m]; NaN: no range
    azimuth, elevation  deck angles of the direction [rad]

    For a filter that does not run yet the frame is laid at this direction first.
    """
    x, y, z = pointing.direction(azimuth, elevation)
    v = lever_arm.from_ins(g.lever_arm, p.lever_arm, distance, g.tracker.running, Vector(x, y, z))
    v = rotated(mat_ed, v)
    azimuth, elevation = pointing.earth_angles(v.x, v.y, v.z)
    if not g.tracker.running:
        e, n, u = pointing.earth_direction(azimuth, elevation)
        estimate_frame.lay(g.frame, Vector(e, n, u), ZERO_VECTOR)
    return estimate_frame.direction_to_frame(g.frame, azimuth, elevation)


@compiled
def _measured_rates(g, deck, u, at):
    """Return (azimuth rate, elevation rate) [rad/s] of the target in the frame of the filter.

    The rates are the sum of the rates of the antenna and of the receiver error.

    deck   Attitude of the deck when the error was measured
    u      record of signals.Inputs.dtype
    at     Pointing of the antenna when the error was measured
    """
    n = pointing.displaced_motion(at.A, at.E, at.dA, at.dE, u.cross_elevation, u.elevation, u.error_rate[0],
                                  u.error_rate[1])
    v, dv = lever_arm.to_ins(g.lever_arm, Vector(n[0], n[1], n[2]), Vector(n[3], n[4], n[5]))
    return deck_reference.earth_rates(estimate_frame.of_deck(g.frame, deck), v, dv)


@compiled
def take(g, p, c, deck, u, at, measured, restart_gap):
    """Filter an error of the receiver. Return (its outcome, the Innovation).

    The outcomes are those of the tracker and OUTCOME_NO_ATTITUDE.

    u            record of signals.Inputs.dtype
    at           Pointing of the antenna when the error was measured
    measured     deck angles (azimuth, elevation) of the target [rad]: those of the antenna, displaced by the error
    restart_gap  time without accepted errors after which the filter restarts [s]
    """
    e = p.tracker.receiver
    t = u.error_stamp - e.age
    known, now = attitude.at(deck, p, t)
    if not known:
        return OUTCOME_NO_ATTITUDE, NO_INNOVATION
    azimuth, elevation = _measured_direction(g, p, now.mat, u.range if deck.stabilised else math.nan, measured[0],
                                             measured[1])
    azimuth_rate, elevation_rate = math.nan, math.nan
    if math.isfinite(u.error_rate[0] + u.error_rate[1] + u.error_rate_sigma):
        azimuth_rate, elevation_rate = _measured_rates(g, now, u, at)
    # R_cross, R_elevation: variances of the measured direction in cross-elevation and elevation [rad2].
    R_cross = R_elevation = error_variance(u.cross_elevation, u.elevation, u.cn0_dbhz, e)
    cos_el = max(math.cos(elevation), 0.01)     # This avoids a division by zero at the zenith.
    # walk_cross, walk_elevation: growth of these variances by the random walk of the attitude error [rad2/s].
    walk_cross = walk_elevation = 0.0
    if deck.stabilised:
        verticals = estimate_frame.verticals(g.frame, azimuth, elevation)
        noise, walk = attitude_error.expected(deck.error, p.tracker.attitude)
        cross, along = attitude_variances(verticals, *noise)
        R_cross, R_elevation = R_cross + cross, R_elevation + along
        walk_cross, walk_elevation = attitude_variances(verticals, *walk)
    target_filter.walk(g.tracker.filter, walk_cross / (cos_el * cos_el), walk_elevation)
    R_rate = u.error_rate_sigma * u.error_rate_sigma
    axis = (AxisMeasurement(azimuth, R_cross / (cos_el * cos_el), azimuth_rate, R_rate / (cos_el * cos_el)),
            AxisMeasurement(elevation, R_elevation, elevation_rate, R_rate))
    outcome, innovation = tracker.observe(g.tracker, p.tracker, c, Measurement(t, axis, u.range, u.range_variance),
                                          restart_gap)
    if outcome != OUTCOME_STALE:
        _follow_with_frame(g, c)
    return outcome, innovation


@compiled
def _follow_with_frame(g, c):
    """Lay the frame along the motion of a target that is too far off its equator, and turn the filter with it."""
    motion = tracker.outlook(g.tracker, c, g.tracker.stamp)
    if abs(motion.elevation.angle) <= estimate_frame.MAX_FRAME_ELEVATION_RAD:
        return
    before, sight = rotation(g.frame.mat), estimate_frame.to_earth(g.frame, motion)
    estimate_frame.lay(g.frame, sight.u, sight.du)
    tracker.turn(g.tracker, c, estimate_frame.from_earth(g.frame, before))


@compiled
def outlook(g, c, t):
    """Return the Source that the filter predicts for t [s]."""
    return Source(1, tracker.outlook(g.tracker, c, t))


@compiled
def earth_outlook(g, c, t):
    """Return the LineOfSight in ENU that the filter predicts for t [s]."""
    return estimate_frame.to_earth(g.frame, tracker.outlook(g.tracker, c, t))


@compiled
def on_deck(g, p, deck, t, source):
    """Return the Motion in deck angles at t [s]; source: the Source."""
    if not source.framed:
        return attitude.on_deck(deck, p, t, source.motion)
    sight = estimate_frame.to_earth(g.frame, source.motion)
    known, now = attitude.at(deck, p, t)
    if not known:
        return earth_angles(sight)      # As attitude.on_deck does.
    return angles(lever_arm.to_antenna(g.lever_arm, deck_reference.on_deck(now, sight)))


@compiled
def on_levelled_deck(g, level, source):
    """Return the Motion of a Source in deck angles of a levelled deck at rest.

    level: Rotation from this deck to the earth.
    """
    still = Attitude(level, ZERO_VECTOR, ZERO_VECTOR)
    if source.framed:
        still = estimate_frame.of_deck(g.frame, still)
    return angles(deck_reference.on_deck(still, line_of_sight(source.motion)))


@compiled
def read(g, p, c, deck, t):
    """Return the Estimate at t [s] in earth angles, as seen from the antenna."""
    framed, variances = tracker.read(g.tracker, c, t)
    azimuth, elevation = variances
    motion = earth_angles(estimate_frame.to_earth(g.frame, framed))
    A11, E11 = estimate_frame.earth_variances(g.frame, framed, motion, azimuth.p11, elevation.p11)
    A12, E12 = estimate_frame.earth_variances(g.frame, framed, motion, azimuth.p12, elevation.p12)
    A22, E22 = estimate_frame.earth_variances(g.frame, framed, motion, azimuth.p22, elevation.p22)
    azimuth, elevation = AxisVariances(A11, A12, A22), AxisVariances(E11, E12, E22)
    if g.lever_arm.range > 0.0:
        known, now = attitude.at(deck, p, t)
        if known:
            motion = lever_arm.earth_angles_to_antenna(g.lever_arm, now.mat, motion)
    return Estimate(motion, (azimuth, elevation))
