"""`pedestal tune`: tune the parameters of the target filter or the gains of the feed-forward of the control unit. The
source is a recording or a scenario:

filter, from a recording   The unit of the control unit receives the recorded inputs again, as in `pedestal recompute`,
                           with changed parameters. The search maximises the mean log-density log N(nu; 0, S) of the
                           innovations nu of the angle, whose variance by the filter is S. This criterion prefers small
                           innovations and a correct S. To limit the weight of outliers, the log-density falls linearly
                           beyond HUBER_LIMIT_SIGMAS. Every second piece of the recording is reserved for validation.
filter, from a scenario    The closed loop runs with given seeds. The search minimises the rms of the true pointing
                           error of the axis in settled autotrack. A run with another seed validates the result.
feed-forward               The rate loop of the drive is identified (identification.py), which gives the gains k_v of
                           the rate and k_a of the acceleration. The closed loop validates the gains.
"""
import dataclasses
import math
import pathlib
import shlex
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import TypeAlias, TypeVar

import numpy as np

from acu_tracker.estimation.filters.kinds import FILTER_KINDS
from acu_tracker.estimation.params import FilterParameters, UkfParameters
from acu_tracker.modes import Mode
from acu_tracker.params import AcuParameters
from acu_tracker.unit_law import RANGE_TOPIC
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common import parameters
from pedestal_common.graph import layouts, topics
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node.unit import Unit
from pedestal_common.quantities import Floats, Json, Pair, Pairs, Records, Seconds
from pedestal_common.text_files import parameter_file
from pedestal_common.text_files.text_table import TextTable
from pedestal_common.wire import records
from pedestal_recording import configuration
from pedestal_results.tracking import HANDOVER_SETTLING_S
from pedestal_workbench.again import recompute, what_if
from pedestal_workbench.again.feed import FedRecording
from pedestal_workbench.tuning import identification, parameter_search

HUBER_LIMIT_SIGMAS = 4.0  # size above which an innovation is an outlier [standard deviations]
CONVERGENCE_TIME_S, PIECE_LENGTH_S = 1.0, 0.5
"""Time for the filter to converge after the first receiver error [s]; length of the pieces of a recording [s]."""
AXES = topics.AXES  # names of the axes
DEFAULT_SEED_COUNT = 2  # default number of seeds with which a scenario runs for each tried set of parameters
ESTIMATE_ERRORS = ('estimate_error_cross_elevation_rms_deg', 'estimate_error_elevation_rms_deg')
TUNED_UKF_PARAMETERS = ('cv_noise', 'ca_noise', 'dwell')
"""Tuned parameters of tracker.ukf. The other parameters of tracker.ukf have an effect only at the start."""


@dataclasses.dataclass(frozen=True)
class TuneOptions:
    """What is tuned, with which runs."""
    source: str             # recording, or scenario (name or .yaml file)
    filter: str | None      # kind of the tuned filter; None: the feed-forward is tuned
    axis: str               # azimuth, elevation or both
    seed: int | None        # first seed; None: that of the scenario
    runs: int | None        # number of runs with different seeds; None: the default
    duration: Seconds | None    # length of a run; None: that of the scenario
    param: list[str]        # changes of the scenario, texts NODE.KEY=VALUE
    output: pathlib.Path | None     # parameter file; None: the default
    command: str            # whole command line, for the head of the file

    @property
    def feedforward(self) -> bool:
        """True if the feed-forward is tuned, in place of a filter."""
        return self.filter is None


@dataclasses.dataclass(frozen=True)
class Score:
    """Score of a set of parameters, of azimuth and elevation."""
    searched: Pair      # criterion on the part of the data on which the search runs; smaller is better
    kept: Pair          # criterion on the part that is reserved for the validation
    nis: Pair           # mean NIS (normalised innovation squared) on the reserved part [-]
    pointing: dict[str, tuple[float, str]]      # {metric: (value, unit)} of further results


