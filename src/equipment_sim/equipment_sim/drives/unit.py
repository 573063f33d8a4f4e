"""Unit of the simulated drives: plant, injected faults and adu/truth, without bus and without ROS."""
import dataclasses
import typing
from collections.abc import Iterable, Mapping

import numpy as np

from adu_drive import drive_unit, injected
from drive_law import rate_drive
from drive_law.axis_params import AxisParameters
from equipment_sim.drives import law
from pedestal_common.graph import nodes, topics
from pedestal_common.injection import schedule, table
from pedestal_common.injection.schedule import Simulated
from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Records, Value
from pedestal_common.wire.commands import Command, Reply
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import cia402, commissioning, errors, pdo
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.unit import DRIVE_LABELS

PLANT_FAULTS = ('motor_loss', 'encoder_jump', 'encoder_stuck', 'brake_stuck', 'lost_tooth', 'gust')
"""Injected faults of the drive unit that simulated drives can have."""

ALIGNED_REPORT_DTYPE = np.dtype([(name, 'i8') for name in pdo.REPORT_FIELDS])
"""Report of a drive for compiled laws, in numbers of eight bytes."""


class Memory(typing.NamedTuple):
    """Memory of the simulated drives."""
    record: Records         # law.DrivesRecord (1,)


class SimulatedDrives(Simulated):
    """Unit of the simulated drives."""
    parameters: ServoDriveParameters
    memory: Memory
    NODE, LAWS = nodes.SIMULATED_DRIVES, {Memory: (law.law, law.laws)}
    VERBS, FAULTS_OF = table.INJECT_COMMANDS[nodes.DRIVE_NODE], nodes.DRIVE_NODE

    def __init__(self, parameters: ServoDriveParameters, reads: Iterable[str]) -> None:
        super().__init__(parameters, reads)
        link = rate_drive.Link.zeros()
        link['truth_stamp'] = NO_STAMP
        at_rest = dataclasses.replace(parameters, initially_enabled=False)
        self.memory = Memory(law.DrivesRecord.of(
            state=drive_unit.initial_state(at_rest),
            constants=drive_unit.constants(parameters), link=link, schedule=schedule.empty(),
            injected=injected.DriveInjected.zeros()))
        self.parts['tick'], self.parts['period'] = NO_STAMP, round(parameters.period * 1e9)
        self.reports = np.zeros(pdo.DRIVE_COUNT, ALIGNED_REPORT_DTYPE)
        for drive in range(pdo.DRIVE_COUNT):
            self.power_up(drive)

    def axis_of(self, drive: int) -> AxisParameters:
        """Return the AxisParameters of a drive."""
        return getattr(self.parameters, topics.AXES[drive // 2])

    def power_up(self, drive: int) -> None:
        """Bring a drive into its state after the supply came on."""
        d, motor = self.parts['drive'][drive], (self.axis_of(drive).motor_1, self.axis_of(drive).motor_2)[drive % 2]
        brake = d['brake_open'], d['brake_ticks']
        self.parts['drive'][drive:drive + 1] = law.Drive.zeros()
        d['state'], d['leaving'] = cia402.State.SWITCH_ON_DISABLED, law.STAY
        # The brakes that were open close in their own time.
        d['brake_ticks'] = 0 if brake[0] else max(brake[1], law.MAX_CATCH_UP_TICKS)
        d['velocity_unit'] = commissioning.RAD_S_PER_RPM
        d['torque_unit'] = commissioning.PERMILLE * self.axis_of(drive).thermal.rated_torque
        d['torque_limit'] = motor.torque_limit

    def measure(self) -> Records:
        """Update `reports` (4,), the reports of the drives at their last time."""
        law.report(self.memory.record, self.reports)
        return self.reports

    def execute(self, command: Command, arguments: Mapping[str, Value]) -> Reply:
        """Inject a fault; see Simulated. Raises ValueError for a fault of messages, which a bus does not have."""
        if command.verb not in (*PLANT_FAULTS, table.CLEAR_COMMAND.name):
            raise ValueError(f'{command.verb}: simulated drives have the faults {", ".join(PLANT_FAULTS)}')
        return super().execute(command, arguments)

    def diagnose(self) -> Diagnosis:
        """Return the Diagnosis with state and error of each drive."""
        values, faulty = [], []
        for label, d in zip(DRIVE_LABELS, self.parts['drive']):
            values.append((f'{label} drive', cia402.STATE_NAMES[d['state']]))
            if d['error']:
                faulty.append(f'{label}: {errors.name(int(d["error"]))}')
        return Diagnosis(LEVEL_WARN if faulty else LEVEL_OK, '; '.join(faulty) or 'drives run', values)

    @property
    def urgent(self) -> tuple[object, ...]:
        """Values whose change is published at once: the errors of the drives."""
        return tuple(self.parts['drive']['error'].tolist())

    def prepare_requests(self) -> None:
        """Compile the functions that the node calls between two steps."""
        super().prepare_requests()
        self.measure()
        law.advance(self.memory.record, np.int64(NO_STAMP))
        law.obey(self.parts['drive'][0], 0)
        law.raise_fault(self.parts['drive'][0], errors.ERROR_HEARTBEAT_LOST)
