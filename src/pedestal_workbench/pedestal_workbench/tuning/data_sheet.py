"""Data sheet of an antenna, whose fields are the options of `pedestal new`, and the refusal of a data sheet whose
values contradict each other.

The refusal names options, each with the range in which the antenna can be made. Because each range depends on the
other values of the data sheet, each range is searched. An option takes values of equal ratios up to the ends of its
own range. The edges between refused and accepted values are bisected.
"""
import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from pedestal_bringup.scenario.link import DEFAULT_DIAMETER_M, DishParameters
from pedestal_common.graph.topics import AXES
from pedestal_common.parameters import (
    NOT_GIVEN,
    ParameterError,
    Parameters,
    as_dict,
    choice,
    flatten,
    is_absent,
    option_of,
    parameter,
)
from pedestal_common.quantities import Hertz, Json, Radians

MIN_MODE_HZ, MAX_MODE_HZ = 1.0, 200.0  # smallest and largest structural frequency that the simulated plant allows [Hz]

TEMPLATE_SCENARIOS = ('leo_pass', 'geo_station', 'uav_flyby', 'ship_pass', 'ship_uav')

KNOWN_MIRROR_M = DEFAULT_DIAMETER_M  # diameter of the mirror of the default antenna, from which others are scaled


class Law(NamedTuple):
    """Law by which a value follows from that of the default antenna."""
    text: str
    share: Callable[[float, float, float], float]   # factor, from the ratios of diameter, motor torque and motor speed
    for_loops: bool                                 # True if the loops depend on the value most


def _ratio_share(load: float) -> float:
    """Return the share of the gear ratio for a share of the torque on the axis per torque of a motor, limited so that
    a gear can have it."""
    return min(max(load, 0.15), 100.0)


_INERTIA = Law('diameter^5: equal shape and material', lambda d, _torque, _speed: d**5, True)
_RATIO = Law('diameter^2 to 30 m: with the motor the wind torque, diameter^3',
             lambda d, _torque, _speed: _ratio_share(d**2), True)
_RATE = Law('diameter^-2 above 3 m, with the gear ratio', lambda d, _torque, _speed: min(1.0, d**-2), False)
_TORQUE = Law('diameter: with the gear ratio the wind torque, diameter^3', lambda d, _torque, _speed: max(d, 0.1),
              True)
_RATIO_OF_MOTOR = Law('diameter^3 / motor torque, 0.15 to 100 times that of 3 m: the wind torque',
                      lambda d, torque, _speed: _ratio_share(d**3 / torque), True)
_RATE_OF_MOTOR = Law('motor speed / gear ratio, at most that of 3 m',
                     lambda d, torque, speed: min(1.0, speed / _ratio_share(d**3 / torque)), False)

SCALED_FIELDS: dict[str, tuple[float, Law]] = {
    'inertia_azimuth': (210.0, _INERTIA), 'inertia_elevation': (150.0, _INERTIA), 'ratio_azimuth': (64.0, _RATIO),
    'ratio_elevation': (90.0, _RATIO), 'motor_torque': (30.0, _TORQUE), 'rate_azimuth': (140.0, _RATE),
    'rate_elevation': (97.0, _RATE)}
"""{field that a data sheet may lack: (value of the default antenna, law)}."""

LAWS_OF_MOTOR = {_RATIO: _RATIO_OF_MOTOR, _RATE: _RATE_OF_MOTOR}  # laws for a data sheet with the torque of its motors

GRID_COUNT, BISECTIONS, MAX_OPTIONS = 8, 10, 3
"""Number of tried values on each side of the refused value; number of bisections of an edge; largest number of options
in the refusal."""

NO_CAUSE = ('encoder_bits', 'cn0', 'lash')  # fields of the data sheet that contradict no other field


