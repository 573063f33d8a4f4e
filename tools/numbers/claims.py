"""Claims of the five papers: every figure and every printed number, its reading, and the row that measures it.

A reading states how we interpret the claim, and under which conditions we measure it. The measured numbers are in the
rows of the studies. A verdict states in words whether the claim holds. tools/reference.py writes claims, numbers and
verdicts side by side into docs/reference/papers.md.
"""
import typing
from collections.abc import Sequence

from pedestal_studies.p000_ma.filter_families import FILTER_MEANINGS


class Claim(typing.NamedTuple):
    """A claim of a paper and its reading, with study, case and metric of the row that measures it, and a verdict.

    The three names are empty for a claim without a row, such as a block diagram. The reading of such a claim states
    our number where a short computation gives it; test_claims.py computes it again. The verdict is empty for a claim
    that cannot be right or wrong, and for a number to which another row of the same claim is compared.
    """
    claim: str
    reading: str
    study: str = ''
    case: str = ''
    metric: str = ''
    verdict: str = ''


def _of(study: str, *claims: Sequence[str]) -> tuple[Claim, ...]:
    """Return the Claims that one study measures; claims: tuples (claim, reading, case, metric, verdict if any)."""
    return tuple(Claim(claim, reading, study, *where) for claim, reading, *where in claims)


