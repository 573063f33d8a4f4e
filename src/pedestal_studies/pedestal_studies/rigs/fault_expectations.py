"""What an operator expects of every fault in every mode: written from what the antenna is for, not from what it does.

Half a beamwidth (0.5 deg) off the target the link is 3 dB down and the error signal still leads back; a tenth of it
(0.1 deg) costs 0.12 dB and counts as on target. In standby nobody points: the antenna is to stand where it stood,
within half a beamwidth. A drive that trips, or is not fed, has to say so within 0.1 s; what takes a motion to find,
within 1 s. Nothing moves by itself after a fault that ended in standby.

The modes that go by the level are under way to autotrack, and are judged by where their beam may be: within the area
that is searched, the look-around, or half a beamwidth. They point by the attitude as program does, so that what holds
for that holds for them; only the receiver matters to them as it does to autotrack.
"""
import typing

from pedestal_common.graph.modes import TABLE

TENTH, HALF = 0.1, 0.5
"""Of the beamwidth of the antenna of the study [deg]."""

HALF_PITCH = 1.32
"""Play of a pinion of 17 teeth and ratio 8 where one is missing: pi / (17 * 8) [deg]."""

SAME = ()
STANDBY = ('standby',)


class Expected(typing.NamedTuple):
    """told: steps within which somebody says something of it, None where nobody has to; end: modes of which the run
    ends in one 5 s after the fault, SAME: the mode it began in; error: largest one while the mode is kept [deg], None
    where the antenna cannot help it."""
    told: int | None
    end: tuple
    error: float | None

    def sentence(self, mode):
        """The expectation in words."""
        told = 'need not be told' if self.told is None else f'told within {self.told} steps'
        error = '' if self.error is None else f', at most {self.error:g} deg'
        return f'{told}, ends in {" or ".join(self.end or (mode,))}{error}'


GOES_ON = Expected(None, SAME, TENTH)
IN_BEAM = Expected(None, SAME, HALF)
TRIPS = Expected(4, STANDBY, HALF)

MOVING = ('rate',)
FOLLOWING = tuple(row.name for row in TABLE if row.follows and not row.by_level)
STILL = tuple(row.name for row in TABLE if not row.follows and row.name not in MOVING)
MODES = (*STILL, *MOVING, *FOLLOWING)
"""Still and moving on the deck; following what lies in earth angles, which takes the attitude."""


def _always(expected):
    """The same in every mode, but that in standby nobody points."""
    resting = expected._replace(error=max(expected.error or HALF, HALF))
    return {**dict.fromkeys(MODES, expected), 'standby': resting}


def _moving(expected, still=GOES_ON):
    """Where it matters only when the axes move."""
    return {**_always(still), **dict.fromkeys((*MOVING, *FOLLOWING), expected)}


def _autotrack(told, error, *end):
    """Where it matters only when the receiver closes the loop."""
    return {**_always(GOES_ON), 'autotrack': Expected(told, end, error)}


_STOPS_OR_NOT = {mode: ('standby', mode) for mode in MODES}


def _attitude(told, error, still=None):
    """Where the attitude is wrong or gone: without it no target can be followed, so that standby is right; to bridge
    it is right as well."""
    return {**_always(Expected(still, SAME, TENTH)),
            **{mode: Expected(told, _STOPS_OR_NOT[mode], error) for mode in FOLLOWING}}


def _off_heading():
    """Where the attitude is off by more than half a beamwidth: only autotrack can point better than it is known."""
    return {**_always(GOES_ON), **{mode: Expected(200, (mode, 'standby'), None) for mode in FOLLOWING},
            'autotrack': Expected(200, ('autotrack', 'program'), HALF)}


REACH = {'search': 10.0, 'acquire': 2.0, 'steptrack': HALF}
"""Largest way from the target to the beam of a mode that goes by the level [deg]: across the area of five beamwidths
about the expected place; a look-around of 1.2 beamwidths about a peak within 0.7; in the beam. A fade takes the level
itself: step track has to search for it then and to look around, so that the reach of acquire is its own."""

TO_AUTOTRACK = ('search', 'acquire', 'autotrack')

SILENT, WRONG = ('drop', 'freeze', 'nan', 'clock_step'), ('wrong_slope', 'phase_180')
"""Faults of the receiver without which, and with which no target is found."""


