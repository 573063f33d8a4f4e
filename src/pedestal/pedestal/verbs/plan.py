"""Verb `plan`: the passes of a night, which of them the antenna takes, and the files of the plan."""
import argparse
import dataclasses
import datetime
import pathlib
import sys
import typing

from pedestal import console
from pedestal.verbs import arguments
from pedestal.verbs.arguments import Verb
from pedestal_common import parameters

if typing.TYPE_CHECKING:
    from pedestal_common.geometry.geodesy import StationParameters
    from pedestal_station.choice import Rules
    from pedestal_station.night import Night

NEW_FILES = 'output', 'csv', 'ics', 'html'  # options of files that are not overwritten
MAX_HOURS = 31 * 24.0  # longest night [h]
FIRST_YEAR, LAST_YEAR = 1957, 2099  # of a night
HORIZON_LIMITS_DEG = -5.0, 89.0  # of --horizon [deg]
MAX_RAIN_MARGIN_DB = 100.0  # largest --rain-margin [dB]


def _add_plan(parser: argparse.ArgumentParser) -> None:
    """Predicts every pass of the objects on this pedestal: rates, turn of the azimuth, keyhole, blockage, sun, link,
    expected loss. Then chooses the passes with the largest weighted contact time, and states to which pass each
    other one lost its time. Files may hold any number of TLEs, OMMs or OEMs; a folder stands for all its files. A bad
    object is refused with its line, and the others are planned.

        pedestal plan active.tle --station 47.4,8.5,500
        pedestal plan active.tle --station 47.4,8.5,500 --from 2026-12-01T18:00 --hours 12 --horizon 5
        pedestal plan elements/ --station 47.4,8.5,500 --scenario my_antenna.yaml --priority ISS=3 NOAA_19=0.5
        pedestal plan geo.tle leo.tle --station 47.4,8.5,500 --window 40874=2026-12-01T20:00/2026-12-01T21:00
        pedestal plan active.tle --station 47.4,8.5,500 --output plan.json --ics plan.ics --html plan.html
        pedestal station --plan plan.json
    """
    parser.add_argument('files', nargs='+', type=pathlib.Path, metavar='FILE', help='file with orbits: TLE, OMM or '
                        'OEM; or a folder of such files')
    parser.add_argument('--station', required=True, metavar='LAT,LON,H', help='position of the antenna: latitude '
                        '[deg], longitude [deg], height [m]')
    parser.add_argument('--from', dest='begin', metavar='UTC', help='beginning of the night, for example '
                        '2026-12-01T18:00; default: now')
    parser.add_argument('--hours', type=float, default=24.0, metavar='N', help=f'length of the night [h], at most '
                        f'{MAX_HOURS:g}; default: 24')
    parser.add_argument('--horizon', type=float, metavar='DEG', help='elevation of rise and set [deg]; default: the '
                        'mask acu.floor of the antenna and its lower elevation limit')
    action = parser.add_argument('--scenario', default='', metavar='NAME', help='scenario that describes '
                                 'the antenna: name or .yaml file; default: every parameter has its default')
    vars(action)['completer'] = arguments.scenarios_and_files
    arguments.add_param(parser, 'acu.azimuth.limits.rate=0.1')
    arguments.add_params_file(parser)
    _add_choice(parser)
    console.add_json(parser)
    for name, what in (('csv', 'table of the passes as CSV'), ('ics', 'taken passes as a calendar (iCalendar)'),
                       ('html', 'page with a Gantt chart and the sky plot of each pass'),
                       ('output', 'plan for `pedestal station --plan`')):
        parser.add_argument(f'--{name}', type=pathlib.Path, metavar='FILE', help=f'new file for the {what}')


def _add_choice(parser: argparse.ArgumentParser) -> None:
    """Add the options of the choice among the passes."""
    parser.add_argument('--satellite', nargs='+', action='extend', default=[], metavar='NAME', help='object to plan, '
                        'by name or number; default: all objects of the files')
    parser.add_argument('--priority', nargs='+', action='extend', default=[], metavar='NAME=W', help='object, by name '
                        'or number, and the weight of a second of its contact; 0 leaves it out; default: 1')
    parser.add_argument('--window', nargs='+', action='extend', default=[], metavar='NAME=UTC/UTC', help='object that '
                        'does not set, such as a geostationary one, and a time in which to track it')
    parser.add_argument('--min-pass', type=float, metavar='S', help='shortest contact [s]; default: 60')
    parser.add_argument('--setup', type=float, metavar='S', help='time between two contacts, beside the slew [s]; '
                        'default: 30')
    parser.add_argument('--time-limit', type=float, metavar='S', help='time of the search for the best plan [s]; '
                        'default: 5')
    parser.add_argument('--rain-margin', type=float, default=0.0, metavar='DB', help='loss of C/N0 by rain to allow '
                        'for [dB]; default: 0')


