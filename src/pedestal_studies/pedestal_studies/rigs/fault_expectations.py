"""Expectations of an operator for every injected fault in every mode, derived from the purpose of the antenna.

The study faults compares these expectations with runs. The expectations were written without regard to the behaviour
of the product. An error of half a beamwidth (0.5 deg) lowers the signal level by 3 dB, and the receiver error still
leads the beam back to the target. An error of a tenth of the beamwidth (0.1 deg) costs 0.12 dB and counts as on
target. In standby the antenna stays at its place within half a beamwidth. A step is 5 ms: 20 steps are 0.1 s, 60 steps
0.3 s, 100 steps 0.5 s, 200 steps 1 s.

The drive must report a trip or missing commands within 0.1 s. A fault that shows only in motion must be reported
within 1 s. Nothing moves by itself after a fault that ended in standby.

The modes that use the signal level (search, acquire, steptrack) lead to autotrack. The permitted error in these modes
is the largest distance of their beam from the target. This is the distance across the searched area, the distance in
the look-around (short motions of the beam about a peak of the level), or half a beamwidth.
Because they point by the attitude as program does, the expectations of program hold for them. The faults of the
receiver are the exception: they affect these modes as they affect autotrack.
"""
import typing

from pedestal_common.graph.modes import MODE_ROWS

TENTH_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG = 0.1, 0.5  # tenth and half of the beamwidth of the antenna in the study [deg]

HALF_PITCH_DEG = 1.32
"""Half of a tooth pitch on the axis [deg], the play at a missing tooth of a pinion with 17 teeth and gear ratio 8:
pi / (17 * 8) rad."""

SAME_MODE, STANDBY_MODE = (), ('standby',)  # values of `Expectation.end`: the mode at the onset; standby


class Expectation(typing.NamedTuple):
    """Expectation for a fault in a mode.

    `report_steps`: latest report by any node, in steps after the onset; None if no report is required. `end`:
    permitted modes 5 s after the fault; SAME_MODE for the mode at the onset. `error`: largest permitted error while
    the mode is kept [deg]; None if the antenna cannot limit the error.
    """
    report_steps: int | None
    end: tuple
    error: float | None

    def texts(self, mode):
        """Return (report, error, permitted modes at the end) in words, for a mode at the onset."""
        kept = not self.end or mode in self.end and self.end != STANDBY_MODE
        ends = ['the same mode'] * kept + [name for name in dict.fromkeys(self.end) if not (kept and name == mode)]
        return ('not required' if self.report_steps is None else f'within {self.report_steps} steps',
                'not limited' if self.error is None else f'at most {self.error:g} deg',
                ' or '.join(filter(None, (', '.join(ends[:-1]), ends[-1]))))

    def sentence(self, mode):
        """Return the expectation as a sentence, for a mode at the onset."""
        return 'report {}, error {}, ends in {}'.format(*self.texts(mode))


EXPECT_NO_EFFECT = Expectation(None, SAME_MODE, TENTH_BEAMWIDTH_DEG)
EXPECT_IN_BEAM = Expectation(None, SAME_MODE, HALF_BEAMWIDTH_DEG)
EXPECT_TRIP = Expectation(4, STANDBY_MODE, HALF_BEAMWIDTH_DEG)

MOVING_MODES = ('rate',)  # mode that moves the axes on the deck
FOLLOWING_MODES = tuple(row.name for row in MODE_ROWS if row.follows and not row.by_level)
"""Modes that follow a direction in earth angles, for which the attitude is needed."""
STILL_MODES = tuple(row.name for row in MODE_ROWS if not row.follows and row.name not in MOVING_MODES)
"""Modes in which the axes end at rest on the deck."""
LEVEL_INDEPENDENT_MODES = (*STILL_MODES, *MOVING_MODES, *FOLLOWING_MODES)  # modes that do not use the signal level


def _in_every_mode(expected):
    """Return {mode: Expectation} with one expectation for every mode.

    Because the antenna does not point in standby, at least half a beamwidth is permitted there.
    """
    resting = expected._replace(error=max(expected.error or HALF_BEAMWIDTH_DEG, HALF_BEAMWIDTH_DEG))
    return {**dict.fromkeys(LEVEL_INDEPENDENT_MODES, expected), 'standby': resting}


def _when_moving(expected, still=EXPECT_NO_EFFECT):
    """Return {mode: Expectation}: `expected` for the modes that move the axes, `still` for the modes at rest."""
    return {**_in_every_mode(still), **dict.fromkeys((*MOVING_MODES, *FOLLOWING_MODES), expected)}


def _in_autotrack(report_steps, error, *end):
    """Return {mode: Expectation} of a fault that affects only autotrack, where the receiver closes the loop.

    end: permitted modes at the end.
    """
    return {**_in_every_mode(EXPECT_NO_EFFECT), 'autotrack': Expectation(report_steps, end, error)}


_STANDBY_OR_SAME_MODE = {mode: ('standby', mode) for mode in LEVEL_INDEPENDENT_MODES}


