"""Enable, brakes, thermal load and faults of the drive, each caused the way it would be."""
import dataclasses
import math

import numpy as np
import pytest

from drive_law import drive_state, faults
from drive_law.params import AduParameters
from pedestal_common.parameters import build

ELEVATION = {'initial_elevation': 0.7}


def made(drive, **values):
    return drive(build(AduParameters, {**ELEVATION, **{name.replace('__', '.'): v for name, v in values.items()}}))


def phases(d):
    """The phases the drive went through, in order."""
    phase = d.log['phase']
    return [drive_state.PHASES[p] for p in phase[np.flatnonzero(np.diff(phase, prepend=-1))]]


def request(d, what):
    return drive_state.request(d.state[0], d.constants[0], getattr(drive_state, f'REQUEST_{what}'))


CAUSES = {
    'overcurrent': ({'azimuth.faults.overcurrent': 20.0}, {'azimuth': 2.0}),
    'overspeed': ({'azimuth.faults.overspeed': 0.4}, {'azimuth': 0.5}),
    'encoder disagreement': ({'azimuth.bias.schedule': 'off', 'azimuth.faults.encoder_disagreement': 3e-4},
                             {'azimuth': 0.2}),
    'following error': ({'wind.gust.kind': 'step', 'wind.gust.azimuth': -11900.0, 'wind.gust.start': 0.1,
                         'azimuth.motor_1.brake': 120.0, 'azimuth.motor_2.brake': 120.0}, {'azimuth': 0.0}),
    'overtemperature': ({'azimuth.thermal.rated_torque': 2.0, 'azimuth.thermal.time_constant': 1.0},
                        {'azimuth': 0.1}),
}
"""Parameters and commands that make the azimuth trip. The wind is a little more than what both motors hold,
2 * 64 * 90 Nm and friction."""


def test_every_fault_is_caused():
    assert {*CAUSES, 'final limit', 'emergency limit', 'stow pin'} == {
        fault.name for fault in faults.AXIS_FAULTS if fault.stops}


@pytest.mark.parametrize('kind', CAUSES)
def test_each_fault_trips_latches_and_stops_both_axes(drive, kind):
    values, command = CAUSES[kind]
    d = made(drive, **values).run(3.0, elevation=0.05, **command)
    y = d.log
    tripped = np.flatnonzero(y['azimuth']['faults'])[0]
    assert faults.names(y['azimuth']['faults'][tripped]) == (kind,)
    assert kind in faults.names(y['azimuth']['faults'][-1]) and not y['elevation']['faults'].any()
    assert not y['following'][tripped:].any() and y['following'][:tripped].all()
    assert (y['phase'][-1], y['braked'][-1]) == (drive_state.PHASE_DISABLED, 1)
    assert np.abs(y['elevation']['load_velocity'][-50:]).max() < 1e-4          # the healthy axis stands as well
    assert np.abs(y['elevation']['true_torque'][-1]).max() < 0.01
    d.run(0.5, azimuth=0.0, elevation=0.0)
    assert d.log['azimuth']['faults'][-1] and d.log['phase'][-1] == drive_state.PHASE_DISABLED


def test_overcurrent_takes_the_torque_away_at_once_and_the_brakes_fall_in(drive):
    values, command = CAUSES['overcurrent']
    d = made(drive, **values).run(0.5, **command)
    assert phases(d)[:2] == ['enabled', 'disabled']
    tripped = np.flatnonzero(d.log['azimuth']['faults'])[0]
    torque, braked = np.abs(d.log['azimuth']['true_torque']).max(axis=1), d.log['braked']
    assert torque[tripped:tripped + 2].min() < 5.0 and torque[tripped + 3:].max() < 0.5
    assert not braked[:tripped + 10].any() and braked[tripped + 12:].all()      # 50 ms later


def beyond_its_end(drive, rate):
    """A drive whose load encoder reads 0.6 rad too little, sent beyond the end of travel at a rate [rad/s]."""
    limits = AduParameters().azimuth.limits
    d = made(drive, azimuth__faults__encoder_disagreement=1.0, initial_azimuth=limits.upper - 0.1)
    d.state['azimuth']['jump'] = -0.6 * d.constants['azimuth']['per_rad']
    return d.run(1.5 + 0.1 / rate, azimuth=rate), limits


