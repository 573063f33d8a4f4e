"""The monopulse tracking receiver: position of the target, samples of the channels, published results.

The unit calls `step` once per drive step. From the previous step to this one, the true error is taken as a straight
line. Along the line the receiver takes `samples_per_step` samples of sum and difference voltages, the last one at the
stamp. An electronic beam is held between two steps and jumps at a step. With a held beam the line begins at the offset
of the previous target position from the present beam.

The module `detector` makes an angle error of each sample. If the parameters select them, each result also holds the
rate of the error at the stamp and the range, with white noise.

Voltages are scaled so that the noise of one channel has the power 1 in one sample. The carrier power on axis is then
C/N0 tau, with the time tau of a sample.

Arguments: s state, c constants, i inputs, o outputs (records of this module).
"""
import math
from collections import namedtuple

import numpy as np

from pedestal_common.codes import codes
from pedestal_common.compiled import compiled, separate
from pedestal_common.geometry import blockage
from pedestal_common.geometry.line_of_sight import angles, earth_angles, offsets, to_deck, to_earth
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Matrix3, Pair, Vector3
from pedestal_common.record import Record
from tracking_receiver_sim import detector, smoothing, target
from tracking_receiver_sim.detector import Voltages, hertz
from tracking_receiver_sim.error_rate import error_rate
from tracking_receiver_sim.monopulse import channels, disk_channels, thermal_noise
from tracking_receiver_sim.params import BEAM_HELD, BEAM_MOTIONS
from tracking_receiver_sim.path import arrival, multipath, polarisation, scintillation

STATUS_TEXTS = dict(
    LOCKED='locked', NO_LOCK='no lock', BELOW_HORIZON='target below the horizon', NO_TARGET='target outside its track',
    NO_BEAM='direction of the beam not valid', STAMP_ORDER='stamp not after that of the last step',
    HIDDEN='target hidden by the superstructure')
STATUS_TEXT_BY_CODE = tuple(STATUS_TEXTS.values())
Status = codes(STATUS_TEXTS)

NORMALS_PER_SAMPLE = 6
"""Standard normals of a sample: real and imaginary noise of the sum and of the two difference channels."""
RESULT_RING_SIZE = 512  # largest number of results that wait for the latency to pass
Result = namedtuple('Result', 'error cn0_dbhz rates range')
"""Published result of one step: error and rates (cross-elevation, elevation) [rad, rad/s], C/N0 [dB-Hz], range [m];
NaN while not locked or if not measured."""
Incidence = namedtuple('Incidence', 'dX dE amplitude image hidden rates range')
"""Signal of a step as it arrives: error (cross-elevation, elevation) [rad] at the stamp, sum voltage on axis [-],
multipath.Image, True if hidden; measured rates and range as in Result."""
NOT_MEASURED = (math.nan, math.nan)  # pair of numbers that the receiver did not measure

State = np.dtype([
    ('stamp_ns', 'i8'), ('error_known', 'i8'), ('cross_elevation', 'f8'), ('elevation', 'f8'), ('direction', 'f8', 3),
    *detector.STATE_FIELDS,
    ('written', 'i8'), ('released', 'i8'),
    ('ring_stamp_ns', 'i8', RESULT_RING_SIZE), ('ring_locked', 'i8', RESULT_RING_SIZE),
    ('ring_cross_elevation', 'f8', RESULT_RING_SIZE), ('ring_elevation', 'f8', RESULT_RING_SIZE),
    ('ring_cn0_dbhz', 'f8', RESULT_RING_SIZE),
    ('ring_rate', 'f8', (RESULT_RING_SIZE, 2)), ('ring_range', 'f8', RESULT_RING_SIZE),
    ('antenna', 'f8', 3), ('antenna_velocity', 'f8', 3), ('scintillation', 'f8', scintillation.NORMALS_PER_STEP)],
                       align=True)
"""State of the receiver, with the state of its detector.

    ring_...            ring of the results whose latency has not passed, see Result
    scintillation       state of scintillation.wander
    error_known         1 if cross_elevation, elevation hold the true error at stamp_ns [rad], and direction the vector
                        to the target in FLU [m]
    written, released   numbers of results put into and taken out of the ring since the start
    antenna             position of the antenna against the station, ENU [m]
    antenna_velocity    velocity of the antenna, FLU [m/s]
"""

