"""Li 2018's filter on a flight of the same kind (figures 1 to 8), and the matrices of its proof of stability.

The paper prints T = 0.01 s and the windows of its figures, and that the filter begins with the first measured angle
and rate. The flight, the noises and the parameters of the filter are ours. A target flies straight past the antenna.
Cases <axis>/filtered are the 'current' statistical filter on angle and rate. Cases <axis>/measured are the measured
angle and rate, and the difference of the measured rate over DIFFERENCE_STEPS steps.

The model of the filter is x+ = Phi x + U abar, y = H x, with the mean acceleration abar. The matrices of the proof are

    controllability (U, Phi U, Phi^2 U),        observability (H', (H Phi)', (H Phi^2)')'.

The condition number of a matrix is its largest singular value over its smallest. `condition` is measured with T in
place of the second as the unit of time, so that the entries are of one size. In seconds the entries differ by up to 1
/ T^2, and `condition_in_seconds` shows only this difference.
"""
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.filters import motion_models
from pedestal_common.graph.topics import AXES
from pedestal_common.quantities import Floats, Matrix3, Row, Seconds, Times, Vector3, Vectors3
from pedestal_results import tracking
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_studies import ensemble
from pedestal_studies.ensemble import MEASUREMENT_PERIOD_S
from pedestal_studies.p004_li_chen_wang.rate_measurement import ALPHA, ANGLE_SIGMA_RAD, differenced_rate, filtered
from pedestal_studies.result import Drawings, Result, legend, of_cases
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS, NOISE_SEED = 40, 1  # number of flights; seed of their noise

TARGET_SPEED_M_S, MIN_GROUND_DISTANCE_M, TARGET_HEIGHT_M, CULMINATION_TIME_S = 300.0, 3000.0, 2500.0, 42.0

FLIGHT_START_S, FLIGHT_END_S = 20.0, 100.0  # times of the paper's figures [s]; the filter begins at the first
SETTLING_TIME_S = 5.0  # time after FLIGHT_START_S from which the rows are evaluated [s]

ZOOM_WINDOWS_S = {'azimuth': (39.0, 43.5), 'elevation': (41.5, 45.0)}  # {axis: (begin, end) [s] of figure 2 or 6}

RATE_SIGMA_RAD_S = math.radians(0.1)  # noise of a measured rate [rad/s]
DIFFERENCE_STEPS = 20  # steps over which the measured rate is differenced

QUANTITY_UNITS = {'angle': 'deg', 'rate': 'deg/s', 'acceleration': 'deg/s2'}


def flight() -> tuple[Times, dict[str, Vectors3]]:
    """Return (times, {axis: angle, rate, acceleration [rad, rad/s, rad/s2]}) of the target.

    A, E: azimuth, from the direction of the nearest point, and elevation. v: speed; t_0: time at the nearest point; d:
    distance over ground at t_0; h: height. With x = v (t - t_0), rho^2 = x^2 + d^2 and r^2 = rho^2 + h^2,

        A = atan2(x, d),    A' = v d / rho^2,           A'' = -2 v^2 d x / rho^4,
        E = atan2(h, rho),  E' = -v h x / (rho r^2),
        E'' = -v^2 h (1 / (rho r^2) - x^2 (3 rho^2 + h^2) / (rho^3 r^4)).
    """
    n = round((FLIGHT_END_S - FLIGHT_START_S) / MEASUREMENT_PERIOD_S) + 1
    t = FLIGHT_START_S + MEASUREMENT_PERIOD_S * np.arange(n, dtype=float)
    v, d, h, x = TARGET_SPEED_M_S, MIN_GROUND_DISTANCE_M, TARGET_HEIGHT_M, TARGET_SPEED_M_S * (t - CULMINATION_TIME_S)
    rho2 = x * x + d * d
    rho, r2 = np.sqrt(rho2), rho2 + h * h
    azimuth = np.arctan2(x, d), v * d / rho2, -2.0 * v * v * d * x / rho2**2
    elevation = (np.arctan2(h, rho), -v * h * x / (rho * r2),
                 -v * v * h * (1.0 / (rho * r2) - x * x * (3.0 * rho2 + h * h) / (rho**3 * r2 * r2)))
    return t, {'azimuth': np.column_stack(azimuth), 'elevation': np.column_stack(elevation)}


def flight_record(axis: str, run: int) -> tuple[Vectors3, Vectors3]:
    """Return (measured, filtered) angle, rate and acceleration of a flight, with noise by axis and run alone."""
    t, target = flight()
    truth = target[axis]
    nu, nu_rate = ensemble.normal_draws(NOISE_SEED + AXES.index(axis), first=run, count=1, n=len(t))[:, 0]
    y, y_rate = truth[:, 0] + ANGLE_SIGMA_RAD * nu, truth[:, 1] + RATE_SIGMA_RAD_S * nu_rate
    out = filtered(t, truth, y, y_rate, RATE_SIGMA_RAD_S * RATE_SIGMA_RAD_S)
    difference, _ = differenced_rate(y_rate, DIFFERENCE_STEPS)
    return np.column_stack((y, y_rate, difference)), np.column_stack([out[name] for name in QUANTITY_UNITS])


def flight_errors(axis: str, run: int) -> Floats:
    """Return the rms errors (2, 3) [deg, deg/s, deg/s2] of one flight, measured and filtered."""
    t, target = flight()
    counts = t >= FLIGHT_START_S + SETTLING_TIME_S
    return np.degrees([[tracking.rms(error) for error in (values - target[axis])[counts].T]
                       for values in flight_record(axis, run)])


