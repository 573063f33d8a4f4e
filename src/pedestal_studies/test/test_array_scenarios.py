"""Scenarios of an electronic array: accuracy of the composed loop, messages that are published once, refusals."""
import dataclasses
import math

import numpy as np
import pytest

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.sections import ScenarioError
from pedestal_results import results, tracking
from pedestal_studies.p002_jia import compared_loops
from pedestal_studies.p002_jia.angle_loop import PaperLoop

SWAY, FOUR = 'phased_array_sway', 'phased_array_four'

QUIET = ['tracking_receiver.receiver.cn0_dbhz=110', 'acu.tracker.receiver.sigma_floor=3e-4',
         'acu.tracker.lock_count=20']
QUIET_INS = ['ins.tilt_noise=0', 'ins.heading_noise=0', 'ins.rate_noise=0']
RAMP = [*QUIET, 'scenario.ship=false', 'tracking_receiver.target.kind=ramp', 'acu.azimuth.filter.ca.noise=0.05',
        'tracking_receiver.target.angle.azimuth=-1.5', f'tracking_receiver.target.angle.azimuth_rate={math.pi / 6}']


def composed(*overrides, duration):
    return closed_loop.Loop(scenario.load(SWAY, overrides, duration=duration)).run()


@pytest.mark.parametrize('smoothing, n', [('none', 20), ('moving_average', 20), ('moving_average', 13),
                                          ('recursion', 20)])
def test_a_ramp_is_met_in_the_middle_of_the_hold_with_every_smoothing(smoothing, n):
    """30 deg/s, T = 10 ms: the beam is off by v T / 2 at either end of its interval, one way and the other."""
    run = composed(*RAMP, f'tracking_receiver.receiver.smoothing={smoothing}',
                   f'tracking_receiver.receiver.smoothing_samples={n}', duration=5.0)
    hold = 0.5 * math.pi / 6 * 0.01 * math.cos(0.6)
    error = run.truth['error'][-50:]
    end, begin = error[1:, 0], tracking.interval_start_error(run['adu/truth']['position'][-50:], error)[1:, 0]
    assert np.abs(0.5 * (end + begin)).max() < 0.01 * hold
    assert end == pytest.approx(np.full(49, hold), rel=0.02) and begin == pytest.approx(np.full(49, -hold), rel=0.02)


def test_a_beam_that_only_leads_is_seen_at_the_beginning_of_its_intervals():
    """On the target at every stamp, so early by a whole period at the beginnings."""
    t = np.arange(300) * 0.01
    beam = np.column_stack((0.3 + 0.5 * t, np.full_like(t, 0.7)))
    begun = tracking.interval_start_error(beam, np.zeros_like(beam))
    assert np.isnan(begun[0]).all()
    assert begun[1:, 0] == pytest.approx(np.full(299, -0.005 * math.cos(0.7)), rel=1e-4)
    nothing, on = np.zeros_like(t), np.ones_like(t, bool)
    mode, noise = np.full(t.size, 'autotrack'), 1e-4 * (-1.0)**np.arange(600).reshape(300, 2)
    unknown = np.full_like(beam, np.nan)
    run = tracking.Tracking(t=t, encoders=beam, reference=unknown, error=np.zeros_like(beam), encoder_error=unknown,
                            measured=0.5 * begun + noise, cn0=nothing, estimate_error=noise, beam_earth=beam,
                            target_earth=beam, estimate_earth=beam, sensor_truth=beam, range=nothing, mode=mode,
                            tracking=on, since=on, obstacle=np.zeros(t.size, int),
                            beamwidth=math.radians(1.0), boresight=np.zeros(2), begun=begun)
    values = results.measured(run.parts)
    assert values['pointing_max_deg'][0] == pytest.approx(math.degrees(0.005 * math.cos(0.7)), rel=1e-4)
    assert values['cross_elevation_rms_deg'][0] == pytest.approx(values['cross_elevation_max_deg'][0], rel=1e-6)
    assert values['single_sample_noise_deg'][0] == pytest.approx(math.degrees(1e-4))
    moving = results.measured(dataclasses.replace(run, begun=unknown).parts)
    assert moving['pointing_max_deg'][0] == 0.0
    assert not any('following' in name or 'encoder' in name for name in values)
    assert 'azimuth_following_rms_deg' in moving


