"""A night of passes in the closed loop: what a plan announces for each taken pass, against what the antenna loses.

Twelve satellites over one station on a slow pedestal with a hidden sector. Each contact of the exact plan runs as
`pedestal station` takes it. The axes slew from the end of the contact before to the begin of this one, and follow the
elements from 5 s before it. The control unit changes to autotrack by its own rules. A wait of more than 240 s between
two contacts is skipped, and the axes then stand at the begin. A case is NAME/K, `NAME/K, N s` for the N s about the
culmination of a longer contact, and `night` for all of them.

announced_loss_s    expected loss of the plan within the contact
loss_s              time off the beam by more than half a beamwidth, behind the hidden sector, or not in autotrack
tracked_percent     share of the contact without this loss
unexplained_s       part of the difference of both losses that exceeds 20 % of the announced one, and exceeds 0.2 s
"""
import datetime
import functools
import math
import pathlib
import tempfile
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.geometry.geodesy import STATION_NAMES, StationParameters
from pedestal_common.quantities import Floats, Radians, Row, Seconds
from pedestal_results import tracking
from pedestal_results.intervals import row, single
from pedestal_results.report import figures as fig
from pedestal_station import antenna, planning, prediction
from pedestal_station.choice import Rules
from pedestal_station.night import Pass, Share
from pedestal_station.objects import Elements
from pedestal_station.outputs import file
from pedestal_studies.result import FIRST_SEED, Result, legend, of_cases, seeds
from pedestal_workbench.trials.monte_carlo import Pool, Progress

DEFAULT_RUNS = 2  # runs of each contact

BEGIN = datetime.datetime(2026, 11, 30)
HOURS = 24.0
STATION = StationParameters(47.4, 8.5, 500.0)
HORIZON_DEG = 5.0
ELEMENTS_HEAD = ('OBJECT_NAME,NORAD_CAT_ID,OBJECT_ID,INCLINATION,RA_OF_ASC_NODE,ECCENTRICITY,ARG_OF_PERICENTER,'
                 'MEAN_ANOMALY,MEAN_MOTION,EPOCH,BSTAR,MEAN_MOTION_DOT,MEAN_MOTION_DDOT,EPHEMERIS_TYPE,'
                 'CLASSIFICATION_TYPE,ELEMENT_SET_NO,REV_AT_EPOCH')
ELEMENTS_TAIL = '2026-11-29T16:00:00,4e-5,8e-6,0,0,U,1,1'
SATELLITES = (
    'STATION 420 km,90001,2000-001A,51.64,211.0,0.0007,17.0,85.0,15.50', 'SSO 500 km,90002,2000-001B,97.4,30.0,'
    '0.0010,90.0,61.0,15.22', 'SSO 700 km,90003,2000-001C,98.2,75.0,0.0010,90.0,183.0,14.57',
    'SSO 830 km,90004,2000-001D,98.7,120.0,0.0010,90.0,244.0,14.19', 'POLAR 780 km,90005,2000-001E,86.4,165.0,0.0002,'
    '90.0,305.0,14.34', 'LEO 550 km,90006,2000-001F,53.0,205.0,0.0001,90.0,6.0,15.06',
    'LEO 1000 km,90007,2000-001G,82.9,250.0,0.0030,90.0,67.0,13.72', 'LEO 1200 km,90008,2000-001H,87.9,295.0,0.0010,'
    '90.0,128.0,13.16', 'LEO 1400 km,90009,2000-001J,66.0,335.0,0.0010,90.0,189.0,12.64',
    'MEO,90010,2000-001K,55.0,100.0,0.0100,30.0,10.0,2.0056', 'HEO,90011,2000-001L,63.4,150.0,0.7000,270.0,20.0,'
    '2.0061', 'GEO,90012,2000-001M,0.05,80.0,0.0002,0.0,257.8,1.0027')
PRIORITIES = 'MEO=0.2', 'HEO=0.1'
"""Made-up orbits, as CSV of OMMs. The slow satellites have low priorities, because one of them would otherwise fill
the night."""
WINDOW = 'GEO=2026-11-30T12:00/2026-11-30T12:15'

ANTENNA = Variant('leo_pass', (
    'acu.azimuth.shaper.rate=0.044', 'acu.azimuth.limits.rate=0.05', 'acu.azimuth.shaper.acceleration=0.1',
    'acu.azimuth.limits.acceleration=0.2', 'acu.blockage=2.2 2.4 0.5', 'tracking_receiver.blockage=2.2 2.4 0.5',
    'tracking_receiver.receiver.range_exponent=0', 'scenario.program.source=none', 'acu.initial_mode=preset'))
