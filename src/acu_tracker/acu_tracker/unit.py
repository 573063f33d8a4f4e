"""The unit of the antenna control unit: its compiled law with the parts that act between two steps.

`unit_law` makes a step. Between the steps the unit hands each message, command and request to the part that it
concerns.
"""
import datetime
import functools
import math
from collections.abc import Iterable, Mapping

import numpy as np

from acu_tracker import control_unit, modes, signals
from acu_tracker.alarms import annunciator, report, table
from acu_tracker.command_table import ACU_COMMANDS
from acu_tracker.modes import Mode, Reason
from acu_tracker.operating import announcement, commands, diagnosis
from acu_tracker.params import AcuParameters
from acu_tracker.pointing.in_force import ModelInForce
from acu_tracker.program import program_track, segments
from acu_tracker.program.air import WEATHER_QUANTITIES
from acu_tracker.program.followed import Followed
from acu_tracker.unit_law import (
    ALARMS_TOPIC,
    ANGLE_ERROR_TOPIC,
    ATTITUDE_TOPIC,
    BLOCKAGE_TOPIC,
    DRIVE_STATE_TOPIC,
    KEYHOLE_TOPIC,
    MODE_TOPIC,
    POINTING_TOPIC,
    Memory,
    UnitRecord,
    law,
    laws,
)
from pedestal_common.graph import nodes, topics
from pedestal_common.node.unit import Diagnosis, Unit
from pedestal_common.parameters import Parameters
from pedestal_common.quantities import AnyRecord, Message, Nanoseconds, Records, Seconds, Value
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command, Reply, schedule

# Time after a reset by an operator during which the reset of the drive is requested [s].
RESET_REQUEST_DURATION_S = 0.2

# Indices of the alarms for the silence of the drive, and of those whose report contains the text of adu/state.
DRIVE_SILENT_ALARM, DRIVE_FAULT_ALARM = table.ALARM_INDEX['drive silent'], table.ALARM_INDEX['drive fault']
STEPS_LOST_ALARM = table.ALARM_INDEX['steps lost']
MOTOR_LOST_ALARMS = tuple(table.ALARM_INDEX[f'{axis} motor lost'] for axis in topics.AXES)


@functools.lru_cache(1)
def _initial(parameters: AcuParameters) -> Records:
    # The cache saves time in successive trials with equal parameters.
    return UnitRecord.of(state=control_unit.initial_state(parameters),
                         constants=control_unit.constants(parameters))


