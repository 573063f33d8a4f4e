"""Texts and numbers for the operator on keyholes, hidden sectors and the end of the azimuth's travel.

A text states a time as UTC in realtime (epoch: UTC of stamp 0), and in lockstep as seconds of the run (epoch 0).
"""
import datetime
import math
from typing import TYPE_CHECKING

import numpy as np

from acu_tracker import modes
from acu_tracker.lookahead import planner
from acu_tracker.program import program_track
from pedestal_common.quantities import AnyRecord, Degrees, Nanoseconds, Radians, Seconds

if TYPE_CHECKING:
    from acu_tracker.params import AcuParameters, AxisParameters
    from acu_tracker.unit import Acu


def instant(t: Seconds, epoch: Nanoseconds) -> str:
    """Return the text of a time."""
    if not epoch:
        return f'{t:.1f} s'
    utc = datetime.datetime(1970, 1, 1) + datetime.timedelta(microseconds=round(epoch / 1000 + t * 1e6, -5))
    return f'{utc:%H:%M:%S}.{utc.microsecond // 100_000} UTC'


def keyhole(lookahead: AnyRecord, parameters: 'AcuParameters', epoch: Nanoseconds = 0) -> str:
    """Return the text of acu/keyhole: the announced slew, its cancellation, or that no azimuth wrap holds the pass."""
    beamwidth = parameters.tracker.receiver.beamwidth
    if lookahead['announced_forecast'] == planner.FORECAST_NO_WRAP:
        return f'keyhole ahead: no azimuth wrap holds the pass; {_at_the_end(parameters.azimuth, "")}'
    if lookahead['announced_forecast'] == planner.FORECAST_NONE:
        return 'no keyhole ahead: the azimuth can follow the target; the announced slew is cancelled'
    slew = lookahead['announced']
    way = 'clockwise' if slew['peak'] > 0.0 else 'counter-clockwise'
    if slew['other_cost'] == math.inf:
        other = 'limits forbid the opposite direction'
    else:
        other = f'the opposite direction would lose {slew["other_cost"] - slew["cost"]:.1f} s more'
    top, leaves, meets = (instant(slew[name], epoch) for name in ('culmination', 't1', 't2'))
    text = (f'keyhole at {top}, elevation {_deg(slew["highest"]):.1f} deg: azimuth leaves the target at {leaves}, '
            f'slews {abs(_deg(slew["azimuth2"] - slew["azimuth1"])):.0f} deg {way} and meets the target at {meets}; '
            f'expected loss {slew["loss"]:.1f} s, largest pointing offset {_deg(slew["worst"]):.2f} deg; {other}')
    if lookahead['deck_motion'] > 0.25 * beamwidth:
        text += f'; approximate, because the deck moves by {_deg(lookahead["deck_motion"]):.2f} deg rms'
    return text


def _at_the_end(axis: 'AxisParameters', when: str) -> str:
    # when: text of the time, with a blank at its end; '' without a time.
    if axis.limits.high - axis.limits.low < 2.0 * math.pi:
        return f'{when}the azimuth stops at the end of its travel until the target is inside the travel again'
    duration = 2.0 * math.pi / axis.shaper.rate + axis.shaper.rate / axis.shaper.acceleration
    return (f'{when}the azimuth turns back by 360 deg at the end of its travel, for about {duration:.1f} s off the '
            'target')


def overtravel(unit: 'Acu') -> str:
    """Return the text for a program track that no azimuth wrap holds; it states when the end of travel is reached.

    On a ship the text has no time, because the time depends on the motion of the deck.
    """
    state, limits = unit.parts['state'], unit.parameters.azimuth.limits
    now, when = state['stamp'], ''
    track = unit.memory.tables[program_track.TABLE_INDEX[state['mode']['table']]]
    ahead = track.times > now
    if ahead.any() and not unit.parts['inputs']['stabilised']:
        azimuth = np.unwrap(np.concatenate(([state['guidance']['azimuth']], track.angles[ahead, 0])))
        beyond = np.flatnonzero((azimuth < limits.low) | (azimuth > limits.high))
        if beyond.size and beyond[0] > 0:
            row, times = beyond[0], np.concatenate(([now], track.times[ahead]))
            end = limits.low if azimuth[row] < limits.low else limits.high
            rows = row - 1 + np.argsort(azimuth[row - 1:row + 1])   # np.interp needs increasing azimuths
            when = f'at {instant(float(np.interp(end, azimuth[rows], times[rows])), unit.epoch)} '
    return f'no azimuth wrap holds the whole program track: {_at_the_end(unit.parameters.azimuth, when)}'


def reaches_end(unit: 'Acu') -> bool:
    """Return True if the azimuth will reach the end of its travel within keyhole.notice at its present rate.

    Where the mode follows a table, or a program track covers the present time, `overtravel` reports the end of travel.
    """
    outputs, state, program = unit.parts['outputs'], unit.parts['state'], unit.memory.tables.program.times
    mode, covered = outputs['mode'], len(program) > 0 and program[0] <= state['stamp'] <= program[-1]
    return (modes.FOLLOWS_TARGET[mode] and not modes.FOLLOWS_TABLE[mode] and not covered
            and outputs['time_to_limit'][0] < unit.parameters.keyhole.notice)


def end_of_travel(unit: 'Acu') -> str:
    """Return the text for an azimuth that will soon reach the end of its travel."""
    left = unit.parts['outputs']['time_to_limit'][0]
    return _at_the_end(unit.parameters.azimuth, f'at the present rate, in {left:.1f} s ')


def turn(unit: 'Acu') -> str:
    """Return the text for a turn of the azimuth that is under way."""
    guidance, reference = unit.parts['state']['guidance'], unit.parts['state']['axis'][0]['reference']
    return f'the azimuth goes round by {_deg(guidance["azimuth"] - reference["angle"]):+.0f} deg to the target'


def hidden(lookahead: AnyRecord, epoch: Nanoseconds = 0) -> str:
    """Return the text of acu/blockage: begin and end of the time in which the target will be hidden."""
    begin, end = (instant(t, epoch) for t in lookahead['hidden'])
    return f'target hidden from {begin} to {end}'


def numbers(lookahead: AnyRecord) -> list[tuple[str, str]]:
    """Return the values (key, text) of the forecast for the diagnostics."""
    values = [('keyhole', planner.FORECAST_TEXTS[lookahead['forecast']])]
    if lookahead['forecast'] == planner.FORECAST_KEYHOLE:
        slew = lookahead['slew']
        values += [('keyhole_begins_s', f'{slew["t1"]:.3f}'), ('keyhole_ends_s', f'{slew["t2"]:.3f}'),
                   ('keyhole_loss_s', f'{slew["loss"]:.3f}'), ('keyhole_worst_deg', f'{_deg(slew["worst"]):.3f}'),
                   ('keyhole_needed_deg_s', f'{_deg(slew["needed"]):.3g}'),
                   ('deck_motion_deg', f'{_deg(lookahead["deck_motion"]):.3f}')]
    begin, end = lookahead['hidden']
    if not math.isnan(begin):
        values += [('hidden_from_s', f'{begin:.1f}'), ('hidden_to_s', f'{end:.1f}')]
    return values


def _deg(angle: Radians) -> Degrees:
    return math.degrees(angle)