def log_density(innovation: Pairs, sigma: Pairs) -> Pairs:
    """Return the log-density log N(nu; 0, sigma^2) of innovations nu, without its constant. Beyond HUBER_LIMIT_SIGMAS
    it is linear (Huber 1964)."""
    z = np.abs(innovation / sigma)
    return -np.where(z <= HUBER_LIMIT_SIGMAS, 0.5 * z * z, HUBER_LIMIT_SIGMAS
                     * (z - 0.5 * HUBER_LIMIT_SIGMAS)) - np.log(sigma)


def _mean(values: Pairs) -> Pair:
    """Return the mean of the finite values of each column; infinite for a column without finite values."""
    return np.array([column[np.isfinite(column)].mean() if np.isfinite(column).any() else math.inf
                     for column in values.T])


class RecordedSource:
    """A recording as the source of the tuning. The criterion is the negative mean log-density of the innovations.
    Raises ValueError for too few receiver errors.

    searched, reserved     masks (n,) of the steps in the pieces for the search, for the validation
    ranged      True if the recording has a measured range
    of_beams    True for an array with several beams. Its control units are the nodes `beam_1/acu` and so on. A
                parameter file for `acu` then serves `pedestal run`, but not `ros2 run`.
    """

    criterion_name, unit, kept = 'negative log-likelihood of an error', '', 'on the reserved pieces'

    def __init__(self, path: pathlib.Path) -> None:
        self.recording = FedRecording(path)
        params = recompute.parameters_of(self.recording, 'acu')
        assert isinstance(params, AcuParameters)
        self.params = params
        self.of_beams = self.recording.bag.beam != ''
        done = recompute.recompute(self.recording, 'acu', self.params)
        self.feed = done.feed
        self.requests = {step: [command for command, _ in made] for step, made in done.requests.items()}
        present = self.feed.inputs[RANGE_TOPIC]['stamp'] != records.NO_STAMP
        self.ranged = np.isfinite(self.feed.inputs[RANGE_TOPIC]['range'][present]).any()
        t = self.feed.stamps / NS_PER_SECOND
        compared = np.isfinite(self._innovations(done.steps)[0]).all(axis=1)
        if not compared.any():
            raise ValueError(f'{path}: no receiver error to compare the filter with')
        counted = compared & (t >= t[compared][0] + CONVERGENCE_TIME_S)
        even = np.floor(t / PIECE_LENGTH_S).astype(int) % 2 == 0
        # Every second piece is for the search, the others are reserved for the validation.
        self.searched, self.reserved = counted & even, counted & ~even
        if not (self.searched.any() and self.reserved.any()):
            raise ValueError(f'{path}: receiver errors span {np.ptp(t[compared]):.3g} s; must be at least '
                             f'{CONVERGENCE_TIME_S + 2.0 * PIECE_LENGTH_S:g} s')

    def _innovations(self, steps: Records) -> Floats:
        """Return (3, n, 2): innovation [rad], its standard deviation [rad] and NIS [-] of both axes, of n outputs."""
        return np.array([layouts.of_filter(steps, name) for name in ('innovation', 'innovation_sigma', 'nis')])

    def _run(self, params: AcuParameters) -> tuple[Unit, Records]:
        unit = recompute.unit_of(self.recording, 'acu', params)
        return unit, recompute.compute(self.recording, unit, self.feed, requests=self.requests)[0]

    def criterion(self, params: AcuParameters) -> Pair:
        """Return the criterion of both axes, on the pieces for the search."""
        innovation, sigma, _ = self._innovations(self._run(params)[1])
        return _mean(-log_density(innovation, sigma)[self.searched])

    def score(self, params: AcuParameters) -> Score:
        """Return the score of parameters."""
        unit, steps = self._run(params)
        innovation, sigma, nis = self._innovations(steps)
        density = log_density(innovation, sigma)
        outputs = recompute.outputs_of(unit, self.feed, steps)
        numbers = what_if.numbers(what_if.evaluated(self.recording.bag, [outputs]))
        pointing = {}
        for name in ESTIMATE_ERRORS:
            if name in numbers:
                [value], of_value = numbers[name]
                pointing[name] = value, of_value
        return Score(searched=_mean(-density[self.searched]), kept=_mean(-density[self.reserved]),
                     nis=_mean(nis[self.reserved]), pointing=pointing)


