"""Filters compared: angle and rate noise of every filter on four target motions, white and coloured noise.

Cases are <profile>/<filter>/<noise>, with the profiles of profiles.py, measured at 100 Hz. Every filter except
UNTUNED_FILTERS is tuned for each profile and noise, for the smallest angle rms over TUNING_RUNS records of other
seeds. A filter ...-rate-X has an independent rate measurement with a noise of X deg/s rms. A filter ...-expecting
knows the bandwidth of coloured noise; it has no case with white noise.
"""
import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from matplotlib.figure import Figure

from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.params import FilterParameters, UkfParameters
from pedestal_common.parameters import build
from pedestal_common.quantities import Floats, Radians, Records, Row, Times
from pedestal_results.intervals import row
from pedestal_results.report import figures as fig
from pedestal_results.report.filter_figures import MODEL_COLOURS
from pedestal_studies import ensemble, profiles
from pedestal_studies.ensemble import Noise
from pedestal_studies.result import Drawings, Result, legend
from pedestal_workbench.trials import monte_carlo
from pedestal_workbench.trials.monte_carlo import Pool, Progress
from pedestal_workbench.tuning import parameter_search

CaseName: TypeAlias = tuple[str, str, str]      # profile, filter, noise
Means: TypeAlias = dict[CaseName, dict[str, float]]     # {case: {metric: mean over the runs}}

DEFAULT_RUNS = 200  # runs of each case
BATCH_RUNS = 25  # runs that one worker makes at a time

NOISE_SEED, TUNING_SEED, TUNING_RUNS = 1, 2, 4

SETTLING_TIME_S = 3.0  # start of the evaluation [s]

NOISE_CASES = {f'{colour}-{sigma}': Noise(math.radians(sigma), bandwidth)
               for sigma in (0.03, 0.1) for colour, bandwidth in (('white', None), ('coloured', 5.0))}
"""{name: Noise}; the number in a name is the rms [deg]. Coloured noise is white noise after a first-order lag of 5 Hz,
with the same rms."""

RATE_SIGMAS_RAD_S = {f'current_statistical-rate-{sigma}': math.radians(sigma) for sigma in (0.5, 0.1, 0.02)}

MANOEUVRE_PARAMETERS = {'imm.models': 'cv ca current_statistical', 'imm.rungs': 1, 'imm.dwell': 5.0,
                        'imm.cv.noise': math.radians(0.003), 'imm.ca.noise': math.radians(0.1)}

NOISE_AWARE_FILTERS = ('ca-expecting', 'imm-expecting')  # filters that know the bandwidth of the noise

FILTERS = {**{kind: FilterParameters(kind=kind) for kind in FILTER_KINDS if kind != 'imm_ukf'},
           'imm-manoeuvre': build(FilterParameters, {'kind': 'imm', **MANOEUVRE_PARAMETERS}),
           **{name: FilterParameters(kind=name.partition('-')[0])
              for name in (*RATE_SIGMAS_RAD_S, *NOISE_AWARE_FILTERS)}}
"""{filter: its parameters}."""

UNTUNED_FILTERS = ('imm', 'imm-manoeuvre', 'imm-expecting', 'imm_ukf')  # filters that are not tuned

RANGED_PROFILE, RANGE_SIGMA_M = 'flyby-60m', 1.0
"""Profile on which imm_ukf is shown, and standard deviation of its measured range [m]. The other profiles are motions
in one angle without a distance, which this Cartesian filter needs."""

SHOWN_FILTERS = (*FILTERS, 'imm_ukf')  # filters of the figures and tables
SHOWN_NOISE = 'white-0.03'  # noise of the figures and of the printed table

METRIC_TARGETS = {
    ('flyby-500m', 'current_statistical', 'reduction'): '>= 6.5',
    ('flyby-60m', 'current_statistical', 'reduction'): '>= 2.8',
    ('flyby-500m', 'current_statistical-rate-0.1', 'reduction'): '>= 7.3',
    ('flyby-60m', 'current_statistical-rate-0.1', 'reduction'): '>= 5.2',
    **{(profile, 'imm-manoeuvre', 'angle_rms_deg'): target for profile, target in (
        ('flyby-500m', '<= 0.0075'), ('flyby-60m', '<= 0.0090'), ('s-turn-500m', '<= 0.0078'),
        ('s-20deg', '<= 0.0097'))},
    ('flyby-500m', 'imm', 'angle_rms_deg'): '<= 0.0048', ('flyby-60m', 'imm', 'angle_rms_deg'): '<= 0.0102',
    ('s-turn-500m', 'imm', 'angle_rms_deg'): '<= 0.0089', ('s-20deg', 'imm', 'angle_rms_deg'): '<= 0.0155'}
