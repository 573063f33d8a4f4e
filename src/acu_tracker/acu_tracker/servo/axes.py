"""The position loops of both axes of the antenna: start from the actual angles, following of the reference, rest."""
import math
from typing import TYPE_CHECKING, NamedTuple

from acu_tracker import modes
from acu_tracker.geometry.vector import Motion
from acu_tracker.modes import Mode
from acu_tracker.servo import position_loop, reference, travel
from acu_tracker.servo.position_loop import Command, Feedback, Instants
from acu_tracker.signals import Inputs, Outputs
from pedestal_common.compiled import compiled
from pedestal_common.quantities import BothAxes, Pair, RadiansPerSecond, Seconds

if TYPE_CHECKING:
    from acu_tracker.control_unit import Constants

ARRIVAL_BEAMWIDTHS = 0.25   # largest distance of an axis from the target of its mode that counts as reached
ARRIVAL_RATE_RAD_S = 2e-3   # rate below which an axis that follows no target has arrived [rad/s]


class BeamInputs(NamedTuple):
    """Inputs of the loop of an electronic beam."""
    error: Pair         # receiver error in deck angles [rad]; NaN: no error in this step
    deck_rates: tuple[RadiansPerSecond, RadiansPerSecond]   # at which the motion of the deck moves a fixed target
    closed: bool        # True if the loop is closed on the receiver error (autotrack)


@compiled
def now(axis: BothAxes[position_loop.AxisLoop]) -> Motion:
    """Return the present references of both axes."""
    return Motion(reference.now(axis[0].reference), reference.now(axis[1].reference))


@compiled
def start_from_actual(axis: BothAxes[position_loop.AxisLoop], constants: 'Constants', inputs: Inputs,
                      immobile: tuple[bool, bool], begins: bool, silence: bool) -> None:
    """Set the references to the actual angles: of both axes if they begin to move, and of an axis that cannot move.

    For an axis that cannot move (immobile) this is done in every step. This avoids a reference that runs ahead of the
    axis, which the axis would chase as soon as it can move again. silence: the last command is too old to be in force.
    """
    for i in range(2):
        rate, powerless = inputs.velocity[i], immobile[i] and not begins
        if powerless:
            rate = position_loop.realised(axis[i].command, rate)
        if silence or powerless:
            position_loop.replace_command(axis[i], rate)
        if begins or powerless:
            position_loop.initialise(axis[i], constants.axis[i].p, inputs.stamp, inputs.position[i], rate)


@compiled
def follow(axis: BothAxes[position_loop.AxisLoop], constants: 'Constants', inputs: Inputs, outputs: Outputs,
           motion: Motion, now: Instants, beam: BeamInputs) -> None:
    """Run the position loops of both axes towards a reference motion."""
    now_ends = travel.ends(constants, inputs, motion.azimuth.angle)
    for i in range(2):
        feedback = Feedback(y=inputs.position[i], dy=inputs.velocity[i], error=beam.error[i], V=beam.deck_rates[i],
                            closed=beam.closed, ends=now_ends[i])
        _write(outputs, i, position_loop.follow(axis[i], constants.axis[i], motion[i], feedback, now))


@compiled
def distance(constants: 'Constants', inputs: Inputs, motion: Motion, mode: int) -> float:
    """Return the distance of the axes from the target of a mode, in units of the largest one that counts as reached.

    This is ARRIVAL_BEAMWIDTHS, or `stow_window` in mode stow. In a mode that follows no target the axes must also
    stand.
    """
    follows, window = modes.FOLLOWS_TARGET[mode], ARRIVAL_BEAMWIDTHS * constants.p.tracker.receiver.beamwidth
    if mode == Mode.STOW:
        window = constants.p.stow_window
    scale = math.cos(motion.elevation.angle) if follows else 1.0
    farthest = max(abs(motion.azimuth.angle - inputs.position[0]) * scale,
                   abs(motion.elevation.angle - inputs.position[1])) / window
    fastest = max(abs(inputs.velocity[0]), abs(inputs.velocity[1])) / ARRIVAL_RATE_RAD_S
    return farthest if follows else max(farthest, fastest)


@compiled
def rest(axis: BothAxes[position_loop.AxisLoop], constants: 'Constants', outputs: Outputs, dt: Seconds) -> None:
    """Bring both axes to rest; dt: time since the last command."""
    for i in range(2):
        _write(outputs, i, position_loop.stop(axis[i], constants.axis[i].p, dt))


@compiled
def _write(outputs: Outputs, i: int, command: Command) -> None:
    outputs.rate[i], outputs.torque[i] = command.rate, command.torque
    outputs.reference[i, 0], outputs.reference[i, 1], outputs.reference[i, 2] = command.reference
    outputs.angle_limited[i], outputs.rate_limited[i] = command.angle_limited, command.rate_limited
    outputs.acceleration_limited[i] = command.acceleration_limited
