"""Settings of a drive, and a bus that was left."""
import struct

import numpy as np
import pytest

from pedestal_common import parameters
from pedestal_hardware import canopen_bus, commissioning, pdo
from pedestal_hardware.bus import BusError
from pedestal_hardware.params import ServoDriveParameters
from pedestal_hardware.unit import DRIVE_LABELS

UNIT = commissioning.RAD_S_PER_RPM * 1e-3


def made(**values):
    return parameters.build(ServoDriveParameters, values)


def value_of(rows, number, subindex=0):
    return next(row.value for row in rows if (row.number, row.subindex) == (number, subindex))


@pytest.mark.parametrize('halves', range(4, 41))
def test_the_settings_of_every_period_fit_into_their_objects(halves):
    p = made(period=halves * 5e-4)
    for drive in range(pdo.DRIVE_COUNT):
        rows = commissioning.settings(p, drive, UNIT, 5.0)
        for row in rows:
            struct.pack(f'<{row.kind}', row.value)
        period = value_of(rows, 0x60C2, 1) * 10.0 ** value_of(rows, 0x60C2, 2)
        assert period == pytest.approx(halves * 5e-4)


@pytest.mark.parametrize('control, modes, integrals', [
    ('velocity', [9, 9, 9, 9], [0, 0, 0, 0]), ('drive', [9, 10, 9, 10], [20000, 0, 10500, 0]),
    ('torque', [10, 10, 10, 10], [0, 0, 0, 0])])
def test_modes_and_integrals_of_each_control(control, modes, integrals):
    values = {'period': 1e-3, 'bus.bitrate': 2_000_000} if control == 'torque' else {}
    p = made(control=control, **values)
    rows = [commissioning.settings(p, drive, UNIT, 5.0) for drive in range(pdo.DRIVE_COUNT)]
    assert [value_of(row, 0x6060) for row in rows] == modes
    assert [value_of(row, 0x60F9, 2) for row in rows] == integrals
    assert [pdo.COMMAND_MAPPINGS[p.torque_mode(drive)][0][2][0] for drive in range(pdo.DRIVE_COUNT)] == [
        0x60B2 if mode == 9 else 0x6071 for mode in modes]


def test_a_drive_without_the_mode_of_torque_is_named():
    bus = Objects()
    bus.values[0x6502, 0] = 0x1A5
    with pytest.raises(BusError, match='object 6502: the drive has no mode cyclic synchronous torque'):
        commissioning.commission(bus, 1, made(control='drive'))


class Objects:
    """Drive that keeps each written object."""

    def __init__(self, **values):
        self.values = {(0x6502, 0): 0x3A5, (0x60A9, 0): 0x00B44700, (0x608F, 1): 4096, (0x608F, 2): 1,
                       (0x6091, 1): 1, (0x6091, 2): 1}

    def read(self, drive, index, subindex, kind):
        return self.values[index, subindex]

    def write(self, drive, index, subindex, kind, value):
        self.values[index, subindex] = value


@pytest.mark.parametrize('share', [0.5, 1.0, 2.0])
def test_the_largest_torque_is_a_share_of_the_rated_torque_of_the_drive(share):
    p, bus = made(), Objects()
    rated = share * p.azimuth.thermal.rated_torque
    bus.values[0x6076, 0] = round(rated * 1e3)
    scale = commissioning.commission(bus, 0, p)
    assert scale.torque == pytest.approx(1e-3 * rated)
    assert bus.values[0x6072, 0] * scale.torque == pytest.approx(p.azimuth.motor_1.torque_limit, rel=1e-3)


def test_a_lost_connection_is_set_to_a_fault():
    assert value_of(commissioning.settings(made(), 0, UNIT, 5.0), 0x6007) == 1


def test_a_bus_that_was_left_starts_no_drive():
    p = made()
    bus = canopen_bus.CanopenBus(p.bus, p.drives.nodes, DRIVE_LABELS, p.period)
    bus.stop()
    with pytest.raises(BusError, match='the bus is closed'):
        bus.start(0)
    reports = np.zeros(pdo.DRIVE_COUNT, pdo.REPORT_DTYPE)
    assert not bus.exchange(np.zeros(pdo.DRIVE_COUNT, pdo.COMMAND_DTYPE), reports).any()


def test_a_value_that_does_not_fit_is_an_error_of_the_bus():
    p = made()
    bus = canopen_bus.CanopenBus(p.bus, p.drives.nodes, DRIVE_LABELS, p.period)
    with pytest.raises(BusError, match='object 60C2:1'), bus._errors_named(0x60C2, 1):
        struct.pack('<B', 350)