class SimulatedSource:
    """A scenario as the source of the tuning. The criterion is the rms pointing error [deg] in the closed loop, in
    settled autotrack, or with any_mode in any mode except standby. The fields params, ranged and of_beams are as in
    RecordedSource. Raises ValueError if the run is never in such a mode."""

    criterion_name, unit, kept = 'pointing error rms', 'deg', 'on the reserved seed'

    def __init__(self, variant: Variant, runs: int, any_mode: bool) -> None:
        """Load the scenarios, one for each seed from that of the variant on; the seed after `runs` seeds validates."""
        chosen = variant.load()
        self.any_mode = any_mode
        self.of_beams = chosen.prefixes != ('',)
        self.params = chosen.node_parameters('acu')
        self.ranged = chosen.node_parameters('tracking_receiver').receiver.ranging.measured
        first = chosen.header.seed
        self.seeds, self.kept_seeds = range(first, first + runs), (first + runs,)
        self._scenarios = {seed: variant.with_(seed=seed).load() for seed in (*self.seeds, *self.kept_seeds)}
        if not np.isfinite(self.criterion(self.params)).all():
            mode = 'out of standby' if any_mode else 'in autotrack'
            raise ValueError(f'scenario {chosen.name}: never {mode} for more than {HANDOVER_SETTLING_S:g} s')

    def runs(self, params: AcuParameters, seeds: Iterable[int]) -> tuple[Records, Records]:
        """Return (steps, truth) of the settled parts of the runs with these parameters and seeds, all runs one after
        the other: records of closed_loop.STEP and closed_loop.TRUTH."""
        parts = []
        for seed in seeds:
            run = closed_loop.Loop(self._scenarios[seed], changed={'acu': params}).run()
            on = run['acu/mode'] != Mode.STANDBY if self.any_mode else run['acu/mode'] == Mode.AUTOTRACK
            start = run.t[on][0] + HANDOVER_SETTLING_S if on.any() else math.inf
            settled = on & (run.t >= start)
            parts.append((run.steps[settled], run.truth[settled]))
        steps, truth = map(np.concatenate, zip(*parts))
        return steps, truth

    def criterion(self, params: AcuParameters) -> Pair:
        """Return the criterion [deg] of both axes, with the seeds for the search."""
        _, truth = self.runs(params, self.seeds)
        return np.degrees(np.sqrt(_mean(truth['error']**2)))

    def score(self, params: AcuParameters) -> Score:
        """Return the score of parameters."""
        kept, truth = self.runs(params, self.kept_seeds)
        rms = np.degrees(np.sqrt(_mean(truth['error']**2)))
        difference = kept['acu/reference']['position'] - kept['joint_states']['position']
        following = np.degrees(np.sqrt(_mean(difference**2)))
        return Score(self.criterion(params), rms, _mean(layouts.of_filter(kept, 'nis')), {
            **{f'{name}_rms_deg': (value, 'deg') for name, value in zip(('cross_elevation', 'elevation'), rms)},
            **{f'{axis}_following_rms_deg': (value, 'deg') for axis, value in zip(AXES, following)}})


Source: TypeAlias = RecordedSource | SimulatedSource
_Params = TypeVar('_Params', bound=parameters.Parameters)


def _with_filter(params: AcuParameters, axis: str, changed: FilterParameters) -> AcuParameters:
    return dataclasses.replace(params, **{axis: dataclasses.replace(getattr(params, axis), filter=changed)})