Constants = np.dtype([
    ('target', target.TargetRecord.dtype),
    ('beamwidth', 'f8'), ('slope', 'f8'), *detector.CONSTANTS_FIELDS,
    ('cos_beta', 'f8'), ('sin_beta', 'f8'), ('cos_phi', 'f8'), ('sin_phi', 'f8'), ('sign', 'f8', 2),
    ('boresight', 'f8', 2),
    ('path', arrival.Path.dtype), ('multipath', multipath.Multipath.dtype),
    ('scintillation', scintillation.Scintillation.dtype),
    ('first_measured_normal', 'i8'), ('first_source_normal', 'i8'), ('first_scintillation_normal', 'i8'),
    ('disk_radius', 'f8'), ('source_sigma', 'f8'), ('period_ns', 'i8'), ('held', 'i8'),
    ('power', 'f8'), ('reference_range', 'f8'), ('half_exponent', 'f8'), ('horizon_mask', 'f8'),
    ('latency_ns', 'i8'),
    ('rate_measured', 'i8'), ('rate_sigma', 'f8'), ('range_measured', 'i8'), ('range_sigma', 'f8'),
    ('range_variance', 'f8'), ('lever_arm', 'f8', 3), ('sectors', 'f8', (blockage.MAX_SECTORS, 3))], align=True)
"""Constants of the receiver, with the constants of its detector.

    slope               true k_m
    sign                1 or -1, of each difference channel
    boresight           null of the differences off the beam, cross-elevation and elevation [rad]
    first_..._normal    index of the first normal of the measured rate and range, of a source of noise, and of the
                        scintillation
    disk_radius         radius of a source of noise [beamwidths]; 0: a carrier
    source_sigma        1-sigma of the power of a source of noise in one sample, as a share of it
    power               carrier power / noise power in one sample at the reference range
    range_variance      variance of the range [m2], in single precision
"""


class Inputs(Record):
    """Inputs of a step.

    valid                           1 if the direction of the beam is known
        azimuth, elevation, .._rate     true beam on the deck [rad], [rad/s]
        mat_ed                          true attitude deck -> earth
        position                        base_link against the station, ENU [m]
        twist_linear, twist_angular     velocity of base_link [m/s] and rate of the deck [rad/s], FLU
    """
    stamp_ns: int
    valid: int
    azimuth: float
    elevation: float
    mat_ed: Matrix3
    position: Vector3
    azimuth_rate: float
    elevation_rate: float
    twist_linear: Vector3
    twist_angular: Vector3


class Outputs(Record):
    """Outputs of a step.

    due                             1 if a result comes out in this step

    The result, measured at stamp_ns; its numbers are NaN while not locked, except C/N0:

    cross_elevation, elevation      errors [rad]
        cn0_dbhz, locked                C/N0 [dB-Hz]; 1 while locked
        rate, range                     rates of the errors [rad/s] and range [m], NaN if not measured; the range has the
                                        single precision of its topic

    Values at the stamp of this step, NaN if not known:

    status                          index into STATUS_TEXT_BY_CODE
        true_..., target_...            true error [rad]; target, ENU [m, m/s]
    """
    due: int
    stamp_ns: int
    cross_elevation: float
    elevation: float
    cn0_dbhz: float
    locked: int
    status: int
    rate: Pair
    range: float
    true_cross_elevation: float
    true_elevation: float
    target_valid: int
    target_position: Vector3
    target_velocity: Vector3


