"""Table of the topics of the graph: type, rate, and meaning of every number. `nodes` has their publishers and
subscribers.

    step    one message per drive step, stamped with the step (or with the measured step, where latency is modelled)
    once    one message before the first step
    second  one message of each publisher at every whole second of the drive's time
    change  a message at each change; it belongs to the next step that its publisher answers
    sample  a message whenever its publisher has measured, in realtime only; a lockstep run takes none
    command a message for each command; the reply states the result, and the step before which the command took effect
    reply   a message for each command that the node accepted or refused
    station a message of the station, a program beside a graph in realtime
"""
import typing
from collections.abc import Mapping

AXES = ('azimuth', 'elevation')
MOTOR_NAMES = tuple(f'{axis}_motor_{i}' for axis in AXES for i in (1, 2))
MOTION_MODELS = ('cv', 'ca', 'singer', 'current_statistical', *(f'ca_{rung}' for rung in range(2, 9)))
"""Motion models of the target in the ACU's filters."""

FILTER_UNITS = {'innovation': 'rad', 'rate_innovation': 'rad/s', 'nis': '', 'sigma': 'rad', 'rate_sigma': 'rad/s',
                'correlation': '', 'innovation_sigma': 'rad', **dict.fromkeys(MOTION_MODELS, '')}
"""{number: unit} of acu/filter, for the filter of one axis; the number of a motion model is its probability."""

ENABLED_STATES = ('enabled', 'enabled: azimuth motor lost', 'enabled: elevation motor lost',
                  'enabled: azimuth and elevation motor lost')
"""Texts of adu/state with which the drive follows commands. Bit 0 of their index means that the azimuth runs with one
motor of its pair, bit 1 the same for the elevation."""

PIN_STATE_TEXTS = ('out', 'moving', 'in', 'failed')
"""States of a stow pin: it releases its axis, is in motion, locks its axis, or did not reach the commanded
position."""

NO_TEXT_CODE = -1  # code, in records, of a text or a list that was never published


class Qos(typing.NamedTuple):
    """Quality of service of a rate. Publishers are reliable, and subscribers in lockstep too."""
    latched: bool       # a late joiner receives the last message
    lockstep: int       # queue depth of publishers and subscribers in lockstep; 0: all messages
    written: int        # queue depth of a publisher in realtime, which never waits for a subscriber
    # queue depth of a subscriber in realtime, a few steps. It keeps the newest messages, so a late node skips stale
    # data. It is deep enough that a second, faster publisher cannot evict the messages of the first
    read: int
    reliable: bool      # a subscriber in realtime is reliable: a message that it lost is sent again
    recorded: int       # queue depth of a recorder, some seconds, because its disk may delay it
    # realtime subscribers also accept volatile publishers (`ros2 topic pub`), by a second subscription
    unlatched: bool = False


QOS_BY_RATE = {'step': Qos(latched=False, lockstep=0, written=1000, read=8, reliable=False, recorded=4000),
               'once': Qos(latched=True, lockstep=1, written=1, read=1, reliable=True, recorded=100, unlatched=True),
               'change': Qos(latched=True, lockstep=1, written=1, read=8, reliable=True, recorded=1000),
               'command': Qos(latched=False, lockstep=100, written=100, read=100, reliable=True, recorded=1000),
               'reply': Qos(latched=False, lockstep=100, written=100, read=100, reliable=True, recorded=1000),
               'second': Qos(latched=False, lockstep=10, written=10, read=100, reliable=True, recorded=1000),
               'sample': Qos(latched=False, lockstep=10, written=10, read=10, reliable=False, recorded=1000),
               'station': Qos(latched=True, lockstep=10, written=10, read=10, reliable=True, recorded=1000)}

UNSTEPPED_RATES = 'once', 'sample'  # rates of messages that belong to no step, and that a unit takes by `decode`

PASS_STATES = 'queued', 'running', 'done', 'failed', 'skipped', 'dropped'
"""States of a pass of the station."""

STATION_RATE = 'station'
"""Rate of the messages of the station, a program beside the graph: on change, latched."""

REALTIME_RATES = 'command', 'sample', STATION_RATE
"""Rates of messages that come from outside the graph, and that are recorded in realtime only."""

