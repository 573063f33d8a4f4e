"""Feeds of the antenna, and what a scanned feed makes of an error.

    three_channels  sum S and both differences D_x, D_e
    one_channel     a coupler with the share c: sqrt(1 - c) S + sqrt(c) D, with D = D_x, D_e, -D_x, -D_e in turn
    conical_scan    the sum of a beam that turns about the axis at the squint q

A scanned feed has one output. Its scan reference is a complex number r of modulus 1. The real part of r belongs to
cross-elevation, the imaginary part to elevation. With one_channel the reference is 1, j, -1, -j. With conical_scan the
beam is moved by q towards r. The power of the signal at an error v [beamwidths] is, to first order,

    P (1 + g (v_x Re r + v_e Im r))

with the modulation slope g. Sherman and Barton, Monopulse Principles and Techniques, 2nd ed., chapter 4.
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Radians, Seconds
from pedestal_hardware.monopulse.params import FEED_KINDS, ONE_CHANNEL, THREE_CHANNELS, MonopulseParameters
from receiver_law.monopulse import sum_pattern

THREE_CHANNELS_KIND, ONE_CHANNEL_KIND = FEED_KINDS.index(THREE_CHANNELS), FEED_KINDS.index(ONE_CHANNEL)

DIFFERENTIATION_STEP_BEAMWIDTHS, CIRCLE_DIRECTIONS = 1e-4, 64  # numerical derivative; conical scan
SPREAD_PHASES, SPREAD_POINTS = 16, 32  # phases of the scan at the begin of a window, points of an integral


def modulation_slope(params: MonopulseParameters) -> float:
    """Return the modulation slope g of the scanned feed [1/beamwidth]."""
    feed, h = params.feed, DIFFERENTIATION_STEP_BEAMWIDTHS
    if feed.kind == ONE_CHANNEL:
        return 2.0 * math.sqrt(feed.coupling / (1.0 - feed.coupling)) * params.antenna.slope
    # The pattern is no body of rotation, so the fundamental of the power on the circle counts.
    first = power = 0.0
    for k in range(CIRCLE_DIRECTIONS):
        angle = 2.0 * math.pi * k / CIRCLE_DIRECTIONS
        x, e = feed.squint * math.cos(angle), feed.squint * math.sin(angle)
        powers = [(sum_pattern(v - x) * sum_pattern(e))**2 for v in (-h, h)]
        first += math.cos(angle) * (powers[1] - powers[0]) / h
        power += 0.5 * sum(powers)
    return first / power


def reference_efficiency(params: MonopulseParameters) -> float:
    """Return the share of the modulation that the averaged reference keeps [-]. The average over an integral shortens
    the reference, and a window of no whole number of scans covers the directions unequally. The share is the variance
    of a fit with two perfect components, 2 / M, over that with this reference."""
    count, kind = params.steps_per_error * params.receiver.samples_per_step, FEED_KINDS.index(params.feed.kind)
    points = np.arange(count * SPREAD_POINTS) + 0.5
    turns = params.feed.scan_rate * params.period / params.receiver.samples_per_step * points
    variance = 0.0
    for phase in range(SPREAD_PHASES):
        angles = 2.0 * math.pi * (turns / SPREAD_POINTS + phase / SPREAD_PHASES)
        r = np.array([reference(kind, angle) for angle in angles]).reshape(count, SPREAD_POINTS).mean(1)
        A = np.column_stack((np.ones(count), r.real, r.imag))
        variance += 0.5 * np.diag(np.linalg.inv(A.T @ A))[1:].sum() / SPREAD_PHASES
    return float(2.0 / (count * variance))


def effective_integration(params: MonopulseParameters) -> Seconds:
    """Return the time for which three channels must integrate for the noise of one error, at equal C/N0. A scanned
    feed measures the power of M integrals: var(v) = 4 / (g^2 C/N0 T) with the time T of an error, against 1 / (2 k_m^2
    C/N0 T) of three channels."""
    if not params.feed.scanned:
        return params.period
    ratio = modulation_slope(params) / params.antenna.slope
    return 0.125 * ratio * ratio * reference_efficiency(params) * params.steps_per_error * params.period


@compiled
def reference(kind: int, angle: Radians) -> complex:
    """Return the scan reference at an angle of the scan. kind: index into FEED_KINDS."""
    if kind == ONE_CHANNEL_KIND:
        angle = 0.5 * math.pi * math.floor(angle / (0.5 * math.pi))
    return complex(math.cos(angle), math.sin(angle))
