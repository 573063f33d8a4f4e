"""The verdict and the exit code of `pedestal run`, and the column `why` of `pedestal trials`."""
import csv
import json

import pytest

from pedestal import cli, console, stop
from pedestal_recording import bag as bags
from pedestal_results import results, verdict

RUNS = {'tripped': ('leo_pass', ('adu.azimuth.faults.overspeed=0.02',),
                    'tracked 0 %: drive fault azimuth overspeed at'),
        'no target': ('uav_flyby', ('acu.initial_mode=standby',), 'no target was to be tracked: standby 100 %')}
"""{word: (scenario, changes, text)} of a run that failed and one that did not; the others are in test_verdict.py of
pedestal_results."""
SECONDS = 5.0


@pytest.mark.thorough
@pytest.mark.parametrize('word', RUNS)
def test_a_run_begins_its_results_with_a_verdict(start_run, word):
    name, changes, text = RUNS[word]
    failed = word != 'no target'
    run = start_run(name, '--duration', SECONDS, *(part for change in changes for part in ('--param', change)),
                    *([] if failed else ['--all']))
    done = run.finish()
    assert done.returncode == (console.EXIT_FAILED_RUN if failed else 0), done.stderr
    printed = done.stdout.splitlines()
    said = next(i for i, line in enumerate(printed) if line.startswith(text))
    assert printed[said + 1].startswith(f'{name}: ')     # the title of the table
    content = json.loads(run.json.read_text())
    written = content['verdicts']['']
    assert (written['word'], written['text']) == (word, printed[said])
    shown = [row['metric'] for row in content['rows'] if any(f' {row["metric"]} ' in line for line in printed)]
    assert len(shown) == (results.BRIEF_COUNT if failed else len(content['rows']))
    assert ('not measured' in done.stdout) != failed and ('--all prints all results' in done.stdout) == failed
    bag = bags.read(run.bag)
    assert verdict.of(bag, results.tracking.read(bag)) == (word, printed[said])


def test_the_help_lists_the_exit_codes(capsys):
    with pytest.raises(SystemExit):
        cli.main(['run', '--help'])
    text = ' '.join(capsys.readouterr().out.split())
    for code, meaning in console.EXIT_CODES.items():
        assert f'{code}: {meaning}' in text
    assert console.EXIT_STOPPED == stop.STOP_EXIT_CODE


def test_a_trial_that_tripped_is_in_no_mean_silently(pedestal, tmp_path):
    """Half of the trials trip at their first motion. Table, page and screen state why."""
    rows = tmp_path / 'limits.csv'
    rows.write_text('adu.azimuth.faults.overspeed\n' + '\n'.join(['2.7', '0.02'] * 4) + '\n')
    code, said, errors = pedestal('trials', 'leo_pass', '--duration', 5, '--vary', rows, '--workers', 1, '--json',
                                  'r.json')
    assert (code, errors) == (0, '')
    with open(tmp_path / 'trials' / 'leo_pass' / 'trials.csv') as stream:
        whys = [row['why'] for row in csv.DictReader(stream)]
    assert whys[::2] == [''] * 4
    assert all(why.startswith('tripped: tracked 0 %: drive fault azimuth overspeed at ') for why in whys[1::2])
    assert '4 of 8, 4 tripped' in said and 'leo_pass: 4 of 8 runs failed: 4 tripped' in said
    row = next(row for row in json.loads((tmp_path / 'r.json').read_text())['rows']
               if row['metric'] == 'pointing_rms_deg/mean')
    assert (row['runs'], row['of'], row['left_out']) == (4, 8, {'tripped': 4})
    assert '4 of 8, 4 tripped' in (tmp_path / 'trials' / 'leo_pass' / 'trials.html').read_text()
