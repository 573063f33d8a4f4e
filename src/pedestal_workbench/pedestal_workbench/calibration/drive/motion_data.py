"""Motion of one axis in a recording: angles, rates and accelerations of load and motors, and their torques.

All numbers pass through one Gaussian filter, whose derivatives give rates and accelerations. Because the equations of
motion are linear in these numbers, equal filters on both sides leave the estimates right.
"""
import dataclasses

import numpy as np
from scipy.ndimage import gaussian_filter1d

from drive_law.axis_params import AxisParameters
from pedestal_common.quantities import Floats, Pairs, Seconds, Times
from pedestal_recording import recording as recordings
from pedestal_recording.recording import Recording
from pedestal_workbench.calibration.calibration import CalibrationError

SMOOTHING_S = 0.012  # standard deviation of the Gaussian of the smoothing filter [s]
MOVING_RATE_RAD_S = 2e-4  # least rate of a moving axis [rad/s]


@dataclasses.dataclass(frozen=True)
class Motion:
    """Motion of one axis over n steps, after the smoothing filter."""
    t: Times
    theta: Floats               # angle (n,) by the load encoder [rad]
    v: Floats                   # its rate [rad/s]
    a: Floats                   # its acceleration [rad/s2]
    motor_angle: Pairs          # of both motors on the load axis, by the motor encoders [rad]
    motor_rate: Pairs           # of both motors on the motor shaft [rad/s]
    motor_acceleration: Pairs   # the same [rad/s2]
    motor_torque: Pairs         # of both motors on the motor shaft [Nm]

    @property
    def period(self) -> Seconds:
        """Time from a step to the next."""
        return float(np.median(np.diff(self.t)))

    def mesh_torque(self, axis: AxisParameters) -> Pairs:
        """Return the torques [Nm] on the motor shaft that the gears get, less inertia and friction of the motors."""
        motors = axis.motor_1, axis.motor_2
        return np.column_stack([
            self.motor_torque[:, k] - m.inertia * self.motor_acceleration[:, k]
            - m.friction * np.tanh(self.motor_rate[:, k] / m.friction_speed) - m.viscous * self.motor_rate[:, k]
            for k, m in enumerate(motors)])

    def load_torque(self, axis: AxisParameters) -> Floats:
        """Return the torque (n,) [Nm] of both gears on the load."""
        return axis.gear_train.ratio * self.mesh_torque(axis).sum(1)


def read(bag: Recording, name: str, axis: AxisParameters) -> Motion:
    """Return the motion of the axis `name` in a recording. Raises CalibrationError."""
    if missing := recordings.missing(bag, 'joint_states', 'adu/motor_states'):
        raise CalibrationError(f'the recording holds no {missing}')
    joints = bag.table('joint_states')
    t = joints['t']
    columns = [f'{name}_motor_{k}.{column}' for column in ('position', 'effort') for k in (1, 2)]
    motors = recordings.at(bag, t, 'adu/motor_states', columns)
    theta = joints[f'{name}.position']
    if not (np.isfinite(motors).all() and np.isfinite(theta).all()):
        at = t[~(np.isfinite(motors).all(1) & np.isfinite(theta))][0]
        raise CalibrationError(f'{name}: an angle or a torque is missing or NaN at {at:.3f} s')
    return smoothed(t, theta, motors, axis.gear_train.ratio)


def smoothed(t: Times, theta: Floats, motors: Floats, ratio: float) -> Motion:
    """Return the motion of an axis from its raw numbers. Raises CalibrationError for missing steps.

    theta: load encoder [rad]; motors (n, 4): angles [rad] and torques [Nm] of motors 1 and 2 on the motor shaft;
    ratio: turns of the motor per turn of the axis.
    """
    period = float(np.median(np.diff(t)))
    if not np.allclose(np.diff(t), period, rtol=0.0, atol=0.1 * period):
        raise CalibrationError(f'the steps of the recording are not {period:g} s apart; steps are missing')
    smooth = gaussian_filter1d(np.column_stack((theta, motors)), SMOOTHING_S / period, axis=0, mode='nearest')
    # Central differences: those of a straight line and of a parabola are exact, whatever the angle is.
    rate, acceleration = np.zeros_like(smooth[:, :3]), np.zeros_like(smooth[:, :3])
    later, now, before = smooth[2:, :3], smooth[1:-1, :3], smooth[:-2, :3]
    rate[1:-1], acceleration[1:-1] = 0.5 * (later - before) / period, (later - 2.0 * now + before) / period**2
    return Motion(t, smooth[:, 0], rate[:, 0], acceleration[:, 0], smooth[:, 1:3] / ratio, rate[:, 1:],
                  acceleration[:, 1:], smooth[:, 3:])
