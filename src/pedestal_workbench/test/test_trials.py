"""Trials of a scenario: draws, refusals, a continued table, statistics against other methods, and the same numbers on
any pool."""
import dataclasses
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time

import distributed
import numpy as np
import pytest
from scipy import stats

from pedestal import cli
from pedestal.verbs import arguments
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_results import results
from pedestal_results.recorded_run import RecordedRun
from pedestal_workbench.trials import comparison, ensemble, monte_carlo, statistics
from pedestal_workbench.trials.distributions import parse
from pedestal_workbench.trials.plan import plan
from pedestal_workbench.trials.table import Table

INERTIA, BANDWIDTH = 'adu.azimuth.load.inertia', 'acu.azimuth.feedforward.bandwidth'
VARY = (f'{INERTIA}=normal(1, 0.1)x', f'{BANDWIDTH}=uniform(15, 25)')


@pytest.mark.parametrize('text, cumulative', [
    ('uniform(15, 25)', stats.uniform(15.0, 10.0).cdf), ('normal(-2, 0.5)', stats.norm(-2.0, 0.5).cdf)])
def test_draws_have_their_distribution(text, cumulative):
    u = np.random.default_rng(1).random(4000)
    assert stats.kstest(parse(text).draw(u), cumulative).pvalue > 0.01


def test_whole_numbers_and_choices_are_equally_likely():
    u = (np.arange(6000) + 0.5) / 6000
    assert np.unique(parse('uniform(5, 7)').draw(u, whole=True), return_counts=True)[1].tolist() == [2000] * 3
    drawn = parse('choice(cv, 2.5, true)').draw(u).tolist()
    assert {value: drawn.count(value) for value in drawn} == {'cv': 2000, 2.5: 2000, True: 2000}


def test_a_trial_is_drawn_from_its_seed_and_a_longer_plan_begins_with_it():
    for sobol in (False, True):
        few, many = (plan(Variant('leo_pass', seed=7), runs, VARY, sobol) for runs in (3, 8))
        assert [few.drawn(i) for i in range(3)] == [many.drawn(i) for i in range(3)]
    alone, among = (plan(Variant('leo_pass', seed=seed), runs, VARY) for seed, runs in ((9, 1), (7, 3)))
    assert alone.drawn(0) == among.drawn(2) and alone.command(0) == among.command(2)
    nominal = scenario.load('leo_pass').node_parameters('adu').azimuth.load.inertia
    factors = np.array(plan(Variant('leo_pass'), 500, VARY).varied[INERTIA]) / nominal
    assert stats.kstest(factors, stats.norm(1.0, 0.1).cdf).pvalue > 0.01


