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
from pedestal_common.quantities import Complexes
from pedestal_common.record import Record
from pedestal_hardware.monopulse.params import FEED_KINDS, ONE_CHANNEL, THREE_CHANNELS
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
    """Record of the simulated feed.

    kind            index into FEED_KINDS
        of_sum          share of the sum voltage in the signal [-]
        of_difference   shares of the differences, with their phases [-]
        squint          angle between beam and axis of rotation [rad]
        angle, turn     angle of the scan [rad], and its change in a sample [rad]
    """
    kind: int
    of_sum: float
    of_difference: Annotated[Complexes, (2,)]
    squint: float
    angle: float
    turn: float


def record(p) -> np.ndarray:
    """Return Feed (1,) of MonopulseParameters, at the angle 0."""
    f, feed = Feed.zeros(), p.feed
    f['kind'] = FEED_KINDS.index(feed.kind)
    f['of_sum'] = math.sqrt(1.0 - feed.coupling)
    f['of_difference'] = [cmath.rect(math.sqrt(feed.coupling), phase)
                          for phase in (p.simulated.x_phase, p.simulated.e_phase)]
    f['squint'], f['turn'] = feed.squint * p.antenna.beamwidth, 2.0 * math.pi * feed.scan_rate / p.source.rate
    return f


def modulation_slope(p) -> float:
    """Return the modulation slope g of the scanned feed of MonopulseParameters [1/beamwidth]."""
    feed, h = p.feed, DIFFERENTIATION_STEP_BEAMWIDTHS
    if feed.kind == ONE_CHANNEL:
        return 2.0 * math.sqrt(feed.coupling / (1.0 - feed.coupling)) * p.antenna.slope
    # The pattern is no body of rotation, so the fundamental of the power on the circle counts.
    first = power = 0.0
    for k in range(CIRCLE_DIRECTIONS):
        angle = 2.0 * math.pi * k / CIRCLE_DIRECTIONS
        x, e = feed.squint * math.cos(angle), feed.squint * math.sin(angle)
        powers = [(sum_pattern(v - x) * sum_pattern(e))**2 for v in (-h, h)]
        first += math.cos(angle) * (powers[1] - powers[0]) / h
        power += 0.5 * sum(powers)
    return first / power


def reference_efficiency(p) -> float:
    """Return the share of the modulation that the averaged reference of MonopulseParameters keeps [-].

    The average over an integral shortens the reference, and a window of no whole number of scans covers the directions
    unequally. The share is the variance of a fit with two perfect components, 2 / M, over that with this reference.
    """
    count, kind = p.steps_per_error * p.receiver.samples_per_step, FEED_KINDS.index(p.feed.kind)
    turns = p.feed.scan_rate * p.period / p.receiver.samples_per_step * (np.arange(count * SPREAD_POINTS) + 0.5)
    variance = 0.0
    for phase in range(SPREAD_PHASES):
        angles = 2.0 * math.pi * (turns / SPREAD_POINTS + phase / SPREAD_PHASES)
        r = np.array([reference(kind, angle) for angle in angles]).reshape(count, SPREAD_POINTS).mean(1)
        A = np.column_stack((np.ones(count), r.real, r.imag))
        variance += 0.5 * np.diag(np.linalg.inv(A.T @ A))[1:].sum() / SPREAD_PHASES
    return float(2.0 / (count * variance))


def effective_integration(p) -> float:
    """Return the time [s] for which a receiver of three channels must integrate to have the noise of one error of
    MonopulseParameters, at equal C/N0 of the received carrier.

    A scanned feed measures the power of M integrals: var(v) = 4 / (g^2 C/N0 T) with the time T of an error, against
    1 / (2 k_m^2 C/N0 T) of three channels.
    """
    if not p.feed.scanned:
        return p.period
    ratio = modulation_slope(p) / p.antenna.slope
    return 0.125 * ratio * ratio * reference_efficiency(p) * p.steps_per_error * p.period


@compiled
def reference(kind, angle):
    """Return the scan reference at an angle of the scan [rad]. kind: index into FEED_KINDS."""
    if kind == ONE_CHANNEL_KIND:
        angle = 0.5 * math.pi * math.floor(angle / (0.5 * math.pi))
    return complex(math.cos(angle), math.sin(angle))


@compiled
def turn(voltages, f):
    """Set the scan reference in the second channel of voltages (rows, 2), one row a sample, and turn the scan on."""
    for k in range(voltages.shape[0]):
        voltages[k, 1] = reference(f.kind, f.angle + (k + 0.5) * f.turn)
    f.angle = (f.angle + voltages.shape[0] * f.turn) % (2.0 * math.pi)


@compiled
def fill(voltages, f, s, c, seen):
    """Set voltages (rows, channels) of a step without noise; the second channel of a scanned feed holds its reference.

    s, c: state and constants of the simulated receiver; seen: receiver.Incidence.
    """
    for k in range(voltages.shape[0]):
        part = (k + 0.5) / voltages.shape[0]
        if f.kind == THREE_CHANNELS_KIND or f.kind == ONE_CHANNEL_KIND:
            v = receiver.voltages_at(s, c, seen, part, seen.amplitude)
            total, x, e = complex(v.s_real, v.s_imag), complex(v.x_real, v.x_imag), complex(v.e_real, v.e_imag)
            if f.kind == THREE_CHANNELS_KIND:
                voltages[k, 0], voltages[k, 1], voltages[k, 2] = total, x, e
            else:
                r = voltages[k, 1]
                voltages[k, 0] = (f.of_sum * total + r.real * f.of_difference[0] * x
                                  + r.imag * f.of_difference[1] * e)
        else:
            X, E = receiver.error_at(s, seen, part)
            x, e = f.squint * voltages[k, 1].real, f.squint * voltages[k, 1].imag
            image = Image(seen.image.real, seen.image.imaginary, seen.image.dX - x, seen.image.dE - e)
            v = receiver.voltages(c, seen.amplitude, (X - x - c.boresight[0]) / c.beamwidth,
                                  (E - e - c.boresight[1]) / c.beamwidth, image)
            voltages[k, 0] = complex(v.s_real, v.s_imag)
