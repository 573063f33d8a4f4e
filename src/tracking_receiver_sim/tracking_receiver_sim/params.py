"""Parameters of the target, the path and the tracking receiver: TrackingReceiverNodeParameters of the node."""
import dataclasses
import math

from pedestal_common.geometry import bodies
from pedestal_common.geometry.blockage import BLOCKAGE_DOC as SECTORS_DOC
from pedestal_common.geometry.blockage import sectors
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.lever_arm import LeverArm
from pedestal_common.injection import table
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text
from receiver_law.smoothing import MAX_WINDOW_SAMPLES, SMOOTHING_KINDS

TARGET_KINDS = ('leo_pass', 'track_file', 'flyby', 'sine', 'step', 'ramp', *bodies.POSITIONS)
TARGET_SINE, TARGET_STEP, TARGET_RAMP = map(TARGET_KINDS.index, ('sine', 'step', 'ramp'))

BEAM_MOTIONS = ('moving', 'held')
BEAM_MOVING, BEAM_HELD = range(len(BEAM_MOTIONS))

POLARISATION_SENSES = ('right', 'left')


@dataclasses.dataclass(frozen=True)
class MultipathParameters(Parameters):
    """A wave that level ground or the sea below the antenna reflects."""
    reflection: float = parameter(0.0, 0.0, 1.0, '', 'amplitude factor of smooth ground; 0: off; sea at low angles: '
                                  'near 1')
    roughness: float = parameter(0.0, 0.0, 100.0, 'm', 'rms height of ground or waves')
    height: float = parameter(10.0, 0.1, 1000.0, 'm', 'height of the antenna over the ground')
    wavelength: float = parameter(0.0355, 1e-4, 10.0, 'm', 'wavelength; the default is in X band')


@dataclasses.dataclass(frozen=True)
class ScintillationParameters(Parameters):
    """Turbulence of the air: level and direction of the wave wander; ITU-R P.618 section 2.4.1 for the level."""
    level_db: float = parameter(0.0, 0.0, 10.0, 'dB', '1-sigma of the level at the zenith; grows with 1 / sin^1.2 of '
                                'the elevation')
    angle: float = parameter(0.0, 0.0, 1e-2, 'rad', '1-sigma of the direction at the zenith, each axis; grows with '
                             '1 / sqrt(sin) of the elevation')
    time_constant: float = parameter(1.0, 1e-3, 1000.0, 's', 'time constant of level and direction')

    @property
    def on(self) -> bool:
        """True if level or direction scintillates."""
        return self.level_db > 0.0 or self.angle > 0.0


@dataclasses.dataclass(frozen=True)
class PathParameters(Parameters):
    """Path of the wave from the target to the receiver."""
    refractivity: float = parameter(0.0, 0.0, 500.0, 'N', 'refractivity of the air at the ground, N = 77.6 / T '
                                    '(P + 4810 e / T), T in K, P and e in hPa; 0: no refraction; 311: 15 C, 1013 hPa, '
                                    '50 % humidity')
    light_time: bool = flag(False, 'delay of light: the receiver sees the target where it was when the wave left it')
    multipath: MultipathParameters = group(MultipathParameters)
    scintillation: ScintillationParameters = group(ScintillationParameters)


@dataclasses.dataclass(frozen=True)
class PolarisationParameters(Parameters):
    """The polarisation ellipse of an antenna."""
    axial_ratio_db: float = parameter(0.0, 0.0, 60.0, 'dB', 'axial ratio, long over short axis; 0: circular')
    tilt: float = parameter(0.0, -math.pi, math.pi, 'rad', 'tilt of the long axis, in the frame of the receiving '
                            'antenna')
    sense: str = choice('right', POLARISATION_SENSES, 'sense of rotation')