def _attitude_fault(report_steps, error, still_report_steps=None):
    """Return {mode: Expectation} of a wrong or missing attitude.

    Without attitude no target can be followed, so a mode may end in standby. A mode that bridges the fault may remain.
    still_report_steps: as report_steps, for the modes that do not need the attitude.
    """
    return {**_in_every_mode(Expectation(still_report_steps, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
            **{mode: Expectation(report_steps, _STANDBY_OR_SAME_MODE[mode], error) for mode in FOLLOWING_MODES}}


def _heading_fault():
    """Return {mode: Expectation} of an attitude that is wrong by more than half a beamwidth.

    Only autotrack can point better than the attitude is known.
    """
    return {**_in_every_mode(EXPECT_NO_EFFECT),
            **{mode: Expectation(200, (mode, 'standby'), None) for mode in FOLLOWING_MODES},
            'autotrack': Expectation(200, ('autotrack', 'program'), HALF_BEAMWIDTH_DEG)}


LEVEL_MODE_ERRORS_DEG = {'search': 10.0, 'acquire': 2.0, 'steptrack': HALF_BEAMWIDTH_DEG}
"""Largest permitted distance of the beam from the target, for each mode that uses the signal level [deg].

In search, the searched area reaches five beamwidths (5 deg) to each side of the expected place, and beam and target
may be on opposite sides. In acquire, the beam looks around up to 1.2 beamwidths from the peak that was found. The peak
is within 0.7 beamwidths of the target, so the sum is 1.9 beamwidths. In steptrack the target is within the beam. A
fade removes the level itself, so steptrack has to search and look around; it then has the limit of acquire.
"""

MODES_TO_AUTOTRACK = ('search', 'acquire', 'autotrack')

SIGNAL_LOSS_FAULTS, WRONG_ERROR_FAULTS = ('drop', 'freeze', 'nan', 'clock_step'), ('wrong_slope', 'phase_180')
"""Faults of the receiver that remove its signal, or give its errors a wrong sign; no target is found with them."""


def _signal_level_modes(of_modes, node, fault):
    """Return {mode: Expectation} of the modes that use the signal level, derived from the other modes.

    of_modes: {mode: Expectation} of the other modes. node, fault: names of the node and of its fault.
    """
    (report_steps, end, error), permitted_errors = of_modes['program'], LEVEL_MODE_ERRORS_DEG
    if node == 'tracking_receiver' and fault == 'fade':
        report_steps, end = None, ('program',)
        permitted_errors = {**LEVEL_MODE_ERRORS_DEG, 'steptrack': LEVEL_MODE_ERRORS_DEG['acquire']}
    elif node == 'tracking_receiver' and fault in SIGNAL_LOSS_FAULTS:
        report_steps, end = 200, ('program',)
    elif node == 'tracking_receiver' and fault in WRONG_ERROR_FAULTS:
        end = ('program', 'standby')
    return {mode: Expectation(report_steps, end if end == STANDBY_MODE
                              else tuple(dict.fromkeys((mode, *MODES_TO_AUTOTRACK, *end))),
                              None if error is None else max(error, permitted))
            for mode, permitted in permitted_errors.items()}


def _unstow_expectation(fault, of_modes):
    """Return the Expectation in mode unstow, derived from that in standby.

    In both modes the brakes hold the antenna. A trip need not end the mode unstow.
    """
    expected = of_modes['standby']
    expected = expected._replace(end=expected.end and _STANDBY_OR_SAME_MODE['unstow'])
    # An inverter that is off has no effect until the drive commands torque.
    return expected._replace(report_steps=None) if fault == 'adu.motor_loss' else expected


_LEVEL_INDEPENDENT_EXPECTATIONS = {
    'adu.motor_loss': _in_every_mode(Expectation(200, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.encoder_jump': _in_every_mode(EXPECT_TRIP),
    'adu.encoder_stuck': _when_moving(Expectation(200, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.brake_stuck': {**_in_every_mode(EXPECT_NO_EFFECT),
                        **{mode: Expectation(200, _STANDBY_OR_SAME_MODE[mode],
                                             TENTH_BEAMWIDTH_DEG) for mode in (*MOVING_MODES, *FOLLOWING_MODES)}},
    'adu.lost_tooth': {mode: Expectation(None, end, HALF_PITCH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.gust': _in_every_mode(EXPECT_NO_EFFECT),
    # Only unstow has stow pins; their timeout is longer than the run.
    'adu.pin_stuck': _in_every_mode(EXPECT_NO_EFFECT),
    'adu.drop': _when_moving(Expectation(20, SAME_MODE, None), Expectation(20, SAME_MODE, TENTH_BEAMWIDTH_DEG)),
    'adu.delay': _when_moving(EXPECT_IN_BEAM),
    'adu.freeze': _when_moving(Expectation(100, STANDBY_MODE, HALF_BEAMWIDTH_DEG)),
    'adu.bias': {mode: Expectation(200, end, HALF_BEAMWIDTH_DEG) for mode, end in _STANDBY_OR_SAME_MODE.items()},
    'adu.nan': {**_in_every_mode(EXPECT_TRIP),
                # The rate commands continue, so mode rate may begin again.
                'rate': EXPECT_TRIP._replace(end=('standby', 'rate'))},
    'adu.noise': _in_every_mode(EXPECT_IN_BEAM),
    'tracking_receiver.drop': _in_autotrack(100, HALF_BEAMWIDTH_DEG),
    'tracking_receiver.delay': _in_autotrack(None, TENTH_BEAMWIDTH_DEG),
    'tracking_receiver.freeze': _in_autotrack(200, HALF_BEAMWIDTH_DEG, 'autotrack', 'program'),
    # The receiver cannot know its bias, so the beam follows the default of the fault: 0.002 rad are 0.115 deg.
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
"""{'NODE.FAULT': {mode: Expectation}} of LEVEL_INDEPENDENT_MODES; the other modes and unstow are derived from them."""
FAULT_EXPECTATIONS = {name: {**of_modes, **_signal_level_modes(of_modes, *name.split('.')),
                             'unstow': _unstow_expectation(name, of_modes)}
                      for name, of_modes in _LEVEL_INDEPENDENT_EXPECTATIONS.items()}
"""{'NODE.FAULT': {mode: Expectation}} of every fault with its defaults and a duration of 5 s."""

