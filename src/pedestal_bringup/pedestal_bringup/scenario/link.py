"""Dish and radio link of a scenario: the parameters of several nodes that follow from `scenario.dish` and
`scenario.link`, and the lines that state them before a run.

    beamwidth   70 deg times wavelength divided by diameter
    wind        acts on the diameter
    C/N0        at the reference range: that of the default antenna for the area of the dish; with an EIRP:
                EIRP + G/T - 20 log10(4 pi R / wavelength) - 10 log10(k)

A value that the scenario sets itself takes precedence, except over an EIRP.
"""
import dataclasses
import math
import typing
from collections.abc import Mapping

from pedestal_common import parameters
from pedestal_common.parameters import NOT_GIVEN, is_absent, parameter

if typing.TYPE_CHECKING:    # numpy is slow to import, and `pedestal scenarios` needs none
    from pedestal_common.quantities import DecibelHertz, Decibels, Meters, Radians, Value

DEFAULT_DIAMETER_M, DEFAULT_FREQUENCY_GHZ = 3.0, 6.976
"""Diameter of the dish for which the defaults of beamwidth and C/N0 hold [m], and the frequency that they imply."""
BEAM_FACTOR_RAD = math.radians(70.0)  # half-power beamwidth times diameter divided by wavelength [rad]
SPEED_OF_LIGHT_M_GHZ = 0.299792458  # speed of light [m GHz]
BOLTZMANN_DB = -228.599  # Boltzmann constant [dBW/K/Hz]
EFFICIENCY = 0.6  # aperture efficiency of a dish [-]


@dataclasses.dataclass(frozen=True)
class DishParameters(parameters.Parameters):
    """The dish, one for all nodes."""
    diameter: float = parameter(NOT_GIVEN, 0.1, 100.0, 'm', 'diameter of the dish, from which beamwidth, C/N0 and '
                                'torque of the wind follow; not given: the nodes keep their values, of a dish of 3 m')
    frequency: float = parameter(NOT_GIVEN, 0.1, 300.0, 'GHz', 'frequency of the signal; not given: 6.976')

    @property
    def stated(self) -> bool:
        """True if the scenario states the dish."""
        return not (is_absent(self.diameter) and is_absent(self.frequency))

    @property
    def size(self) -> 'Meters':
        """Diameter, also of a dish that is not stated."""
        return DEFAULT_DIAMETER_M if is_absent(self.diameter) else self.diameter

    @property
    def wavelength(self) -> 'Meters':
        """Wavelength of the signal."""
        return SPEED_OF_LIGHT_M_GHZ / (DEFAULT_FREQUENCY_GHZ if is_absent(self.frequency) else self.frequency)

    @property
    def beamwidth(self) -> 'Radians':
        """Half-power beamwidth."""
        return BEAM_FACTOR_RAD * self.wavelength / self.size

    @property
    def gain(self) -> 'Decibels':
        """Gain on the axis of the beam."""
        return 10.0 * math.log10(EFFICIENCY) + 20.0 * math.log10(math.pi * self.size / self.wavelength)


@dataclasses.dataclass(frozen=True)
class LinkParameters(parameters.Parameters):
    """The radio link from the target to the receiver."""
    eirp: float = parameter(NOT_GIVEN, -100.0, 120.0, 'dBW', 'EIRP of the target; with G/T and range it gives the '
                            'C/N0; not given: tracking_receiver.receiver.cn0_dbhz at reference_range holds')
    g_over_t: float = parameter(NOT_GIVEN, -60.0, 80.0, 'dB/K', 'G/T of the station; not given: gain of the dish over '
                                'noise_temperature')
    noise_temperature: float = parameter(150.0, 1.0, 1e5, 'K', 'noise temperature of antenna and receiver')

    def cn0(self, dish: DishParameters, distance: 'Meters') -> 'DecibelHertz':
        """Return the C/N0 on the axis of the beam at a range."""
        ratio = dish.gain - 10.0 * math.log10(self.noise_temperature) if is_absent(self.g_over_t) else self.g_over_t
        return self.eirp + ratio - 20.0 * math.log10(4.0 * math.pi * distance / dish.wavelength) - BOLTZMANN_DB


def derive(sections: 'dict[str, dict[str, Value]]', dish: DishParameters, link: LinkParameters,
           types: Mapping[str, type[parameters.Parameters]]) -> tuple[str, ...]:
    """Set the parameters that follow from dish and link. Return a line for each value that overrides the dish, or that
    the link replaces. types: {node: its parameter dataclass}."""
    known = {node: parameters.defaults(kind) for node, kind in types.items()}
    receiver, notes = sections['tracking_receiver'], []

    def take(node: str, key: str, value: float) -> None:
        if key not in known[node]:      # an array has no dish, and a receiver of I/Q samples no C/N0
            return
        own = sections[node].setdefault(key, float(f'{value:.6g}'))
        if not math.isclose(own, value, rel_tol=0.01) and key != 'receiver.cn0_dbhz':
            notes.append(f'{node}.{key} = {own:.4g} overrides {value:.4g} of the dish of {dish.size:g} m')

    if dish.stated:
        take('adu', 'wind.field.diameter', dish.size)
        take('tracking_receiver', 'antenna.beamwidth', dish.beamwidth)
    distance = receiver.get('receiver.reference_range', known['tracking_receiver'].get('receiver.reference_range'))
    if not is_absent(link.eirp) and distance:
        level = float(f'{link.cn0(dish, distance):.6g}')
        own = receiver.get('receiver.cn0_dbhz', level)
        if own != level:
            notes.append(f'scenario.link.eirp = {link.eirp:g} dBW: {level:.4g} dB-Hz at {1e-3 * distance:g} km in '
                         f'place of tracking_receiver.receiver.cn0_dbhz = {own:g}')
        receiver['receiver.cn0_dbhz'] = level
    elif dish.stated:
        take('tracking_receiver', 'receiver.cn0_dbhz', known['tracking_receiver'].get('receiver.cn0_dbhz', 0.0)
             + 20.0 * math.log10(dish.size / DEFAULT_DIAMETER_M))
    return tuple(notes)