@dataclasses.dataclass(frozen=True)
class LeoPassParameters(Parameters):
    """A satellite pass, computed from orbital elements by the model SGP4."""
    line_1: str = text('1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991',
                       'first line of the TLE')
    line_2: str = text('2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482',
                       'second line of the TLE')
    omm: str = text('', 'elements as a CCSDS OMM in JSON, instead of the TLE')
    start_time: str = text('', 'UTC of the start, ISO 8601; empty: the run is centred on a culmination; the kinds sun '
                           'and moon need it')
    culmination_low_deg: float = parameter(30.0, 0.0, 90.0, 'deg', 'lowest culmination that the pass finder accepts',
                                           must_be='below culmination_high_deg')
    culmination_high_deg: float = parameter(70.0, 0.0, 90.0, 'deg', 'highest culmination that the pass finder accepts')
    search_days: float = parameter(3.0, 0.1, 30.0, 'd', 'length of the search for a pass, from the TLE epoch on')
    ut1_offset: float = parameter(0.0, -0.9, 0.9, 's', 'UT1 - UTC (IERS Bulletin A), which turns the earth further, '
                                  'also below sun and moon; a program track assumes 0')


@dataclasses.dataclass(frozen=True)
class TrackFileParameters(Parameters):
    """A track from a file: a recorded flight (CSV, ADS-B, GPX, NMEA), a predicted orbit (CCSDS OEM, STK) or a table of
    azimuth and elevation (CSV, program.txt), see docs/reference/tracks.md."""
    path: str = text('', 'file: CSV, ADS-B as CSV, GPX, NMEA, OEM, STK .e, program.txt')
    aircraft: str = text('', 'name of the target if the file holds several: icao24, callsign, name of a GPX track, '
                         'object of an OEM; or talker of a log of NMEA')
    start: float = parameter(0.0, 0.0, 1e7, 's', 'time from the first fix, state or row to stamp 0')
    max_gap: float = parameter(10.0, 0.01, 600.0, 's', 'largest time between two fixes of a flight')
    max_speed: float = parameter(400.0, 1.0, 12e3, 'm/s', 'largest speed of a flight; a faster one is refused')
    max_acceleration: float = parameter(50.0, 0.1, 1000.0, 'm/s2', 'largest acceleration; a track above it is refused')
    smooth: bool = flag(False, 'Rauch-Tung-Striebel smoother of a constant-velocity model on each axis')
    sigma_horizontal: float = parameter(10.0, 1e-3, 1e4, 'm', '1-sigma of a fix east and north, for `smooth`')
    sigma_vertical: float = parameter(3.0, 1e-3, 1e4, 'm', '1-sigma of a fix up, for `smooth`; steps of 25 ft alone '
                                      'give 2.2')
    acceleration_noise: float = parameter(1.0, 1e-3, 1e3, 'm/s2/sqrt(Hz)', 'white acceleration of the target, for '
                                          '`smooth`')


@dataclasses.dataclass(frozen=True)
class FlybyParameters(Parameters):
    """A straight, level pass at constant speed, with growing azimuth. The defaults are the UAV of Ma 2023."""
    closest_distance: float = parameter(500.0, 0.0, 1e6, 'm', 'closest distance over ground')
    height: float = parameter(100.0, -1000.0, 1e6, 'm', 'height above the station')
    speed: float = parameter(15.0, 0.0, 8000.0, 'm/s', 'ground speed')
    heading: float = parameter(math.pi / 2, -2 * math.pi, 2 * math.pi, 'rad', 'course clockwise from north')
    closest_time: float = parameter(30.0, -1e4, 1e6, 's', 'time of closest approach')


@dataclasses.dataclass(frozen=True)
class AngleParameters(Parameters):
    """Targets sine, step and ramp: earth angles about a centre, at a fixed range, moving from `start` on."""
    azimuth: float = parameter(0.0, -2 * math.pi, 2 * math.pi, 'rad', 'azimuth of the centre, clockwise from north')
    elevation: float = parameter(0.6, 0.0, math.pi / 2, 'rad', 'elevation of the centre')
    range: float = parameter(10e3, 10.0, 1e9, 'm', 'distance of the target')
    start: float = parameter(0.0, 0.0, 1e6, 's', 'time at which the motion starts')
    azimuth_amplitude: float = parameter(0.01, -math.pi, math.pi, 'rad', 'azimuth amplitude of sine and step')
    elevation_amplitude: float = parameter(0.01, -math.pi, math.pi, 'rad', 'elevation amplitude of sine and step')
    frequency: float = parameter(0.1, 0.0, 50.0, 'Hz', 'frequency of the sine')
    azimuth_rate: float = parameter(0.01, -10.0, 10.0, 'rad/s', 'azimuth rate of the ramp')
    elevation_rate: float = parameter(0.0, -10.0, 10.0, 'rad/s', 'elevation rate of the ramp')


