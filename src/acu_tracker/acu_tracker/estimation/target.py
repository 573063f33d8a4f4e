"""The estimate of the target: conversion of measurements from the deck to the frame of the filter, and back.

The equator of the filter's frame passes through the target (`estimate_frame`). With a measured range the filter
estimates the line of sight from the INS, otherwise the one from the antenna (`lever_arm`). The module `tracking` calls
this module.
"""
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from acu_tracker.estimation import tracker
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import (
    NO_INNOVATION,
    AxisMeasurement,
    AxisVariances,
    Estimate,
    Innovation,
    Measurement,
    attitude_variances,
    error_variance,
)
from acu_tracker.geometry import attitude, attitude_error, deck_reference, estimate_frame, lever_arm
from acu_tracker.geometry.attitude import DeckAttitude
from acu_tracker.geometry.deck_reference import ZERO_VECTOR, Attitude
from acu_tracker.geometry.encoders import Pointing
from acu_tracker.geometry.motion import LineOfSight, Motion, angles, earth_angles, line_of_sight
from acu_tracker.geometry.vector import Rotation, Vector, rotated, rotation
from acu_tracker.signals import Inputs
from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight as pointing
from pedestal_common.quantities import Bit, Meters, Radians, RadiansPerSecond, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters


class Target(Record):
    """Estimate of the target."""
    tracker: tracker.Tracker        # the filter with its gates
    frame: estimate_frame.Frame     # the frame of the filter
    lever_arm: lever_arm.LeverArm   # from the INS to the antenna


OUTCOME_GATED, OUTCOME_STALE, OUTCOME_NOISY = tracker.OUTCOME_GATED, tracker.OUTCOME_STALE, tracker.OUTCOME_NOISY
OUTCOME_NO_ATTITUDE = OUTCOME_NOISY + 1
"""Outcome of `take` without an attitude; the other outcomes are those of the tracker."""


class Source(NamedTuple):
    """Target to which the antenna points."""
    framed: Bit     # 1 if the motion is in the frame of the filter, 0 if it is in earth angles
    motion: Motion


def initialise(record: Records) -> None:
    """Start without an estimate."""
    record['frame']['mat'] = np.eye(3)


@compiled
def _measured_direction(target: Target, params: 'SharedParameters', mat_ed: Rotation, distance: Meters,
                        azimuth: Radians, elevation: Radians) -> tuple[Radians, Radians]:
    """Return (azimuth, elevation) of a measured direction in the frame of the filter.

    mat_ed              rotation deck -> earth
    distance            measured range; NaN: no range
    azimuth, elevation  deck angles of the direction

    For a filter that does not run yet the frame is laid at this direction first.
    """
    x, y, z = pointing.direction(azimuth, elevation)
    v = lever_arm.from_ins(target.lever_arm, params.lever_arm, distance, target.tracker.running, Vector(x, y, z))
    v = rotated(mat_ed, v)
    azimuth, elevation = pointing.earth_angles(v.x, v.y, v.z)
    if not target.tracker.running:
        e, n, u = pointing.earth_direction(azimuth, elevation)
        estimate_frame.lay(target.frame, Vector(e, n, u), ZERO_VECTOR)
    return estimate_frame.direction_to_frame(target.frame, azimuth, elevation)


