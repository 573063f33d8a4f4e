"""Beam cut and G/T: against a computed beam and disk, an antenna of known G/T, and the simulated receiver."""
import csv
import json
import math

import numpy as np
import pytest
from scipy.integrate import dblquad

from pedestal import cli
from pedestal_bringup.loop import memory_recording
from pedestal_bringup.scenario import files, scenario
from pedestal_workbench.calibration.sensitivity import beam, levels, sensitivity

G_OVER_T_DB_K, FLUX_SFU, FREQUENCY_GHZ, DIAMETER_DEG = 31.0, 300.0, 8.5, 0.53
"""An antenna of 7 m at X band, and the quiet sun."""
WIDTH, PLACE = np.array((0.36, 0.34)), np.array((0.02, -0.03))


def measured(noise, seed=0, diameter=DIAMETER_DEG, width=WIDTH):
    """Return rows (xel, el, level [dB]) of a raster and of four levels off the source, with a relative noise."""
    rng = np.random.default_rng(seed)
    grid = np.arange(-4, 5) * 0.16
    offsets = np.array([(x, y) for x in grid for y in grid] + [(6.0, 0.0), (-6.0, 0.0), (0.0, 6.0), (0.0, -6.0)])
    S, wavelength = FLUX_SFU * 1e-22, 299_792_458.0 / (1e9 * FREQUENCY_GHZ)
    # (Y - 1) of a point source: half of the flux is received by the area G lambda^2 / (4 pi).
    excess = 10.0**(0.1 * G_OVER_T_DB_K) * wavelength**2 / (4.0 * math.pi) * 0.5 * S / 1.380649e-23
    power = 1.0 + excess * beam.pattern(offsets, PLACE, width, beam.disk(diameter))
    power *= 1.0 + noise * rng.normal(size=power.size)
    return np.column_stack((offsets, 10.0 * np.log10(power) - 73.0))


def write(path, rows, head=('cross_elevation_deg', 'elevation_deg', 'level_db')):
    with open(path, 'w', newline='') as file:
        csv.writer(file).writerows([head, *rows.tolist()])
    return str(path)


def values(content):
    return {row['metric']: row['value'] for row in content['rows']}


@pytest.mark.parametrize('ratio', [0.3, 1.0, 1.6])
def test_the_size_correction_is_that_of_an_integral(ratio):
    """A disk in a Gaussian beam: L = x / (1 - exp(-x)), x = ln 2 (W / b)^2; S.733 for small disks."""
    b, W = 0.36, 0.36 * ratio
    points = beam.disk(W)
    ours = 1.0 / beam.pattern(np.zeros((1, 2)), np.zeros(2), (b, b), points)[0]
    x = math.log(2.0) * ratio**2
    assert ours == pytest.approx(x / -math.expm1(-x), rel=2e-3)
    if ratio < 0.5:
        assert ours == pytest.approx(1.0 + 0.38 * ratio**2, rel=5e-3)
    off = np.array((0.3, 0.1))

    def received(phi, r):
        dx, dy = off[0] - r * math.cos(phi), off[1] - r * math.sin(phi)
        return r * math.exp(-4.0 * math.log(2.0) * (dx * dx + dy * dy) / b**2)

    whole = dblquad(received, 0.0, 0.5 * W, 0.0, 2.0 * math.pi)[0] / (math.pi * 0.25 * W * W)
    assert beam.pattern(off[np.newaxis], np.zeros(2), (b, b), points)[0] == pytest.approx(whole, rel=0.01)


