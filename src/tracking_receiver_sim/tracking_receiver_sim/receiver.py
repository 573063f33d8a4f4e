"""The monopulse tracking receiver: position of the target, samples of the channels, published results.

The unit calls `step` once per drive step. From the previous step to this one, the true error is taken as a straight
line, along which the receiver takes `samples_per_step` samples, the last one at the stamp. An electronic beam is held
between two steps and jumps at a step. The line then begins at the offset of the previous target position from the
present beam.

The voltages have the scale of receiver_law.detector, which makes an angle error of each sample. If the parameters
select them, each result also holds the rate of the error at the stamp and the range, with white noise.
"""
import math
from typing import Annotated, NamedTuple

import numpy as np

from pedestal_common import ring
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import blockage
from pedestal_common.geometry.line_of_sight import angles, earth_angles, offset_rates, offsets, to_deck, to_earth
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import (
    Bit,
    DecibelHertz,
    Floats,
    Ints,
    Matrix3,
    Meters,
    Nanoseconds,
    Pair,
    Radians,
    RadiansPerSecond,
    Records,
    Seconds,
    Times,
    Vector3,
)
from pedestal_common.record import Record
from receiver_law import detector, smoothing
from receiver_law.detector import Voltages, hertz
from receiver_law.monopulse import channels, disk_channels
from tracking_receiver_sim import target, wave_path
from tracking_receiver_sim.params import BEAM_HELD, BEAM_MOTIONS, ReceiverParameters, TrackingReceiverParameters

STATUS_TEXTS = dict(
    LOCKED='locked', NO_LOCK='no lock', BELOW_HORIZON='target below the horizon', NO_TARGET='target outside its track',
    NO_BEAM='direction of the beam not valid', STAMP_ORDER='stamp not after that of the last step',
    HIDDEN='target hidden by the superstructure')
STATUS_TEXT_BY_CODE = tuple(STATUS_TEXTS.values())
Status = codes(STATUS_TEXTS)

NORMALS_PER_SAMPLE = 6  # of noise: real and imaginary of the sum and of two differences
RESULT_RING_SIZE = 512  # largest number of results that wait for the latency to pass
NOT_MEASURED = (math.nan, math.nan)  # pair of numbers that the receiver did not measure


class Result(NamedTuple):
    """Published result of one step; its numbers are NaN while not locked or if not measured, except C/N0."""
    error: tuple[Radians, Radians]                      # cross-elevation, elevation
    cn0_dbhz: DecibelHertz
    rates: tuple[RadiansPerSecond, RadiansPerSecond]    # of the error
    range: Meters


class Incidence(NamedTuple):
    """Signal of a step as it arrives."""
    dX: Radians                                         # error at the stamp: cross-elevation
    dE: Radians
    amplitude: float                                    # sum voltage on axis
    image: wave_path.Image
    hidden: bool
    rates: tuple[RadiansPerSecond, RadiansPerSecond]    # measured; NaN if not measured, as the range
    range: Meters


class State(Record):
    """State of the receiver. The ring holds the results whose latency has not passed, see Result."""
    stamp_ns: Nanoseconds       # of the last step, -1 before the first
    error_known: Bit            # 1 if the next three fields hold the true error at stamp_ns
    cross_elevation: Radians
    elevation: Radians
    direction: Vector3          # vector to the target, FLU [m]
    detector: detector.State
    written: int                # number of results put into the ring since the start
    released: int               # number of results taken out of the ring since the start
    ring_stamp_ns: Annotated[Ints, (RESULT_RING_SIZE,)]
    ring_locked: Annotated[Ints, (RESULT_RING_SIZE,)]
    ring_cross_elevation: Annotated[Floats, (RESULT_RING_SIZE,)]    # [rad]
    ring_elevation: Annotated[Floats, (RESULT_RING_SIZE,)]          # [rad]
    ring_cn0_dbhz: Annotated[Floats, (RESULT_RING_SIZE,)]
    ring_rate: Annotated[Floats, (RESULT_RING_SIZE, 2)]             # [rad/s]
    ring_range: Annotated[Floats, (RESULT_RING_SIZE,)]              # [m]
    antenna: Vector3            # position of the antenna against the station, ENU [m]
    antenna_velocity: Vector3   # velocity of the antenna, FLU [m/s]
    scintillation: Annotated[Floats, (wave_path.SCINTILLATION_NORMALS,)]     # state of wave_path.wander


