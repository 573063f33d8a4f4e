"""Makes the pictures of the documentation, except chain.svg, which is drawn by hand.

    python -m docs.pictures.make              all of them, in about five minutes
    python -m docs.pictures.make page         the operator's page in a pass, in a fault, and with the link lost
    python -m docs.pictures.make ship         the operator's page with a recording of a ship
    python -m docs.pictures.make sky demo     the sky plot of a pass, and the overview of the demo
    python -m docs.pictures.make budget       the error budget, from docs/rows.json
    python -m docs.pictures.make loops        the position loops of an antenna from a data sheet
    python -m docs.pictures.make targets      the default filter beside tuned filters, from docs/rows.json
    python -m docs.pictures.make night        the chart of a night of passes
"""
import argparse
import contextlib
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import matplotlib
import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

import pedestal
from pedestal_bringup.loop import memory_recording
from pedestal_results import recorded_run
from pedestal_results.report import figures, run_figures
from pedestal_studies.system import budget, target_filters

FOLDER = pathlib.Path(__file__).parent
PORT = 8077
DESK, TELEPHONE = (1280, 800), (390, 844)
"""Width and height of the screen of the operator [px]."""

MAX_PICTURE_BYTES = 200_000
MAX_COLOURS = 256
"""Largest size and largest number of colours of a picture."""

PASS = ('leo_pass', '--pacing', 'realtime', '--duration', '360', '--page', str(PORT),
        '--param', 'scenario.priority=10')
PASS_MOMENT_S = 100.0
"""Arguments of the run, which has a real-time priority against alarms about time; time of its picture after its start
[s]."""

LOST = 'document.documentElement.dataset.link === "lost"'
LIVE = 'document.querySelector("[data-verb=standby]").ariaDisabled === "false"'
HEALTHY = f'{LIVE} && document.querySelector("#first-alarm").textContent === "no alarms"'
"""Conditions of the page for a picture. On a busy machine a live page may be stale for a moment."""

FAULTS = ('motor_loss axis=azimuth motor=1', 'encoder_jump axis=elevation size=0.01')
"""Faults that are injected into the drive."""

BLOCKAGE = '2.6 3.6 0.5'
SHIP = ('ship_overhead', '--param', f'acu.blockage={BLOCKAGE}', '--param', f'tracking_receiver.blockage={BLOCKAGE}')
SHIP_MOMENT_S, SHIP_DURATION_S = 9.5, 34.5
"""Time of the picture of the ship, and of the end of its recording, which shows the path ahead [s]."""

DATA_SHEET = ('--mirror 9 --inertia-azimuth 28000 --inertia-elevation 21000 --ratio-azimuth 700 --ratio-elevation 800 '
              '--motor-torque 25 --rate-azimuth 10 --rate-elevation 10 --mode 4')
"""Antenna of docs/design/antenna.md."""

WHOLE_PASS_S = 345.0  # leo_pass from its rise until it sets
MIN_BAR_MDEG = 0.2  # terms of the budget that are smaller in both modes have no bar
MODES = {'program': ('program track', figures.RAW_COLOUR), 'autotrack': ('autotrack', figures.FILTERED_COLOUR)}


NIGHT = ('--station', '47.4,8.5,500', '--from', '2019-12-10T00:00', '--horizon', '5', '--priority', 'NAVIGATION=0.2',
         'MOLNIYA=0.1', '--window', 'STATIONARY=2019-12-10T12:00/2019-12-10T13:00')
"""Arguments of the plan of the night of docs/operate/plan.md."""

LOST_RATIO = 5.0  # place of a target that a filter loses, in the chart of the ratios of pointing errors


def start(*arguments):
    """Start a `pedestal` command."""
    command = [sys.executable, '-m', 'pedestal.cli', *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def end(process):
    process.send_signal(signal.SIGINT)
    process.wait()


@contextlib.contextmanager
def page_of(process):
    """The page of a `pedestal` process as the operator sees it, then the end of both."""
    try:
        address = next(filter(None, (re.search(r'http\S+', line) for line in process.stdout)))[0]
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path='/usr/bin/chromium',
                                                 args=['--no-sandbox', '--disable-gpu'])
            page = browser.new_page(viewport=dict(zip(('width', 'height'), DESK)))
            page.set_default_timeout(120e3)
            page.goto(address)
            page.wait_for_function('() => document.querySelector("#mode").textContent !== "-"')
            yield page
            browser.close()
    finally:
        end(process)


