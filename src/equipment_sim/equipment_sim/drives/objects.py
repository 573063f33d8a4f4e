"""Object dictionary of a simulated drive, built in code, without a file of any maker."""
from collections.abc import Iterable

from canopen import objectdictionary as od

from equipment_sim.drives.law import ENCODER_TURNS

READ_ONLY, WRITABLE = 'ro', 'rw'

ERROR_OBJECT, SILENCE_OBJECT = (0x2F00, 1), (0x2F00, 2)
"""Objects of the simulated drives alone, for rehearsals: a written error code becomes a fault of the drive; a written
time [ms] takes the drive off the bus, and its supply too."""

VARIABLES = (
    (0x1001, 'error register', od.UNSIGNED8, READ_ONLY, 0), (0x1005, 'COB-ID SYNC', od.UNSIGNED32, WRITABLE, 0x80),
    (0x1006, 'communication cycle period', od.UNSIGNED32, WRITABLE, 0),
    (0x1017, 'producer heartbeat time', od.UNSIGNED16, WRITABLE, 0),
    (0x6007, 'abort connection option code', od.INTEGER16, WRITABLE, 1),
    (0x603F, 'error code', od.UNSIGNED16, READ_ONLY, 0), (0x6040, 'controlword', od.UNSIGNED16, WRITABLE, 0),
    (0x6041, 'statusword', od.UNSIGNED16, READ_ONLY, 0), (0x605A, 'quick stop option code', od.INTEGER16, WRITABLE, 2),
    (0x605B, 'shutdown option code', od.INTEGER16, WRITABLE, 0),
    (0x605C, 'disable operation option code', od.INTEGER16, WRITABLE, 1),
    (0x605D, 'halt option code', od.INTEGER16, WRITABLE, 1),
    (0x605E, 'fault reaction option code', od.INTEGER16, WRITABLE, 2),
    (0x6060, 'modes of operation', od.INTEGER8, WRITABLE, 0),
    (0x6061, 'modes of operation display', od.INTEGER8, READ_ONLY, 0),
    (0x6064, 'position actual value', od.INTEGER32, READ_ONLY, 0),
    (0x606C, 'velocity actual value', od.INTEGER32, READ_ONLY, 0),
    (0x6071, 'target torque', od.INTEGER16, WRITABLE, 0), (0x6072, 'max torque', od.UNSIGNED16, WRITABLE, 3000),
    (0x6076, 'motor rated torque', od.UNSIGNED32, READ_ONLY, 0),
    (0x6077, 'torque actual value', od.INTEGER16, READ_ONLY, 0),
    (0x6085, 'quick stop deceleration', od.UNSIGNED32, WRITABLE, 10_000),
    (0x60A9, 'SI unit velocity', od.UNSIGNED32, WRITABLE, 0x00B44700),
    (0x60B1, 'velocity offset', od.INTEGER32, WRITABLE, 0), (0x60B2, 'torque offset', od.INTEGER16, WRITABLE, 0),
    (0x60FD, 'digital inputs', od.UNSIGNED32, READ_ONLY, 0), (0x60FF, 'target velocity', od.INTEGER32, WRITABLE, 0),
    (0x6502, 'supported drive modes', od.UNSIGNED32, READ_ONLY, 0x3A5))
"""(index, name, type, access, default) of the objects without subindices."""

RECORDS = (
    (0x1016, 'consumer heartbeat time', ((od.UNSIGNED32, 0),), WRITABLE),
    (0x2F00, 'rehearsal', ((od.UNSIGNED16, 0), (od.UNSIGNED16, 0)), WRITABLE),
    (0x608F, 'position encoder resolution', ((od.UNSIGNED32, 0), (od.UNSIGNED32, ENCODER_TURNS)), READ_ONLY),
    (0x6091, 'gear ratio', ((od.UNSIGNED32, 1), (od.UNSIGNED32, 1)), WRITABLE),
    (0x60C2, 'interpolation time period', ((od.UNSIGNED8, 1), (od.INTEGER8, -3)), WRITABLE),
    (0x60E4, 'additional position actual value', ((od.INTEGER32, 0), (od.INTEGER32, 0)), READ_ONLY),
    (0x60F9, 'velocity control parameters', ((od.UNSIGNED16, 0), (od.UNSIGNED16, 0)), WRITABLE))
"""(index, name, ((type, default) of each subindex from 1 on), access) of the objects with subindices."""

PDO_COUNT, MAX_MAPPED_OBJECTS = 4, 8


def _variable(index: int, subindex: int, name: str, kind: int, access: str, default: int) -> od.ODVariable:
    entry = od.ODVariable(name, index, subindex)
    entry.data_type, entry.access_type, entry.default = kind, access, default
    return entry


def _record(index: int, name: str, members: Iterable[tuple[int, int, str, int]]) -> od.ODRecord:
    """Return a record; members: [(subindex, type, access, default)] from subindex 0 on."""
    record = od.ODRecord(name, index)
    for subindex, kind, access, default in members:
        record.add_member(_variable(index, subindex, f'{name} {subindex}', kind, access, default))
    return record


def dictionary(node: int, profile: int) -> od.ObjectDictionary:
    """Return the object dictionary of a CANopen node. profile: number in its device type (1000)."""
    found = od.ObjectDictionary()
    found.node_id = node
    found.add_object(_variable(0x1000, 0, 'device type', od.UNSIGNED32, READ_ONLY, 2 << 16 | profile))
    found.add_object(_variable(0x1014, 0, 'COB-ID EMCY', od.UNSIGNED32, READ_ONLY, 0x80 + node))
    for index, name, kind, access, default in VARIABLES:
        found.add_object(_variable(index, 0, name, kind, access, default))
    for index, name, members, access in RECORDS:
        found.add_object(_record(index, name, [(0, od.UNSIGNED8, READ_ONLY, len(members)), *(
            (subindex, kind, access, default) for subindex, (kind, default) in enumerate(members, 1))]))
    for base, cob in ((0x1400, 0x200), (0x1800, 0x180)):
        for k in range(PDO_COUNT):
            found.add_object(_record(base + k, f'PDO {k + 1} communication', (
                (0, od.UNSIGNED8, READ_ONLY, 5), (1, od.UNSIGNED32, WRITABLE, 1 << 31 | cob + 0x100 * k + node),
                (2, od.UNSIGNED8, WRITABLE, 255), (3, od.UNSIGNED16, WRITABLE, 0), (5, od.UNSIGNED16, WRITABLE, 0))))
            found.add_object(_record(base + 0x200 + k, f'PDO {k + 1} mapping', (
                (0, od.UNSIGNED8, WRITABLE, 0), *((subindex, od.UNSIGNED32, WRITABLE, 0)
                                                  for subindex in range(1, MAX_MAPPED_OBJECTS + 1)))))
    return found