class Constants(Record):
    """Constants of the receiver."""
    target: target.TargetRecord
    beamwidth: Radians
    slope: float                # true k_m
    detector: detector.Constants
    cos_beta: float
    sin_beta: float
    cos_phi: float
    sin_phi: float
    sign: Pair                  # slope of each difference channel over its slope without an injected fault
    boresight: Pair             # null of the differences off the beam [rad]
    path: wave_path.Path
    multipath: wave_path.Multipath
    scintillation: wave_path.Scintillation
    first_measured_normal: int          # index of the first normal of the measured rate and range
    first_source_normal: int            # index of the first normal of a source of noise
    first_scintillation_normal: int     # index of the first normal of the scintillation
    disk_radius: float          # of a source of noise [beamwidths]; 0: a carrier
    source_sigma: float         # 1-sigma of the power of a source of noise in one sample, as a share of it
    period_ns: Nanoseconds
    held: Bit                   # 1 for an electronic beam
    power: float                # carrier power / noise power in one sample at the reference range
    reference_range: Meters
    half_exponent: float        # half of the power of the range with which C/N0 falls
    horizon_mask: Radians
    latency_ns: Nanoseconds
    rate_measured: Bit
    rate_sigma: RadiansPerSecond
    range_measured: Bit
    range_sigma: Meters
    range_variance: float       # [m2], in single precision
    lever_arm: Vector3          # from base_link to the antenna, FLU [m]
    sectors: Annotated[Floats, (blockage.MAX_SECTORS, 3)]   # see blockage.sectors


class Inputs(Record):
    """Inputs of a step: true beam and true motion of the ship."""
    stamp_ns: Nanoseconds
    valid: Bit                  # 1 if the direction of the beam is known
    azimuth: Radians            # of the beam on the deck
    elevation: Radians
    mat_ed: Matrix3             # attitude deck -> earth
    position: Vector3           # of base_link against the station, ENU [m]
    azimuth_rate: RadiansPerSecond
    elevation_rate: RadiansPerSecond
    twist_linear: Vector3       # velocity of base_link, FLU [m/s]
    twist_angular: Vector3      # rate of the deck, FLU [rad/s]


class Outputs(Record):
    """Outputs of a step: a result, if one comes out, then values at the stamp of this step; NaN if not known."""
    due: Bit                    # 1 if a result comes out in this step
    stamp_ns: Nanoseconds       # at which the result was measured
    cross_elevation: Radians    # error
    elevation: Radians
    cn0_dbhz: DecibelHertz
    locked: Bit
    status: int                 # of this step: index into STATUS_TEXT_BY_CODE
    rate: Pair                  # rates of the errors [rad/s], NaN if not measured
    range: Meters               # NaN if not measured; in the single precision of its topic
    true_cross_elevation: Radians   # error at the stamp of this step
    true_elevation: Radians
    target_valid: Bit
    target_position: Vector3    # ENU [m]
    target_velocity: Vector3    # ENU [m/s]


