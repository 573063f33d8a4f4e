"""Unit of `drive_node`. A step: commands, their exchange for the reports of the drives, messages of the graph."""
import dataclasses
import math
import typing
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from drive_law import axis_control, drive_state, rate_drive
from pedestal_common.graph import nodes, topics
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Records, Stamps
from pedestal_common.wire.commands import Reply
from pedestal_hardware import cia402, errors, pdo, servo_drives
from pedestal_hardware.bus import Bus
from pedestal_hardware.commissioning import Scale
from pedestal_hardware.params import CONTROLS, ServoDriveParameters

DRIVE_LABELS = tuple(f'{axis} motor {i}' for axis in topics.AXES for i in (1, 2))  # names of the four drives in texts


class Memory(typing.NamedTuple):
    """Memory of the node."""
    record: Records         # servo_drives.ServoRecord (1,)


def _scales(params: ServoDriveParameters) -> Records:
    """Return the Scales (1,), in which the units of the drives are still 1."""
    scales = np.ones(1, servo_drives.Scales.dtype)
    k = scales[0]
    for i, name in enumerate(topics.AXES):
        axis, drives = getattr(params, name), getattr(params.drives, name)
        k['load'][i] = 2.0 * math.pi / 2.0 ** axis.encoder.load_bits * (-1.0 if drives.load_reversed else 1.0)
        k['load_zero'][i] = drives.load_zero
    k['per_period'], k['control'] = 1.0 / params.period, CONTROLS.index(params.control)
    k['follow_gain'] = 1.0 - math.exp(-params.period / params.drives.follow_time)
    for name, time in (('lost', params.bus.report_timeout), ('enable', params.drives.enable_time),
                       ('reset', params.drives.reset_time), ('leave', servo_drives.MAX_LEAVE_S),
                       ('blind', servo_drives.MAX_BLIND_S)):
        k[f'{name}_periods'] = math.ceil(time / params.period - 1e-6)
    return scales


def _constants(params: ServoDriveParameters) -> Records:
    """Return the drive_state.Constants (1,). Their sensors are exact, because the drives themselves measure."""
    axes = {}
    for name in topics.AXES:
        p = getattr(params, name)
        values = axis_control.constants(p, params.period)
        if params.control == 'drive':
            # The drives contain the gains.
            values.update(K_p=0.0, K_iT=0.0, K_d=0.0)
        for motor in ('motor_1', 'motor_2'):
            of_motor = axis_control.motor_constants(getattr(p, motor), p.thermal, p.encoder.motor_bits, params.period)
            values[motor] = axis_control.MotorConstants.of(**{**of_motor, 'gain': 1.0, 'offset': 0.0})
        axes[name] = axis_control.Constants.of(**{**values, 'zero_hat': 0.0})
    return drive_state.Constants.of(**drive_state.constants(params), **axes)


def _initial_state(params: ServoDriveParameters) -> Records:
    axes = {}
    for name in topics.AXES:
        p, theta = getattr(params, name), getattr(params, f'initial_{name}')
        angle = p.gear_train.ratio * theta
        count = round(angle * axis_control.counts_per_rad(p.encoder.motor_bits))
        motor = axis_control.MotorState.of(theta=angle, count=count)
        axes[name] = axis_control.State.of(theta=theta, motor_1=motor, motor_2=motor)
    return drive_state.State.of(
        **{**drive_state.initial_state(dataclasses.replace(params, initially_enabled=False)),
           'wanted': params.initially_enabled}, **axes)