@dataclasses.dataclass(frozen=True)
class DataSheet(Parameters):
    """Data sheet of an antenna. Both motors of an axis have equal data."""
    mirror: float = parameter(3.0, 0.1, 40.0, 'm', 'diameter of the mirror')
    frequency: float = parameter(2.3, 0.1, 100.0, 'GHz', 'frequency of the received signal')
    cn0: float = parameter(0.0, 0.0, 120.0, 'dB-Hz', 'C/N0 on the beam axis at the reference range of the scenario; '
                           '0: computed from that of the scenario for the area of the mirror')
    beamwidth: float = parameter(0.0, 0.0, 20.0, 'deg',
                                 'half-power beamwidth; 0: computed as 70 deg times wavelength divided by diameter')
    inertia_azimuth: float = parameter(NOT_GIVEN, 0.1, 1e7, 'kg m2', 'inertia of the load about the azimuth axis')
    inertia_elevation: float = parameter(NOT_GIVEN, 0.1, 1e7, 'kg m2', 'inertia of the load about the elevation axis')
    ratio_azimuth: float = parameter(NOT_GIVEN, 8.0, 1e5, '', 'gear ratio from motor to azimuth axis')
    ratio_elevation: float = parameter(NOT_GIVEN, 8.0, 1e5, '', 'gear ratio from motor to elevation axis')
    motor_torque: float = parameter(NOT_GIVEN, 0.1, 1000.0, 'Nm',
                                    'rated torque of one motor; the peak torque is set to three times this torque')
    motor_power: float = parameter(NOT_GIVEN, 1e-3, 1000.0, 'kW', 'rated power of one motor, which gives its rated '
                                   'torque at --motor-speed')
    motor_speed: float = parameter(1500.0, 100.0, 10000.0, 'rpm', 'rated speed of a motor')
    lash: float = parameter(1.0, 0.0, 50.0, 'mrad', 'lash of one gear mesh, referred to the load axis')
    rate_azimuth: float = parameter(NOT_GIVEN, 0.6, 1000.0, 'deg/s', 'largest rate of azimuth')
    rate_elevation: float = parameter(NOT_GIVEN, 0.6, 1000.0, 'deg/s', 'largest rate of elevation')
    mode: float = parameter(0.0, 0.0, MAX_MODE_HZ, 'Hz', 'lowest structural frequency with locked motors, 1 to 200; '
                            '0: computed as 20 Hz times the diameter in m to the power -0.7')
    mode_share: float = parameter(0.5, 0.0, 0.9, '', 'share of the load inertia that swings with the lowest '
                                  'structural frequency; 0: rigid structure')
    encoder_bits: int = parameter(22, 8, 32, 'bit', 'resolution of the load encoders, per turn')
    like: str = choice('leo_pass', TEMPLATE_SCENARIOS, 'scenario that provides target and site')

    def __post_init__(self) -> None:
        if self.mode != 0.0 and not MIN_MODE_HZ <= self.mode <= MAX_MODE_HZ:
            raise ParameterError(f'mode = {self.mode:g} Hz: must be {MIN_MODE_HZ:g} to {MAX_MODE_HZ:g}, or 0 for the '
                                 'average of antennas of this diameter')
        if not (is_absent(self.motor_power) or is_absent(self.motor_torque)):
            raise ParameterError(f'motor_power = {self.motor_power:g} kW: must be without motor_torque, because power '
                                 f'and motor_speed = {self.motor_speed:g} rpm give the torque')
        super().__post_init__()

    def completed(self) -> 'DataSheet':
        """Return the data sheet with a torque for its power, and with scaled values for those that it lacks. Raises
        ParameterError."""
        sheet, limits = self.with_torque(), _limits()
        values: dict[str, Json] = {
            name: min(max(sheet.scaled(name)[0], limits[name]['low']), limits[name]['high'])
            for name in SCALED_FIELDS if is_absent(getattr(sheet, name))}
        return dataclasses.replace(sheet, **values)

    def with_torque(self) -> 'DataSheet':
        """Return the data sheet with the torque of its motors in place of their power. Raises ParameterError."""
        if is_absent(self.motor_power):
            return self
        speed = self.motor_speed * math.pi / 30.0
        low, high = (_limits()['motor_torque'][end] for end in ('low', 'high'))
        torque = float(f'{1e3 * self.motor_power / speed:.4g}')
        if not low <= torque <= high:
            raise ParameterError(f'{option_of("motor_power")} {self.motor_power:g} kW: must be '
                                 f'{1e-3 * low * speed:.3g} to {1e-3 * high * speed:.3g} at '
                                 f'{self.motor_speed:g} rpm, for a torque of {low:g} to {high:g} Nm')
        return dataclasses.replace(self, motor_power=NOT_GIVEN, motor_torque=torque)

    def scaled(self, name: str) -> tuple[float, Law]:
        """Return (value of one of SCALED_FIELDS, also outside its range; its law). The torque of the motors, if the
        data sheet has it, gives the gear ratio, and a gear ratio that follows from it the rate."""
        known, law = SCALED_FIELDS[name]
        torque, ratio = self.motor_torque, getattr(self, name.replace('rate_', 'ratio_'))
        if is_absent(torque):
            torque = SCALED_FIELDS['motor_torque'][0]
        elif is_absent(ratio):
            law = LAWS_OF_MOTOR.get(law, law)
        shares = (self.mirror / KNOWN_MIRROR_M, torque / SCALED_FIELDS['motor_torque'][0],
                  self.motor_speed / DataSheet.motor_speed)
        return float(f'{known * law.share(*shares):.4g}'), law

    @property
    def structural_frequency(self) -> Hertz:
        """Lowest frequency of the structure with locked motors. Without `mode` it is the average of antennas of this
        diameter d [m], 20 Hz d^-0.7. Source: W. Gawronski, Control and Pointing Challenges of Antennas and (Radio)
        Telescopes, IPN Progress Report 42-159 (JPL, 2004), and Modeling and Control of Antennas and Telescopes
        (Springer, 2008). Because single antennas differ from the average, a measured frequency takes precedence."""
        return self.mode or 20.0 * self.mirror**-0.7

    @property
    def theta(self) -> Radians:
        """Half-power beamwidth."""
        return math.radians(self.beamwidth) or DishParameters(self.mirror, self.frequency).beamwidth


