"""Pointing error of a recorded run in the modes that follow a direction without the angle errors of the receiver.

In `program`, `tle` and `steptrack` the error is the direction to the true target minus that of the beam. In `preset`
it is the requested deck angle minus that of the beam. The requested angle is the reference of the position loop while
this reference stands.

Only the settled part of a mode counts, without the slew to the direction. It begins when the error has moved by less
than MAX_DRIFT beamwidths per second for SETTLING_TIME_S. Because step track moves the beam on purpose, its settled
part begins HANDOVER_SETTLING_S after the begin of the mode.
"""
import numpy as np

from pedestal_analysis.results import tracking
from pedestal_analysis.results.tracking import DEG_PER_RAD

FOLLOWING_MODES = ('program', 'tle', 'preset', 'steptrack')
"""Modes whose pointing error is a result of its own; _PARTS has a function for each."""
SETTLING_TIME_S = 0.5
"""Time for which the error must be still before a mode counts as settled [s]."""
MAX_DRIFT = 0.25
"""Largest motion of a still error [beamwidths/s]."""
MAX_REFERENCE_STEP_RAD = 1e-5
"""Largest motion within SETTLING_TIME_S of a reference that counts as standing [rad]."""


def read(bag, run) -> dict:
    """Return {mode: pointing errors (k, 2) [deg]} in the settled part of each mode; run: Tracking of the bag.Bag.

    Columns: cross-elevation, elevation. An electronic beam has two rows per step: at the end and at the beginning of
    the interval. A mode without a settled part is left out.
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
    """Return the distance (n,) that values (n, 2) moved in the last `window` steps; infinite in the first rows."""
    out = np.full(len(values), np.inf)
    out[window:] = np.hypot(*(values[window:] - values[:-window]).T)
    return out


def _to_target(run):
    """Return the true pointing error (n, 2) (cross-elevation, elevation) [rad] of a tracking.Tracking."""
    return np.column_stack((run.cross_elevation, run.elevation_error))


def _of_table(_, run, inside):
    """Return (error (n, 2) [rad], mask (n,) of the settled steps) of a mode that follows a table of directions.

    inside (n,): mask of the steps in the mode.
    """
    error, window = _to_target(run), _window(run)
    on = np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        still = _moved(error[first:last], window) < MAX_DRIFT * SETTLING_TIME_S * run.beamwidth
        long = np.flatnonzero(np.convolve(still, np.ones(window, int))[:last - first] == window)
        if long.size:
            on[first + long[0]:last] = True
    return error, on


def _of_steps(_, run, inside):
    """Return (error (n, 2) [rad], mask (n,) of the settled steps) of step track, whose steps are the mask `inside`."""
    on = np.zeros(run.t.size, bool)
    for first, last in tracking.stretches(inside):
        on[first:last] = run.t[first:last] >= run.t[first] + tracking.HANDOVER_SETTLING_S
    return _to_target(run), on


def _of_preset(bag, run, inside):
    """Return (reference minus beam (n, 2) [rad], mask (n,) of the settled steps) of the mode `preset`.

    inside (n,): mask of the steps in the mode. Columns: cross-elevation, elevation.
    """
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
"""{mode: function(bag, run, mask of the steps in the mode) -> (error (n, 2) [rad], mask of the settled steps)}."""
