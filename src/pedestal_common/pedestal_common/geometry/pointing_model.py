"""Pointing model of a pedestal: conversion between the direction of the beam on the sky and the encoder angles.

The terms have the numbers and signs of the VLBI Field System and of katpoint. Each term is ADDED to the wanted angles
to give the angles of the encoders. To first order the sums dA and dE [rad], at the azimuth A and the elevation E, are

    dA = P1 + P3 tan E - P4 / cos E + (P5 sin A - P6 cos A) tan E + P12 A + P13 cos A + P14 sin A
         + P17 cos 2A + P18 sin 2A
    dE = P7 + P5 cos A + P6 sin A + P8 cos E + P9 E + P11 sin E + P15 cos 2A + P16 sin 2A + P19 cos 8E + P20 sin 8E
         + P21 cos A + P22 sin A

P2 and P10 do not exist, because other terms have the same effect. P9 and P12 are factors [-], all other terms are
angles [rad].

This module computes the terms P1 and P3 to P8 exactly, at any elevation. From the encoders to the sky:

    1. P1 and P7, the zeros, are subtracted from the angles of the encoders; the results are a and e
    2. the periodic terms and the factors, with a and e for A and E, are subtracted; the sag P8 is among them
    3. P4 sets the beam off the normal of the elevation axis (collimation)
    4. the elevation turns the beam
    5. P3 leans the elevation axis (non-perpendicularity)
    6. the azimuth turns the elevation axis
    7. P5 and P6 lean the azimuth axis (tilt): P5 to azimuth 0, P6 to azimuth 90 deg

Steps 2 to 7 are those of the simulated pedestal (adu_drive.plant.mount), which is written on its own, so that a test
can compare both. The conversion from the sky to the encoders is the exact inverse.

Past the zenith the elevation is above 90 deg, of the encoders as well as of a direction. The axes then point over the
back: the azimuth A and the elevation E are the direction with the azimuth A + 180 deg and the elevation 180 deg - E.
Within abs(P3 - P4) of the azimuth axis the beam points nowhere. For a direction in this cone the result is the nearest
one on its edge.

On the sky means in the frame of the deck: azimuth clockwise from the bow, ashore from north. On a ship the tilt is the
misalignment between the INS and the pedestal.

A, E     azimuth and elevation of the encoders [rad]
a, e     the same without the zeros [rad]
suffix _dot, _ddot   first and second time derivative
"""
import math
from collections.abc import Mapping
from typing import Annotated, TypeAlias

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import angles, direction, wrap
from pedestal_common.quantities import (
    Bit,
    Direction,
    Floats,
    Matrix3,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Xyz,
)
from pedestal_common.record import Record

AxisMotion: TypeAlias = tuple[Radians, RadiansPerSecond, RadiansPerSecond2]
"""Angle of an axis with its first and second time derivative."""

FACTORS = ('p9', 'p12')  # terms that are factors [-]; the others are angles [rad]


class Terms(Record, align=False):
    """Terms by name; p9 and p12 are factors."""
    p1: Radians
    p3: Radians
    p4: Radians
    p5: Radians
    p6: Radians
    p7: Radians
    p8: Radians
    p9: float
    p11: Radians
    p12: float
    p13: Radians
    p14: Radians
    p15: Radians
    p16: Radians
    p17: Radians
    p18: Radians
    p19: Radians
    p20: Radians
    p21: Radians
    p22: Radians


TERMS = tuple(Terms.__annotations__)  # names of the terms


class PointingModel(Record):
    """Pointing model. All fields follow from `terms`."""
    terms: Annotated[Floats, (len(TERMS),)]
    exact: Bit              # 1: all terms are zero, so that encoders and sky have the same angles
    periodic: Bit           # 1: a term of step 2 is not zero
    p: Terms                # the same values as `terms`
    tilt: Matrix3           # rotation from the frame of the azimuth axis to the deck, FLU
    sin_lean: float         # of P3
    cos_lean: float
    sin_off: float          # of P4
    cos_off: float


MIN_ZENITH_DISTANCE_RAD = 1e-6  # distance from the azimuth axis below which the rates of the azimuth are limited [rad]
MAX_CONE_ROUNDING = 1e-12  # excess of a sine over 1 that is rounding, not a direction that the beam cannot reach

NEWTON_STEPS = 6
"""Steps of Newton's method that invert the periodic terms; each step doubles the number of correct digits."""