def test_the_final_switch_takes_the_torque_away_whatever_the_encoder_says_and_the_drive_leads_back(drive):
    d, limits = beyond_its_end(drive, 0.5)
    final, emergency, _ = limits.switches
    y = d.log
    tripped = np.flatnonzero(y['azimuth']['faults'])[0]
    assert faults.names(y['azimuth']['faults'][-1]) == ('final limit',) and phases(d) == ['enabled', 'disabled']
    assert y['azimuth']['load_position'][tripped] == pytest.approx(limits.upper + final, abs=0.5 * 0.006)
    assert np.abs(y['azimuth']['true_torque'][tripped + 3:]).max() < 0.5 and y['braked'][-1]
    assert y['azimuth']['load_position'][-1] < limits.upper + emergency
    d.state['azimuth']['jump'] = 0.0
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_ACCEPTED
    d.run(3.5)
    led = d.log['azimuth'][-700:]
    assert not led['faults'][-1] and led['load_velocity'].min() > -0.3        # 0.1 rad/s at once: it overshoots
    assert led['load_position'][-1] == pytest.approx(limits.upper, abs=1e-3) and d.log['following'][-1]


def test_the_emergency_switch_is_not_reset_while_it_is_pressed(drive):
    d, limits = beyond_its_end(drive, 2.4)
    assert faults.names(d.log['azimuth']['faults'][-1]) == ('final limit', 'emergency limit')
    assert d.log['azimuth']['load_position'].max() < limits.upper + 1.2 * limits.switches[2]
    assert np.abs(d.log['azimuth']['load_velocity'][-20:]).max() < 1e-3
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_CAUSE_PERSISTS


def test_a_runaway_ends_in_the_brakes(drive):
    """More wind than both motors hold: the stop is not obeyed, after stop_time the brakes fall in. The wind is within
    what they hold with the friction, so the axis comes to rest."""
    values, command = CAUSES['following error']
    d = made(drive, **values).run(4.0, **command)
    assert phases(d) == ['enabled', 'stopping', 'disabled']
    (stopping, disabled) = (np.flatnonzero(d.log['phase'] == p)[0] for p in (drive_state.PHASE_STOPPING,
                                                                             drive_state.PHASE_DISABLED))
    assert disabled - stopping == pytest.approx(200, abs=2)
    assert np.abs(d.log['azimuth']['load_velocity'][-50:]).max() < 1e-6


def test_reset_only_when_it_stands_and_the_cause_has_gone(drive):
    d = made(drive, azimuth__faults__overspeed=0.4, azimuth__limits__deceleration=1.0)
    d.run(0.1, azimuth=0.5)
    assert d.log['azimuth']['faults'][-1] == faults.Bit.OVERSPEED
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_AXES_MOVING
    assert request(d, 'ENABLE') == drive_state.REPLY_FAULT_LATCHED
    d.run(0.7)
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_ACCEPTED
    d.run(0.5, azimuth=0.3)
    assert d.log['following'][-1] and not d.log['azimuth']['faults'][-1]


def test_an_overtemperature_must_cool_down(drive):
    values, command = CAUSES['overtemperature']
    d = made(drive, **values).run(1.0, **command)
    while d.log['phase'][-1] != drive_state.PHASE_DISABLED:
        d.run(0.1)
    assert d.log['azimuth']['thermal_load'][-1].max() > 0.8
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_CAUSE_PERSISTS
    d.run(5.0)
    assert d.log['azimuth']['thermal_load'][-1].max() < 0.8
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_ACCEPTED


def test_motion_resumes_from_where_it_stands_within_the_ramp(drive):
    """After a reset whoever commands has gone on: the drive neither jumps nor makes up for what it missed."""
    d = made(drive).run(0.3, azimuth=1.0)
    assert request(d, 'EMERGENCY_STOP') == drive_state.REPLY_ACCEPTED
    d.run(0.5)
    stood = d.log['azimuth']['load_position'][-1]
    assert request(d, 'RESET_FAULTS') == drive_state.REPLY_ACCEPTED
    d.run(0.5, azimuth=1.0)
    a = d.log[-100:]['azimuth']
    free = np.flatnonzero(d.log[-100:]['following'])[0]
    assert np.abs(a['load_position'][:free] - stood).max() < 2e-5
    fast = np.flatnonzero(a['load_velocity'] > 0.95)[0]
    assert fast - free >= 0.9 * 0.95 / 20.0 / 5e-3                  # at full torque: half of it
    assert a['load_position'][-1] - stood == pytest.approx((99 - free) * 5e-3 - 1.0 / 40.0, abs=0.01)