def filters(source: Source, kind: str, axes: Sequence[str],
            progress: Callable[[float, str], object]) -> tuple[AcuParameters, dict[str, Json]]:
    """Return (parameters with the tuned filter, {name: value} of the tuned parameters). progress(share of the work
    that is done, text). Raises ValueError."""
    count = 0

    def counted(criterion: float, part: int) -> float:
        nonlocal count
        count += 1
        # Because the number of tries is not known in advance, the progress bar of an axis slows down toward its end.
        progress((part + 1.0 - math.exp(-count / 40.0)) / len(axes), f'{axes[part]}: {count} tried')
        return criterion

    params = source.params
    for axis in axes:
        params = _with_filter(params, axis, dataclasses.replace(getattr(params, axis).filter, kind=kind))
    settings = {f'{axis}.filter.kind': kind for axis in axes}
    if kind == 'imm_ukf':
        if not source.ranged:
            raise ValueError('--filter imm_ukf: needs a measured range (tracking_receiver.receiver.ranging.measured); '
                             'without range the filter equals imm')
        rows = [AXES.index(axis) for axis in axes]

        def with_ukf(ukf: UkfParameters) -> AcuParameters:
            return dataclasses.replace(params, tracker=dataclasses.replace(params.tracker, ukf=ukf))

        best, _ = parameter_search.tuned(params.tracker.ukf,
                                         lambda ukf: counted(source.criterion(with_ukf(ukf))[rows].sum(), 0),
                                         TUNED_UKF_PARAMETERS)
        best = _rounded(best, TUNED_UKF_PARAMETERS)
        return with_ukf(best), {**settings,
                                **{f'tracker.ukf.{name}': getattr(best, name) for name in TUNED_UKF_PARAMETERS}}
    for part, axis in enumerate(axes):
        count, i = 0, AXES.index(axis)

        def cost(changed: FilterParameters, axis: str = axis, i: int = i, part: int = part,
                 params: AcuParameters = params) -> float:
            return counted(source.criterion(_with_filter(params, axis, changed))[i], part)

        given = getattr(params, axis).filter
        best = _rounded(parameter_search.tuned(given, cost)[0], parameter_search.names(given))
        params = _with_filter(params, axis, best)
        values = parameters.as_dict(best)
        names = parameter_search.names(given) + (('imm.models',) if kind == 'imm' else ())
        settings.update({f'{axis}.filter.{name}': values[name] for name in names})
    return params, settings


def _rounded(params: _Params, names: Iterable[str]) -> _Params:
    values = parameters.as_dict(params)
    return parameters.build(type(params), {**values, **{name: float(f'{values[name]:.4g}') for name in names}})


def feedforward(chosen: Scenario, source: Source, axes: Iterable[str],
                progress: Callable[[float, str], object]) -> tuple[AcuParameters, dict[str, float]]:
    """Return (parameters with identified feed-forward gains, {name: value} of the gains)."""
    progress(0.1, 'identifying the rate loop')
    loops, params = identification.identify(chosen), source.params
    settings: dict[str, float] = {}
    for axis in axes:
        old = getattr(params, axis)
        new = dataclasses.replace(old.feedforward, rate_feedforward=float(f'{loops[axis].k_v:.5g}'),
                                  acceleration_feedforward=float(f'{loops[axis].k_a:.3g}'))
        params = dataclasses.replace(params, **{axis: dataclasses.replace(old, feedforward=new)})
        settings |= {f'{axis}.feedforward.rate_feedforward': new.rate_feedforward,
                     f'{axis}.feedforward.acceleration_feedforward': new.acceleration_feedforward}
    return params, settings


