"""Detector of the tracking receiver: from the voltages of sum and differences to angle errors, C/N0 and lock.

A sample becomes an angle error by Re(d conj(s)) divided by the smoothed sum power (automatic gain control, AGC). d and
s are the voltages of difference and sum. The error is limited to the full scale of the detector, then smoothed.

Voltages are scaled so that the noise of one channel has the power 1 in one sample. The carrier power on axis is then
C/N0 tau, with the time tau of a sample. The noise power 1 is subtracted from the measured sum power.

The simulated receiver (`receiver`) and a receiver of I/Q samples (pedestal_hardware.monopulse) both call these
functions. Arguments: s a record with the fields STATE_FIELDS, c a record with the fields CONSTANTS_FIELDS.
"""
import math
from collections import namedtuple

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Nanoseconds, Radians, Seconds
from pedestal_common.record import Record
from tracking_receiver_sim import smoothing
from tracking_receiver_sim.monopulse import detect
from tracking_receiver_sim.smoothing import SMOOTHING_KINDS

MIN_POWER_OVER_NOISE = 0.01
"""Smallest ratio of carrier power to noise power in one sample that the C/N0 estimate reports (-20 dB)."""


class State(Record):
    """State of the detector."""
    agc_power: float                            # sum power / noise power, smoothed for the gain
    level_power: float                          # sum power / noise power, smoothed for the C/N0
    smooth_cross_elevation: smoothing.Smoother
    smooth_elevation: smoothing.Smoother
    locked: Bit
    timer_ns: Nanoseconds                       # time for which the level has been past that which changes the lock


class Constants(Record):
    """Constants of the detector. A gain is the share of the way to its input that a filter moves in a sample."""
    angle_scale: Radians        # theta3 / k_m with the k_m that the receiver assumes
    full_scale: Radians         # largest error
    samples: int                # of one step
    tau: Seconds                # time of a sample
    agc_gain: float
    level_gain: float
    smoothing: int              # index of SMOOTHING_KINDS
    smoothing_gain: float       # 1/n of the recursion
    smoothing_samples: int      # length of the moving average
    acquire_power: float        # carrier power / noise power in one sample above which the receiver gains lock
    lose_power: float           # carrier power / noise power in one sample below which it loses lock
    acquire_ns: Nanoseconds
    lose_ns: Nanoseconds


STATE_FIELDS, CONSTANTS_FIELDS = ([(name, record.dtype[name]) for name in record.dtype.names or ()]
                                  for record in (State, Constants))
"""Fields of both, for records that hold them among others."""

Voltages = namedtuple('Voltages', 's_real s_imag x_real x_imag e_real e_imag')
"""Voltages of one sample: sum, cross-elevation difference, elevation difference."""


def hertz(cn0_dbhz):
    """Return a C/N0 [Hz] given in dB-Hz."""
    return 10.0**(0.1 * cn0_dbhz)


def set_constants(c, antenna, receiver, period):
    """Set CONSTANTS_FIELDS in the record c (1,) from AntennaParameters, ReceiverParameters and a step [s]."""
    tau = period / receiver.samples_per_step
    c['angle_scale'] = antenna.beamwidth / antenna.slope
    c['full_scale'] = receiver.full_scale * antenna.beamwidth
    c['samples'], c['tau'] = receiver.samples_per_step, tau
    c['agc_gain'] = -math.expm1(-tau / receiver.agc_time_constant)
    c['level_gain'] = -math.expm1(-tau / receiver.cn0_time_constant)
    c['smoothing'] = SMOOTHING_KINDS.index(receiver.smoothing)
    c['smoothing_gain'], c['smoothing_samples'] = 1.0 / receiver.smoothing_samples, receiver.smoothing_samples
    c['acquire_power'] = hertz(receiver.acquire_level_dbhz) * tau
    c['lose_power'] = hertz(receiver.lose_level_dbhz) * tau
    c['acquire_ns'], c['lose_ns'] = round(receiver.acquire_time * 1e9), round(receiver.lose_time * 1e9)


@compiled
def begin(s):
    """Begin a step."""
    smoothing.begin(s.smooth_cross_elevation)
    smoothing.begin(s.smooth_elevation)


@compiled
def put(s, c, v):
    """Take the Voltages of one sample, noise included. The filters of AGC and level advance."""
    power = v.s_real * v.s_real + v.s_imag * v.s_imag
    s.agc_power += c.agc_gain * (power - s.agc_power)
    s.level_power += c.level_gain * (power - s.level_power)
    # The range of the AGC ends at a carrier as strong as the noise.
    gain = c.angle_scale / max(s.agc_power - 1.0, 1.0)
    x = gain * detect(v.x_real, v.x_imag, v.s_real, v.s_imag)
    e = gain * detect(v.e_real, v.e_imag, v.s_real, v.s_imag)
    smoothing.put(s.smooth_cross_elevation, max(-c.full_scale, min(x, c.full_scale)), c.smoothing_gain)
    smoothing.put(s.smooth_elevation, max(-c.full_scale, min(e, c.full_scale)), c.smoothing_gain)


@compiled
def errors(s, c):
    """Return the (cross-elevation, elevation) errors [rad] at the end of a step."""
    return (smoothing.smoothed(s.smooth_cross_elevation, c.smoothing, c.samples, c.smoothing_samples),
            smoothing.smoothed(s.smooth_elevation, c.smoothing, c.samples, c.smoothing_samples))


@compiled
def lock(s, c, power, elapsed_ns):
    """Update the lock: gained after acquire_ns above the upper level, lost after lose_ns below the lower level.

    power: carrier power / noise power; elapsed_ns: time since the last step.
    """
    if s.locked != 0:
        crossed, wait = power < c.lose_power, c.lose_ns
    else:
        crossed, wait = power > c.acquire_power, c.acquire_ns
    s.timer_ns = s.timer_ns + elapsed_ns if crossed else 0
    if crossed and s.timer_ns >= wait:
        s.locked, s.timer_ns = 1 - s.locked, 0


@compiled
def cn0_dbhz(s, c):
    """Return the estimate of the C/N0 [dB-Hz]."""
    return 10.0 * math.log10(max(s.level_power - 1.0, MIN_POWER_OVER_NOISE) / c.tau)