def constants(params, period, built) -> np.ndarray:
    """Return Constants (1,) of TrackingReceiverParameters, a drive step `period` [s] and a target.Target.

    Raises ParameterError for a latency that the ring of results does not cover.
    """
    antenna, receiver = params.antenna, params.receiver
    if receiver.latency >= (RESULT_RING_SIZE - 1) * period:
        raise ParameterError(f'receiver.latency = {receiver.latency:g} s: must be below {RESULT_RING_SIZE - 1} '
                             f'periods of {period:g} s')
    tau = period / receiver.samples_per_step
    c = np.zeros(1, Constants)
    c['target'], c['beamwidth'] = built.constants, antenna.beamwidth
    c['slope'] = antenna.slope * antenna.slope_factor
    detector.set_constants(c, antenna, receiver, period)
    c['cos_beta'], c['sin_beta'] = math.cos(antenna.cross_coupling), math.sin(antenna.cross_coupling)
    c['cos_phi'], c['sin_phi'] = math.cos(antenna.phase_error), math.sin(antenna.phase_error)
    c['sign'] = 1.0
    c['period_ns'] = round(period * 1e9)
    c['held'] = BEAM_MOTIONS.index(receiver.beam) == BEAM_HELD
    c['boresight'] = antenna.boresight_cross_elevation, antenna.boresight_elevation
    c['path'], c['multipath'] = arrival.constants(params.path), multipath.constants(params.path.multipath)
    c['scintillation'] = scintillation.constants(params.path.scintillation, period)
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
        c['power'] *= polarisation.efficiency(params.target.polarisation, antenna.polarisation)
        c['half_exponent'] = 0.5 * receiver.range_exponent
    c['horizon_mask'] = receiver.horizon_mask
    c['latency_ns'] = round(receiver.latency * 1e9)
    c['rate_measured'], c['rate_sigma'] = receiver.rate.measured, receiver.rate.sigma
    c['range_measured'], c['range_sigma'] = receiver.ranging.measured, receiver.ranging.sigma
    c['range_variance'] = np.float32(receiver.ranging.sigma**2)
    c['lever_arm'] = params.lever_arm.x, params.lever_arm.y, params.lever_arm.z
    c['sectors'] = blockage.sectors(params.blockage)
    return c


def initial_state() -> np.ndarray:
    """Return (1,) State before the first step: noise in the channels, not locked."""
    s = np.zeros(1, State)
    s['stamp_ns'], s['agc_power'], s['level_power'] = -1, 1.0, 1.0
    return s


def _measured_normals(receiver) -> int:
    """Return the number of standard normals per step that the channels, rate and range of ReceiverParameters take."""
    return NORMALS_PER_SAMPLE * receiver.samples_per_step + 2 * receiver.rate.measured + receiver.ranging.measured


def _receiver_normals(params) -> int:
    """Return _measured_normals of TrackingReceiverParameters, and those of a source of noise."""
    return _measured_normals(params.receiver) + params.receiver.samples_per_step * params.target.of_noise


def normals_per_step(params) -> int:
    """Return the number of standard normals that `step` takes with TrackingReceiverParameters."""
    return _receiver_normals(params) + scintillation.NORMALS_PER_STEP * params.path.scintillation.on


def angle_noise(params, cn0_dbhz, period):
    """Return the predicted 1-sigma of one published error on axis [rad] at a C/N0 [dB-Hz] and a drive step [s]."""
    antenna, receiver = params.antenna, params.receiver
    tau = period / receiver.samples_per_step
    one_sample = thermal_noise(antenna.beamwidth, antenna.slope, hertz(cn0_dbhz), tau)
    independent = {'none': receiver.samples_per_step, 'recursion': 2.0 * receiver.smoothing_samples - 1.0,
                   'moving_average': receiver.smoothing_samples}
    return one_sample / math.sqrt(independent[receiver.smoothing])


def age(params, period):
    """Return the mean age [s] of an error at its stamp if the beam is held between two steps, otherwise 0.

    A moving beam needs no age. There the mean over a step differs from the error at the stamp at most by the change of
    the error within the step. params: TrackingReceiverParameters; period: drive step [s].
    """
    receiver = params.receiver
    if BEAM_MOTIONS.index(receiver.beam) != BEAM_HELD:
        return 0.0
    return (smoothing.delay(receiver.smoothing, receiver.samples_per_step, receiver.smoothing_samples)
            * period / receiver.samples_per_step)


def beam_age(params, period):
    """Return the mean time [s] from the stamp of the measured beam to the stamp of an error.

    Because a held beam is published at the end of its step, only older steps in the smoothing count. The result is 0
    for a moving beam. params: TrackingReceiverParameters; period: drive step [s].
    """
    receiver = params.receiver
    if BEAM_MOTIONS.index(receiver.beam) != BEAM_HELD:
        return 0.0
    return smoothing.steps_back(receiver.smoothing, receiver.samples_per_step, receiver.smoothing_samples) * period


@compiled
def inputs_known(i):
    """Return True if beam, attitude and position are known and finite."""
    total = i.azimuth + i.elevation
    for row in range(3):
        total += i.position[row] + i.mat_ed[row, 0] + i.mat_ed[row, 1] + i.mat_ed[row, 2]
    return i.valid != 0 and math.isfinite(total)