@dataclasses.dataclass(frozen=True)
class NoiseSourceParameters(Parameters):
    """The sun or the moon as a source of noise: a disk that is equally bright everywhere."""
    diameter: float = parameter(9.25e-3, 0.0, 0.1, 'rad', 'diameter of the disk; default: 0.53 deg, of the sun at '
                                'radio frequencies and of the moon')
    bandwidth: float = parameter(1e6, 1e3, 1e10, 'Hz', 'bandwidth B of the receiver; the noise of the source itself '
                                 'makes the level fluctuate by 1 / sqrt(B t) in the time t')


@dataclasses.dataclass(frozen=True)
class TargetParameters(Parameters):
    """The target and the station."""
    kind: str = choice('leo_pass', TARGET_KINDS, 'kind of target; sun, moon: sources of noise')
    station: StationParameters = group(StationParameters)
    leo_pass: LeoPassParameters = group(LeoPassParameters)
    track_file: TrackFileParameters = group(TrackFileParameters)
    flyby: FlybyParameters = group(FlybyParameters)
    angle: AngleParameters = group(AngleParameters)
    noise_source: NoiseSourceParameters = group(NoiseSourceParameters)
    polarisation: PolarisationParameters = group(PolarisationParameters)

    @property
    def of_noise(self) -> bool:
        """True if the target is a source of noise, without a carrier."""
        return self.kind in bodies.POSITIONS


@dataclasses.dataclass(frozen=True)
class AntennaParameters(Parameters):
    """Sum and difference channels; the defaults are a dish of 3 m at 7 GHz."""
    beamwidth: float = parameter(0.0175, 1e-4, 0.5, 'rad', 'half-power beamwidth theta3 of the sum pattern')
    slope: float = parameter(1.6, 0.5, 1.867, '1', 'slope k_m: difference over sum per beamwidth; lossless: 1.867')
    slope_factor: float = parameter(1.0, 0.1, 5.0, '1', 'true slope over the slope that the receiver assumes')
    cross_coupling: float = parameter(0.0, -math.pi, math.pi, 'rad', 'rotation beta of the axes of the error to the '
                                      'axes of the antenna')
    phase_error: float = parameter(0.0, -math.pi, math.pi, 'rad', 'phase error phi of the differences to the sum, '
                                   'after the comparator')
    boresight_cross_elevation: float = parameter(0.0, -0.1, 0.1, 'rad', 'null of the difference channels off the '
                                                 'beam, in cross-elevation')
    boresight_elevation: float = parameter(0.0, -0.1, 0.1, 'rad', 'null of the difference channels off the beam, in '
                                           'elevation')
    polarisation: PolarisationParameters = group(PolarisationParameters)


@dataclasses.dataclass(frozen=True)
class RateParameters(Parameters):
    """Measured rate of the angle error, independent of the measured error: tachometer of the antenna and receiver."""
    measured: bool = flag(False, 'measurement of the rate of the angle error, published on angle_rate')
    sigma: float = parameter(1.745e-3, 1e-9, 10.0, 'rad/s', '1-sigma of the rate of each axis, tachometer and '
                             'receiver together')


@dataclasses.dataclass(frozen=True)
class RangingParameters(Parameters):
    """Measurement of the distance of the target."""
    measured: bool = flag(False, 'measurement of the range, published on range')
    sigma: float = parameter(1.0, 1e-6, 1e6, 'm', '1-sigma of the range')


