"""Commands of an operator to the station on `station/command`: their table, and what each of them requests."""
from typing import NamedTuple

from pedestal_common.geometry import orbit
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.quantities import Days, Degrees, Seconds
from pedestal_common.wire import commands
from pedestal_common.wire.commands import Argument, Command, CommandDefinition
from pedestal_station.outputs.file import ELEMENT_NAMES, Contact, direction, orbit_of, seconds

_CASE = Argument('case', 'name of the pass in the plan, NAME/K', default='')

STATION_COMMANDS = (
    CommandDefinition('hold', 'send no more commands to the antenna until `resume`; a recording continues', (
        Argument('reason', 'reason', default=''),)),
    CommandDefinition('resume', 'go on after `hold`, or after another client has commanded a mode'),
    CommandDefinition('skip', 'leave out a pass, also the one under way', (
        _CASE._replace(doc=f'{_CASE.doc}; default: the pass under way, else the next'),)),
    CommandDefinition('insert', 'take a pass that is dropped, skipped or failed, or one of other elements; queued '
                      'passes that overlap it are dropped', (
                          _CASE, Argument('name', 'name of another satellite; default: its number', default=''),
                          *(Argument(name, 'its elements, as in the command `tle`', default='')
                            for name in ELEMENT_NAMES),
                          *(Argument(name, f'{name} of the contact, UTC', default='') for name in ('begin', 'end')))))
"""Table of the commands of the station."""


class Antenna(NamedTuple):
    """What the station needs of the parameters of the control unit."""
    station: StationParameters
    azimuth: tuple[Degrees, Degrees]    # lowest and highest encoder angle
    oldest: Days                        # largest age of elements


class Request(NamedTuple):
    """A command of an operator, checked as far as that needs no state of the station."""
    command: Command
    case: str = ''                  # of a pass of the plan
    contact: Contact | None = None  # to be inserted, without the number in its case


def request(command: Command, antenna: Antenna) -> Request:
    """Return the Request of a Command. Raises ValueError."""
    found = {name: str(value) for name, value in commands.values(STATION_COMMANDS, command).items()}
    case = found.get('case', '')
    if command.verb != 'insert':
        return Request(command, case)
    others = [name for name, text in found.items() if text and name != 'case']
    if bool(case) == bool(others):
        raise ValueError('insert: must have either case, or elements with begin and end'
                         + (f'; case = {case} and {", ".join(others)} are given' if case else ''))
    return Request(command, case, None if case else _contact(found, antenna))


def _contact(found: dict[str, str], antenna: Antenna) -> Contact:
    """Return the contact of the arguments of `insert`. Raises ValueError."""
    elements = {name: found[name].replace('_', ' ') if name != 'omm' else found[name]
                for name in ELEMENT_NAMES if found[name]}
    number = orbit_of(elements).satellite.number
    name = found['name'] or number
    times: list[Seconds] = [seconds(orbit.instant(name, found[name])) for name in ('begin', 'end')]
    begin, end = times
    points = [direction(elements, antenna.station, utc) for utc in (begin, 0.5 * (begin + end), end)]
    (azimuth, elevation), highest = points[0], max(elevation for _, elevation in points)
    azimuth += 360.0 * round((0.5 * sum(antenna.azimuth) - azimuth) / 360.0)
    contact = Contact(name, name, number, elements, (), begin, end, azimuth, elevation, highest)
    if highest <= 0.0:
        raise ValueError(f'insert: {name} is below the horizon from {found["begin"]} to {found["end"]}')
    return contact