class Acu(Unit):
    """The antenna control unit. If it reads ship/imu/data, the antenna stands on a ship."""
    NODE, LAWS = nodes.row('acu'), {Memory: (law, laws)}
    LIVE = ('tracker', 'azimuth', 'elevation')
    REQUESTS = (*(f'acu/{mode}' for mode in modes.MODES), 'acu/acknowledge', 'acu/reset_faults')
    VERBS = ACU_COMMANDS
    CALLS = ('adu/emergency_stop', 'adu/reset_faults')
    MOMENTARY = (KEYHOLE_TOPIC, BLOCKAGE_TOPIC, ALARMS_TOPIC)

    parameters: AcuParameters
    memory: Memory
    authority: commands.Authority   # client in control
    desk: commands.AlarmDesk        # commands to the alarms
    followed: Followed              # tables and directions that the modes follow
    model: ModelInForce             # pointing model
    drive_state: str                # state of the drive as the drive published it
    reset_stamp: Seconds            # stamp of the last request to reset the drive
    losses: str                     # excessive losses of steps, as text; '' without

    def __init__(self, parameters: AcuParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.memory = Memory(_initial(parameters).copy(), program_track.NO_TABLES)
        self.parts['inputs']['stabilised'], self.parts['inputs']['drive_ready'] = ATTITUDE_TOPIC in self.reads, 1
        self.parts['outputs']['mode'], self.parts['outputs']['pins'] = Mode.STANDBY, topics.NO_TEXT_CODE
        signals.clear(self.parts['outputs'])
        self.drive_state = 'unknown'
        self.authority = commands.Authority()
        self.followed = Followed(parameters)
        self.model = ModelInForce(parameters)
        self.desk = commands.AlarmDesk()
        self._silent, self.reset_stamp = False, -math.inf
        self.losses = ''

    @property
    def silent(self) -> bool:
        """True if the drive is silent. Setting it raises the alarm, because without the drive no step detects it."""
        return self._silent

    @silent.setter
    def silent(self, silent: bool) -> None:
        self._silent = silent
        if silent:
            stamp = self.parts['state']['stamp']
            annunciator.set_condition(self.alarms, DRIVE_SILENT_ALARM, True, stamp if math.isfinite(stamp) else 0.0)
            self.outputs[ALARMS_TOPIC] = self.alarms['revision']

    def prepare_requests(self) -> None:
        """Compile the functions behind the requests and the alarm commands, and those of the diagnosis."""
        super().prepare_requests()
        commands.reset(self)
        self.desk.prepare(self.parts['state'])
        self.encode(ALARMS_TOPIC, 0)
        annunciator.set_condition(self.alarms, DRIVE_SILENT_ALARM, True, 0.0)
        self.diagnose()
        self.followed.air.raised(np.zeros(2), np.zeros((2, 2)))

    def configure(self, parameters: Parameters) -> None:
        """Put new values of the LIVE parameters into the constants.

        A state without a step, as after a reset, begins with the pointing model that was in force, at its last terms.
        """
        super().configure(parameters)
        if not math.isfinite(self.parts['state']['stamp']):
            self.model.begin(self.parts['state']['tracking']['pointing'])
            self.followed.bend(self.parts, None)
        self.memory.record['constants'] = control_unit.constants(self.parameters)
        self.followed.expire()

    def decode(self, topic: str, message: Message) -> None:
        """Take a message on acu/program_track, or a reading of the weather station.

        A bad message on acu/program_track raises ValueError. Two or more points are a segment of the program track in
        earth angles. One point is a preset in deck angles.
        """
        if topic in WEATHER_QUANTITIES:
            stamp = messages.nanoseconds(message.header.stamp)
            self.followed.take_weather(topic, stamp * 1e-9 if stamp else None, message,
                                       self.now * 1e-9 if math.isfinite(self.parts['state']['stamp']) else None)
            return
        times, angles = segments.rows(message)
        if len(angles) == 1:
            self.parts['inputs']['preset'], self.parts['inputs']['preset_valid'] = angles[0], 1
        else:
            start = messages.nanoseconds(message.header.stamp) * 1e-9
            self.followed.append(self.parts, times + start, angles)
            self.update_tables()

    @property
    def next_due(self) -> Nanoseconds:
        """Time of the next command of the schedule, or of the next update of a table or of the refraction."""
        return min(super().next_due, self.followed.due)

    def execute_due(self, stamp: Nanoseconds) -> None:
        """Bring the tables of the law to a stamp, and execute the scheduled commands that are due before its step."""
        if self.epoch != self.followed.predictor.epoch:
            self.followed.predict_by(self.followed.predictor.with_epoch(self.epoch))
            self.model.check_date(self.parts['state']['tracking']['pointing'], self.utc)
        self.followed.advance(self.parts, stamp)
        self.memory = self.memory._replace(tables=self.followed.tables)
        super().execute_due(stamp)

    @property
    def now(self) -> Nanoseconds:
        """Stamp of the last step, 0 before the first."""
        stamp = float(self.parts['state']['stamp'])
        return round(stamp * 1e9) if math.isfinite(stamp) else 0

    @property
    def utc(self) -> datetime.datetime | None:
        """UTC of the last step; None in lockstep, whose stamps are no UTC."""
        since = datetime.timedelta(microseconds=(self.epoch + self.now) // 1000)
        return datetime.datetime(1970, 1, 1) + since if self.epoch else None

    def take_losses(self, text: str) -> None:
        """Take the excessive losses of steps that the drive reports, as text; '' without."""
        self.losses, self.parts['inputs']['steps_lost'] = text, bool(text)

    def update_tables(self) -> None:
        """Bring the tables of the law to the last step, after what they follow has changed."""
        self.followed.update(self.parts, self.now)
        self.memory = self.memory._replace(tables=self.followed.tables)

    def take_text(self, topic: str, text: str) -> None:
        """Take the text of a text topic, and keep that of adu/state for the diagnosis."""
        super().take_text(topic, text)
        if topic == DRIVE_STATE_TOPIC:
            self.drive_state = text

    def encode(self, topic: str, code: int) -> Message:
        """Return the text that a code on a text topic stands for; for acu/alarms return the message."""
        lookahead = self.parts['state']['guidance']['lookahead']
        if topic == KEYHOLE_TOPIC:
            return announcement.keyhole(lookahead, self.parameters, self.epoch)
        if topic == ALARMS_TOPIC:
            details = dict.fromkeys((DRIVE_FAULT_ALARM, *MOTOR_LOST_ALARMS), self.drive_state)
            details[STEPS_LOST_ALARM] = self.losses
            return report.message(self.alarms, details, self.desk.reasons)
        if topic == BLOCKAGE_TOPIC:
            return announcement.hidden(lookahead, self.epoch)
        if topic == POINTING_TOPIC:
            return self.model.reports[code].text
        return modes.MODES[code] if topic == MODE_TOPIC else super().encode(topic, code)

    def schedule(self) -> list[tuple[Nanoseconds, Command]]:
        """Return the commands of the parameter `commands`, with their times."""
        return schedule('commands', self.parameters.commands, ACU_COMMANDS)

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Return the Reply to a command of VERBS."""
        return commands.EXECUTORS[command.verb](self, command, arguments)

    def admit(self, command: Command) -> None:
        """Raise ValueError for a command of a client, if another client holds control."""
        self.authority.admit(command)

    def request(self, name: str) -> Reply:
        """Return the Reply to a request of a service: acu/MODE, acu/acknowledge or acu/reset_faults."""
        return commands.request(self, name.removeprefix('acu/'))

    @property
    def drive_status(self) -> str:
        """State of the drive as the drive published it, or 'silent'."""
        return 'silent' if self.silent else self.drive_state

    def requests_for(self, topic: str, text: str) -> list[str]:
        """Return [name of the service that requests the mode] for a text on acu/mode, else []."""
        return [f'acu/{text}'] if topic == MODE_TOPIC and text in modes.MODES else []

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis and clear the bits of the invalid inputs."""
        result = diagnosis.of(self)
        self.parts['invalid'] = 0
        return result

    @property
    def calls(self) -> tuple[str, ...]:
        """Services of the drive that the unit calls now; its reset after a reset by an operator."""
        stop, reset = self.CALLS
        if self.parts['state']['unasked']['moves']:
            return (stop,)
        return (reset,) if 0.0 < self.parts['state']['stamp'] - self.reset_stamp < RESET_REQUEST_DURATION_S else ()

    @property
    def alarms(self) -> AnyRecord:
        """Record of all alarms."""
        return self.parts['state']['supervision']['alarms']

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the latched faults that wait for acu/reset_faults."""
        bits = control_unit.latched(self.parts['state'])
        return tuple(fault for fault in diagnosis.FAULT_TEXTS if bits >> table.ALARM_INDEX[fault] & 1)

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once in the diagnostics."""
        outputs, inputs = self.parts['outputs'], self.parts['inputs']
        return (control_unit.latched(self.parts['state']), outputs['mode'], outputs['reason'] == Reason.SILENCE,
                outputs['locked'], outputs['arrived'], inputs['drive'], inputs['pins'], inputs['aligning'],
                self.authority.requester(self.now))

    @staticmethod
    def idle(numbers: Mapping[str, Message]) -> str:
        """Return the reason why a recording does not exercise the unit, or ''."""
        if not np.isfinite(numbers[ANGLE_ERROR_TOPIC][:, 0]).any():
            return 'the receiver never locked'
        return '' if 'autotrack' in numbers[MODE_TOPIC] else 'the ACU was never in autotrack'
