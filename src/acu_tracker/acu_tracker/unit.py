"""The unit of the antenna control unit: its compiled law with the parts that act between two steps.

The node `acu`, the closed loop and the recomputation run this unit (pedestal_common.node.unit). `unit_law` makes a
step. Between the steps the unit hands each message, command and request to the part that it concerns.
"""
import datetime
import functools
import math
from collections.abc import Iterable, Mapping

import numpy as np

from acu_tracker import control_unit, modes, signals
from acu_tracker.alarms import annunciator, report, table
from acu_tracker.modes import Mode, Reason
from acu_tracker.operating import announcement, diagnosis, refusals
from acu_tracker.operating.alarm_desk import AlarmDesk
from acu_tracker.operating.authority import Authority
from acu_tracker.operating.command_table import ACU_COMMANDS
from acu_tracker.operating.commands import EXECUTORS
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
from pedestal_common.quantities import AnyRecord, Message, Nanoseconds, Records, Value
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command, Reply, schedule

RESET_REQUEST_DURATION_S = 0.2
"""Time after a reset by an operator during which the reset of the drive is requested [s]."""

DRIVE_SILENT_ALARM, DRIVE_FAULT_ALARM = table.ALARM_INDEX['drive silent'], table.ALARM_INDEX['drive fault']
MOTOR_LOST_ALARMS = tuple(table.ALARM_INDEX[f'{axis} motor lost'] for axis in topics.AXES)
"""Indices of the alarms for the silence of the drive, and of those whose report contains the text of adu/state."""


