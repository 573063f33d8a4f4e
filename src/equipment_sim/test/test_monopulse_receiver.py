"""Receiver of I/Q samples with simulated samples, in simulated time: noise, lock, calibration, gaps, bad samples, and
feeds with one output."""
import math
import re

import numpy as np
import pytest

from equipment_sim.iq.unit import SimulatedIq
from pedestal_common import parameters
from pedestal_common.node.unit import LEVEL_ERROR
from pedestal_common.wire import commands, records
from pedestal_hardware.monopulse import blocks, feed
from pedestal_hardware.monopulse.params import MonopulseParameters
from pedestal_hardware.monopulse.unit import ANGLE_ERROR_TOPIC, MonopulseReceiver
from receiver_law.monopulse import sum_pattern, thermal_noise

PERIOD = 0.005
BEAMWIDTH = 0.0175
FIXED = {'target.kind': 'step', 'target.angle.azimuth': 0.3, 'target.angle.elevation': 0.6,
         'target.angle.start': 1e6, 'receiver.range_exponent': 0.0, 'duration': 60.0}
OPEN = {'receiver.acquire_level_dbhz': 30.0, 'receiver.lose_level_dbhz': 30.0}
"""Levels at which the receiver locks to the weakest carrier of these tests."""


class Rig:
    """Simulated samples into a receiver. offset: (cross-elevation, elevation) of the target off the beam [rad]."""

    def __init__(self, offset=(0.0, 0.0), **values):
        self.p = parameters.build(MonopulseParameters, FIXED | values)
        self.iq, self.unit = SimulatedIq(self.p, ('adu/truth',)), MonopulseReceiver(self.p, ('clock',))
        self.blocks = blocks.Blocks(self.p.source.rate, self.p.block)
        self.step, self.number, self.offset, self.stamps = 0, 0, offset, []

    def samples(self):
        """The samples of the next step."""
        truth = self.iq.inputs[0]['adu/truth']
        truth['position'] = 0.3 - self.offset[0] / math.cos(0.6), 0.6 - self.offset[1]
        truth['stamp'] = stamp = round(self.step * PERIOD * 1e9)
        self.iq.step(np.array([stamp]), self.iq.inputs, self.iq.outputs)
        self.step += 1
        return self.iq.samples(self.p.block)

    def run(self, steps, change=lambda samples: samples, skip=0):
        """Make steps, and return their (errors (n, 2) [rad], C/N0 (n,) [dB-Hz]). change(samples) -> samples that
        arrive; skip: number of samples that are lost before the first."""
        self.number += skip
        rows = []
        for _ in range(steps):
            samples = change(self.samples())
            for block in self.blocks.put(blocks.Chunk(samples, self.number, round(self.number * 1e9
                                                                                 / self.p.source.rate))):
                self.unit.take(block)
                outputs = records.empty(self.unit.outputs_type(), 1)
                self.unit.step(np.array([block.middle]), self.unit.inputs, outputs)
                if outputs[0][ANGLE_ERROR_TOPIC]['stamp'] != records.NO_STAMP:
                    self.stamps.append(int(outputs[0][ANGLE_ERROR_TOPIC]['stamp']))
                    rows.append(outputs[0][ANGLE_ERROR_TOPIC]['vector'].copy())
            self.number += len(samples)
        rows = np.array(rows).reshape(-1, 3)
        return rows[:, :2], rows[:, 2]

    @property
    def state(self):
        return self.unit.parts['state']


SLOW = {'source.rate': 50e3, 'carrier.span': 40e3, 'carrier.bins': 1024}
"""A fifth of the samples: the noise of an error depends on C/N0 and time only."""