EVENT_RATES = 'change', 'reply'
"""Rates of messages that are published between two steps, when there is a change or a reply."""


class Topic(typing.NamedTuple):
    """Row of the table: one topic."""
    name: str
    type: str
    rate: str
    doc: str                            # content of its messages
    names: tuple[str, ...] = AXES       # joints of a JointState or JointTrajectory, in the order of its numbers
    frame: str = ''                     # header.frame_id
    child: str = ''                     # child_frame_id
    units: Mapping[str, str] = {}       # {column: unit} where the type of the message states none (see layouts)
    texts: tuple[str, ...] = ()         # texts that subscribers distinguish, in the order of their codes
    measured: str = ''                  # parameter of its publisher that is true if the topic exists; '': always
    flag: str = ''                      # parameter of its subscribers with the same meaning
    holds: bool = False                 # a message is valid until the next one: in realtime no step waits for it
    only: tuple[str, ...] = ()          # fields of its layout that it uses; (): all
    # {field of its record: name of the control unit's input, or a name for each number}; see wire.inputs
    inputs: Mapping[str, str | tuple[str, ...]] = {}
    latency: str = ''                   # parameter of the control unit with the age of the data at a step; '': age 0


TOPICS = (
    Topic('clock', 'rosgraph_msgs/msg/Clock', 'step', 'time of the drive: the stamp of its step'),
    Topic('joint_states', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth`, `elevation`: encoder angle [rad], rate [rad/s], torque on the load [Nm]', frame='base_link',
          inputs={'position': 'position', 'velocity': 'velocity', 'effort': 'torque'}),
    Topic('adu/truth', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth`, `elevation`: true deck angle [rad] and rate [rad/s] of the dish, or of the beam of an array. '
          'Only simulated equipment uses it; the ACU does not subscribe to it', frame='base_link',
          only=('position', 'velocity')),
    Topic('adu/motor_states', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth_motor_1` ... `elevation_motor_2`: shaft angle [rad], rate [rad/s], torque [Nm]', names=MOTOR_NAMES,
          frame='base_link'),
    Topic('adu/state', 'std_msgs/msg/String', 'change',
          'values while the drive follows commands: `enabled`, or `enabled: azimuth motor lost` while one motor of a '
          'pair is lost. Values while it does not: `stopping`, `engaging brakes`, `disabled`, `releasing brakes`, '
          '`emergency stop`, or `fault: azimuth overspeed, ...`',
          texts=(*ENABLED_STATES, 'stopping', 'engaging brakes', 'disabled', 'releasing brakes', 'emergency stop'),
          inputs={'code': 'drive'}),
    Topic('adu/stow_pins', 'std_msgs/msg/String', 'change',
          'state of the stow pin of each axis: `azimuth out, elevation out`, ...; `out`, `moving`, `in`, `failed`',
          texts=tuple(f'azimuth {azimuth}, elevation {elevation}' for azimuth in PIN_STATE_TEXTS
                      for elevation in PIN_STATE_TEXTS),
          measured='stow_pins', flag='stow_pins', inputs={'code': 'pins'}),
    Topic('ship/truth', 'nav_msgs/msg/Odometry', 'step',
          'pose of `base_link` (FLU) in `earth` (ENU), twist in `base_link`', frame='earth', child='base_link'),
    Topic('ship/imu/data_raw', 'sensor_msgs/msg/Imu', 'step',
          'REP 145: specific force [m/s2], rate against inertial space [rad/s]; no orientation',
          frame='base_link'),
    Topic('ship/imu/data', 'sensor_msgs/msg/Imu', 'step',
          'attitude deck -> earth with its 1-sigma, deck rate against the earth [rad/s]; delayed by `latency`',
          frame='base_link', latency='attitude_latency',
          inputs={'stamp': 'attitude_stamp', 'orientation': 'quaternion', 'angular_velocity': 'deck_rate'}),
    Topic('ins/state', 'std_msgs/msg/String', 'change',
          '`aligned` from the time on at which the 1-sigma of the heading is at most `alignment.aligned_sigma`, else '
          '`aligning`. After 0.1 s without its IMU the INS starts again with `aligning`. With method `model` the INS '
          'never publishes this topic; the ACU then takes the INS as aligned',
          texts=('aligning', 'aligned')),
    Topic('ins/error', 'sensor_msgs/msg/JointState', 'step',
          '`roll`, `pitch`, `heading`: accuracy of the attitude in the message of `ship/imu/data` with the same '
          'stamp, without a constant error. The field `position` holds the 1-sigma of the white noise of a sample '
          '[rad], `velocity` the random walk of the error [rad/sqrt(s)]. All six numbers must be finite. They are '
          'valid until the next message',
          names=('roll', 'pitch', 'heading'), frame='base_link',
          units={f'{angle}.velocity': 'rad/sqrt(s)' for angle in ('roll', 'pitch', 'heading')},
          measured='error_told', flag='ins_error', holds=True, only=('position', 'velocity'),
          latency='attitude_latency',
          inputs={'came': 'attitude_error_came', 'position': 'attitude_noise', 'velocity': 'attitude_walk'}),
    Topic('tracking_receiver/angle_error', 'geometry_msgs/msg/Vector3Stamped', 'step',
          'x cross-elevation error [rad], y elevation error [rad], z C/N0 [dB-Hz]; x, y are NaN while unlocked; '
          'delayed by `latency`', frame='beam',
          units={'x': 'rad', 'y': 'rad', 'z': 'dB-Hz'}, latency='receiver_latency',
          inputs={'came': 'error_came', 'stamp': 'error_stamp',
                  'vector': ('cross_elevation', 'elevation', 'cn0_dbhz')}),
    Topic('tracking_receiver/angle_rate', 'geometry_msgs/msg/Vector3Stamped', 'step',
          "x cross-elevation, y elevation: rate of the error [rad/s], NaN while unlocked; z: 1-sigma [rad/s] of the "
          "target rate that the ACU forms (this rate plus the antenna's rate on `joint_states`); delayed by `latency`",
          frame='beam',
          units={'x': 'rad/s', 'y': 'rad/s', 'z': 'rad/s'}, measured='receiver.rate.measured',
          flag='receiver_rate', latency='receiver_latency',
          inputs={'vector': ('error_rate', 'error_rate', 'error_rate_sigma')}),
    Topic('tracking_receiver/range', 'sensor_msgs/msg/Range', 'step',
          'range of the target [m], NaN while unlocked, and its variance [m2]; delayed by `latency`', frame='beam',
          units={'field_of_view': 'rad', 'min_range': 'm', 'max_range': 'm'}, measured='receiver.ranging.measured',
          flag='receiver_range', latency='receiver_latency',
          inputs={'range': 'range', 'variance': 'range_variance'}),
    Topic('target/truth', 'nav_msgs/msg/Odometry', 'step',
          'target position [m] and velocity [m/s], ENU of the station', frame='earth', child='target'),
    Topic('acu/rate_command', 'sensor_msgs/msg/JointState', 'step',
          'velocity [rad/s], effort = feed-forward load torque [Nm]', frame='base_link'),
    Topic('acu/estimate', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'one point: filter estimate of the target, earth angles at the stamp; NaN without an estimate',
          frame='earth'),
    Topic('acu/reference', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'one point: reference of the position loop, encoder angles at the stamp', frame='base_link'),
    Topic('acu/filter', 'sensor_msgs/msg/JointState', 'step',
          'numbers of the filter of each axis, all in `position`: innovation, NIS, 1-sigma, correlation of angle and '
          'rate, and the probability of each motion model; NaN for a number without a value in this step: '
          + ', '.join(f'`azimuth_{name}`' + (f' [{unit}]' if unit else '') for name, unit in FILTER_UNITS.items()),
          names=tuple(f'{axis}_{name}' for axis in AXES for name in FILTER_UNITS), frame='earth', only=('position',),
          units={f'{axis}_{name}.position': unit for axis in AXES for name, unit in FILTER_UNITS.items()}),
    Topic('acu/mode', 'std_msgs/msg/String', 'change', 'mode of the ACU'),
    Topic('acu/stow_pins', 'std_msgs/msg/String', 'change',
          'commanded position of the stow pins: `out` or `in`; no message before the first mode `stow` or `unstow`',
          texts=('out', 'in'), measured='stow_pins', flag='stow_pins'),
    Topic('acu/keyhole', 'std_msgs/msg/String', 'change',
          'predicted passage through the zenith of the deck: time, direction of the azimuth, expected time with the '
          'target off the beam. The numbers are in the diagnostics (`keyhole_begins_s`, `keyhole_ends_s`, '
          '`keyhole_loss_s`, `keyhole_worst_deg`, `keyhole_needed_deg_s`, `deck_motion_deg`)'),
    Topic('acu/blockage', 'std_msgs/msg/String', 'change',
          'predicted beginning and end of the blockage of the target by the superstructure'),
    Topic('acu/pointing', 'std_msgs/msg/String', 'change',
          'pointing model in force, as JSON: `antenna`, `file`, `date`, `rms_deg`, `terms` ({name: value} [deg]; p9 '
          'and p12 are factors). While another model takes effect: also `before`, the terms before, and the begin and '
          'the end of the change, `begins_s` and `ends_s` [s of the graph]. No message without a model'),
    Topic('acu/alarms', 'diagnostic_msgs/msg/DiagnosticArray', 'change',
          'one status for each alarm in a state other than normal, annunciated alarms first; the section Alarms gives '
          'the meaning of `values`'),
    Topic('acu/program_track', 'trajectory_msgs/msg/JointTrajectory', 'once',
          'two or more points: program track, time-tagged azimuth and elevation (earth); one point: preset angles '
          '(deck)', frame='earth'),
    Topic('weather/pressure', 'sensor_msgs/msg/FluidPressure', 'sample',
          'pressure of the air at the station [Pa], not reduced to sea level; the ACU uses it for the refraction',
          names=()),
    Topic('weather/temperature', 'sensor_msgs/msg/Temperature', 'sample',
          'temperature of the air at the station [deg C]', names=()),
    Topic('weather/humidity', 'sensor_msgs/msg/RelativeHumidity', 'sample',
          'relative humidity of the air at the station, 0 to 1', names=()),
    Topic('acu/command', 'diagnostic_msgs/msg/DiagnosticStatus', 'command',
          'name = command, hardware_id = client, message = number of the request, values = arguments; see commands'),
    Topic('acu/command_result', 'diagnostic_msgs/msg/DiagnosticStatus', 'reply',
          'every command that was accepted or refused, by topic, service or schedule, with `granted` and `reply`; an '
          'accepted command takes effect in the next step for which the ACU publishes a rate command'),
    *(topic for node in ('ship_motion', 'ins', 'tracking_receiver', 'adu') for topic in (
        Topic(f'{node}/inject', 'diagnostic_msgs/msg/DiagnosticStatus', 'command',
              'command to inject a fault: name = fault, values = its arguments; see the faults that can be injected'),
        Topic(f'{node}/injected', 'diagnostic_msgs/msg/DiagnosticStatus', 'reply',
              'every injection that was accepted or refused, as on `acu/command_result`'
              + ('; also the replies to its services (enable, disable ...)' if node == 'adu' else '')))),
    Topic('station/command', 'diagnostic_msgs/msg/DiagnosticStatus', 'command',
          'command to the station, as on `acu/command`'),
    Topic('station/command_result', 'diagnostic_msgs/msg/DiagnosticStatus', 'reply',
          'every command that the station accepted or refused, as on `acu/command_result`'),
    Topic('station/night', 'std_msgs/msg/String', STATION_RATE,
          'the night, as JSON: `now` (what the station does) and `passes`, each with `case`, `begin` and `end` of its '
          'contact (UTC [s]), `max_elevation_deg`, '
          f'`state` ({", ".join(f"`{state}`" for state in PASS_STATES[:-1])} or `{PASS_STATES[-1]}`) and `text`'),
    Topic('station/log', 'std_msgs/msg/String', STATION_RATE,
          'decisions of the station: a line for each, with its UTC'),
    Topic('diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'second', 'state of each node'),
)

TOPIC_BY_NAME = {topic.name: topic for topic in TOPICS}
TOPIC_FLAGS = tuple(dict.fromkeys(topic.flag for topic in TOPICS if topic.flag))
"""Names of the parameters that state whether the graph has a topic (Topic.flag)."""
