"""The unit of the antenna control unit: the compiled law with its state, the conversion of messages, and the commands.

The node `acu`, the closed loop and the recomputation run this unit (pedestal_common.node.unit). In each step it
converts the messages to the inputs of `control_unit.step`, and the outputs to messages. Between the steps it executes
the commands of clients.
"""
import datetime
import functools
import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from acu_tracker import control_unit, modes, signals
from acu_tracker.alarms import annunciator, report, table
from acu_tracker.estimation import receiver_error
from acu_tracker.geometry import direction
from acu_tracker.mode import mode_change
from acu_tracker.modes import Mode, Reason
from acu_tracker.operating import announcement, diagnosis
from acu_tracker.operating.alarm_desk import AlarmDesk
from acu_tracker.operating.authority import Authority
from acu_tracker.operating.command_table import ACU_COMMANDS, ALARM_COMMAND_NAMES, ARGUMENT_SETTERS
from acu_tracker.params import AcuParameters
from acu_tracker.pointing import model
from acu_tracker.pointing.params import PointingParameters
from acu_tracker.program import segments, tables
from acu_tracker.program.air import WEATHER_QUANTITIES, Air
from acu_tracker.program.prediction import Predicted, Predictor
from acu_tracker.program.program_track import ProgramTrack
from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.graph import nodes, topics
from pedestal_common.graph.modes import Row as ModeRow
from pedestal_common.node.unit import NEVER_DUE_NS, Diagnosis, Unit, joined
from pedestal_common.parameters import Parameters
from pedestal_common.quantities import (
    AnyRecord,
    Message,
    Nanoseconds,
    Pairs,
    Radians,
    Records,
    Seconds,
    Stamps,
    Times,
    Value,
)
from pedestal_common.record import Record
from pedestal_common.wire import messages
from pedestal_common.wire.commands import Command, Reply, schedule
from pedestal_common.wire.inputs import taking
from pedestal_common.wire.records import NO_STAMP

JOINT_STATES_TOPIC, ATTITUDE_TOPIC = 'joint_states', 'ship/imu/data'
ANGLE_ERROR_TOPIC, ANGLE_RATE_TOPIC = 'tracking_receiver/angle_error', 'tracking_receiver/angle_rate'
RANGE_TOPIC, RATE_COMMAND_TOPIC = 'tracking_receiver/range', 'acu/rate_command'
ESTIMATE_TOPIC, REFERENCE_TOPIC, FILTER_TOPIC = 'acu/estimate', 'acu/reference', 'acu/filter'
MODE_TOPIC, KEYHOLE_TOPIC, BLOCKAGE_TOPIC, ALARMS_TOPIC = 'acu/mode', 'acu/keyhole', 'acu/blockage', 'acu/alarms'
DRIVE_STATE_TOPIC, INS_STATE_TOPIC, STOW_PINS_TOPIC = 'adu/state', 'ins/state', 'acu/stow_pins'
POINTING_TOPIC = 'acu/pointing'

FILTER_COLUMN_COUNT, MODEL_COUNT = len(topics.FILTER_UNITS), len(topics.MOTION_MODELS)
"""Number of the values of an axis on acu/filter; the last MODEL_COUNT are the probabilities of the motion models."""

INS_ALIGNING = topics.TOPIC_BY_NAME[INS_STATE_TOPIC].texts.index('aligning')
"""Code of the state `aligning`; an INS that has published no state, topics.NO_TEXT_CODE, counts as aligned."""


class UnitRecord(Record):
    """Memory of the control unit: the records of its law."""
    state: control_unit.State
    constants: control_unit.Constants
    inputs: signals.Inputs
    outputs: signals.Outputs
    invalid: int    # bits of signals.INVALID_INPUTS that were set since the last diagnosis


SILENCE_REFUSAL = f'no {JOINT_STATES_TOPIC}, the drive is silent'
"""Text with which every mode except standby is refused while the drive is silent."""

BEND_INTERVAL_S = 0.1  # time after which the refraction of a direction of the mode slave is computed again [s]

RESET_REQUEST_DURATION_S = 0.2
"""Time after a reset by an operator during which the reset of the drive is requested [s]."""

DRIVE_SILENT_ALARM, DRIVE_FAULT_ALARM = table.ALARM_INDEX['drive silent'], table.ALARM_INDEX['drive fault']
MOTOR_LOST_ALARMS = tuple(table.ALARM_INDEX[f'{axis} motor lost'] for axis in topics.AXES)
"""Indices of the alarms for the silence of the drive, and of those whose report contains the text of adu/state."""


