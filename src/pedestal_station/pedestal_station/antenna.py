"""The antenna of a plan: what the prediction of a pass needs of a scenario, and of the place and time of the night."""
import dataclasses
import datetime
import functools
import math

import numpy as np

from acu_tracker import control_unit
from acu_tracker.params import AcuParameters
from acu_tracker.program.air import Air
from acu_tracker.search import judgement
from pedestal_bringup.scenario.link import DishParameters, LinkParameters
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_common.geometry import bodies, orbit, pointing_model
from pedestal_common.geometry.geodesy import StationParameters
from pedestal_common.graph.steps import SECONDS_PER_DAY
from pedestal_common.parameters import is_absent
from pedestal_common.quantities import DecibelHertz, Decibels, Meters, Pairs, Radians, Records, Times, Vectors3
from tracking_receiver_sim.params import ReceiverParameters

SUN_RADIUS_RAD = math.radians(0.27)  # apparent radius of the sun, at radio frequencies at least this [rad]

NO_SCENARIO = 'scenario:\n  ros__parameters: {}\n'  # text of a scenario in which every parameter has its default


@dataclasses.dataclass(frozen=True)
class Antenna:
    """An antenna at its place in a night.

    A ship is taken as level, with its mean heading, because its future motion is not known.
    """
    acu: AcuParameters
    receiver: ReceiverParameters | None     # None: a receiver without C/N0
    dish: DishParameters
    link: LinkParameters
    heading: Radians                # of the deck; 0 ashore
    station: StationParameters
    begin: datetime.datetime        # UTC of the night
    rain_margin: Decibels           # taken from the C/N0
    sun_avoidance: Radians          # largest angle between sun and target at which the sun takes the target

    @functools.cached_property
    def constants(self) -> Records:
        """Constants of the control unit (1,)."""
        return control_unit.constants(self.acu)

    @functools.cached_property
    def terms(self) -> Records:
        """PointingModel (1,)."""
        made = pointing_model.PointingModel.zeros()
        pointing_model.put(made[0], self.acu.pointing.terms)
        return made

    def deck_angles(self, times: Times, enu: Vectors3) -> Pairs:
        """Return azimuth and apparent elevation (n, 2) on the deck of positions ENU [m]."""
        return Air(self.acu.refraction).raised(times, orbit.angles(enu)) - (self.heading, 0.0)

    def sun(self, times: Times) -> Vectors3:
        """Return the unit vectors ENU to the sun at seconds of the night."""
        julian, fraction = orbit.julian_date(self.begin)
        fractions = fraction + times / SECONDS_PER_DAY
        seen = bodies.seen('sun', self.station, julian, fractions, orbit.earth_fixed(julian, fractions))
        return seen / np.linalg.norm(seen, axis=1)[:, np.newaxis]

    def cn0(self, distance: Meters) -> DecibelHertz:
        """Return the expected C/N0 at a range: of the link budget, without an EIRP that of the simulated receiver; NaN
        without both."""
        if not is_absent(self.link.eirp):
            return self.link.cn0(self.dish, distance) - self.rain_margin
        known = self.receiver
        return math.nan if known is None else judgement.expected_level(
            known.cn0_dbhz, known.reference_range, known.range_exponent, distance) - self.rain_margin


def of(chosen: Scenario, station: StationParameters, begin: datetime.datetime,
       rain_margin: Decibels = 0.0) -> Antenna:
    """Return the Antenna of a scenario at a station, from a UTC on. The sun takes the target when it touches the beam.
    Raises ScenarioError for an array."""
    if chosen.header.beam:
        raise ScenarioError(f'scenario {chosen.name}: scenario.beam = true: must be false, because a plan needs a '
                            'pedestal with two axes')
    acu, receiver = chosen.node_parameters('acu'), chosen.node_parameters('tracking_receiver')
    heading = math.radians(chosen.node_parameters('ship_motion').ship.heading_deg) if chosen.header.ship else 0.0
    return Antenna(acu, None if chosen.header.iq else receiver.receiver, chosen.header.dish, chosen.header.link,
                   heading, station, begin, rain_margin, 0.5 * acu.tracker.receiver.beamwidth + SUN_RADIUS_RAD)
