"""The truth of the ship at an instant: position, attitude and their exact derivatives.

The law is stateless: the same seed and time give the same bits in any order.
"""
import math
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion, rotation, to_deck
from pedestal_common.quantities import (
    Floats,
    Matrix3,
    MetersPerSecond,
    Quaternion,
    Radians,
    RadiansPerSecond,
    RadiansPerSecond2,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record
from ship_motion_sim import recording, waves
from ship_motion_sim.params import RecordedParameters, ShipParameters
from ship_motion_sim.waves import FREEDOM_COUNT, HEAVE, PITCH, ROLL, SURGE, SWAY, WAVE_COMPONENT_COUNT, YAW

MOTION_STATUS_TEXTS = ('ok', 'time is not finite')
MOTION_OK, MOTION_BAD_TIME = range(len(MOTION_STATUS_TEXTS))

class Constants(Record):
    """Components of a seaway, or a recorded motion."""
    frequency: Annotated[Floats, (WAVE_COMPONENT_COUNT,)]   # w_e [rad/s]; components not in use are 0
    phase: Annotated[Floats, (WAVE_COMPONENT_COUNT,)]       # [rad]
    cosine: Annotated[Floats, (WAVE_COMPONENT_COUNT, FREEDOM_COUNT)]    # Re X [m, rad]
    sine: Annotated[Floats, (WAVE_COMPONENT_COUNT, FREEDOM_COUNT)]      # -Im X
    yaw: Radians            # mean heading as REP 103 yaw
    cos_yaw: float
    sin_yaw: float
    speed: MetersPerSecond
    pieces: int             # number of pieces of a recorded motion; 0: components
    breaks: Annotated[Floats, (recording.MAX_PIECES + 1,)]  # [s]
    # [m, rad], highest power first
    coefficients: Annotated[Floats, (recording.MAX_PIECES, FREEDOM_COUNT, recording.COEFFICIENTS_PER_PIECE)]


class Truth(Record):
    """Motion of the ship at an instant; roll, pitch and yaw as in REP 103."""
    status: int             # index into MOTION_STATUS_TEXTS; unless MOTION_OK, the rest is NaN
    # surge, sway, heave [m], roll, pitch, yaw about the mean heading [rad]; rows: value, first, second derivative
    freedoms: Annotated[Floats, (3, FREEDOM_COUNT)]
    position: Vector3       # ENU [m]
    velocity: Vector3       # ENU [m/s]
    acceleration: Vector3   # ENU [m/s2]
    velocity_deck: Vector3  # FLU [m/s]
    roll: Radians
    pitch: Radians
    yaw: Radians
    quaternion: Quaternion  # deck -> earth
    mat_ed: Matrix3         # deck -> earth
    angular_velocity: Vector3       # FLU, against the earth [rad/s]
    angular_acceleration: Vector3   # FLU [rad/s2]


def constants(params: ShipParameters) -> Records:
    """Return the Constants (1,) of a seaway or of a recorded motion. Raises csv_table.TableError."""
    record = Constants.zeros()
    if params.motion == 'recorded':
        yaw = _put_recorded(record, params.recorded)
    else:
        yaw = math.radians(90.0 - params.heading_deg)
        _put_components(record, waves.build(params))
    record['yaw'], record['cos_yaw'], record['sin_yaw'] = yaw, math.cos(yaw), math.sin(yaw)
    record['speed'] = params.speed
    return record


def summary(params: ShipParameters, duration: Seconds = math.inf) -> tuple[str, ...]:
    """Return a line on the file of the motion, () without a file, and one if a recorded motion ends before the run.
    Raises csv_table.TableError for a file that cannot be used."""
    if params.motion == 'recorded':
        times, _, description = recording.read(params.recorded)
        ends = (f'the recorded motion of the ship ends after {times[-1]:.4g} s of the run; the deck is at rest after '
                f'it',) if times[-1] < duration < math.inf else ()
        return (description, *ends)
    return (waves.measured(params).description,) if params.spectrum == 'file' else ()


def _put_components(record: Records, sines: waves.Waves) -> None:
    count = len(sines.frequency)
    record['frequency'][0, :count] = sines.frequency
    record['phase'][0, :count] = sines.phase
    record['cosine'][0, :count] = sines.response.real
    record['sine'][0, :count] = -sines.response.imag


def _put_recorded(record: Records, params: RecordedParameters) -> Radians:
    """Put the recorded motion into the record. Return its mean yaw."""
    times, freedoms, _ = recording.read(params)
    mean = float(np.mean(freedoms[:, YAW]))
    freedoms[:, YAW] -= mean
    breaks, coefficients = recording.spline_with_ends(times, freedoms)
    count = len(coefficients)
    record['pieces'] = count
    record['breaks'][0, :count + 1] = breaks
    record['coefficients'][0, :count] = coefficients
    return mean


@compiled
def sin_cos(angle: Radians) -> tuple[float, float]:
    """Return (sin, cos) of an angle, with errors below 1e-15 up to 1e6 rad.

    Over an array this function is four times as fast as those of libm, because the compiler vectorises it. Reduction
    and polynomials are those of fdlibm (Sun Microsystems 1993: e_rem_pio2.c, k_sin.c, k_cos.c).
    """
    # n quarter turns, subtracted as three parts of pi / 2, so that the remainder r has no rounding error.
    n = math.floor(angle * (2.0 / math.pi) + 0.5)
    r = angle - n * 1.57079632673412561417 - n * 6.07710050630396597660e-11 - n * 2.02226624879595063154e-21
    z = r * r
    s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * (
            -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))))
    c = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (
        2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * (
            2.08757232129817482790e-09 - z * 1.13596475577881948265e-11)))))
    quadrant = n - 4.0 * math.floor(0.25 * n)
    odd = quadrant == 1.0 or quadrant == 3.0
    sine, cosine = (c, s) if odd else (s, c)
    return (-sine if quadrant >= 2.0 else sine,
            -cosine if quadrant == 1.0 or quadrant == 2.0 else cosine)


