"""Numbers that drives and node exchange once a period, as the bytes of their process data objects (PDO).

The records are packed and little-endian, so a PDO is a part of the bytes of a record. The mapping of a drive is the
list of its objects, (index, subindex, bits), in the order of the record.
"""
from typing import TypeAlias

import numpy as np

Mapping: TypeAlias = tuple[tuple[int, int, int], ...]    # (index, subindex, bits) of each object in a PDO

DRIVE_COUNT = 4  # number of drives of an antenna: two on each of two axes

# Records declare numbers of eight bytes; the sizes of these are those of the objects of a drive.
COMMAND_DTYPE = np.dtype([
    ('controlword', '<u2'),
    ('velocity', '<i4'),        # target velocity, in units of the drive
    ('torque', '<i2')])         # torque offset, in the mode of torque the target torque, in units of the drive
"""Command to a drive."""

_REPORT = (
    ('status', '<u2'),          # statusword
    ('velocity', '<i4'),        # actual velocity
    ('torque', '<i2'),          # actual torque
    ('position', '<i4'),        # of the motor
    ('error', '<u2'),           # error code
    ('mode', '<i1'),            # mode of operation
    ('load', '<i4'),            # position of the load encoder
    ('inputs', '<u4'))          # digital inputs
REPORT_FIELDS = tuple(name for name, _ in _REPORT)
REPORT_DTYPE = np.dtype(list(_REPORT))
"""Report of a drive."""
REPORT_OFFSETS = {name: sum(np.dtype(kind).itemsize for _, kind in _REPORT[:k])
                  for k, (name, _) in enumerate(_REPORT)}
"""{field: its first byte in the record of a report}."""

TORQUE_OFFSET, TARGET_TORQUE = (0x60B2, 0, 16), (0x6071, 0, 16)
COMMAND_MAPPINGS = {torque_mode: (((0x6040, 0, 16), (0x60FF, 0, 32), TARGET_TORQUE if torque_mode else TORQUE_OFFSET),)
                    for torque_mode in (False, True)}
"""{True for a drive in the mode of torque: PDO that it receives}."""

REPORT_MAPPING = (((0x6041, 0, 16), (0x606C, 0, 32), (0x6077, 0, 16)),
                  ((0x6064, 0, 32), (0x603F, 0, 16), (0x6061, 0, 8)),
                  ((0x60E4, 2, 32), (0x60FD, 0, 32)))
"""PDO that a drive sends. Only the drive of motor 1 of each axis sends the last one."""

BITS_PER_BYTE = 8


def pdo_bytes(mapping: Mapping) -> int:
    """Return the number of bytes of a PDO."""
    return sum(bits for _, _, bits in mapping) // BITS_PER_BYTE


REPORT_PARTS = tuple((sum(map(pdo_bytes, REPORT_MAPPING[:k])), pdo_bytes(REPORT_MAPPING[k]))
                     for k in range(len(REPORT_MAPPING)))
"""(first byte, number of bytes) of each PDO in the record of a report."""


def reports_of(drive: int) -> range:
    """Return the numbers of the PDOs that a drive sends."""
    return range(len(REPORT_MAPPING) if drive % 2 == 0 else len(REPORT_MAPPING) - 1)