"""Azimuth rate 2.5 deg/s. The C/N0 does not depend on the range, as if each satellite had the power that it needs."""

FOLLOW_LEAD_S = 5.0  # time before a contact from which the antenna follows the elements [s]
MAX_GAP_S, SKIPPED_LEAD_S = 240.0, 10.0
"""Longest time between two contacts that is simulated, and time before a contact after a longer one [s]."""
MAX_CONTACT_S = 900.0  # length to which a contact is cut, about its culmination [s]
RULES = Rules(time_limit=60.0)
MAX_DIFFERENCE, MAX_DIFFERENCE_S = 0.2, 0.2  # of an explained loss, of the announced one [-] and [s]


class Contact(NamedTuple):
    """A taken pass, as the closed loop runs it. Times: seconds of the night."""
    case: str
    elements: tuple[tuple[str, str], ...]   # (name of a parameter of leo_pass, value)
    ut1_offset: Seconds
    lead: Seconds       # time from the begin of the run to the contact
    start: tuple[Radians, Radians]      # encoder angles of the axes before the slew to the begin
    begin: Seconds
    end: Seconds
    point: tuple[Radians, Radians]      # encoder angles at the begin
    announced: Seconds


def contacts() -> list[Contact]:
    """Return the contacts of the exact plan in the order of time, by its plan file."""
    used = antenna.of(ANTENNA.load(), STATION, BEGIN)
    with tempfile.TemporaryDirectory() as folder:
        path, plan = (pathlib.Path(folder) / name for name in ('elements.csv', 'plan.json'))
        path.write_text('\n'.join([ELEMENTS_HEAD, *(f'{each},{ELEMENTS_TAIL}' for each in SATELLITES)]) + '\n')
        night = planning.night(planning.Wishes(
            paths=[path], station=STATION, begin=BEGIN, duration=3600.0 * HOURS, horizon=HORIZON_DEG, antenna=ANTENNA,
            satellites=(), priorities=PRIORITIES, windows=(WINDOW,), rain_margin=0.0, rules=RULES))
        shares = tuple(map(_cut, night.passes, night.exact.shares))
        night = night._replace(exact=night.exact._replace(shares=shares))
        file.write(plan, night)
        planned = [each for each in file.read(plan).contacts if each.taken]
    passes = {each.case: (each, share) for each, share in zip(night.passes, shares)}
    known: list[Contact] = []
    start, free = (used.acu.azimuth.stow, used.acu.elevation.stow), -math.inf
    for each in planned:
        found, share = passes[each.case]
        point = math.radians(each.azimuth_deg), math.radians(each.elevation_deg)
        assert isinstance(found.object.orbit, Elements)
        flown = prediction.predict(found.object, found.window._replace(rise=share.begin, set=share.end), used,
                                   point[0])
        gap = share.begin - free
        known.append(Contact(
            each.case if share.end - share.begin < MAX_CONTACT_S else f'{each.case}, {MAX_CONTACT_S:g} s',
            tuple(each.elements.items()), found.object.orbit.query.ut1_offset,
            *((gap, start) if gap <= MAX_GAP_S else (SKIPPED_LEAD_S, point)),
            share.begin, share.end, point, _announced(found, share)))
        start, free = (flown.azimuth[1], flown.elevation[1]), share.end
    return known


def _cut(each: Pass, share: Share) -> Share:
    """Return a share of which a long contact is cut, about its culmination."""
    if not share.end - share.begin > MAX_CONTACT_S:
        return share
    begin = min(max(each.window.culmination - 0.5 * MAX_CONTACT_S, share.begin), share.end - MAX_CONTACT_S)
    return share._replace(begin=begin, end=begin + MAX_CONTACT_S)


def _announced(each: Pass, share: Share) -> Seconds:
    """Return the part of the expected loss of a pass within its contact."""
    return sum(max(0.0, min(loss.end, share.end) - max(loss.begin, share.begin)) for loss in each.prediction.losses)


def variant(contact: Contact, seed: int) -> Variant:
    """Return the run of a contact."""
    t = contact.begin - contact.lead
    begin = BEGIN + datetime.timedelta(seconds=math.floor(t))
    moved = t - math.floor(t) + contact.lead      # begin of the contact in the run
    of_target, of_acu = 'tracking_receiver.target', 'acu.prediction'
    return ANTENNA.with_({
        **{f'{of_target}.leo_pass.{name}': value for name, value in contact.elements},
        **{f'{of_acu}.{name}': value for name, value in contact.elements},
        **{f'{node}.station.{name}': getattr(STATION, name) for node in (of_target, of_acu) for name in STATION_NAMES},
        f'{of_target}.leo_pass.start_time': f'{begin.isoformat()}Z', f'{of_acu}.start_time': f'{begin.isoformat()}Z',
        f'{of_target}.leo_pass.ut1_offset': contact.ut1_offset,
        'adu.initial_azimuth': contact.start[0], 'adu.initial_elevation': contact.start[1],
        'acu.azimuth.preset': contact.point[0], 'acu.elevation.preset': contact.point[1],
        'acu.commands': f'{moved - FOLLOW_LEAD_S:.3f} tle'},
        seed=seed, duration=math.ceil(moved + contact.end - contact.begin))