def made(name):
    """Reduce the colours of a new picture. Return True if it is small enough."""
    file = FOLDER / f'{name}.png'
    Image.open(file).convert('RGB').quantize(MAX_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    size = file.stat().st_size
    print(f'{file}: {size} bytes', flush=True)
    return size <= MAX_PICTURE_BYTES


def take(page, name, condition='true'):
    """Take a picture of the page when a condition holds."""
    time.sleep(2.0)  # the charts are drawn once a second
    if condition is HEALTHY and page.locator('#acknowledge-all').is_visible():
        page.locator('#acknowledge-all').dispatch_event('click')
    page.wait_for_function(f'() => {condition}')
    page.screenshot(path=FOLDER / f'{name}.png')
    return made(name)


def operate(page):
    """An operator takes control and enters a preset."""
    page.locator('#name').fill('anna')
    page.locator('#name').press('Enter')
    page.wait_for_function('() => document.querySelector("#lock").textContent.includes("locked")')
    page.locator('#take').click()
    page.locator('[name=azimuth]').fill('30')
    page.locator('[name=elevation]').fill('45')
    page.locator('[name=elevation]').blur()


def make_page(folder):
    """A pass ashore in realtime: in health, after two faults, and after the end of the server."""
    process = start('run', *PASS, '--bag', folder / 'run')
    with page_of(process) as page:
        operate(page)
        time.sleep(PASS_MOMENT_S)
        small = [take(page, 'pass', HEALTHY)]
        for fault in FAULTS:
            start('ask', *fault.split(), '--node', 'adu').communicate()
        page.wait_for_function('() => document.querySelector("#alarm-list").textContent.includes("encoder")')
        small.append(take(page, 'fault', LIVE))
        end(process)
        page.set_viewport_size(dict(zip(('width', 'height'), TELEPHONE)))
        time.sleep(5.0)
        small.append(take(page, 'lost', LOST))
    return all(small)


def make_ship(folder):
    """A recording of a ship: hidden sector, keyhole ahead."""
    bag = folder / 'ship'
    start('run', *SHIP, '--duration', SHIP_DURATION_S, '--bag', bag).communicate()
    with page_of(start('replay', bag, '--page', PORT, '--paused', '--start', SHIP_MOMENT_S)) as page:
        return take(page, 'ship')


def make_figure(spec, data, name):
    """A figure of a report."""
    figures.render(spec, data, FOLDER / f'{name}.png')
    return made(name)


def recorded(scenario, **changes):
    """A run in memory."""
    chosen = pedestal.load(scenario, **changes)
    return recorded_run.RecordedRun(memory_recording.record(chosen.checked, chosen.beams[0]))


def make_sky(_folder):
    [spec] = [spec for spec in run_figures.FIGURES if spec.key == 'sky']
    return make_figure(spec, recorded('leo_pass', duration=WHOLE_PASS_S), 'sky_plot')


def make_demo(_folder):
    return make_figure(run_figures.OVERVIEW_FIGURE, recorded('leo_pass'), 'demo')


def budget_figure(rows):
    """Bars of the terms of the error budget in both modes, the largest first."""
    sizes = {mode: {name: 1e3 * rows['budget', f'{mode}/{name}', 'rms_deg']['value'] for name in
                    (*budget.documented(mode, random=False), *budget.documented(mode, random=True), 'combined')}
             for mode in MODES}
    names = {name: max(of_mode.get(name, 0.0) for of_mode in sizes.values()) for of in sizes.values() for name in of}
    shown = sorted((name for name, size in names.items() if size >= MIN_BAR_MDEG), key=names.get)
    figure, panels = figures.new_panels(1, height=0.7 + 0.27 * len(shown), x='error on both axes together [mdeg rms]')
    axes = panels[0, 0]
    for (mode, (label, colour)), shift in zip(MODES.items(), (0.2, -0.2)):
        axes.barh([i + shift for i in range(len(shown))], [sizes[mode].get(name, 0.0) for name in shown], 0.36,
                  color=colour, label=label)
    axes.set_yticks(range(len(shown)), ['all terms' if name == 'combined' else name for name in shown])
    axes.set_ylim(-0.6, len(shown) - 0.4)
    axes.grid(axis='y', visible=False)
    axes.set_title(f'{len(names) - len(shown)} more terms are below {MIN_BAR_MDEG:g} mdeg')
    axes.legend(loc='lower right')
    return figure


def make_budget(_folder):
    spec = figures.Spec('error_budget', '', '', (), budget_figure)
    from tools.numbers import published  # here, because --help also answers outside of the checkout
    return make_figure(spec, published.read(FOLDER.parents[1]), 'error_budget')


def make_loops(folder):
    scenario = folder / 'dish.yaml'
    start('new', scenario, *DATA_SHEET.split()).communicate()
    start('study', 'bode', '--scenario', scenario, '--output', folder).communicate()
    shutil.copy(folder / 'position.png', FOLDER / 'loops.png')
    return made('loops')


def targets_figure(rows):
    """Pointing error of the default over that of the tuned filter for each target; beside it the IMM that expects
    manoeuvres, with a cross at the edge where that IMM loses the target."""
    figure, panels = figures.new_panels(1, height=6.4, x='pointing error over that of the tuned filter')
    axes, targets = panels[0, 0], [*target_filters.TARGET_SCENARIOS]
    for name, label, colour in (('default', 'default', figures.FILTERED_COLOUR),
                                ('manoeuvre', 'IMM that expects manoeuvres', figures.RAW_COLOUR)):
        found = [rows['target-filters', f'{target}/{name}', 'pointing_to_tuned'] for target in targets]
        known = [i for i, row in enumerate(found) if row['value'] is not None]
        ends = np.array([[found[i][end] for i in known] for end in ('ci_low', 'value', 'ci_high')])
        axes.errorbar(ends[1], known, xerr=np.diff(ends, axis=0), fmt='o', markersize=4, color=colour, label=label)
        lost = [i for i in range(len(targets)) if i not in known]
        axes.plot([LOST_RATIO] * len(lost), lost, 'x', color=colour)
    axes.axvline(1.0, linewidth=0.8)
    axes.axvline(target_filters.MAX_POINTING_RATIO, linewidth=0.8, linestyle='--', label='requirement')
    axes.set_xscale('log')
    axes.set_xlim(0.75, 1.1 * LOST_RATIO)
    axes.set_xticks([0.8, 1.0, 1.5, 2.0, 3.0, 4.0, LOST_RATIO], ['0.8', '1', '1.5', '2', '3', '4', 'lost'])
    axes.minorticks_off()
    axes.set_yticks(range(len(targets)), targets)
    axes.set_ylim(len(targets) - 0.5, -0.5)
    axes.legend(loc='lower right')
    return figure


def make_targets(_folder):
    from tools.numbers import published
    return make_figure(figures.Spec('target_filters', '', '', (), targets_figure), published.read(FOLDER.parents[1]),
                       'target_filters')


def make_night(folder):
    """The chart of the page of a plan."""
    page_file = folder / 'night.html'
    start('samples', folder).communicate()
    start('plan', folder / 'night.tle', *NIGHT, '--html', page_file).communicate()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path='/usr/bin/chromium',
                                             args=['--no-sandbox', '--disable-gpu'])
        page = browser.new_page(viewport=dict(zip(('width', 'height'), DESK)))
        page.goto(page_file.as_uri())
        page.locator('svg.chart').first.screenshot(path=FOLDER / 'night.png')
        browser.close()
    return made('night')


