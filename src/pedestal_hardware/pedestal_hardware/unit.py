"""Unit of `drive_node`. A step computes the commands, exchanges them for the reports of the drives, and fills the
messages of the graph."""
import dataclasses
import math
import typing

import numpy as np

from adu_drive import drive_state, drive_unit
from adu_drive import unit as adu_unit
from pedestal_common.graph import nodes, topics
from pedestal_common.node.unit import LEVEL_ERROR, LEVEL_WARN, Unit, joined
from pedestal_common.wire.commands import Reply
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, errors, pdo, servo_drives
from pedestal_hardware.params import CONTROLS

DRIVE_LABELS = tuple(f'{axis} motor {i}' for axis in topics.AXES for i in (1, 2))  # names of the four drives in texts


class Memory(typing.NamedTuple):
    """Memory of the node; record: (1,) of servo_drives.Record."""
    record: np.ndarray


def _scales(p):
    """Return the record (1,) of servo_drives.SCALES_DTYPE, in which the units of the drives are still 1."""
    scales = np.ones(1, servo_drives.SCALES_DTYPE)
    k = scales[0]
    for i, name in enumerate(topics.AXES):
        axis, drives = getattr(p, name), getattr(p.drives, name)
        k['load'][i] = 2.0 * math.pi / 2.0 ** axis.encoder.load_bits * (-1.0 if drives.load_reversed else 1.0)
        k['load_zero'][i] = drives.load_zero
    k['per_period'], k['control'] = 1.0 / p.period, CONTROLS.index(p.control)
    k['follow_gain'] = 1.0 - math.exp(-p.period / p.drives.follow_time)
    for name, time in (('lost', p.bus.report_timeout), ('enable', p.drives.enable_time),
                       ('reset', p.drives.reset_time), ('leave', servo_drives.MAX_LEAVE_S),
                       ('blind', servo_drives.MAX_BLIND_S)):
        k[f'{name}_periods'] = math.ceil(time / p.period - 1e-6)
    return scales


def _constants(p):
    """Return the constants for the laws of the drive unit, at the period of the node. The sensors of these laws are
    exact, because the drives themselves measure."""
    constants = drive_unit.constants(p, speed_period=p.period)
    for axis in topics.AXES:
        c = constants[0][axis]
        c['encoder']['exact'], c['encoder']['zero'] = 1, 0.0
        if p.control == 'drive':
            # The drives contain the gains.
            c['K_p'] = c['K_iT'] = c['K_d'] = 0.0
        for motor in ('motor_1', 'motor_2'):
            c[motor]['gain'], c[motor]['offset'] = 1.0, 0.0
    return constants


