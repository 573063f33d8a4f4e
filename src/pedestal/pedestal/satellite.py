"""Changes of a scenario for a satellite, a station and a pass of the user: --tle, --satellite, --station, --pass and
--start of `pedestal run`, and the arguments of `pedestal.load` with these names."""
import datetime
import json
import math
import pathlib
import typing
from collections.abc import Sequence

from pedestal import console
from pedestal_common import parameters
from pedestal_common.geometry import orbit, passes
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.quantities import Seconds
from pedestal_results.report.subject import place
from tracking_receiver_sim import elements

if typing.TYPE_CHECKING:
    from pedestal_bringup.scenario.scenario import Draft

START_TIME_PARAMETER = 'tracking_receiver.target.leo_pass.start_time'
OTHER_FORMS = {'--pass': 'next, list, or a number of the list', '--start': '+SECONDS after the rise'}
"""{option: its values that are no UTC}."""
MAX_EARLY_START_S = 3600.0  # largest time from the start of a run to the rise of its pass [s]


class Options(typing.TypedDict, total=False):
    """Fields of a Choice by name."""
    tle: str | pathlib.Path | None
    satellite: str
    station: str | None
    which: str | None
    start: str | None


class Choice(typing.NamedTuple):
    """Satellite, station and pass of the user, as the options of `pedestal run`; None or '': not chosen."""
    tle: str | pathlib.Path | None = None
    satellite: str = ''
    station: str | None = None
    which: str | None = None    # --pass
    start: str | None = None

    @property
    def made(self) -> bool:
        """True if anything was chosen."""
        return not (self.tle is self.station is self.which is self.start is None)


class Chosen(typing.NamedTuple):
    """Draft of a scenario with the changes of a Choice."""
    draft: 'Draft'
    changes: list[str]          # texts 'node.key=value', including those of the user
    duration: Seconds | None    # of the run, None for that of the scenario
    lines: list[str]            # for the user


def chosen(draft: 'Draft', changes: Sequence[str], choice: Choice, duration: Seconds | None,
           now: datetime.datetime) -> Chosen:
    """Return a Draft with the changes of the user and of a Choice. duration: that given by the user; now: UTC. Raises
    ValueError."""
    selected = with_satellite(draft, changes, choice, now)
    started = _started(changes)
    if choice.which is None and choice.start is None and (not choice.tle or started):
        return selected._replace(duration=duration)
    for option, value in (('--pass', choice.which), ('--start', choice.start)):
        if value is not None and started:
            raise ValueError(f'{option} {value}: sets {START_TIME_PARAMETER}, which is also given; leave out one')
    start, length, line = PassSelection(selected.draft, now).choose(choice.which, duration, choice.start)
    return Chosen(selected.draft.changed(start), [*start, *selected.changes], length, [*selected.lines, line])


def with_satellite(draft: 'Draft', changes: Sequence[str], choice: Choice, now: datetime.datetime) -> Chosen:
    """Return a Draft with the changes of the user and the satellite and the station of a Choice. Raises ValueError."""
    changes, lines = list(changes), list[str]()
    if choice.station is not None:
        changes = station_changes(choice.station) + changes
    if choice.tle:
        when = _instant('--pass', choice.which) or _instant('--start', choice.start)
        started = _started(changes)
        found, remark = tle_changes(choice.tle, choice.satellite,
                                    when or (orbit.instant('start_time', started) if started else now))
        errors, lines = _without_prediction_errors(draft, changes)
        changes = [*found, *errors, *changes]
        lines = [remark] * bool(remark) + lines
    return Chosen(draft.changed(changes), changes, None, lines)


def _started(changes: Sequence[str]) -> str:
    """Return the start time of the satellite in the changes of the user, '' without one."""
    return next((change.partition('=')[2].strip('"\'') for change in reversed(changes)
                 if change.startswith(START_TIME_PARAMETER + '=')), '')


def _instant(option: str, text: str | None) -> datetime.datetime | None:
    """Return the UTC of a value of --pass or --start, None for another kind of value. Raises TargetError."""
    if text is None or text in ('list', 'next') or text.isdecimal() or text.startswith('+'):
        return None
    try:
        return orbit.instant(option, text)
    except TargetError as error:
        raise TargetError(f'{error}; or {OTHER_FORMS[option]}') from None