@compiled
def place_antenna(s, c, i):
    """Set the antenna's position p + M r [m] and velocity v + w x r [m/s] in the state; r: the lever arm, FLU [m]."""
    x, y, z = c.lever_arm[0], c.lever_arm[1], c.lever_arm[2]
    wx, wy, wz = i.twist_angular[0], i.twist_angular[1], i.twist_angular[2]
    e, n, u = to_earth(i.mat_ed, x, y, z)
    s.antenna[0], s.antenna[1], s.antenna[2] = i.position[0] + e, i.position[1] + n, i.position[2] + u
    s.antenna_velocity[0] = i.twist_linear[0] + wy * z - wz * y
    s.antenna_velocity[1] = i.twist_linear[1] + wz * x - wx * z
    s.antenna_velocity[2] = i.twist_linear[2] + wx * y - wy * x


@compiled
def apparent_state(s, c, true):
    """Return the apparent TargetState of a true one, both ENU of the station, with refraction and delay of light."""
    if c.path.refractivity == 0.0 and c.path.light_time == 0:
        return true
    e, n, u = true.position
    r, v = arrival.seen(c.path, (e - s.antenna[0], n - s.antenna[1], u - s.antenna[2]), true.velocity)
    return target.TargetState(true.valid, (s.antenna[0] + r[0], s.antenna[1] + r[1], s.antenna[2] + r[2]), v)


@compiled
def carrier_amplitude(c, e, n, u, hidden):
    """Return the sum voltage on axis [-] from a target at a vector (e, n, u) from the antenna, ENU [m].

    The voltage is 0 below the horizon mask. hidden: True if a blockage hides the target; the voltage is then 0 too.
    """
    _, elevation = earth_angles(e, n, u)
    if hidden or not elevation >= c.horizon_mask:       # also true for an elevation of NaN
        return 0.0
    distance = max(math.sqrt(e * e + n * n + u * u), 1.0)
    return math.sqrt(c.power) * (c.reference_range / distance)**c.half_exponent


@compiled
def voltages(c, amplitude, v_x, v_e, image):
    """Return the Voltages of one sample without noise.

    amplitude: sum voltage on axis [-]; v_x, v_e: offsets of the target from the null of the differences, in
    beamwidths; image: multipath.Image.
    """
    # S_g, D_xg, D_eg: patterns for the image of the target in the ground.
    if c.disk_radius > 0.0:
        S, D_x, D_e = disk_channels(v_x, v_e, c.disk_radius, c.slope, c.cos_beta, c.sin_beta)
    else:
        S, D_x, D_e = channels(v_x, v_e, c.slope, c.cos_beta, c.sin_beta)
    S_imag = D_x_imag = D_e_imag = 0.0
    if c.multipath.reflection != 0.0:
        S_g, D_xg, D_eg = channels((image.dX - c.boresight[0]) / c.beamwidth,
                                   (image.dE - c.boresight[1]) / c.beamwidth, c.slope, c.cos_beta, c.sin_beta)
        S, D_x, D_e = S + image.real * S_g, D_x + image.real * D_xg, D_e + image.real * D_eg
        S_imag, D_x_imag, D_e_imag = image.imaginary * S_g, image.imaginary * D_xg, image.imaginary * D_eg
    x_real, x_imag = c.sign[0] * amplitude * D_x, c.sign[0] * amplitude * D_x_imag
    e_real, e_imag = c.sign[1] * amplitude * D_e, c.sign[1] * amplitude * D_e_imag
    return Voltages(amplitude * S, amplitude * S_imag,
                    x_real * c.cos_phi - x_imag * c.sin_phi, x_real * c.sin_phi + x_imag * c.cos_phi,
                    e_real * c.cos_phi - e_imag * c.sin_phi, e_real * c.sin_phi + e_imag * c.cos_phi)


@compiled
def with_noise(v, normals, first):
    """Return Voltages with noise, made of the normals from index `first` on."""
    # The noise power 1 of a channel is half in its real and half in its imaginary part.
    half = math.sqrt(0.5)
    return Voltages(v.s_real + half * normals[first], v.s_imag + half * normals[first + 1],
                    v.x_real + half * normals[first + 2], v.x_imag + half * normals[first + 3],
                    v.e_real + half * normals[first + 4], v.e_imag + half * normals[first + 5])


