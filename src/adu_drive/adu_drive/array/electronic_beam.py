"""Electronically steered beam of a phased array: no motors, a commanded angle is reached after a pure delay and held.

A command stamped t_k is active from the first step at or after t_k + transport delay, until the next command becomes
active. This models the delays of the beam steering computer and the array of paper 002 (section 2, figure 2). The hold
models the closed-loop period of that paper. Arguments: s state, c constants, u inputs, y outputs (records below).
"""
from typing import Annotated

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Floats, Ints, Pair
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

BEAM_RING_SIZE = 512  # largest number of commands within the delay
MAX_COMMAND_ANGLE_RAD = 1e3  # largest valid angle of a command [rad]; a command beyond it, infinite or NaN is ignored


class Constants(Record):
    """Record."""
    delay_ns: int
    timeout_ns: int


class State(Record):
    """State of a beam."""
    # ring_stamp_ns, ring_position: stamps [ns] and angles (azimuth, elevation) [rad] of the commands within the delay
    ring_stamp_ns: Annotated[Ints, (BEAM_RING_SIZE,)]
    ring_position: Annotated[Floats, (BEAM_RING_SIZE, 2)]
    written: int  # written, released: numbers of commands put into and taken out of the ring since the start
    released: int
    command_stamp_ns: int  # stamp of the newest valid command [ns]
    position: Pair  # active beam (azimuth, elevation) [rad]


class Inputs(Record):
    """Inputs of a step."""
    stamp_ns: int  # stamp t_k of the step [ns]
    due: int  # 1 if the step has a new command
    command_stamp_ns: int  # command_stamp_ns, position: stamp [ns] and beam (azimuth, elevation) [rad] of this command
    position: Pair


class Outputs(Record):
    """Outputs at t_k+1."""
    position: Pair  # active beam from t_k on (azimuth, elevation) [rad]
    stale: int  # 1 if the newest valid command was older than the timeout at t_k, or missing
    # 1 if the command of this step was invalid or not newer than the previous one; the beam stays
    invalid_command: int


def check_delay(period, transport_delay):
    """Raise ParameterError if the commands within the delay do not fit into the ring; both in s."""
    if transport_delay >= (BEAM_RING_SIZE - 1) * period:
        raise ParameterError(f'transport_delay = {transport_delay:g} s: must be below {BEAM_RING_SIZE - 1} periods of '
                             f'{period:g} s')


def constants(period, transport_delay, timeout) -> np.ndarray:
    """Return Constants (1,) for a period, a delay and the age at which a command is stale, all in s."""
    check_delay(period, transport_delay)
    return np.array([(round(transport_delay * 1e9), round(timeout * 1e9))], Constants.dtype)


def initial_state(azimuth, elevation) -> np.ndarray:
    """Return State (1,): the beam at these angles [rad], without a command."""
    s = State.zeros()
    s['position'], s['command_stamp_ns'] = (azimuth, elevation), NO_STAMP
    return s


@compiled
def receive(s, u):
    """Put the command of a step into the ring. Return True if it is valid."""
    azimuth, elevation = u.position[0], u.position[1]
    if not (abs(azimuth) <= MAX_COMMAND_ANGLE_RAD and abs(elevation) <= MAX_COMMAND_ANGLE_RAD
            and u.command_stamp_ns > s.command_stamp_ns):
        return False
    slot = s.written % BEAM_RING_SIZE
    s.ring_stamp_ns[slot] = s.command_stamp_ns = u.command_stamp_ns
    s.ring_position[slot, 0], s.ring_position[slot, 1] = azimuth, elevation
    s.written += 1
    s.released = max(s.released, s.written - BEAM_RING_SIZE)
    return True


@compiled
def release(s, c, stamp_ns):
    """Release all commands whose delay has ended at stamp_ns; the newest of them is active."""
    while s.released < s.written and s.ring_stamp_ns[s.released % BEAM_RING_SIZE] <= stamp_ns - c.delay_ns:
        slot = s.released % BEAM_RING_SIZE
        s.position[0], s.position[1] = s.ring_position[slot, 0], s.ring_position[slot, 1]
        s.released += 1


@compiled
def read(s, y):
    """Write the present outputs, for t_0 before the first step. Records State, Outputs."""
    y.position[0], y.position[1] = s.position[0], s.position[1]


@compiled
def step(s, c, u, y):
    """Advance one step from t_k to t_k+1. Records State, Constants, Inputs, Outputs.

    s and y are written.
    """
    y.invalid_command = 1 if u.due == 1 and not receive(s, u) else 0
    y.stale = 1 if s.command_stamp_ns == NO_STAMP or u.stamp_ns - s.command_stamp_ns > c.timeout_ns else 0
    release(s, c, u.stamp_ns)
    read(s, y)
