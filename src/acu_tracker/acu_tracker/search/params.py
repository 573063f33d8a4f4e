"""Parameters of search, acquisition and step track."""
import dataclasses

from acu_tracker.search.pattern import SEARCH_PATTERNS
from pedestal_common.parameters import Parameters, choice, parameter


@dataclasses.dataclass(frozen=True)
class StepTrackParameters(Parameters):
    """Parameters of the mode steptrack.

    The step is that of the antenna controller GD 7200. The cycle is shorter, for faster targets; the deadband is
    smaller.
    """

    cycle: float = parameter(20.0, 1.0, 3600.0, 's', 'period of the climbs; 120 s in the GD 7200')
    step: float = parameter(0.08, 0.01, 0.3, 'beamwidths', 'step of the beam to either side')
    deadband: float = parameter(0.02, 0.0, 0.3, 'beamwidths', 'distance of the peak up to which the beam stays')
    dwell: float = parameter(1.0, 0.01, 60.0, 's', 'averaging time of the level at each place')


@dataclasses.dataclass(frozen=True)
class SearchParameters(Parameters):
    """Parameters of the mode search: the beam waits at the last place, covers a small area, then the full area.

    Small and full area are repeated for a number of rounds.
    """

    pattern: str = choice('spiral', SEARCH_PATTERNS, 'search path; square and raster lie along the track')
    wait: float = parameter(2.5, 0.0, 600.0, 's', 'time at the last place, in which the noise is learnt')
    small: float = parameter(1.5, 0.1, 50.0, 'beamwidths', 'radius of the small area', must_be='at most full')
    full: float = parameter(5.0, 0.1, 200.0, 'beamwidths', 'radius of the full area')
    across: float = parameter(0.3, 0.0, 1.0, '', 'raster and sector: half width of the area over half its length')
    pitch: float = parameter(0.7, 0.1, 1.0, 'beamwidths', 'distance between neighbouring lines')
    speed: float = parameter(1.0, 0.01, 1.0, '', 'speed of the beam, in beamwidths per 4 time constants of the level')
    rounds: int = parameter(3, 1, 1000, '', 'number of rounds of both areas before the fallback mode')


@dataclasses.dataclass(frozen=True)
class AcquisitionParameters(Parameters):
    """Parameters of the way from a level above the noise to autotrack."""

    learn_time: float = parameter(2.0, 0.1, 60.0, 's', 'time over which the noise is learnt off target')
    acquire_time: float = parameter(0.2, 0.0, 10.0, 's', 'time above its threshold after which a signal counts')
    loss_time: float = parameter(0.3, 0.0, 10.0, 's', 'time below the loss threshold after which the target is lost')
    timeout: float = parameter(30.0, 1.0, 600.0, 's', 'time after which acquire gives up')
    time_constant: float = parameter(0.1, 1e-3, 10.0, 's', "time constant of the receiver's level")
    expected_dbhz: float = parameter(0.0, 0.0, 120.0, 'dB-Hz', 'level on the axis at reference_range; 0: unknown, '
                                     'acquire looks around for a main lobe')
    reference_range: float = parameter(500e3, 1.0, 1e10, 'm', 'range at which expected_dbhz holds')
    range_exponent: float = parameter(2.0, 0.0, 4.0, '1', 'power of a measured range with which the level falls')
