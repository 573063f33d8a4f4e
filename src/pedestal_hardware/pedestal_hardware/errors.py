"""Error codes of drives (object 603F, emergency messages): their names, and the faults that follow from them.

The codes are those of CiA 301, CiA 402 and the firmware specification of EPOS4. A code that has no name here belongs
to a class, which its first digit states.
"""
from drive_law import faults
from pedestal_common.compiled import compiled

ERROR_HEARTBEAT_LOST = 0x8130

ERROR_NAMES = {
    0x2310: 'continuous overcurrent', 0x2320: 'short circuit or earth leakage', 0x2330: 'earth leakage',
    0x2350: 'I2t of the motor', 0x3110: 'mains overvoltage', 0x3120: 'mains undervoltage', 0x3130: 'phase lost',
    0x3210: 'DC link overvoltage', 0x3220: 'DC link undervoltage', 0x4210: 'overtemperature of the device',
    0x4310: 'overtemperature of the drive', 0x4380: 'overtemperature of the motor', 0x5113: 'logic supply low',
    0x6320: 'invalid parameter', 0x7121: 'motor blocked', 0x7122: 'commutation', 0x7305: 'encoder 1',
    0x7306: 'encoder 2', 0x7320: 'position sensor', 0x8110: 'CAN overrun', 0x8120: 'CAN passive',
    ERROR_HEARTBEAT_LOST: 'heartbeat lost', 0x8140: 'back from bus off', 0x8150: 'COB-ID collision',
    0x8180: 'EtherCAT link lost', 0x8210: 'PDO not processed: wrong length', 0x8250: 'RPDO time-out',
    0x8311: 'excess torque', 0x8400: 'speed control', 0x8611: 'following error', 0x8612: 'reference limit',
    0x8700: 'synchronisation'}

CLASS_NAMES = ('', 'generic error', 'current', 'voltage', 'temperature', 'hardware', 'software', 'additional module',
               'monitoring', 'external error')
"""Names of the classes of error codes, by the first digit of the code."""

MAKER_CODE_MIN = 0xFF00  # smallest of the codes that each maker defines


def name(code: int) -> str:
    """Return the text of an error code, such as `0x8130 heartbeat lost`; '' for code 0."""
    if not code:
        return ''
    if code >= MAKER_CODE_MIN:
        return f'0x{code:04X} of the maker'
    if 0x7380 <= code <= 0x738F:
        return f'0x{code:04X} encoder'
    digit = code >> 12
    return f'0x{code:04X} ' + (ERROR_NAMES.get(code) or (CLASS_NAMES[digit] if digit < len(CLASS_NAMES) else
                                                         'unknown error'))


@compiled
def is_of_the_bus(code: int) -> bool:
    """Return True if a drive has such an error because the bus or its master was absent. A start clears it."""
    return code & 0xFF00 == 0x8100 or code == 0x8250


@compiled
def fault_of(code: int, motor: int) -> int:
    """Return the fault word of an axis for the error code of its drive `motor` (0 or 1)."""
    if code == 0x2350 or code & 0xF000 == 0x4000:
        return faults.Bit.OVERTEMPERATURE
    if code & 0xF000 == 0x2000:
        return faults.Bit.OVERCURRENT
    if code & 0xFF00 == 0x7300:
        return faults.Bit.ENCODER_DISAGREEMENT
    if code == 0x8611 or code == 0x8400:
        return faults.Bit.FOLLOWING_ERROR
    return faults.Bit.MOTOR_1_LOST if motor == 0 else faults.Bit.MOTOR_2_LOST