@compiled
def error_at(s, seen, part):
    """Return the true (cross-elevation, elevation) error [rad] when a part [-] of a step has passed.

    The error changes during the step from that of the state s to that of `seen`, an Incidence.
    """
    from_X, from_E = (s.cross_elevation, s.elevation) if s.error_known != 0 else (seen.dX, seen.dE)
    return from_X + part * (seen.dX - from_X), from_E + part * (seen.dE - from_E)


@compiled
def voltages_at(s, c, seen, part, amplitude):
    """Return the Voltages without noise when a part [-] of a step has passed; amplitude: sum voltage on axis [-].

    s, seen: see `error_at`.
    """
    X, E = error_at(s, seen, part)
    return voltages(c, amplitude, (X - c.boresight[0]) / c.beamwidth, (E - c.boresight[1]) / c.beamwidth, seen.image)


@compiled
def measure(s, c, seen, normals):
    """Return the errors (cross-elevation, elevation) [rad] that the receiver measures in one step with an Incidence.
    """
    detector.begin(s)
    for k in range(c.samples):
        level = seen.amplitude
        if c.source_sigma > 0.0:
            level *= math.sqrt(max(0.0, 1.0 + c.source_sigma * normals[c.first_source_normal + k]))
        detector.put(s, c, with_noise(voltages_at(s, c, seen, (k + 1.0) / c.samples, level), normals,
                                      NORMALS_PER_SAMPLE * k))
    return detector.errors(s, c)


@compiled
def rate_and_range(s, c, i, target_state, normals):
    """Return the measured ((cross-elevation rate, elevation rate) [rad/s], range [m]) of a TargetState.

    NaN stands for a number that the receiver does not measure.
    """
    rates, distance = NOT_MEASURED, math.nan
    first = c.first_measured_normal
    if c.rate_measured != 0:
        rate_x, rate_e = error_rate(i, s.antenna, s.antenna_velocity, target_state)
        rates = rate_x + c.rate_sigma * normals[first], rate_e + c.rate_sigma * normals[first + 1]
        first += 2
    if c.range_measured != 0:
        e, n, u = target_state.position
        e, n, u = e - s.antenna[0], n - s.antenna[1], u - s.antenna[2]
        distance = float(np.float32(math.sqrt(e * e + n * n + u * u) + c.range_sigma * normals[first]))
    return rates, distance


@compiled
def delay(s, c, o, stamp_ns, result):
    """Put a Result into the ring and release the newest result measured at or before stamp_ns - latency."""
    slot = s.written % RESULT_RING_SIZE
    s.ring_stamp_ns[slot], s.ring_locked[slot] = stamp_ns, s.locked
    s.ring_cross_elevation[slot], s.ring_elevation[slot] = result.error
    s.ring_rate[slot, 0], s.ring_rate[slot, 1] = result.rates
    s.ring_cn0_dbhz[slot], s.ring_range[slot] = result.cn0_dbhz, result.range
    s.written += 1
    s.released = max(s.released, s.written - RESULT_RING_SIZE)
    while s.released < s.written and s.ring_stamp_ns[s.released % RESULT_RING_SIZE] <= stamp_ns - c.latency_ns:
        slot = s.released % RESULT_RING_SIZE
        s.released += 1
        o.due, o.stamp_ns, o.locked = 1, s.ring_stamp_ns[slot], s.ring_locked[slot]
        o.cross_elevation, o.elevation = s.ring_cross_elevation[slot], s.ring_elevation[slot]
        o.cn0_dbhz = s.ring_cn0_dbhz[slot]
        o.rate[0], o.rate[1], o.range = s.ring_rate[slot, 0], s.ring_rate[slot, 1], s.ring_range[slot]


@compiled
def reset_outputs(o):
    """Reset the outputs at the start of a step: nothing measured, nothing known."""
    o.due, o.stamp_ns, o.locked = 0, 0, 0
    o.cross_elevation, o.elevation, o.cn0_dbhz = math.nan, math.nan, math.nan
    o.rate[0], o.rate[1], o.range = math.nan, math.nan, math.nan
    o.true_cross_elevation, o.true_elevation = math.nan, math.nan
    o.target_valid = 0
    for axis in range(3):
        o.target_position[axis], o.target_velocity[axis] = math.nan, math.nan