class ServoDrives(adu_unit.Adu):
    """Unit of four servo drives, from ServoDriveParameters.

    bus: bus.Bus, None before the node has connected it; the drives then report nothing.
    """
    NODE, COMMAND, LAWS, VERBS = nodes.SERVO_DRIVE, adu_unit.RATE_COMMAND_TOPIC, {}, ()

    def __init__(self, parameters, reads):
        Unit.__init__(self, parameters, reads)
        self.bus = None
        self.problems = [''] * pdo.DRIVE_COUNT
        self._commands = np.zeros(pdo.DRIVE_COUNT, pdo.COMMAND_DTYPE)
        self._reports = np.zeros(pdo.DRIVE_COUNT, pdo.REPORT_DTYPE)
        link, drives = adu_unit.Link.zeros(), np.zeros(1, servo_drives.DRIVES_DTYPE)
        drives['age'] = 1     # nothing was reported yet
        link['stamp'] = link['command_stamp'] = link['truth_stamp'] = NO_STAMP
        link['timeout'] = round(parameters.command_timeout * parameters.period * 1e9)
        link['period'] = round(parameters.period * 1e9)
        at_rest = dataclasses.replace(parameters, initially_enabled=False)
        self.memory = Memory(joined(
            servo_drives.Record, state=drive_unit.initial_state(at_rest), constants=_constants(parameters),
            link=link, drives=drives, scales=_scales(parameters)))
        for i, axis in enumerate(topics.AXES):
            for gain in ('K_p', 'K_iT'):
                self.parts['scales'][gain][i] = self.parts['constants'][axis][gain]
        self.parts['state']['wanted'] = parameters.initially_enabled
        d = self.parts['drives']
        self._command_values = [(self._commands[name], d[source]) for name, source in (
            ('controlword', 'controlword'), ('velocity', 'target'), ('torque', 'offset'))]
        self._report_values = [(d[name], self._reports[name]) for name in pdo.REPORT_FIELDS]
        for axis in topics.AXES:
            # The torques that hold the axes are measured, not known in advance.
            for motor in ('motor_1', 'motor_2'):
                self.parts['state'][axis][motor]['sum'] = 0.0
            self.parts['state'][axis]['d_hat'] = 0.0
        drive_unit.read(*(self.parts[name] for name in ('state', 'constants', 'outputs')))

    def schedule(self):
        """Return []: real drives have no injected faults. The simulated drives take those of the parameter
        `inject`."""
        return []

    def step(self, stamps, inputs, outputs):
        """Make the steps of stamps (n,) [ns]: commands, exchange, messages."""
        for k, stamp in enumerate(stamps):
            servo_drives.control(self.memory.record, stamp, inputs[k])
            self._exchange()
            servo_drives.measure(self.memory.record, stamp, outputs[k])

    def _exchange(self):
        """Exchange the commands for the reports of the drives."""
        d = self.parts['drives']
        d['reported'] = 0
        if self.bus is None:
            return
        for command, value in self._command_values:
            np.multiply(d['ready'], value, out=command, casting='unsafe')
        d['reported'] = self.bus.exchange(self._commands, self._reports)
        for value, report in self._report_values:
            value[...] = report

    def use_drive(self, drive, scale):
        """Begin to use a drive whose settings are verified. scale: commissioning.Scale, the units of the drive."""
        d, k = self.parts['drives'], self.parts['scales']
        axis = getattr(self.parameters.drives, topics.AXES[drive // 2])
        sign = -1.0 if getattr(axis, f'reversed_{drive % 2 + 1}') else 1.0
        for name, value in scale._asdict().items():
            k[name][drive] = sign * value
        # A drive that has lost its supply may count from another position.
        d['known'][drive] = d['been_up'][drive] = d['away'][drive] = 0
        d['ready'][drive], self.problems[drive] = 1, ''

    def reset_drives(self, drives):
        """Let these drives reset their faults in the next periods."""
        self.parts['drives']['reset_left'][drives] = self.parts['scales']['reset_periods']

    @property
    def rests(self):
        """True if the axes are disabled and all drives that report have removed the torque. A drive that does not
        remove it counts as off after `drives.enable_time`."""
        d, k = self.parts['drives'], self.parts['scales']
        off = np.isin(d['state'], cia402.OFF_STATES) | (d['age'] > k['lost_periods'])
        return super().rests and bool(off.all() or self.parts['state']['age'] > k['enable_periods'])

    @property
    def lost(self):
        """Numbers of the drives that report nothing."""
        d = self.parts['drives']
        return [i for i in range(pdo.DRIVE_COUNT) if d['age'][i] > self.parts['scales']['lost_periods']
                or not d['ready'][i]]

    @property
    def faulty(self):
        """Numbers of the drives in the state `fault`."""
        return [int(i) for i in np.flatnonzero(self.parts['drives']['state'] == cia402.State.FAULT)]

    def request(self, name):
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

    def resume(self, state):
        """Restore the state before a restart: enabled if it was enabled. The drives know their angles."""
        self.parts['state']['wanted'] = state.enabled

    def plant_state(self):
        """Return the state_file.PlantState for `resume`; an unknown angle is 0."""
        state = super().plant_state()
        return state._replace(azimuth=float(np.nan_to_num(state.azimuth)),
                              elevation=float(np.nan_to_num(state.elevation)))

    def diagnose(self):
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
    def urgent(self):
        """Values whose change is published at once: those of the drive unit, and the errors of the drives."""
        return (*super().urgent, *self.parts['drives']['error'].tolist(), *self.problems)

    def prepare_requests(self):
        """Compile the functions behind the requests, and the law that commands the drives."""
        super().request(self.REQUESTS[0])
        servo_drives.control(self.memory.record, np.int64(0), self.inputs[0])

    @property
    def last_prepared(self):
        """(law that reads the drives, its arguments): `prepare` calls it last."""
        return servo_drives.measure, (self.memory.record, np.int64(0), self.outputs[0])
