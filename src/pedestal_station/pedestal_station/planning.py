"""The plan of a night: from files of elements to the passes, their predictions, and the choice among them."""
import datetime
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.geometry.orbit import TargetError
from pedestal_common.parameters import did_you_mean
from pedestal_common.quantities import Decibels, Degrees, Seconds
from pedestal_common.text_files.files import FilePath
from pedestal_station import antenna, choice, objects, prediction, windows
from pedestal_station.antenna import Antenna
from pedestal_station.changeover import Changeovers
from pedestal_station.choice import Rules
from pedestal_station.night import Choice, Interval, Night, Object, Pass, Refusal, Share, Window

MAX_PASSES = 2000  # largest number of passes
MAX_PRIORITY = 1e6  # largest weight of a second of contact
MAX_NAMED = 3  # largest number of refusals in an error
CUT_POINTS = 1000  # number of instants among which the highest one of a chosen time is
NO_WINDOW = 'no --window'
UNDER_WAY = 'under way at the start'
WITHOUT_LOSS = 'without the loss at an end'
EQUAL_S = 1e-3  # difference of times below which they are equal [s]

Progress: TypeAlias = Callable[[float, str], None]  # share of the work that is done, name of the object


class Wishes(NamedTuple):
    """What the user wants of a night."""
    paths: Sequence[FilePath]   # files of elements, or folders
    station: StationParameters
    begin: datetime.datetime    # UTC
    duration: Seconds
    horizon: Degrees | None     # None for the mask of the antenna
    antenna: Variant            # scenario of the antenna; without a source: that of the defaults
    satellites: Sequence[str]   # names or numbers, () for all objects
    priorities: Sequence[str]   # texts NAME=W; 0 leaves an object out
    windows: Sequence[str]      # texts NAME=UTC/UTC
    rain_margin: Decibels       # loss of C/N0 by rain
    rules: Rules


def night(wishes: Wishes, progress: Progress = lambda *_: None) -> Night:
    """Return the plan. A bad object is refused, and the others are planned. Raises ValueError for a wrong wish, and if
    no object remains."""
    used = antenna.of(_scenario(wishes.antenna), wishes.station, wishes.begin, wishes.rain_margin)
    found, refusals = objects.read(wishes.paths, wishes.station, wishes.begin, wishes.duration,
                                   used.acu.prediction.oldest)
    if not found:
        raise ValueError('; '.join([*map(refusal_text, refusals[:MAX_NAMED]), 'no object is left to plan']))
    found = [each for each in weighted(_selected(found, wishes.satellites), wishes.priorities)
             if each.priority]
    if not found:
        raise ValueError('--priority: the weight of every object is 0; no object is left to plan')
    chosen, horizon = _chosen(found, wishes), _horizon(wishes, used)
    passes: list[Pass] = []
    for i, each in enumerate(found):
        progress(i / len(found), each.name)
        try:
            known, refused = _passes(each, horizon, wishes.duration, chosen.get(each.name, []), used)
            passes += known
            refusals += refused
            if len(passes) > MAX_PASSES:
                raise ValueError(f'{len(passes)} passes of the first {i + 1} of {len(found)} objects: must be at most '
                                 f'{MAX_PASSES}; choose objects by --satellite, or fewer --hours')
        except TargetError as error:
            refusals.append(Refusal(each.path, each.line, each.name, str(error)))
    progress(1.0, f'choice among {len(passes)} passes')
    passes.sort(key=lambda each: (each.window.rise, each.case))
    exact, greedy = _choices(passes, used, wishes.rules)
    return Night(wishes.begin, wishes.duration, wishes.station, wishes.horizon,
                 wishes.antenna.source or 'default parameters', tuple(passes), exact, greedy, tuple(refusals))


def refusal_text(refused: Refusal) -> str:
    """Return a refusal as a line. Line 0 stands for the whole file."""
    place = f'line {refused.line}: {refused.name}: ' if refused.line else ''
    return f'{refused.path}: {place}{refused.reason}'


def _scenario(variant: Variant) -> scenario.Scenario:
    if variant.source:
        return variant.load()
    return scenario.parse('of the defaults', antenna.NO_SCENARIO, variant.overrides())


def _named(found: Sequence[Object], option: str, name: str) -> Object:
    """Return the object of a name or number. Raises ValueError."""
    known = [each for each in found if name.strip().upper() in (each.name.upper(), each.number)]
    if not known:
        hint = did_you_mean(name, [text for each in found for text in (each.name, each.number)])
        raise ValueError(f'{option}: no object {name!r:.60} in the files;{hint}'.removesuffix(';'))
    return known[0]


def weighted(found: Sequence[Object], texts: Sequence[str]) -> list[Object]:
    """Return objects with the priorities of texts NAME=WEIGHT. Raises ValueError."""
    weights: dict[str, float] = {}
    for text in texts:
        name, _, weight = text.rpartition('=')
        option = f'--priority {text}'
        known = _named(found, option, name)
        try:
            weights[known.name] = float(weight)
        except ValueError:
            weights[known.name] = math.nan
        if not 0.0 <= weights[known.name] <= MAX_PRIORITY:
            raise ValueError(f'{option}: weight = {weight!r:.20}: must be a number from 0 to {MAX_PRIORITY:.0f}')
    return [each._replace(priority=weights.get(each.name, each.priority)) for each in found]