"""{(profile, filter, metric): target} for the noise white-0.03. The targets of imm are 1.15 times the rms of the best
tuned filter of one model."""

CONSISTENCY_LIMITS = (0.8, 1.25)
"""Range of two ratios of a consistent filter [-]: mean NIS (normalised innovation squared) per degree of freedom, and
rms error over the sigma that the filter states."""


def degrees_of_freedom(name: str) -> int:
    """Return the degrees of freedom of the innovation of a filter: 1 for the angle, and 1 for a measured rate."""
    return 1 + (name in RATE_SIGMAS_RAD_S)


def times() -> Times:
    """Return the instants of the measurements of a record."""
    n = round(profiles.RECORD_DURATION_S / ensemble.MEASUREMENT_PERIOD_S)
    return ensemble.MEASUREMENT_PERIOD_S * np.arange(n, dtype=float)


def noise_of(noise: str, name: str) -> Noise:
    """Return the noise for a filter; noise: key of NOISE_CASES; name: key of FILTERS."""
    return dataclasses.replace(NOISE_CASES[noise], rate_sigma=RATE_SIGMAS_RAD_S.get(name),
                               expected=name in NOISE_AWARE_FILTERS)


def measured(params: FilterParameters, profile: str, noise: Noise, seed: int, first: int, count: int) -> Records:
    """Return ensemble.Moments (count, n) of one filter in the runs first ... first + count - 1."""
    t = times()
    truth = profiles.truth(profile, t)
    return ensemble.moments(params, t, truth, noise, ensemble.records(truth, noise, seed, first, count))


def settled(sums: Records) -> Records:
    """Return the sum (runs,) of Moments (runs, n) over the time after SETTLING_TIME_S."""
    return ensemble.over_time(sums[:, round(SETTLING_TIME_S / ensemble.MEASUREMENT_PERIOD_S):])


def tune(item: tuple[str, str, str]) -> FilterParameters:
    """Return the parameters of an item (profile, noise, filter), tuned on the records of TUNING_SEED."""
    profile, noise, name = item
    t = times()
    noise_known = noise_of(noise, name)
    truth = profiles.truth(profile, t)
    records = ensemble.records(truth, noise_known, TUNING_SEED, 0, TUNING_RUNS)

    def angle_rms(params: FilterParameters) -> Radians:
        sums = settled(ensemble.moments(params, t, truth, noise_known, records))
        return math.sqrt(sums['angle2'].sum() / sums['runs'].sum())

    return parameter_search.tuned(FILTERS[name], angle_rms)[0]


THINNING_STEPS = 10  # steps between two measurements that the figures show


def batch(item: tuple[str, str, dict[str, FilterParameters], int, int]) -> dict[str, tuple[Records, Records]]:
    """Return {filter: (Moments (count,) of every run, Moments of all runs at the drawn times)} of an item (profile,
    noise, {filter: parameters}, first run, number of runs)."""
    profile, noise, filters, first, count = item
    sums_of: dict[str, tuple[Records, Records]] = {}
    for name, params in filters.items():
        sums = measured(params, profile, noise_of(noise, name), NOISE_SEED, first, count)
        sums_of[name] = settled(sums), ensemble.over_runs(sums[:, ::THINNING_STEPS])
    if profile == RANGED_PROFILE:
        t = times()
        sums = ensemble.unscented_moments(UkfParameters(), profiles.truth(profile, t), profiles.distance(profile, t),
                                          NOISE_CASES[noise], RANGE_SIGMA_M, (NOISE_SEED, first, count))
        sums_of['imm_ukf'] = settled(sums), ensemble.over_runs(sums[:, ::THINNING_STEPS])
    return sums_of


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None, on: Sequence[str] = profiles.PROFILES,
        noises: Sequence[str] = tuple(NOISE_CASES)) -> Result:
    """Compare all filters in `runs` runs of each case; on: names of profiles; noises: names of NOISE_CASES."""
    pool = pool or monte_carlo.Pool(1)
    applicable = {noise: [name for name in FILTERS if NOISE_CASES[noise].bandwidth
                          or name not in NOISE_AWARE_FILTERS] for noise in noises}
    wanted = [(profile, noise, name) for profile in on for noise in noises for name in applicable[noise]
              if name not in UNTUNED_FILTERS]
    tuned = {(profile, noise): {name: FILTERS[name] for name in applicable[noise] if name in UNTUNED_FILTERS}
             for profile in on for noise in noises}
    for (profile, noise, name), params in zip(wanted, pool.map(
            tune, wanted, lambda share, text: progress(0.5 * share, f'tuning, {text}'))):
        tuned[profile, noise][name] = params
    items = [(*key, tuned[key], *part) for key in tuned for part in monte_carlo.batches(runs, BATCH_RUNS)]
    of_runs: dict[CaseName, list[Records]] = {}
    over_time: dict[CaseName, Records] = {}
    for (profile, noise, *_), sums_of in zip(items, pool.map(
            batch, items, lambda share, text: progress(0.5 + 0.5 * share, f'{runs} runs of each case, {text}'))):
        for name, (sums, thinned) in sums_of.items():
            case = profile, name, noise
            of_runs.setdefault(case, []).append(sums)
            over_time[case] = ensemble.sum_of_moments(over_time[case], thinned) if case in over_time else thinned
    values = {case: metrics(np.concatenate(sums)) for case, sums in of_runs.items()}
    means = {case: {metric: float(value.mean()) for metric, (value, _) in measured.items()}
             for case, measured in values.items()}
    table = rows(values)
    # Because all rows are too many for a terminal, only those with a target are printed.
    return Result(table, figures(means, over_time), remarks(means, tuned, runs), [r for r in table if r['target']])


