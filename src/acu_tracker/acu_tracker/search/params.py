"""Parameters of search, acquisition and step track."""
import dataclasses

from acu_tracker.search.pattern import SEARCH_PATTERNS
from pedestal_common.parameters import ParameterError, Parameters, choice, parameter


@dataclasses.dataclass(frozen=True)
class StepTrackParameters(Parameters):
    """Mode steptrack; the defaults are those of the GD 7200 but for the cycle, which follows a faster target."""

    cycle: float = parameter(20.0, 1.0, 3600.0, 's', 'from one climb to the next; the GD 7200 has 120 s')
    step: float = parameter(0.08, 0.01, 0.3, 'beamwidths', 'to either side')
    deadband: float = parameter(0.02, 0.0, 0.3, 'beamwidths', 'a peak that is nearer is let be')
    dwell: float = parameter(1.0, 0.01, 60.0, 's', 'over which the level is averaged at each place')


@dataclasses.dataclass(frozen=True)
class SearchParameters(Parameters):
    """Mode search: on the last place, over a small area, over the full one, and again."""

    pattern: str = choice('spiral', SEARCH_PATTERNS, 'of the path; the square and the raster lie along the track')
    wait: float = parameter(2.5, 0.0, 600.0, 's', 'on the last place before the beam moves; there the noise is learnt')
    small: float = parameter(1.5, 0.1, 50.0, 'beamwidths', 'radius of the small area')
    full: float = parameter(5.0, 0.1, 200.0, 'beamwidths', 'radius of the full area')
    across: float = parameter(0.3, 0.0, 1.0, '', 'raster and sector: half width of the area over half its length')
    pitch: float = parameter(0.7, 0.1, 1.0, 'beamwidths', 'distance of neighbouring lines')
    speed: float = parameter(1.0, 0.01, 1.0, '', 'of the beam, over a beamwidth in four time constants of the level')
    rounds: int = parameter(3, 1, 1000, '', 'small and full, then the fallback')

    def check(self):
        """Raise ParameterError where the small area is the larger one."""
        if self.small > self.full:
            raise ParameterError(f'small = {self.small:g} beamwidths: must be at most full = {self.full:g}')


@dataclasses.dataclass(frozen=True)
class AcquisitionParameters(Parameters):
    """From a level above the noise to autotrack."""

    learn_time: float = parameter(2.0, 0.1, 60.0, 's', 'over which the noise is learnt off target')
    acquire_time: float = parameter(0.2, 0.0, 10.0, 's', 'above the threshold before there is a target')
    loss_time: float = parameter(0.3, 0.0, 10.0, 's', 'below the lower one before there is none')
    timeout: float = parameter(30.0, 1.0, 600.0, 's', 'after which acquire gives up')
    time_constant: float = parameter(0.1, 1e-3, 10.0, 's', 'with which the receiver smooths its level')
    expected_dbhz: float = parameter(0.0, 0.0, 120.0, 'dB-Hz', 'level on the axis at reference_range; 0: not known, '
                                     'so that acquire looks around for a main lobe')
    reference_range: float = parameter(500e3, 1.0, 1e10, 'm', 'range at which expected_dbhz holds')
    range_exponent: float = parameter(2.0, 0.0, 4.0, '1', 'the level falls with this power of a measured range')
