"""Every figure and every printed number of the five papers: what is claimed, how it is read, which row measures it.

A number here stands in the row of a study; `reference` writes both beside each other into docs/papers.md.
"""
import typing


class Claim(typing.NamedTuple):
    """A claim of a paper and its reading; study, case and metric of the row that measures it, '' where it is no number
    of ours, as of a block diagram."""
    claim: str
    reading: str
    study: str = ''
    case: str = ''
    metric: str = ''


def _of(study, *claims):
    return tuple(Claim(claim, reading, study, *where) for claim, reading, *where in claims)


PAPER_000_CLAIMS = (
    Claim('figures 1 to 4: block diagrams, gear train, simulation model', 'built: graph.md, The chain; adu_drive'),
    Claim('table 1: 30 Nm, 1500 rpm, 4.7 kW; 1.736 and 1.731 ohm, 20.199 and 20.149 mH between the terminals',
          'half of each is that of a phase: defaults of `adu`'),
    *_of('servo', *(
        (claim, f'{reading}{gains}', case, metric)
        for case, gains in (('paper-all', ''), ('paper-r1', "; the scenario's gains"))
        for claim, reading, metric in (
            ('figure 5: overshoot 12 %', 'of a step of 0.174 rad', 'step_overshoot_percent'),
            ('settling 0.2 s', 'to 2 %', 'step_settling_2percent_s'),
            ('one oscillation', 'crossings of the final value', 'step_crossings'),
            ('figure 6: amplitude 0.869 of 0.87 rad', 'read as 0.4 Hz, fitted sine', 'sine_0p4hz_amplitude_rad'),
            ('peak error below 0.12 %', 'shortfall of the amplitude', 'sine_0p4hz_peak_error_percent'),
            ('largest tracking error 0.04 rad', 'steady sine', 'sine_0p4hz_max_error_rad'),
            ('largest error below 4.6 %', 'the same over the amplitude', 'sine_0p4hz_max_error_percent'),
            ('mean square error below 2.81 %', 'rms 0.0281 rad, neither squared nor relative',
             'sine_0p4hz_rms_error_rad')))),
    *_of('servo',
         ('figure 6: "0.4 rad/s"', 'read so, with gains for that sine: amplitude', 'paper-r2',
          'sine_0p4rads_amplitude_rad'),
         ('largest tracking error 0.04 rad', 'the same', 'paper-r2', 'sine_0p4rads_max_error_rad'),
         ('settling 0.2 s', 'the same gains: one controller cannot do both', 'paper-r2', 'step_settling_2percent_s')),
    *_of('scenarios',
         ('figures 7, 8: the filtered error is smooth (no number)', 'noise of a sample over that of the estimate, '
          'flight at 500 m, cross-elevation', 'uav_flyby', 'noise_reduction_cross_elevation'),
         ('figures 9, 10: the filtered position is smooth (no number)', 'the same, elevation', 'uav_flyby',
          'noise_reduction_elevation'),
         ('the same', 'at 60 m, cross-elevation', 'uav_flyby-60m', 'noise_reduction_cross_elevation'),
         ('the same', 'at 60 m, elevation', 'uav_flyby-60m', 'noise_reduction_elevation'),
         ('figure 11: azimuth of the flight (no number)', 'below; pointing error rms', 'uav_flyby',
          'pointing_rms_deg')),
    *_of('backlash',
         ('double-motor drive removes the backlash (no number)', 'standstill without bias', 'bias-off',
          'standstill_peak_to_peak_rad'),
         ('the same', 'standstill with 5 Nm', 'bias-on', 'standstill_peak_to_peak_rad'),
         ('the same', 'error of a reversal, without over with', 'bias-on', 'reversal_ratio_off_to_on'),
         ('one speed loop keeps the motors in step (no number)', 'fight torque at rest', 'mean-speed',
          'fight_torque_rms_nm'),
         ('the same', 'a speed loop for each motor', 'independent-loops', 'fight_torque_rms_nm')))

