"""Report of the pointing model in force, the JSON text of acu/pointing, and the directions that a reader derives from
it. The control unit publishes it at its start and at both ends of a change of its model. Terms have the units of the
parameters: degrees, or none for the factors."""
import json
import math
import typing

import numpy as np

from pedestal_common.compiled import compiled
from pedestal_common.geometry import pointing_model
from pedestal_common.geometry.pointing_model import FACTORS, TERMS, PointingModel
from pedestal_common.quantities import Degrees, Floats, Pairs, Seconds, Times

MAX_RESIDUALS = 40  # largest number of residuals of a model, whose text then fits into an argument of a command

RESIDUAL_RANGES = (-360.0, 540.0), (-5.0, 90.0), (-5000.0, 5000.0), (-5000.0, 5000.0)
"""Accepted azimuth and elevation [deg], and residuals in cross-elevation and elevation [mdeg]."""


class Report(typing.NamedTuple):
    """Pointing model in force."""
    antenna: str                    # antenna, file, date and rms_deg identify the model
    file: str
    date: str
    rms_deg: Degrees
    terms: dict[str, float]         # {name: value} of the terms that are not 0
    before: dict[str, float] = {}   # the same of the model before, from which the change begins; {} without a change
    begins_s: Seconds = 0.0         # begin of the change of the terms, time of the graph; 0 without a change
    ends_s: Seconds = 0.0           # its end
    residuals: str = ''             # text of residual_rows

    @property
    def text(self) -> str:
        """Text of acu/pointing."""
        return json.dumps(self._asdict())

    @property
    def title(self) -> str:
        """The model in words."""
        rms = f'rms {self.rms_deg:g} deg' if self.rms_deg > 0.0 else ''
        named = ', '.join(filter(None, (self.file, self.antenna and f'antenna {self.antenna}', self.date, rms)))
        return f'{named or "without a name"}; ' + (' '.join(f'{name.upper()} {value:g}' for name, value
                                                            in self.terms.items()) or 'all terms 0')


def read(text: str) -> Report:
    """Return the Report of a text; raise ValueError for another text."""
    try:
        values = json.loads(text)
        report = Report(**values)
        for terms in (report.terms, report.before):
            if not set(terms) <= set(TERMS) or not all(math.isfinite(value) for value in terms.values()):
                raise ValueError(f'terms {terms!s:.80}: must be finite numbers, named {TERMS[0]} to {TERMS[-1]}')
        if not math.isfinite(report.begins_s + report.ends_s + report.rms_deg):
            raise ValueError('begins_s, ends_s, rms_deg: must be finite')
        residual_rows(report.residuals)
    except (TypeError, ValueError, AttributeError) as error:
        raise ValueError(f'acu/pointing: {error}') from None
    return report


def residual_rows(text: str) -> list[list[float]]:
    """Return the residuals of a fit [[azimuth, elevation, cross-elevation, elevation], ...] [deg] of a text 'azimuth
    elevation cross-elevation elevation; ...' with direction in degrees, residual in thousandths. Raises ValueError."""
    rows = [part.split() for part in text.split(';') if part.strip()]
    if len(rows) > MAX_RESIDUALS:
        raise ValueError(f'{len(rows)} residuals: must be at most {MAX_RESIDUALS}')
    found = []
    for row in rows:
        try:
            numbers = [float(word) for word in row]
        except ValueError:
            numbers = []
        if len(numbers) != len(RESIDUAL_RANGES) or not all(
                low <= value <= high for value, (low, high) in zip(numbers, RESIDUAL_RANGES)):
            raise ValueError(f'residual {" ".join(row)!r:.60}: must be azimuth -360 to 540 deg, elevation -5 to 90 '
                             'deg, and cross-elevation and elevation -5000 to 5000 mdeg')
        found.append([*numbers[:2], 1e-3 * numbers[2], 1e-3 * numbers[3]])
    return found


def residual_text(directions: Pairs, residuals: Pairs) -> str:
    """Return the text of residual_rows for angles [deg], at most MAX_RESIDUALS rows at equal distances."""
    chosen = np.unique(np.linspace(0, len(directions) - 1, min(len(directions), MAX_RESIDUALS)).round().astype(int))
    return '; '.join(f'{az:.0f} {el:.0f} {1e3 * x:.1f} {1e3 * y:.1f}'
                     for (az, el), (x, y) in zip(directions[chosen], residuals[chosen]))


def in_degrees(terms: Floats) -> dict[str, float]:
    """Return {name: value} of the terms (20,) that are not 0, in the units of the parameters."""
    return {name: float(value) if name in FACTORS else float(np.degrees(value))
            for name, value in zip(TERMS, terms.tolist()) if value != 0.0}


def in_radians(terms: typing.Mapping[str, float]) -> Floats:
    """Return the terms (20,) of {name: value} in the units of the parameters."""
    return np.array([terms.get(name, 0.0) if name in FACTORS else math.radians(terms.get(name, 0.0))
                     for name in TERMS])


@compiled
def _directions(model: PointingModel, before: Floats, after: Floats, begins: Seconds, ends: Seconds, times: Times,
                angles: Pairs, on_sky: Pairs) -> None:
    for k in range(len(times)):
        if ends > begins:
            pointing_model.put_between(model, before, after, min(max((times[k] - begins) / (ends - begins), 0.0), 1.0))
        on_sky[k, 0], on_sky[k, 1] = pointing_model.direction_of(model, angles[k, 0], angles[k, 1])


def directions(report: Report | None, times: Times, angles: Pairs) -> Pairs:
    """Return the directions of the beam on the sky, deck angles; those of the encoders without a report."""
    if report is None or not (report.terms or report.before):
        return angles
    after, on_sky = in_radians(report.terms), np.empty((len(angles), 2))
    m = pointing_model.model({})
    pointing_model.put(m[0], after)
    _directions(m[0], in_radians(report.before), after, report.begins_s, report.ends_s,
                np.ascontiguousarray(times, float), np.ascontiguousarray(angles, float), on_sky)
    return on_sky