def metrics(sums: Records) -> dict[str, tuple[Floats, str]]:
    """Return {metric: (values (runs,), unit)} of Moments (runs,).

    `reduction`: rms of the measured angle over that of the estimate. `..._over_sigma`: rms error over the sigma that
    the filter states. A consistent filter has a nis_mean equal to its degrees of freedom. Its nees_mean (angle and
    rate, per degree of freedom) and both ..._over_sigma are 1.
    """
    angle, rate, raw = (ensemble.rms(sums, name) for name in ('angle', 'rate', 'raw'))
    n = sums['runs']
    return {'angle_rms_deg': (np.degrees(angle), 'deg'), 'rate_rms_deg_s': (np.degrees(rate), 'deg/s'),
            'reduction': (raw / angle, ''), 'nis_mean': (sums['nis'] / n, ''),
            'nees_mean': (0.5 * sums['nees'] / n, ''),
            'angle_over_sigma': (angle / np.sqrt(sums['variance'] / n), ''),
            'rate_over_sigma': (rate / np.sqrt(sums['rate_variance'] / n), '')}


def rows(values: Mapping[CaseName, dict[str, tuple[Floats, str]]]) -> list[Row]:
    """Return a row for every metric of every case; values: {case: as `metrics` returns}."""
    return [row('/'.join(case), metric, value, unit,
                target=METRIC_TARGETS.get((*case[:2], metric)) if case[2] == SHOWN_NOISE else None)
            for case, measured in values.items() for metric, (value, unit) in measured.items()]


def _cell(measured: Mapping[str, float] | None) -> str:
    if measured is None:
        return 34 * ' '
    return (f'{measured["angle_rms_deg"]:.4f} ({measured["reduction"]:.1f})  {measured["rate_rms_deg_s"]:.4f}  '
            f'{measured["angle_over_sigma"]:.2f} {measured["rate_over_sigma"]:.2f}').ljust(34)