def test_disable_and_enable(drive):
    d = made(drive).run(0.2, azimuth=0.5, elevation=0.1)
    assert request(d, 'DISABLE') == drive_state.REPLY_ACCEPTED
    d.run(1.0)
    assert request(d, 'ENABLE') == drive_state.REPLY_ACCEPTED
    d.run(0.5, azimuth=0.2)
    assert phases(d) == ['enabled', 'stopping', 'engaging brakes', 'disabled', 'releasing brakes', 'enabled']
    assert d.log['azimuth']['load_velocity'][-1] == pytest.approx(0.2, abs=2e-3)
    off = d.log[d.log['phase'] == drive_state.PHASE_DISABLED]
    assert np.abs(off['azimuth']['true_torque'][2:]).max() < 0.01 and off['braked'].all()


@pytest.mark.parametrize('wind', [0.0, 1000.0, -1000.0])
def test_brakes_hold_without_torque_and_without_creep(drive, wind):
    d = made(drive, initially_enabled=False, wind__gust__kind='step', wind__gust__azimuth=wind,
             wind__gust__start=0.5).run(4.0, azimuth=0.5)
    a = d.log['azimuth']
    assert not d.log['following'].any() and np.abs(a['true_torque'][50:]).max() < 0.01
    assert np.ptp(a['motor_position'][20:, 0]) < 1e-9 and np.ptp(a['motor_position'][20:, 1]) < 1e-9
    assert np.ptp(a['load_position'][400:]) < 1e-9
    swing = abs(wind) / 5e6 + (0.6e-3 if wind else 1e-5)                        # one mesh bends, half the lash is lost
    assert np.ptp(a['load_position']) < swing


def test_a_brake_takes_the_speed_as_coulomb_friction_does(drive):
    """Torque off at speed: 45 Nm on each shaft and the friction brake 0.0085 + 210 / (2 * 64^2) kg m2 per motor."""
    d = made(drive, azimuth__faults__overcurrent=30.0)
    for rate in np.linspace(0.0, 1.5, 60):
        d.step(azimuth=rate)
    assert not d.log['azimuth']['faults'].any()
    d.run(0.3, azimuth=-1.5)
    a = d.log[60:]
    gripping = np.flatnonzero(a['braked'])[0]
    v = a['azimuth']['load_velocity'][gripping + 1:gripping + 5]
    friction = 0.4 + (60.0 + 20.0 * v.mean()) / 128.0 + 0.003 * 64.0 * v.mean()
    expected = -(45.0 + friction) / (0.0085 + 210.0 / 8192.0) / 64.0
    assert np.polyfit(np.arange(4) * 5e-3, v, 1)[0] == pytest.approx(expected, rel=0.1)


def test_thermal_load_is_the_first_order_lag_of_the_torque_squared(drive):
    """-2000 Nm of wind on two motors without bias or friction: x = (T / T_r)^2 (1 - exp(-t / tau)), and R with it."""
    d = made(drive, azimuth__bias__schedule='off', wind__azimuth=-3000.0, azimuth__thermal__time_constant=2.0).run(
        3.0, azimuth=0.0)
    a = d.log['azimuth']
    T = a['true_torque'][:, 0]
    assert np.ptp(T) < 0.02 * T.mean()
    t = d.times
    expected = (T.mean() / 30.0) ** 2 * (1.0 - np.exp(-t / 2.0))
    assert np.abs(a['thermal_load'][:, 0] - expected).max() < 0.02 * expected.max()
    m, state, volts, amperes = d.params.azimuth.motor_1, d.state['azimuth']['motor_1'][0], 0.0, 0.0
    for _ in range(100):
        d.step()
        volts, amperes = volts + state['v_q'], amperes + state['i_q']
    R = m.resistance * (1.0 + 0.00393 * 80.0 * d.log['azimuth']['thermal_load'][-50, 0])
    assert volts / amperes == pytest.approx(R, rel=2e-3)


