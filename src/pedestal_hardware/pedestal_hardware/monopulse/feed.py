"""Feeds of the antenna: the signal at their outputs, and what a scanned feed makes of an error.

    three_channels  sum S and both differences D_x, D_e
    one_channel     a coupler with the share c: sqrt(1 - c) S + sqrt(c) D, with D = D_x, D_e, -D_x, -D_e in turn
    conical_scan    the sum of a beam that turns about the axis at the squint q

A scanned feed has one output. Its scan reference is a complex number r of modulus 1. The real part of r belongs to
cross-elevation, the imaginary part to elevation. With one_channel the reference is 1, j, -1, -j. With conical_scan the
beam is moved by q towards r. The power of the signal at an error v [beamwidths] is, to first order,

    P (1 + g (v_x Re r + v_e Im r))

with the modulation slope g. Sherman and Barton, Monopulse Principles and Techniques, 2nd ed., chapter 4.
"""
import cmath
import math
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Complexes, Radians, RadiansPerSample, Records, Seconds
from pedestal_common.record import Record
from pedestal_hardware.monopulse.params import FEED_KINDS, ONE_CHANNEL, THREE_CHANNELS, MonopulseParameters
from tracking_receiver_sim import receiver
from tracking_receiver_sim.monopulse import sum_pattern
from tracking_receiver_sim.path.multipath import Image

THREE_CHANNELS_KIND, ONE_CHANNEL_KIND = FEED_KINDS.index(THREE_CHANNELS), FEED_KINDS.index(ONE_CHANNEL)

DIFFERENTIATION_STEP_BEAMWIDTHS, CIRCLE_DIRECTIONS = 1e-4, 64
"""Step of the numerical derivative [beamwidths], and number of directions on the circle of a conical scan."""

SPREAD_PHASES, SPREAD_POINTS = 16, 32
"""Number of phases of the scan at the begin of a window, and points of an integral, for the spread of the reference.
"""


class Feed(Record):
    """Simulated feed."""
    kind: int                       # index into FEED_KINDS
    of_sum: float                   # share of the sum voltage in the signal [-]
    of_difference: Annotated[Complexes, (2,)]   # shares of the differences, with their phases [-]
    squint: Radians                 # angle between beam and axis of rotation
    angle: Radians                  # of the scan
    turn: RadiansPerSample          # change of this angle in a sample


def record(params: MonopulseParameters) -> Records:
    """Return the Feed (1,), at the angle 0."""
    record, feed = Feed.zeros(), params.feed
    record['kind'] = FEED_KINDS.index(feed.kind)
    record['of_sum'] = math.sqrt(1.0 - feed.coupling)
    record['of_difference'] = [cmath.rect(math.sqrt(feed.coupling), phase)
                          for phase in (params.simulated.x_phase, params.simulated.e_phase)]
    record['squint'] = feed.squint * params.antenna.beamwidth
    record['turn'] = 2.0 * math.pi * feed.scan_rate / params.source.rate
    return record


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
    """Return the share of the modulation that the averaged reference keeps [-].

    The average over an integral shortens the reference, and a window of no whole number of scans covers the directions
    unequally. The share is the variance of a fit with two perfect components, 2 / M, over that with this reference.
    """
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
    """Return the time for which a receiver of three channels must integrate to have the noise of one error, at equal
    C/N0 of the received carrier.

    A scanned feed measures the power of M integrals: var(v) = 4 / (g^2 C/N0 T) with the time T of an error, against
    1 / (2 k_m^2 C/N0 T) of three channels.
    """
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


@compiled
def turn(voltages: Complexes, simulated: Feed) -> None:
    """Set the scan reference in the second channel of voltages (rows, 2), one row a sample, and turn the scan on."""
    for k in range(voltages.shape[0]):
        voltages[k, 1] = reference(simulated.kind, simulated.angle + (k + 0.5) * simulated.turn)
    simulated.angle = (simulated.angle + voltages.shape[0] * simulated.turn) % (2.0 * math.pi)


@compiled
def fill(voltages: Complexes, simulated: Feed, state: receiver.State, constants: receiver.Constants,
         seen: receiver.Incidence) -> None:
    """Set voltages (rows, channels) of a step without noise; the second channel of a scanned feed holds
    its reference. state, constants: of the simulated receiver."""
    for k in range(voltages.shape[0]):
        part = (k + 0.5) / voltages.shape[0]
        if simulated.kind == THREE_CHANNELS_KIND or simulated.kind == ONE_CHANNEL_KIND:
            v = receiver.voltages_at(state, constants, seen, part, seen.amplitude)
            total, x, e = complex(v.s_real, v.s_imag), complex(v.x_real, v.x_imag), complex(v.e_real, v.e_imag)
            if simulated.kind == THREE_CHANNELS_KIND:
                voltages[k, 0], voltages[k, 1], voltages[k, 2] = total, x, e
            else:
                r = voltages[k, 1]
                voltages[k, 0] = (simulated.of_sum * total + r.real * simulated.of_difference[0] * x
                                  + r.imag * simulated.of_difference[1] * e)
        else:
            X, E = receiver.error_at(state, seen, part)
            x, e = simulated.squint * voltages[k, 1].real, simulated.squint * voltages[k, 1].imag
            image = Image(seen.image.real, seen.image.imaginary, seen.image.dX - x, seen.image.dE - e)
            v = receiver.voltages(constants, seen.amplitude, (X - x - constants.boresight[0]) / constants.beamwidth,
                                  (E - e - constants.boresight[1]) / constants.beamwidth, image)
            voltages[k, 0] = complex(v.s_real, v.s_imag)
