"""Calibration matrix of a receiver of I/Q samples: ratios of samples with a known complex matrix, fit and intervals,
named faults, refusals, and the command line with simulated samples.
"""
import dataclasses
import json
import math

import numpy as np
import pytest

from pedestal import cli
from pedestal_bringup.scenario import files, scenario
from pedestal_common import parameters
from pedestal_hardware.monopulse import blocks, sigmf
from pedestal_hardware.monopulse.params import CHANNELS, MonopulseParameters
from pedestal_workbench.calibration.calibration import CalibrationError
from pedestal_workbench.calibration.receiver import complex_matrix, iq_phasing, matrix, ratios

CROSS_OFFSETS = np.array([(0.0, 0.0), *((r * s, 0.0) for r in (0.1, 0.2, 0.3) for s in (1, -1)),
                  *((0.0, r * s) for r in (0.1, 0.2, 0.3) for s in (1, -1))])
CIRCLE_OFFSETS = 0.2 * np.array([(math.cos(a), math.sin(a)) for a in np.arange(8) * math.pi / 4])
RATE, PERIOD, POINT_S = 1e4, 0.02, 1.0
FAULT_MATRICES = {'right': np.eye(2), 'exchanged': np.eye(2)[::-1], '180': -np.eye(2),
               'sign of elevation': np.diag((1.0, -1.0))}


def turned(angle):
    return np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))


def phased(x_phase, e_phase):
    return np.diag(np.exp(1j * np.array((x_phase, e_phase))))


def receiver(**values):
    return parameters.build(MonopulseParameters, {
        'source.rate': RATE, 'period': PERIOD, 'carrier.span': 8e3, 'carrier.bins': 1024,
        'receiver.acquire_level_dbhz': 30.0, 'receiver.lose_level_dbhz': 28.0, **values})


def samples_of(path, C, points, cn0_dbhz, seed, p):
    """Return (ratios.Samples, spans) of a recording with D = k_m C m S at points (n, 2) of POINT_S each, after 1 s on
    the beacon. The noise power of a sample is 1."""
    rng, before = np.random.default_rng(seed), round(1.0 / PERIOD) * p.block
    count = round(POINT_S * RATE)
    t = np.arange(before + len(points) * count) / RATE
    carrier = math.sqrt(10.0**(0.1 * cn0_dbhz) / RATE) * np.exp(1j * (2.0 * math.pi * (700.0 * t + 5.0 * t * t) + 0.4))
    ratio = np.repeat(np.vstack(((0.0, 0.0), points @ (p.antenna.slope * C).T)), [before, *[count] * len(points)],
                      axis=0)
    noise = rng.standard_normal((t.size, 6)).view(complex) * math.sqrt(0.5)
    made = carrier[:, np.newaxis] * np.column_stack((np.ones(t.size), ratio)) + noise
    epoch = 1_700_000_000 * blocks.NS_PER_SECOND
    recorder = sigmf.Recorder(path, RATE, CHANNELS, 'test')
    recorder.write(blocks.Chunk(made.astype(np.complex64), 0, epoch), True)
    recorder.close()
    begins = before / RATE + POINT_S * np.arange(len(points))
    return ratios.Samples(sigmf.Recording(path, CHANNELS), p, epoch), np.column_stack((begins, begins + POINT_S))


C_TRUE = 0.9 * phased(0.9, -1.2) @ turned(0.3)


