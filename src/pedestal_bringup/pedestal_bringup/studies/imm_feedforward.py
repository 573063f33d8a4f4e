"""Feed-forward of estimated rate and acceleration (paper 003): a conventional Kalman filter against the IMM.

The target moves to and fro through 20 deg at 3.5 deg/s and turns round in a half cosine. Every 10 ms the tracker says
how far the antenna missed it 40 ms ago, with noise. What the antenna's encoder said then plus the miss is the line of
sight, y; a filter of `acu_tracker.axis_filter` makes rate v and acceleration a of it, and the rate loop is told

    u = K_p miss(t - d) + k_v v + k_a a,        W(s) = w^2 / (s^2 + 2 zeta w s + w^2),

where k_v + k_a s are the first two terms of 1 / W(s), so that a constant acceleration leaves no miss. `imm` takes v
and a as they were at the time of the miss, `imm-predicted` as they will be in the middle of the interval in which u is
in force, d + T / 2 later; `perfect-state` is told the truth of that instant. All filters see the same noise.
"""
import dataclasses
import math

import numpy as np
from scipy.linalg import expm

from acu_tracker import axis_filter, feedforward
from acu_tracker.filter_params import Filter
from acu_tracker.motion_models import MODELS
from pedestal_bringup import monte_carlo
from pedestal_bringup.figures import FILTERED, INK, MOTOR_1, MOTOR_2, RAW, TRUTH
from pedestal_bringup.studies import experiment, profiles
from pedestal_bringup.studies.experiment import Result, row
from pedestal_common import noise
from pedestal_common.compiled import compiled

RUNS = 50
"""Of each case, the noise drawn anew."""

T = 0.01
"""Between two misses [s]."""

DELAY = 4
"""Age of a miss when it comes, in T."""

SIGMA = math.radians(0.02)
"""Of a miss [rad]."""

K_P = 5.0
"""Of the miss [1/s]."""

RATE_LOOP = (2.0 * math.pi * 8.0, 0.7)
"""w [rad/s], zeta."""

STROKE, SPEED = math.radians(20.0), math.radians(3.5)
"""Between the turning points [rad], outside the reversals [rad/s]."""

REVERSALS = {'azimuth': 1.0, 'elevation': 1.6}
"""Duration of a reversal [s]: 11 and 6.9 deg/s2 at its peak. The paper does not print it."""

PERIODS = 2
"""Of the motion that count, after half of one to settle."""

CALM = 2.0
"""After a reversal the rate is called uniform from then on [s]."""

BATCH = 25
"""Runs of one piece of work."""


def feedforward_gains(w, zeta):
    """(k_v [-], k_a [s]) of 1 / W(s) = 1 + 2 zeta s / w + s^2 / w^2: paper 003's c1, c2, corrected, for this W."""
    return 1.0, 2.0 * zeta / w


def rate_loop_step(w, zeta):
    """M (3, 4) of (theta, omega, omega') T later = M (theta, omega, omega', u), u constant: exact."""
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = 1.0
    A[2, 1:] = -w * w, -2.0 * zeta * w, w * w
    return expm(A * T)[:3]


K_V, K_A = feedforward_gains(*RATE_LOOP)

STEP = np.dtype([('miss', 'f8'), ('rate', 'f8'), ('acceleration', 'f8'), ('mu', 'f8', axis_filter.BANK)], align=True)
"""True angle less antenna [rad]; rate [rad/s] and acceleration [rad/s2] fed forward; probability of each model."""


@compiled
def _follow(target, known, f, c, lead, M, normals, out):
    """Runs of the loop: target (n, 3), normals (runs, n) into out (runs, n).

    known (n, 2): rate and acceleration to feed forward; (0, 2): those of the filter f, c, `lead` [s] after its miss.
    """
    R = SIGMA * SIGMA
    encoder = np.empty(len(target))
    for i in range(len(normals)):
        theta, omega, omega_dot = target[0]
        for k in range(len(target)):
            encoder[k] = theta
            e, v, a = 0.0, target[0, 1], target[0, 2]
            j = k - DELAY
            if j >= 0:
                e = target[j, 0] + SIGMA * normals[i, j] - encoder[j]
                y = encoder[j] + e
                if j == 0:
                    axis_filter.start(f[0], c[0], y, R, SPEED)
                else:
                    axis_filter.predict(f[0], c[0], T)
                    axis_filter.correct(f[0], c[0], y, R, math.nan, math.nan)
                _, v, a = axis_filter.outlook(f[0], c[0], lead)
            if len(known) > 0:
                v, a = known[k]
            u = feedforward.rate(e, 0.0, v, K_P, K_V) + K_A * a
            step = out[i, k]
            step.miss, step.rate, step.acceleration = target[k, 0] - theta, v, a
            axis_filter.probabilities(f[0], c[0], step.mu)
            theta, omega, omega_dot = (
                theta + M[0, 1] * omega + M[0, 2] * omega_dot + M[0, 3] * u,
                M[1, 1] * omega + M[1, 2] * omega_dot + M[1, 3] * u,
                M[2, 1] * omega + M[2, 2] * omega_dot + M[2, 3] * u)


