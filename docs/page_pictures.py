"""Takes the pictures of docs/page.md: a run in realtime at four sizes of the screen, and a recording of a ship.

    python docs/page_pictures.py                 all of them, in about five minutes
    python docs/page_pictures.py run             only those of the run: in health, in a fault, with the link lost
    python docs/page_pictures.py ship            only the recording
"""
import contextlib
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

from PIL import Image
from playwright.sync_api import sync_playwright

FOLDER = pathlib.Path(__file__).parent / 'page'
PORT = 8077
SIZES = ((1280, 800), (1024, 768), (768, 1024), (390, 844))
"""Width and height of a desk, two tablets and a telephone [px]."""

MAX_PICTURE_BYTES = 120_000
MAX_COLOURS = 256
"""Largest size and largest number of colours of a picture."""

PASS = ('leo_pass', '--pacing', 'realtime', '--duration', '360', '--page', str(PORT))
"""Arguments of the run. On a busy machine add --param scenario.priority=10."""

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


def pedestal(*arguments):
    """Start a `pedestal` command."""
    command = [sys.executable, '-m', 'pedestal.cli', *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


@contextlib.contextmanager
def page_of(browser, process, size):
    """The page of a `pedestal` process as the operator sees it, then the end of both."""
    width, height = size
    try:
        address = next(filter(None, (re.search(r'http\S+', line) for line in process.stdout)))[0]
        page = browser.new_page(viewport={'width': width, 'height': height})
        page.set_default_timeout(120e3)
        page.goto(address)
        page.wait_for_function('() => document.querySelector("#mode").textContent !== "-"')
        yield page
        page.close()
    finally:
        end(process)


def end(process):
    process.send_signal(signal.SIGINT)
    process.wait()


def take(page, name):
    """Take one picture with few colours. Return True if it is small enough."""
    file = FOLDER / f'{name}.png'
    page.screenshot(path=file)
    Image.open(file).convert('RGB').quantize(MAX_COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    size = file.stat().st_size
    print(f'{file}: {size} bytes', flush=True)
    return size <= MAX_PICTURE_BYTES


def take_sizes(page, name, condition):
    """Take a picture at each size of the screen when a condition holds."""
    small = []
    for width, height in SIZES:
        page.set_viewport_size({'width': width, 'height': height})
        page.evaluate('scrollTo(0, 0)')
        time.sleep(2.0)  # the charts are drawn once a second
        if condition is HEALTHY and page.locator('#acknowledge-all').is_visible():
            page.locator('#acknowledge-all').dispatch_event('click')
        page.wait_for_function(f'() => {condition}')
        small.append(take(page, f'{name}_{width}x{height}'))
    page.set_viewport_size(dict(zip(('width', 'height'), SIZES[0])))
    return all(small)


def operate(page):
    """An operator takes control, acknowledges the alarms so far, and enters a preset."""
    page.locator('#name').fill('anna')
    page.locator('#name').press('Enter')
    page.wait_for_function('() => document.querySelector("#lock").textContent.includes("locked")')
    page.locator('#take').click()
    page.locator('[name=azimuth]').fill('30')
    page.locator('[name=elevation]').fill('45')
    page.locator('[name=elevation]').blur()


def take_run(browser, folder):
    """A pass ashore in realtime: in health, after two faults, and after the end of the server."""
    process = pedestal('run', *PASS, '--bag', folder / 'run')
    with page_of(browser, process, SIZES[0]) as page:
        operate(page)
        time.sleep(30.0)
        small = [take_sizes(page, 'healthy', HEALTHY)]
        for fault in FAULTS:
            pedestal('ask', *fault.split(), '--node', 'adu').communicate()
        page.wait_for_function('() => document.querySelector("#first-alarm").textContent.includes("encoder")')
        small.append(take_sizes(page, 'fault', LIVE))
        end(process)
        time.sleep(5.0)
        small.append(take_sizes(page, 'lost', LOST))
    return all(small)


def take_ship(browser, folder):
    """A recording of a ship: hidden sector, keyhole ahead."""
    bag = folder / 'ship'
    pedestal('run', *SHIP, '--duration', SHIP_DURATION_S, '--bag', bag).communicate()
    process = pedestal('replay', bag, '--page', PORT, '--paused', '--start', SHIP_MOMENT_S)
    with page_of(browser, process, SIZES[1]) as page:
        time.sleep(3.0)
        return take(page, 'ship')


PICTURES = {'run': take_run, 'ship': take_ship}


def main(names):
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path='/usr/bin/chromium',
                                             args=['--no-sandbox', '--disable-gpu'])
        return 0 if all([PICTURES[name](browser, pathlib.Path(folder)) for name in names or PICTURES]) else 1


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
