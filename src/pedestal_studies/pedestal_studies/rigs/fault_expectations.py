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

from pedestal_common.graph.modes import MODE_ROWS

TENTH_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG = 0.1, 0.5
"""Of the beamwidth of the antenna of the study [deg]."""

HALF_PITCH_DEG = 1.32
"""Play of a pinion of 17 teeth and ratio 8 where one is missing: pi / (17 * 8) [deg]."""

SAME_MODE = ()
STANDBY_MODE = ('standby',)


class Expectation(typing.NamedTuple):
    """told: steps within which somebody says something of it, None where nobody has to; end: modes of which the run
    ends in one 5 s after the fault, SAME_MODE: the mode it began in; error: largest one while the mode is kept [deg],
    None
    where the antenna cannot help it."""
    told: int | None
    end: tuple
    error: float | None

    def sentence(self, mode):
        """The expectation in words."""
        told = 'need not be told' if self.told is None else f'told within {self.told} steps'
        error = '' if self.error is None else f', at most {self.error:g} deg'
        return f'{told}, ends in {" or ".join(self.end or (mode,))}{error}'


EXPECT_NO_EFFECT = Expectation(None, SAME_MODE, TENTH_BEAMWIDTH_DEG)
EXPECT_IN_BEAM = Expectation(None, SAME_MODE, HALF_BEAMWIDTH_DEG)
EXPECT_TRIP = Expectation(4, STANDBY_MODE, HALF_BEAMWIDTH_DEG)

MOVING_MODES = ('rate',)
FOLLOWING_MODES = tuple(row.name for row in MODE_ROWS if row.follows and not row.by_level)
STILL_MODES = tuple(row.name for row in MODE_ROWS if not row.follows and row.name not in MOVING_MODES)
LEVEL_INDEPENDENT_MODES = (*STILL_MODES, *MOVING_MODES, *FOLLOWING_MODES)
"""Still and moving on the deck; following what lies in earth angles, which takes the attitude."""


def _in_every_mode(expected):
    """The same in every mode, but that in standby nobody points."""
    resting = expected._replace(error=max(expected.error or HALF_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG))
    return {**dict.fromkeys(LEVEL_INDEPENDENT_MODES, expected), 'standby': resting}


def _when_moving(expected, still=EXPECT_NO_EFFECT):
    """Where it matters only when the axes move."""
    return {**_in_every_mode(still), **dict.fromkeys((*MOVING_MODES, *FOLLOWING_MODES), expected)}


def _in_autotrack(told, error, *end):
    """Where it matters only when the receiver closes the loop."""
    return {**_in_every_mode(EXPECT_NO_EFFECT), 'autotrack': Expectation(told, end, error)}


_STANDBY_OR_SAME_MODE = {mode: ('standby', mode) for mode in LEVEL_INDEPENDENT_MODES}