def _plan(options: argparse.Namespace) -> int:
    arguments.check_result_files(options, new=NEW_FILES)
    _check(options)
    from pedestal_station import planning
    from pedestal_station.outputs import words
    begin, duration = _time(options)
    wishes = planning.Wishes(
        paths=options.files, station=_station(options.station), begin=begin, duration=duration,
        horizon=options.horizon, antenna=arguments.variant(options), satellites=options.satellite,
        priorities=options.priority, windows=options.window, rain_margin=options.rain_margin, rules=_rules(options))
    with console.progress_of_share() as progress:
        night = planning.night(wishes, progress)
    for refused in night.refusals:
        print(f'{planning.refusal_text(refused)}; left out', file=sys.stderr)
    for line in (*words.remarks(night), *(f'warning: {warning}' for warning in words.warnings(night))):
        print(line, file=sys.stderr)
    console.show_night(night)
    print(words.verdict(night))
    _write(options, night)
    return 0


def _station(text: str) -> 'StationParameters':
    """Return the station of --station. Raises ValueError."""
    from pedestal import satellite
    from pedestal_common.geometry.geodesy import StationParameters
    prefix = 'target.station.'
    try:
        return parameters.build(StationParameters, satellite.station_values(text), prefix)
    except parameters.ParameterError as error:
        raise ValueError(f'--station {text}: {str(error).removeprefix(prefix)}') from None


def _time(options: argparse.Namespace) -> tuple[datetime.datetime, float]:
    """Return (begin of the night, its duration [s]) of --from and --hours. Raises ValueError."""
    from pedestal_common.geometry import orbit
    if not 0.0 < options.hours <= MAX_HOURS:
        raise ValueError(f'--hours {options.hours:g}: must be above 0 and at most {MAX_HOURS:g}')
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None, microsecond=0)
    begin = now if options.begin is None else orbit.instant('--from', options.begin)
    if not FIRST_YEAR <= begin.year <= LAST_YEAR:
        raise ValueError(f'--from {options.begin}: must be in the years {FIRST_YEAR} to {LAST_YEAR}')
    return begin, 3600.0 * options.hours


def _check(options: argparse.Namespace) -> None:
    """Raise ValueError for a number outside of its range."""
    for name, (low, high), unit in (('horizon', HORIZON_LIMITS_DEG, 'deg'),
                                    ('rain_margin', (0.0, MAX_RAIN_MARGIN_DB), 'dB')):
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            raise ValueError(f'{parameters.option_of(name)} {value:g}: must be {low:g} to {high:g} {unit}')


def _rules(options: argparse.Namespace) -> 'Rules':
    """Return the rules of the choice. Raises ValueError."""
    from pedestal_station.choice import Rules
    names = [field.name for field in dataclasses.fields(Rules)]
    try:
        return Rules(**{name: value for name in names if (value := getattr(options, name)) is not None})
    except parameters.ParameterError as error:
        name, equals, rest = str(error).partition(' = ')
        raise ValueError(f'{parameters.option_of(name)}{equals}{rest}') from None


def _write(options: argparse.Namespace, night: 'Night') -> None:
    """Write the files of a plan."""
    from pedestal_station.outputs import rows
    console.write_json(options.json, rows.json_content(night))
    if options.csv:
        options.csv.write_text(rows.csv_text(night), encoding='utf-8')
    if options.ics:
        from pedestal_station.outputs import calendar
        options.ics.write_bytes(calendar.text(night).encode())
    if options.html:
        from pedestal_station.outputs import page
        options.html.write_text(page.text(night, options.command), encoding='utf-8')
    if options.output:
        from pedestal_station.outputs import file
        file.write(options.output, night)
    written = [str(path) for name in NEW_FILES if (path := getattr(options, name))]
    print('\n'.join(written), end='\n' * bool(written))


VERBS = {
    'plan': Verb(_add_plan, _plan),
}
