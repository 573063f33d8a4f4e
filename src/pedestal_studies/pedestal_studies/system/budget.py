"""The error budget of scenario station_real: each term alone, the sum of all terms, and the run with all terms.

The contribution of a term is the pointing error of a run with this term on, minus the error of a run with all terms
off. The two runs have the same seed and are subtracted step by step. Systematic contributions are added as signed
vectors along the pass, random contributions as squares:

    combined^2 = mean |servo + sum of systematic|^2 + sum of mean |random|^2

A random term has both contributions: <term>-mean is its mean over the seeds and systematic, its deviation from this
mean is random. `servo` is the error with all terms off. `noise` is the deviation of that error between the seeds of
the receiver. Cases are <mode>/<term>. Cases <mode>/<time>s give the signed contributions at that time of the pass.
"""
import dataclasses
import functools
import typing
from collections.abc import Mapping
from typing import Annotated

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario import scenario, sections
from pedestal_common.graph import topics
from pedestal_common.parameters import defaults
from pedestal_common.quantities import Degrees, Floats, Pairs, Row, Seconds, Times
from pedestal_results import tracking
from pedestal_results.intervals import pseudo_values, row
from pedestal_results.report import figures as fig
from pedestal_studies.result import FIRST_SEED, Result, of_cases, seeds
from pedestal_workbench.trials.monte_carlo import Pool, Progress

SCENARIO_NAME = 'station_real'  # scenario of all runs, in which all terms are on
DEFAULT_RUNS = 30  # runs of the random terms
RANDOM_SHARE = 0.8  # part of the progress bar for the runs of the random terms [-]

EVALUATION_START_S, EVALUATION_PERIOD_S = 15.0, 0.1  # start and period of the evaluation of the error [s]
TABLE_TIMES_S = (30, 90, 150, 210, 270)  # times of the pass at which contributions are shown with their signs [s]
ERROR_COLUMNS = ('cross_elevation', 'elevation')  # names of the two columns of an error

MODE_OVERRIDES = {'program': ('acu.tracker.handover=false',), 'autotrack': ()}


class Term(typing.NamedTuple):
    """Source of error."""
    name: str
    parameters: tuple[str, ...]     # node.key, with * for both axes; with their defaults the term is off
    random: bool    # True if its error depends on the seed
    doc: str        # description


ERROR_TERMS = (
    Term('encoder-zero', ('adu.*.encoder.error.zero',), False, 'zero errors of both encoders'),
    Term('encoder-eccentricity', ('adu.*.encoder.error.eccentricity_sin', 'adu.*.encoder.error.eccentricity_cos'),
         False, 'eccentric encoder discs, error once per turn'),
    Term('encoder-interpolation', ('adu.*.encoder.error.interpolation',), False,
         'interpolation between the lines of the encoder disc'),
    Term('tilt', ('adu.mount.tilt_forward', 'adu.mount.tilt_starboard'), False, 'tilt of the azimuth axis'),
    Term('non-perpendicularity', ('adu.mount.non_perpendicularity',), False, 'non-perpendicularity of the two axes'),
    Term('collimation', ('adu.mount.collimation',), False, 'angle of the beam to the normal of the elevation axis'),
    Term('sag', ('adu.mount.sag',), False, 'sag of the dish and its feed, with cos E'),
    Term('gear-transmission', ('adu.*.gear_train.runout', 'adu.*.gear_train.tooth_error'), False,
         'runout and tooth errors of the pinions'),
    Term('cogging', ('adu.*.motor_1.cogging', 'adu.*.motor_2.cogging'), False, 'cogging of the motors'),
    Term('turning-bodies', ('adu.elevating.about_beam',), False,
         'inertia that varies with elevation, gyroscopic and cross-axis torques'),
    Term('wind', ('adu.wind.field.speed',), True, 'mean wind and gusts on both axes and on the structure'),
    Term('refraction', ('tracking_receiver.path.refractivity', 'scenario.program.refractivity'), False,
         'refractivity that the operator did not measure'),
    Term('ut1', ('tracking_receiver.target.leo_pass.ut1_offset',), False, 'rotation of the earth ahead of UTC'),
    Term('light-time', ('tracking_receiver.path.light_time',), False, 'motion of the target during the light time'),
    Term('prediction', ('scenario.program.time_offset',), False, 'satellite ahead of its elements'),
    Term('boresight', ('tracking_receiver.antenna.boresight_cross_elevation',
                       'tracking_receiver.antenna.boresight_elevation'), False,
         'angle of the null of the difference channels to the beam'),
    Term('multipath', ('tracking_receiver.path.multipath.reflection',), False, 'image of the target in the ground'),
    Term('scintillation', ('tracking_receiver.path.scintillation.level_db',
                           'tracking_receiver.path.scintillation.angle'), True,
         'turbulent air, in level and direction'),
    Term('polarisation', ('tracking_receiver.target.polarisation.axial_ratio_db',
                          'tracking_receiver.antenna.polarisation.axial_ratio_db'), False,
         'level lost by polarisation mismatch'))
