"""Parameters of a drive of two axes: AduNodeParameters of `adu_node` and, with the bus, of the node of real drives.

Because a scenario also runs with real drives, they accept the parameters of the simulated plant, and do not use them.
"""
import dataclasses
import math
import typing

import numpy as np

from drive_law.axis_params import (
    SPEED_LOOP_PERIOD_S,
    AxisParameters,
    FaultParameters,
    FrictionParameters,
    GearTrainParameters,
    LimitParameters,
    LoadParameters,
    SpeedLoopParameters,
)
from pedestal_common.injection import table
from pedestal_common.parameters import ParameterError, Parameters, choice, flag, group, parameter, text
from pedestal_common.quantities import Radians, Seconds

MAX_TRANSPORT_DELAY_S = 0.1  # longest transport delay [s]


def whole_speed_periods(name: str, value: Seconds) -> int:
    """Return the number of speed-loop periods in a time. Raises ParameterError unless it is whole."""
    periods = round(value / SPEED_LOOP_PERIOD_S)
    if abs(value / SPEED_LOOP_PERIOD_S - periods) > 1e-6:
        raise ParameterError(f'{name} = {value:g} s: must be a multiple of {SPEED_LOOP_PERIOD_S:g} s (the speed loop)')
    return periods


@dataclasses.dataclass(frozen=True)
class BrakeParameters(Parameters):
    """Brakes of all motors; the braking torque is a parameter of each motor."""
    engage_time: float = parameter(0.05, 0.0, 10.0, 's', 'time from the command until the brakes grip')
    release_time: float = parameter(0.1, 0.0, 10.0, 's', 'time from the command until the brakes are free')
    stop_time: float = parameter(1.0, 1e-3, 100.0, 's', 'longest controlled stop; the brakes end a longer stop')


@dataclasses.dataclass(frozen=True)
class StowPinParameters(Parameters):
    """Stow pins of both axes: place of the holes, conditions and times of the motion."""
    azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'encoder angle at which the pin of the azimuth meets its hole')
    elevation: float = parameter(0.5 * math.pi, -20.0, 20.0, 'rad', 'encoder angle at which the pin of the elevation '
                                 'meets its hole')
    window: float = parameter(1.75e-3, 1e-5, 0.1, 'rad', 'largest distance from the hole for moving a pin in')
    travel_time: float = parameter(3.0, 0.0, 600.0, 's', 'time of a pin from out to in')
    timeout: float = parameter(10.0, 0.01, 600.0, 's', 'longest time for the motion of a pin; then the pin has failed')
    initially_in: bool = flag(False, 'true: both pins are in at t = 0')

    def check(self) -> None:
        """Raise ParameterError if the timeout is not above the travel time."""
        if self.timeout <= self.travel_time:
            raise ParameterError(f'timeout = {self.timeout:g} s: must be above travel_time = {self.travel_time:g} s')


@dataclasses.dataclass(frozen=True)
class GustParameters(Parameters):
    """Gusts: step and sine add a torque to the mean torque; davenport and von_karman are spectra of the wind speed,
    see wind.py."""
    kind: str = choice('none', ('none', 'step', 'sine', 'davenport', 'von_karman'), 'gust in addition to '
                       'the mean torque')
    azimuth: float = parameter(0.0, -1e9, 1e9, 'Nm', 'step, sine: amplitude on azimuth')
    elevation: float = parameter(0.0, -1e9, 1e9, 'Nm', 'step, sine: amplitude on elevation')
    start: float = parameter(1.0, 0.0, 86400.0, 's', 'step, sine: time of the drive at which the gust begins')
    frequency: float = parameter(1.0, 1e-3, 50.0, 'Hz', 'sine: frequency')
    speed: float = parameter(10.0, 1.0, 60.0, 'm/s', 'spectra: speed V of the mean wind')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'spectra: turbulence intensity sigma_v / V')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'von_karman: length scale of the turbulence')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'spectra: seed of the phases')


