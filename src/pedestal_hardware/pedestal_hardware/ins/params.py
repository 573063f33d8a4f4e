"""Parameters of ins_input_node."""
import dataclasses
import math

from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text
from pedestal_common.quantities import Radians
from pedestal_hardware.ins.frames import BODY_MATRICES, EARTH_MATRICES
from pedestal_hardware.ins.sentences import KINDS
from pedestal_hardware.lines import sources


@dataclasses.dataclass(frozen=True)
class NmeaInputParameters(Parameters):
    """A device that sends NMEA sentences."""
    url: str = text('udp://127.0.0.1:5010', f'connection: {sources.URL_FORMS_TEXT}; udp: HOST is an address of this '
                    'machine')
    baud_rate: int = parameter(38400, 50, 4_000_000, 'Bd', 'speed of a serial device')
    sentence: str = choice('pashr', KINDS, 'sentence that gives the attitude; hdt: heading only, for a level deck')
    roll_positive: str = choice('starboard_down', ('starboard_down', 'port_down'), 'side that is down at a positive '
                                'roll')
    pitch_positive: str = choice('bow_up', ('bow_up', 'bow_down'), 'position of the bow at a positive pitch')
    roll_angle: str = choice('tait_bryan', ('tait_bryan', 'tss'), 'definition of roll; tss: angle of the athwartships '
                             'axis against the horizontal')
    aligned_status: int = parameter(0, 0, 99, '', 'smallest INS status of PASHR that means aligned; 0: the status is '
                                    'not used')


@dataclasses.dataclass(frozen=True)
class ImuInputParameters(Parameters):
    """A device whose ROS driver publishes sensor_msgs/Imu."""
    topic: str = text('imu/data', 'topic of the driver')
    earth: str = choice('enu', tuple(EARTH_MATRICES), 'frame of the earth; nwu: as enu, but yaw is 0 at north')
    body: str = choice('flu', tuple(BODY_MATRICES), 'body frame of the orientation; flu: x forward, y left, z up; '
                       'frd: forward, right, down; rfu: right, forward, up')
    rate_body: str = choice('flu', tuple(BODY_MATRICES), 'body frame of angular_velocity and linear_acceleration')
    undeclared_rates: bool = flag(False, 'angular_velocity is valid although its covariance declares it missing')


@dataclasses.dataclass(frozen=True)
class MountingParameters(Parameters):
    """Angles of the case of the device on the deck: turned by yaw, then by pitch, then by roll."""
    roll: float = parameter(0.0, -180.0, 180.0, 'deg', 'roll of the case, positive with its port side up')
    pitch: float = parameter(0.0, -90.0, 90.0, 'deg', 'pitch of the case, positive with its front down')
    yaw: float = parameter(0.0, -180.0, 180.0, 'deg', 'yaw of the case, positive with its front to port')

    @property
    def radians(self) -> tuple[Radians, Radians, Radians]:
        """Roll, pitch, yaw."""
        return math.radians(self.roll), math.radians(self.pitch), math.radians(self.yaw)


@dataclasses.dataclass(frozen=True)
class InsInputParameters(Parameters):
    """Parameters of ins_input_node."""
    REALTIME_ONLY = ', because the INS has its own time'

    source: str = choice('nmea', ('nmea', 'imu'), 'NMEA sentences, or the sensor_msgs/Imu of a driver')
    nmea: NmeaInputParameters = group(NmeaInputParameters)
    imu: ImuInputParameters = group(ImuInputParameters)
    mounting: MountingParameters = group(MountingParameters)
    heading_zero: float = parameter(0.0, -360.0, 360.0, 'deg', 'true heading at which the device reports 0')
    stamp: str = choice('arrival', ('arrival', 'device'), 'time of a sample: its arrival, or the time that the device '
                        'states (PASHR, header.stamp)')
    latency: float = parameter(0.0, -1.0, 1.0, 's', 'time from the measurement to the stamp, which is subtracted')
    oldest: float = parameter(0.5, 0.01, 10.0, 's', 'largest age of a stamp')
    future: float = parameter(0.02, 0.0, 10.0, 's', 'largest lead of a stamp over the clock of this host')
    max_gap: float = parameter(0.5, 0.02, 10.0, 's', 'longest time between two samples; after a longer gap the rates '
                               'begin again')
    rate_bandwidth: float = parameter(10.0, 0.5, 200.0, 'rad/s', 'bandwidth of the rates that follow from the '
                                      'attitude of a device without rates')
    aligned_sigma: float = parameter(0.5, 0.001, 180.0, 'deg', 'largest stated 1-sigma of the heading of an aligned '
                                     'device')
    frame_check: bool = flag(True, 'attitudes are withheld while their change contradicts the rates')
    silence: float = parameter(0.5, 0.05, 60.0, 's', 'time without an attitude from which the diagnostics report an '
                               'error')

    def check(self) -> None:
        """Raise ParameterError for a connection that cannot be used, or a time that the sentence does not have."""
        if self.source == 'nmea':
            sources.place(self.nmea.url, 'nmea.url')
            if self.nmea.aligned_status and self.nmea.sentence != 'pashr':
                raise ParameterError(f'nmea.aligned_status = {self.nmea.aligned_status}: must be 0 with nmea.sentence '
                                     f'= {self.nmea.sentence}, which states no status')
            if self.stamp == 'device' and self.nmea.sentence != 'pashr':
                raise ParameterError(f'stamp = device: must be arrival with nmea.sentence = {self.nmea.sentence}, '
                                     'which has no time')
        if not self.imu.topic.strip():
            raise ParameterError("imu.topic = '': must be the name of a topic")
