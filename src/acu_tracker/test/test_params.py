import pytest

from acu_tracker import control_unit
from acu_tracker.params import AcuParameters
from pedestal_common.parameters import ParameterError, build


def test_parameters_are_checked():
    build(AcuParameters, {})
    for name, value, words in (('azimuth.shaper.rate', 3.0, 'shaper.rate'), ('elevation.stow', 2.0, 'stow'),
                               ('command_delay', 0.5, 'command_delay'), ('step_gap', 0.006, 'step_gap'),
                               ('azimuth.shaper.jerk', 100.0, 'h0'), ('azimuth.limits.low', 5.0, 'low'),
                               ('tracker.coast_time', 0.05, 'coast_time'), ('initial_mode', 'park', 'standby'),
                               ('azimuth.controller', 'lqr', 'pid, feedforward, adrc'),):
        with pytest.raises(ParameterError, match=words):
            build(AcuParameters, {name: value})


@pytest.mark.parametrize('values, line', [
    ({'receiver_latency': 0.31}, 'receiver_latency = 0.31 s: must be 0 to 60 periods, 0.3 s'),
    ({'attitude_latency': 0.31, 'attitude_timeout': 1.0}, 'attitude_latency = 0.31 s: must be 0 to 60 periods, 0.3 s'),
    ({'elevation.notch.frequency': 100.0}, 'elevation.notch.frequency = 100 Hz: must be below half the step rate, '
                                           '100 Hz'),
    ({'attitude_latency': 0.2}, 'attitude_latency = 0.2 s: must be below attitude_timeout - '
                                'command_delay - half a period = 0.1975 s'),
])
def test_what_does_not_go_together_is_refused(values, line):
    with pytest.raises(ParameterError) as error:
        build(AcuParameters, values)
    assert str(error.value) == line


def test_what_a_beam_does_not_keep_does_not_limit_it():
    """80 periods on their way; the encoders of then must still be there for the receiver's errors."""
    beam = {'azimuth.controller': 'beam', 'elevation.controller': 'beam', 'period': 0.001, 'command_delay': 0.08}
    build(AcuParameters, beam).check_graph(1, True)
    for more in ({'azimuth.controller': 'adrc'}, {'receiver_latency': 0.061}, {'tracker.receiver.beam_age': 0.061}):
        with pytest.raises(ParameterError, match='must be 0 to 60 periods'):
            build(AcuParameters, beam | more)


def test_constants_hold_the_parameters():
    c = control_unit.constants(build(AcuParameters, {
        'azimuth.filter.kind': 'current_statistical', 'azimuth.filter.current_statistical.a_max': 0.123,
        'command_delay': 0.01}))
    assert c['target']['filter']['axis'][0, 0]['models'][0]['a_max'] == 0.123 and c['lead'] == 0.0125
