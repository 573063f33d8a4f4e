"""Changes of a scenario by --tle, --station and --pass of `pedestal run`: a satellite and a station of the user."""
import datetime
import json
import math
import pathlib
import typing

from pedestal import console
from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.geometry.orbit import TargetError
from pedestal_results.report.subject import place
from tracking_receiver_sim import elements

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.scenario import Draft


def tle_changes(path: str | pathlib.Path, name: str, when: datetime.datetime) -> tuple[list[str], str]:
    """Return (texts 'node.key=value', remark) for a satellite of a file of TLEs (two-line elements) or OMMs (orbit
    mean-elements messages). The texts set the elements of the target and those of mode tle. name: '' if the file holds
    only one satellite; when: time (UTC), whose nearest set of elements is used. Raises TargetError."""
    chosen = elements.read(path, name, when)
    return [f'{node}.{key}={json.dumps(text)}' for node in ('tracking_receiver.target.leo_pass', 'acu.prediction')
            for key, text in chosen.values.items()], chosen.remark


def station_values(text: str) -> dict[str, float]:
    """Return {parameter of the receiver: value} of a station 'LATITUDE,LONGITUDE,HEIGHT' [deg, deg, m]. Raises
    ValueError."""
    try:
        numbers = [float(part) for part in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) != len(STATION_NAMES):
        raise ValueError(f'--station {text!r}: must be LATITUDE,LONGITUDE,HEIGHT in degrees and metres, for example '
                         '47.4,8.5,500')
    return {f'target.station.{name}': number for name, number in zip(STATION_NAMES, numbers)}


class PassSelection:
    """Choice of a pass of the satellite over the station of a draft at the time `now` (UTC). Raises ValueError for a
    scenario whose target is no satellite."""

    def __init__(self, draft: 'Draft', now: datetime.datetime) -> None:
        if draft.header.graph_beams > 1:
            raise ValueError(f'--pass: {draft.name} has {draft.header.beams} beams; must be a scenario of one beam')
        target = draft.target
        if target.kind != 'leo_pass':
            raise ValueError(f'--tle, --pass: the target of {draft.name} is a {target.kind}, must be a '
                             'satellite (leo_pass)')
        self.satellite, self.station, self.now = orbit.satellite(target.leo_pass), target.station, now

    def print_passes(self) -> None:
        """Print the passes with their numbers for --pass."""
        begin, old = passes.search_start(self.satellite, self.now)
        if old:
            print(f'{old}: the list begins at its epoch')
        found = passes.passes_after(self.satellite, self.station, begin)
        print(f'satellite {self.satellite.number} over {place(self.station)}, {passes.SEARCH_DAYS:g} days from '
              f'{begin:%Y-%m-%d %H:%M:%S} UTC, passes above {passes.MIN_CULMINATION_DEG:g} deg')
        console.show_list([('N', 'rises (UTC)', 'azimuth', 'highest', 'at', 'sets', 'azimuth and duration')] + [
            (str(n), _utc(p.rise), _azimuth(p.rise_azimuth), f'{p.elevation:.1f} deg', *_times(p),
             _ending(p))
            for n, p in enumerate(found, 1)])
        for n, p in enumerate(found, 1):
            if p.duration > passes.MAX_RUN_S:
                print(f'pass {n}: {_extent(p)}; a run of it needs --duration: --pass UTC --duration S')

    def choose(self, which: str, duration: float | None = None) -> tuple[list[str], float, str]:
        """Return (texts 'node.key=value', duration [s], line that describes the pass) of one pass. which: value of
        --pass; duration: None for the time from rise to set. Raises TargetError."""
        p = passes.chosen_pass(self.satellite, self.station, which, self.now)
        start, where = p.start.replace(microsecond=0), f'satellite {self.satellite.number} over {place(self.station)}'
        if p.duration > passes.MAX_RUN_S:
            if duration is None:
                raise TargetError(f'--pass {which}: {where}: {_extent(p)}, longer than a run of {passes.MAX_RUN_S:g} '
                                  f's: add --duration S; the run begins at {start:%Y-%m-%d %H:%M:%S} UTC')
            line = (f'{where}: {_extent(p)}, highest {p.elevation:.1f} deg at {_utc(p.top)}; the run begins at '
                    f'{start:%Y-%m-%d %H:%M:%S} UTC')
        else:
            line = (f'{where}: rises {p.rise:%Y-%m-%d %H:%M:%S} UTC in azimuth {_azimuth(p.rise_azimuth)}, highest '
                    f'{p.elevation:.1f} deg at {p.top:%H:%M:%S}, sets {p.set:%H:%M:%S} in azimuth '
                    f'{_azimuth(p.set_azimuth)}{", under way now" if p.under_way and p.begin == self.now else ""}')
            # Whole seconds from the start to the set, rounded up: the negative of the floor of the negative.
            duration = duration or -((start - (p.set or start)) // datetime.timedelta(seconds=1))
        return [f'tracking_receiver.target.leo_pass.start_time="{start.isoformat()}Z"',
                f'scenario.title="a pass of satellite {self.satellite.number}"'], duration, line


def _azimuth(degrees: float) -> str:
    return '-' if math.isnan(degrees) else f'{round(degrees) % 360} deg'


def _utc(when: datetime.datetime | None) -> str:
    return f'{when:%Y-%m-%d %H:%M:%S}' if when else '-'


def _times(p: passes.Pass) -> tuple[str, str]:
    """Return the times of highest elevation and of the set as texts, with dates for a pass longer than a run."""
    long = p.duration > passes.MAX_RUN_S
    return (_utc(p.top), _utc(p.set)) if long else (f'{p.top:%H:%M:%S}', f'{p.set:%H:%M:%S}')


def _ending(p: passes.Pass) -> str:
    length = f'{p.duration:.0f} s' if math.isfinite(p.duration) else 'never sets' if p.set is None else 'longer'
    return f'{_azimuth(p.set_azimuth)}, {length}{", under way" if p.under_way else ""}'


def _extent(p: passes.Pass) -> str:
    if p.rise is None and p.set is None:
        return 'above the horizon throughout, the satellite never sets'
    rise, down = (f'{_utc(when)} UTC' if when else '' for when in (p.rise, p.set))
    limit = f'for more than {passes.MAX_PASS_DAYS:g} days'
    return f'above the horizon {f"from {rise}" if rise else limit} {f"to {down}" if down else limit}'
