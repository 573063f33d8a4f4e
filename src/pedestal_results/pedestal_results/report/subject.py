"""Subject of a recording in words, for the head of its report: target, date, station, changed parameters."""
import datetime
import math
from collections.abc import Callable, Mapping

import numpy as np

from pedestal_common import parameters
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph import nodes
from pedestal_common.quantities import Seconds, Value
from pedestal_recording import recording as recordings
from pedestal_recording.bag import Bag
from pedestal_results import directions
from pedestal_results.recorded_run import RecordedRun
from tracking_receiver_sim.params import TargetParameters

TARGET_DESCRIPTIONS: dict[str, Callable[[TargetParameters], str]] = {
    'leo_pass': lambda target: (f'satellite {orbit.satellite(target.leo_pass).number}, from its '
                                f'{"OMM" if target.leo_pass.omm else "TLE"}'),
    'track_file': lambda target: f'track of the file {target.track_file.path.rpartition("/")[2]}',
    'flyby': lambda target: (f'straight flight at {target.flyby.speed:g} m/s, {target.flyby.height:g} m above the '
                             f'station, closest distance over ground {target.flyby.closest_distance:g} m'),
    'sine': lambda target: f'sine of {target.angle.frequency:g} Hz in azimuth and elevation',
    'step': lambda target: f'step at {target.angle.start:g} s',
    'ramp': lambda target: f'constant rate from {target.angle.start:g} s on',
}
"""{kind of target: function that returns a description}."""

STATION_TARGET_KINDS = ('leo_pass', 'track_file')  # kinds of target that depend on the position of the station


MAX_VALUE_CHARACTERS = 80  # length of a shown parameter value, above which its middle is left out [characters]


def date(bag: Bag) -> str:
    """Return the date of a run as text: its first message in realtime, else the date of the file."""
    if bag.start and bag.index.size:
        return f'{_utc(bag.index.log.min() / 1e9)} UTC'
    written = f'file of {_utc(bag.file.stat().st_mtime)} UTC'
    return f'{written}; a lockstep recording states no date' if bag.metadata.get('pacing') == 'lockstep' else written


def _utc(seconds: Seconds) -> str:
    return f'{datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc):%Y-%m-%d %H:%M:%S}'


def changed_parameters(bag: Bag) -> list[list[str]]:
    """Return rows [node.parameter, value, default, unit] of the recorded parameters that differ from the defaults."""
    return [row for name, values in bag.configuration['parameters'].items() if nodes.plain(name) in nodes.NODE_NAMES
            for row in changed(name, nodes.row(name, bag.beams > 0, bag.servo).parameters_type(), values)]


def changed(node: str, kind: type[parameters.Parameters], values: Mapping[str, Value]) -> list[list[str]]:
    """Return rows [node.parameter, value, default, unit] of {dotted name: value}, for those that differ from the
    defaults of a parameter dataclass."""
    defaults, fields = parameters.defaults(kind), dict(parameters.flatten(kind))
    return [[f'{node}.{key}', _shown(value), _shown(defaults[key]), fields[key].metadata.get('unit', '')]
            for key, value in values.items()
            if key in defaults and value != defaults[key] and not parameters.is_absent(value)]


def _shown(value: object) -> str:
    """Return a parameter value as text, without the middle of a long text."""
    text = parameters.value_text(value)
    half = MAX_VALUE_CHARACTERS // 2
    return text if len(text) <= MAX_VALUE_CHARACTERS else f'{text[:half]} ... {text[-half:]}'


def place(station: StationParameters) -> str:
    """Return the position of a station as text."""
    return f'latitude {station.latitude_deg:g}, longitude {station.longitude_deg:g} deg, height {station.height:g} m'


def rows(bag: Bag, run: RecordedRun) -> list[list[str]]:
    """Return rows [name, text] on a bag of one beam and its RecordedRun, as far as the bag states them."""
    models = [['pointing model', title] for title in directions.titles(bag)]
    beamwidth = [['beamwidth', f'{math.degrees(run.beamwidth):.4g} deg']] if math.isfinite(run.beamwidth) else []
    beamwidth = [*models, *beamwidth]
    values = recordings.parameters(bag, 'tracking_receiver')
    try:
        target = parameters.build(TargetParameters, {name.removeprefix('target.'): value for name, value in
                                                     values.items() if name.startswith('target.')})
    except parameters.ParameterError:
        values = {}
    if not values:
        return beamwidth
    station = [['station', place(target.station)]] if target.kind in STATION_TARGET_KINDS else []
    return [['target', TARGET_DESCRIPTIONS[target.kind](target)], *_sky(run), *station, *beamwidth]


def _sky(run: RecordedRun) -> list[list[str]]:
    """Return rows on the UTC at 0 s and on the highest elevation; [] for a target without a date."""
    try:
        begin = orbit.instant('stamp_0_utc', _begin(run))
    except orbit.TargetError:
        return []
    highest = []
    if not run.no_truth and np.isfinite(run.tracking.target_earth[:, 1]).any():
        elevation = run.tracking.target_earth[:, 1]
        top = int(np.nanargmax(elevation))
        when = begin + datetime.timedelta(seconds=float(run.tracking.t[top]))
        highest = [['highest', f'{math.degrees(elevation[top]):.1f} deg at {when:%Y-%m-%d %H:%M:%S} UTC, '
                    f'{run.tracking.t[top]:.1f} s']]
    return [['0 s is', f'{begin:%Y-%m-%d %H:%M:%S} UTC'], *highest]


def _begin(run: RecordedRun) -> str:
    return next((value.value for _, status in recordings.diagnostics(run.bag) for value in status.values
                 if value.key == 'stamp_0_utc'), '')