def measured(contact: Contact, run: int) -> Floats:
    """Return of one run: loss within the contact, share of the contact without it [%]."""
    found = tracking.read(memory_recording.record(variant(contact, FIRST_SEED + run).load()))
    begin = (contact.begin - contact.lead) % 1.0 + contact.lead
    inside = (found.t >= begin) & (found.t < begin + contact.end - contact.begin)
    lost = (found.distance > 0.5 * found.beamwidth) | (found.mode != 'autotrack') | ~found.trackable
    return np.array([np.sum(lost[inside]) * found.period, 100.0 * (1.0 - np.mean(lost[inside]))])


def unexplained(announced: Floats, lost: Floats) -> Floats:
    """Return by how much losses differ from announced ones, beyond the difference that counts as explained."""
    most = np.maximum(MAX_DIFFERENCE * announced, MAX_DIFFERENCE_S)
    return np.maximum(np.abs(lost - announced) - most, 0.0)


def rows(values: Mapping[Contact, Floats]) -> list[Row]:
    """Return the rows of the study; values: {contact: (runs, 2), as `measured` returns}."""
    table, of_runs = list[Row](), np.array([each[:, 0] for each in values.values()])
    announced = np.array([each.announced for each in values])
    beyond = unexplained(announced[:, np.newaxis], of_runs)
    for each, found, left in zip(values, values.values(), beyond):
        table += [single(each.case, 'contact_s', each.end - each.begin, 's'),
                  single(each.case, 'announced_loss_s', each.announced, 's'),
                  row(each.case, 'loss_s', found[:, 0], 's'),
                  row(each.case, 'tracked_percent', found[:, 1], '%'),
                  row(each.case, 'unexplained_s', left, 's', target='<= 0')]
    lengths = np.array([each.end - each.begin for each in values])
    lossy, wrong = of_runs.max(axis=1) > MAX_DIFFERENCE_S, beyond.max(axis=1) > 0.0
    return [*table, single('night', 'contacts', len(values)), single('night', 'without_loss', int(np.sum(~lossy))),
            single('night', 'with_explained_loss', int(np.sum(lossy & ~wrong))),
            single('night', 'with_unexplained_loss', int(np.sum(wrong)), target='<= 0'),
            single('night', 'contact_s', float(lengths.sum()), 's'),
            single('night', 'announced_loss_s', float(announced.sum()), 's'),
            row('night', 'loss_s', of_runs.sum(axis=0), 's'),
            row('night', 'tracked_percent', 100.0 * (1.0 - of_runs.sum(axis=0) / lengths.sum()), '%')]


def run(progress: Progress, runs: int = DEFAULT_RUNS, pool: Pool | None = None) -> Result:
    """Run every contact of the night `runs` times."""
    values = of_cases(measured, contacts(), runs, pool, progress, size=1)
    table = rows(values)
    shown = [each for each in table if each['case'] == 'night' or each['metric'] == 'loss_s' and each['value']]
    return Result(table, {'night': functools.partial(figure, values)}, [seeds(runs)], shown)


def figure(values: Mapping[Contact, Floats]) -> Figure:
    """Draw the measured over the announced loss of every contact, with the difference that counts as explained."""
    drawn, axes = fig.new_panels(1, height=3.8, x='announced loss [s]', y=('measured loss [s]',))
    announced = np.array([each.announced for each in values])
    line = np.geomspace(0.01, max(announced.max(), 1.0), 200)
    most = np.maximum(MAX_DIFFERENCE * line, MAX_DIFFERENCE_S)
    axes[0, 0].fill_between(line, line - most, line + most, alpha=0.2, label='explained')
    for i in range(min(map(len, values.values()))):
        axes[0, 0].plot(announced, [found[i, 0] for found in values.values()], '.', color=fig.FILTERED_COLOUR,
                        label='contact')
    axes[0, 0].set_xscale('symlog', linthresh=0.1)
    axes[0, 0].set_yscale('symlog', linthresh=0.1)
    return legend(drawn)