def test_the_verb_finds_beamwidth_squint_and_g_over_t(tmp_path, capfd):
    file = write(tmp_path / 'sun.csv', measured(0.01))
    given = ['calibrate', 'sensitivity', '--levels', file, '--flux', str(FLUX_SFU), '--frequency', str(FREQUENCY_GHZ)]
    output, page = tmp_path / 'beam.yaml', tmp_path / 'page.html'
    assert cli.main([*given, '--json', '-', '--output', str(output), '--report', str(page)]) == 0
    found = values(json.loads(capfd.readouterr().out))
    assert found['g_over_t_db_k'] == pytest.approx(G_OVER_T_DB_K, abs=0.1)
    assert found['beamwidth_cross_elevation_deg'] == pytest.approx(WIDTH[0], abs=0.005)
    assert found['beamwidth_elevation_deg'] == pytest.approx(WIDTH[1], abs=0.005)
    assert found['peak_cross_elevation_deg'] == pytest.approx(PLACE[0], abs=0.003)
    assert found['peak_elevation_deg'] == pytest.approx(PLACE[1], abs=0.003)
    acu = scenario.load('leo_pass', files.file_overrides(output)).node_parameters('acu')
    assert acu.tracker.receiver.beamwidth == pytest.approx(math.radians(math.sqrt(WIDTH.prod())), rel=0.01)
    assert page.read_text().count('<svg') == 1
    assert cli.main([*given, '--attenuation', '0.5', '--json', '-']) == 0
    assert values(json.loads(capfd.readouterr().out))['g_over_t_db_k'] == pytest.approx(
        found['g_over_t_db_k'] + 0.5, abs=1e-6)


def test_the_intervals_hold_the_truth(tmp_path):
    """In 95 % of 30 noisy rasters, within the spread of such a share."""
    inside, options = [], sensitivity.SensitivityOptions(flux=FLUX_SFU, frequency=FREQUENCY_GHZ)
    for seed in range(30):
        found = sensitivity.calibrate(levels.read(write(tmp_path / 'x.csv', measured(0.02, seed))), options)
        rows = {row['metric']: row for row in found.rows()}
        inside.append([rows[name]['ci_low'] < true < rows[name]['ci_high'] for name, true in (
            ('beamwidth_elevation_deg', WIDTH[1]), ('peak_cross_elevation_deg', PLACE[0]),
            ('g_over_t_db_k', G_OVER_T_DB_K))])
    share = np.mean(inside, axis=0)
    print(f'truth inside the interval: beamwidth {share[0]:.2f}, peak {share[1]:.2f}, G/T {share[2]:.2f}')
    assert (share > 0.85).all()


def test_offsets_in_azimuth_shrink_with_the_elevation(tmp_path, capfd):
    rows = measured(0.0)
    plain = write(tmp_path / 'plain.csv', rows)
    rows[:, 0] /= math.cos(math.radians(40.0))
    turned = write(tmp_path / 'azimuth.csv', rows, ('az_deg', 'el_deg', 'level_db'))
    found = []
    for given in (['--levels', plain], ['--levels', turned, '--elevation', '40']):
        assert cli.main(['calibrate', 'sensitivity', *given, '--diameter', '0.53', '--json', '-']) == 0
        found.append(values(json.loads(capfd.readouterr().out)))
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert cli.main(['calibrate', 'sensitivity', '--levels', turned]) == 2
    assert '--elevation must state the elevation' in capfd.readouterr().err


@pytest.mark.parametrize('change, given, message', [
    (lambda rows: rows[:6], [], 'must be at least 7'),
    (lambda rows: rows[:-4], [], 'no level off the source'),
    (lambda rows: rows[rows[:, 0] > 0.1], [], 'at the edge of the scanned area'),
    (lambda rows: rows * (1.0, 1.0, math.nan), [], 'line 2: level_db = nan'),
    (lambda rows: rows * (1.0, 1.0, 0.0), [], 'Y factor 0 dB'),
    (lambda rows: rows, ['--flux', '300'], 'G/T needs both'),
    (lambda rows: rows, ['--flux', '-3', '--frequency', '8'], '--flux -3: must be 1 to 1e'),
    (lambda rows: rows, ['--flux', 'nan', '--frequency', '8'], '--flux nan: must be 1 to 1e'),
    (lambda rows: rows, ['--attenuation', '0.3'], '--attenuation: has no effect without --flux'),
    (lambda rows: rows, ['--bandwidth', '1e6'], '--bandwidth: has no effect without --bag'),
    (lambda rows: rows, ['--elevation', '40'], '--elevation: has no effect, because the offsets are in cross-elevation'
     )])
