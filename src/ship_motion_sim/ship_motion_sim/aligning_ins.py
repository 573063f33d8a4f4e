"""The INS of method riccati_eso: integration of the IMU, alignment, navigation and estimated accuracy.

Its `ship` parameters serve only for the latitude and for the true velocity, which an aid measures with noise.
"""
import math

from pedestal_common import ring
from pedestal_common.compiled import compiled
from pedestal_common.geometry.line_of_sight import quaternion, rotation, to_deck
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Bit, Floats, Matrix3, MetersPerSecond, Nanoseconds, Records, Vector3
from pedestal_common.record import Record
from ship_motion_sim import earth, ins, motion, navigator
from ship_motion_sim.ins import NO_STAMP, LatencyRing
from ship_motion_sim.navigator import State as NavigatorState
from ship_motion_sim.params import InsParameters

MAX_IMU_GAP_S = 0.1
"""Longest time between two usable IMU messages over which the INS integrates [s].

An angular acceleration of the deck of 0.1 rad/s2 causes an error of 0.5 mrad within this time.
"""


class Constants(Record):
    """An INS that aligns."""
    ship: motion.Constants
    earth_rate: Vector3             # ENU [rad/s]
    latency_ns: Nanoseconds
    increment: Bit                  # 1: mean rates of the IMU since its last sample, 0: rates at the stamp
    aid_noise: MetersPerSecond      # rms
    navigator: navigator.Constants
    power_up: NavigatorState        # state of the navigator at power-up


class _Ship(Record):
    last_stamp_ns: Nanoseconds
    truth: motion.Truth             # true motion of the ship, for the aid


class State(LatencyRing, _Ship):
    """State of the INS. The fields of the last base come first."""
    navigator: navigator.State
    imu_stamp_ns: Nanoseconds       # of the last usable IMU message
    last_rate: Vector3              # in the last usable IMU message [rad/s]
    last_force: Vector3             # [m/s2]
    angle: Vector3                  # increments since that message [rad]
    force: Vector3                  # [m/s]
    aid: Vector3                    # velocity that the aid measures [m/s]
    mat_ed: Matrix3                 # estimated deck -> earth


def constants(params: InsParameters) -> Records:
    """Return the Constants (1,). Raises ParameterError if the azimuth cannot reach alignment.aligned_sigma."""
    record, latitude = Constants.zeros(), math.radians(params.ship.latitude_deg)
    record['ship'] = motion.constants(params.ship)
    record['earth_rate'] = earth.rate(latitude)
    record['latency_ns'] = round(params.latency * 1e9)
    record['increment'], record['aid_noise'] = params.imu_output == 'increment', params.aid.noise
    record['navigator'] = navigator.constants(params.alignment, params.aid.source, latitude)
    aligned, least = params.alignment.aligned_sigma, navigator.least_azimuth_sigma(record['navigator'][0])
    if aligned <= least:
        raise ParameterError(f'alignment.aligned_sigma = {aligned:g} rad: must be above {least:.3g} rad, the limit at '
                             f'latitude {params.ship.latitude_deg:g} deg with alignment.gyro_bias = '
                             f'{params.alignment.gyro_bias:g} rad/s')
    yaw = math.radians(90.0 - params.alignment.initial_heading_deg)
    record['power_up'] = navigator.initial_state(record['navigator'], quaternion(0.0, 0.0, yaw))
    return record


def initial_state(constants: Records) -> Records:
    """Return the State (1,) before the first sample; constants: Constants (1,)."""
    return State.of(last_stamp_ns=NO_STAMP, imu_stamp_ns=NO_STAMP, navigator=constants['power_up'])


@compiled
def measure_aid(constants: Constants, state: State, stamp_ns: Nanoseconds, normals: Floats) -> None:
    """Put the velocity that the aid measures at stamp_ns, with noise, into state.aid; normals: three or more."""
    if constants.navigator.aid == navigator.AID_NONE:
        return
    motion.truth(constants.ship, 1e-9 * stamp_ns, state.truth)
    for i in range(3):
        state.aid[i] = state.truth.velocity_deck[i] + constants.aid_noise * normals[i]