def constants(params: TrackingReceiverParameters, period: Seconds, built: target.Target) -> Records:
    """Return the Constants (1,) of a step and a target. Raises ParameterError for a latency beyond the ring."""
    antenna, receiver = params.antenna, params.receiver
    if receiver.latency >= (RESULT_RING_SIZE - 1) * period:
        raise ParameterError(f'receiver.latency = {receiver.latency:g} s: must be below {RESULT_RING_SIZE - 1} '
                             f'periods of {period:g} s')
    tau = period / receiver.samples_per_step
    c = Constants.zeros()
    c['target'], c['beamwidth'] = built.constants, antenna.beamwidth
    c['slope'] = antenna.slope * antenna.slope_factor
    detector.set_constants(c['detector'], antenna, receiver, period)
    c['cos_beta'], c['sin_beta'] = math.cos(antenna.cross_coupling), math.sin(antenna.cross_coupling)
    c['cos_phi'], c['sin_phi'] = math.cos(antenna.phase_error), math.sin(antenna.phase_error)
    c['sign'] = 1.0
    c['period_ns'] = round(period * 1e9)
    c['held'] = BEAM_MOTIONS.index(receiver.beam) == BEAM_HELD
    c['boresight'] = antenna.boresight_cross_elevation, antenna.boresight_elevation
    c['path'] = wave_path.path_constants(params.path)
    c['multipath'] = wave_path.multipath_constants(params.path.multipath)
    c['scintillation'] = wave_path.scintillation_constants(params.path.scintillation, period)
    c['first_measured_normal'] = NORMALS_PER_SAMPLE * receiver.samples_per_step
    c['first_source_normal'], c['first_scintillation_normal'] = _measured_normals(receiver), _receiver_normals(params)
    c['power'] = hertz(receiver.cn0_dbhz) * tau
    c['reference_range'] = receiver.reference_range
    if params.target.of_noise:
        source = params.target.noise_source
        c['disk_radius'] = 0.5 * source.diameter / antenna.beamwidth
        c['source_sigma'] = 1.0 / math.sqrt(source.bandwidth * tau)
        # The place of a body is an apparent one, and its noise has no polarisation.
        c['path']['light_time'] = 0
    else:
        c['power'] *= wave_path.polarisation_efficiency(params.target.polarisation, antenna.polarisation)
        c['half_exponent'] = 0.5 * receiver.range_exponent
    c['horizon_mask'] = receiver.horizon_mask
    c['latency_ns'] = round(receiver.latency * 1e9)
    c['rate_measured'], c['rate_sigma'] = receiver.rate.measured, receiver.rate.sigma
    c['range_measured'], c['range_sigma'] = receiver.ranging.measured, receiver.ranging.sigma
    c['range_variance'] = np.float32(receiver.ranging.sigma**2)
    c['lever_arm'] = params.lever_arm.x, params.lever_arm.y, params.lever_arm.z
    c['sectors'] = blockage.sectors(params.blockage)
    return c


def initial_state() -> Records:
    """Return the State (1,) before the first step: noise in the channels, not locked."""
    state = State.zeros()
    state['stamp_ns'], state['detector']['agc_power'], state['detector']['level_power'] = -1, 1.0, 1.0
    return state


def _measured_normals(receiver: ReceiverParameters) -> int:
    return NORMALS_PER_SAMPLE * receiver.samples_per_step + 2 * receiver.rate.measured + receiver.ranging.measured


def _receiver_normals(params: TrackingReceiverParameters) -> int:
    return _measured_normals(params.receiver) + params.receiver.samples_per_step * params.target.of_noise


def normals_per_step(params: TrackingReceiverParameters) -> int:
    """Return the number of standard normals that `step` takes."""
    return _receiver_normals(params) + wave_path.SCINTILLATION_NORMALS * params.path.scintillation.on


def age(params: TrackingReceiverParameters, period: Seconds) -> Seconds:
    """Return the mean age of an error at its stamp if the beam is held between two steps, otherwise 0. With a moving
    beam the mean over a step differs from the error at the stamp at most by its change within the step."""
    receiver = params.receiver
    if BEAM_MOTIONS.index(receiver.beam) != BEAM_HELD:
        return 0.0
    return (smoothing.delay(receiver.smoothing, receiver.samples_per_step, receiver.smoothing_samples)
            * period / receiver.samples_per_step)