@dataclasses.dataclass(frozen=True)
class Source:
    """Where rate and acceleration come from: a filter, or None for the truth; `predicted` to the instant of the
    command, or as they were when the miss was measured."""
    filter: Filter | None
    predicted: bool = False


def filter_of(kind, **groups):
    """A filter_params.Filter of a kind with groups of its parameters changed: cv=dict(noise=...)."""
    return Filter(kind=kind, **{name: dataclasses.replace(getattr(Filter(), name), **values)
                                for name, values in groups.items()})


def cv(q):
    """Constant rate; q [deg/s2/sqrt(Hz)]."""
    return Source(filter_of('cv', cv={'noise': math.radians(q)}))


def ca(q):
    """Constant acceleration; q [deg/s3/sqrt(Hz)]."""
    return Source(filter_of('ca', ca={'noise': math.radians(q)}))


def imm(q_ca, predicted):
    """A quiet cv, a ca of q_ca [deg/s3/sqrt(Hz)], a lively current_statistical; each holds for 5 s."""
    default = Filter().imm
    bank = {
        'models': 'cv ca current_statistical', 'dwell': 5.0,
        'cv': dataclasses.replace(default.cv, noise=math.radians(0.003)),
        'ca': dataclasses.replace(default.ca, noise=math.radians(q_ca)),
        'current_statistical': dataclasses.replace(default.current_statistical, alpha=4.0, a_max=math.radians(40.0),
                                                   floor=0.3)}
    return Source(filter_of('imm', imm=bank), predicted)


CV = (0.1, 0.2, 0.3, 0.5, 4.0)
"""Process noises of the conventional filter [deg/s2/sqrt(Hz)]."""

USUAL_CV = {'azimuth': 0.1, 'elevation': 0.3}
"""The one that is `kalman-cv`: what comes nearest to the paper, which prints none."""

SOURCES = {
    'imm': imm(40.0, False), 'imm-predicted': imm(40.0, True), 'perfect-state': Source(None, True),
    'imm-b-predicted': imm(5.0, True), 'kalman-ca-0.1': ca(0.1), 'kalman-ca-40': ca(40.0),
    'kalman-ca-40-predicted': dataclasses.replace(ca(40.0), predicted=True)}


def cv_name(axis, q):
    return f'{axis}/kalman-cv' if q == USUAL_CV[axis] else f'{axis}/kalman-cv-{q:g}'


CASES = {f'{axis}/kalman-cv': (axis, cv(q)) for axis, q in USUAL_CV.items()}
CASES |= {f'{axis}/{name}': (axis, source) for axis in REVERSALS for name, source in SOURCES.items()}
CASES |= {cv_name(axis, q): (axis, cv(q)) for axis in REVERSALS for q in CV}


def motion(axis):
    """(t (n,) [s], target (n, 3), its period [s]): the S motion of an axis, half a period and PERIODS more."""
    reversal = REVERSALS[axis]
    period = 2.0 * (STROKE / SPEED + reversal * (1.0 - 2.0 / math.pi))
    t = T * np.arange(round((0.5 + PERIODS) * period / T))
    return t, np.column_stack(profiles.s_motion(t, STROKE, SPEED, reversal)), period


def steps_of(axis, source, first, count):
    """STEP records (count, n) of runs first ... first + count - 1 of a Source on an axis; run i has the noise of i."""
    t, target, _ = motion(axis)
    lead = (DELAY + 0.5) * T if source.predicted else 0.0
    known = np.zeros((0, 2))
    if source.filter is None:
        at = t + 0.5 * T if source.predicted else t - DELAY * T
        known = np.column_stack(profiles.s_motion(at, STROKE, SPEED, REVERSALS[axis])[1:])
    normals = np.array([noise.generator(first + i, 'tracking_receiver').standard_normal(len(t)) for i in range(count)])
    out = np.zeros((count, len(t)), STEP)
    _follow(target, known, np.zeros(1, axis_filter.FILTER), axis_filter.constants(source.filter or Filter()), lead,
            rate_loop_step(*RATE_LOOP), normals, out)
    return out