MA_CLAIMS = (
    Claim('figures 1 to 4: block diagrams, gear train, simulation model',
          'implemented: the chain of the nodes; package adu_drive'),
    Claim('table 1: 30 Nm, 1500 rpm, 4.7 kW; 1.736 and 1.731 ohm, 20.199 and 20.149 mH between the terminals',
          'a phase has half of each: defaults of `adu`'),
    Claim('the motors differ by less than 0.5 %',
          'table 1 and the defaults of `adu`: 0.29 % in resistance, 0.25 % in inductance', verdict='holds'),
    Claim('two motors stiffen the drive (no number)', 'torque on the load, 100 Nm, divided by its deflection against '
          'the motors: 9.97e+06 Nm/rad with a bias torque of 12 Nm, twice the 5e+06 Nm/rad of one mesh; 6.7e+05 '
          'Nm/rad without bias torque', verdict='holds with a bias torque, not without'),
    Claim('figure 6: the output has the period of the input, "0.4 rad/s"', 'fitted period of the load: 2.5000 s of '
          '2.5 s for 0.4 Hz (paper-all, paper-r1); 15.708 s of 15.708 s for 0.4 rad/s (paper-r2)',
          verdict='holds for both readings of "0.4 rad/s"'),
    *_of('filter-families', *(
        ('introduction: the Kalman filter has a better effect than least squares, alpha-beta, alpha-beta-gamma and '
         'Wiener filter (no number)', f'error of {FILTER_MEANINGS[name]} divided by error of the Kalman filter, {how}',
         f'all/{name}/{tuning}', 'angle_ratio_to_kalman', verdict)
        for tuning, how, verdicts in (
            ('own-tuning', 'each tuned for each of four motions',
             {'least_squares': 'holds', 'alpha_beta': 'holds', 'alpha_beta_gamma': 'not reproduced: equal within 1 %',
              'wiener': 'not reproduced: equal within 1 %'}),
            ('one-tuning', 'each with one tuning for all four motions',
             {'least_squares': 'holds', 'alpha_beta': 'holds', 'alpha_beta_gamma': 'not reproduced: equal within 1 %',
              'wiener': 'not reproduced: the Wiener filter is 2 % better',
              'imm': 'our IMM of Kalman filters is better than all of them'}))
        for name, verdict in verdicts.items())),
    *_of('servo', *(
        (claim, f'{reading}{gains}', case, metric,
         'not reproduced with these gains' if (case, metric) == ('paper-r1', 'sine_0p4hz_peak_error_percent')
         else 'reproduced')
        for case, gains in (('paper-all', ''), ('paper-r1', "; the scenario's gains"))
        for claim, reading, metric in (
            ('figure 5: overshoot 12 %', 'step of 0.174 rad', 'step_overshoot_percent'),
            ('figure 5: settling time 0.2 s', 'within 2 % of the step', 'step_settling_2percent_s'),
            ('figure 5: one oscillation', 'crossings of the final value', 'step_crossings'),
            ('figure 6: amplitude 0.869 of 0.87 rad', 'amplitude of a fitted sine of 0.4 Hz',
             'sine_0p4hz_amplitude_rad'),
            ('figure 6: peak error below 0.12 %', 'shortfall of the amplitude, sine of 0.4 Hz',
             'sine_0p4hz_peak_error_percent'),
            ('figure 6: largest tracking error 0.04 rad', 'after the first period, sine of 0.4 Hz',
             'sine_0p4hz_max_error_rad'),
            ('figure 6: largest error below 4.6 %', 'largest tracking error divided by the amplitude',
             'sine_0p4hz_max_error_percent'),
            ('figure 6: mean square error below 2.81 %', 'rms 0.0281 rad, neither squared nor relative',
             'sine_0p4hz_rms_error_rad')))),
    *_of('servo',
         ('figure 6: amplitude 0.869 of 0.87 rad, "0.4 rad/s"', 'sine of 0.4 rad/s, with gains for this sine',
          'paper-r2', 'sine_0p4rads_amplitude_rad', 'reproduced'),
         ('figure 6: largest tracking error 0.04 rad', 'sine of 0.4 rad/s, with gains for this sine', 'paper-r2',
          'sine_0p4rads_max_error_rad', 'reproduced'),
         ('figure 5: settling time 0.2 s', 'within 2 % of the step; the gains for the sine of 0.4 rad/s',
          'paper-r2', 'step_settling_2percent_s', 'not reproduced together with the sine of 0.4 rad/s')),
    *_of('scenarios',
         ('figures 7, 8: the filtered error is smooth (no number)', 'noise of a sample divided by noise of the '
          'estimate, cross-elevation, flyby at 500 m', 'uav_flyby', 'noise_reduction_cross_elevation', 'holds'),
         ('figures 9, 10: the filtered position is smooth (no number)', 'noise of a sample divided by noise of '
          'the estimate, elevation, flyby at 500 m', 'uav_flyby', 'noise_reduction_elevation', 'holds'),
         ('figures 7, 8: the filtered error is smooth (no number)', 'the same ratio at 60 m, cross-elevation',
          'uav_flyby-60m', 'noise_reduction_cross_elevation', 'holds'),
         ('figures 9, 10: the filtered position is smooth (no number)', 'the same ratio at 60 m, elevation',
          'uav_flyby-60m', 'noise_reduction_elevation', 'holds'),
         ('figure 11: azimuth of the flight (no number)', 'rms of the pointing error; the figure follows this table',
          'uav_flyby', 'pointing_rms_deg')),
    *_of('backlash',
         ('the dual-motor drive removes the backlash (no number)', 'peak to peak at standstill, without bias torque',
          'bias-off', 'standstill_peak_to_peak_rad'),
         ('the dual-motor drive removes the backlash (no number)', 'peak to peak at standstill, bias torque 5 Nm',
          'bias-on', 'standstill_peak_to_peak_rad', 'holds'),
         ('the dual-motor drive removes the backlash (no number)', 'error of a reversal without bias torque, '
          'divided by the error with 5 Nm', 'bias-on', 'reversal_ratio_off_to_on', 'holds'),
         ('one speed loop keeps the motors in step (no number)', 'opposing torque at rest, one speed loop',
          'mean-speed', 'fight_torque_rms_nm', 'holds'),
         ('one speed loop keeps the motors in step (no number)', 'opposing torque at rest, a speed loop for each '
          'motor', 'independent-loops', 'fight_torque_rms_nm')))

