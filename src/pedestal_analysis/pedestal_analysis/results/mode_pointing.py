"""Pointing error in the modes that follow a direction without the receiver's errors.

In `program`, `tle` and `steptrack` the direction is that of the true target. In `preset` it is the requested deck
angle, which is the reference of the position loop while that stands. The slew to the direction is left out: the part
begins when the error has moved by less than MAX_DRIFT beamwidths per second for SETTLING_TIME_S. Because step track
moves the beam on purpose, its part begins HANDOVER_SETTLING_S after the mode.
"""
import numpy as np

from pedestal_analysis.results import tracking
from pedestal_analysis.results.tracking import DEG_PER_RAD

FOLLOWING_MODES = ('program', 'tle', 'preset', 'steptrack')
"""Modes with results of their own, each with a row of _PARTS."""
SETTLING_TIME_S = 0.5
"""Time for which the error must be still before a mode counts as settled [s]."""
MAX_DRIFT = 0.25
"""Largest motion of a still error [beamwidths/s]."""
MAX_REFERENCE_STEP_RAD = 1e-5
"""Largest motion of a standing reference in SETTLING_TIME_S [rad]."""


def read(bag, run) -> dict:
    """Return {mode: errors (k, 2) [deg]} of the settled part of each mode of a bag.Bag and its tracking.Tracking.

    Columns: cross-elevation, elevation. A mode without a settled part is left out.
    """
    found = {}
    for mode in FOLLOWING_MODES:
        inside = run.mode == mode
        if not inside.any():
            continue
        error, on = _PARTS[mode](bag, run, inside)
        if np.isfinite(error[on]).any():
            parts = [error[on], run.begun[on]] if run.electronic and mode != 'preset' else [error[on]]
            found[mode] = np.concatenate(parts) * DEG_PER_RAD
    return found


def _window(run):
    """Return SETTLING_TIME_S as a number of steps."""
    return max(1, round(SETTLING_TIME_S / run.period))


def _moved(values, window):
    """Return the distance (n,) that values (n, 2) moved in the window before each step; infinite without one."""
    out = np.full(len(values), np.inf)
    out[window:] = np.hypot(*(values[window:] - values[:-window]).T)
    return out


def _to_target(run):
    return np.column_stack((run.cross_elevation, run.elevation_error))


def _of_table(_, run, inside):
    """Return (error (n, 2) [rad], mask (n,) of its settled steps) of a mode that follows a table."""
    error, window = _to_target(run), _window(run)
    on = np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        still = _moved(error[first:last], window) < MAX_DRIFT * SETTLING_TIME_S * run.beamwidth
        long = np.flatnonzero(np.convolve(still, np.ones(window, int))[:last - first] == window)
        if long.size:
            on[first + long[0]:last] = True
    return error, on


def _of_steps(_, run, inside):
    """Return (error (n, 2) [rad], mask (n,) of its settled steps) of step track."""
    on = np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        on[first:last] = run.t[first:last] >= run.t[first] + tracking.HANDOVER_SETTLING_S
    return _to_target(run), on


def _of_preset(bag, run, inside):
    """Return (error (n, 2) [rad] against the reference, mask (n,) of its settled steps) of preset angles."""
    columns, window = ('azimuth.position', 'elevation.position'), _window(run)
    beam = tracking.on_grid(bag, run.t, 'adu/truth' if 'adu/truth' in bag.topics else 'joint_states', columns)
    error, on = run.reference - beam, np.zeros(run.t.size, bool)
    error[:, 0] *= np.cos(beam[:, 1])
    for first, last in tracking.stretches(inside):
        part = slice(first, last)
        on[part] = ((_moved(run.reference[part], window) < MAX_REFERENCE_STEP_RAD)
                    & (_moved(error[part], window) < MAX_DRIFT * SETTLING_TIME_S * run.beamwidth))
    return error, on


_PARTS = {'program': _of_table, 'tle': _of_table, 'preset': _of_preset, 'steptrack': _of_steps}
"""{mode: function(bag, run, steps of the mode (n,)) -> (error, settled steps)}."""