@pytest.mark.parametrize('name, overrides, line', [
    (SWAY, ['adu.transport_delay=0.021'], 'adu: transport_delay = 0.021 s: must be a multiple of the period 0.01 s'),
    (SWAY, ['adu.period=0.0001', 'adu.transport_delay=0.3'], 'adu: transport_delay = 0.3 s: must be below 511 periods '
                                                             'of 0.0001 s'),
    (SWAY, ['acu.azimuth.controller=feedforward'], "acu: azimuth.controller = 'feedforward': must be beam: the drive "
                                                   'is an array'),
    ('leo_pass', ['acu.elevation.controller=beam'], "acu: elevation.controller = 'beam': must be one of pid, "
                                                    'feedforward, adrc: the drive has motors'),
    (FOUR, ['beam_2/acu.azimuth.controller=pid'], "beam_2/acu: azimuth.controller = 'pid': must be beam: the drive is "
                                                  'an array'),
    (FOUR, ['beam_2/acu.period=0.001'], 'beam_2/acu: period = 0.001: must be 0.01, as for the other nodes; leave it '
                                        'out here'),
    (FOUR, ['beam_3/tracking_receiver.duration=5.0'], 'beam_3/tracking_receiver: duration = 5.0: must be 30.0, as for '
                                                      'the other nodes; leave it out here'),
    (FOUR, ['beam_3/acu.receiver_rate=true'], 'beam_3/acu: receiver_rate = True: must be False, as for the other '
                                              'nodes; leave it out here'),
])
def test_what_does_not_go_together_is_refused(name, overrides, line):
    with pytest.raises(ScenarioError) as error:
        scenario.load(name, overrides)
    assert str(error.value).partition(', ')[2] == line


def test_a_beam_may_be_on_its_way_for_many_periods():
    chosen = scenario.load(SWAY, ['adu.period=0.001', 'adu.transport_delay=0.08'])
    assert chosen.node_parameters('acu').command_delay == 0.08


def test_every_beam_knows_the_age_of_its_own_errors():
    own = ['beam_2/tracking_receiver.receiver.smoothing=moving_average',
           'beam_3/tracking_receiver.receiver.beam=moving', 'beam_4/acu.tracker.receiver.age=0.001']
    chosen = scenario.load(FOUR, own)
    known = [chosen.node_parameters(f'beam_{i}/acu').tracker.receiver for i in (1, 2, 3, 4)]
    assert [r.age for r in known] == pytest.approx([0.0045, 0.0095, 0.0, 0.001])
    assert [r.beam_age for r in known] == pytest.approx([0.0, 0.005, 0.0, 0.0])
    assert scenario.parse(FOUR, chosen.as_yaml()) == chosen
    for_all = scenario.load(FOUR, [*own, 'acu.tracker.receiver.age=0.002'])
    assert for_all.node_parameters('beam_2/acu').tracker.receiver.age == 0.002


@pytest.mark.parametrize('delta, reading', [(0.0, 0.1408), (0.85, 0.0211)])
def test_the_papers_loop_through_the_cores_reads_what_its_kernel_does(delta, reading):
    """Figure 9: v T of the sway, and the rest of it with compensation."""
    of_axes = [f'acu.{axis}.beam.{key}={value}' for axis in ('azimuth', 'elevation')
               for key, value in (('form', 'type_1'), ('rate_compensation', delta))]
    run = composed(*QUIET, *QUIET_INS, *of_axes, 'adu.transport_delay=0', duration=14.0)
    read = np.degrees(np.abs(run['tracking_receiver/angle_error']['vector'][run.t > 6.0, :2]).max())
    target, rate = compared_loops.sway_target()
    kernel = np.degrees(np.abs(compared_loops.settled(PaperLoop(delta=delta).run(target, rate)[1])).max())
    assert kernel == pytest.approx(reading, rel=0.005)
    assert read == pytest.approx(kernel, rel=0.01)