def remarks(values: Means, tuned: Mapping[tuple[str, str], Mapping[str, FilterParameters]], runs: int) -> list[str]:
    """Return the sentences that explain the rows, with a table of the profiles; tuned: {(profile, noise): filters}."""
    lines = [f'{runs} runs of each case. The columns are angle rms [deg] (reduction), rate rms [deg/s], and the error '
             f'over own sigma of angle and rate, for the noise {SHOWN_NOISE} deg. --json gives the rows of all cases.']
    on = [profile for profile, noise in tuned if noise == SHOWN_NOISE]
    if on:
        lines.append(f'{"":30}' + ''.join(f'{profile:34}' for profile in on).rstrip())
        lines += [f'{name:30}' + ''.join(_cell(values.get((profile, name, SHOWN_NOISE))) for profile in on).rstrip()
                  for name in SHOWN_FILTERS]
    for colour in ('white', 'coloured'):
        inconsistent: dict[str, dict[str, list[float]]] = {}
        for (_, name, noise), measured in values.items():
            measures = {'NIS': measured['nis_mean'] / degrees_of_freedom(name), 'angle': measured['angle_over_sigma'],
                        'rate': measured['rate_over_sigma']}
            if noise.startswith(colour):
                for what, value in measures.items():
                    if not CONSISTENCY_LIMITS[0] <= value <= CONSISTENCY_LIMITS[1]:
                        inconsistent.setdefault(name, {}).setdefault(what, []).append(value)
        listed = [f'    {name}: '
                  + ', '.join(f'{what} {min(outside):.2f} to {max(outside):.2f}' for what, outside in ranges.items())
                  for name, ranges in inconsistent.items()]
        if listed:
            lines += [f'Inconsistent filters under {colour} noise, with NIS per degree of freedom or error over own '
                      f'sigma outside {CONSISTENCY_LIMITS[0]:g} to {CONSISTENCY_LIMITS[1]:g} in at least one case:',
                      *listed]
    pairs = [(values[profile, name, noise]['reduction'],
              values[profile, name, noise.replace('white', 'coloured')]['reduction'])
             for profile, name, noise in values if noise == SHOWN_NOISE
             and (profile, name, noise.replace('white', 'coloured')) in values and name == 'current_statistical']
    if pairs:
        lines.append('The reductions above are for white noise at 100 Hz. For noise of the same rms within 5 Hz the '
                     'reduction of current_statistical falls from '
                     f'{", ".join(f"{white:.1f}" for white, _ in pairs)} to '
                     f'{", ".join(f"{colour:.1f}" for _, colour in pairs)}. Only the `-expecting` filters know the '
                     'bandwidth of the noise; all others assume white noise.')
    return lines


def figures(values: Means, over_time: Mapping[CaseName, Records]) -> Drawings:
    """Return the figures of the cases with the noise SHOWN_NOISE."""
    on = list(dict.fromkeys(profile for profile, _, noise in values if noise == SHOWN_NOISE))
    if not on:
        return {}
    return {'errors': lambda: errors_figure(over_time, on), 'rates': lambda: errors_figure(over_time, on, 'rate'),
            'rms': lambda: rms_figure(values, on), 'nis': lambda: nis_figure(values, on),
            'probabilities': lambda: probabilities_figure(over_time, on),
            'noise': lambda: noise_figure(values, on)}


FILTER_COLOURS = {'current_statistical': fig.RAW_COLOUR, 'current_statistical-rate-0.1': fig.FILTERED_COLOUR,
                  'imm': fig.TRUTH_COLOUR}


def errors_figure(over_time: Mapping[CaseName, Records], on: Sequence[str], what: str = 'angle') -> Figure:
    """Draw the error over time: mean +-1 sigma over the runs, and dashed the sigma that the filter states."""
    unit = 'deg' if what == 'angle' else 'deg/s'
    figure, axes = fig.new_panels(len(on), len(FILTER_COLOURS), height=1.0 + 1.4 * len(on),
                                  y=[f'{profile}\n[{unit}]' for profile in on], sharex=True, sharey='row')
    t = times()[::THINNING_STEPS]
    after = t >= SETTLING_TIME_S
    for line, profile in zip(axes, on):
        for panel, (name, colour) in zip(line, FILTER_COLOURS.items()):
            sums = over_time[profile, name, SHOWN_NOISE][after]
            mean = np.degrees(sums[what] / sums['runs'])
            sigma = np.degrees(np.sqrt(np.maximum(sums[f'{what}2'] / sums['runs'] - (sums[what] / sums['runs']) ** 2,
                                                  0.0)))
            own_sigma = np.degrees(np.sqrt(sums['variance' if what == 'angle' else 'rate_variance'] / sums['runs']))
            panel.fill_between(t[after], mean - sigma, mean + sigma, color=colour, alpha=0.35, linewidth=0.0)
            panel.plot(t[after], mean, color=colour, linewidth=0.8)
            for side in (-1.0, 1.0):
                panel.plot(t[after], side * own_sigma, color=fig.INK_COLOUR, linewidth=0.7, linestyle='--')
    for panel, name in zip(axes[0], FILTER_COLOURS):
        panel.set_title(name)
    return figure


def profile_panels(on: Sequence[str]) -> tuple[Figure, fig.Panels]:
    """Return (figure, panels) with a panel for each profile, two in a row, and room for a line of each filter."""
    rows = (len(on) + 1) // 2
    figure, axes = fig.new_panels(rows, 2, x='', height=0.8 + rows * (0.5 + 0.2 * len(SHOWN_FILTERS)), sharey=True)
    for panel in axes.flat[len(on):]:
        panel.set_visible(False)
    return figure, axes.flat[:len(on)]


