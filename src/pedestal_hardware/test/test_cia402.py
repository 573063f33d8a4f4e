"""State machine of CiA 402 against the tables of the package canopen, and against the transitions of the profile."""
import itertools

import pytest
from canopen.profiles import p402

from pedestal_hardware import cia402, errors
from pedestal_hardware.cia402 import State

NAMES = {'NOT READY TO SWITCH ON': State.NOT_READY_TO_SWITCH_ON, 'SWITCH ON DISABLED': State.SWITCH_ON_DISABLED,
         'READY TO SWITCH ON': State.READY_TO_SWITCH_ON, 'SWITCHED ON': State.SWITCHED_ON,
         'OPERATION ENABLED': State.OPERATION_ENABLED, 'QUICK STOP ACTIVE': State.QUICK_STOP_ACTIVE,
         'FAULT REACTION ACTIVE': State.FAULT_REACTION_ACTIVE, 'FAULT': State.FAULT}


def test_every_statusword_has_the_state_of_canopen():
    table = p402.State402.SW_MASK
    assert set(table) == set(NAMES)
    for word in range(1 << 16):
        expected = next((NAMES[name] for name, (mask, value) in table.items() if word & mask == value),
                        cia402.UNKNOWN_STATE)
        assert cia402.state(word) == expected, hex(word)


def test_104_patterns_have_no_state():
    assert sum(cia402.state(word) == cia402.UNKNOWN_STATE for word in range(128)) == 104


def test_the_statusword_of_a_state_states_this_state():
    assert [cia402.state(value) for value in cia402.STATUS_OF_STATE] == list(State)


GOAL_STATES = {cia402.GOAL_OFF: State.SWITCH_ON_DISABLED, cia402.GOAL_SWITCHED_ON: State.SWITCHED_ON,
               cia402.GOAL_ENABLED: State.OPERATION_ENABLED}


@pytest.mark.parametrize('goal, begin', list(itertools.product(GOAL_STATES, [
    State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED,
    State.QUICK_STOP_ACTIVE])))
def test_controlwords_lead_to_the_goal(goal, begin):
    now, control = begin, 0
    for _ in range(5):
        before, control = control, cia402.controlword(now, goal)
        now = cia402.successor(now, control, before)
    assert now == GOAL_STATES[goal]


def test_a_drive_is_enabled_in_three_commands():
    now = State.SWITCH_ON_DISABLED
    sent = []
    while now != State.OPERATION_ENABLED:
        sent.append(cia402.controlword(now, cia402.GOAL_ENABLED))
        now = cia402.successor(now, sent[-1], 0)
    assert sent == [0x06, 0x07, 0x0F]


@pytest.mark.parametrize('goal', range(len(cia402.GOALS)))
@pytest.mark.parametrize('now', [State.FAULT, State.FAULT_REACTION_ACTIVE, cia402.UNKNOWN_STATE])
def test_no_goal_resets_or_enables_a_faulty_drive(goal, now):
    control = cia402.controlword(now, goal)
    assert not control & (cia402.CONTROL_RESET | 8)


def test_only_a_rising_edge_resets():
    assert cia402.successor(State.FAULT, 0x80, 0x00) == State.SWITCH_ON_DISABLED
    assert cia402.successor(State.FAULT, 0x80, 0x80) == State.FAULT
    assert cia402.successor(State.FAULT, 0x0F, 0x00) == State.FAULT


def test_a_quick_stop_stays_and_can_end():
    now = cia402.successor(State.OPERATION_ENABLED, 0x02, 0x0F)
    assert now == State.QUICK_STOP_ACTIVE
    assert cia402.successor(now, 0x02, 0x02) == now
    assert cia402.successor(now, 0x0F, 0x02) == State.OPERATION_ENABLED
    assert cia402.successor(State.SWITCHED_ON, 0x02, 0x07) == State.SWITCH_ON_DISABLED


@pytest.mark.parametrize('code, text', [
    (0, ''), (0x8130, '0x8130 heartbeat lost'), (0x2310, '0x2310 continuous overcurrent'),
    (0x4299, '0x4299 temperature'), (0xFF01, '0xFF01 of the maker'),
    (0x7388, '0x7388 encoder'), (0xB000, '0xB000 unknown error')])
def test_error_codes_have_names(code, text):
    assert errors.name(code) == text