PAPER_001_CLAIMS = (
    Claim('figures 1, 2: block diagrams', 'built: ship_motion_sim/alignment'),
    Claim('34 deg north; 3, 3 and 180 deg misaligned', 'as printed'),
    Claim('gyros: drift 0.01 deg/h, random walk 0.005 deg/sqrt(h), scale 90 ppm', 'as printed'),
    Claim('accelerometers: 3e-5 g, 6e-6 g/sqrt(Hz), scale 70 ppm', 'as printed'),
    Claim('table 1: 5, 7, 9 deg at 0.5, 0.3, 0.2 Hz; white velocity 0.05 m/s', 'as printed; one value every 0.02 s'),
    Claim('h = 0.02 s, c0, r0, h0, beta, delta, r1, c1, h1 of the ADRC', 'level noise 16.6 arcmin with them; see the '
          'corrections'),
    *_of('alignment',
         ('figures 3, 4: classical, azimuth stable after 420 s', 'rms over the runs below 12 arcmin from then on',
          'classical', 'time_to_12arcmin_rms_s'),
         ('figures 3, 4: ADRC, azimuth stable after 250 s', 'the same', 'adrc', 'time_to_12arcmin_rms_s'),
         ('precision like the classical (no number)', 'azimuth after 600 s, classical', 'classical',
          'azimuth_rms_arcmin_600s'),
         ('the same', 'azimuth after 600 s, ADRC', 'adrc', 'azimuth_rms_arcmin_600s'),
         ('figure 4: level disturbed more than the classical (no number)', 'level, classical', 'classical',
          'level_rms_arcmin'),
         ('the same', 'level, ADRC', 'adrc', 'level_rms_arcmin')))

_STEP, _RAMP = 'step/alpha=0.1/T=10ms/{}', 'ramp/{}deg_s/T={}ms'
PAPER_002_CLAIMS = (
    Claim('figures 1, 2, 8: block diagrams', 'built: pedestal_studies/rigs/angle_loop.py'),
    Claim('(2): 8.4 Hz for n = 20, T = 1 ms', '1/((n - 1) T) is 8.38 Hz; the recursion is at -3 dB at 8.17 Hz'),
    *_of('phased-array',
         *((f'figure 3: overshoot about 20 %{of}', f'alpha 0.1, T = 10 ms, {smoothing}', _STEP.format(kind),
            'overshoot_percent') for of, smoothing, kind in (
                ('', 'no smoothing', 'S0'), ('', 'the recursion (1)', 'S1'), ('', 'a moving average', 'S2'))),
         ('figure 4: a shorter period overshoots more (no number)', 'T = 5 ms, the recursion',
          'step/alpha=0.1/T=5ms/S1', 'overshoot_percent'),
         ('figure 5: a long delay makes it unstable (no number)', 'largest stable delay, no smoothing',
          'delay-limit/alpha=0.1/T=10ms/S0', 'delay_ms'),
         ('the same', 'the recursion', 'delay-limit/alpha=0.1/T=10ms/S1', 'delay_ms'),
         ('figure 6, left: 0.3 deg at 30 deg/s and 10 ms', 'as the receiver reads it: v T', _RAMP.format(30, 10),
          'lag_deg'),
         ('figure 6, left: 0.15 deg at 5 ms', 'the same', _RAMP.format(30, 5), 'lag_deg'),
         *(('figure 6, right: v T of other rates (no number)', f'{rate} deg/s', _RAMP.format(rate, 10), 'lag_deg')
           for rate in (10, 20, 40)),
         ('figure 7: sine of 30 deg/s, 10 deg/s2, "about 0.3 deg"', 'the share of the acceleration, a T^2 / beta, is '
          'left out', 'sine', 'lag_deg'),
         ('figure 9: sway 10 deg in 8 s (no number)', 'without compensation', 'sway/delta=0', 'lag_deg'),
         ('figure 9: compensation 0.85 isolates greatly (no number)', 'with it', 'sway/delta=0.85', 'lag_deg'),
         ('lost when the lag passes half a beamwidth', "lag, in beamwidths, of a linear receiver's beam",
          'loss/half-beamwidth/type-1', 'linear_lag_beamwidths')))

