"""What trials are to be made of a scenario: the seed and the changed parameters of each, all known before the first.

Trial i has the seed first + i. The numbers its parameters are drawn from follow from that seed alone, or are point i
of a scrambled Sobol sequence (scipy.stats.qmc; Owen, Journal of Complexity 14 (1998) 466), so that a plan of more
trials begins with the same ones.
"""
import dataclasses
import hashlib
import math
import shlex

import numpy as np
from scipy.stats import qmc

from pedestal_analysis.trials import distributions
from pedestal_analysis.trials.distributions import VaryError
from pedestal_bringup.scenario import scenario
from pedestal_common import parameters
from pedestal_common.graph import nodes
from pedestal_common.text_files import csv_table, plain_yaml

PLAN_HEADER_KEYS = ('seed', 'duration', 'pacing', 'beam', 'beams')
"""Keys of the header that all trials share, or have from their number."""


@dataclasses.dataclass(frozen=True)
class Plan:
    """Trials of a scenario: source as the command names it; name and content of its file; overrides 'node.key=value'
    of all trials; duration [s], None for the scenario's; seed of the first trial; varied {node.key: values of the
    trials}; texts: of --vary, by which it is told from others."""
    source: str
    name: str
    content: str
    overrides: tuple
    duration: float | None
    seed: int
    runs: int
    varied: dict
    texts: tuple

    def changes(self, i):
        """The overrides of trial i."""
        return (*self.overrides, *(scenario.override(name, values[i]) for name, values in self.varied.items()))

    def scenario(self, i):
        """The scenario.Scenario of trial i. Raises ScenarioError."""
        return scenario.parse(self.name, self.content, self.changes(i), self.seed + i, self.duration)

    def command(self, i):
        """The command that runs trial i through the nodes."""
        duration = [] if self.duration is None else ['--duration', repr(self.duration)]
        changes = [part for change in self.changes(i) for part in ('--param', change)]
        return shlex.join(['pedestal', 'run', self.source, '--seed', str(self.seed + i), *duration, *changes])

    def part(self, numbers):
        """The Plan of some trials in a row, a range, numbered from 0 again."""
        varied = {name: values[numbers.start:numbers.stop] for name, values in self.varied.items()}
        return dataclasses.replace(self, seed=self.seed + numbers.start, runs=len(numbers), varied=varied)

    @property
    def identity(self):
        """{what: text} by which trials of this plan, whatever their number, are told from those of another."""
        return {'scenario': self.name, 'content': hashlib.sha256(self.content.encode()).hexdigest(),
                '--param': ' '.join(self.overrides), '--vary': ' '.join(self.texts), '--seed': str(self.seed),
                '--duration': str(self.duration)}


def plan(source, runs=None, vary=(), overrides=(), seed=None, duration=None, sobol=False) -> Plan:
    """The Plan of trials of a scenario, a name or a path.

    runs: how many, None for the rows of a table, else 100. vary: texts 'node.key=distribution', or a path of a .csv
    whose columns are parameters and whose rows are trials. overrides: texts 'node.key=value'. seed: of the first, None
    for the scenario's. sobol: the points of a Sobol sequence in the place of independent draws.
    Raises ScenarioError, VaryError, TableError for what cannot be run in every trial.
    """
    name, content = scenario.text(source)
    nominal = scenario.parse(name, content, overrides, seed, duration)
    if nominal.header.pacing != 'lockstep':
        overrides = (*overrides, 'scenario.pacing=lockstep')
    rows = [_table(path) for path in vary if path.endswith('.csv') and '=' not in path]
    drawn = dict(_drawn(text) for text in vary if '=' in text or not text.endswith('.csv'))
    names = [*drawn, *(column for table in rows for column in table)]
    for column in names:
        if names.count(column) > 1 or sum(text.startswith(f'{column}=') for text in vary) > 1:
            raise VaryError(f'--vary {column}: is varied twice')
    if runs is None:
        runs = min((len(values) for table in rows for values in table.values()), default=100)
    if runs < 1:
        raise VaryError(f'--runs {runs}: must be at least 1')
    if sobol and not drawn:
        raise VaryError('--sobol: nothing is drawn; a --vary NODE.KEY=DISTRIBUTION is missing')
    first = nominal.header.seed
    if first + runs > 2**31:
        raise VaryError(f'--runs {runs}: from seed {first} on there are {2**31 - first} seeds')
    u = _points(first, runs, len(drawn), sobol)
    varied = {column: _values(nominal, column, distribution, u[:, k])
              for k, (column, distribution) in enumerate(drawn.items())}
    for table in rows:
        for column, values in table.items():
            _field(nominal, column)
            if len(values) < runs:
                raise VaryError(f'--runs {runs}: the table has {len(values)} rows')
            varied[column] = values[:runs]
    texts = (*(f'{column}={distribution.text}' for column, distribution in drawn.items()), *['--sobol'] * sobol,
             *(hashlib.sha256(repr(table).encode()).hexdigest() for table in rows))
    made = Plan(source, name, content, tuple(overrides), duration, first, runs, varied, texts)
    for column in varied:
        _check(nominal, made, column, drawn.get(column))
    return made