@dataclasses.dataclass(frozen=True)
class ReceiverParameters(Parameters):
    """Level, sampling, smoothing, lock and latency of the receiver."""
    cn0_dbhz: float = parameter(46.4, 0.0, 120.0, 'dB-Hz', 'C/N0 on the beam axis at the reference range; of sun and '
                                'moon: bandwidth times noise above the system noise over system noise, if all of '
                                'their noise came from a point')
    reference_range: float = parameter(500e3, 1.0, 1e10, 'm', 'range at which the C/N0 is cn0_dbhz')
    range_exponent: float = parameter(2.0, 0.0, 4.0, '1', 'power of the range with which C/N0 falls; 0: constant')
    horizon_mask: float = parameter(0.0, -math.pi / 2, math.pi / 2, 'rad', 'elevation below which there is no signal')
    samples_per_step: int = parameter(5, 1, 100, '1', 'channel samples per drive step')
    beam: str = choice('moving', BEAM_MOTIONS, 'motion of the beam between two steps; held: an electronic beam, which '
                       'jumps at the steps')
    smoothing: str = choice('none', SMOOTHING_KINDS, 'smoothing of the errors; none: mean over a step; recursion: '
                            'low-pass of Jia 2025 over the samples')
    smoothing_samples: int = parameter(20, 1, 10000, '1', 'number of samples n of recursion and moving average')
    full_scale: float = parameter(0.7, 0.1, 100.0, 'beamwidths', 'largest error that the detector puts out')
    agc_time_constant: float = parameter(0.05, 1e-3, 10.0, 's', 'time constant of the sum power that normalises the '
                                         'errors')
    cn0_time_constant: float = parameter(0.1, 1e-3, 10.0, 's', 'time constant of the published C/N0')
    acquire_level_dbhz: float = parameter(39.0, 0.0, 120.0, 'dB-Hz', 'C/N0 above which the receiver locks after '
                                          'acquire_time')
    lose_level_dbhz: float = parameter(36.0, 0.0, 120.0, 'dB-Hz', 'C/N0 below which the receiver loses lock after '
                                       'lose_time')
    acquire_time: float = parameter(0.1, 0.0, 10.0, 's', 'time above acquire_level_dbhz until the receiver locks')
    lose_time: float = parameter(0.05, 0.0, 10.0, 's', 'time below lose_level_dbhz until the receiver loses lock')
    latency: float = parameter(0.0, 0.0, 0.5, 's', 'time from a measurement to its publication')
    rate: RateParameters = group(RateParameters)
    ranging: RangingParameters = group(RangingParameters)

    def check(self) -> None:
        """Raise ParameterError if a moving average is too long, or if the lower lock level is above the upper one."""
        if self.smoothing == 'moving_average' and self.smoothing_samples > MAX_WINDOW_SAMPLES:
            raise ParameterError(f'smoothing_samples = {self.smoothing_samples}: must be 1 to {MAX_WINDOW_SAMPLES} '
                                 'with smoothing = moving_average')
        if self.lose_level_dbhz > self.acquire_level_dbhz:
            raise ParameterError(f'lose_level_dbhz = {self.lose_level_dbhz:g} dB-Hz: must not be above '
                                 f'acquire_level_dbhz = {self.acquire_level_dbhz:g} dB-Hz')


@dataclasses.dataclass(frozen=True)
class TrackingReceiverParameters(Parameters):
    """Parameters of target, path and receiver."""
    lever_arm: LeverArm = group(LeverArm)
    blockage: str = text('', SECTORS_DOC)
    target: TargetParameters = group(TargetParameters)
    path: PathParameters = group(PathParameters)
    antenna: AntennaParameters = group(AntennaParameters)
    receiver: ReceiverParameters = group(ReceiverParameters)
    seed: int = parameter(1, 0, 2**31 - 1, '1', 'seed of the receiver noise')

    def check(self) -> None:
        """Raise ParameterError if `blockage` is not a list of hidden sectors."""
        sectors(self.blockage)


@dataclasses.dataclass(frozen=True)
class TrackingReceiverNodeParameters(TrackingReceiverParameters):
    """Parameters of tracking_receiver_node: the receiver, and the step and length of the run."""
    period: float = parameter(5e-3, 1e-4, 1.0, 's', 'period T of the steps of the drive')
    duration: float = parameter(3600.0, 0.1, 86400.0, 's', 'duration of the run, covered by the target motion')
    inject: str = text('', table.INJECT_DOC)

    def check(self) -> None:
        """Raise ParameterError if `inject` is not a list of faults of the receiver."""
        super().check()
        table.scheduled_commands('tracking_receiver', self.inject)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError if `inject` holds a fault that the pacing of the graph excludes."""
        super().check_graph(beams, lockstep)
        table.check_pacing('tracking_receiver', self.inject, lockstep)