ZHOU_YANG_QIN_CLAIMS = (
    Claim('figures 1, 2: block diagrams', 'implemented: p001_zhou_yang_qin/adrc.py'),
    Claim('latitude 34 deg north; misalignment 3, 3 and 180 deg', 'as printed'),
    Claim('longitude 108 deg, height 450 m', 'no law of an alignment contains the longitude; gravity is that of the '
          'ellipsoid, 9.7965 m/s2, and 450 m lessen it by 0.0014 m/s2, or 0.014 % of the level limit',
          verdict='without effect'),
    Claim('limit of the level: grad / g', 'bias 3e-5 g: 0.103 arcmin; mean of 550 to 600 s without noise about east: '
          '0.102 arcmin, classical method and ADRC', verdict='holds'),
    Claim('limit of the azimuth: eps / w_N, equal for both methods', 'drift 0.01 deg/h: 2.757 arcmin; mean of 550 to '
          '600 s without noise: 2.66 arcmin, classical method; 2.71 arcmin, ADRC', verdict='holds'),
    Claim('gyros: drift 0.01 deg/h, random walk 0.005 deg/sqrt(h), scale 90 ppm', 'as printed'),
    Claim('accelerometers: bias 3e-5 g, noise 6e-6 g/sqrt(Hz), scale 70 ppm', 'as printed'),
    Claim('table 1: sway 5, 7, 9 deg at 0.5, 0.3, 0.2 Hz; white velocity 0.05 m/s',
          'as printed; one value of the velocity every 0.02 s'),
    Claim('h = 0.02 s, c0, r0, h0, beta, delta, r1, c1, h1 of the ADRC', 'h as printed; the gains are ours, because '
          'the printed gains give a level noise of 16.6 arcmin (see the corrections)',
          verdict='not reproduced with the printed gains'),
    *_of('alignment',
         ('figures 3, 4: classical method, azimuth stable after 420 s', 'time after which the rms over the runs stays '
          'below 12 arcmin', 'classical', 'time_to_12arcmin_rms_s', 'reproduced within 3 %'),
         ('figures 3, 4: ADRC, azimuth stable after 250 s', 'time after which the rms over the runs stays below 12 '
          'arcmin', 'adrc', 'time_to_12arcmin_rms_s', 'reproduced within 6 %'),
         ('precision of the ADRC equal to the classical method (no number)', 'azimuth after 600 s, classical method',
          'classical', 'azimuth_rms_arcmin_600s'),
         ('precision of the ADRC equal to the classical method (no number)', 'azimuth after 600 s, ADRC', 'adrc',
          'azimuth_rms_arcmin_600s', 'not reproduced: the azimuth of the ADRC is twice as precise'),
         ('figure 4: ADRC disturbs the level more than the classical method (no number)', 'level, classical method',
          'classical', 'level_rms_arcmin'),
         ('figure 4: ADRC disturbs the level more than the classical method (no number)', 'level, ADRC', 'adrc',
          'level_rms_arcmin', 'holds')),
    *_of('alignment-speed', *(
        (f'section 6: {claim} (no number)', f'{reading}, all times of the ADRC divided by {speed}', f'adrc/{speed}',
         metric, verdict if speed == '4' else '')
        for claim, reading, metric, verdict in (
            ('other parameters level faster', 'time after which the rms of the level stays below 30 arcmin',
             'level_settling_s', 'holds'),
            ('faster levelling shortens the alignment of the azimuth', 'time after which the rms of the azimuth stays '
             'below 12 arcmin', 'time_to_12arcmin_rms_s', 'not reproduced: no trend over the factors 0.5 to 4'),
            ('faster levelling shortens the alignment of the azimuth', 'azimuth after 100 s',
             'azimuth_rms_arcmin_100s', 'holds for the first minutes'),
            ('faster is less precise', 'level after 300 s', 'level_rms_arcmin', 'holds for the level'),
            ('faster is less precise', 'azimuth after 600 s', 'azimuth_rms_arcmin_600s',
             'not reproduced for the azimuth: equal within the intervals'))
        for speed in ('1', '4'))))

