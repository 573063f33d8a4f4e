"""Direction of the beam on the sky in a recording, from the encoder angles and the reports on acu/pointing."""
import numpy as np

from pedestal_common.geometry import pointing_report
from pedestal_common.quantities import Pairs, Seconds, Times
from pedestal_recording import bag as bags
from pedestal_recording.recording import Recording

POINTING_TOPIC = 'acu/pointing'


def reports(bag: Recording) -> list[tuple[Seconds, pointing_report.Report]]:
    """Return [(time, report)] of a recording of one beam, [] without a pointing model.

    Raises bag.BagError for a text that is no report.
    """
    table = bag.table(POINTING_TOPIC) if POINTING_TOPIC in bag.topics else {}
    try:
        return [(float(t), pointing_report.read(text)) for t, text in zip(table.get('t', ()), table.get('data', ()))]
    except ValueError as error:
        raise bags.BagError(f'{bag.path}: {error}') from None


def on_sky(bag: Recording, times: Times, angles: Pairs) -> Pairs:
    """Return the directions of encoder angles at times; both are deck angles [rad].

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


def titles(bag: Recording) -> list[str]:
    """Return the pointing models of a recording in words, each once, in ASCII; [] without a model."""
    return list(dict.fromkeys(report.title.encode('ascii', 'replace').decode() for _, report in reports(bag)))