def beam_age(params: TrackingReceiverParameters, period: Seconds) -> Seconds:
    """Return the mean time from the stamp of the measured beam to the stamp of an error; 0 for a moving beam. Because
    a held beam is published at the end of its step, only older steps in the smoothing count."""
    receiver = params.receiver
    if BEAM_MOTIONS.index(receiver.beam) != BEAM_HELD:
        return 0.0
    return smoothing.steps_back(receiver.smoothing, receiver.samples_per_step, receiver.smoothing_samples) * period


@compiled
def inputs_known(inputs: Inputs) -> bool:
    """Return True if beam, attitude and position are known and finite."""
    total = inputs.azimuth + inputs.elevation
    for row in range(3):
        total += inputs.position[row] + inputs.mat_ed[row, 0] + inputs.mat_ed[row, 1] + inputs.mat_ed[row, 2]
    return inputs.valid != 0 and math.isfinite(total)


@compiled
def place_antenna(state: State, constants: Constants, inputs: Inputs) -> None:
    """Set the antenna's position p + M r [m] and velocity v + w x r [m/s] in the state.

    The ship has the position p, the velocity v, the attitude M (deck to earth) and the rate w; r is the lever arm.
    """
    x, y, z = constants.lever_arm[0], constants.lever_arm[1], constants.lever_arm[2]
    wx, wy, wz = inputs.twist_angular[0], inputs.twist_angular[1], inputs.twist_angular[2]
    e, n, u = to_earth(inputs.mat_ed, x, y, z)
    state.antenna[0], state.antenna[1] = inputs.position[0] + e, inputs.position[1] + n
    state.antenna[2] = inputs.position[2] + u
    state.antenna_velocity[0] = inputs.twist_linear[0] + wy * z - wz * y
    state.antenna_velocity[1] = inputs.twist_linear[1] + wz * x - wx * z
    state.antenna_velocity[2] = inputs.twist_linear[2] + wx * y - wy * x


@compiled
def apparent_state(state: State, constants: Constants, true: target.TargetState) -> target.TargetState:
    """Return the apparent state of a true one, with refraction and delay of light."""
    if constants.path.refractivity == 0.0 and constants.path.light_time == 0:
        return true
    (e, n, u), antenna = true.position, state.antenna
    r, v = wave_path.seen(constants.path, (e - antenna[0], n - antenna[1], u - antenna[2]), true.velocity)
    return target.TargetState(true.valid, (antenna[0] + r[0], antenna[1] + r[1], antenna[2] + r[2]), v)


@compiled
def carrier_amplitude(constants: Constants, e: Meters, n: Meters, u: Meters, hidden: bool) -> float:
    """Return the sum voltage on axis from a target at (e, n, u); 0 below the horizon mask or if hidden."""
    _, elevation = earth_angles(e, n, u)
    if hidden or not elevation >= constants.horizon_mask:       # also true for an elevation of NaN
        return 0.0
    distance = max(math.sqrt(e * e + n * n + u * u), 1.0)
    return math.sqrt(constants.power) * (constants.reference_range / distance)**constants.half_exponent


@compiled
def voltages(constants: Constants, amplitude: float, v_x: float, v_e: float, image: wave_path.Image) -> Voltages:
    """Return the Voltages of one sample without noise. amplitude: sum voltage on axis; v_x, v_e: offsets from the null
    of the differences [beamwidths]."""
    # S_g, D_xg, D_eg: patterns for the image of the target in the ground.
    slope, cos_beta, sin_beta = constants.slope, constants.cos_beta, constants.sin_beta
    if constants.disk_radius > 0.0:
        S, D_x, D_e = disk_channels(v_x, v_e, constants.disk_radius, slope, cos_beta, sin_beta)
    else:
        S, D_x, D_e = channels(v_x, v_e, slope, cos_beta, sin_beta)
    S_imag = D_x_imag = D_e_imag = 0.0
    if constants.multipath.reflection != 0.0:
        S_g, D_xg, D_eg = channels((image.dX - constants.boresight[0]) / constants.beamwidth,
                                   (image.dE - constants.boresight[1]) / constants.beamwidth, slope, cos_beta,
                                   sin_beta)
        S, D_x, D_e = S + image.real * S_g, D_x + image.real * D_xg, D_e + image.real * D_eg
        S_imag, D_x_imag, D_e_imag = image.imaginary * S_g, image.imaginary * D_xg, image.imaginary * D_eg
    x_real, x_imag = constants.sign[0] * amplitude * D_x, constants.sign[0] * amplitude * D_x_imag
    e_real, e_imag = constants.sign[1] * amplitude * D_e, constants.sign[1] * amplitude * D_e_imag
    cos_phi, sin_phi = constants.cos_phi, constants.sin_phi
    return Voltages(amplitude * S, amplitude * S_imag,
                    x_real * cos_phi - x_imag * sin_phi, x_real * sin_phi + x_imag * cos_phi,
                    e_real * cos_phi - e_imag * sin_phi, e_real * sin_phi + e_imag * cos_phi)