@pytest.mark.parametrize('cn0_dbhz', [36.0, 46.0])
def test_the_ratios_of_noisy_samples_are_those_of_the_carrier(tmp_path, cn0_dbhz):
    """Sigma of a ratio: 1 / sqrt(2 C T) in real and imaginary part, with the loss of an integral of finite length.
    The mean over the seeds has no bias by the noise of the sum, which is 6 % of its power at 36 dB-Hz."""
    p, found = receiver(), []
    truth = CIRCLE_OFFSETS @ (p.antenna.slope * C_TRUE).T
    for seed in range(6):
        samples, spans = samples_of(tmp_path / f'{seed}.sigmf-meta', C_TRUE, CIRCLE_OFFSETS, cn0_dbhz, seed, p)
        found.append(ratios.at_points(samples, spans) - truth)
    error = np.array(found)
    C, T_c = 10.0**(0.1 * cn0_dbhz), PERIOD / p.receiver.samples_per_step
    # The noise of the sum adds the square of the ratio, about 0.3^2.
    sigma = math.sqrt((1.0 + 1.0 / (C * T_c)) / (2.0 * C * POINT_S))
    print(f'{cn0_dbhz:g} dB-Hz: sigma {error.real.std():.5f} and {error.imag.std():.5f}, law {sigma:.5f}')
    assert [error.real.std(), error.imag.std()] == pytest.approx([sigma, sigma], rel=0.2)
    # Along the ratio, so that a factor of the size would show: the 16 ratios of a seed have the size 0.2 k_m 0.9.
    along = (error * truth.conj() / np.abs(truth)).real
    assert abs(along.mean()) < 3.0 * sigma / math.sqrt(along.size)


@pytest.mark.parametrize('cn0_dbhz', [40.0, 56.0])
def test_the_matrix_of_samples_is_within_its_intervals(tmp_path, cn0_dbhz):
    p, inside, phases = receiver(), [], []
    M, m = np.linalg.inv(C_TRUE), np.vstack((CROSS_OFFSETS, CIRCLE_OFFSETS))
    for seed in range(6):
        samples, spans = samples_of(tmp_path / f'{seed}.sigmf-meta', C_TRUE, m, cn0_dbhz, seed, p)
        measured = ratios.at_points(samples, spans) / p.antenna.slope
        slopes = complex_matrix.fit(CROSS_OFFSETS, measured[:len(CROSS_OFFSETS)])
        half = complex_matrix.half_of_inverse(slopes)
        inside += [np.abs((slopes.matrix - M).real) <= half, np.abs((slopes.matrix - M).imag) <= half]
        phases.append(np.abs(np.angle(slopes.matrix / M)) / complex_matrix.phase_half(slopes.matrix, half))
        multiplied = (measured[len(CROSS_OFFSETS):] - slopes.null) @ slopes.matrix.T
        verified = matrix.verify(np.eye(2), np.zeros(2), CIRCLE_OFFSETS, multiplied.real)
        assert verified.error < (0.02 if cn0_dbhz > 50.0 else 0.15)
        assert complex_matrix.skew(multiplied, CIRCLE_OFFSETS) < (0.02 if cn0_dbhz > 50.0 else 0.15)
    print(f'{cn0_dbhz:g} dB-Hz: {np.mean(inside):.3f} of the elements and {np.mean(np.array(phases) <= 1.0):.3f} of '
          f'the phases within 95 %, largest phase error {np.max(phases):.2f} of half the interval')
    assert np.mean(inside) > 0.85 and np.mean(np.array(phases) <= 1.0) > 0.85
    assert np.max(phases) < 2.0


def test_the_intervals_hold_the_truth_in_95_percent():
    rng, inside, phases = np.random.default_rng(3), [], []
    M = np.linalg.inv(C_TRUE)
    size = np.maximum(np.hypot(*CROSS_OFFSETS.T), matrix.SMALLEST_OFFSET_BEAMWIDTHS)[:, np.newaxis]
    for _ in range(400):
        noise = 0.03 * size * rng.standard_normal((len(CROSS_OFFSETS), 4)).view(complex)
        slopes = complex_matrix.fit(CROSS_OFFSETS, CROSS_OFFSETS @ C_TRUE.T + (0.01 + 0.02j) + noise)
        half = complex_matrix.half_of_inverse(slopes)
        inside += [np.abs((slopes.C - C_TRUE).real) <= slopes.half, np.abs((slopes.C - C_TRUE).imag) <= slopes.half,
                   np.abs((slopes.matrix - M).real) <= half, np.abs((slopes.matrix - M).imag) <= half]
        phases.append(np.abs(np.angle(slopes.matrix / M)) <= complex_matrix.phase_half(slopes.matrix, half))
    assert 0.93 < np.mean(inside) < 0.97 and 0.93 < np.mean(phases) < 0.97
    exact = complex_matrix.fit(CROSS_OFFSETS, CROSS_OFFSETS @ C_TRUE.T + (0.01 + 0.02j))
    np.testing.assert_allclose(exact.matrix, M, atol=1e-12)
    np.testing.assert_allclose(exact.null, 0.01 + 0.02j, atol=1e-12)


