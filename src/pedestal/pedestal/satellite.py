"""Changes of a scenario by --tle, --station and --pass of `pedestal run`: a satellite and a station of the user."""
import datetime
import json
import pathlib
import typing

from pedestal_analysis import console
from pedestal_analysis.report.subject import place
from pedestal_common.geometry import orbit, passes
from tracking_receiver_sim import elements

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.scenario import Draft

STATION_PARAMETERS = ('latitude_deg', 'longitude_deg', 'height')


def tle_changes(path: str | pathlib.Path, name: str) -> list[str]:
    """Return texts 'node.key=value' for the target and for mode tle, from a file of TLEs or OMMs.

    name: of the satellite, '' for a file of one satellite. Raises TargetError.
    """
    _, line_1, line_2 = elements.read(path, name)
    return [f'{prefix}.line_{number}={json.dumps(line)}'
            for prefix in ('tracking_receiver.target.leo_pass', 'acu.prediction')
            for number, line in enumerate((line_1, line_2), 1)]


def station_changes(text: str) -> list[str]:
    """Return texts 'node.key=value' for a station 'LATITUDE,LONGITUDE,HEIGHT' [deg, deg, m]. Raises ValueError."""
    try:
        numbers = [float(part) for part in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) != len(STATION_PARAMETERS):
        raise ValueError(f'--station {text!r}: must be LATITUDE,LONGITUDE,HEIGHT in degrees and metres, for example '
                         '47.4,8.5,500; a negative latitude needs an equals sign: --station=-33.9,18.4,10')
    return [f'tracking_receiver.target.station.{name}={number!r}' for name, number in zip(STATION_PARAMETERS, numbers)]


class PassSelection:
    """Choice of a pass of the satellite over the station of a scenario.Draft at the time `now` (datetime, UTC).

    Raises ValueError for a scenario whose target is no satellite.
    """

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
        print(f'satellite {self.satellite.satnum_str} over {place(self.station)}, {passes.SEARCH_DAYS:g} days from '
              f'{begin:%Y-%m-%d %H:%M:%S} UTC, passes above {passes.MIN_CULMINATION_DEG:g} deg')
        console.show_list([('N', 'rises (UTC)', 'azimuth', 'highest', 'at', 'sets', 'azimuth and duration')] + [
            (str(n), f'{p.rise:%Y-%m-%d %H:%M:%S}', f'{p.rise_azimuth:.0f} deg', f'{p.elevation:.1f} deg',
             f'{p.top:%H:%M:%S}', f'{p.set:%H:%M:%S}', f'{p.set_azimuth:.0f} deg, {p.duration:.0f} s')
            for n, p in enumerate(found, 1)])

    def choose(self, which: str) -> tuple[list[str], int, str]:
        """Return (texts 'node.key=value', duration [s], line) of a pass from rise to set. Raises TargetError.

        which: value of --pass: 'next', a number in the list, or a UTC.
        """
        p = passes.chosen_pass(self.satellite, self.station, which, self.now)
        start = p.rise.replace(microsecond=0)
        line = (f'satellite {self.satellite.satnum_str} over {place(self.station)}: rises {p.rise:%Y-%m-%d %H:%M:%S} '
                f'UTC in azimuth {p.rise_azimuth:.0f} deg, highest {p.elevation:.1f} deg at {p.top:%H:%M:%S}, sets '
                f'{p.set:%H:%M:%S} in azimuth {p.set_azimuth:.0f} deg')
        return [f'tracking_receiver.target.leo_pass.start_time="{start.isoformat()}Z"'], -(
            (start - p.set) // datetime.timedelta(seconds=1)), line
