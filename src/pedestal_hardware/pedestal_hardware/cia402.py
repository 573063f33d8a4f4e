"""State machine of a drive by CiA 402 (IEC 61800-7-201): states in the statusword (object 6041), commands in the
controlword (6040). Only the state machines of this module know their bits."""
from pedestal_common.codes import codes
from pedestal_common.compiled import compiled

STATE_PATTERNS = (('not ready to switch on', 0x4F, 0x00), ('switch on disabled', 0x4F, 0x40),
                  ('ready to switch on', 0x6F, 0x21), ('switched on', 0x6F, 0x23), ('operation enabled', 0x6F, 0x27),
                  ('quick stop active', 0x6F, 0x07), ('fault reaction active', 0x4F, 0x0F), ('fault', 0x4F, 0x08))
"""(state, mask, value): the drive is in the state if the statusword under the mask has the value."""

STATE_NAMES = tuple(name for name, _, _ in STATE_PATTERNS)
State = codes(STATE_NAMES)
_PATTERNS = tuple((mask, value) for _, mask, value in STATE_PATTERNS)
UNKNOWN_STATE = len(STATE_NAMES)
"""Code of a statusword that no state has; 104 of the 128 patterns of its low seven bits."""

OFF_STATES = (State.NOT_READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.FAULT)
"""States without torque, in which a drive needs no command to stay off."""

STATUS_OF_STATE = tuple(value for _, _, value in STATE_PATTERNS)
"""Statusword of each state, without the bits that do not belong to the state."""

STATUS_VOLTAGE, STATUS_REMOTE, STATUS_LIMIT, STATUS_FOLLOWS = 1 << 4, 1 << 9, 1 << 11, 1 << 12
"""Bits of the statusword: supply voltage present; controlword obeyed; an internal limit acts; in the modes of cyclic
set-points: the drive follows them."""

COMMAND_DISABLE_VOLTAGE, COMMAND_QUICK_STOP, COMMAND_SHUTDOWN, COMMAND_SWITCH_ON, COMMAND_ENABLE = 0, 2, 6, 7, 15
CONTROL_HALT, CONTROL_RESET = 1 << 8, 1 << 7
"""Bits of the controlword: ramp to standstill and hold; a rising edge resets a fault."""

GOALS = ('off', 'switched on', 'enabled', 'quick stop')
GOAL_OFF, GOAL_SWITCHED_ON, GOAL_ENABLED, GOAL_QUICK_STOP = range(len(GOALS))
"""States to which `controlword` leads a drive."""


@compiled
def state(status: int) -> int:
    """Return the code of the state in a statusword, UNKNOWN_STATE for a pattern that no state has."""
    for code, (mask, value) in enumerate(_PATTERNS):
        if status & mask == value:
            return code
    return UNKNOWN_STATE


@compiled
def controlword(now: int, goal: int) -> int:
    """Return the controlword that leads a drive in the state `now` one transition nearer to a goal. It resets no
    fault."""
    if now == State.FAULT or now == State.FAULT_REACTION_ACTIVE or goal == GOAL_OFF:
        return COMMAND_DISABLE_VOLTAGE
    if goal == GOAL_QUICK_STOP:
        moving = now == State.OPERATION_ENABLED or now == State.QUICK_STOP_ACTIVE
        return COMMAND_QUICK_STOP if moving else COMMAND_DISABLE_VOLTAGE
    if now == State.SWITCH_ON_DISABLED:
        return COMMAND_SHUTDOWN
    if now == State.READY_TO_SWITCH_ON or (now == State.SWITCHED_ON or now == State.OPERATION_ENABLED) and (
            goal == GOAL_SWITCHED_ON):
        return COMMAND_SWITCH_ON
    if now == State.SWITCHED_ON or now == State.OPERATION_ENABLED:
        return COMMAND_ENABLE
    if now == State.QUICK_STOP_ACTIVE:
        # Transition 16: the motor holds the axis at standstill until the brake grips.
        return COMMAND_ENABLE | CONTROL_HALT
    return COMMAND_DISABLE_VOLTAGE


@compiled
def successor(now: int, control: int, before: int) -> int:
    """Return the state of a drive after a controlword, by transitions 2 to 12, 15 and 16. before: previous one."""
    if now == State.FAULT:
        rising = control & CONTROL_RESET and not before & CONTROL_RESET
        return State.SWITCH_ON_DISABLED if rising else now
    if now == State.NOT_READY_TO_SWITCH_ON or now == State.FAULT_REACTION_ACTIVE:
        return now
    if not control & 2:
        return State.SWITCH_ON_DISABLED
    if not control & 4:
        moving = now == State.OPERATION_ENABLED or now == State.QUICK_STOP_ACTIVE
        return State.QUICK_STOP_ACTIVE if moving else State.SWITCH_ON_DISABLED
    low = control & 0xF
    if now == State.QUICK_STOP_ACTIVE:
        return State.OPERATION_ENABLED if low == COMMAND_ENABLE else now
    if now == State.SWITCH_ON_DISABLED:
        return State.READY_TO_SWITCH_ON if low & 7 == COMMAND_SHUTDOWN else now
    if low & 7 == COMMAND_SHUTDOWN:
        return State.READY_TO_SWITCH_ON
    if now == State.READY_TO_SWITCH_ON:
        return State.SWITCHED_ON    # a drive makes the transitions 3 and 4 one after the other
    return State.OPERATION_ENABLED if low == COMMAND_ENABLE else State.SWITCHED_ON
