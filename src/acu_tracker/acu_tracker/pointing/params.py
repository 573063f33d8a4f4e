"""Parameters of the pointing model: its terms, and the facts by which an operator recognises it."""
import dataclasses
from datetime import datetime

from pedestal_common.geometry import orbit
from pedestal_common.geometry.pointing_model import TERMS
from pedestal_common.geometry.pointing_report import Report, in_degrees, in_radians, residual_rows
from pedestal_common.parameters import ParameterError, Parameters, parameter, text
from pedestal_common.quantities import Floats, Seconds


@dataclasses.dataclass(frozen=True)
class PointingParameters(Parameters):
    """Pointing model: terms that turn the wanted direction into encoder angles
    (pedestal_common.geometry.pointing_model)."""
    p1: float = parameter(0.0, -10.0, 10.0, 'deg', 'zero of the azimuth encoder minus zero of the azimuth')
    p3: float = parameter(0.0, -6.0, 6.0, 'deg', 'deviation of the two axes from 90 deg')
    p4: float = parameter(0.0, -6.0, 6.0, 'deg', 'collimation: beam to the normal of the elevation axis')
    p5: float = parameter(0.0, -6.0, 6.0, 'deg', 'azimuth axis leans to azimuth 0: north, or the bow')
    p6: float = parameter(0.0, -6.0, 6.0, 'deg', 'azimuth axis leans to azimuth 90 deg: east, or starboard')
    p7: float = parameter(0.0, -10.0, 10.0, 'deg', 'zero of the elevation encoder minus zero of the elevation')
    p8: float = parameter(0.0, -6.0, 6.0, 'deg', 'sag: elevation error with the cosine of the elevation')
    p9: float = parameter(0.0, -0.01, 0.01, '', 'scale error of the elevation encoder')
    p11: float = parameter(0.0, -1.0, 1.0, 'deg', 'elevation error with the sine of the elevation')
    p12: float = parameter(0.0, -0.01, 0.01, '', 'scale error of the azimuth encoder')
    p13: float = parameter(0.0, -1.0, 1.0, 'deg', 'azimuth error with the cosine of the azimuth: encoder off centre')
    p14: float = parameter(0.0, -1.0, 1.0, 'deg', 'azimuth error with the sine of the azimuth: encoder off centre')
    p15: float = parameter(0.0, -1.0, 1.0, 'deg', 'elevation error with the cosine of twice the azimuth')
    p16: float = parameter(0.0, -1.0, 1.0, 'deg', 'elevation error with the sine of twice the azimuth')
    p17: float = parameter(0.0, -1.0, 1.0, 'deg', 'azimuth error with the cosine of twice the azimuth: tilted encoder')
    p18: float = parameter(0.0, -1.0, 1.0, 'deg', 'azimuth error with the sine of twice the azimuth: tilted encoder')
    p19: float = parameter(0.0, -0.2, 0.2, 'deg', 'elevation error with the cosine of eight times the elevation')
    p20: float = parameter(0.0, -0.2, 0.2, 'deg', 'elevation error with the sine of eight times the elevation')
    p21: float = parameter(0.0, -1.0, 1.0, 'deg', 'elevation error with the cosine of the azimuth')
    p22: float = parameter(0.0, -1.0, 1.0, 'deg', 'elevation error with the sine of the azimuth')
    antenna: str = text('', 'name of the antenna of the model; empty: not stated')
    file: str = text('', 'name of the file of the model')
    date: str = text('', 'UTC of the model, ISO 8601; empty: not stated')
    rms: float = parameter(0.0, 0.0, 10.0, 'deg', 'rms of the residuals of the fit; 0: not stated')
    residuals: str = text('', "residuals of the fit for the page: 'azimuth elevation [deg] cross-elevation elevation "
                          "[mdeg]; ...'")

    def check(self) -> None:
        """Raise ParameterError for a date or residuals that are none."""
        _ = self.made
        try:
            residual_rows(self.residuals)
        except ValueError as error:
            raise ParameterError(f'residuals: {error}') from None

    @property
    def made(self) -> datetime | None:
        """The time (UTC) of the model; None: not stated. Raise ParameterError for a wrong date."""
        try:
            return orbit.instant('date', self.date) if self.date else None
        except orbit.TargetError as error:
            raise ParameterError(str(error)) from None

    @property
    def terms(self) -> Floats:
        """The values of pointing_model.TERMS (20,) [rad, -]."""
        return in_radians({name: getattr(self, name) for name in TERMS})

    @property
    def named(self) -> bool:
        """True if the model has an antenna, a file or a date."""
        return bool(self.antenna or self.file or self.date)

    def report(self, before: Floats | None = None, begins_s: Seconds = 0.0, ends_s: Seconds = 0.0) -> Report:
        """Return the report of the model; before: terms (20,) [rad, -] from which a change begins."""
        return Report(self.antenna, self.file, self.date, self.rms, in_degrees(self.terms),
                      {} if before is None else in_degrees(before), begins_s, ends_s, self.residuals)

    def check_antenna(self, antenna: str) -> None:
        """Raise ParameterError for a model of another antenna; antenna: name of this antenna, '' if it has none."""
        if self.antenna and antenna and self.antenna != antenna:
            raise ParameterError(f'pointing.antenna = {self.antenna!r}: must be the parameter antenna, {antenna!r}: '
                                 'the model belongs to another antenna')

    def unchecked(self, antenna: str) -> str:
        """Return a warning that the antenna of the model is not checked, because this one has no name; ''
        otherwise."""
        if not self.antenna or antenna:
            return ''
        return f'antenna {self.antenna!r} of the pointing model is not checked, because the parameter antenna is empty'

    def check_date(self, now: datetime | None) -> None:
        """Raise ParameterError for a model of a later date than `now` (UTC); None: unknown."""
        if now is not None and self.made is not None and self.made > now:
            raise ParameterError(f'pointing.date = {self.date!r}: must not be later than now, '
                                 f'{now.isoformat(" ", "seconds")} UTC')