@compiled
def incidence(s, c, i, o, true, normals):
    """Return the Incidence of the target's true state, and set the true error in the outputs."""
    dX, dE, amplitude = 0.0, 0.0, 0.0
    rates, distance = NOT_MEASURED, math.nan
    image = multipath.Image(0.0, 0.0, 0.0, 0.0)
    hidden = False
    if true.valid:
        place_antenna(s, c, i)
        seen = apparent_state(s, c, true)
        rates, distance = rate_and_range(s, c, i, seen, normals)
        e, n, u = seen.position
        e, n, u = e - s.antenna[0], n - s.antenna[1], u - s.antenna[2]
        x, y, z = to_deck(i.mat_ed, e, n, u)
        if c.held and s.error_known:
            s.cross_elevation, s.elevation = offsets(i.azimuth, i.elevation, s.direction[0], s.direction[1],
                                                     s.direction[2])
        s.direction[0], s.direction[1], s.direction[2] = x, y, z
        dX, dE = offsets(i.azimuth, i.elevation, x, y, z)
        hidden = blockage.blocked(c.sectors, *angles(x, y, z))
        amplitude = carrier_amplitude(c, e, n, u, hidden)
        image = multipath.image(c.multipath, i, e, n, u)
        o.true_cross_elevation, o.true_elevation = dX, dE
        if c.scintillation.on != 0:
            sin_E = u / math.sqrt(e * e + n * n + u * u)
            fading, X, E = scintillation.wander(c.scintillation, s.scintillation, sin_E, normals,
                                                c.first_scintillation_normal)
            amplitude, dX, dE = fading * amplitude, dX + X, dE + E
    return Incidence(dX, dE, amplitude, image, hidden, rates, distance)


@compiled
def begin(s, c, i, o, breaks, coefficients):
    """Begin a step: reset the outputs and set the target in them. Return (the target's true state, time since the last
    step [ns]); the time is 0 for a stamp that is not after the last one. Arguments: see `step`."""
    reset_outputs(o)
    elapsed_ns = 0
    if i.stamp_ns > s.stamp_ns:
        elapsed_ns = i.stamp_ns - s.stamp_ns if s.stamp_ns >= 0 else c.period_ns
        s.stamp_ns = i.stamp_ns
    true = target.state(c.target, breaks, coefficients, 1e-9 * i.stamp_ns)
    if elapsed_ns > 0:
        o.target_valid = true.valid
        o.target_position[0], o.target_position[1], o.target_position[2] = true.position
        o.target_velocity[0], o.target_velocity[1], o.target_velocity[2] = true.velocity
    else:
        o.status = Status.STAMP_ORDER
    return true, elapsed_ns


@compiled
def finish(s, o, true, seen):
    """Keep the error of a step for the next step, and set the status."""
    s.cross_elevation, s.elevation = seen.dX, seen.dE
    s.error_known = true.valid
    o.status = (Status.NO_TARGET if true.valid == 0 else Status.HIDDEN if seen.hidden else
                Status.BELOW_HORIZON if seen.amplitude == 0.0 else Status.LOCKED if s.locked != 0 else Status.NO_LOCK)


@separate
def step(s, c, i, o, breaks, coefficients, normals):
    """Execute one drive step. Never raises: the status of the outputs names a missing input.

    s, c, i, o: records State, Constants, Inputs, Outputs; breaks, coefficients: of the Target;
    normals: (normals_per_step,).
    """
    true, elapsed_ns = begin(s, c, i, o, breaks, coefficients)
    if elapsed_ns == 0:
        return
    error, rates, distance = NOT_MEASURED, NOT_MEASURED, math.nan
    if inputs_known(i):
        seen = incidence(s, c, i, o, true, normals)
        error, rates, distance = measure(s, c, seen, normals), seen.rates, seen.range
        detector.lock(s, c, s.level_power - 1.0, elapsed_ns)
        finish(s, o, true, seen)
    else:
        s.error_known, s.locked, s.timer_ns = 0, 0, 0
        o.status = Status.NO_BEAM
    if s.locked == 0:
        error, rates, distance = NOT_MEASURED, NOT_MEASURED, math.nan
    delay(s, c, o, i.stamp_ns, Result(error, detector.cn0_dbhz(s, c), rates, distance))
