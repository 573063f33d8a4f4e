"""The models of the target filter that an axis with a flexible structure can use.

The receiver sees the swing of the dish against the encoder as a motion of the target. The filter follows the swing,
the reference of the axis follows the filter, and the axis moves the base of the dish. This is a loop beside the
position loop, and a model of the filter makes the loop faster the more white jerk the model has. With the angles of
base, dish and reference B, D, r, the open loop L(s) is the product of

    (D - B) / B = -s^2 / (s^2 + 2 zeta w s + w^2)                            twist of the structure
    B / r       = (s^2 + G) / (s^2 + G + X share s^2 (D - B) / B)            axis under the reaction of the dish
    r / (D - B) = (x3 + 2 x2 / h0 + x1 / h0^2) / (s + 1 / h0)^2 e^(-lead s)  filter and shaper, with

    x1, x2, x3 = (2 b s^2 + 2 b^2 s + b^3, 2 b^2 s^2 + b^3 s, b^3 s^2) / (s^3 + 2 b s^2 + 2 b^2 s + b^3)

w, zeta, share   of StructureParameters
b                bandwidth (q / r)^(1/3) of the steady Kalman filter of a model ca with the white jerk q, for a
                 receiver with the noise density r. x1, x2, x3 are angle, rate and acceleration, predicted by the lead
h0               of the shaper, in its linear zone
lead             time from an error of the receiver to the middle of its command
G                acceleration that the loops of the axis make of an error of 1 rad. `feedforward`, `pid`: C (s + K),
                 where C = w_s + w_s^2 / (5 s) is the speed loop of the drive and K the controller with its notch;
                 `adrc`: w_c^2 + 2 w_c s. Under `pid` the reference is x1, and B / r has C K in place of s^2 + G
X                1, or under `adrc` the part of a disturbance that the observer leaves, 1 - w_o^3 / (s + w_o)^3

A bank weighs its models, so the gain of the loop may also be smaller. The margin is therefore the smallest distance of
k L from -1 on the imaginary axis for any k from 0 to 1. A loop with a margin above 0 is stable for each such k. A
model is usable with MIN_MARGIN, if its bandwidth also stays below the structure by MIN_FREQUENCY_RATIO: a faster model
amplifies gusts below the resonance.
"""
import dataclasses
import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.filters.measurement import error_variance
from acu_tracker.servo import controllers, position_loop
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import record
from pedestal_common.quantities import Complexes, RadiansPerSecond, Seconds

if TYPE_CHECKING:
    from acu_tracker.estimation.params import FilterParameters, ReceiverModelParameters
    from acu_tracker.params import AcuParameters, AxisParameters

MIN_MARGIN, MIN_FREQUENCY_RATIO = 1.0 / 1.5, 8.0
"""Smallest margin of a usable model [-], with which the loop amplifies a disturbance by 1.5 at most; smallest ratio
of the frequency of the structure to the bandwidth of a usable model [-]."""

SPEED_INTEGRAL_RATIO = 5.0  # ratio of the gains K_p w_s and K_i of the drive's speed loop (tuning.loops) [-]


def twist(axis: 'AxisParameters', s: Complexes) -> Complexes:
    """Return the twist of the structure per angle of its base."""
    w = 2.0 * math.pi * axis.structure.frequency
    return -s * s / (s * s + 2.0 * axis.structure.damping * w * s + w * w)


def _notch(axis: 'AxisParameters', s: Complexes) -> Complexes:
    if axis.notch.frequency == 0.0:
        return np.ones_like(s)
    w, wide = 2.0 * math.pi * axis.notch.frequency, 2.0 * axis.notch.width
    return (s * s + axis.notch.depth * wide * w * s + w * w) / (s * s + wide * w * s + w * w)


def axis_response(axis: 'AxisParameters', delay: Seconds, s: Complexes) -> Complexes:
    """Return the angle of the base per reference; delay: time from an encoder angle to the middle of its command."""
    reaction = axis.structure.inertia_share * twist(axis, s) * s * s
    if axis.controller == 'adrc':
        w_c, w_o = axis.adrc.bandwidth, axis.adrc.observer_bandwidth
        held = s * s + 2.0 * w_c * s + w_c * w_c
        return held / (held + (1.0 - (w_o / (s + w_o))**3) * reaction)
    gains = axis.pid if axis.controller == 'pid' else axis.feedforward
    K_p, K_i = controllers.pid_gains(record(gains, type(gains))[0])
    K = (K_p + K_i / s) * _notch(axis, s) * np.exp(-delay * s)
    C = axis.adrc.rate_bandwidth + axis.adrc.rate_bandwidth**2 / (SPEED_INTEGRAL_RATIO * s)
    led = C * K if axis.controller == 'pid' else s * s + C * (s + K)
    return led / (s * s + C * (s + K) + reaction)