_STEP, _RAMP = 'step/alpha=0.1/T=10ms/{}', 'ramp/{}deg_s/T={}ms'
JIA_CLAIMS = (
    Claim('figures 1, 2, 8: block diagrams', 'implemented: pedestal_studies/p002_jia/angle_loop.py'),
    Claim('(2): bandwidth 8.4 Hz for n = 20, T = 1 ms',
          '1/((n - 1) T) is 8.38 Hz; the recursion has its -3 dB at 8.17 Hz', verdict='reproduced'),
    *_of('phased-array',
         *(('figure 3: overshoot about 20 %', f'alpha 0.1, T = 10 ms, {smoothing}', _STEP.format(kind),
            'overshoot_percent', verdict) for smoothing, kind, verdict in (
                ('no smoothing', 'S0', 'reproduced'), ('the recursion (1)', 'S1', 'not reproduced'),
                ('a moving average', 'S2', 'reproduced'))),
         *((f'figure 3: {claim} (no number)', f'{quantity}, alpha {alpha}, T = 10 ms, the recursion (1)',
            case.format(alpha), metric, verdict if alpha == '0.3' else '')
           for claim, quantity, case, metric, verdict in (
               ('a larger alpha responds faster', 'time to 90 % of the step', 'step/alpha={}/T=10ms/S1',
                'rise_90percent_s', 'holds'),
               ('a faster response lets in more noise', 'motion of the beam by 0.05 deg of noise in each millisecond',
                'noise/alpha={}', 'jitter_rms_deg', 'holds'))
           for alpha in ('0.05', '0.3')),
         *((f'figure 4: {claim} (no number)', f'{quantity}, alpha 0.1, T = {period} ms, the recursion (1)',
            f'step/alpha=0.1/T={period}ms/S1', metric, verdict if period == 5 else '')
           for claim, quantity, metric, verdict in (
               ('a shorter period responds faster', 'time to 90 % of the step', 'rise_90percent_s', 'holds'),
               ('a shorter period oscillates more often', 'crossings of the target beyond 0.5 % of the step',
                'crossings', 'not reproduced: equally often'))
           for period in (10, 5)),
         ('figure 4: a shorter period overshoots more (no number)', 'alpha 0.1, T = 5 ms, the recursion (1)',
          'step/alpha=0.1/T=5ms/S1', 'overshoot_percent', 'holds with smoothing, not without'),
         *(('figure 5: a delay within limits has little effect (no number)', f'{quantity}, no smoothing, {text}',
            f'step/alpha=0.1/T=10ms/S0{case}', metric, verdict if case else '')
           for quantity, metric, verdict in (
               ('time to 90 % of the step', 'rise_90percent_s', 'holds for the speed'),
               ('overshoot', 'overshoot_percent', 'not reproduced: 20 ms add a third of the overshoot'))
           for text, case in (('without delay', ''), ('delay 20 ms', '/delay=20ms'))),
         ('figure 5: a long delay makes the loop unstable (no number)', 'largest stable delay, no smoothing',
          'delay-limit/alpha=0.1/T=10ms/S0', 'delay_ms', 'holds'),
         ('figure 5: a long delay makes the loop unstable (no number)', 'largest stable delay, the recursion (1)',
          'delay-limit/alpha=0.1/T=10ms/S1', 'delay_ms', 'holds'),
         ('figure 6, left: 0.3 deg at 30 deg/s and 10 ms', 'error that the receiver measures: v T',
          _RAMP.format(30, 10), 'lag_deg', 'reproduced'),
         ('figure 6, left: 0.15 deg at 30 deg/s and 5 ms', 'error that the receiver measures: v T',
          _RAMP.format(30, 5), 'lag_deg', 'reproduced'),
         *(('figure 6, right: v T of other rates (no number)', f'{rate} deg/s and 10 ms', _RAMP.format(rate, 10),
            'lag_deg', 'holds') for rate in (10, 20, 40)),
         ('figure 7: sine of 30 deg/s, 10 deg/s2, "about 0.3 deg"', 'the paper omits the share of the acceleration, '
          'a T^2 / beta', 'sine', 'lag_deg', 'not reproduced: 0.30 deg is v T alone'),
         *(('section 4: a steeper slope lessens the lag (no number)',
            f'largest true error of the beam, {target}, no smoothing, {text}', f'{case}{slope}/S0',
            'true_lag_deg', verdict)
           for target, case in (('ramp of 30 deg/s', _RAMP.format(30, 10)), ('sine of figure 7', 'sine'))
           for text, slope, verdict in (('slope as assumed', '', ''), ('slope twice as steep', '/slope=2', 'holds'))),
         ('section 4: the slope must leave the loop its dynamics (no number)', 'largest stable delay, the recursion '
          '(1), slope twice as steep', 'delay-limit/alpha=0.1/T=10ms/S1/slope=2', 'delay_ms',
          'holds: the limit of the delay falls'),
         ('figure 9: sway 10 deg in 8 s (no number)', 'without compensation', 'sway/delta=0', 'lag_deg'),
         ('figure 9: compensation 0.85 isolates greatly (no number)', 'compensation 0.85', 'sway/delta=0.85',
          'lag_deg', 'holds'),
         ('the target is lost when the lag exceeds half a beamwidth', 'lag of the loop with a linear receiver, at the '
          'largest rate at which the loop keeps the target', 'loss/half-beamwidth/type-1', 'linear_lag_beamwidths',
          'holds')))