@pytest.mark.parametrize('cn0_dbhz', [35.0, 40.0, 50.0, 60.0])
def test_noise_law(cn0_dbhz):
    """Over six seeds, against the law with the loss of an integral of finite length."""
    found, levels = [], []
    for seed in range(6):
        rig = Rig(**OPEN, **SLOW, **{'receiver.cn0_dbhz': cn0_dbhz, 'seed': seed})
        errors, cn0 = rig.run(1200)
        found.append(errors[400:])
        levels.append(10.0**(0.1 * cn0[400:]))
    assert np.isfinite(found).all()
    C, T_c = 10.0**(0.1 * cn0_dbhz), PERIOD / rig.p.receiver.samples_per_step
    law = BEAMWIDTH / rig.p.antenna.slope * math.sqrt(1.0 + 1.0 / (C * T_c)) / math.sqrt(2.0 * C * PERIOD)
    measured = np.concatenate(found).std(axis=0)
    assert measured == pytest.approx([law, law], rel=0.05)
    assert 10.0 * math.log10(np.mean(levels)) == pytest.approx(cn0_dbhz, abs=0.15)


def test_an_error_has_sign_size_and_axis():
    offset = np.array([0.2, -0.1]) * BEAMWIDTH
    rig = Rig(tuple(offset), **{'receiver.cn0_dbhz': 65.0})
    errors, _ = rig.run(300)
    # The difference over the sum is 5 % above its slope at a third of a beamwidth.
    assert errors[150:].mean(axis=0) == pytest.approx(offset, rel=0.03)


def test_the_loop_follows_a_doppler_rate():
    rig = Rig(**{'receiver.cn0_dbhz': 45.0, 'target.kind': 'flyby', 'target.flyby.closest_distance': 50.0,
                 'target.flyby.height': 2000.0, 'target.flyby.speed': 300.0, 'target.flyby.closest_time': 1.5,
                 'simulated.carrier': 10e9, 'receiver.horizon_mask': -1.5})
    # The beam does not follow: only the frequency counts here, so the pattern has one voltage.
    rig.iq.parts['constants']['beamwidth'] = 1e3
    rig.run(100)
    first = rig.iq.frequency
    errors, _ = rig.run(400)
    rate = (rig.iq.frequency - first) / 2.0
    assert abs(rate) > 1000.0
    assert np.isfinite(errors).all()
    hertz = rig.p.source.rate / (2.0 * math.pi)
    # A loop of first order would stand off by the change of the frequency in a block over its gain, 33 Hz and more.
    assert abs(rate) * PERIOD / rig.p.carrier.loop_gain > 33.0
    assert abs(rig.state['error']) * hertz < 10.0
    assert rig.state['turn'] * hertz == pytest.approx(rig.iq.frequency, abs=abs(rate) * PERIOD + 10.0)


def test_the_same_seed_gives_the_same_samples():
    made = []
    for seed in (1, 1, 2):
        rig = Rig(seed=seed)
        made.append(np.concatenate([rig.samples() for _ in range(5)]))
    assert np.array_equal(made[0], made[1]) and not np.array_equal(made[0], made[2])


def test_a_calibration_matrix_takes_phases_back():
    phases = {'simulated.x_phase': 0.9, 'simulated.e_phase': -1.2}
    offset = 0.1 * BEAMWIDTH
    wrong, _ = Rig((offset, offset), **phases, **{'receiver.cn0_dbhz': 60.0}).run(300)
    assert wrong[150:].mean(axis=0) == pytest.approx([offset * math.cos(0.9), offset * math.cos(1.2)], rel=0.03)
    rig = Rig((offset, offset), **phases, **{'receiver.cn0_dbhz': 60.0, 'calibration.x_from_x_phase': -0.9,
                                             'calibration.e_from_e_phase': 1.2})
    right, _ = rig.run(800)
    assert right[150:].mean(axis=0) == pytest.approx([offset, offset], rel=0.03)
    values = dict(rig.unit.diagnose().values)
    assert float(values['cross_elevation_phase_deg']) == pytest.approx(math.degrees(0.9), abs=1.0)
    assert float(values['elevation_phase_deg']) == pytest.approx(-math.degrees(1.2), abs=1.0)
    assert abs(float(values['elevation_skew'])) < 0.01
    # The ratio at a tenth of a beamwidth is the slope over ten, with a second of smoothing.
    assert float(values['elevation_ratio']) == pytest.approx(0.16, rel=0.05)