PAPER_003_CLAIMS = (
    Claim('figures 1, 2, 5 to 7: block diagrams, test stand', 'built: pedestal_studies/rigs/feedforward_loop.py'),
    Claim('20 deg to and fro at 3.50 deg/s, as 30 m/s at 500 m', 'as printed; 3.44 deg/s'),
    *_of('manoeuvre',
         ('figure 3: rate, 50 runs: the stronger the manoeuvre, the larger the gap (no number)',
          'error of cv over that of the IMM, reversal of 4 s', 'reversal-4s/imm-b', 'rate_ratio_of_cv'),
         ('the same', 'reversal of 0.5 s', 'reversal-0.5s/imm-b', 'rate_ratio_of_cv'),
         ('figure 4: acceleration, the same', 'reversal of 4 s', 'reversal-4s/imm-b', 'acceleration_ratio_of_cv'),
         ('the same', 'reversal of 0.5 s', 'reversal-0.5s/imm-b', 'acceleration_ratio_of_cv')),
    *_of('imm-feedforward',
         ('figure 8: largest miss 0.17 deg (RMS), conventional, azimuth', 'rms over the whole motion',
          'azimuth/kalman-cv', 'miss_rms_deg'),
         ('figure 9: 0.035 deg, IMM', 'the same', 'azimuth/imm', 'miss_rms_deg'),
         ('4 to 5 x better', 'ratio in every run', 'azimuth/imm', 'miss_ratio_to_kalman_cv'),
         ('figure 10: 0.1 deg, conventional, elevation', 'rms over the whole motion', 'elevation/kalman-cv',
          'miss_rms_deg'),
         ('figure 11: 0.03 deg, IMM', 'the same', 'elevation/imm', 'miss_rms_deg'),
         ('3 x better', 'ratio in every run', 'elevation/imm', 'miss_ratio_to_kalman_cv'),
         ('more than 3 x better', 'through receiver, control unit and motors, azimuth', 'azimuth/drive-imm',
          'miss_ratio_to_kalman_cv'),
         ('the same', 'the same, elevation', 'elevation/drive-imm', 'miss_ratio_to_kalman_cv')))

PAPER_004_CLAIMS = (
    Claim('T = 0.01 s; begins with the measured angle and rate', 'as printed; noises and flight are ours'),
    *_of('telemetry-flight',
         *((f'figure{"s" if " " in numbers else ""} {numbers}: {axis}, {what} (no number)',
            f'what is measured over the estimate, rms{more}', f'{axis}/filtered', f'{quantity}_reduction')
           for axis, figures in (('azimuth', ('1, 2', '3', '4')), ('elevation', ('5, 6', '7', '8')))
           for numbers, what, quantity, more in zip(
               figures, ('measured and estimated', 'measured and estimated', 'estimated'),
               ('angle', 'rate', 'acceleration'), ('', '', ': the measured rate differenced over 0.2 s'))),
         ('controllable (no number)', 'rank', 'controllability', 'rank'),
         ('the same', 'condition, time in T', 'controllability', 'condition'),
         ('observable (no number)', 'rank, angle and rate measured', 'observability/angle-rate', 'rank'),
         ('the same', 'condition, time in T', 'observability/angle-rate', 'condition'),
         ('the same', 'condition with the angle alone', 'observability/angle', 'condition')),
    *_of('rate-measurement',
         ('the measured rate widens the band (no number)', 'bandwidth of the rate, with over without', 'position-rate',
          'rate_bandwidth_ratio'),
         ('it lessens the dynamic error (no number)', 'at 0.2 Hz, without over with', 'position-rate',
          'dynamic_error_ratio'),
         ('uniformly asymptotically stable (no number)', 'largest eigenvalue', 'position-rate',
          'largest_eigenvalue')))

CLAIMS_BY_PAPER = {'000': PAPER_000_CLAIMS, '001': PAPER_001_CLAIMS, '002': PAPER_002_CLAIMS, '003': PAPER_003_CLAIMS,
                   '004': PAPER_004_CLAIMS}