@compiled
def with_noise(v: Voltages, normals: Floats, first: int) -> Voltages:
    """Return voltages with noise, made of the normals from index `first` on."""
    # The noise power 1 of a channel is half in its real and half in its imaginary part.
    half = math.sqrt(0.5)
    return Voltages(v.s_real + half * normals[first], v.s_imag + half * normals[first + 1],
                    v.x_real + half * normals[first + 2], v.x_imag + half * normals[first + 3],
                    v.e_real + half * normals[first + 4], v.e_imag + half * normals[first + 5])


@compiled
def error_at(state: State, seen: Incidence, part: float) -> tuple[Radians, Radians]:
    """Return the true (cross-elevation, elevation) error after a part of a step, at whose end it is that `seen`."""
    from_X, from_E = (state.cross_elevation, state.elevation) if state.error_known != 0 else (seen.dX, seen.dE)
    return from_X + part * (seen.dX - from_X), from_E + part * (seen.dE - from_E)


@compiled
def voltages_at(state: State, constants: Constants, seen: Incidence, part: float, amplitude: float) -> Voltages:
    """Return the Voltages without noise when a part of a step has passed; amplitude: sum voltage on axis."""
    X, E = error_at(state, seen, part)
    return voltages(constants, amplitude, (X - constants.boresight[0]) / constants.beamwidth,
                    (E - constants.boresight[1]) / constants.beamwidth, seen.image)


@compiled
def measure(state: State, constants: Constants, seen: Incidence, normals: Floats) -> tuple[Radians, Radians]:
    """Return the errors (cross-elevation, elevation) that the receiver measures in one step."""
    samples = constants.detector.samples
    detector.begin(state.detector)
    for k in range(samples):
        level = seen.amplitude
        if constants.source_sigma > 0.0:
            level *= math.sqrt(max(0.0, 1.0 + constants.source_sigma * normals[constants.first_source_normal + k]))
        sample = voltages_at(state, constants, seen, (k + 1.0) / samples, level)
        detector.put(state.detector, constants.detector, with_noise(sample, normals, NORMALS_PER_SAMPLE * k))
    return detector.errors(state.detector, constants.detector)


@compiled
def error_rate(inputs: Inputs, position: Vector3, velocity: Vector3,
               seen: target.TargetState) -> tuple[RadiansPerSecond, RadiansPerSecond]:
    """Return (d dX/dt, d dE/dt) of a target off the beam, exactly. velocity: velocity of the antenna, FLU [m/s]. In
    the deck frame the target is at r = M^T (p - position). Its derivative is dr/dt = M^T v - velocity - w x r, with
    the rotation M deck -> earth and the rate w of the deck."""
    (e, n, u), (v_e, v_n, v_u) = seen.position, seen.velocity
    x, y, z = r = to_deck(inputs.mat_ed, e - position[0], n - position[1], u - position[2])
    vx, vy, vz = to_deck(inputs.mat_ed, v_e, v_n, v_u)
    wx, wy, wz = inputs.twist_angular[0], inputs.twist_angular[1], inputs.twist_angular[2]
    v = (vx - velocity[0] - (wy * z - wz * y), vy - velocity[1] - (wz * x - wx * z),
         vz - velocity[2] - (wx * y - wy * x))
    return offset_rates((inputs.azimuth, inputs.elevation), (inputs.azimuth_rate, inputs.elevation_rate), r, v)