def test_defaults_do_not_trip_in_the_hardest_moves(drive):
    """Ma 2023's raw step, the largest steps of the rate command, and a gust of 3000 Nm."""
    d = made(drive, period=2e-3, azimuth__bias__torque=5.0, azimuth__bias__schedule='fade',
             azimuth__speed_loop__proportional=3.57, azimuth__speed_loop__integral=244.0)
    for _ in range(300):
        d.step(azimuth=54.85 * (0.174 - d.outputs[0]['azimuth']['position']))
    for rate in (2.45, -2.45, 0.0):
        d.run(0.4, azimuth=rate, elevation=math.copysign(1.7, rate) if rate else 0.0)
    assert d.log['following'].all()
    d = made(drive, wind__gust__kind='step', wind__gust__azimuth=3000.0, wind__gust__start=0.1).run(2.0, azimuth=0.0)
    assert d.log['following'].all()


def test_the_same_faults_give_the_same_bytes(drive):
    values, command = CAUSES['overspeed']
    first, second = (made(drive, **values).run(1.0, **command).log for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_a_drive_that_starts_disabled_can_be_enabled(drive):
    d = drive(dataclasses.replace(AduParameters(initial_elevation=0.7), initially_enabled=False)).run(0.2, azimuth=0.3)
    assert request(d, 'ENABLE') == drive_state.REPLY_ACCEPTED
    d.run(0.5)
    assert phases(d) == ['disabled', 'releasing brakes', 'enabled']
    assert d.log['azimuth']['load_velocity'][-1] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.parametrize('offset', [10.0, 20.0])
def test_without_torque_the_inverter_is_off_whatever_a_current_sensor_says(drive, offset):
    """With the loops on, an offset of the sensors would be a torque that nobody asked for."""
    d = made(drive, azimuth__motor_1__drift__current_offset=offset, azimuth__motor_2__drift__current_offset=offset,
             azimuth__bias__schedule='off').run(0.2, azimuth=0.0)
    assert request(d, 'DISABLE') == drive_state.REPLY_ACCEPTED
    d.run(2.0)
    a = d.log['azimuth'][-300:]
    assert d.log['phase'][-1] == drive_state.PHASE_DISABLED
    assert np.abs(a['true_torque']).max() == 0.0 and (a['bias'] == 0.0).all()
    assert np.ptp(a['load_position']) < 2e-4 and np.ptp(a['motor_position']) < 0.2      # it swings inside its lash


@pytest.mark.parametrize('gap', [{'enable': 0}, {'azimuth': math.nan}])
@pytest.mark.parametrize('delay', [0.0, 0.05])
def test_after_a_gap_the_command_is_met_within_the_ramp(drive, gap, delay):
    """Stale or unbelievable commands stop the axis; nothing of before the gap comes back, and the next is no step."""
    d = drive(AduParameters(initial_elevation=0.7, transport_delay=delay)).run(0.5, azimuth=1.0)
    assert d.log['azimuth']['load_velocity'][-1] == pytest.approx(1.0, abs=5e-3)
    d.run(0.3, **gap)
    assert abs(d.log['azimuth']['load_velocity'][-1]) < 2e-3
    d.run(0.3, azimuth=-0.5, enable=1)
    v = d.log['azimuth']['load_velocity'][-60:]
    assert v.max() < 0.02 and v[-1] == pytest.approx(-0.5, abs=2e-3)
    reached = np.flatnonzero(v < -0.475)[0] - round(delay / 5e-3)
    assert reached * 5e-3 >= 0.9 * 0.475 / 20.0


def test_the_drive_is_enabled_when_the_brakes_have_let_go(drive):
    d = made(drive)
    assert request(d, 'DISABLE') == drive_state.REPLY_ACCEPTED
    d.run(1.0)
    assert d.log['phase'][-1] == drive_state.PHASE_DISABLED
    assert request(d, 'ENABLE') == drive_state.REPLY_ACCEPTED
    d.run(1.0)
    releasing = d.log['phase'][-200:] == drive_state.PHASE_RELEASING_BRAKES
    assert releasing.sum() >= d.constants['release_periods'][0] > 1
    enabled = d.log['phase'] == drive_state.PHASE_ENABLED
    assert enabled[-1] and not d.log['braked'][enabled].any()