def test_no_lock_without_a_carrier_and_a_new_search_after_a_loss():
    rig = Rig(**{'receiver.cn0_dbhz': 50.0})
    errors, _ = rig.run(200)
    assert np.isfinite(errors[100:]).all() and not np.isfinite(errors[0]).any()
    noise = np.random.default_rng(5)

    def silent(samples):
        return noise.standard_normal((len(samples), 6), np.float32).view(np.complex64)
    errors, _ = rig.run(300, silent)
    assert np.isnan(errors[100:]).all()
    assert rig.state['carrier'] == 0 and rig.unit.diagnose().message == 'search for the carrier'
    errors, _ = rig.run(200)
    assert np.isfinite(errors[100:]).all()


def test_samples_that_are_not_finite_give_no_error_and_are_named():
    rig = Rig(**{'receiver.cn0_dbhz': 50.0})
    rig.run(200)
    before = rig.state.copy()

    def broken(samples):
        samples[17, 2] = complex(math.nan, 0.0)
        return samples
    errors, cn0 = rig.run(2, broken)
    assert np.isnan(errors).all() and np.isfinite(cn0).all()
    diagnosis = rig.unit.diagnose()
    assert diagnosis.message == 'samples hold NaN or infinity' and dict(diagnosis.values)['bad_blocks'] == '2'
    assert rig.state['agc_power'] == before['agc_power'] and rig.state['noise'] == before['noise']
    errors, _ = rig.run(40)
    assert np.isfinite(errors[-1]).all()


@pytest.mark.parametrize('skip, kept', [(3000, True), (100_000, False)], ids=['short', 'long'])
def test_a_gap_is_counted_and_the_receiver_continues(skip, kept):
    rig = Rig(**{'receiver.cn0_dbhz': 50.0})
    rig.run(200)
    errors, _ = rig.run(200, skip=skip)
    assert (rig.blocks.gaps, rig.blocks.lost) == (1, skip)
    assert np.isfinite(errors[0]).all() == kept
    assert np.isfinite(errors[-1]).all()


SCANNED_FEEDS = ['one_channel', 'conical_scan']
"""Feeds with one output."""


@pytest.mark.thorough
@pytest.mark.parametrize('kind', SCANNED_FEEDS)
@pytest.mark.parametrize('cn0_dbhz, rate', [(38.0, 50.0), (50.0, 240.0), *(
    pytest.param(*case, marks=pytest.mark.thorough)
    for case in ((45.0, 50.0), (60.0, 50.0), (50.0, 12.5), (50.0, 110.0), (50.0, 150.0)))])