NO_TERMS, ALL_TERMS = 'none', 'whole'  # values of `on` in place of the name of a term: no term, every term

RECEIVER_TERMS = ('boresight', 'multipath', 'scintillation', 'polarisation')  # have no effect in program track


def active_terms(mode: str) -> list[Term]:
    """Return the ERROR_TERMS that affect the antenna in a mode."""
    return [term for term in ERROR_TERMS if not (mode == 'program' and term.name in RECEIVER_TERMS)]


def documented(mode: str, random: bool) -> dict[str, str]:
    """Return {name: description} of the systematic or of the random contributions in a mode."""
    if random:
        noise = {'noise': 'noise of the receiver'} if mode == 'autotrack' else {}
        return noise | {term.name: f'{term.doc}: deviation from the mean' for term in active_terms(mode)
                        if term.random}
    return {'servo': 'lag, friction, quantisation, bending of the structure by the unbalance',
            **{term.name: term.doc for term in active_terms(mode) if not term.random},
            **{f'{term.name}-mean': f'{term.doc}: mean over the seeds' for term in active_terms(mode) if term.random}}


def parameters_of(term: Term) -> list[str]:
    """Return the parameters node.key of a term, separately for each axis."""
    return [key.replace('*', axis) for key in term.parameters
            for axis in (topics.AXES if '*' in key else topics.AXES[:1])]


def switched_off(term: Term) -> list[str]:
    """Return overrides that switch a term off: they give its parameters their defaults."""
    texts = []
    for key in parameters_of(term):
        node, _, name = key.partition('.')
        texts.append(f'{key}={str(defaults(sections.parameters_of(node))[name]).lower()}')
    return texts


def overrides(mode: str, on: str) -> list[str]:
    """Return the overrides of a run in a mode; on: name of the one term that is on, or NO_TERMS, or ALL_TERMS."""
    off = [] if on == ALL_TERMS else [text for term in ERROR_TERMS if term.name != on for text in switched_off(term)]
    return [*MODE_OVERRIDES[mode], *off]


@dataclasses.dataclass(frozen=True)
class Pass:
    """Direction of the antenna along the pass, at the times of an error."""
    times: Times
    azimuth: Floats     # [deg]
    elevation: Floats   # [deg]


def _run(mode: str, on: str, seed: int, duration: Seconds | None) -> Run:
    """Return the run of a mode, with a step every EVALUATION_PERIOD_S from EVALUATION_START_S on; on: argument of
    `overrides`; duration: None for that of the scenario."""
    chosen = scenario.load(SCENARIO_NAME, [*overrides(mode, on), f'adu.wind.field.seed={seed}'], seed=seed,
                           duration=duration)
    run = closed_loop.Loop(chosen).run()
    every = round(EVALUATION_PERIOD_S / (run.t[1] - run.t[0]))
    return run.where(np.arange(len(run.t)) % every == 0).where(run.t[::every] >= EVALUATION_START_S)