@pytest.mark.parametrize('name, words', [
    ('right', []), ('exchanged', ['exchanged channels']), ('180', ['180 deg: both slopes']),
    ('sign of elevation', ['reversed sign: the slope of elevation'])])
@pytest.mark.parametrize('angle_deg', [0.0, 25.0])
@pytest.mark.parametrize('phase_deg', [0.0, 40.0])
def test_each_fault_has_its_name(name, words, angle_deg, phase_deg):
    C = phased(math.radians(phase_deg), 0.0) @ FAULT_MATRICES[name] @ turned(math.radians(angle_deg))
    slopes = complex_matrix.fit(CROSS_OFFSETS, CROSS_OFFSETS @ C.T)
    # The first channel, whose phase is off, contains the elevation if the channels are exchanged.
    axis = 'elevation' if name == 'exchanged' else 'cross-elevation'
    expected = words + [f'phase off: the phase of the {axis} difference'] * bool(phase_deg)
    expected += ['turned axes'] * bool(angle_deg)
    said = complex_matrix.faults(slopes, np.eye(2))
    assert len(said) == len(expected) and all(any(word in sentence for sentence in said) for word in expected), said
    # The matrix that corrects all of these leaves none.
    assert complex_matrix.faults(slopes, slopes.matrix) == []


def test_weak_slopes_and_channels_without_signal_are_named():
    weak = complex_matrix.fit(CROSS_OFFSETS, CROSS_OFFSETS @ (0.3 * phased(0.0, 0.0)))
    assert ['weak slope: the mean slope is 0.30 k_m' in sentence for sentence in
            complex_matrix.faults(weak, np.eye(2))] == [True]
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.standard_normal((len(CROSS_OFFSETS), 4)).view(complex)
    for C in (np.zeros((2, 2)), np.array(((1.0, 0.5), (1.0, 0.5)))):
        with pytest.raises(CalibrationError, match='hardly follow the offsets'):
            complex_matrix.fit(CROSS_OFFSETS, CROSS_OFFSETS @ C.T + noise)
    with pytest.raises(CalibrationError, match='on one line'):
        complex_matrix.fit(CROSS_OFFSETS[:7], CROSS_OFFSETS[:7] @ C_TRUE.T)


def test_points_without_samples_and_without_lock_are_refused(tmp_path):
    p = receiver()
    samples, spans = samples_of(tmp_path / 'a.sigmf-meta', C_TRUE, CIRCLE_OFFSETS, 50.0, 0, p)
    later = dataclasses.replace(samples, epoch=samples.epoch - 3 * blocks.NS_PER_SECOND)
    with pytest.raises(CalibrationError, match=r'samples are missing at 1.0 to 2.0 s: .*a.sigmf-meta holds samples '
                       r'from 2023-11-14T22:13:20.010000000Z to .*time 0 of the recording is 2023-11-14T22:13:17'):
        ratios.at_points(later, spans)
    samples, spans = samples_of(tmp_path / 'b.sigmf-meta', C_TRUE, CIRCLE_OFFSETS, 20.0, 0, p)
    with pytest.raises(CalibrationError, match='receiver not locked at 1.0 to 2.0 s: 5[0-9] of 5'):
        ratios.at_points(samples, spans)


