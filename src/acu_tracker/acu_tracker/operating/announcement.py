"""Texts of the look-ahead for the operator, and its numbers for the diagnostics.

`h` is a record of lookahead.planner.PLANNER_DTYPE.
"""
import math

from acu_tracker.lookahead import planner


def keyhole(h, beamwidth):
    """Return the text of acu/keyhole: the planned slew, or that no azimuth wrap fits; beamwidth [rad]."""
    if h['forecast'] == planner.FORECAST_NO_WRAP:
        return 'keyhole ahead: no azimuth wrap holds the pass; the axis will stop at the end of its travel'
    slew = h['slew']
    way = 'clockwise' if slew['peak'] > 0.0 else 'counter-clockwise'
    if slew['other_cost'] == math.inf:
        other = 'limits forbid the opposite direction'
    else:
        other = f'the opposite direction would lose {slew["other_cost"] - slew["cost"]:.1f} s more'
    text = (f'keyhole at {slew["culmination"]:.1f} s, elevation {_deg(slew["highest"]):.1f} deg: azimuth leaves the '
            f'target at {slew["t1"]:.1f} s, slews {abs(_deg(slew["azimuth2"] - slew["azimuth1"])):.0f} deg {way} and '
            f'meets the target at {slew["t2"]:.1f} s; expected loss {slew["loss"]:.1f} s, largest pointing '
            f'offset {_deg(slew["worst"]):.2f} deg; {other}')
    if h['deck_motion'] > 0.25 * beamwidth:
        text += f'; approximate, because the deck moves by {_deg(h["deck_motion"]):.2f} deg rms'
    return text


def hidden(h):
    """Return the text of acu/blockage: begin and end [s] of the time for which the target will be hidden."""
    begin, end = h['hidden']
    return f'target hidden from {begin:.1f} s to {end:.1f} s'


def numbers(h):
    """Return [(key, value text)] of the forecast; a slew or a hidden sector appears only where there is one."""
    values = [('keyhole', planner.FORECAST_TEXTS[h['forecast']])]
    if h['forecast'] == planner.FORECAST_KEYHOLE:
        slew = h['slew']
        values += [('keyhole_begins_s', f'{slew["t1"]:.3f}'), ('keyhole_ends_s', f'{slew["t2"]:.3f}'),
                   ('keyhole_loss_s', f'{slew["loss"]:.3f}'), ('keyhole_worst_deg', f'{_deg(slew["worst"]):.3f}'),
                   ('keyhole_needed_deg_s', f'{_deg(slew["needed"]):.3g}'),
                   ('deck_motion_deg', f'{_deg(h["deck_motion"]):.3f}')]
    if h['hidden'][0] == h['hidden'][0]:
        values += [('hidden_from_s', f'{h["hidden"][0]:.1f}'), ('hidden_to_s', f'{h["hidden"][1]:.1f}')]
    return values


def _deg(angle):
    return math.degrees(angle)