@functools.lru_cache(1)
def _initial(parameters: AcuParameters) -> Records:
    """Return the UnitRecord (1,) of a control unit before its first step.

    The cache saves time in successive trials with equal parameters.
    """
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
    authority: Authority        # client in control
    desk: AlarmDesk             # commands to the alarms
    followed: Followed          # tables and directions that the modes follow
    model: ModelInForce         # pointing model
    drive_state: str            # state of the drive as the drive published it

    def __init__(self, parameters: AcuParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.memory = Memory(_initial(parameters).copy(), program_track.NO_TABLES)
        self.parts['inputs']['stabilised'], self.parts['inputs']['drive_ready'] = ATTITUDE_TOPIC in self.reads, 1
        self.parts['outputs']['mode'], self.parts['outputs']['pins'] = Mode.STANDBY, topics.NO_TEXT_CODE
        signals.clear(self.parts['outputs'])
        self.drive_state = 'unknown'
        self.authority = Authority()
        self.followed = Followed(parameters)
        self.model = ModelInForce(parameters)
        self.desk = AlarmDesk()
        self._silent, self._reset_stamp = False, -math.inf

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
        self.reset()
        self.desk.prepare(self.parts['state'])
        self.encode(ALARMS_TOPIC, 0)
        annunciator.set_condition(self.alarms, DRIVE_SILENT_ALARM, True, 0.0)
        self.diagnose()
        self.followed.air.raised(np.zeros(2), np.zeros((2, 2)))

    def configure(self, parameters: Parameters) -> None:
        """Put new values of the LIVE parameters into the constants; the state stays as it is.

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

        A bad message on acu/program_track raises ValueError; Air counts the readings that it drops. Two or more points
        are a segment of the program track in earth angles. One point is a preset in deck angles.
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
        """Execute the scheduled commands that are due before the step of a stamp.

        The tables of the law are brought to this stamp before.
        """
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

    def update_tables(self) -> None:
        """Bring the tables of the law to the last step, after what they follow has changed."""
        self.followed.update(self.parts, self.now)
        self.memory = self.memory._replace(tables=self.followed.tables)

    def take_text(self, topic: str, text: str) -> None:
        """Take the text of a text topic; the text of adu/state is also kept for the diagnosis."""
        super().take_text(topic, text)
        if topic == DRIVE_STATE_TOPIC:
            self.drive_state = text

    def encode(self, topic: str, code: int) -> Message:
        """Return the text that a code on a text topic stands for; for acu/alarms return the message."""
        lookahead = self.parts['state']['guidance']['lookahead']
        if topic == KEYHOLE_TOPIC:
            return announcement.keyhole(lookahead, self.parameters)
        if topic == ALARMS_TOPIC:
            tripped = dict.fromkeys((DRIVE_FAULT_ALARM, *MOTOR_LOST_ALARMS), self.drive_state)
            return report.message(self.alarms, tripped, self.desk.reasons)
        if topic == BLOCKAGE_TOPIC:
            return announcement.hidden(lookahead)
        if topic == POINTING_TOPIC:
            return self.model.reports[code].text
        return modes.MODES[code] if topic == MODE_TOPIC else super().encode(topic, code)

    def schedule(self) -> list[tuple[Nanoseconds, Command]]:
        """Return the commands of the parameter `commands`, with their times."""
        return schedule('commands', self.parameters.commands, ACU_COMMANDS)

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Return the Reply to a command of VERBS; a refusal states the reason and changes nothing."""
        return EXECUTORS[command.verb](self, command, arguments)

    def admit(self, command: Command) -> None:
        """Raise ValueError for a command of a client, if another client holds control."""
        self.authority.admit(command)

    def request(self, name: str) -> Reply:
        """Return the Reply to a request of a service: acu/MODE, acu/acknowledge or acu/reset_faults.

        A refusal states the reason.
        """
        mode = name.removeprefix('acu/')
        parts, outputs = self.parts, self.parts['outputs']
        if mode == 'reset_faults':
            return self.reset()
        if mode == 'acknowledge':
            return self.desk.acknowledge(self.parts['state'])
        if self.silent and mode != 'standby':
            return Reply(False, f'refused: {refusals.SILENCE_REFUSAL}; mode is {modes.MODES[outputs["mode"]]}')
        parts['inputs']['drive_ready'] = self.inputs[0][DRIVE_STATE_TOPIC] <= signals.DRIVE_READY
        code = modes.MODES.index(mode)
        granted = control_unit.request(parts['state'], parts['constants'], parts['inputs'], outputs,
                                       self.memory.tables, code)
        refusal = '' if granted else f'refused: {refusals.of_mode(self, code, outputs["reason"])}; '
        return Reply(bool(granted), f'{refusal}mode is {modes.MODES[outputs["mode"]]}')

    def reset(self) -> Reply:
        """Return the Reply to a reset of the latched alarms and faults; also request the reset of a drive in fault.

        The reset is refused while the cause of one of them is present. The control unit does not reset an emergency
        stop of the drive: only an operator does, at adu/reset_faults.
        """
        cause = control_unit.reset(self.parts['state'])
        if self.drive_state.startswith('fault'):
            self._reset_stamp = float(self.parts['state']['stamp'])
        if cause != annunciator.NO_ALARM:
            return Reply(False, f'refused: the cause of {table.ALARM_NAMES[cause]} is still there')
        drive = f'; the drive reports {self.drive_state}'
        return Reply(True, 'cleared' + (drive if self.drive_state.startswith(('fault', 'emergency stop')) else ''))

    def refusals(self) -> list[int]:
        """Return for each mode Reason.NONE, or the reason why it would be refused now."""
        parts, why = self.parts, np.zeros(len(modes.MODES), np.int64)
        control_unit.refusals(parts['state'], parts['constants'], parts['inputs'], self.memory.tables, why)
        return why.tolist()

    @property
    def drive_status(self) -> str:
        """State of the drive as the drive published it, or 'silent'."""
        return 'silent' if self.silent else self.drive_state

    def requests_for(self, topic: str, text: str) -> list[str]:
        """Return [name of the service that requests the mode] for a text on acu/mode, else []."""
        return [f'acu/{text}'] if topic == MODE_TOPIC and text in modes.MODES else []

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis and clear the bits of the invalid inputs.

        The level is ERROR for a latched fault or invalid inputs since the last diagnosis. The level is WARN for gated
        errors, a turn of the azimuth, a limit that holds the beam, an end of travel ahead, or coasting.
        """
        result = diagnosis.of(self)
        self.parts['invalid'] = 0
        return result

    @property
    def calls(self) -> tuple[str, ...]:
        """Services of the drive that the unit calls now.

        The unit calls the emergency stop during uncommanded motion, and the reset for a short time after a reset by an
        operator.
        """
        stop, reset = self.CALLS
        if self.parts['state']['unasked']['moves']:
            return (stop,)
        return (reset,) if 0.0 < self.parts['state']['stamp'] - self._reset_stamp < RESET_REQUEST_DURATION_S else ()

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
        """Values whose change is published at once in the diagnostics.

        The values are faults, mode, silence, lock, state of the drive, pins and alignment.
        """
        outputs, inputs = self.parts['outputs'], self.parts['inputs']
        return (control_unit.latched(self.parts['state']), outputs['mode'], outputs['reason'] == Reason.SILENCE,
                outputs['locked'], inputs['drive'], inputs['pins'], inputs['aligning'])

    @staticmethod
    def idle(numbers: Mapping[str, Message]) -> str:
        """Return the reason why a recording does not exercise the unit, or ''; numbers: recorded numbers by topic.

        The reasons are a receiver that never locked, and a control unit that was never in autotrack.
        """
        if not np.isfinite(numbers[ANGLE_ERROR_TOPIC][:, 0]).any():
            return 'the receiver never locked'
        return '' if 'autotrack' in numbers[MODE_TOPIC] else 'the ACU was never in autotrack'