def model(terms: Mapping[str, float]) -> Records:
    """Return the PointingModel (1,) of {name: term}; the others of TERMS are 0."""
    unknown = sorted(set(terms) - set(TERMS))
    if unknown:
        raise ValueError(f'term {unknown[0]}: must be one of {", ".join(TERMS)}')
    m = PointingModel.zeros()
    put(m[0], np.array([terms.get(name, 0.0) for name in TERMS]))
    return m


@compiled
def put(model: PointingModel, terms: Floats) -> None:
    """Set a model to the values (20,) of TERMS."""
    p, zero = model.p, True
    for i in range(len(terms)):
        model.terms[i] = terms[i]
        zero &= terms[i] == 0.0
    (p.p1, p.p3, p.p4, p.p5, p.p6, p.p7, p.p8, p.p9, p.p11, p.p12) = (
        terms[0], terms[1], terms[2], terms[3], terms[4], terms[5], terms[6], terms[7], terms[8], terms[9])
    (p.p13, p.p14, p.p15, p.p16, p.p17, p.p18, p.p19, p.p20, p.p21, p.p22) = (
        terms[10], terms[11], terms[12], terms[13], terms[14], terms[15], terms[16], terms[17], terms[18], terms[19])
    model.exact, model.periodic = 1 if zero else 0, 0
    for i in range(6, len(terms)):
        if terms[i] != 0.0:
            model.periodic = 1
    model.sin_lean, model.cos_lean = math.sin(p.p3), math.cos(p.p3)
    model.sin_off, model.cos_off = math.sin(p.p4), math.cos(p.p4)
    # The rotation by the tilt is one by the angle tau about the level axis (x, y) = (P6, P5) / tau.
    tau = math.hypot(p.p5, p.p6)
    x, y = (p.p6 / tau, p.p5 / tau) if tau > 0.0 else (0.0, 0.0)
    s, d = math.sin(tau), 1.0 - math.cos(tau)
    T = model.tilt
    T[0, 0], T[0, 1], T[0, 2] = 1.0 - d * y * y, d * x * y, s * y
    T[1, 0], T[1, 1], T[1, 2] = d * x * y, 1.0 - d * x * x, -s * x
    T[2, 0], T[2, 1], T[2, 2] = -s * y, s * x, 1.0 - d


@compiled
def put_between(model: PointingModel, before: Floats, after: Floats, x: float) -> None:
    """Set a model between the terms `before` and `after` at the share x of the time, without a rate at both ends."""
    share, terms = x * x * (3.0 - 2.0 * x), model.terms
    for i in range(len(terms)):
        terms[i] = after[i] if x == 1.0 else before[i] + share * (after[i] - before[i])
    put(model, terms)


@compiled
def _azimuth_terms(p: Terms, a: Radians) -> tuple[Radians, float, float]:
    """Return (the periodic terms of the azimuth at a, their first and second derivative by a)."""
    s, c, s2, c2 = math.sin(a), math.cos(a), math.sin(2.0 * a), math.cos(2.0 * a)
    return (p.p12 * a + p.p13 * c + p.p14 * s + p.p17 * c2 + p.p18 * s2,
            p.p12 - p.p13 * s + p.p14 * c + 2.0 * (p.p18 * c2 - p.p17 * s2),
            -p.p13 * c - p.p14 * s - 4.0 * (p.p17 * c2 + p.p18 * s2))


@compiled
def _nod(p: Terms, a: Radians) -> tuple[Radians, float, float]:
    """Return (the terms of the elevation that depend on a, their first and second derivative by a)."""
    s, c, s2, c2 = math.sin(a), math.cos(a), math.sin(2.0 * a), math.cos(2.0 * a)
    return (p.p15 * c2 + p.p16 * s2 + p.p21 * c + p.p22 * s,
            2.0 * (p.p16 * c2 - p.p15 * s2) + p.p22 * c - p.p21 * s,
            -4.0 * (p.p15 * c2 + p.p16 * s2) - p.p21 * c - p.p22 * s)


@compiled
def _elevation_terms(p: Terms, e: Radians) -> tuple[Radians, float, float]:
    """Return (the terms of the elevation that depend on e, their first and second derivative by e)."""
    s, c, s8, c8 = math.sin(e), math.cos(e), math.sin(8.0 * e), math.cos(8.0 * e)
    return (p.p8 * c + p.p9 * e + p.p11 * s + p.p19 * c8 + p.p20 * s8,
            -p.p8 * s + p.p9 + p.p11 * c + 8.0 * (p.p20 * c8 - p.p19 * s8),
            -p.p8 * c - p.p11 * s - 64.0 * (p.p19 * c8 + p.p20 * s8))


