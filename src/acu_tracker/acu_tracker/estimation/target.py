"""The target: its estimate by the filter, in the frame of the filter, in earth angles and in deck angles.

The equator of the filter's frame passes through the target (`geometry.frames`). With a measured range the filter
estimates the line of sight from the INS, otherwise the one from the antenna (`lever_arm`). Between accepted
measurements the filter stays at the stamp of the last one; `outlook` and `read` predict from there.
"""
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from acu_tracker.estimation import monitors
from acu_tracker.estimation.filters import target_filter
from acu_tracker.estimation.filters.measurement import Estimate, weighted
from acu_tracker.estimation.params import FilterParameters, TrackerParameters
from acu_tracker.geometry import attitude, frames, lever_arm
from acu_tracker.geometry.attitude import DeckAttitude
from acu_tracker.geometry.frames import Attitude
from acu_tracker.geometry.vector import (
    ZERO_VECTOR,
    LineOfSight,
    Motion,
    Rotation,
    angles,
    earth_angles,
    line_of_sight,
)
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Ints, Pair, Radians, Records, Seconds
from pedestal_common.record import Record

if TYPE_CHECKING:
    from acu_tracker.params import SharedParameters


GATE_FLOOR_BEAMWIDTHS = 0.01
"""Standard deviation that the gate adds to every prediction on a rigid antenna [beamwidths]. With a strong signal the
noise is so small that a target which begins to turn would leave the gate before the filter follows it. A dish that
swings would pass too, and its filter does not follow a swing."""


class Constants(Record):
    """Constants of the filter and of its gate."""
    filter: target_filter.Constants
    # largest accepted nu' S^-1 nu [-] of the two angles, and of one rate or range; nu: innovation, S: its
    # covariance, of the angles with gate_floor
    gates: Pair
    gate_floor: Radians     # standard deviation that the gate adds to every predicted angle
    rigid: Bit              # 1 if neither axis has a structure that swings


class Target(Record):
    """Estimate of the target."""
    filter: target_filter.Filter
    stamp: Seconds          # of the last accepted measurement
    running: Bit            # 1 while there is an estimate
    converged: Bit          # 1 if the rates are known well enough for lock
    roughness: monitors.Roughness
    accepted_in_a_row: int  # number of consecutive accepted measurements
    gated_in_a_row: int     # number of consecutive rejected (gated) measurements
    # of each axis: number of consecutive measured rates that agreed with the filter
    rates_in_a_row: Annotated[Ints, (2,)]
    gated: int              # number of rejected directions since the start
    rates_gated: int        # number of rejected rates since the start
    ranges_gated: int       # number of rejected ranges since the start
    frame: frames.Frame     # the frame of the filter
    lever_arm: lever_arm.LeverArm   # from the INS to the antenna


class Source(NamedTuple):
    """Target to which the antenna points."""
    framed: Bit     # 1 if the motion is in the frame of the filter, 0 if it is in earth angles
    motion: Motion


def gate_of_one(gate: float) -> float:
    """Return the gate x of one number that is exceeded as rarely as `gate` of two numbers; both are chi-square [-].

    Two numbers exceed `gate` with the probability e^(-gate/2). One number exceeds x with the probability erfc(z), z^2
    = x/2. The function solves x - 2 log(e^z^2 erfc(z)) = gate by bisection, because e^z^2 erfc(z) does not underflow.
    """
    low, high = 0.0, gate
    for _ in range(100):
        x = 0.5 * (low + high)
        z = math.sqrt(0.5 * x)
        scaled_erfc = math.exp(z * z) * math.erfc(z) if z < 20.0 else 1.0 / (z * math.sqrt(math.pi))
        if x - 2.0 * math.log(scaled_erfc) < gate:
            low = x
        else:
            high = x
    return high


def constants(params: TrackerParameters, axes: Sequence[FilterParameters], rigid: bool = True) -> Records:
    """Return the constants (1,) of the parameters, and of the filters of both axes; rigid: True if neither axis has a
    structure that swings."""
    return Constants.of(filter=target_filter.constants(params.ukf, axes, params.receiver.noise_bandwidth),
                        gates=(params.gate, gate_of_one(params.gate)),
                        gate_floor=GATE_FLOOR_BEAMWIDTHS * params.receiver.beamwidth if rigid else 0.0, rigid=rigid)


def initialise(record: Records) -> None:
    """Start without an estimate."""
    record['frame']['mat'] = np.eye(3)


@compiled
def stop(target: Target) -> None:
    """Discard the estimate; the next measurement starts the filter."""
    target.running = 0


@compiled
def reset_accepted_count(target: Target) -> None:
    """Reset the count of accepted measurements, so that the lock takes lock_count new ones."""
    target.accepted_in_a_row = 0


@compiled
def settled(target: Target, params: TrackerParameters) -> Bit:
    """Return True if lock_count consecutive measurements were accepted, and the filter has converged."""
    return target.running and target.accepted_in_a_row >= params.lock_count and target.converged


@compiled
def locked(target: Target, params: TrackerParameters, since_accepted: Seconds) -> Bit:
    """Return True if autotrack can begin: the filter is settled, and its last accepted measurement is at most
    coast_after old. since_accepted: its age, less the receiver's latency."""
    return settled(target, params) and since_accepted <= params.coast_after


@compiled
def outlook(target: Target, constants: Constants, t: Seconds) -> Motion:
    """Return the Motion in the frame of the filter predicted for t, at the earliest for the last accepted
    measurement."""
    return target_filter.outlook(target.filter, constants.filter, max(t - target.stamp, 0.0))


@compiled
def sight(target: Target, constants: Constants, t: Seconds) -> LineOfSight:
    """Return the line of sight (ENU) of the estimate at t; t as in `outlook`."""
    return frames.to_earth(target.frame, outlook(target, constants, t))


@compiled
def on_deck(target: Target, params: 'SharedParameters', deck: DeckAttitude, t: Seconds, source: Source) -> Motion:
    """Return the Motion in deck angles at t."""
    if not source.framed:
        return attitude.on_deck(deck, params, t, source.motion)
    sight = frames.to_earth(target.frame, source.motion)
    known, now = attitude.at(deck, params, t)
    if not known:
        return earth_angles(sight)      # As attitude.on_deck does.
    return angles(lever_arm.to_antenna(target.lever_arm, frames.on_deck(now, sight)))


@compiled
def on_levelled_deck(target: Target, level: Rotation, source: Source) -> Motion:
    """Return the Motion of a source in deck angles of a levelled deck at rest; level: this deck -> earth."""
    still = Attitude(level, ZERO_VECTOR, ZERO_VECTOR)
    if source.framed:
        still = frames.of_deck(target.frame, still)
    return angles(frames.on_deck(still, line_of_sight(source.motion)))


@compiled
def read(target: Target, params: 'SharedParameters', constants: Constants, deck: DeckAttitude,
         t: Seconds) -> Estimate:
    """Return the Estimate at t in earth angles, as seen from the antenna; t as in `outlook`."""
    target_filter.predict(target.filter, constants.filter, max(t - target.stamp, 0.0))
    framed, variances = target_filter.read(target.filter)
    motion = earth_angles(frames.to_earth(target.frame, framed))
    azimuth, elevation = frames.earth_shares(target.frame, framed, motion)
    if target.lever_arm.range > 0.0:
        known, now = attitude.at(deck, params, t)
        if known:
            motion = lever_arm.earth_angles_to_antenna(target.lever_arm, now.mat, motion)
    return Estimate(motion, (weighted(variances, azimuth), weighted(variances, elevation)))