@dataclasses.dataclass(frozen=True)
class WindFieldParameters(Parameters):
    """A wind over the whole antenna; see wind.py. Its torques add to those of WindParameters."""
    speed: float = parameter(0.0, 0.0, 60.0, 'm/s', 'speed V of the mean wind; 0: off')
    from_azimuth: float = parameter(0.0, -2.0 * math.pi, 2.0 * math.pi, 'rad', 'deck azimuth of the wind source')
    intensity: float = parameter(0.2, 0.0, 0.5, '', 'turbulence intensity sigma_u / V along the wind')
    length: float = parameter(100.0, 10.0, 2000.0, 'm', 'length scale of the turbulence')
    diameter: float = parameter(3.0, 0.1, 100.0, 'm', 'diameter D of the dish; of a scenario: scenario.dish.diameter')
    density: float = parameter(1.225, 0.1, 2.0, 'kg/m3', 'density of the air')
    c_1: float = parameter(0.055, -1.0, 1.0, '', 'torque coefficient of sin alpha')
    c_2: float = parameter(-0.08, -1.0, 1.0, '', 'torque coefficient of sin 2 alpha')
    seed: int = parameter(1, 0, 2 ** 31 - 1, '', 'seed of the phases')


@dataclasses.dataclass(frozen=True)
class WindParameters(Parameters):
    """Torque of the wind on both axes."""
    azimuth: float = parameter(0.0, -1e9, 1e9, 'Nm', 'mean torque on azimuth')
    elevation: float = parameter(0.0, -1e9, 1e9, 'Nm', 'mean torque on elevation')
    gust: GustParameters = group(GustParameters)
    field: WindFieldParameters = group(WindFieldParameters)

    def check(self) -> None:
        """Raise ParameterError for a spectrum without a mean torque."""
        if self.gust.kind in ('davenport', 'von_karman') and self.azimuth == self.elevation == 0.0:
            raise ParameterError(f'gust.kind = {self.gust.kind}: scales the mean torque, so azimuth or '
                                 'elevation must not be 0 Nm')


@dataclasses.dataclass(frozen=True)
class MountParameters(Parameters):
    """Alignment errors of deck, axes and beam; mount.py defines convention and signs."""
    tilt_forward: float = parameter(0.0, -0.1, 0.1, 'rad', "azimuth axis leans to azimuth 0, the bow; katpoint's P5")
    tilt_starboard: float = parameter(0.0, -0.1, 0.1, 'rad', 'azimuth axis leans to azimuth 90 deg; P6')
    non_perpendicularity: float = parameter(0.0, -0.1, 0.1, 'rad', 'deviation of the two axes from 90 deg; P3')
    collimation: float = parameter(0.0, -0.1, 0.1, 'rad', 'angle from the beam to the plane perpendicular to the '
                                   'elevation axis; P4')
    sag: float = parameter(0.0, -0.1, 0.1, 'rad', 'droop of the beam at elevation 0, cosine of elevation; P8')


@dataclasses.dataclass(frozen=True)
class ElevatingParameters(Parameters):
    """Inertia of the elevating part in its own frame, x along the beam, y to port, z up; see gimbal.py. The inertia
    about y is elevation.load.inertia; azimuth.load.inertia holds at elevation 0."""
    about_beam: float = parameter(0.0, 0.0, 1e7, 'kg m2', 'inertia about x; 0: the inertia of the azimuth is '
                                  'constant, and the axes do not interact')
    about_lift: float = parameter(0.0, 0.0, 1e7, 'kg m2', 'inertia about z')
    product_xy: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x y over the mass')
    product_xz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of x z over the mass')
    product_yz: float = parameter(0.0, -1e7, 1e7, 'kg m2', 'integral of y z over the mass')


