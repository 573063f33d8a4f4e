"""Print of a page as PDF by an installed browser.

The page is HTML with figures as SVG, which a browser prints as it shows them. This avoids a second layout of the page
and a further library: matplotlib would only write the figures, and WeasyPrint needs the system library Pango.
"""
import os
import pathlib
import shutil
import subprocess
import tempfile

BROWSERS = 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'
"""Programs that can print, in the order of the search."""

MAX_PRINT_TIME_S = 300.0  # longest time for the print of a page [s]


def browser() -> str:
    """Return the path of an installed browser. Raises ValueError without one."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise ValueError('--pdf: needs Chromium or Google Chrome, and neither is installed: apt install chromium, or '
                         'print the page without --pdf from any browser')
    return found


def write(program: str, page: pathlib.Path, output: pathlib.Path) -> None:
    """Print a page (path of an HTML file) by the browser `program` to a path. Raises ValueError if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        printed = pathlib.Path(folder) / 'page.pdf'
        # Chromium refuses to start its sandbox as root.
        root = ['--no-sandbox'] if os.geteuid() == 0 else []
        try:
            done = subprocess.run([program, '--headless', *root, '--disable-gpu', '--no-pdf-header-footer',
                                   f'--user-data-dir={folder}/profile', f'--print-to-pdf={printed}',
                                   page.resolve().as_uri()], stdin=subprocess.DEVNULL, capture_output=True,
                                  text=True, timeout=MAX_PRINT_TIME_S, check=False)
        except subprocess.TimeoutExpired:
            raise ValueError(f'--pdf: {program} did not print {page} within {MAX_PRINT_TIME_S:g} s') from None
        if not printed.exists():
            last = (done.stderr.strip().splitlines() or ['without a message'])[-1]
            raise ValueError(f'--pdf: {program} did not print {page}, exit code {done.returncode}: {last}')
        shutil.copyfile(printed, output)