SUMS = np.dtype([('miss', 'f8'), ('miss_squared', 'f8'), ('rate_error_squared', 'f8')])
"""Over runs, at one step [rad, rad2, rad2/s2]."""


def batch(item):
    """(SUMS (n,), sum of the largest misses of each run [rad]) of an item (axis, source, first run, how many)."""
    axis, source, first, count = item
    steps = steps_of(axis, source, first, count)
    t, target, period = motion(axis)
    sums = np.zeros(len(t), SUMS)
    sums['miss'] = steps['miss'].sum(axis=0)
    sums['miss_squared'] = np.square(steps['miss']).sum(axis=0)
    sums['rate_error_squared'] = np.square(steps['rate'] - target[:, 1]).sum(axis=0)
    return sums, float(np.abs(steps['miss'][:, t >= 0.5 * period]).max(axis=1).sum())


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of the runs of a Source on an axis: over them at each step (n,) the mean miss, its rms [rad], the rms
    error of the rate [rad/s]; the mean of the largest misses [rad]."""
    axis: str
    miss_mean: np.ndarray
    miss_rms: np.ndarray
    rate_rms: np.ndarray
    peak: float

    def measures(self):
        """{metric: (value, unit)}: miss over all, in the worst second, its peak; noise of a uniform rate."""
        t, target, period = motion(self.axis)
        counts = t >= 0.5 * period
        squares = np.square(self.miss_rms[counts])
        second = round(1.0 / T)
        windows = np.convolve(squares, np.full(second, 1.0 / second), 'valid')
        turning = np.convolve(np.abs(target[:, 1]) < 0.999 * SPEED, np.ones(round(CALM / T)))[:len(t)] > 0.5
        return {'miss_rms_deg': (math.degrees(math.sqrt(squares.mean())), 'deg'),
                'miss_worst_second_deg': (math.degrees(math.sqrt(windows.max())), 'deg'),
                'miss_peak_deg': (math.degrees(self.peak), 'deg'),
                'rate_noise_deg_s': (math.degrees(experiment.rms(self.rate_rms[counts & ~turning])), 'deg/s')}


def outcomes(cases, count, pool, progress=lambda share, text: None):
    """{name: Outcome} of `count` runs of each of cases {name: (axis, source)}."""
    pieces = monte_carlo.batches(count, BATCH)
    items = [(axis, source, *piece) for axis, source in cases.values() for piece in pieces]
    done = pool.map(batch, items, progress)
    found = {}
    for name, (axis, _) in cases.items():
        sums, peaks = [], 0.0
        for _ in pieces:
            more, peak = next(done)
            sums.append(more)
            peaks += peak
        total = {field: sum(part[field] for part in sums) / count for field in SUMS.names}
        found[name] = Outcome(axis, total['miss'], np.sqrt(total['miss_squared']),
                              np.sqrt(total['rate_error_squared']), peaks / count)
    return found


TARGETS = {
    'azimuth/kalman-cv': '0.16 to 0.17', 'azimuth/imm': '<= 0.036', 'azimuth/imm-predicted': '<= 0.025',
    'elevation/kalman-cv': '0.085 to 0.095', 'elevation/imm': '<= 0.028', 'elevation/imm-predicted': '<= 0.018'}
"""Of miss_rms_deg."""

PAPER = {'azimuth/kalman-cv': 0.17, 'azimuth/imm': 0.035, 'elevation/kalman-cv': 0.1, 'elevation/imm': 0.03}
"""Miss rms of the paper [deg]: what it calls its largest."""

MAIN = {f'{axis}/{name}' for axis in REVERSALS for name in ('kalman-cv', 'imm', 'imm-predicted', 'perfect-state')}
"""The cases that get all rows."""

RATIOS = {'azimuth/imm': ('>= 4', 0.17 / 0.035), 'azimuth/imm-predicted': ('>= 6', None),
          'elevation/imm': ('>= 3', 0.1 / 0.03), 'elevation/imm-predicted': ('>= 5', None)}
"""Target and paper of how often the miss of kalman-cv is that of a case."""


def conventional(found, axis):
    """(rate noise [deg/s], miss [deg]) of the conventional filter, an array (2, n) over CV."""
    return np.array([[found[cv_name(axis, q)].measures()[metric][0] for q in CV]
                     for metric in ('rate_noise_deg_s', 'miss_rms_deg')])


def at_rate_noise(found, axis, rate_noise):
    """Miss [deg] of a conventional filter tuned to a rate noise [deg/s], between those of CV (log-log)."""
    curve = conventional(found, axis)
    return math.exp(np.interp(math.log(rate_noise), *np.log(curve)))


def rows(found):
    """The rows of {case: Outcome} of all cases."""
    result = []
    for name, outcome in found.items():
        values, axis = outcome.measures(), outcome.axis
        miss = values['miss_rms_deg'][0]
        result.append(row(name, 'miss_rms_deg', miss, 'deg', PAPER.get(name), TARGETS.get(name)))
        result += [row(name, metric, value, unit) for metric, (value, unit) in values.items()
                   if metric == 'rate_noise_deg_s' or metric != 'miss_rms_deg' and name in MAIN]
        if name in RATIOS:
            target, paper = RATIOS[name]
            result.append(row(name, 'miss_ratio_to_kalman_cv',
                              found[f'{axis}/kalman-cv'].measures()['miss_rms_deg'][0] / miss, '', paper, target))
            result.append(row(name, 'miss_ratio_at_equal_rate_noise',
                              at_rate_noise(found, axis, values['rate_noise_deg_s'][0]) / miss, '', None,
                              '>= 5' if axis == 'azimuth' and name.endswith('predicted') else None))
    return result


def remarks(found):
    """What the rows do not say by themselves."""
    value = {(name, metric): value for name, outcome in found.items()
             for metric, (value, _) in outcome.measures().items()}
    late = (DELAY + 0.5) * T
    steepest = math.pi * math.degrees(SPEED) / REVERSALS['azimuth']
    return [
        'Not printed in the paper and chosen here: the time of a reversal, sample time, noise, delay, rate loop, K_p '
        'and every constant of the filters. Its "largest miss (RMS)" is read as the rms over the whole motion; the '
        'rms of the worst second is the row below.',
        f'What is fed forward {1e3 * late:g} ms late (d + T / 2) misses by a (d + T / 2) / K_p in a long turn, '
        f'{steepest * late / K_P:.3f} deg at the {steepest:.1f} deg/s2 of the azimuth: that is most of what `imm` '
        'has left, and what the prediction takes away. A constant rate estimate is nothing that prediction could '
        'change: kalman-cv is the same with it.',
        'perfect-state is what noise of the miss and jerk in the rate loop leave: the limit of this servo.',
        f'The elevation of the paper (0.1 deg) needs a conventional filter of {USUAL_CV["elevation"]:g} '
        f'deg/s2/sqrt(Hz); with the {USUAL_CV["azimuth"]:g} of its azimuth it misses by '
        f'{value["elevation/kalman-cv-0.1", "miss_rms_deg"]:.3f} deg.',
        'The miss alone can be had from any filter by more noise: a conventional one of 4 deg/s2/sqrt(Hz) misses by '
        f'{value["azimuth/kalman-cv-4", "miss_rms_deg"]:.3f} deg, a ca of 40 deg/s3/sqrt(Hz), predicted, by '
        f'{value["azimuth/kalman-ca-40-predicted", "miss_rms_deg"]:.3f} deg, with '
        f'{value["azimuth/kalman-ca-40-predicted", "rate_noise_deg_s"]:.2f} deg/s of noise on the rate where the IMM '
        f'has {value["azimuth/imm-predicted", "rate_noise_deg_s"]:.3f}. Hence miss_ratio_at_equal_rate_noise: against '
        'the conventional filter that is tuned to the same noise. The IMM was tuned on the azimuth and left so.',
    ]


COLOURS = {'kalman-cv': TRUTH, 'imm': MOTOR_1, 'imm-predicted': FILTERED, 'perfect-state': INK}


def figures(found):
    """{name: function that draws it}."""
    return {'azimuth': lambda: miss_figure('azimuth', 'figures 8 and 9', found),
            'elevation': lambda: miss_figure('elevation', 'figures 10 and 11', found),
            'feedforward': feedforward_figure, 'probabilities': probability_figure,
            'tunings': lambda: tuning_figure(found)}


def from_first_turn(axis):
    """(time [s] from the first step that counts on, which steps (n,) those are, the target (n, 3))."""
    t, target, period = motion(axis)
    counts = t >= 0.5 * period
    return t[counts] - 0.5 * period, counts, target


def miss_figure(axis, those, found):
    """The paper's figures of the miss, one run of each and the mean over the runs."""
    names = ('kalman-cv', 'imm', 'imm-predicted')
    figure, axes = experiment.panels(len(names), size=(7.4, 6.4), sharex=True, sharey=True)
    t, counts, _ = from_first_turn(axis)
    for name, panel in zip(names, axes[:, 0]):
        case = f'{axis}/{name}'
        panel.plot(t, np.degrees(steps_of(*CASES[case], 0, 1)['miss'][0, counts]), color=RAW, linewidth=0.7,
                   label='one run')
        panel.plot(t, np.degrees(found[case].miss_mean[counts]), color=COLOURS[name], linewidth=1.4,
                   label='mean of the runs')
        panel.set_title(f'{name}: {found[case].measures()["miss_rms_deg"][0]:.3f} deg rms')
        panel.set_ylabel('miss [deg]')
        panel.legend(loc='upper right', ncols=2)
    axes[0, 0].set_title(f'{axis}, {those} of the paper. {axes[0, 0].get_title(loc="left")}')
    axes[-1, 0].set_xlabel('time [s]')
    return figure


