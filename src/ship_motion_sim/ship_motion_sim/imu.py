"""A strapdown IMU at the origin of the deck: specific force and angular rate by REP 145.

output 'sample'      the rates at the stamp
output 'increment'   the mean rates since the last sample: increments of an integrating IMU, divided by the interval.
                     Three-point Gauss quadrature of the analytic rates, whose error is proportional to dt^7.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import to_deck
from pedestal_common.quantities import (
    Bit,
    Floats,
    MetersPerSecond2,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Vector3,
)
from pedestal_common.record import Record
from ship_motion_sim import earth, motion
from ship_motion_sim.params import ShipMotionParameters

IMU_NORMALS_PER_STEP = 6  # number of standard normals of a step: three gyros, three accelerometers
FIRST_GYRO_NORMAL, FIRST_ACCELEROMETER_NORMAL = 0, 3
"""Indices of the normals of the first gyro and of the first accelerometer."""
IMU_STATUS_TEXTS = ('ok', 'step is not positive', 'truth is not valid')
IMU_OK, IMU_BAD_STEP, IMU_BAD_TRUTH = range(len(IMU_STATUS_TEXTS))

_GAUSS_NODE_OFFSET = math.sqrt(0.15)
"""Distance of the outer nodes of the three-point rule from the middle, for an interval of 1."""


class SensorErrors(Record):
    """Errors of three gyros, or of three accelerometers."""
    bias: Vector3           # [rad/s] or [m/s2]
    noise: float            # density of the white noise [rad/sqrt(s)] or [m/s/sqrt(s)]
    scale: float            # error of the scale factor [-]
    misalignment: Radians   # sensing axis x is turned towards y, y towards z, z towards x
    quantum: float          # smallest increment [rad] or [m/s]; 0: no quantisation


class Constants(Record):
    """An IMU and its place on the earth."""
    earth_rate: Vector3     # ENU [rad/s]
    gravity: MetersPerSecond2
    increment: Bit          # 1: mean rates since the last sample, 0: rates at the stamp
    gyro: SensorErrors
    accelerometer: SensorErrors


class State(Record):
    """State of an IMU."""
    truth: motion.Truth     # at a node of the quadrature
    angle_left: Vector3     # remainders of the quantised increments: angles [rad]
    force_left: Vector3     # velocities [m/s]


class Inputs(Record):
    """Inputs of a sample."""
    t: Seconds              # of the sample
    dt: Seconds             # time since the last sample; in the first step, the period


class Outputs(Record):
    """Outputs of the IMU: a sample."""
    status: int                     # index into IMU_STATUS_TEXTS; unless IMU_OK, the rest is NaN
    angular_velocity: Vector3       # against inertial space, FLU [rad/s]
    linear_acceleration: Vector3    # specific force, FLU [m/s2]: at rest +g along z


def constants(params: ShipMotionParameters) -> Records:
    """Return the Constants (1,)."""
    imu, latitude = params.imu, math.radians(params.ship.latitude_deg)
    record = Constants.zeros()
    record['earth_rate'] = earth.rate(latitude)
    record['gravity'] = earth.gravity(latitude)
    record['increment'] = imu.output == 'increment'
    for sensor in ('gyro', 'accelerometer'):
        errors = record[sensor]
        errors['bias'] = [getattr(imu, f'{sensor}_bias_{axis}') for axis in 'xyz']
        for name in ('noise', 'scale', 'misalignment', 'quantum'):
            errors[name] = getattr(imu, f'{sensor}_{name}')
    return record


def initial_state() -> Records:
    """Return the State (1,) before the first sample."""
    return State.zeros()


@compiled
def inertial_rate(truth: motion.Truth,
                  earth_rate: Vector3) -> tuple[RadiansPerSecond, RadiansPerSecond, RadiansPerSecond]:
    """Return the angular rate of the deck against inertial space (x, y, z), FLU; earth_rate in ENU [rad/s]."""
    ex, ey, ez = to_deck(truth.mat_ed, earth_rate[0], earth_rate[1], earth_rate[2])
    w = truth.angular_velocity
    return w[0] + ex, w[1] + ey, w[2] + ez


@compiled
def specific_force(truth: motion.Truth, earth_rate: Vector3,
                   gravity: MetersPerSecond2) -> tuple[MetersPerSecond2, MetersPerSecond2, MetersPerSecond2]:
    """Return the specific force mat_ed^T (a + 2 w_ie x v - g), FLU; earth_rate: w_ie, ENU [rad/s].

    The earth is a rotating plane, the tangent plane of the truth, in which g is constant along -z. The model omits
    that the vertical turns as the ship moves over the round earth (transport rate, 1e-6 rad/s at 7 m/s).
    """
    a, v, e = truth.acceleration, truth.velocity, earth_rate
    return to_deck(truth.mat_ed,
                   a[0] + 2.0 * (e[1] * v[2] - e[2] * v[1]),
                   a[1] + 2.0 * (e[2] * v[0] - e[0] * v[2]),
                   a[2] + 2.0 * (e[0] * v[1] - e[1] * v[0]) + gravity)


@compiled
def mean_rates(state: State, constants: Constants, ship: motion.Constants, t: Seconds, dt: Seconds, rate: Vector3,
               force: Vector3) -> None:
    """Fill rate [rad/s] and force [m/s2] with the means of the true rates over [t - dt, t]."""
    for i in range(3):
        rate[i] = force[i] = 0.0
    for node in range(3):
        motion.truth(ship, t - 0.5 * dt + (node - 1) * _GAUSS_NODE_OFFSET * dt, state.truth)
        weight = 8.0 / 18.0 if node == 1 else 5.0 / 18.0
        wx, wy, wz = inertial_rate(state.truth, constants.earth_rate)
        fx, fy, fz = specific_force(state.truth, constants.earth_rate, constants.gravity)
        rate[0] += weight * wx
        rate[1] += weight * wy
        rate[2] += weight * wz
        force[0] += weight * fx
        force[1] += weight * fy
        force[2] += weight * fz


@compiled
def add_sensor_errors(errors: SensorErrors, dt: Seconds, values: Vector3, normals: Floats, first: int,
                      remainder: Vector3) -> None:
    """Add the errors of three sensors to the true values, measured over dt; the normals are used from index `first`
    on.

    White noise is given as a density, so a sample has the noise density / sqrt(dt). remainder: part of the increment
    that quantisation cut off, kept for the next sample.
    """
    x, y, z = values[0], values[1], values[2]
    per_sample = 1.0 / math.sqrt(dt)
    for i in range(3):
        across = y if i == 0 else z if i == 1 else x
        values[i] += errors.scale * values[i] + errors.misalignment * across
        values[i] += errors.bias[i] + errors.noise * per_sample * normals[first + i]
        if errors.quantum > 0.0:
            increment = values[i] * dt + remainder[i]
            counted = errors.quantum * math.floor(increment / errors.quantum + 0.5)
            remainder[i] = increment - counted
            values[i] = counted / dt


@compiled
def step(state: State, constants: Constants, ship: motion.Constants, inputs: Inputs, truth: motion.Truth, out: Outputs,
         normals: Floats) -> None:
    """Take one sample. truth: truth of the ship at the time of the sample; normals: (IMU_NORMALS_PER_STEP,)."""
    rate, force = out.angular_velocity, out.linear_acceleration
    if truth.status != motion.MOTION_OK:
        out.status = IMU_BAD_TRUTH
    elif not 0.0 < inputs.dt < math.inf:
        out.status = IMU_BAD_STEP
    else:
        out.status = IMU_OK
    if out.status != IMU_OK:
        for i in range(3):
            rate[i] = force[i] = math.nan
        return
    if constants.increment == 1:
        mean_rates(state, constants, ship, inputs.t, inputs.dt, rate, force)
    else:
        rate[0], rate[1], rate[2] = inertial_rate(truth, constants.earth_rate)
        force[0], force[1], force[2] = specific_force(truth, constants.earth_rate, constants.gravity)
    add_sensor_errors(constants.gyro, inputs.dt, rate, normals, FIRST_GYRO_NORMAL, state.angle_left)
    add_sensor_errors(constants.accelerometer, inputs.dt, force, normals, FIRST_ACCELEROMETER_NORMAL, state.force_left)
