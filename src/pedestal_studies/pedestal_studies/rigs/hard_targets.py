"""Targets that manoeuvre hard, as tables of azimuth and elevation seen from the antenna.

Positions are in metres east, north and up of the antenna. Each function takes times t (n,) [s], at a constant period,
and returns (azimuth, elevation), both (n,) [rad].
"""
import functools
import math

import numpy as np

from pedestal_studies.rigs import profiles

G_M_S2 = 9.81  # acceleration of gravity [m/s2]
STEP_RATE_HZ = 100.0  # rate of the rows of a table


def _seen(east, north, up):
    """Return (azimuth, elevation) of positions [m]."""
    return np.unwrap(np.arctan2(east, north)), np.arctan2(up, np.hypot(east, north))


def _integrated(t, rate, start):
    """Return the integral of `rate` (n,) over t by the rule of the trapezium, from a value `start`."""
    return start + np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))))


def s_motion(t):
    """Return the S motion of paper 003: 20 deg to and fro at 3.5 deg/s, reversals of 1 s (11 deg/s2)."""
    azimuth = profiles.s_motion(t, math.radians(20.0), math.radians(3.5), 1.0)[0]
    return azimuth, np.full(t.size, math.radians(30.0))


def quadcopter(t):
    """Return dashes of 12 m/s across the line of sight at 120 m, with 0.5 g and stops of 2 s between them."""
    speed, push, stop, cruise = 12.0, 0.5 * G_M_S2, 2.0, 4.0
    ramp = speed / push
    dash = 2.0 * ramp + cruise
    half, r = np.divmod(t, dash + stop)
    v = np.clip(np.minimum(push * r, push * (dash - r)), 0.0, speed) * (1.0 - 2.0 * (half % 2))
    east = _integrated(t, v, -0.5 * speed * (cruise + ramp))
    return _seen(east, np.full(t.size, 115.0), np.full(t.size, 35.0))


def launch_vehicle(t):
    """Return an ascent 5 km away: thrust acceleration from 0.4 g to 3 g in 60 s, tilted from the vertical by
    0.6 deg/s after 10 s."""
    net = G_M_S2 * (0.4 + 2.6 * np.minimum(t / 60.0, 1.0))
    pitch = np.radians(0.6) * np.maximum(t - 10.0, 0.0)
    v_up, v_east = _integrated(t, net * np.cos(pitch), 0.0), _integrated(t, net * np.sin(pitch), 0.0)
    return _seen(_integrated(t, v_east, 0.0), np.full(t.size, 5000.0), _integrated(t, v_up, 200.0))


def _turning(t, speed, turn, leg, load, start):
    """Return (azimuth, elevation) of an aircraft that turns left and right alternately, with straight legs between.

    speed [m/s]; turn: angle of each turn [rad]; leg: duration of a straight leg [s]; load: lateral acceleration [g];
    start: position at the start [m], on the way to the east.
    """
    rate = load * G_M_S2 / speed
    half, r = np.divmod(t, leg + turn / rate)
    turning = np.where(r >= leg, rate, 0.0) * (1.0 - 2.0 * (half % 2))
    # An aircraft takes 0.5 s to bank.
    width = round(0.5 * STEP_RATE_HZ)
    turning = np.convolve(np.pad(turning, (width, 0), 'edge'), np.full(width + 1, 1.0 / (width + 1)), 'valid')
    (east, north, up), psi = start, _integrated(t, turning, 0.5 * math.pi)
    return _seen(_integrated(t, speed * np.sin(psi), east), _integrated(t, speed * np.cos(psi), north),
                 np.full(t.size, up))


HARD_TARGETS = {
    's_motion': s_motion, 'quadcopter': quadcopter, 'launch_vehicle': launch_vehicle,
    'jet': functools.partial(_turning, speed=250.0, turn=math.pi, leg=4.0, load=6.0, start=(-2000.0, 2500.0, 1200.0)),
    'stunt_plane': functools.partial(_turning, speed=60.0, turn=2.0 * math.pi, leg=2.0, load=3.0,
                                     start=(-250.0, 750.0, 250.0)),
    'helicopter': functools.partial(_turning, speed=50.0, turn=0.5 * math.pi, leg=12.0, load=0.4,
                                    start=(-1000.0, 2000.0, 500.0))}
"""{name: function of t}."""


def write(path, name, duration):
    """Write the table of a target over a duration [s] as a CSV that a track_file reads."""
    t = np.arange(round(duration * STEP_RATE_HZ) + 1) / STEP_RATE_HZ
    azimuth, elevation = HARD_TARGETS[name](t)
    np.savetxt(path, np.column_stack((t, np.degrees(azimuth), np.degrees(elevation))), '%.9f', ',',
               header='time [s],azimuth [deg],elevation [deg]', comments='')