LIN_WU_ZHU_CLAIMS = (
    Claim('figures 1, 2, 5 to 7: block diagrams, test stand',
          'implemented: pedestal_studies/p003_lin_wu_zhu/feedforward_loop.py'),
    Claim('20 deg to and fro at 3.50 deg/s, which represents 30 m/s at 500 m',
          '3.50 deg/s as printed; 30 m/s at 500 m is 3.44 deg/s', verdict='reproduced'),
    Claim('(17): with c_1, c_2 no steady error at constant rate and at constant acceleration', 'steady miss without '
          'noise, true state fed forward: 0 deg at 3.5 deg/s and at 11 deg/s2; 0.099 deg at 11 deg/s2 if the state is '
          '45 ms late, d + T / 2', verdict='holds with the true state, not with a late state'),
    *_of('imm-feedforward', *(
        ('(17): no error in theory', f'the S motion with the noise of the miss, true state fed forward, {axis}',
         f'{axis}/perfect-state', 'miss_rms_deg',
         f'not reproduced: noise and jerk leave {percent} % of the conventional miss')
        for axis, percent in (('azimuth', 2), ('elevation', 4)))),
    *_of('manoeuvre',
         *((f'figure {number}: {quantity}, 50 runs: the gap grows with the manoeuvre (no number)',
            f'error of cv divided by error of the IMM, reversal of {reversal} s', f'reversal-{reversal}s/imm-b',
            f'{quantity}_ratio_of_cv', verdict if reversal == 0.5 else '')
           for number, quantity, verdict in ((3, 'rate', 'holds'), (
               4, 'acceleration', 'holds for the difference of the errors, not for their ratio'))
           for reversal in (4, 0.5))),
    *_of('feedforward-speed', *(
        ('section 1: the IMM estimates better than differences (no number)',
         f'error of the {quantity} by differences over {10 * steps} ms divided by that of the IMM, {axis}',
         f'{axis}/30m_s/difference-{steps}', f'{quantity}_ratio_to_imm', 'holds')
        for quantity in ('rate', 'acceleration') for steps in (1, 15) for axis in ('azimuth', 'elevation')), *(
        ('section 1: differences add noise to the loop (no number)', reading, f'azimuth/30m_s/{case}', metric, verdict)
        for reading, case, metric, verdict in (
            ('noise of the rate that is fed forward, IMM, azimuth', 'imm', 'rate_noise_deg_s', ''),
            ('noise of the rate that is fed forward, differences over 10 ms, azimuth', 'difference-1',
             'rate_noise_deg_s', 'holds'),
            ('miss with differences over 10 ms divided by miss with the IMM, azimuth', 'difference-1',
             'miss_ratio_to_imm', 'not reproduced: the miss is equal within 1 %'),
            ('miss with differences over 150 ms divided by miss with the IMM, azimuth', 'difference-15',
             'miss_ratio_to_imm', 'holds'))), *(
        ('introduction: targets of 30 to 50 m/s (no number)', f'50 m/s at 500 m, {axis}: {reading}',
         f'{axis}/50m_s/{case}', metric, verdict)
        for axis in ('azimuth', 'elevation') for reading, case, metric, verdict in (
            ('miss with the IMM', 'imm', 'miss_rms_deg', ''),
            ('miss of the conventional filter divided by that of the IMM', 'imm', 'miss_ratio_to_kalman_cv',
             'holds: still more than 3 x better'),
            ('miss with the IMM through receiver, control unit and motors', 'drive-imm', 'miss_rms_deg', ''),
            ('runs that stay in autotrack with the IMM', 'drive-imm', 'autotrack_percent', 'holds'),
            ('runs that stay in autotrack with the conventional filter', 'drive-kalman-cv', 'autotrack_percent',
             '')))),
    *_of('imm-feedforward',
         ('figure 8: largest miss 0.17 deg (RMS), conventional filter, azimuth', 'rms over the whole motion',
          'azimuth/kalman-cv', 'miss_rms_deg', 'reproduced within 6 %'),
         ('figure 9: 0.035 deg, IMM, azimuth', 'rms over the whole motion', 'azimuth/imm', 'miss_rms_deg',
          'reproduced'),
         ('figures 8, 9: 4 to 5 x better', 'ratio of the two in each run, azimuth', 'azimuth/imm',
          'miss_ratio_to_kalman_cv', 'reproduced'),
         ('figure 10: 0.1 deg, conventional filter, elevation', 'rms over the whole motion', 'elevation/kalman-cv',
          'miss_rms_deg', 'reproduced within 12 %'),
         ('figure 11: 0.03 deg, IMM, elevation', 'rms over the whole motion', 'elevation/imm', 'miss_rms_deg',
          'reproduced within 12 %'),
         ('figures 10, 11: 3 x better', 'ratio of the two in each run, elevation', 'elevation/imm',
          'miss_ratio_to_kalman_cv', 'reproduced'),
         ('more than 3 x better', 'the same ratio through receiver, control unit and motors, azimuth',
          'azimuth/drive-imm', 'miss_ratio_to_kalman_cv', 'holds'),
         ('more than 3 x better', 'the same ratio through receiver, control unit and motors, elevation',
          'elevation/drive-imm', 'miss_ratio_to_kalman_cv', 'not reproduced: 2.96 x')))