def feedforward_figure():
    """What is fed forward through one reversal, one run, beside the truth."""
    figure, axes = experiment.panels(2, size=(7.4, 5.4), sharex=True)
    t, counts, target = from_first_turn('azimuth')
    for panel, field, column, label in ((axes[0, 0], 'rate', 1, 'rate [deg/s]'),
                                        (axes[1, 0], 'acceleration', 2, 'acceleration [deg/s2]')):
        panel.plot(t, np.degrees(target[counts, column]), color=INK, linestyle='--', label='truth')
        for name in ('kalman-cv', 'imm', 'imm-predicted'):
            panel.plot(t, np.degrees(steps_of(*CASES[f'azimuth/{name}'], 0, 1)[field][0, counts]), color=COLOURS[name],
                       label=name)
        panel.set_ylabel(label)
    turn = t[np.argmax(np.abs(target[counts, 2]))]
    axes[0, 0].set_xlim(turn - 1.5, turn + 2.5)
    axes[0, 0].set_title('fed forward through a reversal of the azimuth')
    axes[0, 0].legend()
    axes[1, 0].set_xlabel('time [s]')
    return figure


def probability_figure():
    """Which model the IMM believes in while the target turns, mean of BATCH runs."""
    figure, axes = experiment.panels(2, size=(7.4, 4.6), sharex=True, height_ratios=(1, 1.6))
    t, counts, target = from_first_turn('azimuth')
    mu = steps_of(*CASES['azimuth/imm'], 0, BATCH)['mu'][:, counts].mean(axis=0)
    axes[0, 0].plot(t, np.degrees(target[counts, 2]), color=INK)
    axes[0, 0].set_ylabel('acceleration\n[deg/s2]')
    axes[0, 0].set_title('the target, and the probability of each model of imm')
    for model, colour in (('cv', TRUTH), ('ca', MOTOR_2), ('current_statistical', FILTERED)):
        axes[1, 0].plot(t, mu[:, MODELS.index(model)], color=colour, label=model)
    axes[1, 0].set_ylabel('probability')
    axes[1, 0].set_ylim(0.0, 1.0)
    axes[1, 0].legend(loc='center right')
    axes[1, 0].set_xlabel('time [s]')
    return figure