def test_noise_law_of_a_scanned_feed(kind, cn0_dbhz, rate):
    """Over six seeds. The power of M integrals of the received level R has the variance 2 R T_c + 1. Half of the
    squares of the reference belong to each axis, less the loss of its averages."""
    found, levels = [], []
    for seed in range(6):
        rig = Rig(**OPEN, **SLOW, **{'feed.kind': kind, 'feed.scan_rate': rate, 'receiver.cn0_dbhz': cn0_dbhz,
                                     'seed': seed})
        errors, cn0 = rig.run(2400)
        found.append(errors[len(errors) // 5:])
        levels.append(10.0**(0.1 * cn0[len(errors) // 5:]))
    assert np.isfinite(found).all()
    share = 0.9 if kind == 'one_channel' else float(sum_pattern(0.25))**2
    R, T_c = share * 10.0**(0.1 * cn0_dbhz), PERIOD / rig.p.receiver.samples_per_step
    T = rig.p.steps_per_error * PERIOD
    factor = math.sqrt(1.0 + 0.5 / (R * T_c))
    # The control unit's model of three channels, with the effective time of an error.
    law = factor * thermal_noise(BEAMWIDTH, rig.p.antenna.slope, R, feed.effective_integration(rig.p))
    assert np.concatenate(found).std(axis=0) == pytest.approx([law, law], rel=0.1 if kind == 'one_channel' else 0.07)
    if rate <= 50.0:
        lost = np.sinc(rate * T_c) if kind == 'conical_scan' else math.sqrt(1.0 - 4.0 / 3.0 * rate * T_c)
        closed = factor * 2.0 * BEAMWIDTH / (feed.modulation_slope(rig.p) * lost * math.sqrt(R * T))
        assert law == pytest.approx(closed, rel=1e-2)
    assert 10.0 * math.log10(np.mean(levels) / R) == pytest.approx(0.0, abs=0.2)


def test_one_channel_costs_what_the_coupler_takes():
    """A coupler of 10 % costs 13 dB against three channels (hardware.md B1), of which 0.46 dB lower the level."""
    p = parameters.build(MonopulseParameters, {'feed.kind': 'one_channel'})
    loss = 10.0 * math.log10(4 * PERIOD * feed.reference_efficiency(p) / feed.effective_integration(p) / 0.9)
    assert loss == pytest.approx(10.0 * math.log10(2.0 / 0.1), abs=0.01)


@pytest.mark.parametrize('kind', SCANNED_FEEDS)
@pytest.mark.parametrize('rate', [13.0, 50.0, 187.3])
def test_a_scanned_error_has_sign_size_and_axis_at_any_rate_of_the_scan(kind, rate):
    offset = np.array([0.12, -0.2]) * BEAMWIDTH
    rig = Rig(tuple(offset), **SLOW, **{'feed.kind': kind, 'feed.scan_rate': rate, 'receiver.cn0_dbhz': 70.0})
    errors, _ = rig.run(600)
    steps = math.ceil(1.0 / (rate * PERIOD))
    assert np.diff(rig.stamps) == pytest.approx(steps * PERIOD * 1e9)
    # The first window ends with block number `steps`, and its middle is half a window earlier.
    assert rig.stamps[0] == pytest.approx(0.5 * steps * PERIOD * 1e9)
    assert errors[len(errors) // 3:].mean(axis=0) == pytest.approx(offset, rel=0.04)
    assert float(dict(rig.unit.diagnose().values)['scan_hz']) == pytest.approx(rate, rel=0.1)


def test_the_phase_of_the_reference_and_the_matrix_turn_a_scanned_error():
    offset = np.array([0.1, 0.0]) * BEAMWIDTH
    values = {'feed.kind': 'conical_scan', 'receiver.cn0_dbhz': 70.0}
    turned, _ = Rig(tuple(offset), **SLOW, **values, **{'feed.reference_phase': 0.5}).run(600)
    assert turned[75:].mean(axis=0) == pytest.approx([offset[0] * math.cos(0.5), offset[0] * math.sin(0.5)], rel=0.03)
    swapped, _ = Rig(tuple(offset), **SLOW, **values, **{
        'calibration.x_from_x_gain': 0.0, 'calibration.e_from_x_gain': 2.0, 'calibration.e_from_e_gain': 0.0,
        'calibration.e_from_x_phase': math.pi}).run(600)
    assert swapped[75:].mean(axis=0) == pytest.approx([0.0, -2.0 * offset[0]], abs=0.06 * offset[0])


@pytest.mark.parametrize('kind', SCANNED_FEEDS)
def test_a_reference_that_stands_still_gives_no_error_and_is_named(kind):
    rig = Rig(**SLOW, **{'feed.kind': kind, 'receiver.cn0_dbhz': 55.0})
    errors, _ = rig.run(200)
    assert np.isfinite(errors[20:]).all()

    def still(samples):
        samples[:, 1] = 0.7
        return samples
    errors, cn0 = rig.run(40, still)
    assert np.isnan(errors[1:]).all() and np.isfinite(cn0).all()
    diagnosis = rig.unit.diagnose()
    assert (diagnosis.message, diagnosis.level) == ('no scan reference, or it stands still', LEVEL_ERROR)
    errors, _ = rig.run(400)
    assert np.isfinite(errors[-20:]).all() and rig.unit.diagnose().message == 'locked'


def quarters(*values):
    """Return a change of the samples: these values of the reference in the place of 1, j, -1, -j."""
    def changed(samples):
        k = np.round(np.angle(samples[:, 1]) / (0.5 * math.pi)).astype(int) % 4
        samples[:, 1] = np.array(values, np.complex64)[k]
        return samples
    return changed


def noisy(amplitude, sigma):
    """Return a change of the samples: a reference of this amplitude with noise."""
    rng = np.random.default_rng(3)

    def changed(samples):
        noise = sigma / math.sqrt(2.0) * rng.standard_normal((len(samples), 2)).view(complex)[:, 0]
        samples[:, 1] = amplitude * samples[:, 1] + noise
        return samples
    return changed


def conjugate(samples):
    samples[:, 1] = samples[:, 1].conj()
    return samples


def with_mean(samples):
    samples[:, 1] += 0.5
    return samples


WRONG_SCAN = 'the scan reference is not that of feed.scan_rate: '


@pytest.mark.parametrize('kind, change, text', [
    ('one_channel', conjugate, WRONG_SCAN + r'-(50.0|49.9) Hz, must be 50 Hz'),
    ('conical_scan', conjugate, WRONG_SCAN + r'-50.0 Hz, must be 50 Hz'),
    ('conical_scan', with_mean, WRONG_SCAN + r'its mean is 0.4'),
    ('one_channel', quarters(0.0, 1.0, 1.0 + 1.0j, 1.0j), WRONG_SCAN),
    ('one_channel', quarters(-1.0 - 1.0j, -1.0 + 1.0j, 1.0 - 1.0j, 1.0 + 1.0j), WRONG_SCAN),
    ('conical_scan', noisy(0.0, 1.0), 'no scan reference, or it stands still'),
    ('one_channel', noisy(0.0, 0.0), 'no scan reference, or it stands still'),
    ('conical_scan', noisy(0.05, 0.1), 'no scan reference, or it stands still')],
    ids=['direction', 'direction of the beam', 'mean', 'bits of 0 and 1', 'order of the bits', 'noise', 'zero',
         'too weak'])
def test_a_wrong_scan_reference_gives_no_error_and_is_named(kind, change, text):
    rig = Rig((0.15 * BEAMWIDTH, -0.1 * BEAMWIDTH), **SLOW, **{'feed.kind': kind, 'receiver.cn0_dbhz': 60.0})
    errors, _ = rig.run(400, change)
    diagnosis = rig.unit.diagnose()
    assert re.match(text, diagnosis.message) and diagnosis.level == LEVEL_ERROR, diagnosis.message
    assert np.isnan(errors[5:]).all()


@pytest.mark.parametrize('kind, configured, actual, text', [
    ('one_channel', 50.0, 25.0, '2[45].* Hz, must be 50 Hz'),
    ('conical_scan', 50.0, 12.5, '1[23].* Hz, must be 50 Hz'),
    ('conical_scan', 25.0, 100.0, '100.* Hz, must be 25 Hz')])
def test_another_rate_of_the_scan_is_named(kind, configured, actual, text):
    rig = Rig(**SLOW, **{'feed.kind': kind, 'feed.scan_rate': configured, 'receiver.cn0_dbhz': 60.0})
    rig.iq.parts['feed']['turn'] = 2.0 * math.pi * actual / rig.p.source.rate
    errors, _ = rig.run(600)
    assert np.isnan(errors[5:]).all()
    message = rig.unit.diagnose().message
    assert re.search(text, message) or message == 'no scan reference, or it stands still', message


@pytest.mark.parametrize('amplitude, sigma', [(1e-3, 0.0), (30.0, 0.0), (0.5, 0.1)])
def test_amplitude_and_some_noise_of_the_reference_do_not_count(amplitude, sigma):
    offset = np.array([0.15, -0.1]) * BEAMWIDTH
    for kind in SCANNED_FEEDS:
        rig = Rig(tuple(offset), **SLOW, **{'feed.kind': kind, 'receiver.cn0_dbhz': 70.0})
        errors, _ = rig.run(800, noisy(amplitude, sigma))
        assert errors[100:].mean(axis=0) == pytest.approx(offset, rel=0.05)


def test_bits_of_plus_and_minus_one_stand_at_45_degrees():
    offset = np.array([0.15, -0.1]) * BEAMWIDTH
    rig = Rig(tuple(offset), **SLOW, **{'feed.kind': 'one_channel', 'feed.reference_phase': -0.25 * math.pi,
                                        'receiver.cn0_dbhz': 70.0})
    errors, _ = rig.run(800, quarters(1.0 + 1.0j, -1.0 + 1.0j, -1.0 - 1.0j, 1.0 - 1.0j))
    assert errors[100:].mean(axis=0) == pytest.approx(offset, rel=0.05)


def test_the_lock_ends_if_no_window_is_complete():
    """A gap in each third step, of four that a window needs."""
    rig = Rig(**SLOW, **{'feed.kind': 'conical_scan', 'receiver.cn0_dbhz': 55.0})
    rig.run(200)
    assert rig.state['locked']
    for _ in range(100):
        assert len(rig.run(3, skip=50)[0]) == 0
    assert not rig.state['locked'] and rig.unit.diagnose().message != 'locked'
    rig.run(300)
    assert rig.state['locked']


def test_a_bad_block_and_a_gap_begin_a_new_window():
    rig = Rig(**SLOW, **{'feed.kind': 'conical_scan', 'receiver.cn0_dbhz': 55.0})
    rig.run(202)                       # half a window

    def broken(samples):
        samples[3, 1] = math.inf
        return samples
    errors, _ = rig.run(1, broken)
    assert np.isnan(errors).all() and rig.unit.diagnose().message == 'samples hold NaN or infinity'
    assert len(rig.run(3)[0]) == 0 and np.isfinite(rig.run(1)[0]).all()
    rig.run(2)
    assert len(rig.run(3, skip=100)[0]) == 0 and np.isfinite(rig.run(2)[0]).all()


def test_a_level_that_changes_with_the_scan_is_an_error_of_conical_scan():
    """Fading of 10 % at the rate of the scan: an error of its size over the modulation slope."""
    rig = Rig(**SLOW, **{'feed.kind': 'conical_scan', 'receiver.cn0_dbhz': 75.0})
    rig.run(400)

    def fading(samples):
        samples[:, 0] *= 1.0 + 0.05 * samples[:, 1].real
        return samples
    errors, _ = rig.run(200, fading)
    assert errors[10:].mean(axis=0) == pytest.approx([0.1 * BEAMWIDTH / feed.modulation_slope(rig.p), 0.0],
                                                     abs=1e-3 * BEAMWIDTH)


@pytest.mark.parametrize('values, text', [
    ({'feed.kind': 'one_channel', 'feed.scan_rate': 300.0}, r'feed.scan_rate = 300 Hz: must be at most 250 Hz'),
    ({'feed.kind': 'one_channel', 'receiver.smoothing': 'recursion'}, r'receiver.smoothing = recursion: must be'),
    ({'feed.kind': 'conical_scan', 'antenna.cross_coupling': 0.1}, r'antenna.cross_coupling = 0.1 rad: must be 0'),
    ({'feed.kind': 'conical_scan', 'simulated.x_phase': 0.1}, r'simulated.x_phase = 0.1 rad: must be 0 with')])
def test_parameters_that_a_scanned_feed_does_not_have_are_refused(values, text):
    with pytest.raises(parameters.ParameterError, match=text):
        parameters.build(MonopulseParameters, values)


def test_a_conical_scan_has_no_faults_of_differences():
    rig = Rig(**SLOW, **{'feed.kind': 'conical_scan'})
    with pytest.raises(ValueError, match='phase_180: simulated I/Q of conical_scan has the faults fade'):
        rig.iq.execute(commands.Command('phase_180', 'test', '1'), {})