@dataclasses.dataclass(frozen=True)
class AduParameters(Parameters):
    """Parameters of the antenna drive unit."""
    period: float = parameter(5e-3, 1e-3, 0.02, 's', 'period T of the steps, each with one command')
    transport_delay: float = parameter(0.0, 0.0, MAX_TRANSPORT_DELAY_S, 's', 'time from the stamp of a command to its '
                                       'effect')
    initial_azimuth: float = parameter(0.0, -20.0, 20.0, 'rad', 'azimuth of the axis at time 0')
    initial_elevation: float = parameter(0.0, -20.0, 20.0, 'rad', 'elevation of the axis at time 0')
    initially_enabled: bool = flag(True, 'true: enabled at t = 0; false: brakes on until adu/enable')
    brakes: BrakeParameters = group(BrakeParameters)
    stow_pins: bool = flag(False, 'true: each axis has a stow pin')
    pins: StowPinParameters = group(StowPinParameters)
    wind: WindParameters = group(WindParameters)
    mount: MountParameters = group(MountParameters)
    elevating: ElevatingParameters = group(ElevatingParameters)
    azimuth: AxisParameters = group(AxisParameters)
    elevation: AxisParameters = group(
        AxisParameters,
        speed_loop=SpeedLoopParameters(proportional=3.2, integral=105.0, load_inertia=150.0),
        gear_train=GearTrainParameters(reducer_ratio=10.0, pinion_ratio=9.0, lash=0.8e-3, stiffness=4e6, damping=4e3),
        load=LoadParameters(inertia=150.0, viscous=15.0, unbalance=40.0),
        friction=FrictionParameters(coulomb=45.0, breakaway=60.0),
        limits=LimitParameters(rate=1.7, lower=math.radians(-2.0), upper=math.radians(92.0)),
        faults=FaultParameters(overspeed=2.1))

    def check(self) -> None:
        """Raise ParameterError for invalid times, an impossible body, or an initial angle outside the travel."""
        whole_speed_periods('period', self.period)
        whole_speed_periods('transport_delay', self.transport_delay)
        if self.elevating.about_beam > 0.0:
            self._check_bodies()
        for name in ('azimuth', 'elevation'):
            angle, limits = getattr(self, f'initial_{name}'), getattr(self, name).limits
            if not limits.lower <= angle <= limits.upper:
                raise ParameterError(f'initial_{name} = {angle:g} rad: must be {limits.lower:g} to {limits.upper:g}, '
                                     'the travel of the axis')
            if self.stow_pins:
                self._check_pin(name, angle, limits)

    def _check_pin(self, name: str, angle: Radians, limits: LimitParameters) -> None:
        hole = getattr(self.pins, name)
        if not limits.lower <= hole <= limits.upper:
            raise ParameterError(f'pins.{name} = {hole:g} rad: must be {limits.lower:g} to {limits.upper:g}, the '
                                 'travel of the axis')
        if self.pins.initially_in and abs(angle - hole) > self.pins.window:
            raise ParameterError(f'initial_{name} = {angle:g} rad: must be pins.{name} = {hole:g} within pins.window, '
                                 'because of pins.initially_in')

    def _check_bodies(self) -> None:
        e = self.elevating
        I_x, I_y, I_z = e.about_beam, self.elevation.load.inertia, e.about_lift
        if not 0.0 < I_z < self.azimuth.load.inertia:
            raise ParameterError(f'elevating.about_lift = {I_z:g} kg m2: must be above 0 and below '
                                 f'azimuth.load.inertia = {self.azimuth.load.inertia:g}')
        half = 0.5 * (I_x + I_y + I_z)
        second = np.array([[half - I_x, e.product_xy, e.product_xz], [e.product_xy, half - I_y, e.product_yz],
                           [e.product_xz, e.product_yz, half - I_z]])
        if np.linalg.eigvalsh(second)[0] < 0.0:
            raise ParameterError(f'elevating: no body has moments {I_x:g}, {I_y:g} (elevation.load.inertia), {I_z:g} '
                                 'kg m2 with these products')


@dataclasses.dataclass(frozen=True)
class RunParameters(Parameters):
    """Parameters of the run of a node that owns the time."""
    if typing.TYPE_CHECKING:
        period: float       # each subclass declares it
    duration: float = parameter(0.0, 0.0, 86400.0, 's',
                                'length of the run in the time of the drive; 0: until stopped')
    command_timeout: int = parameter(10, 1, 10000, 'periods', 'realtime: age from which a command is stale; then '
                                     'the axes stop, and a beam stays')

    def check(self) -> None:
        """Raise ParameterError unless the run is a whole number of periods."""
        super().check()
        if self.duration and abs(self.duration / self.period - round(self.duration / self.period)) > 1e-6:
            raise ParameterError(f'duration = {self.duration:g} s: must be a multiple of the period {self.period:g} s')


@dataclasses.dataclass(frozen=True)
class AduNodeParameters(RunParameters, AduParameters):
    """Parameters of adu_node: drive and run."""
    inject: str = text('', f"{table.INJECT_DOC}; also requests, such as '5 adu/emergency_stop'")
    state_file: str = text('', 'file for the angles of the simulated plant, from which it continues after a restart; '
                           'empty: it begins at the initial angles')

    def check(self) -> None:
        """Raise ParameterError for an invalid `inject`."""
        super().check()
        table.scheduled_commands('adu', self.inject)

    def check_graph(self, beams: int, lockstep: bool) -> None:
        """Raise ParameterError for a fault that does not exist in the pacing of the graph."""
        super().check_graph(beams, lockstep)
        table.check_pacing('adu', self.inject, lockstep)
