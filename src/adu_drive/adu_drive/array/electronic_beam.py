"""The electronically steered beam of a phased array: no motors, it goes where it is told after a pure delay and stays.

A command stamped t_k is in force from the first step at or after t_k + transport delay on, until the next one is: the
delays of paper 002's beam steering computer and array (section 2, figure 2) and the hold of its closed-loop period.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.parameters import ParameterError
from pedestal_common.wire.records import NO_STAMP

BEAM_RING_SIZE = 512
"""Commands that can be on their way at once."""

MAX_COMMAND_ANGLE_RAD = 1e3
"""Angles beyond this [rad], infinite or NaN are not believed."""

CONSTANTS_DTYPE = np.dtype([('delay_ns', 'i8'), ('timeout_ns', 'i8')], align=True)

STATE_DTYPE = np.dtype([('ring_stamp_ns', 'i8', (BEAM_RING_SIZE,)), ('ring_position', 'f8', (BEAM_RING_SIZE, 2)),
                        ('written', 'i8'),
                        ('released', 'i8'), ('command_stamp_ns', 'i8'), ('position', 'f8', (2,))], align=True)
"""written, released: commands put into the ring and taken from it since the start; command_stamp_ns: of the newest
that was believed; position: the beam in force (azimuth, elevation) [rad]."""

INPUTS_DTYPE = np.dtype([('stamp_ns', 'i8'), ('due', 'i8'), ('command_stamp_ns', 'i8'), ('position', 'f8', (2,))],
                        align=True)
"""Stamp t_k of the step [ns]; due 1: a command came, with its stamp and its beam (azimuth, elevation) [rad]."""

OUTPUTS_DTYPE = np.dtype([('position', 'f8', (2,)), ('stale', 'i8'), ('invalid_command', 'i8')], align=True)
"""At t_k+1: the beam that was in force from t_k on (azimuth, elevation) [rad]; stale 1: the newest believed command
was older than the timeout at t_k, or there was none; invalid_command 1: the command of this step was no angle or not
newer than the one before. The beam stays then."""


def check_delay(period, transport_delay):
    """Raises ParameterError where the commands on their way do not fit into the ring; both in s."""
    if transport_delay >= (BEAM_RING_SIZE - 1) * period:
        raise ParameterError(f'transport_delay = {transport_delay:g} s: must be below {BEAM_RING_SIZE - 1} periods of '
                             f'{period:g} s')


def constants(period, transport_delay, timeout) -> np.ndarray:
    """CONSTANTS_DTYPE (1,) of a step `period` [s], a delay [s] and the age [s] at which a command is stale."""
    check_delay(period, transport_delay)
    return np.array([(round(transport_delay * 1e9), round(timeout * 1e9))], CONSTANTS_DTYPE)


def initial_state(azimuth, elevation) -> np.ndarray:
    """STATE_DTYPE (1,): the beam at these angles [rad], no command yet."""
    s = np.zeros(1, STATE_DTYPE)
    s['position'], s['command_stamp_ns'] = (azimuth, elevation), NO_STAMP
    return s


@compiled
def receive(s, u):
    """Put the command of a step into the ring; whether it was to be believed."""
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
    """Bring every command into force whose delay is over at stamp_ns; the newest of them holds."""
    while s.released < s.written and s.ring_stamp_ns[s.released % BEAM_RING_SIZE] <= stamp_ns - c.delay_ns:
        slot = s.released % BEAM_RING_SIZE
        s.position[0], s.position[1] = s.ring_position[slot, 0], s.ring_position[slot, 1]
        s.released += 1


@compiled
def read(s, y):
    """Outputs as they are now: at t_0, before the first step. Records STATE_DTYPE, OUTPUTS_DTYPE."""
    y.position[0], y.position[1] = s.position[0], s.position[1]


@compiled
def step(s, c, u, y):
    """One step from t_k to t_k+1. Records STATE_DTYPE, CONSTANTS_DTYPE, INPUTS_DTYPE, OUTPUTS_DTYPE; s and y are
    written."""
    y.invalid_command = 1 if u.due == 1 and not receive(s, u) else 0
    y.stale = 1 if s.command_stamp_ns == NO_STAMP or u.stamp_ns - s.command_stamp_ns > c.timeout_ns else 0
    release(s, c, u.stamp_ns)
    read(s, y)
