"""What a strapdown IMU at the deck's origin reports: specific force and angular rate as REP 145 wants them.

    inputs['dt'] = step [s]; step(constants(params), inputs, truth, outputs, normals)
"""
import math

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.line_of_sight import to_deck
from ship_motion_sim import earth, motion
from ship_motion_sim.params import ShipMotionParameters

NORMALS = 6     # standard normals a step takes: three gyros, three accelerometers
STATUS = ('ok', 'step is not positive', 'truth is not valid')
OK, BAD_STEP, BAD_TRUTH = range(len(STATUS))

CONSTANTS = np.dtype([
    ('earth_rate', 'f8', (3,)),                 # ENU [rad/s]
    ('gravity', 'f8'),                          # [m/s2]
    ('gyro_bias', 'f8', (3,)),                  # [rad/s]
    ('gyro_noise', 'f8'),                       # [rad/sqrt(s)]
    ('accelerometer_bias', 'f8', (3,)),         # [m/s2]
    ('accelerometer_noise', 'f8'),              # [m/s/sqrt(s)]
], align=True)

INPUTS = np.dtype([('dt', 'f8')], align=True)   # time since the last sample; in the first step, the period [s]

OUTPUTS = np.dtype([
    ('status', 'i8'),                           # index into STATUS; not OK: the rest is NaN
    ('angular_velocity', 'f8', (3,)),           # against inertial space, FLU [rad/s]
    ('linear_acceleration', 'f8', (3,)),        # specific force, FLU [m/s2]: at rest +g along z
], align=True)


def constants(params: ShipMotionParameters) -> np.ndarray:
    """The record (1,) of CONSTANTS."""
    imu, latitude = params.imu, math.radians(params.ship.latitude_deg)
    record = np.zeros(1, CONSTANTS)
    record['earth_rate'] = earth.rate(latitude)
    record['gravity'] = earth.gravity(latitude)
    record['gyro_bias'] = imu.gyro_bias_x, imu.gyro_bias_y, imu.gyro_bias_z
    record['gyro_noise'] = imu.gyro_noise
    record['accelerometer_bias'] = imu.accelerometer_bias_x, imu.accelerometer_bias_y, imu.accelerometer_bias_z
    record['accelerometer_noise'] = imu.accelerometer_noise
    return record


@compiled
def inertial_rate(truth, earth_rate):
    """Angular rate of the deck against inertial space (x, y, z), FLU [rad/s]; earth_rate (3,) in ENU."""
    ex, ey, ez = to_deck(truth.mat_ed, earth_rate[0], earth_rate[1], earth_rate[2])
    w = truth.angular_velocity
    return w[0] + ex, w[1] + ey, w[2] + ez


@compiled
def specific_force(truth, earth_rate, gravity):
    """mat_ed^T (a + 2 w_ie x v - g), FLU [m/s2]; earth_rate (3,) = w_ie in ENU.

    The earth is the rotating tangent plane in which the truth is given, with g constant along -z: gravity does not
    turn with the ship's place (v/R = 1e-6 rad/s at 7 m/s), and the rate above holds no transport rate either.
    """
    a, v, e = truth.acceleration, truth.velocity, earth_rate
    return to_deck(truth.mat_ed,
                   a[0] + 2.0 * (e[1] * v[2] - e[2] * v[1]),
                   a[1] + 2.0 * (e[2] * v[0] - e[0] * v[2]),
                   a[2] + 2.0 * (e[0] * v[1] - e[1] * v[0]) + gravity)


@compiled
def step(constants, inputs, truth, outputs, normals):
    """One sample. truth: motion.OUTPUTS (1,) at the instant of the sample; normals (NORMALS,) standard normals.

    White noise is given as a density, so a sample carries density / sqrt(dt).
    """
    c, dt, ship, out = constants[0], inputs[0].dt, truth[0], outputs[0]
    rate, force = out.angular_velocity, out.linear_acceleration
    rate[0], rate[1], rate[2] = inertial_rate(ship, c.earth_rate)
    force[0], force[1], force[2] = specific_force(ship, c.earth_rate, c.gravity)
    out.status = OK
    if ship.status != motion.OK:
        out.status = BAD_TRUTH
    elif not 0.0 < dt < math.inf:
        out.status = BAD_STEP
    per_sample = 1.0 / math.sqrt(dt) if out.status == OK else math.nan
    for i in range(3):
        rate[i] += c.gyro_bias[i] + c.gyro_noise * per_sample * normals[i]
        force[i] += c.accelerometer_bias[i] + c.accelerometer_noise * per_sample * normals[3 + i]
