"""Parameters of ship, IMU and INS: ShipMotionParameters of `ship_motion_node`, InsParameters of `ins_node`.

Both hold the group `ship`, which must be the same in both nodes; the status of ins.step reports a difference.
"""
import dataclasses

from pedestal_common.injection import table
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text

MAX_SEED = 2 ** 31 - 1
IMU_OUTPUTS = ('sample', 'increment')
INS_METHODS = ('model', 'riccati_eso')
VELOCITY_AIDS = ('none', 'log')


@dataclasses.dataclass(frozen=True)
class HullParameters(Parameters):
    """A ship of about 10 000 t. The gains are plausible, not identified."""
    length: float = parameter(145.0, 5.0, 500.0, 'm', 'length on the waterline')
    beam: float = parameter(20.6, 1.0, 100.0, 'm', 'beam on the waterline')
    draught: float = parameter(7.2, 0.2, 40.0, 'm', 'draught')
    roll_gain: float = parameter(0.75, 0.0, 2.0, '-', 'roll per effective wave slope, static')
    roll_period: float = parameter(13.0, 1.0, 60.0, 's', 'natural period of roll')
    roll_damping: float = parameter(0.08, 0.005, 2.0, '-', 'damping ratio of roll')
    pitch_period: float = parameter(6.8, 1.0, 60.0, 's', 'natural period of pitch')
    pitch_damping: float = parameter(0.35, 0.005, 2.0, '-', 'damping ratio of pitch')
    heave_period: float = parameter(7.2, 1.0, 60.0, 's', 'natural period of heave')
    heave_damping: float = parameter(0.30, 0.005, 2.0, '-', 'damping ratio of heave')
    yaw_gain: float = parameter(0.9, 0.0, 2.0, '-', 'yaw per rotation of the orbital flow along the hull, static')
    yaw_period: float = parameter(12.0, 1.0, 120.0, 's', 'natural period of yaw')
    yaw_damping: float = parameter(0.7, 0.005, 2.0, '-', 'damping ratio of yaw')


@dataclasses.dataclass(frozen=True)
class PlainParameters(Parameters):
    """One sine for each degree of freedom, amplitude sin(2 pi t / period); no surge and no sway."""
    roll_amplitude_deg: float = parameter(10.0, 0.0, 60.0, 'deg', 'amplitude of roll')
    roll_period: float = parameter(8.0, 0.5, 1000.0, 's', 'period of roll')
    pitch_amplitude_deg: float = parameter(0.0, 0.0, 60.0, 'deg', 'amplitude of pitch')
    pitch_period: float = parameter(6.0, 0.5, 1000.0, 's', 'period of pitch')
    yaw_amplitude_deg: float = parameter(0.0, 0.0, 60.0, 'deg', 'amplitude of yaw about the mean heading')
    yaw_period: float = parameter(12.0, 0.5, 1000.0, 's', 'period of yaw')
    heave_amplitude: float = parameter(0.0, 0.0, 20.0, 'm', 'amplitude of heave')
    heave_period: float = parameter(7.0, 0.5, 1000.0, 's', 'period of heave')


@dataclasses.dataclass(frozen=True)
class RecordedParameters(Parameters):
    """A recorded motion; recording.py describes columns and signs."""
    path: str = text('', 'CSV with columns time_s, roll_deg, pitch_deg, heading_deg (surge_m, sway_m, heave_m)')
    start: float = parameter(0.0, 0.0, 1e7, 's', 'time from the first row to stamp 0')
    max_gap: float = parameter(2.0, 0.001, 60.0, 's', 'largest time between two rows')