class Memory(NamedTuple):
    """Memory of the law."""
    record: Records     # a UnitRecord (1,)
    tables: tables.Tables   # tables that the modes follow


_take = taking(signals.INPUT_TOPICS)


@compiled
def decode(inputs: signals.Inputs, stamp: Nanoseconds, received: AnyRecord) -> None:
    """Convert the messages of a step, received on the input topics, into the inputs of the control unit.

    An attitude stays until the next one comes. A rate or a range is used only if an error has the same stamp.
    """
    _take(inputs, received)
    error, rate, distance = received[ANGLE_ERROR_TOPIC], received[ANGLE_RATE_TOPIC], received[RANGE_TOPIC]
    inputs.stamp, inputs.encoder_valid = stamp * 1e-9, 1
    inputs.error_valid = 1 if inputs.error_came and inputs.cross_elevation == inputs.cross_elevation else 0
    if rate.stamp == NO_STAMP or rate.stamp != error.stamp:
        inputs.error_rate[0] = inputs.error_rate[1] = math.nan
    if distance.stamp == NO_STAMP or distance.stamp != error.stamp:
        inputs.range = math.nan
    if received[ATTITUDE_TOPIC].stamp != NO_STAMP:
        inputs.attitude_valid = 1
    inputs.aligning = received[INS_STATE_TOPIC] == INS_ALIGNING
    inputs.drive_ready = inputs.drive <= signals.DRIVE_READY


@compiled
def encode(outputs: signals.Outputs, state: control_unit.State, stamp: Nanoseconds, sent: AnyRecord) -> None:
    """Convert the outputs of the control unit and the counts of its reports into the records of its messages.

    sent: record of the output topics.
    """
    command, estimate, reference = sent[RATE_COMMAND_TOPIC], sent[ESTIMATE_TOPIC], sent[REFERENCE_TOPIC]
    command.stamp = estimate.stamp = reference.stamp = sent[FILTER_TOPIC].stamp = stamp
    for i in range(2):
        command.velocity[i], command.effort[i] = outputs.rate[i], outputs.torque[i]
        estimate.position[i], reference.position[i] = outputs.estimate[i, 0], outputs.reference[i, 0]
        estimate.velocity[i], reference.velocity[i] = outputs.estimate[i, 1], outputs.reference[i, 1]
        estimate.acceleration[i], reference.acceleration[i] = outputs.estimate[i, 2], outputs.reference[i, 2]
        # In the order of topics.FILTER.
        numbers = sent[FILTER_TOPIC].position[i * FILTER_COLUMN_COUNT:]
        numbers[0], numbers[1], numbers[2] = outputs.innovation[i], outputs.rate_innovation[i], outputs.nis[i]
        numbers[3], numbers[4] = math.sqrt(outputs.covariance[i, 0]), math.sqrt(outputs.covariance[i, 2])
        numbers[5] = outputs.covariance[i, 1] / (numbers[3] * numbers[4])
        numbers[6] = outputs.innovation_sigma[i]
        for j in range(MODEL_COUNT):
            numbers[FILTER_COLUMN_COUNT - MODEL_COUNT + j] = outputs.probability[i, j]
    lookahead = state.guidance.lookahead
    sent[MODE_TOPIC] = outputs.mode
    sent[KEYHOLE_TOPIC], sent[BLOCKAGE_TOPIC] = lookahead.forecasts - 1, lookahead.blockages - 1
    sent[ALARMS_TOPIC], sent[STOW_PINS_TOPIC] = outputs.alarms, outputs.pins
    sent[POINTING_TOPIC] = state.tracking.pointing.report


@compiled
def law(memory: Memory, stamp: Nanoseconds, inputs: AnyRecord, outputs: AnyRecord) -> None:
    """Run one step; the arguments are those of the law of a unit (pedestal_common.node.unit.Unit)."""
    record = memory.record[0]
    decode(record.inputs, stamp, inputs)
    receiver_error.correct_error(record.constants.p.tracker.matrix, record.inputs)
    control_unit.step(record.state, record.constants, record.inputs, record.outputs, memory.tables)
    record.inputs.preset_valid = 0
    record.invalid |= record.outputs.invalid_input
    encode(record.outputs, record.state, stamp, outputs)


@compiled
def laws(memory: Memory, stamps: Stamps, inputs: Records, outputs: Records) -> None:
    """Run `law` for arrays of stamps, inputs and outputs."""
    for k in range(len(stamps)):
        law(memory, stamps[k], inputs[k], outputs[k])


