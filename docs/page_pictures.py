"""Takes the pictures of docs/page.md: a run in realtime, two recordings, their page in Debian's Chromium.

    python docs/page_pictures.py                 all of them, some two minutes each
    python docs/page_pictures.py ship            only this one
"""
import contextlib
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

FOLDER = pathlib.Path(__file__).parent / 'page'
PORT = 8077
AFTER = 25.0
"""Seconds that a recording goes on after its picture: the path ahead."""

LARGEST = 300_000
"""Bytes of a picture at the most."""

PICTURES = {'ashore': (('leo_pass', '--pacing', 'realtime', '--page', str(PORT)), (1280, 800), 45.0),
            'ship': (('ship_overhead', '--param', 'acu.blockage=2.6 3.6 0.5', '--param',
                      'tracking_receiver.blockage=2.6 3.6 0.5'), (1024, 768), 9.5),
            'fault': (('leo_pass', '--param', 'adu.inject=12 motor_loss axis=azimuth motor=1; 31 encoder_jump '
                       'axis=elevation size=0.01'), (1280, 800), 34.0)}
"""{name: (the run, size of the page, when [s])}; one that is not in realtime is shown as a recording."""


def pedestal(*arguments):
    """A `pedestal` command as a process."""
    command = [sys.executable, '-m', 'pedestal.cli', *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


@contextlib.contextmanager
def shown(arguments, moment, bag):
    """The address of the page of a run in realtime, or of its recording at a moment [s]."""
    if '--page' in arguments:
        process = pedestal('run', *arguments, '--bag', bag)
    else:
        pedestal('run', *arguments, '--duration', moment + AFTER, '--bag', bag).communicate()
        process = pedestal('replay', bag, '--page', PORT, '--paused', '--start', moment)
    try:
        yield next(filter(None, (re.search(r'http\S+', line) for line in process.stdout)))[0]
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def operate(page):
    """Somebody takes control, has seen the alarms so far, and is about to ask for a preset."""
    page.locator('#name').fill('anna')
    page.locator('#name').press('Enter')
    page.wait_for_function('() => document.querySelector("#mode").textContent === "autotrack"')
    page.locator('#take').click()
    if page.locator('#acknowledge-all').is_visible():
        page.locator('#acknowledge-all').click()
    page.locator('[name=azimuth]').fill('30')
    page.locator('[name=elevation]').fill('45')


def take(browser, name, folder):
    """Take one picture; whether it is small enough."""
    arguments, (width, height), moment = PICTURES[name]
    with shown(arguments, moment, folder / name) as address:
        page = browser.new_page(viewport={'width': width, 'height': height})
        page.set_default_timeout(120e3)
        page.goto(address)
        page.wait_for_function('() => document.querySelector("#mode").textContent !== "-"')
        if '--page' in arguments:
            operate(page)
            time.sleep(moment)
        time.sleep(3.0)
        file = FOLDER / f'{name}.png'
        page.screenshot(path=file)
        page.close()
    size = file.stat().st_size
    print(f'{file}: {size} bytes', flush=True)
    return size <= LARGEST


def main(names):
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path='/usr/bin/chromium',
                                             args=['--no-sandbox', '--disable-gpu'])
        return 0 if all([take(browser, name, pathlib.Path(folder)) for name in names or PICTURES]) else 1


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
