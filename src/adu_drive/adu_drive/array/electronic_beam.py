"""Electronically steered beam of a phased array: no motors, a commanded angle is reached after a pure delay and held.

A command stamped t_k is active from the first step at or after t_k + transport delay, until the next command becomes
active. This models the delays of the beam steering computer and the array of Jia 2025 (section 2, figure 2). The hold
models the closed-loop period of that paper.
"""
from typing import Annotated

from adu_drive.array.params import BEAM_RING_SIZE, check_delay
from pedestal_common import ring
from pedestal_common.compiled import compiled
from pedestal_common.quantities import Bit, Floats, Ints, Nanoseconds, Pair, Radians, Records, Seconds
from pedestal_common.record import Record
from pedestal_common.wire.records import NO_STAMP

MAX_COMMAND_ANGLE_RAD = 1e3  # largest valid angle of a command [rad]; a command beyond it, infinite or NaN is ignored


class Constants(Record):
    """Times of a beam."""
    delay_ns: Nanoseconds           # transport delay
    timeout_ns: Nanoseconds         # age at which a command is stale


class State(Record):
    """State of a beam. A beam has an azimuth and an elevation."""
    ring_stamp_ns: Annotated[Ints, (BEAM_RING_SIZE,)]       # stamps [ns] of the commands within the delay
    ring_position: Annotated[Floats, (BEAM_RING_SIZE, 2)]   # their beams [rad]
    written: int                    # number of commands put into the ring since the start
    released: int                   # number of those taken out
    command_stamp_ns: Nanoseconds   # of the newest valid command
    position: Pair                  # active beam [rad]


class Inputs(Record):
    """Inputs of a step."""
    stamp_ns: Nanoseconds           # t_k of the step
    due: Bit                        # 1 if the step has a new command
    command_stamp_ns: Nanoseconds   # of this command
    position: Pair                  # its beam [rad]


class Outputs(Record):
    """Outputs at t_k+1."""
    position: Pair                  # active beam from t_k on [rad]
    stale: Bit                      # 1 if the newest valid command was older than the timeout at t_k, or missing
    # 1 if the command of this step was invalid or not newer than the previous one; the beam stays
    invalid_command: Bit


def constants(period: Seconds, transport_delay: Seconds, timeout: Seconds) -> Records:
    """Return the Constants (1,)."""
    check_delay(period, transport_delay)
    return Constants.of(delay_ns=round(transport_delay * 1e9), timeout_ns=round(timeout * 1e9))


def initial_state(azimuth: Radians, elevation: Radians) -> Records:
    """Return the State (1,) without a command."""
    return State.of(position=(azimuth, elevation), command_stamp_ns=NO_STAMP)


@compiled
def receive(beam: State, inputs: Inputs) -> bool:
    """Put the command of a step into the ring. Return True if it is valid."""
    azimuth, elevation = inputs.position[0], inputs.position[1]
    if not (abs(azimuth) <= MAX_COMMAND_ANGLE_RAD and abs(elevation) <= MAX_COMMAND_ANGLE_RAD
            and inputs.command_stamp_ns > beam.command_stamp_ns):
        return False
    beam.command_stamp_ns = inputs.command_stamp_ns
    slot = ring.put(beam, inputs.command_stamp_ns)
    beam.ring_position[slot, 0], beam.ring_position[slot, 1] = azimuth, elevation
    return True


@compiled
def release(beam: State, constants: Constants, stamp_ns: Nanoseconds) -> None:
    """Release all commands whose delay has ended; the newest of them is active."""
    slot = ring.release(beam, stamp_ns - constants.delay_ns)
    if slot != ring.NONE_DUE:
        beam.position[0], beam.position[1] = beam.ring_position[slot, 0], beam.ring_position[slot, 1]


@compiled
def read(beam: State, outputs: Outputs) -> None:
    """Write the present outputs, for t_0 before the first step."""
    outputs.position[0], outputs.position[1] = beam.position[0], beam.position[1]


@compiled
def step(beam: State, constants: Constants, inputs: Inputs, outputs: Outputs) -> None:
    """Advance one step from t_k to t_k+1."""
    outputs.invalid_command = 1 if inputs.due == 1 and not receive(beam, inputs) else 0
    outputs.stale = 1 if (beam.command_stamp_ns == NO_STAMP
                          or inputs.stamp_ns - beam.command_stamp_ns > constants.timeout_ns) else 0
    release(beam, constants, inputs.stamp_ns)
    read(beam, outputs)