@dataclasses.dataclass(frozen=True)
class ShipParameters(Parameters):
    """Sea, course and hull: the parameters that the truth of the ship depends on."""
    motion: str = choice('waves', ('waves', 'plain', 'recorded'), 'source of the motion: waves of a spectrum, plain '
                         'sines, or a CSV file')
    sea_state: int = parameter(5, 0, 6, '-', 'sea state 3 to 6, which sets height and period; 0: significant_height '
                               'and peak_period')
    significant_height: float = parameter(0.0, 0.0, 20.0, 'm', 'significant wave height Hs, only with sea_state 0')
    peak_period: float = parameter(0.0, 0.0, 25.0, 's', 'peak period Tp, only with sea_state 0')
    spectrum: str = choice('jonswap', ('jonswap', 'file'), 'spectrum of the waves; file: a measured spectrum instead '
                           'of a sea state')
    gamma: float = parameter(3.3, 1.0, 10.0, '-', 'peak enhancement of JONSWAP; 1 is Bretschneider')
    spectrum_file: str = text('', 'CSV of a measured spectrum with columns frequency_hz, density_m2_per_hz')
    wave_angle_deg: float = parameter(45.0, 0.0, 360.0, 'deg', 'direction to which the waves travel, clockwise from '
                                      'the bow; 0: following sea, 180: head sea')
    spread_deg: float = parameter(15.0, 0.0, 60.0, 'deg', 'standard deviation of the direction of single waves')
    heading_deg: float = parameter(0.0, 0.0, 360.0, 'deg', 'mean heading, clockwise from north; 0 with motion '
                                   'recorded, whose file holds the heading')
    speed: float = parameter(7.0, 0.0, 25.0, 'm/s', 'speed along the mean heading')
    latitude_deg: float = parameter(47.0, -89.0, 89.0, 'deg', 'geodetic latitude, for gravity and earth rate')
    seed: int = parameter(1, 0, MAX_SEED, '-', 'seed of the seaway')
    hull: HullParameters = group(HullParameters)
    plain: PlainParameters = group(PlainParameters)
    recorded: RecordedParameters = group(RecordedParameters)

    def check(self) -> None:
        """Raise ParameterError for a missing or useless file, wave height or heading."""
        if (self.motion == 'recorded') != bool(self.recorded.path):
            raise ParameterError(f"recorded.path = '{self.recorded.path}': must name a CSV file with motion = "
                                 'recorded, and be empty otherwise')
        if self.motion == 'recorded' and self.heading_deg != 0.0:
            raise ParameterError(f'heading_deg = {self.heading_deg:g} deg: must be 0 with motion = recorded, whose '
                                 'heading is in the file')
        if (self.spectrum == 'file') != bool(self.spectrum_file):
            raise ParameterError(f"spectrum_file = '{self.spectrum_file}': must name a CSV file with spectrum = file, "
                                 'and be empty otherwise')
        if self.spectrum == 'file' and self.motion != 'waves':
            raise ParameterError(f"spectrum = 'file': has no effect with motion = {self.motion}; take motion = waves")
        if self.sea_state in (1, 2):
            raise ParameterError(f'sea_state = {self.sea_state}: must be 3 to 6, or 0 for significant_height and '
                                 'peak_period')
        for name, low in (('significant_height', 0.01), ('peak_period', 3.0)):
            value = getattr(self, name)
            if self.sea_state == 0 and self.motion == 'waves' and value < low:
                raise ParameterError(f'{name} = {value:g}: must be at least {low:g} with sea_state = 0')
            if self.sea_state != 0 and value != 0.0:
                raise ParameterError(f'{name} = {value:g}: must be 0 unless sea_state = 0')


@dataclasses.dataclass(frozen=True)
class ImuParameters(Parameters):
    """Errors of the IMU; the defaults are gyrocompass grade: 0.01 deg/h, 0.005 deg/sqrt(h), 30 ug, 10 ug/sqrt(Hz)."""
    gyro_bias_x: float = parameter(4.85e-8, -0.1, 0.1, 'rad/s', 'gyro bias along x')
    gyro_bias_y: float = parameter(4.85e-8, -0.1, 0.1, 'rad/s', 'gyro bias along y')
    gyro_bias_z: float = parameter(4.85e-8, -0.1, 0.1, 'rad/s', 'gyro bias along z')
    gyro_noise: float = parameter(1.45e-6, 0.0, 0.01, 'rad/sqrt(s)', 'angle random walk')
    accelerometer_bias_x: float = parameter(3e-4, -1.0, 1.0, 'm/s2', 'accelerometer bias along x')
    accelerometer_bias_y: float = parameter(3e-4, -1.0, 1.0, 'm/s2', 'accelerometer bias along y')
    accelerometer_bias_z: float = parameter(3e-4, -1.0, 1.0, 'm/s2', 'accelerometer bias along z')
    accelerometer_noise: float = parameter(1e-4, 0.0, 1.0, 'm/s/sqrt(s)', 'velocity random walk')
    gyro_scale: float = parameter(0.0, -0.1, 0.1, '-', "error of the gyros' scale factor")
    gyro_misalignment: float = parameter(0.0, -0.1, 0.1, 'rad', 'rotation of each gyro axis towards the next axis')
    gyro_quantum: float = parameter(0.0, 0.0, 0.01, 'rad', 'smallest angle increment; 0: no quantisation')
    accelerometer_scale: float = parameter(0.0, -0.1, 0.1, '-', "error of the accelerometers' scale factor")
    accelerometer_misalignment: float = parameter(0.0, -0.1, 0.1, 'rad', 'rotation of each accelerometer axis towards '
                                                  'the next axis')
    accelerometer_quantum: float = parameter(0.0, 0.0, 0.1, 'm/s', 'smallest velocity increment; 0: no quantisation')
    output: str = choice('sample', IMU_OUTPUTS, 'rates at the stamp (sample), or their means since the last sample '
                         '(increment)')
    seed: int = parameter(2, 0, MAX_SEED, '-', 'seed of the noise')


@dataclasses.dataclass(frozen=True)
class NmeaParameters(Parameters):
    """The true attitude as NMEA 0183 (HEHDT, PASHR) over UDP, for third-party equipment."""
    port: int = parameter(0, 0, 65535, '-', 'UDP port of the receiver of the datagrams; 0: off')
    host: str = text('127.0.0.1', 'host name or IPv4 address of the receiver of the datagrams')
    rate: float = parameter(10.0, 0.1, 100.0, 'Hz', 'datagrams per second of simulated time')


