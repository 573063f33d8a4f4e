"""A satellite and a station of the user's own: what --tle, --station and --pass of `pedestal run` change."""
import datetime
import json

from pedestal_analysis import console
from pedestal_analysis.report.subject import place
from pedestal_common.geometry import orbit, passes
from tracking_receiver_sim import elements

STATION_PARAMETERS = ('latitude_deg', 'longitude_deg', 'height')


def tle_changes(path, name):
    """Texts 'node.key=value' of a file of TLEs or OMMs, for the target and for mode tle; name: of the satellite, ''
    where it holds but one. Raises TargetError."""
    _, line_1, line_2 = elements.read(path, name)
    return [f'{known}.line_{number}={json.dumps(line)}'
            for known in ('tracking_receiver.target.leo_pass', 'acu.prediction')
            for number, line in enumerate((line_1, line_2), 1)]


def station_changes(text):
    """Texts 'node.key=value' of a station 'LATITUDE,LONGITUDE,HEIGHT' in deg, deg, m. Raises ValueError."""
    try:
        numbers = [float(part) for part in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) != len(STATION_PARAMETERS):
        raise ValueError(f'--station {text!r}: must be LATITUDE,LONGITUDE,HEIGHT in degrees and metres, for example '
                         '47.4,8.5,500; a negative latitude needs an equals sign: --station=-33.9,18.4,10')
    return [f'tracking_receiver.target.station.{name}={number!r}' for name, number in zip(STATION_PARAMETERS, numbers)]


class PassSelection:
    """The satellite and the station of a scenario.Draft, seen at `now` (datetime, UTC). Raises ValueError where its
    target is no satellite."""

    def __init__(self, draft, now):
        if draft.header.graph_beams > 1:
            raise ValueError(f'--pass: {draft.name} has {draft.header.beams} beams; it takes a scenario of one')
        target = draft.target
        if target.kind != 'leo_pass':
            raise ValueError(f'--tle, --pass: the target of {draft.name} is a {target.kind}, which is no satellite')
        self.satellite, self.station, self.now = orbit.satellite(target.leo_pass), target.station, now

    def list(self):
        """Print the passes that --pass takes by number."""
        begin, old = passes.search_start(self.satellite, self.now)
        if old:
            print(f'{old}: these are the passes of its own time')
        found = passes.passes_after(self.satellite, self.station, begin)
        print(f'satellite {self.satellite.satnum_str} over {place(self.station)}, {passes.SEARCH_DAYS:g} days from '
              f'{begin:%Y-%m-%d %H:%M:%S} UTC, passes above {passes.MIN_CULMINATION_DEG:g} deg')
        console.show_list([('N', 'rises (UTC)', 'azimuth', 'highest', 'at', 'sets', 'azimuth and duration')] + [
            (str(n), f'{p.rise:%Y-%m-%d %H:%M:%S}', f'{p.rise_azimuth:.0f} deg', f'{p.elevation:.1f} deg',
             f'{p.top:%H:%M:%S}', f'{p.set:%H:%M:%S}', f'{p.set_azimuth:.0f} deg, {p.duration:.0f} s')
            for n, p in enumerate(found, 1)])

    def choose(self, which):
        """(texts 'node.key=value', duration [s], line) of the pass that `which` names, from rise to set. Raises
        TargetError."""
        p = passes.chosen_pass(self.satellite, self.station, which, self.now)
        start = p.rise.replace(microsecond=0)
        line = (f'satellite {self.satellite.satnum_str} over {place(self.station)}: rises {p.rise:%Y-%m-%d %H:%M:%S} '
                f'UTC in azimuth {p.rise_azimuth:.0f} deg, highest {p.elevation:.1f} deg at {p.top:%H:%M:%S}, sets '
                f'{p.set:%H:%M:%S} in azimuth {p.set_azimuth:.0f} deg')
        return [f'tracking_receiver.target.leo_pass.start_time="{start.isoformat()}Z"'], -(
            (start - p.set) // datetime.timedelta(seconds=1)), line