@compiled
def rate_and_range(state: State, constants: Constants, inputs: Inputs, target_state: target.TargetState,
                   normals: Floats) -> tuple[tuple[RadiansPerSecond, RadiansPerSecond], Meters]:
    """Return the measured ((cross-elevation rate, elevation rate), range) of the target, NaN where not measured."""
    rates, distance = NOT_MEASURED, math.nan
    first = constants.first_measured_normal
    if constants.rate_measured != 0:
        rate_x, rate_e = error_rate(inputs, state.antenna, state.antenna_velocity, target_state)
        rates = rate_x + constants.rate_sigma * normals[first], rate_e + constants.rate_sigma * normals[first + 1]
        first += 2
    if constants.range_measured != 0:
        e, n, u = target_state.position
        e, n, u = e - state.antenna[0], n - state.antenna[1], u - state.antenna[2]
        distance = float(np.float32(math.sqrt(e * e + n * n + u * u) + constants.range_sigma * normals[first]))
    return rates, distance


@compiled
def delay(state: State, constants: Constants, outputs: Outputs, stamp_ns: Nanoseconds, result: Result) -> None:
    """Put a result into the ring and release the newest result measured at or before stamp_ns - latency."""
    slot = ring.put(state, stamp_ns)
    state.ring_locked[slot] = state.detector.locked
    state.ring_cross_elevation[slot], state.ring_elevation[slot] = result.error
    state.ring_rate[slot, 0], state.ring_rate[slot, 1] = result.rates
    state.ring_cn0_dbhz[slot], state.ring_range[slot] = result.cn0_dbhz, result.range
    slot = ring.release(state, stamp_ns - constants.latency_ns)
    if slot != ring.NONE_DUE:
        outputs.due, outputs.stamp_ns, outputs.locked = 1, state.ring_stamp_ns[slot], state.ring_locked[slot]
        outputs.cross_elevation, outputs.elevation = state.ring_cross_elevation[slot], state.ring_elevation[slot]
        outputs.cn0_dbhz = state.ring_cn0_dbhz[slot]
        outputs.rate[0], outputs.rate[1] = state.ring_rate[slot, 0], state.ring_rate[slot, 1]
        outputs.range = state.ring_range[slot]


@compiled
def reset_outputs(outputs: Outputs) -> None:
    """Reset the outputs at the start of a step: nothing measured, nothing known."""
    outputs.due, outputs.stamp_ns, outputs.locked = 0, 0, 0
    outputs.cross_elevation, outputs.elevation, outputs.cn0_dbhz = math.nan, math.nan, math.nan
    outputs.rate[0], outputs.rate[1], outputs.range = math.nan, math.nan, math.nan
    outputs.true_cross_elevation, outputs.true_elevation = math.nan, math.nan
    outputs.target_valid = 0
    for axis in range(3):
        outputs.target_position[axis], outputs.target_velocity[axis] = math.nan, math.nan