@dataclasses.dataclass(frozen=True)
class ShipMotionParameters(Parameters):
    """Parameters of ship_motion_node."""
    ship: ShipParameters = group(ShipParameters)
    imu: ImuParameters = group(ImuParameters)
    nmea: NmeaParameters = group(NmeaParameters)
    inject: str = text('', table.INJECT_DOC)

    def check(self) -> None:
        """Raise ParameterError if `inject` is not a list of faults of ship_motion."""
        table.scheduled_commands('ship_motion', self.inject)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError if `inject` holds a fault that the pacing of the graph excludes."""
        super().check_graph(beams, lockstep)
        table.check_pacing('ship_motion', self.inject, lockstep)


@dataclasses.dataclass(frozen=True)
class AlignmentParameters(Parameters):
    """The alignment of an INS, and the sensors and sea that it assumes."""
    step: float = parameter(0.02, 0.001, 1.0, 's', 'step of the alignment, at least the period of the IMU')
    initial_heading_deg: float = parameter(0.0, 0.0, 360.0, 'deg', 'heading assumed at power-up; it may be wrong')
    aligned_sigma: float = parameter(0.0035, 1e-5, 0.5, 'rad', '1-sigma of heading at which navigation begins')
    velocity_disturbance: float = parameter(0.05, 1e-4, 10.0, 'm/s', 'rms of the velocity of sea and aid per step and '
                                            'axis, assumed white')
    gyro_noise: float = parameter(1.45e-6, 1e-9, 0.01, 'rad/sqrt(s)', 'assumed angle random walk of the gyros')
    gyro_bias: float = parameter(4.85e-8, 0.0, 0.1, 'rad/s', 'assumed 1-sigma of the bias of a level gyro')
    accelerometer_bias: float = parameter(3e-4, 0.0, 1.0, 'm/s2', 'assumed 1-sigma of the bias of an accelerometer')


@dataclasses.dataclass(frozen=True)
class AidParameters(Parameters):
    """A measured velocity, with which the INS separates swell and speed from its errors."""
    source: str = choice('none', VELOCITY_AIDS, 'source of the velocity; log: in deck axes')
    noise: float = parameter(0.02, 0.0, 10.0, 'm/s', 'rms white noise of the velocity, per axis and IMU sample')


@dataclasses.dataclass(frozen=True)
class InsParameters(Parameters):
    """Parameters of ins_node. Method `model` is the truth with parametrised errors (roll_bias ... imu_tolerance).

    Method `riccati_eso` integrates the IMU and aligns by itself. `ship` must be that of ship_motion_node: the method
    uses its latitude, and the velocity that an aid measures.
    """
    method: str = choice('model', INS_METHODS, 'model: truth with parametrised errors; '
                         'riccati_eso: integration of the IMU, with an alignment')
    roll_bias: float = parameter(0.0, -0.2, 0.2, 'rad', 'constant error of roll')
    pitch_bias: float = parameter(0.0, -0.2, 0.2, 'rad', 'constant error of pitch')
    heading_bias: float = parameter(0.0, -0.2, 0.2, 'rad', 'constant error of heading, clockwise')
    tilt_wander: float = parameter(1.7e-4, 0.0, 0.1, 'rad', 'rms of the slow error of roll and pitch')
    heading_wander: float = parameter(5e-4, 0.0, 0.1, 'rad', 'rms of the slow error of heading')
    wander_time: float = parameter(300.0, 0.1, 1e5, 's', 'correlation time of the slow errors')
    tilt_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of roll and pitch, per sample')
    heading_noise: float = parameter(3e-5, 0.0, 0.1, 'rad', 'rms white noise of heading, per sample')
    rate_noise: float = parameter(1.7e-4, 0.0, 0.1, 'rad/s', 'rms white noise of the deck rate, per axis and sample')
    latency: float = parameter(0.005, 0.0, 0.25, 's', 'time from a measurement to its publication')
    imu_tolerance: float = parameter(0.005, 1e-6, 1.0, 'rad/s', 'largest difference between the rate of the IMU and '
                                     'that of the `ship` parameters of the INS')
    error_told: bool = flag(True, 'publication of ins/error, the noise and random walk of the attitude error')
    seed: int = parameter(3, 0, MAX_SEED, '-', 'seed of the errors')
    imu_output: str = choice('sample', IMU_OUTPUTS, 'parameter `output` of the IMU')
    alignment: AlignmentParameters = group(AlignmentParameters)
    aid: AidParameters = group(AidParameters)
    ship: ShipParameters = group(ShipParameters)
    inject: str = text('', table.INJECT_DOC)

    def check(self) -> None:
        """Raise ParameterError if `inject` is not a list of faults of the INS."""
        table.scheduled_commands('ins', self.inject)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError if `inject` holds a fault that the pacing of the graph excludes."""
        super().check_graph(beams, lockstep)
        table.check_pacing('ins', self.inject, lockstep)
