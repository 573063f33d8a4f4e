"""Direction of the beam on the sky in a recording, from the encoder angles and the reports on acu/pointing."""
import numpy as np

from pedestal_common.geometry import pointing_report
from pedestal_recording import bag as bags

POINTING_TOPIC = 'acu/pointing'


def reports(bag):
    """Return [(time [s], pointing_report.Report)] of a bag.Bag of one beam, [] without a pointing model.

    Raises bag.BagError for a text that is no report.
    """
    table = bag.table(POINTING_TOPIC) if POINTING_TOPIC in bag.topics else {}
    try:
        return [(float(t), pointing_report.read(text)) for t, text in zip(table.get('t', ()), table.get('data', ()))]
    except ValueError as error:
        raise bags.BagError(f'{bag.path}: {error}') from None


def on_sky(bag, times, angles):
    """Return the directions (n, 2) [rad] of encoder angles (n, 2) [rad] at times (n,) [s]; both are deck angles.

    Before its first report a recording has the model of this report: such a recording began during the run.
    """
    found = reports(bag)
    if not found:
        return angles
    starts = np.array([t for t, _ in found])
    which = np.searchsorted(starts, times, 'right').clip(1) - 1
    on_sky = np.array(angles, float)
    for i, (_, report) in enumerate(found):
        chosen = which == i
        on_sky[chosen] = pointing_report.directions(report, times[chosen], angles[chosen])
    return on_sky


def titles(bag):
    """Return the pointing models of a recording in words, each once, in ASCII; [] without a model."""
    return list(dict.fromkeys(report.title.encode('ascii', 'replace').decode() for _, report in reports(bag)))