def bars(values: Means, on: Sequence[str], metric: Callable[[str, Mapping[str, float]], float], label: str,
         colour: Callable[[str], str], text: Callable[[str, Mapping[str, float]], str]) -> tuple[Figure, fig.Panels]:
    """Return (figure, panels) with a panel of bars for each profile.

    metric, text: functions (filter, its metrics) that return the length of a bar and the text at its end.
    """
    figure, panels = profile_panels(on)
    for panel, profile in zip(panels, on):
        measured = {name: values.get((profile, name, SHOWN_NOISE)) for name in SHOWN_FILTERS}
        drawn = panel.barh(list(measured), [metric(name, at) if at else 0.0 for name, at in measured.items()],
                           color=[colour(name) for name in measured])
        panel.bar_label(drawn, [text(name, at) if at else '' for name, at in measured.items()], padding=2, fontsize=8)
        panel.margins(x=0.35)
        panel.locator_params(axis='x', nbins=3)
        panel.grid(axis='y', visible=False)
        panel.set_title(profile)
        panel.set_xlabel(label)
    panels[0].invert_yaxis()
    return figure, panels


def _colour(name: str) -> str:
    if name in UNTUNED_FILTERS:
        return fig.TRUTH_COLOUR
    return fig.FILTERED_COLOUR if name in RATE_SIGMAS_RAD_S else fig.RAW_COLOUR


def rms_figure(values: Means, on: Sequence[str]) -> Figure:
    """Draw the angle rms of every filter; the number on a bar is the reduction."""
    return bars(values, on, lambda name, at: at['angle_rms_deg'], 'angle rms [deg]', _colour,
                lambda name, at: f'{at["reduction"]:.1f}')[0]


def nis_figure(values: Means, on: Sequence[str]) -> Figure:
    """Draw the mean NIS per degree of freedom of every filter; a consistent filter has 1."""
    def nis(name: str, at: Mapping[str, float]) -> float:
        return at['nis_mean'] / degrees_of_freedom(name)

    figure, panels = bars(values, on, nis, 'NIS per degree of freedom', _colour,
                          lambda name, at: f'{nis(name, at):.2f}')
    for panel in panels:
        panel.axvline(1.0, color=fig.INK_COLOUR, linewidth=0.8)
        panel.axvspan(*CONSISTENCY_LIMITS, color=fig.INK_COLOUR, alpha=0.12, linewidth=0.0)
    return figure


def probabilities_figure(over_time: Mapping[CaseName, Records], on: Sequence[str]) -> Figure:
    """Draw the probability of each motion model in the filter imm, mean over the runs."""
    figure, axes = fig.new_panels(len(on), height=1.0 + 1.2 * len(on), sharex=True, sharey=True)
    for panel, profile in zip(axes[:, 0], on):
        sums = over_time[profile, 'imm', SHOWN_NOISE]
        for j, (name, colour) in enumerate(MODEL_COLOURS.items()):
            mu = sums['mu'][:, j] / sums['runs']
            if np.isfinite(mu).any():
                panel.plot(times()[::THINNING_STEPS], mu, color=colour, label=name)
        panel.set_title(profile)
        panel.set_ylim(0.0, 1.0)
    return legend(figure)


def noise_figure(values: Means, on: Sequence[str]) -> Figure:
    """Draw the reduction of every filter under each noise, which shows the effect of the bandwidth of the noise."""
    figure, panels = profile_panels(on)
    for panel, profile in zip(panels, on):
        colours = fig.RAW_COLOUR, fig.RAW_COLOUR, fig.FILTERED_COLOUR, fig.FILTERED_COLOUR
        for noise, colour, marker in zip(NOISE_CASES, colours, 'o^o^'):
            there = [name for name in SHOWN_FILTERS if (profile, name, noise) in values]
            panel.plot([values[profile, name, noise]['reduction'] for name in there], there, marker,
                           color=colour, ms=4.0, linestyle='', label=f'{noise} deg',
                           fillstyle='full' if marker == 'o' else 'none')
        panel.axvline(1.0, color=fig.INK_COLOUR, linewidth=0.8)
        panel.margins(x=0.06)
        panel.set_xlim(left=0.0)
        panel.locator_params(axis='x', nbins=4)
        panel.set_title(profile)
        panel.set_xlabel('reduction')
    panels[0].invert_yaxis()
    return legend(figure)
