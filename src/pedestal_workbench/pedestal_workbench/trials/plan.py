"""Plan of the trials of a scenario: seed and varied parameters of each trial, all drawn before the first trial runs.

Trial i has the seed `first + i`, where `first` is the seed of the first trial. The random numbers that determine its
parameters depend on this seed alone, or are point i of a scrambled Sobol sequence (scipy.stats.qmc; Owen, Journal of
Complexity 14 (1998) 466). A plan of more trials therefore begins with the trials of a plan of fewer trials.
"""
import dataclasses
import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from pedestal_bringup.scenario import files as scenario_files
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.scenario import Draft, Scenario
from pedestal_bringup.scenario.sections import ScenarioError, parameters_of
from pedestal_bringup.scenario.variant import Variant
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.parameters import Parameters
from pedestal_common.quantities import Floats, Json
from pedestal_common.text_files import csv_table, plain_yaml
from pedestal_workbench.trials import distributions
from pedestal_workbench.trials.distributions import Distribution

DEFAULT_RUNS = 100  # number of trials without a table of trials, unless the user gives another

PLAN_HEADER_KEYS = ('seed', 'duration', 'pacing', 'beam', 'beams')
"""Keys of the header of a scenario that trials cannot vary, because trials share them or derive them from their
number."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """Trials of a variant of a scenario."""
    variant: Variant
    base: Draft     # its scenario without its changes, because a worker may not have the file
    overrides: tuple[str, ...]      # texts 'node.key=value' of its files and changes
    seed: int       # of the first trial
    runs: int       # number of trials
    varied: dict[str, list[Json]]   # {node.key: values in the trials}
    identity: dict[str, str]        # {name: text} that distinguishes these trials from others, whatever their number

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return self.base.name

    def drawn(self, i: int) -> list[str]:
        """Return the texts 'node.key=value' of the varied parameters of trial i."""
        return [scenario_files.override(name, values[i]) for name, values in self.varied.items()]

    def scenario(self, i: int) -> Scenario:
        """Return the scenario of trial i. Raises ScenarioError."""
        return self.checked(self.drawn(i), self.seed + i)

    def checked(self, more: Iterable[str], seed: int | None = None) -> Scenario:
        """Return the scenario of the variant with more texts 'node.key=value'. Raises ScenarioError."""
        return scenario.checked(self.base.changed((*self.overrides, *more)), self.seed if seed is None else seed,
                                self.variant.duration)

    def command(self, i: int) -> str:
        """Return the command line that runs trial i with ROS nodes."""
        return self.variant.with_(self.drawn(i), seed=self.seed + i).command()

    def part(self, numbers: range) -> 'Plan':
        """Return the plan of some consecutive trials; numbers: from 0 on."""
        varied = {name: values[numbers.start:numbers.stop] for name, values in self.varied.items()}
        return dataclasses.replace(self, seed=self.seed + numbers.start, runs=len(numbers), varied=varied)


def plan(variant: Variant, runs: int | None = None, vary: Sequence[str] = (), sobol: bool = False) -> Plan:
    """Return the plan of trials of a variant, whose seed is that of the first trial. Raises ValueError.

    runs       None: the number of rows of the tables in `vary`, or DEFAULT_RUNS without a table
    vary       texts 'node.key=distribution', or paths of .csv tables with parameters as columns and trials as rows
    sobol      True for the points of a Sobol sequence instead of independent draws
    """
    name, content = scenario_files.text(variant.source)
    overrides, base = variant.overrides(), Draft(name, scenario_files.sections_of(name, content))
    nominal = scenario.checked(base.changed(overrides), variant.seed, variant.duration)
    if nominal.header.pacing != 'lockstep':
        variant = variant.with_(['scenario.pacing=lockstep'])
        overrides.append('scenario.pacing=lockstep')
    first = nominal.header.seed
    tables = [_table(path) for path in vary if path.endswith('.csv') and '=' not in path]
    drawn = dict(_drawn(text) for text in vary if '=' in text or not text.endswith('.csv'))
    names = [*drawn, *(column for table in tables for column in table)]
    for column in names:
        if names.count(column) > 1 or sum(text.startswith(f'{column}=') for text in vary) > 1:
            raise ValueError(f'--vary {column}: the parameter is varied twice')
    runs = _count(runs, first, tables)
    if sobol and not drawn:
        raise ValueError('--sobol: needs at least one --vary NODE.KEY=DISTRIBUTION')
    u = _points(first, runs, len(drawn), sobol)
    varied = {column: _values(nominal, column, distribution, u[:, k])
              for k, (column, distribution) in enumerate(drawn.items())}
    for table in tables:
        varied |= _columns(nominal, table, runs)
    texts = (*(f'{column}={distribution.text}' for column, distribution in drawn.items()), *['--sobol'] * sobol,
             *(hashlib.sha256(repr(table).encode()).hexdigest() for table in tables))
    identity = {'scenario': name, 'content': hashlib.sha256(content.encode()).hexdigest(),
                '--param': ' '.join(overrides), '--vary': ' '.join(texts), '--seed': str(first),
                '--duration': str(variant.duration)}
    made = Plan(variant, base, tuple(overrides), first, runs, varied, identity)
    for column in varied:
        _check(nominal, made, column, drawn.get(column))
    return made


def _count(runs: int | None, first: int, tables: Iterable[Mapping[str, Sequence[Json]]]) -> int:
    if runs is None:
        runs = min((len(values) for table in tables for values in table.values()), default=DEFAULT_RUNS)
    if runs < 1:
        raise ValueError(f'--runs {runs}: must be at least 1')
    if first + runs > 2**31:
        raise ValueError(f'--runs {runs}: must be at most {2**31 - first}, the number of seeds from {first} on')
    return runs


def _drawn(text: str) -> tuple[str, Distribution]:
    column, equals, distribution = text.partition('=')
    if not equals:
        raise ValueError(f'--vary {text!r}: must be NODE.KEY=DISTRIBUTION or the path of a .csv table')
    try:
        return column, distributions.parse(distribution)
    except ValueError as error:
        raise ValueError(f'--vary {column}: {error}') from None


def _table(path: str) -> dict[str, list[Json]]:
    with csv_table.opened(path) as reader:
        columns: dict[str, list[Json]] = {column: [] for column in reader.fieldnames or ()}
        for row in reader:
            if None in row or None in row.values():
                raise csv_table.TableError(f'{path}: line {reader.line_num}: must have {len(columns)} cells')
            for column, cell in row.items():
                assert cell is not None     # see above
                columns[column].append(plain_yaml.parse(cell))
    if not columns or not all(columns.values()):
        raise csv_table.TableError(f'{path}: must have a header of NODE.KEY names and a row for each trial')
    return columns


def _columns(nominal: Scenario, table: Mapping[str, list[Json]], runs: int) -> dict[str, list[Json]]:
    """Return the columns of a table of trials, cut to the number of trials."""
    for column, values in table.items():
        field(nominal, column)
        if len(values) < runs:
            raise ValueError(f'--runs {runs}: must be at most {len(values)}, the rows of the table')
    return {column: values[:runs] for column, values in table.items()}


def _points(first: int, runs: int, count: int, sobol: bool) -> Floats:
    """Return numbers between 0 and 1 (runs, count), for `count` varied parameters; first: seed of the first trial."""
    if sobol:
        return qmc.Sobol(count, seed=first).random_base2(math.ceil(math.log2(runs)))[:runs]
    # The noise in the run uses the same seed. The spawn key makes the draws independent of this noise.
    return np.array([np.random.default_rng(np.random.SeedSequence(first + i, spawn_key=(0,))).random(count)
                     for i in range(runs)])


def field(nominal: Scenario, column: str, option: str = '--vary') -> dataclasses.Field[Json]:
    """Return the dataclass field of a parameter node.key, after a check that trials can vary it. nominal: scenario of
    the unvaried trials; option: option to name in the ValueError."""
    node, _, key = column.partition('.')
    parameters_of(node)
    if node == 'scenario' and key in PLAN_HEADER_KEYS:
        raise ValueError(f'{option} {column}: cannot vary, because trials share it or derive it from their number')
    present = dict.fromkeys((*map(nodes.plain, nominal.nodes), *nominal.nodes, 'scenario'))
    present.pop('operator', None)  # the operator has only the parameters of the header
    if node not in present:
        raise ValueError(f'{option} {column}: {node} is not in {nominal.name}; must be one of {", ".join(present)}')
    fields = dict(parameters.flatten(type(_parameters(nominal, node))))
    if key not in fields:
        raise ValueError(f'{option} {column}: unknown parameter {key!r};{parameters.did_you_mean(key, fields)}')
    return fields[key]


def _parameters(nominal: Scenario, node: str) -> Parameters:
    return nominal.header if node == 'scenario' else nominal.node_parameters(node)


def value_in(nominal: Scenario, column: str) -> Json:
    """Return the value of a parameter 'node.key' in a scenario."""
    node, _, key = column.partition('.')
    return parameters.as_dict(_parameters(nominal, node))[key]


def _values(nominal: Scenario, column: str, distribution: Distribution, u: Floats) -> list[Json]:
    """Return the values of a parameter in the trials, drawn at the numbers u (runs,) in 0 to 1."""
    whole = field(nominal, column).type is int
    if distribution.factor:
        value = value_in(nominal, column)
        if isinstance(value, bool | str) or value == 0:
            raise ValueError(f'--vary {column}={distribution.text}: a factor of {value!r} varies nothing')
        values = value * distribution.draw(u)
    else:
        values = distribution.draw(u, whole)
    return _rounded(values.tolist(), whole)


def _rounded(values: Iterable[Json], whole: bool) -> list[Json]:
    """Return values, rounded for an integer parameter. Texts stay, because the later check of the parameter refuses
    them."""
    return [round(value) if whole and isinstance(value, float) else value for value in values]


def _check(nominal: Scenario, made: Plan, column: str, distribution: Distribution | None) -> None:
    """Raise ValueError unless each value of a varied parameter is allowed with the other parameters of the scenario.
    distribution: None for a table."""
    values = made.varied[column]
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    extremes = [min(values), max(values)] if numbers else list(dict.fromkeys(values))
    if distribution and distribution.extremes:
        scaled = (np.array(distribution.extremes, object) * (value_in(nominal, column) if distribution.factor
                                                             else 1))
        extremes += _rounded(scaled.tolist(), field(nominal, column).type is int)
    for value in extremes:
        try:
            made.checked([scenario_files.override(column, value)])
        except ScenarioError as error:
            text = f'={distribution.text}' if distribution else ''
            trial = f', trial {values.index(value)}' if value in values else ''
            raise ValueError(f'--vary {column}{text}{trial}: {error}') from None
