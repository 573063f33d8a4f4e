"""Detector of the tracking receiver: from the voltages of sum and differences to angle errors, C/N0 and lock.

A sample becomes an angle error by Re(d conj(s)) divided by the smoothed sum power (automatic gain control), with the
voltages d of a difference and s of the sum. The error is limited to full scale, then smoothed.

Voltages are scaled so that the noise of one channel has the power 1 in one sample. The carrier power on axis is then
C/N0 tau, with the time tau of a sample. The noise power 1 is subtracted from the measured sum power.
"""
import math
from typing import NamedTuple, Protocol

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, DecibelHertz, Hertz, Nanoseconds, Radians, Records, Seconds
from pedestal_common.record import Record
from receiver_law import smoothing
from receiver_law.monopulse import detect, thermal_noise
from receiver_law.smoothing import SMOOTHING_KINDS

MIN_POWER_OVER_NOISE = 0.01  # smallest reported carrier power over noise power of a sample (-20 dB)


class Antenna(Protocol):
    """Parameters of an antenna, of which the detector needs these."""

    @property
    def beamwidth(self) -> Radians:
        """Half-power beamwidth theta3 of the sum pattern."""

    @property
    def slope(self) -> float:
        """Slope k_m: difference over sum per beamwidth."""


class Receiver(Protocol):
    """Parameters of a receiver, of which the detector needs these."""

    @property
    def samples_per_step(self) -> int:
        """Channel samples per step."""

    @property
    def smoothing(self) -> str:
        """Kind of smoothing, one of SMOOTHING_KINDS."""

    @property
    def smoothing_samples(self) -> int:
        """Number of samples n of recursion and moving average."""

    @property
    def full_scale(self) -> float:
        """Largest error [beamwidths]."""

    @property
    def agc_time_constant(self) -> Seconds:
        """Time constant of the sum power that normalises the errors."""

    @property
    def cn0_time_constant(self) -> Seconds:
        """Time constant of the C/N0."""

    @property
    def acquire_level_dbhz(self) -> DecibelHertz:
        """C/N0 above which the receiver locks."""

    @property
    def lose_level_dbhz(self) -> DecibelHertz:
        """C/N0 below which it loses lock."""

    @property
    def acquire_time(self) -> Seconds:
        """Time above the upper level before lock."""

    @property
    def lose_time(self) -> Seconds:
        """Time below the lower level before loss of lock."""


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


class Voltages(NamedTuple):
    """Voltages of one sample."""
    s_real: float   # of the sum
    s_imag: float
    x_real: float   # of the cross-elevation difference
    x_imag: float
    e_real: float   # of the elevation difference
    e_imag: float


def hertz(cn0_dbhz: DecibelHertz) -> Hertz:
    """Return a C/N0 in Hz."""
    return 10.0**(0.1 * cn0_dbhz)


def set_constants(constants: Records, antenna: Antenna, receiver: Receiver, period: Seconds) -> None:
    """Set the constants (1,) for a step of `period`."""
    tau = period / receiver.samples_per_step
    constants['angle_scale'] = antenna.beamwidth / antenna.slope
    constants['full_scale'] = receiver.full_scale * antenna.beamwidth
    constants['samples'], constants['tau'] = receiver.samples_per_step, tau
    constants['agc_gain'] = -math.expm1(-tau / receiver.agc_time_constant)
    constants['level_gain'] = -math.expm1(-tau / receiver.cn0_time_constant)
    constants['smoothing'] = SMOOTHING_KINDS.index(receiver.smoothing)
    constants['smoothing_gain'] = 1.0 / receiver.smoothing_samples
    constants['smoothing_samples'] = receiver.smoothing_samples
    constants['acquire_power'] = hertz(receiver.acquire_level_dbhz) * tau
    constants['lose_power'] = hertz(receiver.lose_level_dbhz) * tau
    constants['acquire_ns'], constants['lose_ns'] = round(receiver.acquire_time * 1e9), round(receiver.lose_time * 1e9)


def angle_noise(antenna: Antenna, receiver: Receiver, cn0_dbhz: DecibelHertz, period: Seconds) -> Radians:
    """Return the predicted 1-sigma of one published error on axis at a C/N0 and a drive step `period`."""
    tau = period / receiver.samples_per_step
    one_sample = thermal_noise(antenna.beamwidth, antenna.slope, hertz(cn0_dbhz), tau)
    independent = {'none': receiver.samples_per_step, 'recursion': 2.0 * receiver.smoothing_samples - 1.0,
                   'moving_average': receiver.smoothing_samples}
    return one_sample / math.sqrt(independent[receiver.smoothing])


@compiled
def begin(state: State) -> None:
    """Begin a step."""
    smoothing.begin(state.smooth_cross_elevation)
    smoothing.begin(state.smooth_elevation)


@compiled
def put(state: State, constants: Constants, sample: Voltages) -> None:
    """Take the voltages of one sample, noise included. The filters of AGC and level advance."""
    power = sample.s_real * sample.s_real + sample.s_imag * sample.s_imag
    state.agc_power += constants.agc_gain * (power - state.agc_power)
    state.level_power += constants.level_gain * (power - state.level_power)
    # The range of the AGC ends at a carrier as strong as the noise.
    gain = constants.angle_scale / max(state.agc_power - 1.0, 1.0)
    x = gain * detect(sample.x_real, sample.x_imag, sample.s_real, sample.s_imag)
    e = gain * detect(sample.e_real, sample.e_imag, sample.s_real, sample.s_imag)
    limit = constants.full_scale
    smoothing.put(state.smooth_cross_elevation, max(-limit, min(x, limit)), constants.smoothing_gain)
    smoothing.put(state.smooth_elevation, max(-limit, min(e, limit)), constants.smoothing_gain)


@compiled
def errors(state: State, constants: Constants) -> tuple[Radians, Radians]:
    """Return the (cross-elevation, elevation) errors at the end of a step."""
    kind, samples, n = constants.smoothing, constants.samples, constants.smoothing_samples
    return (smoothing.smoothed(state.smooth_cross_elevation, kind, samples, n),
            smoothing.smoothed(state.smooth_elevation, kind, samples, n))


@compiled
def lock(state: State, constants: Constants, power: float, elapsed_ns: Nanoseconds) -> None:
    """Update the lock: gained after acquire_ns above the upper level, lost after lose_ns below the lower level. power:
    carrier power / noise power; elapsed_ns: time since the last step."""
    if state.locked != 0:
        crossed, wait = power < constants.lose_power, constants.lose_ns
    else:
        crossed, wait = power > constants.acquire_power, constants.acquire_ns
    state.timer_ns = state.timer_ns + elapsed_ns if crossed else 0
    if crossed and state.timer_ns >= wait:
        state.locked, state.timer_ns = 1 - state.locked, 0


@compiled
def cn0_dbhz(state: State, constants: Constants) -> DecibelHertz:
    """Return the estimate of the C/N0."""
    return 10.0 * math.log10(max(state.level_power - 1.0, MIN_POWER_OVER_NOISE) / constants.tau)