@compiled
def _leaning(model: PointingModel, x: float, y: float, z: float) -> Xyz:
    """Return a vector of the elevating part in the frame of the yoke, whose elevation axis leans."""
    return x, model.cos_lean * y + model.sin_lean * z, model.cos_lean * z - model.sin_lean * y


@compiled
def _to_deck(T: Matrix3, x: float, y: float, z: float) -> Xyz:
    return (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z, T[1, 0] * x + T[1, 1] * y + T[1, 2] * z,
            T[2, 0] * x + T[2, 1] * y + T[2, 2] * z)


@compiled
def _from_deck(T: Matrix3, v: Xyz) -> Xyz:
    x, y, z = v
    return (T[0, 0] * x + T[1, 0] * y + T[2, 0] * z, T[0, 1] * x + T[1, 1] * y + T[2, 1] * z,
            T[0, 2] * x + T[1, 2] * y + T[2, 2] * z)


@compiled
def direction_motion(model: PointingModel, A: Radians, E: Radians, A_dot: RadiansPerSecond,
                     E_dot: RadiansPerSecond) -> tuple[Direction, tuple[RadiansPerSecond, RadiansPerSecond]]:
    """Return ((azimuth, elevation), their rates) of the beam on the sky, of angles and rates of the encoders. The
    azimuth is in the turn of the axis. If the beam is past the zenith, the elevation is above 90 deg."""
    a, e = A - model.p.p1, E - model.p.p7
    azimuth, elevation, azimuth_dot, elevation_dot = a, e, A_dot, E_dot
    if model.periodic:
        g, g_slope, _ = _azimuth_terms(model.p, a)
        nod, nod_slope, _ = _nod(model.p, a)
        f, f_slope, _ = _elevation_terms(model.p, e)
        azimuth, elevation = a - g, e - f - nod
        azimuth_dot, elevation_dot = (1.0 - g_slope) * A_dot, (1.0 - f_slope) * E_dot - nod_slope * A_dot
    cos_E, sin_E = math.cos(elevation), math.sin(elevation)
    x, y, z = _leaning(model, model.cos_off * cos_E, -model.sin_off, model.cos_off * sin_E)
    vx, vy, vz = _leaning(model, -model.cos_off * sin_E * elevation_dot, 0.0, model.cos_off * cos_E * elevation_dot)
    cos_A, sin_A = math.cos(azimuth), math.sin(azimuth)
    x, y = x * cos_A + y * sin_A, y * cos_A - x * sin_A
    vx, vy = vx * cos_A + vy * sin_A + azimuth_dot * y, vy * cos_A - vx * sin_A - azimuth_dot * x
    x, y, z = _to_deck(model.tilt, x, y, z)
    vx, vy, vz = _to_deck(model.tilt, vx, vy, vz)
    at, above = angles(x, y, z)
    level = max(x * x + y * y, MIN_ZENITH_DISTANCE_RAD * MIN_ZENITH_DISTANCE_RAD)
    at_dot, above_dot = (y * vx - x * vy) / level, vz / math.sqrt(level)
    if cos_E < 0.0:
        at, above, above_dot = at + math.pi, math.pi - above, -above_dot
    return (azimuth + wrap(at - azimuth), above), (at_dot, above_dot)


@compiled
def direction_of(model: PointingModel, A: Radians, E: Radians) -> Direction:
    """Return the direction of the beam on the sky; A, E: angles of the encoders."""
    if model.exact:
        return A, E
    on_sky, _ = direction_motion(model, A, E, 0.0, 0.0)
    return on_sky


@compiled
def _angle_rates(x: float, y: float, v: Xyz, w: Xyz, level: float) -> tuple[float, float]:
    """Return the first and second time derivative of the azimuth of a vector, whose derivatives are v and w. level:
    x^2 + y^2, limited from below."""
    rate = (y * v[0] - x * v[1]) / level
    return rate, (y * w[0] - x * w[1] - 2.0 * rate * (x * v[0] + y * v[1])) / level