def _attitude_fault(told, error, still=None):
    """Where the attitude is wrong or gone: without it no target can be followed, so that standby is right; to bridge
    it is right as well."""
    return {**_in_every_mode(Expectation(still, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
            **{mode: Expectation(told, _STANDBY_OR_SAME_MODE[mode], error) for mode in FOLLOWING_MODES}}


def _heading_fault():
    """Where the attitude is off by more than half a beamwidth: only autotrack can point better than it is known."""
    return {**_in_every_mode(EXPECT_NO_EFFECT),
            **{mode: Expectation(200, (mode, 'standby'), None) for mode in FOLLOWING_MODES},
            'autotrack': Expectation(200, ('autotrack', 'program'), HALF_BEAMWIDTH_DEG)}


LEVEL_MODE_ERRORS_DEG = {'search': 10.0, 'acquire': 2.0, 'steptrack': HALF_BEAMWIDTH_DEG}
"""Largest way from the target to the beam of a mode that goes by the level [deg]: across the area of five beamwidths
about the expected place; a look-around of 1.2 beamwidths about a peak within 0.7; in the beam. A fade takes the level
itself: step track has to search for it then and to look around, so that the reach of acquire is its own."""

MODES_TO_AUTOTRACK = ('search', 'acquire', 'autotrack')

SIGNAL_LOSS_FAULTS, WRONG_ERROR_FAULTS = ('drop', 'freeze', 'nan', 'clock_step'), ('wrong_slope', 'phase_180')
"""Faults of the receiver without which, and with which no target is found."""


def _signal_level_modes(node, fault, of_modes):
    """{mode: Expected} of the modes that go by the level, by those of the others."""
    program, reaches = of_modes['program'], LEVEL_MODE_ERRORS_DEG
    told, error, end = program.told, program.error, program.end
    if node == 'tracking_receiver' and fault == 'fade':
        (told, end, reaches) = (None, ('program',),
                                {**LEVEL_MODE_ERRORS_DEG, 'steptrack': LEVEL_MODE_ERRORS_DEG['acquire']})
    elif node == 'tracking_receiver' and fault in SIGNAL_LOSS_FAULTS:
        told, end = 200, ('program',)
    elif node == 'tracking_receiver' and fault in WRONG_ERROR_FAULTS:
        end = ('program', 'standby')
    return {mode: Expectation(told, end if end == STANDBY_MODE
                              else tuple(dict.fromkeys((mode, *MODES_TO_AUTOTRACK, *end))),
                              None if error is None else max(error, reach)) for mode, reach in reaches.items()}


def _unstow_expectation(fault, of_modes):
    """Return what holds in unstow: the antenna stands as in standby, on its brakes, where a trip may not end it."""
    expected = of_modes['standby']
    expected = expected._replace(end=expected.end and _STANDBY_OR_SAME_MODE['unstow'])
    # An inverter that is off is missed when torque is asked for.
    return expected._replace(told=None) if fault == 'adu.motor_loss' else expected


_BASE_EXPECTATIONS = {
    'adu.motor_loss': _in_every_mode(Expectation(200, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.encoder_jump': _in_every_mode(EXPECT_TRIP),
    'adu.encoder_stuck': _when_moving(Expectation(200, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.brake_stuck': {**_in_every_mode(EXPECT_NO_EFFECT),
                        **{mode: Expectation(200, _STANDBY_OR_SAME_MODE[mode],
                                             TENTH_BEAMWIDTH_DEG) for mode in (*MOVING_MODES, *FOLLOWING_MODES)}},
    'adu.lost_tooth': {mode: Expectation(None, end, HALF_PITCH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.gust': _in_every_mode(EXPECT_NO_EFFECT),
    'adu.pin_stuck': _in_every_mode(EXPECT_NO_EFFECT),                      # the antenna of the study has no stow pins
    'adu.drop': _when_moving(Expectation(20, SAME_MODE, None), Expectation(20, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.delay': _when_moving(EXPECT_IN_BEAM),
    'adu.freeze': _when_moving(Expectation(100, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.bias': {mode: Expectation(200, end, HALF_BEAMWIDTH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.nan': {**_in_every_mode(EXPECT_TRIP),
                'rate': EXPECT_TRIP._replace(end=('standby', 'rate'))},     # who jogs goes on asking
    'adu.noise': _in_every_mode(EXPECT_IN_BEAM),
    'tracking_receiver.drop': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.delay': _in_autotrack(None, TENTH_BEAMWIDTH_DEG),
    'tracking_receiver.freeze': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'autotrack', 'program'),
    'tracking_receiver.bias': _in_autotrack(None, 0.115 + TENTH_BEAMWIDTH_DEG),
    'tracking_receiver.nan': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.noise': _in_autotrack(None, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.fade': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.wrong_slope': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'program'),
    'tracking_receiver.phase_180': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'program'),
    'tracking_receiver.clock_step': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'ship_motion.drop': _attitude_fault(60, HALF_BEAMWIDTH_DEG, 60),
    'ship_motion.freeze': _attitude_fault(200, HALF_BEAMWIDTH_DEG, 200),
    'ship_motion.bias': _in_every_mode(Expectation(40, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'ship_motion.nan': _attitude_fault(60, HALF_BEAMWIDTH_DEG, 60),
    'ship_motion.noise': _in_every_mode(Expectation(40, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'ins.drop': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
    'ins.delay': _in_every_mode(EXPECT_NO_EFFECT),
    'ins.freeze': _attitude_fault(200, HALF_BEAMWIDTH_DEG),
    'ins.bias': _in_every_mode(EXPECT_NO_EFFECT),
    'ins.nan': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
    'ins.noise': _heading_fault(),
    'ins.ins_jump': _heading_fault(),
    'ins.clock_step': _attitude_fault(60, HALF_BEAMWIDTH_DEG),
}
FAULT_EXPECTATIONS = {name: {**of_modes, **_signal_level_modes(*name.split('.'), of_modes),
                             'unstow': _unstow_expectation(name, of_modes)}
                      for name, of_modes in _BASE_EXPECTATIONS.items()}
"""{'NODE.FAULT': {mode: Expected}}, of every fault with its defaults that lasts 5 s."""