def make_filter(folder):
    """The programs of the page on the library: the file of angles, then its filter."""
    blocks = re.findall(r'```python\n(.*?)```', (FOLDER.parent / 'start' / 'library.md').read_text(), re.DOTALL)
    [filtered] = [block for block in blocks if "savefig('filtered.png')" in block]
    [angles] = [block for block in blocks if "savetxt('angles.csv'" in block]
    for block in (angles, filtered):
        subprocess.run([sys.executable, '-c', block], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    shutil.copy(folder / 'filtered.png', FOLDER / 'filtered.png')
    return made('filtered')


PICTURES = {'page': make_page, 'ship': make_ship, 'sky': make_sky, 'demo': make_demo, 'budget': make_budget,
            'loops': make_loops, 'filter': make_filter, 'targets': make_targets, 'night': make_night}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(PICTURES))
    names = parser.parse_args().names
    if unknown := [name for name in names if name not in PICTURES]:
        parser.error(f'{", ".join(unknown)}: must be of {", ".join(PICTURES)}')
    matplotlib.use('agg')
    with tempfile.TemporaryDirectory() as folder:
        return 0 if all([PICTURES[name](pathlib.Path(folder)) for name in names or PICTURES]) else 1


if __name__ == '__main__':
    sys.exit(main())