class ServoDrives(rate_drive.RateDrive):
    """Unit of four servo drives."""
    parameters: ServoDriveParameters
    memory: Memory
    bus: Bus | None         # None before the node has connected it; the drives then report nothing
    problems: list[str]     # reason why each drive cannot be used, or ''
    NODE, LAWS = nodes.SERVO_DRIVE, {}

    def __init__(self, parameters: ServoDriveParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        self.bus = None
        self.problems = [''] * pdo.DRIVE_COUNT
        self._commands = np.zeros(pdo.DRIVE_COUNT, pdo.COMMAND_DTYPE)
        self._reports = np.zeros(pdo.DRIVE_COUNT, pdo.REPORT_DTYPE)
        drives = servo_drives.Drives.zeros()
        drives['age'] = 1     # nothing was reported yet
        self.memory = Memory(servo_drives.ServoRecord.of(
            state=_initial_state(parameters), constants=_constants(parameters),
            link=rate_drive.initial_link(parameters), drives=drives, scales=_scales(parameters)))
        for i, axis in enumerate(topics.AXES):
            for gain in ('K_p', 'K_iT'):
                self.parts['scales'][gain][i] = self.parts['constants'][axis][gain]
        d = self.parts['drives']
        self._command_values = [(self._commands[name], d[source]) for name, source in (
            ('controlword', 'controlword'), ('velocity', 'target'), ('torque', 'offset'))]
        self._report_values = [(d[name], self._reports[name]) for name in pdo.REPORT_FIELDS]
        self.read()

    def read(self) -> None:
        """Write the present outputs, between two steps."""
        servo_drives.read(self.memory.record)

    def step(self, stamps: Stamps, inputs: Records, outputs: Records) -> None:
        """Make the steps of these stamps: commands, exchange, messages."""
        for k, stamp in enumerate(stamps):
            servo_drives.control(self.memory.record, stamp, inputs[k])
            self._exchange()
            servo_drives.measure(self.memory.record, stamp, outputs[k])

    def _exchange(self) -> None:
        d = self.parts['drives']
        d['reported'] = 0
        if self.bus is None:
            return
        for command, value in self._command_values:
            np.multiply(d['ready'], value, out=command, casting='unsafe')
        d['reported'] = self.bus.exchange(self._commands, self._reports)
        for value, report in self._report_values:
            value[...] = report

    def use_drive(self, drive: int, scale: Scale) -> None:
        """Begin to use a drive whose settings are verified."""
        d, k = self.parts['drives'], self.parts['scales']
        axis = getattr(self.parameters.drives, topics.AXES[drive // 2])
        sign = -1.0 if getattr(axis, f'reversed_{drive % 2 + 1}') else 1.0
        for name, value in scale._asdict().items():
            k[name][drive] = sign * value
        # A drive that has lost its supply may count from another position.
        d['known'][drive] = d['been_up'][drive] = d['away'][drive] = 0
        d['ready'][drive], self.problems[drive] = 1, ''

    def reset_drives(self, drives: Sequence[int]) -> None:
        """Let these drives reset their faults in the next periods."""
        self.parts['drives']['reset_left'][drives] = self.parts['scales']['reset_periods']

    @property
    def rests(self) -> bool:
        """True if the axes are disabled and all drives that report have removed the torque. A drive that does not
        remove it counts as off after `drives.enable_time`."""
        d, k = self.parts['drives'], self.parts['scales']
        off = np.isin(d['state'], cia402.OFF_STATES) | (d['age'] > k['lost_periods'])
        return super().rests and bool(off.all() or self.parts['state']['age'] > k['enable_periods'])

    @property
    def lost(self) -> list[int]:
        """Numbers of the drives that report nothing."""
        d = self.parts['drives']
        return [i for i in range(pdo.DRIVE_COUNT) if d['age'][i] > self.parts['scales']['lost_periods']
                or not d['ready'][i]]

    @property
    def faulty(self) -> list[int]:
        """Numbers of the drives in the state `fault`."""
        return [int(i) for i in np.flatnonzero(self.parts['drives']['state'] == cia402.State.FAULT)]

    def request(self, name: str) -> Reply:
        """Execute one of REQUESTS and return the Reply. A reset also resets the faults of the drives."""
        d = self.parts['drives']
        if name == 'adu/reset_faults' and d['interlock']:
            return Reply(False, f'refused: the interlock of a drive is open; drive is {self.condition}')
        reply = super().request(name)
        if name == 'adu/reset_faults' and reply.granted:
            self.reset_drives(self.faulty)
            state = self.parts['state']
            enabled = d['state'] == cia402.State.OPERATION_ENABLED
            if state['phase'] == drive_state.PHASE_ENABLED and not enabled.all():
                # The brakes hold the axes until all drives are enabled again.
                state['phase'], state['age'] = drive_state.PHASE_ENGAGING_BRAKES, 0
                state['applied'], state['brake_age'] = 1, 0
        return reply

    def resume(self, state: rate_drive.PlantState) -> None:
        """Restore the state before a restart: enabled if it was enabled. The drives know their angles."""
        self.parts['state']['wanted'] = state.enabled

    def plant_state(self) -> rate_drive.PlantState:
        """Return the PlantState for `resume`; an unknown angle is 0."""
        state = super().plant_state()
        return state._replace(azimuth=float(np.nan_to_num(state.azimuth)),
                              elevation=float(np.nan_to_num(state.elevation)))

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis of the drive unit, with state and error of each drive."""
        diagnosis, d = super().diagnose(), self.parts['drives']
        values = list(diagnosis.values)
        for i, label in enumerate(DRIVE_LABELS):
            states = (*cia402.STATE_NAMES, 'unknown')
            values.append((f'{label} drive', 'no reports' if i in self.lost else states[d['state'][i]]))
            values.append((f'{label} error', errors.name(int(d['error'][i]))))
        problem = next((f'{label}: {text}' for label, text in zip(DRIVE_LABELS, self.problems) if text), '')
        if problem and diagnosis.level < LEVEL_ERROR:
            diagnosis = diagnosis._replace(level=LEVEL_WARN, message=problem)
        elif problem:
            diagnosis = diagnosis._replace(message=f'{diagnosis.message}; {problem}')
        return diagnosis._replace(values=values)

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once: those of the drive unit, and the errors of the drives."""
        return (*super().urgent, *self.parts['drives']['error'].tolist(), *self.problems)

    def prepare_requests(self) -> None:
        """Compile the functions behind the requests, and the law that commands the drives."""
        super().request(self.REQUESTS[0])
        servo_drives.control(self.memory.record, np.int64(0), self.inputs[0])

    @property
    def last_prepared(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        """Law that reads the drives, with its arguments: `prepare` calls it last."""
        return servo_drives.measure, (self.memory.record, np.int64(0), self.outputs[0])