def _limits() -> dict[str, Mapping[str, Json]]:
    return {name: field.metadata for name, field in flatten(DataSheet) if name in SCALED_FIELDS}


def refusal(sheet: DataSheet, error: ValueError, make: Callable[[DataSheet], object]) -> ValueError:
    """Return the error with options for the error of a data sheet. make(sheet) raises ValueError for a refused one."""
    axis, whole = _axis(error), as_dict(sheet.completed())
    if not is_absent(sheet.motor_power):        # it gives the torque
        whole |= {'motor_power': sheet.motor_power, 'motor_torque': NOT_GIVEN}

    def is_made(name: str, value: float) -> bool:
        """Return True if the data sheet with another value is made, or refused for another axis."""
        try:
            changes: dict[str, Json] = {name: value}
            make(dataclasses.replace(sheet, **changes))
        except ValueError as found:
            # An option of one axis cannot mend the other axis.
            return bool(name.endswith(axis or ' ') and _axis(found) not in ('', axis))
        return True

    fields = [(name, field) for name, field in flatten(type(sheet)) if 'low' in field.metadata
              and name not in NO_CAUSE and whole[name] > 0.0
              and not (axis and name.rpartition('_')[2] in AXES and not name.endswith(axis))]
    found: list[str] = []
    # The options that differ from the default come first, because the user gave them.
    for name, field in sorted(fields, key=lambda item: is_absent(getattr(sheet, item[0]))
                              or getattr(sheet, item[0]) == item[1].default):
        if len(found) == MAX_OPTIONS:
            break
        edges = _edges(name, whole[name], field.metadata, is_made)
        if edges:
            value = f'{whole[name]:g} {field.metadata["unit"]}'.rstrip()
            found.append(f'{option_of(name)} {value}: must be {edges[0]:g} to {edges[1]:g}')
    if not found:
        return ValueError(f'the values of the data sheet contradict each other: {error}')
    return ValueError(f'{", or ".join(found)}, with the other values of the data sheet ({error})')


def _axis(error: ValueError) -> str:
    return next((name for name in AXES if f'{name}.' in str(error) or f'adu.{name}:' in str(error)), '')


def _edges(name: str, value: float, meta: Mapping[str, Json],
           is_made: Callable[[str, float], bool]) -> tuple[float, float] | None:
    """Return the lowest and highest accepted value next to a refused value of a field. meta: metadata of the field;
    is_made(name, value) returns True for an accepted value."""
    for end in (meta['high'], meta['low'] or 1e-4 * meta['high']):
        refused, accepted, last = value, 0.0, 0.0   # 0: no value was accepted
        for tried in np.geomspace(value, end, GRID_COUNT + 1)[1:].tolist() if end != value else ():
            tried = min(max(tried, meta['low']), meta['high'])
            if is_made(name, tried):
                accepted, last = accepted or tried, tried
            elif accepted:
                last = _bisected(last, tried, lambda one: is_made(name, one))
                break
            else:
                refused = tried
        if accepted:
            edge = _bisected(accepted, refused, lambda one: is_made(name, one))
            low, high = sorted((edge, last))
            return _rounded(low, math.ceil), _rounded(high, math.floor)
    return None


def _bisected(accepted: float, refused: float, is_made: Callable[[float], bool]) -> float:
    for _ in range(BISECTIONS):
        middle = math.sqrt(accepted * refused)
        accepted, refused = (middle, refused) if is_made(middle) else (accepted, middle)
    return accepted


def _rounded(value: float, direction: Callable[[float], int]) -> float:
    size = 10.0**(math.floor(math.log10(value)) - 2)
    return float(f'{direction(value / size - 1e-9 if direction is math.ceil else value / size + 1e-9) * size:.3g}')