@compiled
def _encoder_angles(pointing: pointing_model.PointingModel, azimuth: Radians,
                    elevation: Radians) -> tuple[Radians, Radians]:
    A, E, _ = pointing_model.encoder_of(pointing, azimuth, elevation)
    return A, E


@functools.lru_cache(1)
def _initial(parameters: AcuParameters) -> Records:
    """Return the UnitRecord (1,) of a control unit before its first step.

    The cache saves time in successive trials with equal parameters.
    """
    return joined(UnitRecord.dtype, state=control_unit.initial_state(parameters),
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

    def __init__(self, parameters: AcuParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.memory = Memory(_initial(parameters).copy(), tables.NO_TABLES)
        self.parts['inputs']['stabilised'], self.parts['inputs']['drive_ready'] = ATTITUDE_TOPIC in self.reads, 1
        self.parts['outputs']['mode'], self.parts['outputs']['pins'] = Mode.STANDBY, topics.NO_TEXT_CODE
        signals.clear(self.parts['outputs'])
        self.drive_state = 'unknown'
        self.authority = Authority()
        self.segments = segments.Segments([(axis.limits.rate, axis.limits.acceleration) for axis in (
            parameters.azimuth, parameters.elevation)])
        self.air = Air(parameters.refraction)
        self.predictor = Predictor(parameters.prediction, air=self.air)
        self.predicted: dict[str, Predicted] = {}       # by name of the mode
        # {name of the mode: (track, revision of the air, track with apparent elevations)}
        self._apparent: dict[str, tuple[ProgramTrack, int, ProgramTrack]] = {}
        self._slave: AnyRecord = None       # commanded direction of the mode slave; None: no direction
        self._bend_due: Nanoseconds = NEVER_DUE_NS
        self.offset: tuple[Seconds, Radians, Radians] = (0.0, 0.0, 0.0)     # of time, azimuth and elevation
        self._tables_valid: tuple[Nanoseconds, Nanoseconds] = (NEVER_DUE_NS, NO_STAMP)      # since, until
        self.desk = AlarmDesk(self.parts['state'], control_unit.reset)
        self._silent, self._reset_stamp = False, -math.inf
        self.pointing, self.refused_model = parameters.pointing, ''
        self.pointing_reports = [self.pointing.report()]

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
        self.desk.prepare()
        self.encode(ALARMS_TOPIC, 0)
        annunciator.set_condition(self.alarms, DRIVE_SILENT_ALARM, True, 0.0)
        self.diagnose()
        self.air.raised(np.zeros(2), np.zeros((2, 2)))

    def configure(self, parameters: Parameters) -> None:
        """Put new values of the LIVE parameters into the constants; the state stays as it is.

        A state without a step, as after a reset, begins with the pointing model that was in force, at its last terms.
        """
        super().configure(parameters)
        if not math.isfinite(self.parts['state']['stamp']):
            model.initialise(self.parts['state']['tracking']['pointing'], self.pointing.terms, self.pointing.named)
            self.pointing_reports = [self.pointing.report()]
            self.bend(None)
        self.memory.record['constants'] = control_unit.constants(self.parameters)
        self._tables_valid = NEVER_DUE_NS, NO_STAMP

    def decode(self, topic: str, message: Message) -> None:
        """Take a message on acu/program_track, or a reading of the weather station.

        A bad message on acu/program_track raises ValueError; Air counts the readings that it drops. Two or more points
        are a segment of the program track in earth angles. One point is a preset in deck angles.
        """
        if topic in WEATHER_QUANTITIES:
            stamp = messages.nanoseconds(message.header.stamp)
            self.air.take(topic, stamp * 1e-9 if stamp else None, message,
                          self.now * 1e-9 if math.isfinite(self.parts['state']['stamp']) else None)
            if self.air.due == -math.inf:
                self._tables_valid = NEVER_DUE_NS, NO_STAMP
            return
        times, angles = rows(message)
        if len(angles) == 1:
            self.parts['inputs']['preset'], self.parts['inputs']['preset_valid'] = angles[0], 1
        else:
            start = messages.nanoseconds(message.header.stamp) * 1e-9
            self._append(times + start, angles)

    def _append(self, times: Times, angles: Pairs) -> None:
        """Append a segment to the program track; raise ValueError if it is refused.

        times: stamps of its rows; angles: azimuth and elevation [rad].
        """
        state, inputs = self.parts['state'], self.parts['inputs']
        followed = state['mode']['now'] == Mode.PROGRAM
        try:
            self.segments.append(times, angles, float(state['stamp']) - self.offset[0], followed)
        except segments.TurnaroundError:
            inputs['turnaround'] = 1
            raise
        inputs['turnaround'] = 0
        self.update_tables()

    @property
    def next_due(self) -> Nanoseconds:
        """Time of the next command of the schedule, or of the next update of a table or of the refraction."""
        return min(super().next_due, self._tables_valid[1], self._bend_due)

    def execute_due(self, stamp: Nanoseconds) -> None:
        """Execute the scheduled commands that are due before the step of a stamp.

        The tables of the law are brought to this stamp before.
        """
        if self.epoch != self.predictor.epoch:
            self._predict_by(self.predictor.with_epoch(self.epoch))
            self._check_model()
        since, until = self._tables_valid
        if not since <= stamp < until:
            self.update_tables(stamp)
        if stamp >= self._bend_due:
            self._bend(int(stamp) * 1e-9)
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

    def _predict_by(self, predictor: Predictor) -> None:
        """Replace the Predictor and discard its predictions."""
        self.predictor, self.predicted, self._tables_valid = predictor, {}, (NEVER_DUE_NS, NO_STAMP)

    def update_tables(self, stamp: Nanoseconds | None = None) -> None:
        """Bring the tables of the law to a stamp; None: the stamp of the last step.

        The tables are the piece of the program track that is due, and the predictions of satellite and sun. The
        refraction is added to true directions. All are shifted by the offset that an operator has commanded.
        """
        stamp = self.now if stamp is None else int(stamp)
        inputs, t = self.parts['inputs'], stamp * 1e-9
        self.air.update(t)
        for place, row in enumerate(tables.TABLE_MODES):
            known = self.predicted.get(row.name)
            if row.predicted and (known is None or not known.since <= t < known.until):
                known = self.predicted[row.name] = getattr(self.predictor, row.predicted)(t)
            inputs['unpredicted'][place] = known.reason if known else Reason.NONE
        piece, inputs['gap'], ends = self.segments.at(t - self.offset[0])
        until = min(ends + self.offset[0], self.air.due, *(known.until for known in self.predicted.values()))
        self._tables_valid = stamp, max(math.ceil(until * 1e9), stamp + 1) if until < math.inf else NEVER_DUE_NS
        self.memory = self.memory._replace(tables=tables.Tables(*(
            tables.shifted(self._apparent_track(row, self.predicted[row.name].track if row.predicted else piece),
                           self.offset)
            for row in tables.TABLE_MODES)))

    def _apparent_track(self, row: ModeRow, track: ProgramTrack) -> ProgramTrack:
        """Return the table of a row of TABLE_MODES with apparent elevations; the last result is kept.

        A new weather changes neither the first nor the last elevation of a table. The planner recognises a program by
        these rows (planner.another_program), and a new program would restart the mode.
        """
        if not self.air.on or not (row.predicted or self.parameters.refraction.program == 'geometric'):
            return track
        kept = self._apparent.get(row.name)
        if kept is not None and kept[0] is track and kept[1] == self.air.revision:
            return kept[2]
        apparent = self.air.apparent(track)
        if kept is not None and kept[0] is track and len(track.times):
            apparent.angles[[0, -1]] = kept[2].angles[[0, -1]]
        self._apparent[row.name] = track, self.air.revision, apparent
        return apparent

    def bend(self, slave: AnyRecord) -> None:
        """Add the refraction to a direction of the mode slave, from now on and again every BEND_INTERVAL_S.

        slave: the commanded direction.Direction; None: there is no direction.
        """
        self._slave, self._bend_due = slave, NEVER_DUE_NS
        if (slave is not None and math.isfinite(slave['stamp']) and self.air.on
                and self.parameters.refraction.slave == 'geometric'):
            self._bend(float(slave['stamp']))

    def _bend(self, t: Seconds) -> None:
        """Add the refraction to the direction of the mode slave for BEND_INTERVAL_S from t on.

        Between both times the elevation moves on a straight line, which meets the next one without a step.
        """
        ends = t + BEND_INTERVAL_S
        times = np.array((t, ends))
        elevations = self.air.bent(np.ascontiguousarray(direction.moved(self._slave, times)[:, 1]), times)
        direction.set_chord(self.parts['state']['guidance']['slave'], 1, t, ends, elevations)
        self._bend_due = round(ends * 1e9) if t <= self._slave['stamp'] + self._slave['holds'] else NEVER_DUE_NS

    def _check_model(self) -> None:
        """Discard a model of the parameters whose date is later than now; the pedestal then counts as ideal.

        The date can be judged in realtime only, before the first step, when the epoch of the stamps is known.
        """
        try:
            self.pointing.check_date(self.utc)
        except ValueError as error:
            self.refused_model, self.pointing = str(error), PointingParameters()
            model.initialise(self.parts['state']['tracking']['pointing'], self.pointing.terms, False)

    def take_model(self, arguments: Mapping[str, Value]) -> Reply:
        """Take another pointing model, gradually, and return the Reply. Raise ValueError if it is refused.

        arguments: by name of a field of PointingParameters.
        """
        pointing = PointingParameters(**arguments)
        pointing.check_antenna(self.parameters.antenna)
        pointing.check_date(self.utc)
        state = self.parts['state']['tracking']['pointing']
        begins = self.now * 1e-9
        duration = model.replace(state, pointing.terms, begins)
        changing = pointing.report(state['before'], begins, begins + duration)
        self.pointing_reports = [*self.pointing_reports[:int(state['report'])], changing, pointing.report()]
        self.pointing, self.refused_model = pointing, ''
        unchecked = pointing.unchecked(self.parameters.antenna)
        return Reply(True, f'pointing model {changing.title}; it is in force in {duration:.1f} s'
                     + (f'; {unchecked}' if unchecked else ''))

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
            return self.pointing_reports[code].text
        return modes.MODES[code] if topic == MODE_TOPIC else super().encode(topic, code)

    def schedule(self) -> list[tuple[Nanoseconds, Command]]:
        """Return the commands of the parameter `commands`, with their times."""
        return schedule('commands', self.parameters.commands, ACU_COMMANDS)

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Return the Reply to a command of VERBS; a refusal states the reason and changes nothing."""
        verb, state = command.verb, self.parts['state']
        if verb == 'reset':
            return self._reset()
        if verb in ALARM_COMMAND_NAMES:
            return getattr(self.desk, verb)(*arguments.values())
        if verb == 'take':
            return self.authority.take(command.who, arguments['role'])
        if verb == 'release':
            return self.authority.release()
        if verb == 'fallback':
            mode_change.choose(state['mode'], arguments['mode'])
            return Reply(True, f'fallback is {arguments["mode"]}')
        if verb == 'offset':
            self.offset = (arguments['time'], *(arguments[axis] for axis in topics.AXES))
            self.update_tables()
            return Reply(True, 'program track shifted by {:g} s, {:g} and {:g} rad'.format(*self.offset))
        if verb == 'pointing':
            if not command.arguments:
                raise ValueError('pointing: no term is given; p1=0 requests a model whose terms are all 0')
            return self.take_model(arguments)
        if verb == 'elements':
            self.take_elements(*arguments.values())
            return Reply(True, f'elements of satellite {self.predictor.number}')
        guidance, predictor, slave = state['guidance'], self.predictor, (self._slave, self._bend_due)
        before = {name: guidance[name].copy() for name in ('preset', 'manual', 'slave')}
        if verb in ARGUMENT_SETTERS:
            ARGUMENT_SETTERS[verb](self, arguments)
        reply = self.request(f'acu/{verb}')
        if not reply.granted:
            for name, value in before.items():
                guidance[name] = value
            self._slave, self._bend_due = slave
            if self.predictor is not predictor:
                self._predict_by(predictor)
                self.update_tables()
        return reply

    def take_elements(self, line_1: str, line_2: str, omm: str) -> None:
        """Predict the satellite from other elements; raise ValueError for invalid elements.

        line_1, line_2: TLE, in which _ stands for a blank; omm: OMM in JSON.
        """
        self._predict_by(self.predictor.with_elements(line_1.replace('_', ' '), line_2.replace('_', ' '), omm))
        self.update_tables()

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
            return self._reset()
        if mode == 'acknowledge':
            return self.desk.acknowledge()
        if self.silent and mode != 'standby':
            return Reply(False, f'refused: {SILENCE_REFUSAL}; mode is {modes.MODES[outputs["mode"]]}')
        parts['inputs']['drive_ready'] = self.inputs[0][DRIVE_STATE_TOPIC] <= signals.DRIVE_READY
        code = modes.MODES.index(mode)
        granted = control_unit.request(parts['state'], parts['constants'], parts['inputs'], outputs,
                                       self.memory.tables, code)
        refusal = '' if granted else f'refused: {self._refusal(code, outputs["reason"])}; '
        return Reply(bool(granted), f'{refusal}mode is {modes.MODES[outputs["mode"]]}')

    def _reset(self) -> Reply:
        """Return the Reply to a reset of the latched alarms and faults; also request the reset of a drive in fault.

        The control unit does not reset an emergency stop of the drive: only an operator does, at adu/reset_faults.
        """
        reply = self.desk.reset()
        if self.drive_state.startswith('fault'):
            self._reset_stamp = float(self.parts['state']['stamp'])
        if reply.granted and self.drive_state.startswith(('fault', 'emergency stop')):
            return Reply(True, f'{reply.text}; the drive reports {self.drive_state}')
        return reply

    def _refusal(self, mode: int, reason: int) -> str:
        """Return the text of the reason why a mode is refused, with its details."""
        more = self.predictor.refusal_details(mode, reason, self.now * 1e-9) if mode in (Mode.TLE, Mode.SUN) else ''
        more = more or diagnosis.missing(self, diagnosis.INPUTS_OF_REASONS.get(reason, ''))
        beyond = self._beyond_limits(modes.MODES[mode]) if reason == Reason.OUTSIDE_LIMITS else ''
        return modes.REASONS[reason] + (f', {more}' if more else beyond)

    @property
    def pointing_model(self) -> str:
        """The pointing model in force, in words; '' without a model."""
        state = self.parts['state']['tracking']['pointing']
        if state['report'] == topics.NO_TEXT_CODE:
            return ''
        title = self.pointing_reports[int(state['report'])].title
        return f'{title}; in force from {state["ends"]:.1f} s on' if state['changing'] else title

    @property
    def drive_status(self) -> str:
        """State of the drive as the drive published it, or 'silent'."""
        return 'silent' if self.silent else self.drive_state

    def refusals(self) -> dict[str, str]:
        """Return {name of a mode: text of the reason} for the modes that would be refused now."""
        if self.silent:
            return dict.fromkeys((mode for mode in modes.MODES if mode != 'standby'), SILENCE_REFUSAL)
        parts, why = self.parts, np.zeros(len(modes.MODES), np.int64)
        control_unit.refusals(parts['state'], parts['constants'], parts['inputs'], self.memory.tables, why)
        words = {code: modes.REASONS[code] for code in set(why.tolist()) - {Reason.NONE}}
        if Reason.DRIVE_NOT_READY in words:
            words[Reason.DRIVE_NOT_READY] += f': {self.drive_status}'
        for reason, name in diagnosis.INPUTS_OF_REASONS.items():
            if reason in words and (text := diagnosis.missing(self, name)):
                words[reason] += f', {text}'
        refused = {mode: words[code] for mode, code in zip(modes.MODES, why.tolist()) if code in words}
        return {mode: text + self._beyond_limits(mode) if text == modes.REASONS[Reason.OUTSIDE_LIMITS] else text
                for mode, text in refused.items()}

    def _beyond_limits(self, mode: str) -> str:
        """Return the details of the reason OUTSIDE_LIMITS for the modes preset and stow; '' for another mode."""
        p, state = self.parameters, self.parts['state']
        angles = {'preset': _encoder_angles(state['tracking']['pointing']['model'],
                                            *state['guidance']['preset']['angle'].tolist()),
                  'stow': (p.azimuth.stow, p.elevation.stow)}.get(mode)
        return '' if angles is None else f', {diagnosis.beyond_limits(p, angles)}'

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
        return self.desk.alarms

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


def rows(message: Message) -> tuple[Times, Pairs]:
    """Return (times since the stamp of the message, azimuth and elevation [rad]) of a JointTrajectory.

    Raise ValueError if an axis or a position is missing.
    """
    if not set(topics.AXES) <= set(message.joint_names):
        raise ValueError(f'joint_names {message.joint_names}: must hold {" and ".join(topics.AXES)}')
    columns = [message.joint_names.index(axis) for axis in topics.AXES]
    for row, point in enumerate(message.points):
        if len(point.positions) != len(message.joint_names):
            raise ValueError(f'row {row}: {len(point.positions)} positions; must be {len(message.joint_names)}')
    times = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9 for point in message.points]
    angles = [[point.positions[column] for column in columns] for point in message.points]
    return np.array(times), np.reshape(angles, (-1, len(columns)))