def _by_level(node, fault, of_modes):
    """{mode: Expected} of the modes that go by the level, by those of the others."""
    program, reaches = of_modes['program'], REACH
    told, error, end = program.told, program.error, program.end
    if node == 'tracking_receiver' and fault == 'fade':
        told, end, reaches = None, ('program',), {**REACH, 'steptrack': REACH['acquire']}
    elif node == 'tracking_receiver' and fault in SILENT:
        told, end = 200, ('program',)
    elif node == 'tracking_receiver' and fault in WRONG:
        end = ('program', 'standby')
    return {mode: Expected(told, end if end == STANDBY else tuple(dict.fromkeys((mode, *TO_AUTOTRACK, *end))),
                           None if error is None else max(error, reach)) for mode, reach in reaches.items()}


def _unstowing(fault, of_modes):
    """Return what holds in unstow: the antenna stands as in standby, on its brakes, where a trip may not end it."""
    expected = of_modes['standby']
    expected = expected._replace(end=expected.end and _STOPS_OR_NOT['unstow'])
    # An inverter that is off is missed when torque is asked for.
    return expected._replace(told=None) if fault == 'adu.motor_loss' else expected


_EXPECTED = {
    'adu.motor_loss': _always(Expected(200, SAME, TENTH)),
    'adu.encoder_jump': _always(TRIPS),
    'adu.encoder_stuck': _moving(Expected(200, STANDBY, HALF)),
    'adu.brake_stuck': {**_always(GOES_ON),
                        **{mode: Expected(200, _STOPS_OR_NOT[mode], TENTH) for mode in (*MOVING, *FOLLOWING)}},
    'adu.lost_tooth': {mode: Expected(None, end, HALF_PITCH) for mode, end in _STOPS_OR_NOT.items()},
    'adu.gust': _always(GOES_ON),
    'adu.pin_stuck': _always(GOES_ON),                      # the antenna of the study has no stow pins
    'adu.drop': _moving(Expected(20, SAME, None), Expected(20, SAME, TENTH)),
    'adu.delay': _moving(IN_BEAM),
    'adu.freeze': _moving(Expected(100, STANDBY, HALF)),
    'adu.bias': {mode: Expected(200, end, HALF) for mode, end in _STOPS_OR_NOT.items()},
    'adu.nan': {**_always(TRIPS), 'rate': TRIPS._replace(end=('standby', 'rate'))},     # who jogs goes on asking
    'adu.noise': _always(IN_BEAM),
    'tracking_receiver.drop': _autotrack(100, HALF),
    'tracking_receiver.delay': _autotrack(None, TENTH),
    'tracking_receiver.freeze': _autotrack(200, HALF, 'autotrack', 'program'),
    'tracking_receiver.bias': _autotrack(None, 0.115 + TENTH),
    'tracking_receiver.nan': _autotrack(100, HALF),
    'tracking_receiver.noise': _autotrack(None, HALF),
    'tracking_receiver.fade': _autotrack(100, HALF),
    'tracking_receiver.wrong_slope': _autotrack(200, HALF, 'program'),
    'tracking_receiver.phase_180': _autotrack(200, HALF, 'program'),
    'tracking_receiver.clock_step': _autotrack(100, HALF),
    'ship_motion.drop': _attitude(60, HALF, 60),
    'ship_motion.freeze': _attitude(200, HALF, 200),
    'ship_motion.bias': _always(Expected(40, SAME, TENTH)),
    'ship_motion.nan': _attitude(60, HALF, 60),
    'ship_motion.noise': _always(Expected(40, SAME, TENTH)),
    'ins.drop': _attitude(60, HALF),
    'ins.delay': _always(GOES_ON),
    'ins.freeze': _attitude(200, HALF),
    'ins.bias': _always(GOES_ON),
    'ins.nan': _attitude(60, HALF),
    'ins.noise': _off_heading(),
    'ins.ins_jump': _off_heading(),
    'ins.clock_step': _attitude(60, HALF),
}
EXPECTED = {name: {**of_modes, **_by_level(*name.split('.'), of_modes), 'unstow': _unstowing(name, of_modes)}
            for name, of_modes in _EXPECTED.items()}
"""{'NODE.FAULT': {mode: Expected}}, of every fault with its defaults that lasts 5 s."""