def test_sobol_points_fill_every_cell():
    """Of 16 points each of 16 stretches of either range holds one, which independent draws do not do."""
    made = plan(Variant('leo_pass'), 16, (f'{INERTIA}=uniform(100, 260)', f'{BANDWIDTH}=uniform(10, 26)'), True)
    for name, low, width in ((INERTIA, 100.0, 10.0), (BANDWIDTH, 10.0, 1.0)):
        assert sorted(((np.array(made.varied[name]) - low) // width).tolist()) == list(range(16))


def test_the_command_of_a_trial_says_what_the_trial_is():
    made = plan(Variant('leo_pass', ('acu.azimuth.filter.kind=ca',), seed=5, duration=6.0), 3, VARY)
    options = cli._parser().parse_args(made.command(2).split()[1:])
    assert made.scenario(2) == scenario.load(options.scenario, options.param, options.seed, options.duration)
    assert made.part(range(1, 3)).scenario(1) == made.scenario(2)


def test_the_command_of_a_trial_names_the_parameter_files(pedestal, tmp_path):
    """In place of their values; --param replaces these."""
    file = tmp_path / 'my loops.yaml'
    file.write_text(f'acu:\n  ros__parameters:\n    {BANDWIDTH.partition(".")[2]}: 12.0\n'
                    '    azimuth.filter.kind: ca\n')
    made = plan(Variant('leo_pass', ('acu.azimuth.filter.kind=cv',), (file,), seed=5), 2, VARY[:1])
    words = shlex.split(made.command(1))[1:]
    assert words[:5] == ['run', 'leo_pass', '--seed', '6', '--params-file'] and words[5] == str(file)
    assert words[6:8] == ['--param', 'acu.azimuth.filter.kind=cv'] and len(words) == 10
    options = cli._parser().parse_args(words)
    assert made.scenario(1) == arguments.variant(options).load()
    code, output, errors = pedestal('trials', 'leo_pass', '--runs', 1, '--duration', 3, '--workers', 1,
                                    '--params-file', file, '--param', 'acu.azimuth.filter.kind=cv')
    assert (code, errors) == (0, '') and BANDWIDTH not in output
    assert f"--duration 3.0 --params-file '{file}' --param acu.azimuth.filter.kind=cv\n" in output


def test_rows_of_a_file_are_trials(tmp_path, pedestal):
    file = tmp_path / 'rows.csv'
    file.write_text(f'{BANDWIDTH},acu.azimuth.filter.kind\n15,ca\n20.5,cv\n')
    made = plan(Variant('leo_pass'), vary=[str(file)])
    assert made.runs == 2 and made.varied == {BANDWIDTH: [15, 20.5], 'acu.azimuth.filter.kind': ['ca', 'cv']}
    file.write_text(f'{BANDWIDTH}\n15\n2000\n')
    code, _, errors = pedestal('trials', 'leo_pass', '--vary', file)
    assert code == 2 and errors.startswith(f'pedestal: error: --vary {BANDWIDTH}, trial 1: scenario leo_pass, acu: ')


REFUSED = {
    'unknown node': ((f'{INERTIA[1:]}=normal(1, 0.1)',), "'du' is no node"),
    'unknown parameter': (('adu.azimuth.load.inertai=uniform(1, 2)',), "did you mean 'azimuth.load.inertia'?"),
    'unknown distribution': ((f'{INERTIA}=gauss(1, 2)',), 'must be one of uniform(low, high), normal(mean, sigma)'),
    'no distribution': ((f'{INERTIA}=20',), 'must be one of uniform(low, high)'),
    'two ends': ((f'{INERTIA}=uniform(1, 2, 3)',), 'must be uniform(low, high)'),
    'no number': ((f'{INERTIA}=uniform(1, b)',), "'b' must be a number"),
    'turned round': ((f'{INERTIA}=uniform(2, 1)',), 'low must be below high'),
    'no spread': ((f'{INERTIA}=normal(2, 0)',), 'sigma must be above 0'),
    'leaves its range': ((f'{INERTIA}=uniform(-1, 200)',), 'inertia = -1 kg m2: must be 0.1 to 1e+07'),
    'a draw leaves its range': ((f'{INERTIA}=normal(1, 2)x',), 'kg m2: must be 0.1 to 1e+07'),
    'an option': (('acu.azimuth.filter.kind=choice(ca, cx)',), "'cx': must be one of"),
    'crosses another': (('adu.azimuth.load.inertia=choice(text)',), 'must be a number'),
    'factor of text': (('acu.azimuth.filter.kind=normal(1, 0.1)x',), "a factor of 'imm' varies"),
    'twice': ((f'{INERTIA}=uniform(1, 2)', f'{INERTIA}=uniform(1, 3)'), 'is varied twice'),
    'ashore': (('ins.latency=uniform(0, 0.01)',), 'ins is not in leo_pass; must be one of'),
    'seed': (('scenario.seed=uniform(1, 9)',), 'scenario.seed: cannot vary, because trials share it or derive it'),
    'no file': (('rows.csv',), 'rows.csv: No such file'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_refused_before_anything_runs(pedestal, tmp_path, case):
    vary, expected = REFUSED[case]
    code, output, errors = pedestal('trials', 'leo_pass', '--runs', 20, *(part for text in vary
                                                                         for part in ('--vary', text)))
    assert (code, output) == (2, '') and expected in errors and errors.count('\n') == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('options, expected', [
    (('--runs', 0), '--runs 0: must be at least 1'), (('--sobol',), '--sobol: needs at least one --vary'),
    (('--seed', 2**31 - 3, '--runs', 4), '--runs 4: must be at most 3, the number of seeds from 2147483645 on'),
    (('--against-param', 'acu.azimuth.filter.kind=cx'), "'cx': must be one of"),
    (('--side', 'a/b', f'{BANDWIDTH}=20'), '--side a/b: must be a name of letters, digits'),
    (('--side', 'base', f'{BANDWIDTH}=20'), 'other than base'),
    (('--require', 'pointing_max_deg'), 'must be RESULT < LIMIT'),
    (('--require', 'pointing_mx_deg < 1'), "did you mean 'pointing_max_deg'?"),
    (('--by', 'bar'), "--by bar: no trial has a result 'bar'"),
    (('--by', 'pointing_mx_deg'), "did you mean 'pointing_max_deg'?"),
    (('--solve', BANDWIDTH), '--solve: needs --until'), (('--until', 'loss_s = 1'), '--until: needs --solve'),
    (('--solve', BANDWIDTH, '--until', 'loss_s < 1'), 'must be RESULT = LIMIT'),
    (('--solve', BANDWIDTH, '--until', 'los_s = 1'), "did you mean 'loss_s'?"),
    (('--solve', f'{BANDWIDTH}=20', '--until', 'loss_s = 1'), 'must be NODE.KEY=LOW:HIGH'),
    (('--solve', f'{BANDWIDTH}=20:10', '--until', 'loss_s = 1'), 'LOW below HIGH'),
    (('--solve', 'acu.azimuth.filter.kind', '--until', 'loss_s = 1'), 'must be a parameter with a number'),
    (('--solve', 'acu.azimuth.feed', '--until', 'loss_s = 1'), '--solve acu.azimuth.feed: unknown parameter'),
    (('--solve', BANDWIDTH, '--until', 'loss_s = 1', '--require', 'loss_s < 1'), '--require: has no effect'),
    (('--solve', BANDWIDTH, '--until', 'loss_s = 1', '--vary', f'{BANDWIDTH}=uniform(10, 20)'), 'is varied too')])
def test_options_that_cannot_be_met(pedestal, options, expected):
    code, output, errors = pedestal('trials', 'leo_pass', *options)
    assert (code, output) == (2, '') and expected in errors and errors.count('\n') == 1


def test_a_table_continues_after_its_last_complete_row(tmp_path):
    def open_table(identity=None):
        return Table(tmp_path, 'trials', identity or {'--seed': '1'}, [INERTIA], ['loss_s', 'aligned_s'])

    with open_table() as table:
        table.append([[0, 1, 0.1 + 0.2, 1e-300, None], [1, 2, 0.5, math.nan, None]])
        with pytest.raises(ValueError, match='another process writes the file'):
            open_table().__enter__()
    with open(table.file, 'ab') as stream:
        stream.write(b'2,3,0.77')
    with open_table() as table:
        assert table.column(INERTIA).tolist() == [0.1 + 0.2, 0.5] and table.measured_results == ['loss_s']
        table.append([[2, 3, 0.7, 2.0, None]])
        assert np.array_equal(table.column('loss_s'), [1e-300, math.nan, 2.0], equal_nan=True)
    assert table.file.read_text().splitlines()[-2:] == ['1,2,0.5,nan,', '2,3,0.7,2.0,']
    with pytest.raises(ValueError, match='contains other trials \\(--seed 1, not 2\\)'):
        open_table({'--seed': '2'}).__enter__()


DAMAGED = {
    'text for a number': ((2, 3, 'abc'), "line 3: loss_s = 'abc': must be a number, or empty for no result"),
    'decimal comma': ((2, 3, '"2,7E-3"'), "line 3: loss_s = '2,7E-3': must be a number"),
    'digits with _': ((2, 3, '1_0'), "line 3: loss_s = '1_0': must be a number"),
    'text for a parameter': ((2, 2, 'x'), f"line 3: {INERTIA} = 'x': must be 210.5"),
    'another seed': ((1, 1, '9'), "line 2: seed = '9': must be 7"),
    'a row less': ((1, None, None), "line 2: trial = '1': must be 0"),
    'a short row': ((2, slice(2, None), []), 'line 3: 2 cells: must be 5 as in line 1'),
    'a foreign last line': ((3, slice(None), ['end of file']), 'line 4: 1 cells: must be 5 as in line 1'),
    'a blank line': ((2, slice(None), []), 'line 3: 0 cells: must be 5'),
    'other names': ((0, 3, 'loss'), 'line 1: must hold the names of the columns'),
    'other letters': ((2, 4, '\udcff'), 'line 3: byte 0xff: must be text in UTF-8'),
    'a quote': ((2, 3, '"1.5'), 'line 4: 4 cells: must be 5'),
}


@pytest.mark.parametrize('case', DAMAGED)
def test_a_damaged_row_is_named_and_not_read(tmp_path, case):
    def open_table():
        return Table(tmp_path, 'trials', {}, [INERTIA], ['loss_s'], ['why'], [(7 + i, 210.5) for i in range(3)])

    with open_table() as table:
        table.append([[i, 7 + i, 210.5, 0.1 * i, 'lost: at 3 s'] for i in range(3)])
    (line, cell, value), expected = DAMAGED[case]
    rows = [row.split(',') for row in table.file.read_text().splitlines()]
    if cell is None:
        del rows[line]
    else:
        rows[line][cell] = value
    before = '\n'.join([*map(','.join, rows), '']).encode(errors='surrogateescape')
    table.file.write_bytes(before)
    with pytest.raises(ValueError) as raised:
        open_table().__enter__()
    assert f'{table.file}: {expected}' in str(raised.value) and '\n' not in str(raised.value)
    assert table.file.read_bytes() == before


def test_a_table_that_a_spreadsheet_wrote_again_goes_on(tmp_path):
    """Other line ends and a byte order mark leave the rows equal; a text for a result is refused."""
    command = ('leo_pass', '--runs', 2, '--duration', 3, '--workers', 1)
    assert cli.main(['trials', *map(str, command), '--output', str(tmp_path)]) == 0
    file = tmp_path / 'trials.csv'
    content = file.read_bytes()
    file.write_bytes(b'\xef\xbb\xbf' + content.replace(b'\n', b'\r\n'))
    made = plan(Variant('leo_pass', duration=3.0), 2)
    with ensemble.open_table(made, tmp_path) as table:
        assert len(table.rows) == 2
    name, cell = 'azimuth_following_rms_deg', str(table.column('azimuth_following_rms_deg')[1])
    file.write_bytes(content.replace(cell.encode(), b'abc'))
    with pytest.raises(ValueError, match=f"line 3: {name} = 'abc': must be a number"):
        ensemble.open_table(made, tmp_path).__enter__()


def make(made, folder, pool):
    with ensemble.open_table(made, folder) as table:
        ensemble.run_missing_trials([made], [table], pool)
        return table


@pytest.mark.thorough
def test_the_same_numbers_whoever_works_and_a_plan_that_goes_on(tmp_path):
    made = plan(Variant('leo_pass', duration=4.0), 6, VARY)
    expected = make(made, tmp_path / 'one', monte_carlo.Pool(1))
    with monte_carlo.Pool(2) as pool:
        make(dataclasses.replace(made, runs=3), tmp_path / 'two', pool)
        assert make(made, tmp_path / 'two', pool).file.read_bytes() == expected.file.read_bytes()
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with monte_carlo.Pool(scheduler=cluster.scheduler_address) as pool:
            assert make(made, tmp_path / 'dask', pool).file.read_bytes() == expected.file.read_bytes()
    values = results.measured(RecordedRun(memory_recording.record(made.scenario(5))).parts)
    assert {name: expected.column(name)[5] for name in expected.measured_results} == {name: value
                                                                         for name, (value, _) in values.items()}


def start_many(folder):
    """The command that makes 96 trials in a folder: three batches, so that it can be stopped after the first."""
    return subprocess.Popen([sys.executable, '-m', 'pedestal.cli', 'trials', 'leo_pass', '--runs', '96',
                             '--duration', '3', '--workers', '1', '--vary', VARY[0], '--output', folder.name],
                            cwd=folder.parent, start_new_session=True, text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.PIPE)


def finish_many(folder):
    """Their rows, once the command has come to its end."""
    process = start_many(folder)
    _, errors = process.communicate(timeout=300.0)
    assert (process.returncode, errors) == (0, '')
    return (folder / 'trials.csv').read_bytes()


@pytest.fixture(scope='module')
def never_stopped(tmp_path_factory):
    return finish_many(tmp_path_factory.mktemp('many') / 'whole')


@pytest.mark.thorough
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGKILL])
def test_a_command_that_was_stopped_goes_on(never_stopped, tmp_path, number):
    """Its rows are those of a command that was not."""
    def rows():
        file = tmp_path / 'cut' / 'trials.csv'
        return file.read_bytes().count(b'\n') - 1 if file.exists() else 0

    process = start_many(tmp_path / 'cut')
    try:
        while rows() < 4:
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        os.killpg(process.pid, number)
        _, errors = process.communicate(timeout=60.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    done = rows()
    assert 4 <= done < 96
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert errors == f'pedestal: {done} of 96 trials are in cut; the same command continues\npedestal: stopped\n'
    assert finish_many(tmp_path / 'cut') == never_stopped


@pytest.mark.thorough
def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of the median, of a rate and of a rank correlation, over 1000 samples of 30."""
    rng, hit = np.random.default_rng(3), np.zeros(3)
    rho = 0.6
    true_rank = 6.0 / math.pi * math.asin(0.5 * rho)
    for _ in range(1000):
        x = rng.standard_normal(30)
        y = rho * x + math.sqrt(1.0 - rho * rho) * rng.standard_normal(30)
        for k, (estimate, truth) in enumerate(((statistics.percentile(x, 50), 0.0),
                                               (statistics.rate(int((x > 1.0).sum()), 30), 100.0 * stats.norm.sf(1)),
                                               (statistics.rank_correlation(x, y), true_rank))):
            hit[k] += estimate[1] <= truth <= estimate[2]
    assert (hit >= 930).all() and hit[2] <= 970


def test_a_rate_of_none_and_of_all_has_the_closed_form():
    """Clopper and Pearson: 1 - (alpha / 2)^(1 / n)."""
    end = 100.0 * (1.0 - 0.025**(1.0 / 40))
    assert statistics.rate(0, 40) == pytest.approx((0.0, 0.0, end))
    assert statistics.rate(40, 40) == pytest.approx((100.0, 100.0 - end, 100.0))


def test_texts_have_no_order(tmp_path):
    """Eta squared of three kinds against the analysis of variance of the ranks; the same in any order of the rows."""
    rng = np.random.default_rng(6)
    kinds = np.repeat(['imm', 'ca', 'cv'], 20)
    values = np.repeat([1.0, 1.6, 0.6], 20) + 0.4 * rng.standard_normal(60)
    ranks = stats.rankdata(values)
    between = sum(20 * (ranks[kinds == kind].mean() - ranks.mean())**2 for kind in ('imm', 'ca', 'cv'))
    share = between / np.sum((ranks - ranks.mean())**2)
    expected, found = 1.0 - (1.0 - share) * 59 / 57, []
    for name, order in (('first', np.arange(60)), ('mixed', rng.permutation(60))):
        with Table(tmp_path, name, {}, ['acu.azimuth.filter.kind'], ['pointing_rms_deg']) as table:
            table.append([[i, i, kinds[k], float(values[k])] for i, k in enumerate(order)])
        rows = statistics.of_sensitivity('leo_pass', table)
        assert [row['metric'] for row in rows] == ['pointing_rms_deg/eta_squared(acu.azimuth.filter.kind)']
        found.append(rows[0])
    assert found[0]['value'] == pytest.approx(expected, rel=1e-12) and expected > 0.4
    assert found[0]['value'] == pytest.approx(found[1]['value'], rel=1e-12)
    assert 0.2 < found[0]['ci_low'] < expected < found[0]['ci_high'] < 0.8


@pytest.mark.thorough
def test_the_interval_of_eta_squared_holds_the_truth_as_often_as_it_says():
    """Three kinds, with no effect and with one; the truth is that of 100,000 trials each."""
    rng = np.random.default_rng(8)
    for effect in (0.0, 0.8):
        shift = effect * np.array([0.0, 1.0, 2.0])
        x, y = np.repeat(np.arange(3), 100000), np.repeat(shift, 100000) + rng.standard_normal(300000)
        truth, hit = statistics.eta_squared(x, y)[0] if effect else 0.0, 0
        for _ in range(300):
            x = np.repeat(np.arange(3), 12)
            _, low, high = statistics.eta_squared(x, shift[x] + rng.standard_normal(36))
            hit += low <= truth <= high
        assert hit >= 277


def test_categories_that_explain_everything_or_nothing():
    x = np.repeat([0.0, 1.0], 5)
    assert statistics.eta_squared(x, x)[0] == pytest.approx(1.0)
    assert statistics.eta_squared(x, np.tile(np.arange(5.0), 2))[0] == 0.0
    for constant in (statistics.eta_squared(x, np.ones(10)), statistics.eta_squared(np.ones(10), x),
                     statistics.eta_squared(np.arange(10.0), x)):
        assert np.isnan(constant).all()


def test_trials_that_never_track_say_so(tmp_path):
    with Table(tmp_path, 'never', {}, [], ['lock_time_s', 'pointing_rms_deg']) as table:
        table.append([[0, 0, 12.5, None]])
    with pytest.raises(ValueError, match='^no trial ever tracked .* a longer --duration, .* --by: lock_time_s$'):
        statistics.ranked_by([table])
    with pytest.raises(ValueError, match='^--by pointing_rms_deg: no trial has this result'):
        statistics.ranked_by([table], 'pointing_rms_deg')


def test_a_filter_kind_as_a_choice(pedestal, tmp_path):
    """Through the command line: the line, the row and the page name eta squared, and no rank correlation."""
    kind = 'acu.azimuth.filter.kind'
    code, output, errors = pedestal('trials', 'leo_pass', '--runs', 6, '--duration', 5, '--vary',
                                    f'{kind}=choice(ca, cv)', '--workers', 1, '--json', 'rows.json')
    assert (code, errors) == (0, '') and f'pointing_rms_deg/eta_squared({kind}): ' in output
    rows = {row['metric']: row for row in json.loads((tmp_path / 'rows.json').read_text())['rows']}
    assert 0.0 <= rows[f'pointing_rms_deg/eta_squared({kind})']['value'] <= 1.0
    page = (tmp_path / 'trials' / 'leo_pass' / 'trials.html').read_text()
    assert f'pointing_rms_deg/eta_squared({kind})' in page
    assert not any('rank_correlation' in text for text in (output, page, *rows))


def sides(tmp_path, a, b):
    tables = [Table(tmp_path, name, {}, [], ['pointing_rms_deg', 'isolation_db']) for name in 'ab']
    for table, values in zip(tables, (a, b)):
        with table:
            table.append([[i, i, value, 60.0 - value] for i, value in enumerate(values.tolist())])
    return comparison.Sides('A', 'B', *tables)


def test_a_gain_is_found_where_there_is_one(tmp_path):
    """12 % better with common noise; the interval agrees with a bootstrap over pairs."""
    rng = np.random.default_rng(4)
    b = 0.01 * np.exp(0.2 * rng.standard_normal(60))
    a = 0.88 * b * np.exp(0.05 * rng.standard_normal(60))
    found = sides(tmp_path, a, b)
    rows = {row['metric']: row for row in comparison.rows(found)}
    assert set(rows) == {*(f'pointing_rms_deg/{key}' for key in ('difference', 'gain', 'ratio', 'wins')),
                         'isolation_db/difference', 'isolation_db/wins'}
    assert rows['pointing_rms_deg/ratio']['value'] == pytest.approx(a.mean() / b.mean())
    gain = rows['pointing_rms_deg/gain']
    assert gain['ci_low'] < 12.0 < gain['ci_high'] and gain['runs'] == 60
    drawn = rng.integers(0, 60, (4000, 60))
    bootstrap = np.percentile(100.0 * (1.0 - a[drawn].mean(axis=1) / b[drawn].mean(axis=1)), (2.5, 97.5))
    assert (gain['ci_low'], gain['ci_high']) == pytest.approx(bootstrap, abs=0.25)
    assert rows['isolation_db/wins']['value'] == rows['pointing_rms_deg/wins']['value']
    assert comparison.sentence(found, 'pointing_rms_deg').startswith('A is better than B by 12 +- 1.')
    assert comparison.sentence(found, 'isolation_db').startswith('A is better than B by 0.001')


@pytest.mark.parametrize('factor, said', [
    (50.0, r'A is better than B by a factor of 5\d(\.\d)? \(4\d\.?\d? to 5\d\.?\d?\) \(pointing_rms_deg, 40 pairs'),
    (2.5, r'A is better than B by a factor of 2\.[45]\d? \(2\.[34]'), (1.8, r'A is better than B by 4\d \+- \d')])
def test_a_ratio_above_two_is_said_as_a_factor(tmp_path, factor, said):
    """98 % hides a factor of 50; its interval agrees with a bootstrap over pairs."""
    rng = np.random.default_rng(6)
    a = 0.01 * np.exp(0.1 * rng.standard_normal(40))
    b = factor * a * np.exp(0.05 * rng.standard_normal(40))
    found = sides(tmp_path, a, b)
    assert re.match(said, comparison.sentence(found, 'pointing_rms_deg'))
    drawn = rng.integers(0, 40, (4000, 40))
    bootstrap = np.percentile(a[drawn].mean(axis=1) / b[drawn].mean(axis=1), (2.5, 97.5))
    assert comparison.ratio(a, b)[1:] == pytest.approx(bootstrap, rel=0.01)
    nothing = comparison.sentence(sides(tmp_path / 'none', np.zeros(40), b), 'pointing_rms_deg')
    assert nothing.startswith(f'A is better than B by {b.mean():.2g} +- ') and ' deg (' in nothing


def test_sides_without_the_result_are_not_identical(tmp_path):
    missing = np.full(4, math.nan)
    assert comparison.sentence(sides(tmp_path, missing, missing), 'pointing_rms_deg') == (
        'A against B: no trial of either side has pointing_rms_deg; choose a result that they have with --by.')


KINDS = tuple(f'acu.{axis}.filter.kind' for axis in ('azimuth', 'elevation'))


@pytest.mark.parametrize('changes, named', [
    ([(), (f'{KINDS[0]}=ca',)], ('azimuth.filter.kind=imm', 'azimuth.filter.kind=ca')),
    ([(), (f'{KINDS[0]}=ca', f'{KINDS[1]}=ca')], ('filter.kind=imm', 'filter.kind=ca')),
    ([(), (f'{KINDS[0]}=ca', f'{KINDS[1]}=cv')], ('azimuth.filter.kind=imm elevation.filter.kind=imm',
                                                  'azimuth.filter.kind=ca elevation.filter.kind=cv')),
    ([('adu.wind.field.speed=2',), ('adu.wind.field.speed=2', 'adu.azimuth.load.inertia=200')],
     ('azimuth.load.inertia=210', 'azimuth.load.inertia=200')),
    ([(), ('adu.azimuth.limits.upper=4', 'adu.elevation.limits.upper=1.6')],
     ('azimuth.limits.upper=4.712389 elevation.limits.upper=1.605703',
      'azimuth.limits.upper=4 elevation.limits.upper=1.6')),
    ([('acu.azimuth.limits.rate=2.4', 'adu.azimuth.limits.rate=2.5'),
      ('acu.azimuth.limits.rate=2.35', 'adu.azimuth.limits.rate=2.6')],
     ('acu.azimuth.limits.rate=2.4 adu.azimuth.limits.rate=2.5',
      'acu.azimuth.limits.rate=2.35 adu.azimuth.limits.rate=2.6'))])
def test_a_side_has_the_short_name_of_what_differs(changes, named):
    assert comparison.names(*(plan(Variant('uav_flyby', texts), 1) for texts in changes)) == named


def test_no_gain_is_said_where_there_is_none(tmp_path):
    rng = np.random.default_rng(5)
    found = sides(tmp_path, *np.exp(0.1 * rng.standard_normal((2, 40))))
    better = 'AB'[comparison.ranked((found.a, found.b), 'pointing_rms_deg')[0]]
    assert comparison.sentence(found, 'pointing_rms_deg').startswith(f'{better} is neither better nor worse than ')
    turned = comparison.Sides('B', 'A', found.b, found.a)
    assert comparison.sentence(turned, 'pointing_rms_deg') == comparison.sentence(found, 'pointing_rms_deg')
    same = comparison.Sides('A', 'B', found.a, found.a)
    assert 'identical values of pointing_rms_deg' in comparison.sentence(same, 'pointing_rms_deg')


@pytest.mark.thorough
def test_a_table_of_a_ship_against_another_setting(pedestal, tmp_path):
    """Through the command line: table, page, rows with intervals; both sides have the same seeds and draws."""
    code, output, errors = pedestal('trials', 'ship_pass', '--runs', 5, '--duration', 8, '--vary',
                                    'ship_motion.ship.sea_state=choice(3, 6)', '--against-param',
                                    'tracking_receiver.receiver.cn0_dbhz=42', '--workers', 1, '--json', 'rows.json')
    assert (code, errors) == (0, '')
    names = [f'receiver.cn0_dbhz={level}' for level in (46.4, 42)]
    assert output.startswith(f'{names[0]} is better than {names[1]} by ')
    folder = tmp_path / 'trials' / 'ship_pass'
    page = (folder / 'trials.html').read_text()
    assert page.count('<svg') == 4 and 'pedestal run ship_pass --seed' in page
    a, b = ((folder / f'{name}.csv').read_text().splitlines() for name in ('trials', 'against'))
    assert [row.split(',')[:3] for row in a] == [row.split(',')[:3] for row in b] and a != b
    rows = {(row['case'], row['metric']): row for row in json.loads((tmp_path / 'rows.json').read_text())['rows']}
    for key in ('mean', 'p05', 'p50', 'p95'):
        row = rows[names[0], f'pointing_rms_deg/{key}']
        assert row['runs'] == 5 and {'value', 'ci_low', 'ci_high', 'unit'} <= set(row)
    assert rows[names[0], 'aligned/rate']['value'] == 100.0
    assert (names[0], 'pointing_rms_deg/rank_correlation(ship_motion.ship.sea_state)') in rows
    assert (' against '.join(names), 'pointing_rms_deg/gain') in rows


def test_every_beam_has_its_own_results(tmp_path):
    made = plan(Variant('phased_array_four', ('acu.tracker.lock_count=20',), duration=3.0), 1)
    table = make(made, tmp_path, monte_carlo.Pool(1))
    assert {name.partition('/')[0] for name in table.measured_results} == {f'beam_{i}' for i in range(1, 5)}
    cases = {row['case'] for row in statistics.of_results('four', table)}
    assert cases == {f'four/beam_{i}' for i in range(1, 5)}
    assert statistics.ranked_by([table]) == 'beam_1/pointing_rms_deg'


def test_the_worst_is_the_one_that_was_not_measured(tmp_path):
    values = np.array([0.2, math.nan, 0.1, 0.3])
    assert statistics.ranking('pointing_rms_deg', values).tolist() == [1, 3, 0, 2]
    assert statistics.ranking('isolation_db', values).tolist() == [1, 2, 0, 3]


@pytest.mark.parametrize(('name', 'times', 'sizes'), (
    ('leo_pass', (0.7, 1.0, 12.0, 3.0), [8, 32, 32, 8, 8]), ('ship_pass', (0.1, 2.0, 2.0, 9.0), [1, 4, 4, 4, 1])))
def test_a_batch_is_short_so_that_a_stop_keeps_the_rows_of_the_last_seconds(tmp_path, name, times, sizes):
    """A batch should run for 3 s, by the measured times [s] of those before. Two plans advance together."""
    plans = [plan(Variant(name, duration=20.0), runs) for runs in (60, 50)]
    with ensemble.open_table(plans[0], tmp_path, 'one') as one, ensemble.open_table(plans[1], tmp_path, 'b') as two:
        batches = ensemble._Batches(plans, [one, two])
    made, ended = iter(batches), []
    for seconds in (*times, *150 * [1.0]):
        if next(made, None) is None:
            break
        ended.append(batches.ended(seconds))
    assert [len(numbers) for _, numbers in ended][:len(sizes)] == sizes and [i for i, _ in ended][:2] == [0, 1]
    for i, runs in enumerate((60, 50)):
        assert [k for j, numbers in ended for k in numbers if j == i] == list(range(runs))