def test_bad_input_is_refused(tmp_path, capfd, change, given, message):
    file = write(tmp_path / 'bad.csv', change(measured(0.0)))
    assert cli.main(['calibrate', 'sensitivity', '--levels', file, '--diameter', '0.53', *given]) == 2
    error = capfd.readouterr().err
    assert message in error


def test_a_source_of_unknown_size_is_refused(tmp_path, capfd):
    """As a point the sun would make the beam half as wide again."""
    file = write(tmp_path / 'sun.csv', measured(0.0))
    assert cli.main(['calibrate', 'sensitivity', '--levels', file]) == 2
    assert '--diameter: is needed without --flux' in capfd.readouterr().err


@pytest.mark.parametrize('names, separator, point', [
    (('Cross-Elevation [deg]', 'Elevation [deg]', 'Level [dB]'), ';', ','),
    (('xel_deg', 'el_deg', 'Level_dB'), '\t', '.')])
def test_levels_are_read_in_each_dialect(tmp_path, names, separator, point):
    rows, file = measured(0.0), tmp_path / 'levels.csv'
    lines = [separator.join(names), *(separator.join(f'{value:.6f}' for value in row).replace('.', point)
                                      for row in rows)]
    file.write_text('\n'.join(lines))
    found = levels.read(file)
    np.testing.assert_allclose(np.column_stack((found.offsets, 10.0 * np.log10(found.power))), rows, atol=1e-5)


def test_the_beam_of_the_simulated_receiver():
    """A raster about a beacon: beamwidth and boresight of the parameters. The pattern is no Gaussian: 2 %."""
    step, width, boresight = 0.005, 0.0175, (1.5e-3, -1.0e-3)
    grid = step * np.arange(-2, 3)
    commands = '; '.join(f'{4.0 + 1.6 * k:.1f} offset azimuth={x / math.cos(0.6):.6f} elevation={y:.6f}'
                         for k, (x, y) in enumerate((x, y) for x in grid for y in grid))
    chosen = scenario.load('geo_station', (
        'tracking_receiver.target.kind=sine', 'tracking_receiver.target.angle.azimuth_amplitude=0',
        'tracking_receiver.target.angle.elevation_amplitude=0', 'tracking_receiver.receiver.range_exponent=0',
        'scenario.program.azimuth_offset=0', 'scenario.program.elevation_offset=0', 'acu.tracker.handover=false',
        'adu.initial_azimuth=0', 'adu.initial_elevation=0.6', f'acu.commands={commands}',
        'tracking_receiver.receiver.cn0_dbhz=60',
        f'tracking_receiver.antenna.boresight_cross_elevation={boresight[0]}',
        f'tracking_receiver.antenna.boresight_elevation={boresight[1]}'), duration=45.0)
    found = sensitivity.calibrate(levels.of_recording(memory_recording.record(chosen), 'raster'),
                                  sensitivity.SensitivityOptions())
    print(found.lines())
    made = found.parameters()
    assert made['tracking_receiver']['antenna.beamwidth'] == pytest.approx(width, rel=0.02)
    assert made['acu']['tracker.receiver.beamwidth'] == made['tracking_receiver']['antenna.beamwidth']
    # The sum and the differences of the simulated receiver have the same axis, at -boresight from the source.
    np.testing.assert_allclose(np.radians(found.beam.place), (-boresight[0], -boresight[1]), atol=1.5e-4)
    np.testing.assert_allclose(found.null, found.beam.place, atol=0.01)