LI_CHEN_WANG_CLAIMS = (
    Claim('T = 0.01 s; the filter begins with the measured angle and rate',
          'as printed; the noises and the flight are ours'),
    *_of('telemetry-flight',
         *((f'figure{"s" if " " in numbers else ""} {numbers}: {quantity} of the {axis}, {shown} (no number)',
            f'rms error of the {measurement} divided by rms error of the estimate', f'{axis}/filtered',
            f'{quantity}_reduction', 'holds')
           for axis, figures in (('azimuth', ('1, 2', '3', '4')), ('elevation', ('5, 6', '7', '8')))
           for numbers, shown, quantity, measurement in zip(
               figures, ('measured and estimated', 'measured and estimated', 'estimated'),
               ('angle', 'rate', 'acceleration'),
               ('measured angle', 'measured rate', 'difference of the measured rate over 0.2 s'))),
         ('the model is controllable (no number)', 'rank', 'controllability', 'rank', 'holds'),
         ('the model is controllable (no number)', 'condition, with T as the unit of time', 'controllability',
          'condition'),
         ('the model is observable (no number)', 'rank, angle and rate measured', 'observability/angle-rate', 'rank',
          'holds'),
         ('the model is observable (no number)', 'condition, angle and rate measured, with T as the unit of time',
          'observability/angle-rate', 'condition'),
         ('the model is observable (no number)', 'condition, angle measured, with T as the unit of time',
          'observability/angle', 'condition')),
    *_of('rate-measurement',
         ('a measured rate widens the band (no number)', 'bandwidth of the rate with a measured rate, divided by '
          'the bandwidth without', 'position-rate', 'rate_bandwidth_ratio', 'holds'),
         ('a measured rate lessens the dynamic error (no number)', 'dynamic error at 0.2 Hz without a measured rate, '
          'divided by the error with it', 'position-rate', 'dynamic_error_ratio', 'holds'),
         ('the filter is uniformly asymptotically stable (no number)', 'largest eigenvalue', 'position-rate',
          'largest_eigenvalue', 'holds')))

CLAIMS_BY_PAPER = {'Ma 2023': MA_CLAIMS, 'Zhou, Yang, Qin 2011': ZHOU_YANG_QIN_CLAIMS, 'Jia 2025': JIA_CLAIMS,
                   'Lin, Wu, Zhu 2020': LIN_WU_ZHU_CLAIMS, 'Li, Chen, Wang 2018': LI_CHEN_WANG_CLAIMS}
"""{authors and year of a paper: its Claims}."""