def pass_angles(duration: Seconds | None) -> Pass:
    """Return the direction along the pass of the scenario; duration: argument of `_run`."""
    run = _run('program', NO_TERMS, FIRST_SEED, duration)
    azimuth, elevation = np.degrees(run['joint_states']['position'].T)
    return Pass(run.t, azimuth, elevation)


def errors(case: tuple[str, str], run: int, duration: Seconds | None = None) -> Pairs:
    """Return the errors [deg], cross-elevation and elevation, of one run; case: arguments of `overrides`."""
    return np.degrees(_run(*case, FIRST_SEED + run, duration).truth['error'])


def rms(errors: Floats) -> Floats:
    """Return the root mean square (...,) of the length of errors (..., n, 2)."""
    return np.sqrt(np.mean(np.sum(errors ** 2, axis=-1), axis=-1))


def _sum(contributions: Mapping[str, Pairs]) -> Pairs:
    return sum(contributions.values(), np.zeros(()))


@dataclasses.dataclass(frozen=True)
class Budget:
    """Budget of a mode. All errors are in deg; their two columns are cross-elevation and elevation."""
    base: Annotated[Floats, '(runs, n, 2)']     # errors with all terms off; one run if no noise reaches the antenna
    once: dict[str, Pairs]      # {systematic term: its contribution}
    seeded: dict[str, Annotated[Floats, '(runs, n, 2)']]    # {random term: its contribution}
    whole: Annotated[Floats, '(runs, n, 2)']    # errors with all terms on

    def of(self, seeds: list[int]) -> 'Budget':
        """Return the budget of some of its runs, whose indices are given."""
        return Budget(self.base[seeds] if len(self.base) > 1 else self.base, self.once,
                      {name: e[seeds] for name, e in self.seeded.items()}, self.whole[seeds])

    @property
    def systematic(self) -> dict[str, Pairs]:
        """Systematic contributions."""
        return {'servo': self.base.mean(axis=0), **self.once,
                **{f'{name}-mean': e.mean(axis=0) for name, e in self.seeded.items()}}

    @property
    def random(self) -> dict[str, Floats]:
        """Random contributions {name: (runs, n, 2)}: deviations from the mean over the runs. Because this mean follows
        the errors, the deviations are too small; the factor sqrt(n / (n - 1)) corrects this."""
        off = {'noise': self.base} if len(self.base) > 1 else {}
        return {name: (e - e.mean(axis=0)) * np.sqrt(len(e) / (len(e) - 1.0))
                for name, e in (off | self.seeded).items()}

    @property
    def combined(self) -> Degrees:
        """Rms of all contributions together."""
        square = sum(np.mean(rms(e) ** 2) for e in self.random.values())
        # The mean of n runs still contains one n-th of the random variance.
        return float(np.sqrt(rms(_sum(self.systematic)) ** 2 + square * (1.0 - 1.0 / len(self.whole))))

    @property
    def to_whole(self) -> float:
        """`combined` over the rms of the runs with all terms on [-]."""
        return self.combined / float(np.sqrt(np.mean(rms(self.whole) ** 2)))


def budget(mode: str, runs: int, duration: Seconds | None, pool: Pool | None, progress: Progress) -> Budget:
    """Return the budget of a mode, with `runs` runs of the random terms."""
    measured = functools.partial(errors, duration=duration)
    seeded, once = ([term.name for term in active_terms(mode) if term.random == kind] for kind in (True, False))
    # Only in autotrack the noise of the receiver reaches the antenna, so only there the run without terms is random.
    random, systematic = [*seeded, ALL_TERMS], list(once)
    (random if mode == 'autotrack' else systematic).append(NO_TERMS)
    found = of_cases(measured, [(mode, on) for on in random], runs, pool,
                    lambda share, text: progress(RANDOM_SHARE * share, text), size=3)
    found |= of_cases(measured, [(mode, on) for on in systematic], 1, pool,
                     lambda share, text: progress(RANDOM_SHARE + (1.0 - RANDOM_SHARE) * share, text), size=1)
    base = found[mode, NO_TERMS]
    return Budget(base, {name: (found[mode, name] - base[:1])[0] for name in once},
                  {name: found[mode, name] - base for name in seeded}, found[mode, ALL_TERMS])


