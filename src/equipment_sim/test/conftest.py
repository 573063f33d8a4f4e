"""Drives and node in one process, without a bus: the same units and the same clock, in simulated time."""
import numpy as np
import pytest

from drive_law import rate_drive
from equipment_sim.drives import law
from equipment_sim.drives.unit import SimulatedDrives
from pedestal_common import parameters
from pedestal_common.wire.records import NO_STAMP
from pedestal_hardware import commissioning, errors, pdo
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.unit import ServoDrives


class Rig:
    """ServoDrives with SimulatedDrives as its bus. Each step is one period.

    absent, mute: numbers of the drives that exchange nothing, and of those whose reports are lost."""

    def __init__(self, **values):
        self.p = parameters.build(ServoDriveParameters, values)
        self.drives = SimulatedDrives(self.p, ('clock',))
        self.now, self.period, self.absent = 0, round(self.p.period * 1e9), set()
        self.mute = set()
        self.signs = [-1 if getattr(getattr(self.p.drives, axis), f'reversed_{motor}') else 1
                      for axis in ('azimuth', 'elevation') for motor in (1, 2)]
        self.take_over()

    def take_over(self):
        """Begin with a new node; the drives stop as after a lost heartbeat, and its start resets them."""
        self.unit = ServoDrives(self.p, ('clock', 'acu/rate_command'))
        self.unit.bus = self
        for drive in range(pdo.DRIVE_COUNT):
            if self.now:
                law.raise_fault(self.drives.parts['drive'][drive], errors.ERROR_HEARTBEAT_LOST)
            self.commission(drive)
        self.unit.reset_drives(list(range(pdo.DRIVE_COUNT)))

    def commission(self, drive):
        """Set the drive as commissioning does by its objects."""
        d, axis = self.drives.parts['drive'][drive], self.drives.axis_of(drive)
        unit = commissioning.RAD_S_PER_RPM * 1e-3
        torque_mode = self.p.torque_mode(drive)
        d['velocity_unit'], d['mode'], d['quick_stop_code'] = unit, commissioning.mode_of(torque_mode), 6
        d['K_p'] = axis.speed_loop.proportional
        d['K_i'] = axis.speed_loop.integral if self.p.control == 'drive' and not torque_mode else 0.0
        d['ramp'] = axis.limits.deceleration * axis.gear_train.ratio * law.SPEED_LOOP_PERIOD_S
        self.unit.use_drive(drive, commissioning.Scale(2.0 * np.pi / 2.0 ** axis.encoder.motor_bits, unit,
                                                       1e-3 * axis.thermal.rated_torque))

    def exchange(self, commands, reports):
        """The call of the bus."""
        law.advance(self.drives.memory.record, self.now)
        measured = self.drives.measure()
        here, heard = (np.array([drive not in lost for drive in range(pdo.DRIVE_COUNT)])
                       for lost in (self.absent, self.absent | self.mute))
        for drive in np.flatnonzero(here):
            for name in pdo.REPORT_FIELDS if heard[drive] else ():
                sign = self.signs[drive] if name in ('velocity', 'torque', 'position') else 1
                reports[name][drive] = sign * measured[name][drive]
            d, sign = self.drives.parts['drive'][drive], self.signs[drive]
            torque = 'target_torque' if self.p.torque_mode(drive) else 'torque_offset'
            d['target'], d[torque] = sign * commands['velocity'][drive], sign * commands['torque'][drive]
            law.obey(d, int(commands['controlword'][drive]))
        return heard

    def step(self, rates=(0.0, 0.0), torques=(0.0, 0.0)):
        """Make a step with a command; None: no command arrives. Return the outputs of the unit."""
        command = self.unit.inputs[0][rate_drive.RATE_COMMAND_TOPIC]
        command['stamp'] = self.now - self.period if rates is not None else NO_STAMP
        if rates is not None:
            command['velocity'], command['effort'] = rates, torques
        self.unit.step(np.array([self.now]), self.unit.inputs, self.unit.outputs)
        self.now += self.period
        return self.unit.outputs[0]

    def run(self, seconds, rates=(0.0, 0.0)):
        """Make the steps of a time."""
        for _ in range(round(seconds / self.p.period)):
            self.step(rates)

    @property
    def state(self):
        """Text of adu/state."""
        return self.unit.condition

    @property
    def truth(self):
        """True angles of the axes [rad]."""
        return np.array([self.drives.parts['state'][axis]['theta'] for axis in ('azimuth', 'elevation')])


@pytest.fixture
def rig():
    """Function that makes a Rig."""
    return Rig
