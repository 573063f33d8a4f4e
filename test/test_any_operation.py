"""Whatever is asked, breaks, is no number or falls silent: nothing moves on the brakes, with a stow pin in or in
standby, no limit is passed by more than it takes to brake, and standby is always there."""
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from acu_tracker import modes
from acu_tracker.modes import Mode
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.graph import topics
from pedestal_common.graph.topics import AXES
from pedestal_common.wire import records
from pedestal_common.wire.commands import Command

RAMP = 1.5
"""Time [s] in which axes that were let go, or told to stop, stand."""

STILL = 0.01
"""Rate [rad/s] of an axis that stands."""

BRAKING = 0.05
"""Angle [rad] beyond the drive's own limits within which an axis comes to a stand."""

STOWED = ('acu.initial_mode=standby', 'adu.stow_pins=true', 'adu.pins.travel_time=0.1', 'adu.pins.timeout=0.3',
          'adu.initial_elevation=0.6', 'adu.pins.elevation=0.6', 'acu.elevation.stow=0.6',
          'acu.prediction.start_time=2019-12-10T12:00:00')
"""Parameters with which the antenna is stowed and unstowed quickly from where it begins, and the sun is up."""

FAULTS = (('adu', 'nan'), ('adu', 'drop'), ('adu', 'freeze'), ('adu', 'motor_loss'), ('adu', 'pin_stuck'),
          ('tracking_receiver', 'nan'),
          ('tracking_receiver', 'fade'), ('tracking_receiver', 'freeze'), ('tracking_receiver', 'wrong_slope'),
          ('tracking_receiver', 'phase_180'), ('tracking_receiver', 'noise'))

ENABLED = tuple(range(len(topics.ENABLED_STATES)))
"""Codes of adu/state with which the drive follows commands."""

REQUESTS = (('adu', 'adu/enable'), ('adu', 'adu/disable'), ('adu', 'adu/emergency_stop'), ('adu', 'adu/reset_faults'),
            ('acu', 'acu/reset_faults'), ('acu', 'acu/acknowledge'))

angle = st.floats(-7.0, 7.0, allow_nan=False)


class Operated(RuleBasedStateMachine):
    """The closed loop of uav_flyby under a tester who does what he likes."""

    @initialize()
    def begin(self):
        self.loop = closed_loop.Loop(scenario.load('uav_flyby', STOWED, duration=3600.0))
        self.k, self.before = 0, records.empty(closed_loop.STEP_DTYPE, 1)
        self.history = records.empty(closed_loop.STEP_DTYPE, 0)
        self.go(0.2)

    def go(self, seconds):
        count = round(seconds * 1e9 / self.loop.period_ns)
        for unit in self.loop.units.values():
            unit.execute_due(self.k * self.loop.period_ns)
        steps, truth = records.empty(closed_loop.STEP_DTYPE, count), np.zeros(count, closed_loop.Truth.dtype)
        memories = tuple(self.loop.units[name].block(count) if name in self.loop.units else None
                         for name in closed_loop.UNIT_ORDER)
        closed_loop.loop(memories, self.k, self.loop.period_ns, self.before, np.zeros((count, 2)), steps, truth)
        self.k += count
        self.history = np.concatenate((self.history, steps))[-round(RAMP * 1e9 / self.loop.period_ns):]

    def ask(self, node, verb, **arguments):
        return self.loop.units[node].command(Command(verb, 'tester', '', {
            name: str(value) for name, value in arguments.items()}))

    @rule(mode=st.sampled_from(modes.MODES), seconds=st.floats(0.05, 1.0))
    def mode(self, mode, seconds):
        self.ask('acu', mode)
        self.go(seconds)

    @rule(verb=st.sampled_from(('stow', 'unstow')), seconds=st.floats(0.1, 3.0))
    def stow(self, verb, seconds):
        self.ask('acu', verb)
        self.go(seconds)

    @rule(azimuth=angle, elevation=angle, verb=st.sampled_from(('preset', 'slave')), seconds=st.floats(0.05, 2.0))
    def point(self, verb, azimuth, elevation, seconds):
        self.ask('acu', verb, azimuth=azimuth, elevation=elevation)
        self.go(seconds)

    @rule(azimuth=st.floats(-3.0, 3.0), elevation=st.floats(-3.0, 3.0), times=st.integers(1, 6))
    def jog(self, azimuth, elevation, times):
        for _ in range(times):
            self.ask('acu', 'rate', azimuth=azimuth, elevation=elevation)
            self.go(0.2)

    @rule(fault=st.sampled_from(FAULTS), duration=st.floats(0.01, 3.0), seconds=st.floats(0.05, 1.0))
    def fault(self, fault, duration, seconds):
        assert self.ask(*fault, duration=duration).granted
        self.go(seconds)

    @rule(request=st.sampled_from(REQUESTS), seconds=st.floats(0.05, 1.0))
    def request(self, request, seconds):
        self.ask(*request)
        self.go(seconds)

    @rule(seconds=st.floats(0.1, 30.0))
    def silence(self, seconds):
        """Nobody is heard for a while; the plant stands still meanwhile, as on its brakes."""
        self.k += round(seconds * 1e9 / self.loop.period_ns)
        self.go(0.2)

    @rule(seconds=st.floats(0.5, 3.0))
    def wait(self, seconds):
        self.go(seconds)

    @rule()
    def standby(self):
        assert self.ask('acu', 'standby').granted
        self.go(0.05)
        assert (self.history['acu/mode'][-1:] == Mode.STANDBY).all()

    @invariant()
    def standby_commands_no_motion(self):
        modes_of_late = self.history['acu/mode']
        if len(modes_of_late) and (modes_of_late == Mode.STANDBY).all() and len(modes_of_late) * 5e-3 >= RAMP:
            assert np.abs(self.history['acu/rate_command']['velocity'][-1]).max() < 1e-9

    @invariant()
    def brakes_hold(self):
        if len(self.history) * 5e-3 >= RAMP:
            drive = self.loop.units['adu']
            states = {drive.encode('adu/state', int(code)) for code in np.unique(self.history['adu/state'])}
            if states == {'disabled'}:
                assert np.abs(self.history['adu/truth']['velocity'][-1]).max() < STILL

    @invariant()
    def nothing_moves_with_a_pin_in(self):
        pinned = self.history['adu/stow_pins'] != 0
        assert not (pinned & np.isin(self.history['adu/state'], ENABLED)).any()
        assert np.abs(self.history['adu/truth']['velocity'][pinned]).max(initial=0.0) < STILL

    @invariant()
    def no_limit_is_passed(self):
        limits = [getattr(self.loop.units['adu'].parameters, axis).limits for axis in AXES]
        for i, limit in enumerate(limits):
            reached = self.history['adu/truth']['position'][:, i]
            assert (reached > limit.lower - BRAKING).all() and (reached < limit.upper + BRAKING).all()


TestOperated = Operated.TestCase
TestOperated.settings = settings(max_examples=25, stateful_step_count=20, deadline=None, derandomize=True,
                                 suppress_health_check=list(HealthCheck))