@compiled
def incidence(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, true: target.TargetState,
              normals: Floats) -> Incidence:
    """Return the Incidence of the target's true state, and set the true error in the outputs."""
    dX, dE, amplitude = 0.0, 0.0, 0.0
    rates, distance = NOT_MEASURED, math.nan
    image = wave_path.Image(0.0, 0.0, 0.0, 0.0)
    hidden = False
    if true.valid:
        place_antenna(state, constants, inputs)
        seen = apparent_state(state, constants, true)
        rates, distance = rate_and_range(state, constants, inputs, seen, normals)
        e, n, u = seen.position
        e, n, u = e - state.antenna[0], n - state.antenna[1], u - state.antenna[2]
        x, y, z = to_deck(inputs.mat_ed, e, n, u)
        if constants.held and state.error_known:
            state.cross_elevation, state.elevation = offsets(inputs.azimuth, inputs.elevation, state.direction[0],
                                                             state.direction[1], state.direction[2])
        state.direction[0], state.direction[1], state.direction[2] = x, y, z
        dX, dE = offsets(inputs.azimuth, inputs.elevation, x, y, z)
        hidden = blockage.blocked(constants.sectors, *angles(x, y, z))
        amplitude = carrier_amplitude(constants, e, n, u, hidden)
        image = wave_path.image(constants.multipath, inputs, e, n, u)
        outputs.true_cross_elevation, outputs.true_elevation = dX, dE
        if constants.scintillation.on != 0:
            sin_E = u / math.sqrt(e * e + n * n + u * u)
            fading, X, E = wave_path.wander(constants.scintillation, state.scintillation, sin_E, normals,
                                                constants.first_scintillation_normal)
            amplitude, dX, dE = fading * amplitude, dX + X, dE + E
    return Incidence(dX, dE, amplitude, image, hidden, rates, distance)


@compiled
def begin(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, breaks: Times,
          coefficients: Floats) -> tuple[target.TargetState, Nanoseconds]:
    """Begin a step: reset the outputs and set the target in them. Return (the target's true state, time since the last
    step [ns]); the time is 0 for a stamp that is not after the last one."""
    reset_outputs(outputs)
    elapsed_ns = 0
    if inputs.stamp_ns > state.stamp_ns:
        elapsed_ns = inputs.stamp_ns - state.stamp_ns if state.stamp_ns >= 0 else constants.period_ns
        state.stamp_ns = inputs.stamp_ns
    true = target.state(constants.target, breaks, coefficients, 1e-9 * inputs.stamp_ns)
    if elapsed_ns > 0:
        outputs.target_valid = true.valid
        outputs.target_position[0], outputs.target_position[1], outputs.target_position[2] = true.position
        outputs.target_velocity[0], outputs.target_velocity[1], outputs.target_velocity[2] = true.velocity
    else:
        outputs.status = Status.STAMP_ORDER
    return true, elapsed_ns


@compiled
def finish(state: State, outputs: Outputs, true: target.TargetState, seen: Incidence) -> None:
    """Keep the error of a step for the next step, and set the status."""
    state.cross_elevation, state.elevation = seen.dX, seen.dE
    state.error_known = true.valid
    outputs.status = (Status.NO_TARGET if true.valid == 0 else Status.HIDDEN if seen.hidden else
                      Status.BELOW_HORIZON if seen.amplitude == 0.0 else
                      Status.LOCKED if state.detector.locked != 0 else Status.NO_LOCK)


@separate
def step(state: State, constants: Constants, inputs: Inputs, outputs: Outputs, breaks: Times, coefficients: Floats,
         normals: Floats) -> None:
    """Execute one drive step. Never raises: the status of the outputs names a missing input."""
    true, elapsed_ns = begin(state, constants, inputs, outputs, breaks, coefficients)
    if elapsed_ns == 0:
        return
    error, rates, distance = NOT_MEASURED, NOT_MEASURED, math.nan
    if inputs_known(inputs):
        seen = incidence(state, constants, inputs, outputs, true, normals)
        error, rates, distance = measure(state, constants, seen, normals), seen.rates, seen.range
        detector.lock(state.detector, constants.detector, state.detector.level_power - 1.0, elapsed_ns)
        finish(state, outputs, true, seen)
    else:
        state.error_known, state.detector.locked, state.detector.timer_ns = 0, 0, 0
        outputs.status = Status.NO_BEAM
    if state.detector.locked == 0:
        error, rates, distance = NOT_MEASURED, NOT_MEASURED, math.nan
    cn0_dbhz = detector.cn0_dbhz(state.detector, constants.detector)
    delay(state, constants, outputs, inputs.stamp_ns, Result(error, cn0_dbhz, rates, distance))