@compiled
def integrate(constants: Constants, state: State, stamp_ns: Nanoseconds, rate: Vector3, force: Vector3) -> bool:
    """Integrate an IMU message, rate [rad/s] and force [m/s2]. Return False after a gap above MAX_IMU_GAP_S.

    A gap resets the INS to the state at power-up. Mean rates directly give the increments; rates at the stamps are
    integrated by the trapezoidal rule. The first message is not integrated, because its interval began before
    power-up.
    """
    dt = 1e-9 * (stamp_ns - state.imu_stamp_ns) if state.imu_stamp_ns != NO_STAMP else 0.0
    if dt > MAX_IMU_GAP_S:
        state.navigator, state.imu_stamp_ns = constants.power_up, NO_STAMP
        return False
    if dt > 0.0:
        for i in range(3):
            if constants.increment == 1:
                state.angle[i], state.force[i] = dt * rate[i], dt * force[i]
            else:
                state.angle[i] = 0.5 * dt * (rate[i] + state.last_rate[i])
                state.force[i] = 0.5 * dt * (force[i] + state.last_force[i])
        navigator.step(state.navigator, constants.navigator, state.angle, state.force, dt, state.aid)
    return True


@compiled
def measure(constants: Constants, state: State, stamp_ns: Nanoseconds, rate: Vector3, force: Vector3) -> None:
    """Put attitude and deck rate of the navigator at stamp_ns into the ring; rate, force: those of the IMU message."""
    n = ring.put(state, stamp_ns)
    q, w = state.quaternion, state.angular_velocity
    q[n, 0], q[n, 1], q[n, 2], q[n, 3] = navigator.attitude(state.navigator)
    rotation(q[n, 0], q[n, 1], q[n, 2], q[n, 3], state.mat_ed)
    e = constants.earth_rate
    ex, ey, ez = to_deck(state.mat_ed, e[0], e[1], e[2])
    first = state.imu_stamp_ns == NO_STAMP
    for i in range(3):
        # A mean rate belongs to the middle of its interval; this extrapolates it to the stamp.
        half = 0.5 * (rate[i] - state.last_rate[i]) if constants.increment == 1 and not first else 0.0
        w[n, i] = rate[i] + half - (ex if i == 0 else ey if i == 1 else ez)
        state.last_rate[i], state.last_force[i] = rate[i], force[i]
        state.linear_acceleration[n, i] = force[i]
    state.variance[n, 0] = state.variance[n, 1] = state.navigator.level_sigma**2
    state.variance[n, 2] = state.navigator.azimuth_sigma**2
    state.stage[n] = state.navigator.stage
    state.imu_stamp_ns = stamp_ns


@compiled
def step(state: State, constants: Constants, inputs: ins.Inputs, out: ins.Outputs, normals: Floats) -> None:
    """Take one IMU message like ins.step; the first three of the normals (INS_NORMALS_PER_STEP,) are for the aid."""
    out.status, out.due = ins.Status.OK, 0
    if inputs.stamp_ns <= state.last_stamp_ns:
        out.status = ins.Status.BAD_STAMP
        return
    state.last_stamp_ns = inputs.stamp_ns
    for n in range(3):
        if not (math.isfinite(inputs.angular_velocity[n]) and math.isfinite(inputs.linear_acceleration[n])):
            out.status = ins.Status.BAD_IMU
    if out.status == ins.Status.OK:
        if ring.full(state):
            out.status = ins.Status.BUFFER_FULL
        measure_aid(constants, state, inputs.stamp_ns, normals)
        if not integrate(constants, state, inputs.stamp_ns, inputs.angular_velocity, inputs.linear_acceleration):
            out.status = ins.Status.ATTITUDE_LOST
        measure(constants, state, inputs.stamp_ns, inputs.angular_velocity, inputs.linear_acceleration)
    if state.released == 0:
        out.stage = navigator.STAGE_ALIGNING
    for n in range(3):
        out.velocity[n] = state.navigator.strapdown.velocity[n]
        # The integrated noise of a gyro is a pure random walk.
        out.noise[n], out.walk[n] = 0.0, constants.navigator.conditions.gyro_noise
    ins.release(constants, state, inputs.stamp_ns, out)