def tuning_figure(found):
    """Miss against the noise of the rate that it is bought with."""
    figure, axes = experiment.panels(1, 2, size=(7.4, 3.8), sharex=True, sharey=True)
    for axis, panel in zip(REVERSALS, axes[0]):
        panel.loglog(*conventional(found, axis), '.-', color=TRUTH, label='kalman-cv, q '
                     f'{CV[0]:g} to {CV[-1]:g}')
        for name, colour, marker in (('kalman-ca-0.1', RAW, 'v'), ('kalman-ca-40-predicted', RAW, '^'),
                                     ('imm', MOTOR_1, 'o'), ('imm-predicted', FILTERED, 'o'),
                                     ('imm-b-predicted', MOTOR_2, 's')):
            values = found[f'{axis}/{name}'].measures()
            panel.loglog(values['rate_noise_deg_s'][0], values['miss_rms_deg'][0], marker, color=colour, label=name)
        panel.set_title(axis)
        panel.set_xlim(0.015, 1.0)
        panel.set_ylim(0.012, 0.3)
        panel.set_xlabel('noise of the rate fed forward [deg/s]')
    axes[0, 0].set_ylabel('miss rms [deg]')
    axes[0, 0].legend()
    return figure


def run(progress, runs=RUNS, pool=None) -> Result:
    found = outcomes(CASES, runs, pool or monte_carlo.Pool(1), progress)
    return Result(rows(found), figures(found), remarks(found))