def _without_prediction_errors(draft: 'Draft', changes: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return (changes that end the errors of the prediction in a scenario, which are of its own satellite; a line for
    each). An error in `changes` stays."""
    from pedestal_bringup.scenario.header import PROGRAM_ERRORS
    given, header = {change.partition('=')[0] for change in changes}, parameters.as_dict(draft.header)
    ended = {key: unit for key, unit in PROGRAM_ERRORS.items() if header[key] and f'scenario.{key}' not in given}
    return [f'scenario.{key}=0' for key in ended], [
        f'scenario.{key} = 0 {unit} in place of {header[key]:g} {unit}, which belongs to the satellite of {draft.name}'
        for key, unit in ended.items()]


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


def station_changes(text: str) -> list[str]:
    """Return the texts 'node.key=value' of a station as in `station_values`. Raises ValueError."""
    return [f'tracking_receiver.{name}={value!r}' for name, value in station_values(text).items()]


class PassSelection:
    """Choice of a pass of the satellite over the station of a draft at the time `now` (UTC). The satellite rises and
    sets at the horizon mask of the receiver. Raises ValueError for a scenario whose target is no satellite."""

    def __init__(self, draft: 'Draft', now: datetime.datetime) -> None:
        if draft.header.graph_beams > 1:
            raise ValueError(f'--pass: {draft.name} has {draft.header.beams} beams; must be a scenario of one beam')
        target = draft.target
        if target.kind != 'leo_pass':
            raise ValueError(f'--tle, --pass, --start: the target of {draft.name} is a {target.kind}, must be a '
                             'satellite (leo_pass)')
        self.satellite, self.station, self.now = orbit.satellite(target.leo_pass), target.station, now
        mask = typing.cast(float, draft.sections.get('tracking_receiver', {}).get('receiver.horizon_mask', 0.0))
        self.least = round(math.degrees(mask), 6)
        self._where = f'satellite {self.satellite.number} over {place(self.station)}'

    def print_passes(self) -> None:
        """Print the passes with their numbers for --pass."""
        begin, old = passes.search_start(self.satellite, self.now)
        if old:
            print(f'{old}: the list begins at its epoch')
        found = passes.passes_after(self.satellite, self.station, begin, least=self.least)
        print(f'{self._where}, {passes.SEARCH_DAYS:g} days from {begin:%Y-%m-%d %H:%M:%S} UTC, passes that culminate '
              f'above {max(passes.MIN_CULMINATION_DEG, self.least):.3g} deg; rise and set are at {self.least:.3g} deg')
        console.show_list([('N', 'rises (UTC)', 'azimuth', 'highest', 'at', 'sets', 'azimuth and duration')] + [
            (str(n), _utc(p.rise), _azimuth(p.rise_azimuth), f'{p.elevation:.1f} deg', *_times(p),
             _ending(p))
            for n, p in enumerate(found, 1)])
        for n, p in enumerate(found, 1):
            if p.duration > passes.MAX_RUN_S:
                print(f'pass {n}: {_extent(p)}; a run of it needs --duration: --pass UTC --duration S')

    def choose(self, which: str | None, duration: Seconds | None = None,
               start: str | None = None) -> tuple[list[str], Seconds, str]:
        """Return (texts 'node.key=value', duration [s], line that describes the pass) of one pass. Raises ValueError.

        which       value of --pass; None for the pass of a UTC in `start`, or else for the next one
        duration    None for the time up to the set
        start       value of --start
        """
        if which is None:
            which = start if start and _instant('--start', start) else 'next'
        p = passes.chosen_pass(self.satellite, self.station, which, self.now, self.least)
        begin = _start(p, which, duration, start)
        if p.duration > passes.MAX_RUN_S:
            if duration is None:
                raise TargetError(f'--pass {which}: {self._where}: {_extent(p)}, longer than a run of '
                                  f'{passes.MAX_RUN_S:g} s: add --duration S; the run begins at {_utc(begin)} UTC')
            line = (f'{self._where}: {_extent(p)}, highest {p.elevation:.1f} deg at {_utc(p.top)}; the run begins at '
                    f'{_utc(begin)} UTC')
        else:
            # Whole seconds from the start to the set, rounded up: the negative of the floor of the negative.
            to_set = -((begin - (p.set or begin)) // datetime.timedelta(seconds=1))
            whole = start is None and duration is None and begin == p.start.replace(microsecond=0)
            duration = duration or to_set
            line = (f'{self._where}: rises {_utc(p.rise)} UTC in azimuth {_azimuth(p.rise_azimuth)}, highest '
                    f'{p.elevation:.1f} deg at {p.top:%H:%M:%S}, sets {p.set:%H:%M:%S} in azimuth '
                    f'{_azimuth(p.set_azimuth)}{f" (at {self.least:.3g} deg)" if self.least else ""}'
                    f'{", under way now" if p.under_way and p.begin == self.now else ""}'
                    + ('' if whole else f'; the run is from {begin:%H:%M:%S} UTC on, {duration:g} s'))
        early = datetime.timedelta(seconds=MAX_EARLY_START_S)
        if start and p.rise and p.set and not (p.rise - min(early, datetime.timedelta(seconds=duration)) <= begin
                                               < p.set):
            raise TargetError(f'--start {start}: a run from {_utc(begin)} UTC on misses the pass, which rises '
                              f'{_utc(p.rise)} and sets {_utc(p.set)} UTC; must begin before the set, at most '
                              f'{MAX_EARLY_START_S:g} s before the rise, and last until the rise')
        return [f'{START_TIME_PARAMETER}="{begin.isoformat()}Z"',
                f'scenario.title="a pass of satellite {self.satellite.number}"'], duration, line


def _start(p: passes.Pass, which: str, duration: Seconds | None, start: str | None) -> datetime.datetime:
    """Return the UTC of the beginning of a run of a pass; arguments: those of PassSelection.choose.

    A run begins at `start`, or at a `which` that is a UTC inside the pass. A run that is shorter than the pass is laid
    about the culmination. Otherwise the run begins with the second in which the satellite rises.
    """
    if start:
        if given := _instant('--start', start):
            return given
        try:
            seconds = float(start)
        except ValueError:
            seconds = math.nan
        if not 0.0 <= seconds <= passes.MAX_RUN_S or p.rise is None:
            raise TargetError(f'--start {start}: must be a UTC such as 2019-12-10T12:35, or +SECONDS after the rise'
                              + ('' if p.rise else ', which is not known here'))
        return p.rise + datetime.timedelta(seconds=seconds)
    if _instant('--pass', which) and p.under_way:
        return p.begin
    rise = p.start.replace(microsecond=0)
    if duration is None or duration >= p.duration or p.duration > passes.MAX_RUN_S or p.rise is None or p.set is None:
        return rise
    middle = p.top - datetime.timedelta(seconds=0.5 * duration)
    return max(rise, min(middle, p.set - datetime.timedelta(seconds=duration))).replace(microsecond=0)


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