@compiled
def _measured_rates(target: Target, deck: Attitude, inputs: Inputs,
                    at: Pointing) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return (azimuth rate, elevation rate) of the target in the frame of the filter.

    The rates are the sum of the rates of the antenna and of the receiver error. deck, at: attitude of the deck and
    direction of the antenna when the error was measured.
    """
    n = pointing.displaced_motion(at.A, at.E, at.dA, at.dE, inputs.cross_elevation, inputs.elevation,
                                  inputs.error_rate[0], inputs.error_rate[1])
    v, dv = lever_arm.to_ins(target.lever_arm, Vector(n[0], n[1], n[2]), Vector(n[3], n[4], n[5]))
    return deck_reference.earth_rates(estimate_frame.of_deck(target.frame, deck), v, dv)


@compiled
def take(target: Target, params: 'SharedParameters', constants: tracker.Constants, deck: DeckAttitude, inputs: Inputs,
         at: Pointing, measured: tuple[Radians, Radians], restart_gap: Seconds) -> tuple[int, Innovation]:
    """Filter an error of the receiver. Return (its outcome, the innovation).

    The outcomes are those of the tracker and OUTCOME_NO_ATTITUDE.

    at           direction of the antenna when the error was measured
    measured     deck angles (azimuth, elevation) of the target: those of the antenna, displaced by the error
    restart_gap  time without accepted errors after which the filter restarts
    """
    e = params.tracker.receiver
    t = inputs.error_stamp - e.age
    known, now = attitude.at(deck, params, t)
    if not known:
        return OUTCOME_NO_ATTITUDE, NO_INNOVATION
    azimuth, elevation = _measured_direction(target, params, now.mat, inputs.range if deck.stabilised else math.nan,
                                             measured[0], measured[1])
    azimuth_rate, elevation_rate = math.nan, math.nan
    if math.isfinite(inputs.error_rate[0] + inputs.error_rate[1] + inputs.error_rate_sigma):
        azimuth_rate, elevation_rate = _measured_rates(target, now, inputs, at)
    # R_cross, R_elevation: variances of the measured direction in cross-elevation and elevation [rad2].
    R_cross = R_elevation = error_variance(inputs.cross_elevation, inputs.elevation, inputs.cn0_dbhz, e)
    cos_el = max(math.cos(elevation), 0.01)     # This avoids a division by zero at the zenith.
    # walk_cross, walk_elevation: growth of these variances by the random walk of the attitude error [rad2/s].
    walk_cross = walk_elevation = 0.0
    if deck.stabilised:
        verticals = estimate_frame.verticals(target.frame, azimuth, elevation)
        noise, walk = attitude_error.expected(deck.error, params.tracker.attitude)
        cross, along = attitude_variances(verticals, *noise)
        R_cross, R_elevation = R_cross + cross, R_elevation + along
        walk_cross, walk_elevation = attitude_variances(verticals, *walk)
    target_filter.walk(target.tracker.filter, walk_cross / (cos_el * cos_el), walk_elevation)
    R_rate = inputs.error_rate_sigma * inputs.error_rate_sigma
    axis = (AxisMeasurement(azimuth, R_cross / (cos_el * cos_el), azimuth_rate, R_rate / (cos_el * cos_el)),
            AxisMeasurement(elevation, R_elevation, elevation_rate, R_rate))
    outcome, innovation = tracker.observe(target.tracker, params.tracker, constants,
                                          Measurement(t, axis, inputs.range, inputs.range_variance), restart_gap)
    if outcome != OUTCOME_STALE:
        _follow_with_frame(target, constants)
    return outcome, innovation


@compiled
def _follow_with_frame(target: Target, constants: tracker.Constants) -> None:
    """Lay the frame along the motion of a target that is too far off its equator, and turn the filter with it."""
    motion = tracker.outlook(target.tracker, constants, target.tracker.stamp)
    if abs(motion.elevation.angle) <= estimate_frame.MAX_FRAME_ELEVATION_RAD:
        return
    before, sight = rotation(target.frame.mat), estimate_frame.to_earth(target.frame, motion)
    estimate_frame.lay(target.frame, sight.u, sight.du)
    tracker.turn(target.tracker, constants, estimate_frame.from_earth(target.frame, before))


@compiled
def outlook(target: Target, constants: tracker.Constants, t: Seconds) -> Source:
    """Return the Source that the filter predicts for t."""
    return Source(1, tracker.outlook(target.tracker, constants, t))


@compiled
def earth_outlook(target: Target, constants: tracker.Constants, t: Seconds) -> LineOfSight:
    """Return the LineOfSight in ENU that the filter predicts for t."""
    return estimate_frame.to_earth(target.frame, tracker.outlook(target.tracker, constants, t))


@compiled
def on_deck(target: Target, params: 'SharedParameters', deck: DeckAttitude, t: Seconds, source: Source) -> Motion:
    """Return the Motion in deck angles at t."""
    if not source.framed:
        return attitude.on_deck(deck, params, t, source.motion)
    sight = estimate_frame.to_earth(target.frame, source.motion)
    known, now = attitude.at(deck, params, t)
    if not known:
        return earth_angles(sight)      # As attitude.on_deck does.
    return angles(lever_arm.to_antenna(target.lever_arm, deck_reference.on_deck(now, sight)))


@compiled
def on_levelled_deck(target: Target, level: Rotation, source: Source) -> Motion:
    """Return the Motion of a source in deck angles of a levelled deck at rest.

    level: rotation from this deck to the earth.
    """
    still = Attitude(level, ZERO_VECTOR, ZERO_VECTOR)
    if source.framed:
        still = estimate_frame.of_deck(target.frame, still)
    return angles(deck_reference.on_deck(still, line_of_sight(source.motion)))


@compiled
def read(target: Target, params: 'SharedParameters', constants: tracker.Constants, deck: DeckAttitude,
         t: Seconds) -> Estimate:
    """Return the Estimate at t in earth angles, as seen from the antenna."""
    framed, variances = tracker.read(target.tracker, constants, t)
    azimuth, elevation = variances
    motion = earth_angles(estimate_frame.to_earth(target.frame, framed))
    A11, E11 = estimate_frame.earth_variances(target.frame, framed, motion, azimuth.p11, elevation.p11)
    A12, E12 = estimate_frame.earth_variances(target.frame, framed, motion, azimuth.p12, elevation.p12)
    A22, E22 = estimate_frame.earth_variances(target.frame, framed, motion, azimuth.p22, elevation.p22)
    azimuth, elevation = AxisVariances(A11, A12, A22), AxisVariances(E11, E12, E22)
    if target.lever_arm.range > 0.0:
        known, now = attitude.at(deck, params, t)
        if known:
            motion = lever_arm.earth_angles_to_antenna(target.lever_arm, now.mat, motion)
    return Estimate(motion, (azimuth, elevation))