def filter_response(axis: 'AxisParameters', bandwidth: RadiansPerSecond, lead: Seconds, s: Complexes) -> Complexes:
    """Return the reference per measured angle of the target, by a model of a bandwidth."""
    b, h0 = bandwidth, axis.shaper.h0
    poles = s**3 + 2.0 * b * s * s + 2.0 * b * b * s + b**3
    x1, x2, x3 = ((2.0 * b * s * s + 2.0 * b * b * s + b**3) / poles, (2.0 * b * b * s * s + b**3 * s) / poles,
                  b**3 * s * s / poles)
    x1, x2 = x1 + lead * x2 + 0.5 * lead * lead * x3, x2 + lead * x3
    shaped = x1 if axis.controller == 'pid' else (x3 + 2.0 / h0 * x2 + x1 / h0**2) / (s + 1.0 / h0)**2
    return shaped * np.exp(-lead * s)


def open_loop(params: 'AcuParameters', name: str, bandwidth: RadiansPerSecond, s: Complexes) -> Complexes:
    """Return the open loop of an axis through a model of a bandwidth."""
    axis = position_loop.slowed(getattr(params, name), params.command_delay)
    delay = params.command_delay + 0.5 * params.period
    lead = delay + params.receiver_latency + params.tracker.receiver.age
    return (twist(axis, s) * axis_response(axis, delay, s)
            * filter_response(axis, bandwidth, lead, s))


def margin(params: 'AcuParameters', name: str, bandwidth: RadiansPerSecond) -> float:
    """Return the margin of the loop of an axis through a model of a bandwidth."""
    structure = getattr(params, name).structure
    # Resonances are narrow near the frequencies on a locked and on a free base.
    free = 1.0 / math.sqrt(1.0 - structure.inertia_share)
    relative = np.concatenate((np.geomspace(0.05, 20.0, 400), np.linspace(0.8, 1.2 * free, 800),
                               1.0 + 0.1 * np.linspace(-1.0, 1.0, 201)**3))
    L = open_loop(params, name, bandwidth, 2j * math.pi * structure.frequency * np.sort(relative))
    share = np.clip(-L.real / np.abs(L)**2, 0.0, 1.0)
    return float(np.abs(1.0 + share * L).min())


def bandwidths(filter_params: 'FilterParameters', receiver: 'ReceiverModelParameters') -> list[RadiansPerSecond]:
    """Return the bandwidth of each model ca of the ladder, at the largest C/N0 of the receiver."""
    imm = filter_params.imm
    variance = error_variance(0.0, 0.0, receiver.cn0_dbhz, record(receiver, type(receiver))[0])
    density = math.sqrt(variance * receiver.integration)
    return [(imm.ca.noise * imm.rung_ratio**rung / density)**(1.0 / 3.0) for rung in range(imm.rungs)]


def rungs_with_margin(params: 'AcuParameters', name: str) -> int:
    """Return the number of models ca of an axis up to the last usable one; all of them on a rigid axis."""
    axis = getattr(params, name)
    if axis.structure.inertia_share == 0.0 or axis.controller == 'beam' or not FILTER_KINDS[axis.filter.kind].ladder:
        return axis.filter.imm.rungs
    highest = 2.0 * math.pi * axis.structure.frequency / MIN_FREQUENCY_RATIO
    return sum(1 for _ in itertools.takewhile(lambda b: b <= highest and margin(params, name, b) >= MIN_MARGIN,
                                              bandwidths(axis.filter, params.tracker.receiver)))


def filters(params: 'AcuParameters') -> 'list[FilterParameters]':
    """Return the filters of both axes with the models ca that have the margin, and at least one model ca."""
    made = []
    for name in AXES:
        own = getattr(params, name).filter
        rungs = max(1, rungs_with_margin(params, name))
        made.append(dataclasses.replace(own, imm=dataclasses.replace(own.imm, rungs=rungs)))
    return made


def remarks(params: 'AcuParameters') -> list[str]:
    """Return a line on the axes whose filter cannot use all its models; no line if there is none."""
    limited: list[str] = []
    none: list[str] = []
    for name in AXES:
        axis, rungs = getattr(params, name), rungs_with_margin(params, name)
        if rungs < axis.filter.imm.rungs:
            limited.append(f'{max(1, rungs)} of its {axis.filter.imm.rungs} models ca in {name} (structure of '
                           f'{axis.structure.frequency:g} Hz)')
        if rungs == 0:
            none.append(name)
    if not limited:
        return []
    why = (f'{" and ".join(none)} may swing with any of them; run `pedestal tune --loops`' if none else
           'a faster model would swing the structure')
    return [f'the filter uses {" and ".join(limited)}; {why}']