def _drawn(text):
    """(node.key, Distribution) of a --vary."""
    column, equals, distribution = text.partition('=')
    if not equals:
        raise VaryError(f'--vary {text!r}: must be NODE.KEY=DISTRIBUTION or a table .csv')
    try:
        return column, distributions.parse(distribution)
    except VaryError as error:
        raise VaryError(f'--vary {column}: {error}') from None


def _table(path):
    """{node.key: values of the trials} of a CSV file with a header."""
    with csv_table.opened(path) as reader:
        columns = {column: [] for column in reader.fieldnames or ()}
        for row in reader:
            if None in row or None in row.values():
                raise csv_table.TableError(f'{path}: line {reader.line_num}: must have {len(columns)} cells')
            for column, cell in row.items():
                columns[column].append(plain_yaml.parse(cell))
    if not columns or not all(columns.values()):
        raise csv_table.TableError(f'{path}: must have a header of NODE.KEY and a row for each trial')
    return columns


def _points(first, runs, count, sobol):
    """Numbers between 0 and 1 (runs, count)."""
    if sobol:
        return qmc.Sobol(count, seed=first).random_base2(math.ceil(math.log2(runs)))[:runs]
    # A spawn key of its own keeps the draws of a seed apart from the noise of the same seed.
    return np.array([np.random.default_rng(np.random.SeedSequence(first + i, spawn_key=(0,))).random(count)
                     for i in range(runs)])


def _field(nominal, column):
    """The dataclass field of a parameter node.key that trials can vary. Raises VaryError, ScenarioError."""
    node, _, key = column.partition('.')
    scenario.parameters_of(node)
    if node == 'scenario' and key in PLAN_HEADER_KEYS:
        raise VaryError(f'--vary {column}: is the same for every trial, or follows from its number')
    there = dict.fromkeys((*map(nodes.plain, nominal.nodes), *nominal.nodes, 'scenario'))
    there.pop('operator', None)  # it has no parameters but those of the header
    if node not in there:
        raise VaryError(f'--vary {column}: {node} takes no part in {nominal.name}; there are {", ".join(there)}')
    fields = dict(parameters.flatten(type(_parameters(nominal, node))))
    if key not in fields:
        raise VaryError(f'--vary {column}: unknown parameter {key!r};{parameters.did_you_mean(key, fields)}')
    return fields[key]


def _parameters(nominal, node):
    """The parameter dataclass of a node, or of the header, as the scenario sets it."""
    return nominal.header if node == 'scenario' else nominal.node_parameters(node)


def _nominal_value(nominal, column):
    """What the scenario says of node.key."""
    node, _, key = column.partition('.')
    return parameters.as_dict(_parameters(nominal, node))[key]


def _values(nominal, column, distribution, u):
    """The values of a drawn parameter in the trials, at u (runs,)."""
    whole = _field(nominal, column).type is int
    if distribution.factor:
        said = _nominal_value(nominal, column)
        if isinstance(said, bool | str) or said == 0:
            raise VaryError(f'--vary {column}={distribution.text}: a factor of {said!r} varies nothing')
        values = said * distribution.draw(u)
    else:
        values = distribution.draw(u, whole)
    return _rounded(values.tolist(), whole)


def _rounded(values, whole):
    """Values as they are, or whole numbers for a parameter that is one; texts stay for the parameter to refuse."""
    return [round(value) if whole and isinstance(value, float) else value for value in values]


def _check(nominal, made, column, distribution):
    """Raise VaryError unless every value of a varied parameter is allowed where the others are as in the scenario."""
    values = made.varied[column]
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    extremes = [min(values), max(values)] if numbers else list(dict.fromkeys(values))
    if distribution and distribution.extremes:
        scaled = (np.array(distribution.extremes, object) * (_nominal_value(nominal, column) if distribution.factor
                                                             else 1))
        extremes += _rounded(scaled.tolist(), _field(nominal, column).type is int)
    for value in extremes:
        try:
            scenario.parse(made.name, made.content, [*made.overrides, scenario.override(column, value)], made.seed,
                           made.duration)
        except scenario.ScenarioError as error:
            text = f'={distribution.text}' if distribution else ''
            trial = f', trial {values.index(value)}' if value in values else ''
            raise VaryError(f'--vary {column}{text}{trial}: {error}') from None