@compiled
def sum_components(ship: Constants, t: Seconds, freedoms: Floats) -> None:
    """Fill freedoms (3, 6) with the sum of all components at t and its first and second derivative."""
    # Row 0 holds the sines, row 1 the cosines. Their loop is separate, because the compiler then vectorises it.
    wave = np.empty((2, WAVE_COMPONENT_COUNT))
    for i in range(WAVE_COMPONENT_COUNT):
        wave[0, i], wave[1, i] = sin_cos(ship.frequency[i] * t + ship.phase[i])
    for d in range(FREEDOM_COUNT):
        freedoms[0, d] = freedoms[1, d] = freedoms[2, d] = 0.0
    for i in range(WAVE_COMPONENT_COUNT):
        w, s, c = ship.frequency[i], wave[0, i], wave[1, i]
        for d in range(FREEDOM_COUNT):
            x = ship.cosine[i, d] * c + ship.sine[i, d] * s
            freedoms[0, d] += x
            freedoms[1, d] += w * (ship.sine[i, d] * c - ship.cosine[i, d] * s)
            freedoms[2, d] -= w * w * x


@compiled
def body_rates(roll: Radians, pitch: Radians, roll_1: RadiansPerSecond, pitch_1: RadiansPerSecond,
               yaw_1: RadiansPerSecond, roll_2: RadiansPerSecond2, pitch_2: RadiansPerSecond2,
               yaw_2: RadiansPerSecond2) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the rate of the deck w [rad/s] and its derivative dw [rad/s2], FLU, from the derivatives .._1, .._2 of
    mat_ed = Rz(yaw) Ry(pitch) Rx(roll)."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    wx = roll_1 - yaw_1 * sp
    wy = pitch_1 * cr + yaw_1 * sr * cp
    wz = -pitch_1 * sr + yaw_1 * cr * cp
    dwx = roll_2 - yaw_2 * sp - yaw_1 * pitch_1 * cp
    dwy = pitch_2 * cr + yaw_2 * sr * cp - yaw_1 * pitch_1 * sr * sp + roll_1 * wz
    dwz = -pitch_2 * sr + yaw_2 * cr * cp - yaw_1 * pitch_1 * cr * sp - roll_1 * wy
    return (wx, wy, wz), (dwx, dwy, dwz)


@compiled
def course_to_earth(ship: Constants, along: float, port: float) -> tuple[float, float]:
    """Return (east, north) of a horizontal vector given along the mean course and to port of it, any unit."""
    return ship.cos_yaw * along - ship.sin_yaw * port, ship.sin_yaw * along + ship.cos_yaw * port


@compiled
def truth(ship: Constants, t: Seconds, out: Truth) -> None:
    """Fill out with the truth at time t."""
    out.status = MOTION_OK if math.isfinite(t) else MOTION_BAD_TIME
    x = out.freedoms
    if ship.pieces > 0 and out.status == MOTION_OK:
        recording.evaluate(ship.breaks, ship.coefficients, ship.pieces, t, x)
    else:
        sum_components(ship, t, x)
    p, v, a = out.position, out.velocity, out.acceleration
    p[0], p[1] = course_to_earth(ship, ship.speed * t + x[0, SURGE], x[0, SWAY])
    v[0], v[1] = course_to_earth(ship, ship.speed + x[1, SURGE], x[1, SWAY])
    a[0], a[1] = course_to_earth(ship, x[2, SURGE], x[2, SWAY])
    p[2], v[2], a[2] = x[0, HEAVE], x[1, HEAVE], x[2, HEAVE]
    roll, pitch, yaw = x[0, ROLL], x[0, PITCH], ship.yaw + x[0, YAW]
    out.roll, out.pitch, out.yaw = roll, pitch, yaw
    q = out.quaternion
    q[0], q[1], q[2], q[3] = quaternion(roll, pitch, yaw)
    rotation(q[0], q[1], q[2], q[3], out.mat_ed)
    w, dw, u = out.angular_velocity, out.angular_acceleration, out.velocity_deck
    (w[0], w[1], w[2]), (dw[0], dw[1], dw[2]) = body_rates(
        roll, pitch, x[1, ROLL], x[1, PITCH], x[1, YAW], x[2, ROLL], x[2, PITCH], x[2, YAW])
    u[0], u[1], u[2] = to_deck(out.mat_ed, v[0], v[1], v[2])