@compiled
def _axis_motion(model: PointingModel, u: Xyz, v: Xyz, w: Xyz,
                 plunged: bool) -> tuple[AxisMotion, AxisMotion, bool]:
    """Return (motion of the azimuth, that of the elevation, reachable) after steps 3 to 7 are undone, as in
    encoder_motion. The azimuth is in no particular turn."""
    x, y, z = _from_deck(model.tilt, u)
    v, w = _from_deck(model.tilt, v), _from_deck(model.tilt, w)
    # q: sine of the elevation; (x_m, y_m): horizontal part of the beam at azimuth 0; level: its squared length.
    k = 1.0 / (model.cos_lean * model.cos_off)
    q, q_dot, q_ddot = k * (z - model.sin_lean * model.sin_off), k * v[2], k * w[2]
    reachable = abs(q) <= 1.0 + MAX_CONE_ROUNDING
    q = min(max(q, -1.0), 1.0)
    level = x * x + y * y
    y_m = model.sin_lean * model.cos_off * q - model.cos_lean * model.sin_off
    x_m = math.sqrt(max(level - y_m * y_m, 0.0)) if reachable else 0.0
    c = x_m / model.cos_off
    if plunged:
        x_m, c = -x_m, -c
    elevation = math.atan2(q, c)
    # Near the azimuth axis the rates are limited.
    level = max(level, MIN_ZENITH_DISTANCE_RAD * MIN_ZENITH_DISTANCE_RAD)
    e_dot = e_ddot = 0.0
    if reachable:
        c_limited = math.copysign(max(abs(c), MIN_ZENITH_DISTANCE_RAD), c)
        e_dot = q_dot / c_limited
        e_ddot = (q_ddot + q * e_dot * e_dot) / c_limited
    azimuth = math.atan2(-y, x) - math.atan2(-y_m, x_m)
    a_dot, a_ddot = _angle_rates(x, y, v, w, level)
    if y_m != 0.0 or model.sin_lean != 0.0:
        lean, off = model.sin_lean * model.cos_off, model.cos_off
        beam_v = (-off * q * e_dot, lean * c * e_dot, 0.0)
        beam_w = (-off * (q * e_ddot + c * e_dot * e_dot), lean * (c * e_ddot - q * e_dot * e_dot), 0.0)
        m_dot, m_ddot = _angle_rates(x_m, y_m, beam_v, beam_w, level)
        a_dot, a_ddot = a_dot - m_dot, a_ddot - m_ddot
    return (azimuth, a_dot, a_ddot), (elevation, e_dot, e_ddot), reachable


@compiled
def encoder_motion(model: PointingModel, u: Xyz, v: Xyz, w: Xyz, plunged: bool,
                   near: Radians) -> tuple[AxisMotion, AxisMotion, bool]:
    """Return the motion of the encoders that keeps the beam on a moving direction, and whether the beam reaches it.

    u, v, w: unit vector of the direction on the sky, FLU, and its derivatives; plunged: the axes point to it over the
    zenith; near: azimuth near which that of the axis is chosen.
    """
    (azimuth, a_dot, a_ddot), (elevation, e_dot, e_ddot), reachable = _axis_motion(model, u, v, w, plunged)
    azimuth = near + wrap(azimuth - near)
    a, e = azimuth, elevation
    if model.periodic:
        for _ in range(NEWTON_STEPS):
            g, g_slope, _ = _azimuth_terms(model.p, a)
            a -= (a - g - azimuth) / (1.0 - g_slope)
        nod, nod_slope, nod_bend = _nod(model.p, a)
        for _ in range(NEWTON_STEPS):
            f, f_slope, _ = _elevation_terms(model.p, e)
            e -= (e - f - nod - elevation) / (1.0 - f_slope)
        g, g_slope, g_bend = _azimuth_terms(model.p, a)
        f, f_slope, f_bend = _elevation_terms(model.p, e)
        a_dot = a_dot / (1.0 - g_slope)
        a_ddot = (a_ddot + g_bend * a_dot * a_dot) / (1.0 - g_slope)
        e_dot = (e_dot + nod_slope * a_dot) / (1.0 - f_slope)
        e_ddot = (e_ddot + nod_slope * a_ddot + nod_bend * a_dot * a_dot + f_bend * e_dot * e_dot) / (1.0 - f_slope)
    return (a + model.p.p1, a_dot, a_ddot), (e + model.p.p7, e_dot, e_ddot), reachable


@compiled
def encoder_of(model: PointingModel, azimuth: Radians, elevation: Radians) -> tuple[Radians, Radians, bool]:
    """Return (A, E, reachable): the angles of the encoders at which the beam points to a direction on the sky, or to
    the nearest reachable one. An elevation above 90 deg points over the zenith. The azimuth of the axis is the one
    nearest to `azimuth`, which counts revolutions."""
    if model.exact:
        return azimuth, elevation, True
    zero = (0.0, 0.0, 0.0)
    A, E, reachable = encoder_motion(model, direction(azimuth, elevation), zero, zero, math.cos(elevation) < 0.0,
                                     azimuth)
    return A[0], E[0], reachable