COUPLING_RAD = 0.3, 0.9, -1.2
"""Cross-coupling, phase of the cross-elevation and of the elevation channel of the simulated receiver [rad]."""
RUN = ('--scenario', 'receiver_phasing', *(part for change in (
    'tracking_receiver.source.rate=2e4', 'adu.period=0.01', 'tracking_receiver.carrier.bins=1024',
    'tracking_receiver.simulated.offset=3000', f'tracking_receiver.antenna.cross_coupling={COUPLING_RAD[0]}',
    f'tracking_receiver.simulated.x_phase={COUPLING_RAD[1]}', f'tracking_receiver.simulated.e_phase={COUPLING_RAD[2]}')
    for part in ('--param', change)))


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Path of the samples of the scenario receiver_phasing."""
    path = tmp_path_factory.mktemp('iq') / 'phasing.sigmf-meta'
    assert cli.main(['simulate', 'receiver', *RUN, '--output', str(path)]) == 0
    return path


def calibrated(capfd, file, *arguments):
    """Return (exit code, content of --json, what the verb complained) of the verb with these samples."""
    capfd.readouterr()
    code = cli.main(['calibrate', 'receiver', *RUN, '--iq', str(file), *arguments, '--json', '-'])
    said = capfd.readouterr()
    return code, json.loads(said.out) if said.out else None, said.err


def test_the_command_line_finds_phases_and_coupling(recorded, capfd, tmp_path):
    """The second call uses the first result, so its matrix in force holds."""
    output, page = tmp_path / 'matrix.yaml', tmp_path / 'page.html'
    code, content, _ = calibrated(capfd, recorded, '--output', str(output), '--report', str(page))
    rows = {row['metric']: row for row in content['rows']}
    # D / S has 5 % more slope at 0.33 beamwidths than on the axis (receiver_law.monopulse).
    M = np.linalg.inv(1.02 * phased(*COUPLING_RAD[1:]) @ turned(COUPLING_RAD[0]))
    for i, names in enumerate(iq_phasing.ELEMENT_NAMES):
        for j, name in enumerate(names):
            phase, gain = rows[f'{name}_phase'], rows[f'{name}_gain']['value']
            assert gain == pytest.approx(abs(M[i, j]), abs=0.02)
            half = phase['ci_high'] - phase['value']
            assert abs(math.remainder(phase['value'] - np.angle(M[i, j]), 2.0 * math.pi)) < half < 0.05
    value = {name: row['value'] for name, row in rows.items()}
    print({name: round(number, 2) for name, number in value.items() if 'circle' in name or 'talk' in name})
    assert code == 0 and value['circle_error_percent'] < 5.0 and value['cross_talk_db'] < -20.0
    assert value['circle_error_before_percent'] > 50.0 and value['cross_talk_before_db'] > -12.0
    assert value['skew_before_percent'] > 50.0 and value['skew_percent'] < 5.0
    assert [any(word in sentence for sentence in content['faults']) for word in (
        'cross-elevation difference is off by 51', 'elevation difference is off by -6', 'turned by 17')] == [True] * 3
    assert 'Ratios of difference and sum' in page.read_text() and '<svg' in page.read_text()
    code, content, _ = calibrated(capfd, recorded, '--params-file', str(output))
    second = {row['metric']: row['value'] for row in content['rows']}
    assert code == 0 and content['faults'] == [] and second['circle_error_before_percent'] < 5.0
    assert second['skew_before_percent'] < 5.0 and second['cross_talk_before_db'] < -20.0
    chosen = scenario.load('leo_pass', ['scenario.receiver=simulated-iq', *files.file_overrides(output)],
                           pacing='realtime')
    in_force = np.array(chosen.node_parameters('tracking_receiver').calibration.matrix)
    np.testing.assert_allclose(in_force, M, atol=0.02)
    assert chosen.node_parameters('acu').tracker.receiver.slope == pytest.approx(1.6 * 1.02, rel=0.01)


def test_samples_of_another_time_and_wrong_options_are_named(recorded, capfd, tmp_path):
    moved = tmp_path / 'moved.sigmf-meta'
    moved.write_text(recorded.read_text().replace('1969-12-31T23:59:59', '2019-12-10T12:00:00'))
    moved.with_suffix('.sigmf-data').symlink_to(recorded.with_suffix('.sigmf-data'))
    code, _, said = calibrated(capfd, moved)
    assert code == 2 and 'holds samples from 2019-12-10' in said and 'must be of the same run' in said
    code, _, said = calibrated(capfd, recorded, '--param', 'tracking_receiver.source.rate=4e4')
    assert code == 1 and 'must be 40000 S/s (source.rate)' in said
    code, _, said = calibrated(capfd, tmp_path / 'none.sigmf-meta')
    assert code == 1 and 'none.sigmf-meta: No such file' in said