def model(T: Seconds) -> tuple[Matrix3, Vector3]:
    """Return (Phi, U) of the 'current' statistical model over T (Li 2018, equations 5 and 6)."""
    angle, rate, kept = motion_models.fading(ALPHA, T)
    return (np.array([[1.0, T, angle], [0.0, 1.0, rate], [0.0, 0.0, kept]]),
            np.array([0.5 * T * T - angle, T - rate, 1.0 - kept]))


MEASUREMENT_MATRICES = {'angle': np.eye(3)[:1], 'angle-rate': np.eye(3)[:2]}  # {case: H}


def controllability(Phi: Matrix3, U: Vector3) -> Matrix3:
    """Return the controllability matrix of the model: (U, Phi U, Phi^2 U)."""
    return np.column_stack([np.linalg.matrix_power(Phi, i) @ U for i in range(3)])


def observability(Phi: Matrix3, H: Floats) -> Floats:
    """Return the observability matrix of the model: H, H Phi, H Phi^2 stacked vertically; (3, 3) or (6, 3)."""
    return np.vstack([H @ np.linalg.matrix_power(Phi, i) for i in range(3)])


def matrices() -> dict[str, tuple[Floats, Floats]]:
    """Return {case: (matrix in seconds, matrix with T as the unit of time)}."""
    T = MEASUREMENT_PERIOD_S
    Phi, U = model(T)
    unit = np.diag([1.0, T, T * T])         # from (angle, rate, acceleration) to (angle, rate T, acceleration T^2)
    back = np.linalg.inv(unit)
    return {'controllability': (controllability(Phi, U), controllability(unit @ Phi @ back, unit @ U / (T * T))),
            **{f'observability/{name}': (observability(Phi, H), observability(unit @ Phi @ back, H))
               for name, H in MEASUREMENT_MATRICES.items()}}


def rows(errors: Mapping[str, Floats]) -> list[Row]:
    """Return the rows of the study; errors: {axis: rms errors (runs, 2, 3) of `flight_errors`}."""
    table = []
    for axis, of_runs in errors.items():
        for name, column in zip(('measured', 'filtered'), of_runs.transpose(1, 2, 0)):
            table += [row(f'{axis}/{name}', f'{quantity}_rms', values, unit)
                      for (quantity, unit), values in zip(QUANTITY_UNITS.items(), column)]
        table += [row(f'{axis}/filtered', f'{quantity}_reduction', values, '', target='> 1')
                  for quantity, values in zip(QUANTITY_UNITS, (of_runs[:, 0] / of_runs[:, 1]).T)]
    for name, (matrix, scaled) in matrices().items():
        table += [row(name, 'rank', np.linalg.matrix_rank(scaled), '', target='3 +- 0'),
                  row(name, 'condition', np.linalg.cond(scaled), ''),
                  row(name, 'condition_in_seconds', np.linalg.cond(matrix), '')]
    return table


def remarks() -> list[str]:
    """Return the sentences that explain the rows, with the matrices in seconds."""
    lines = ['Without the filter the acceleration is the difference of the measured rate over '
             f'{DIFFERENCE_STEPS * MEASUREMENT_PERIOD_S:g} s. The paper prints no error; it claims "smooth" and "does '
             'not diverge".']
    for name, (matrix, _) in matrices().items():
        lines += [f'{name}, in seconds:', *('    ' + '  '.join(f'{value:11.4g}' for value in line) for line in matrix)]
    return lines


def figures() -> Drawings:
    """Return the figures: the paper's figures 1 to 4 and 5 to 8."""
    return {'figures-1-to-4': lambda: axis_figure('azimuth', first_number=1),
            'figures-5-to-8': lambda: axis_figure('elevation', first_number=5)}


def axis_figure(axis: str, first_number: int) -> Figure:
    """Draw one flight in four panels: angle, a part of it, rate and acceleration; first_number: that of
    the paper's figure in the first panel."""
    figure, axes = fig.new_panels(4, height=9.0)
    t, target = flight()
    measured, filtered = flight_record(axis, run=0)
    # The second panel is a window of the first, so both show column 0, the angle.
    for i, (panel, column) in enumerate(zip(axes[:, 0], (0, 0, 1, 2))):
        begin, end = ZOOM_WINDOWS_S[axis] if i == 1 else (FLIGHT_START_S, FLIGHT_END_S)
        shown = (t >= begin) & (t <= end)
        for values, colour, label, width in ((measured, fig.RAW_COLOUR, 'measured', 0.5),
                                             (filtered, fig.FILTERED_COLOUR, 'filtered', 1.2)):
            panel.plot(t[shown], np.degrees(values[shown, column]), color=colour, label=label, linewidth=width)
        panel.plot(t[shown], np.degrees(target[axis][shown, column]), color=fig.INK_COLOUR, linestyle='--',
                   linewidth=0.8, label='truth')
        name, unit = list(QUANTITY_UNITS.items())[column]
        panel.set_ylabel(f'{name} [{unit}]')
        panel.set_title(f'{axis}: {name} (figure {first_number + i} of the paper)')
    axes[3, 0].set_ylim(*np.degrees(2.0 * np.abs(target[axis][:, 2]).max() * np.array((-1.0, 1.0))))
    return legend(figure)


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Fly `runs` flights."""
    errors = of_cases(flight_errors, AXES, runs, pool, progress)
    return Result(rows(errors), figures(), remarks())