def main(options: TuneOptions, progress: Callable[[float, str], object]) -> list[str]:
    """Tune, write the parameter file and return the lines to print. Raises ValueError."""
    is_bag = pathlib.Path(options.source).is_dir() or options.source.endswith('.mcap')
    axes = AXES if options.axis == 'both' else (options.axis,)
    target = options.filter or 'feedforward'
    file = options.output or pathlib.Path(f'{pathlib.Path(options.source).stem}-{target}.yaml')
    _check(options, is_bag, file)
    source: Source
    variant = Variant(options.source, tuple(options.param), seed=options.seed, duration=options.duration)
    progress(0.0, 'reading' if is_bag else 'compiling the laws (first time only)')
    if is_bag:
        source = RecordedSource(pathlib.Path(options.source))
    else:
        source = SimulatedSource(variant, options.runs or DEFAULT_SEED_COUNT, options.feedforward)
    if options.filter is None:
        params, settings = feedforward(variant.load(), source, axes, progress)
    else:
        params, settings = filters(source, options.filter, axes, progress)
    whole = 0.0 if is_bag else dataclasses.replace(variant, duration=None).load().header.duration
    progress(0.98, 'validating')
    old, new = source.score(source.params), source.score(params)
    lines = [*_table(source, old, new, axes), *_remarks(source, old, new, axes, settings)]
    if options.duration and options.duration < whole:
        lines.append(f'tuned on the first {options.duration:g} s of the {whole:g} s of the scenario: the parameters '
                     'may be worse in the rest; without --duration the whole scenario counts')
    made = parameter_file.origin(options.command, configuration.git_revision() or 'unknown')
    parameter_file.write_new(file, {'acu': settings}, [*made, *lines])
    values = [f'{name:48} {value}' for name, value in settings.items()]
    hint = f'pedestal run ... --params-file {shlex.quote(str(file))}'
    if not source.of_beams:
        hint += f', or ros2 run acu_tracker acu_node --ros-args --params-file {shlex.quote(str(file))}'
    return [*lines, '', *values, f'written: {file}  ({hint})']


def _check(options: TuneOptions, is_bag: bool, file: pathlib.Path) -> None:
    if options.filter is not None and options.filter not in FILTER_KINDS:
        raise ValueError(f'--filter {options.filter}: must be one of {", ".join(FILTER_KINDS)}')
    if is_bag and options.feedforward:
        raise ValueError('--feedforward: identifies the drive of a scenario; use a scenario instead of a recording')
    for name in ('seed', 'runs', 'duration', 'param'):
        if is_bag and getattr(options, name) not in (None, []):
            raise ValueError(f'--{name} {getattr(options, name)}: is for a scenario; a recording cannot be changed')
    if options.runs is not None and options.runs < 1:
        raise ValueError(f'--runs {options.runs}: must be at least 1')
    if file.exists():
        raise ValueError(f'--output {file} exists already; the file is not overwritten, so give another name')
    if not file.parent.is_dir():
        raise ValueError(f'--output {file}: must be a file in a directory that exists')


def _table(source: Source, old: Score, new: Score, axes: Collection[str]) -> list[str]:
    rows = []
    for i, axis in enumerate(AXES):
        if axis in axes:
            rows += [(f'{axis}: {source.criterion_name}', old.searched[i], new.searched[i], source.unit),
                     (f'{axis}: {source.kept}', old.kept[i], new.kept[i], source.unit),
                     (f'{axis}: NIS mean', old.nis[i], new.nis[i], '')]
    rows += [(name, value, new.pointing[name][0], unit) for name, (value, unit) in old.pointing.items()]
    return TextTable((('', '<52'), ('old', '>11'), ('new', '>11'), ''),
                     [(name, _text(a), _text(b), unit) for name, a, b, unit in rows]).lines()


def _remarks(source: Source, old: Score, new: Score, axes: Iterable[str], settings: Mapping[str, Json]) -> list[str]:
    doubts = []
    for axis in axes:
        i = AXES.index(axis)
        if not new.kept[i] <= old.kept[i] + 1e-3 * abs(old.kept[i]):
            doubts.append(f'{axis}: {source.kept} the new parameters are no better than the old parameters')
    fields = dict(parameters.flatten(AcuParameters))
    for name, value in settings.items():
        meta = fields[name].metadata
        # Doubtful within 5 % of an end of the range. The value 0 switches a parameter off, and is no doubt.
        if 'low' in meta and not 1.05 * meta['low'] < value < 0.95 * meta['high'] and value > 0.0:
            doubts.append(f'{name} is at the end of its range: the optimum may be outside the range')
    return doubts


def _text(value: float) -> str:
    return f'{value:.5g}' if math.isfinite(value) else 'none'