def _sizes(case: str, e: Floats) -> list[Row]:
    return [row(case, 'rms_deg', rms(e), 'deg'),
            *(row(case, f'{axis}_rms_deg', tracking.rms(e[..., i], axis=-1), 'deg')
              for i, axis in enumerate(ERROR_COLUMNS))]


def rows(mode: str, made: Budget, place: Pass) -> list[Row]:
    """Return the rows of a mode."""
    systematic = {**made.systematic, 'systematic': _sum(made.systematic)}
    table = []
    for name, e in (*systematic.items(), *made.random.items(), ('whole', made.whole)):
        table += _sizes(f'{mode}/{name}', e)
    seeds = list(range(len(made.whole)))
    table += [row(f'{mode}/combined', 'rms_deg', made.combined, 'deg'),
              row(f'{mode}/combined', 'to_whole', pseudo_values(seeds, lambda some: made.of(some).to_whole), '',
                  target='0.9 to 1.1')]
    for time in TABLE_TIMES_S:
        if place.times[0] <= time <= place.times[-1]:
            k = int(np.argmin(np.abs(place.times - time)))
            # The mean over 1.1 s removes the ripple of gears and motors from a contribution.
            near, case = slice(max(k - 5, 0), k + 6), f'{mode}/{time}s'
            table += [row(case, 'azimuth_deg', float(place.azimuth[k]), 'deg'),
                      row(case, 'elevation_deg', float(place.elevation[k]), 'deg')]
            table += [row(case, f'{name}_{axis}_deg', float(e[near, i].mean()), 'deg')
                      for name, e in systematic.items() for i, axis in enumerate(ERROR_COLUMNS)]
    return table


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None,
        duration: Seconds | None = None) -> Result:
    """Measure the budget of every mode; duration: length of the pass, None for that of the scenario."""
    if runs < 3:
        raise ValueError(f'--runs {runs}: must be at least 3, because random and systematic errors are separated by '
                         'their spread over the runs')
    def progress_of(i: int) -> Progress:
        return lambda share, text: progress((i + share) / len(MODE_OVERRIDES), text)

    place = pass_angles(duration)
    made = {mode: budget(mode, runs, duration, pool, progress_of(i)) for i, mode in enumerate(MODE_OVERRIDES)}
    table = [line for mode, of_mode in made.items() for line in rows(mode, of_mode, place)]
    return Result(table, {'budget': functools.partial(figure, made, place)},
                  [f'{seeds(runs)} `pedestal run {SCENARIO_NAME}` is a run of case autotrack/whole.'],
                  [line for line in table if not line['case'].endswith('s')])


def figure(made: Mapping[str, Budget], place: Pass) -> Figure:
    """Draw the rms of all contributions in every mode, and the systematic sum beside the runs with all terms on."""
    drawn, axes = fig.new_panels(len(made), 2, height=7.0, x='')
    for (left, right), (mode, of_mode) in zip(axes, made.items()):
        sizes = {name: np.mean(rms(e)) for name, e in (*of_mode.systematic.items(), *of_mode.random.items())}
        left.barh(list(sizes), list(sizes.values()))
        left.invert_yaxis()
        left.set_title(mode)
        left.set_xlabel('rms [deg]')
        total = _sum(of_mode.systematic)
        for i, axis in enumerate(ERROR_COLUMNS):
            line, = right.plot(place.times, of_mode.whole.mean(axis=0)[:, i], linewidth=0.7, label=axis)
            right.plot(place.times, total[:, i], '--', color=line.get_color())
        right.set_title('whole (mean of the seeds) and systematic sum (dashed)')
        right.set_ylabel('[deg]')
        right.set_xlabel('time [s]')
        right.legend()
    return drawn