def _selected(found: Sequence[Object], names: Sequence[str]) -> Sequence[Object]:
    """Return the objects of some names, all without names. Raises ValueError."""
    named = (_named(found, f'--satellite {name}', name) for name in names)
    return list({each.name: each for each in named}.values()) if names else found


def _chosen(found: Sequence[Object], wishes: Wishes) -> dict[str, list[Interval]]:
    """Return {object: its times in order} of the texts NAME=UTC/UTC. Raises ValueError."""
    chosen: dict[str, list[Interval]] = {}
    for text in wishes.windows:
        name, _, times = text.rpartition('=')
        option, parts = f'--window {text}', times.split('/')
        if len(parts) != 2:
            raise ValueError(f'{option}: must be NAME=UTC/UTC, for example GEO=2026-12-01T20:00/2026-12-01T21:00')
        known = _named(found, option, name)
        begin, end = ((orbit.instant(option, part) - wishes.begin).total_seconds() for part in parts)
        if not 0.0 <= begin < end <= wishes.duration:
            raise ValueError(f'{option}: must begin before it ends, inside the night, which lasts '
                             f'{wishes.duration / 3600.0:g} h from {wishes.begin.isoformat()} on')
        chosen.setdefault(known.name, []).append((begin, end))
    return {name: sorted(times) for name, times in chosen.items()}


def _horizon(wishes: Wishes, used: Antenna) -> windows.Horizon:
    """Return the horizon of the user, else that of the antenna."""
    if wishes.horizon is not None:
        return windows.Horizon.constant(wishes.horizon)
    return windows.Horizon.of_floor(used.acu.floor, used.acu.elevation.limits.low)


def _passes(each: Object, horizon: windows.Horizon, duration: Seconds, chosen: Sequence[Interval],
            used: Antenna) -> tuple[list[Pass], list[Refusal]]:
    """Return the passes of an object, and the refusals of those with old elements. chosen: its times, [] for all
    passes. Raises ValueError for chosen times of an object that sets."""
    known = windows.find(each.orbit, horizon, duration)
    if chosen and not any(window.endless for window in known):
        course = 'rises and sets' if known else 'stays below the horizon'
        raise ValueError(f'--window {each.name}: the object {course}; must be one that does not set')
    passes, refusals = list[Pass](), list[Refusal]()
    for number, window in enumerate((_cut(each, *times) for times in chosen) if chosen else known, 1):
        reason = objects.age_refusal(each.orbit, window.culmination, used.acu.prediction.oldest)
        if reason:
            refusals.append(Refusal(each.path, each.line, f'{each.name}/{number}', reason))
        else:
            passes.append(Pass(each, number, window, prediction.predict(each, window, used)))
    return passes, refusals


def _cut(each: Object, begin: Seconds, end: Seconds) -> Window:
    """Return the window of a chosen time."""
    times = np.linspace(begin, end, CUT_POINTS)
    elevation = windows.angles(each.orbit, times)[:, 1]
    best = int(np.argmax(elevation))
    return Window(begin, (float(times[best]),), float(times[best]), end, float(elevation[best]), False)


def _choices(passes: Sequence[Pass], used: Antenna, rules: Rules) -> tuple[Choice, Choice]:
    """Return the exact and the greedy plan. An endless track is left out. Of a pass under way only the rest can be
    taken, and of a pass with a loss at its begin or end only the part without it."""
    places = [i for i, each in enumerate(passes) if not each.window.endless]
    rest = [passes[i] for i in places]
    for i, each in enumerate(rest):
        window = _usable(each)
        if window != each.window:
            near = each.prediction.azimuth[0] if each.window.rise >= 0.0 else None
            rest[i] = each._replace(window=window, prediction=prediction.predict(each.object, window, used, near))
    axes = used.acu.azimuth.shaper, used.acu.elevation.shaper
    exact, greedy = choice.choose(rest, Changeovers(rest, axes, rules), rules)
    return _whole(exact, passes, places), _whole(greedy, passes, places)


def _usable(each: Pass) -> Window:
    """Return the window of a pass from the begin of the night on, without the losses at its begin and at its end; with
    them if nothing else remains."""
    rise, set_ = begin, end = max(each.window.rise, 0.0), each.window.set
    for loss in each.prediction.losses:
        if loss.begin <= rise + EQUAL_S:
            rise = max(rise, loss.end)
        if loss.end >= set_ - EQUAL_S:
            set_ = min(set_, loss.begin)
    return each.window._replace(rise=rise, set=set_) if rise < set_ else each.window._replace(rise=begin, set=end)


def _whole(plan: Choice, passes: Sequence[Pass], places: Sequence[int]) -> Choice:
    """Return a plan with the passes that took no part in it; places: places of the passes that did."""
    shares = [Share(False, np.nan, np.nan, (), NO_WINDOW)] * len(passes)
    for i, share in zip(places, plan.shares, strict=True):
        window = passes[i].window
        if share.taken and not share.reason:
            reason = UNDER_WAY if window.rise < 0.0 else '' if share.begin - window.rise < EQUAL_S > (
                window.set - share.end) else WITHOUT_LOSS
            share = share._replace(reason=reason)
        shares[i] = share
    return plan._replace(shares=tuple(shares))
