"""The position loops of both axes of the antenna: start from the actual angles, following of the reference, rest.

axis     records (2,) of position_loop.AxisLoop
c, u, o  records of control_unit.Constants, of signals.Inputs.dtype and of signals.Outputs
"""
from collections import namedtuple

from acu_tracker.geometry.motion import Motion
from acu_tracker.servo import floor, position_loop, reference
from acu_tracker.servo.position_loop import Feedback
from pedestal_common.compiled import compiled

BeamInputs = namedtuple('BeamInputs', 'error deck_rates closed')
"""Inputs of the loop of an electronic beam.

error       receiver error (2,) in deck angles [rad]; NaN: no error in this step
deck_rates  rates at which the motion of the deck moves a fixed target [rad/s], of each axis
closed      True if the loop is closed on the receiver error (autotrack)
"""


@compiled
def now(axis):
    """Return the present references of both axes, a Motion."""
    return Motion(reference.now(axis[0].reference), reference.now(axis[1].reference))


@compiled
def start_from_actual(axis, c, u, immobile, begins, silence):
    """Set the references to the actual angles: of both axes if they begin to move, and of an axis that cannot move.

    For an axis that cannot move this is done in every step. This avoids a reference that runs ahead of the axis, which
    the axis would chase as soon as it can move again.

    immobile  True for each axis that does not follow its commands
    begins    True if the axes begin to move
    silence   True if the last command is too old to be in force
    """
    for i in range(2):
        rate, powerless = u.velocity[i], immobile[i] and not begins
        if powerless:
            rate = position_loop.realised(axis[i].command, rate)
        if silence or powerless:
            position_loop.replace_command(axis[i], rate)
        if begins or powerless:
            position_loop.initialise(axis[i], c.axis[i].p, u.stamp, u.position[i], rate)


@compiled
def follow(axis, c, u, o, motion, now, beam):
    """Run the position loops of both axes towards a reference Motion; now: the Instants; beam: the BeamInputs."""
    now_ends = floor.ends(c, u, motion.azimuth.angle)
    for i in range(2):
        feedback = Feedback(y=u.position[i], dy=u.velocity[i], error=beam.error[i], V=beam.deck_rates[i],
                            closed=beam.closed, ends=now_ends[i])
        _write(o, i, position_loop.follow(axis[i], c.axis[i], motion[i], feedback, now))


@compiled
def rest(axis, c, o, dt):
    """Bring both axes to rest; dt [s]: time since the last command."""
    for i in range(2):
        _write(o, i, position_loop.stop(axis[i], c.axis[i].p, dt))


@compiled
def _write(o, i, command):
    """Write the Command of axis i to the outputs."""
    o.rate[i], o.torque[i] = command.rate, command.torque
    o.reference[i, 0], o.reference[i, 1], o.reference[i, 2] = command.reference
    o.angle_limited[i], o.rate_limited[i] = command.angle_limited, command.rate_limited
    o.acceleration_limited[i] = command.acceleration_limited
