"""Directions on the sky in a recording: of the beam, and the measured direction of the target.

The direction of the beam follows from the encoder angles and the reports on acu/pointing; that of the target also from
the receiver errors and the attitude of the deck.
"""
import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import line_of_sight, pointing_report
from pedestal_common.quantities import Floats, Pairs, Quaternions, Seconds, Times
from pedestal_recording import bag as bags
from pedestal_recording.recording import Recording

POINTING_TOPIC = 'acu/pointing'


def reports(bag: Recording) -> list[tuple[Seconds, pointing_report.Report]]:
    """Return [(time, report)] of a recording of one beam, [] without a pointing model. Raises bag.BagError."""
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


@compiled
def _displaced(azimuth: Floats, elevation: Floats, errors: Pairs, quaternions: Quaternions, earth: Pairs) -> None:
    """Fill earth with the earth angles [rad] of a target; azimuth, elevation: deck angles of the beam."""
    mat_ed = np.empty((3, 3))
    for k in range(azimuth.size):
        line_of_sight.rotation(quaternions[k, 0], quaternions[k, 1], quaternions[k, 2], quaternions[k, 3], mat_ed)
        at, up = line_of_sight.displaced(azimuth[k], elevation[k], errors[k, 0], errors[k, 1])
        x, y, z = line_of_sight.direction(at, up)
        east, north, height = line_of_sight.to_earth(mat_ed, x, y, z)
        earth[k, 0], earth[k, 1] = line_of_sight.earth_angles(east, north, height)


def of_target(beam: Pairs, errors: Pairs, quaternions: Quaternions | None = None) -> Pairs:
    """Return the earth angles [rad] of the target: azimuth in (-pi, pi] and elevation; NaN where an input is NaN.

    beam          its azimuth and elevation on the deck [rad]
    errors        receiver errors in cross-elevation and elevation [rad]
    quaternions   rotation deck -> earth, None ashore
    """
    if quaternions is None:
        quaternions = np.tile(np.array(line_of_sight.ASHORE_ATTITUDE), (len(beam), 1))
    earth = np.empty((len(beam), 2))
    _displaced(np.ascontiguousarray(beam[:, 0]), np.ascontiguousarray(beam[:, 1]), np.ascontiguousarray(errors),
               np.ascontiguousarray(quaternions), earth)
    return earth
