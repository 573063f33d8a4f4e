"""The topics of the graph as one table: type, rate, meaning of every number. Who writes and reads them is in `nodes`.

Rate
    step    one message per drive step, stamped with the step (or the step it measured, where latency is modelled)
    once    one before the first step
    second  one per writer at every whole second of the drive's time
    change  whenever it changes; it belongs to the step that its writer answers next
    command whenever somebody asks; what it did, and before which step, is told by the reply
The rate gives the quality of service: see QOS_BY_RATE.
"""
import typing

AXES = ('azimuth', 'elevation')
MOTOR_NAMES = tuple(f'{axis}_motor_{i}' for axis in AXES for i in (1, 2))
MOTION_MODELS = ('cv', 'ca', 'singer', 'current_statistical')
"""Motion models of the target that the ACU's filters know."""

FILTER_UNITS = {'innovation': 'rad', 'rate_innovation': 'rad/s', 'nis': '', 'sigma': 'rad', 'rate_sigma': 'rad/s',
                'correlation': '', 'innovation_sigma': 'rad', **dict.fromkeys(MOTION_MODELS, '')}
"""{number: unit} that acu/filter tells of the filter of one axis; of a model its probability."""

ENABLED_STATES = ('enabled', 'enabled: azimuth motor lost', 'enabled: elevation motor lost',
                  'enabled: azimuth and elevation motor lost')
"""Texts of adu/state with which the drive follows commands: bit 0 of their place says that the azimuth has one motor
of its pair only, bit 1 that the elevation has."""

PIN_STATE_TEXTS = ('out', 'moving', 'in', 'failed')
"""Of a stow pin: it lets its axis move, is on its way, holds it; it is not where it was sent."""

NO_TEXT_CODE = -1
"""In records the code of a text or a list that was never published."""


class Qos(typing.NamedTuple):
    """Quality of service of a rate: a row of QOS_BY_RATE. Writers are reliable, and so are readers in lockstep.

    latched     who comes late gets the last message
    lockstep    messages kept by writers and readers in lockstep; 0: all
    written     by a writer in realtime, which never waits for a reader
    read        by a node that obeys them: those of a few steps, the newest of which stay, so that it never works
                through what is old, and a stranger who writes much faster does not push out what belongs here
    reliable    whether that node has lost ones sent again
    recorded    by a recorder: those of seconds, it may be held up by its disk
    unlatched   whether readers in realtime also hear writers that do not latch, by a second subscription: the writer
                is a person with `ros2 topic pub`
    """
    latched: bool
    lockstep: int
    written: int
    read: int
    reliable: bool
    recorded: int
    unlatched: bool = False


QOS_BY_RATE = {'step': Qos(latched=False, lockstep=0, written=1000, read=8, reliable=False, recorded=4000),
               'once': Qos(latched=True, lockstep=1, written=1, read=1, reliable=True, recorded=100, unlatched=True),
               'change': Qos(latched=True, lockstep=1, written=1, read=8, reliable=True, recorded=1000),
               'command': Qos(latched=False, lockstep=100, written=100, read=100, reliable=True, recorded=1000),
               'reply': Qos(latched=False, lockstep=100, written=100, read=100, reliable=True, recorded=1000),
               'second': Qos(latched=False, lockstep=10, written=10, read=100, reliable=True, recorded=1000)}

EVENT_RATES = 'change', 'reply'
"""Rates of what is said between two steps, when there is something to say."""


class Topic(typing.NamedTuple):
    """One topic.

    doc      what it tells
    names    of a JointState, JointTrajectory: whose numbers they are
    frame    header.frame_id; child: child_frame_id
    units    {column: unit} where the type alone does not tell (see layouts)
    texts    of a text: those that a reader tells apart, in the order of their codes
    measured  the parameter of its writer that says whether it is there; flag: that of its readers; '': it always is
    holds    whether what it says holds until it says otherwise: in realtime no step waits for it
    only     fields of its layout that it uses; (): all
    inputs   {field of its record: name of the control unit's input, or a name for each number}; see inputs
    latency  the parameter of the control unit that tells how old it is at a step
    """
    name: str
    type: str
    rate: str
    doc: str
    names: tuple = AXES
    frame: str = ''
    child: str = ''
    units: typing.Mapping = {}
    texts: tuple = ()
    measured: str = ''
    flag: str = ''
    holds: bool = False
    only: tuple = ()
    inputs: typing.Mapping = {}
    latency: str = ''


TOPICS = (
    Topic('clock', 'rosgraph_msgs/msg/Clock', 'step', "the drive's time t_k"),
    Topic('joint_states', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth`, `elevation`: encoder angle [rad], rate [rad/s], torque on the load [Nm]', frame='base_link',
          inputs={'position': 'position', 'velocity': 'velocity', 'effort': 'torque'}),
    Topic('adu/truth', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth`, `elevation`: true deck angle [rad] and rate [rad/s] of the dish, or of the beam of an array: '
          'what simulated equipment reads, and the ACU never', frame='base_link', only=('position', 'velocity')),
    Topic('adu/motor_states', 'sensor_msgs/msg/JointState', 'step',
          '`azimuth_motor_1` ... `elevation_motor_2`: shaft angle [rad], rate [rad/s], torque [Nm]', names=MOTOR_NAMES,
          frame='base_link'),
    Topic('adu/state', 'std_msgs/msg/String', 'change',
          '`enabled` when the drive follows commands, `enabled: azimuth motor lost` when with one motor of a pair; '
          'otherwise why not: `stopping`, `engaging brakes`, `disabled`, `releasing brakes`, `emergency stop`, '
          '`fault: azimuth overspeed, ...`',
          texts=(*ENABLED_STATES, 'stopping', 'engaging brakes', 'disabled', 'releasing brakes', 'emergency stop'),
          inputs={'code': 'drive'}),
    Topic('adu/stow_pins', 'std_msgs/msg/String', 'change',
          'where the stow pin of each axis is: `azimuth out, elevation out`, ...; `out`, `moving`, `in`, `failed`',
          texts=tuple(f'azimuth {azimuth}, elevation {elevation}' for azimuth in PIN_STATE_TEXTS
                      for elevation in PIN_STATE_TEXTS),
          measured='stow_pins', flag='stow_pins', inputs={'code': 'pins'}),
    Topic('ship/truth', 'nav_msgs/msg/Odometry', 'step',
          'pose of `base_link` (FLU) in `earth` (ENU), twist in `base_link`', frame='earth', child='base_link'),
    Topic('ship/imu/data_raw', 'sensor_msgs/msg/Imu', 'step',
          'REP 145: specific force [m/s2], rate against inertial space [rad/s]; no orientation',
          frame='base_link'),
    Topic('ship/imu/data', 'sensor_msgs/msg/Imu', 'step',
          'attitude deck -> earth with its 1-sigma, deck rate against the earth [rad/s]; `latency` late',
          frame='base_link', latency='attitude_latency',
          inputs={'stamp': 'attitude_stamp', 'orientation': 'quaternion', 'angular_velocity': 'deck_rate'}),
    Topic('ins/state', 'std_msgs/msg/String', 'change',
          '`aligning`, or `aligned` once the 1-sigma of its heading is below `alignment.aligned_sigma`, and again '
          '`aligning` after 0.1 s without its IMU; method `model` never says it, which counts as aligned',
          texts=('aligning', 'aligned')),
    Topic('ins/error', 'sensor_msgs/msg/JointState', 'step',
          '`roll`, `pitch`, `heading`: 1-sigma of what changes in the error of `ship/imu/data`, whose stamp it has: '
          'position, the noise of each sample [rad]; velocity, what it wanders by [rad/sqrt(s)]; all six are numbers, '
          'and hold until the next',
          names=('roll', 'pitch', 'heading'), frame='base_link',
          units={f'{angle}.velocity': 'rad/sqrt(s)' for angle in ('roll', 'pitch', 'heading')},
          measured='error_told', flag='ins_error', holds=True, only=('position', 'velocity'),
          latency='attitude_latency',
          inputs={'came': 'attitude_error_came', 'position': 'attitude_noise', 'velocity': 'attitude_walk'}),
    Topic('tracking_receiver/angle_error', 'geometry_msgs/msg/Vector3Stamped', 'step',
          'x cross-elevation error [rad], y elevation error [rad], z C/N0 [dB-Hz]; x, y are NaN while unlocked; '
          '`latency` late', frame='beam',
          units={'x': 'rad', 'y': 'rad', 'z': 'dB-Hz'}, latency='receiver_latency',
          inputs={'came': 'error_came', 'stamp': 'error_stamp',
                  'vector': ('cross_elevation', 'elevation', 'cn0_dbhz')}),
    Topic('tracking_receiver/angle_rate', 'geometry_msgs/msg/Vector3Stamped', 'step',
          'x cross-elevation, y elevation: rate of the error [rad/s], NaN while unlocked; z their 1-sigma [rad/s], '
          'tachometer and receiver together; `latency` late', frame='beam',
          units={'x': 'rad/s', 'y': 'rad/s', 'z': 'rad/s'}, measured='receiver.rate.measured',
          flag='receiver_rate', latency='receiver_latency',
          inputs={'vector': ('error_rate', 'error_rate', 'error_rate_sigma')}),
    Topic('tracking_receiver/range', 'sensor_msgs/msg/Range', 'step',
          'range of the target [m], NaN while unlocked, and its variance [m2]; `latency` late', frame='beam',
          units={'field_of_view': 'rad', 'min_range': 'm', 'max_range': 'm'}, measured='receiver.ranging.measured',
          flag='receiver_range', latency='receiver_latency',
          inputs={'range': 'range', 'variance': 'range_variance'}),
    Topic('target/truth', 'nav_msgs/msg/Odometry', 'step',
          'target position [m] and velocity [m/s], ENU of the station', frame='earth', child='target'),
    Topic('acu/rate_command', 'sensor_msgs/msg/JointState', 'step',
          'velocity [rad/s], effort = feed-forward load torque [Nm]', frame='base_link'),
    Topic('acu/estimate', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'one point: the target as filtered, earth angles at t_k; NaN without an estimate',
          frame='earth'),
    Topic('acu/reference', 'trajectory_msgs/msg/JointTrajectory', 'step',
          'one point: what the position loop follows, deck angles at t_k', frame='base_link'),
    Topic('acu/filter', 'sensor_msgs/msg/JointState', 'step',
          'named numbers of each axis, all in `position`, NaN where there is none in this step: '
          + ', '.join(f'`azimuth_{name}`' + (f' [{unit}]' if unit else '') for name, unit in FILTER_UNITS.items()),
          names=tuple(f'{axis}_{name}' for axis in AXES for name in FILTER_UNITS), frame='earth', only=('position',),
          units={f'{axis}_{name}.position': unit for axis in AXES for name, unit in FILTER_UNITS.items()}),
    Topic('acu/mode', 'std_msgs/msg/String', 'change', 'the mode'),
    Topic('acu/stow_pins', 'std_msgs/msg/String', 'change',
          'where the stow pins shall be: `out` or `in`; nothing until one of the modes `stow` and `unstow` says so',
          texts=('out', 'in'), measured='stow_pins', flag='stow_pins'),
    Topic('acu/keyhole', 'std_msgs/msg/String', 'change',
          'how the azimuth will go through the zenith of the deck: when, which way round, expected loss; the numbers '
          'are in the diagnostics (`keyhole_begins_s`, `keyhole_ends_s`, `keyhole_loss_s`, `keyhole_worst_deg`, '
          '`keyhole_needed_deg_s`, `deck_motion_deg`)'),
    Topic('acu/blockage', 'std_msgs/msg/String', 'change',
          'from when until when the superstructure will hide the target'),
    Topic('acu/alarms', 'diagnostic_msgs/msg/DiagnosticArray', 'change',
          'the alarms that are not normal, a status each: those that are annunciated first; `values` tell state, '
          'priority, when raised, first-out, the cause that it stands under, what to do, until when and why shelved'),
    Topic('acu/program_track', 'trajectory_msgs/msg/JointTrajectory', 'once',
          'two or more points: time-tagged azimuth and elevation (earth); one point: a preset (deck)', frame='earth'),
    Topic('acu/command', 'diagnostic_msgs/msg/DiagnosticStatus', 'command',
          'name = verb, hardware_id = who, message = number of the request, values = arguments; see commands'),
    Topic('acu/command_result', 'diagnostic_msgs/msg/DiagnosticStatus', 'reply',
          'every command that was obeyed or refused, by topic, service or schedule, with `granted` and `reply`; it '
          'took effect in the step that is answered next'),
    *(topic for node in ('ship_motion', 'ins', 'tracking_receiver', 'adu') for topic in (
        Topic(f'{node}/inject', 'diagnostic_msgs/msg/DiagnosticStatus', 'command',
              'a fault to inject: name = fault, values = its arguments; see the faults that can be injected'),
        Topic(f'{node}/injected', 'diagnostic_msgs/msg/DiagnosticStatus', 'reply',
              'every fault that was injected or refused, as on `acu/command_result`'
              + ('; services too' if node == 'adu' else '')))),
    Topic('diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', 'second', 'state of each node'),
)

TOPIC_BY_NAME = {topic.name: topic for topic in TOPICS}
TOPIC_FLAGS = tuple(dict.fromkeys(topic.flag for topic in TOPICS if topic.flag))
