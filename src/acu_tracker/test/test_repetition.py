"""Whether the receiver says the same while the beam moves."""

from acu_tracker import signals
from acu_tracker.estimation import monitors
from acu_tracker.geometry.history import Pointing


def test_the_same_numbers_count_once_the_beam_has_moved_and_until_they_change():
    s, u = monitors.Repetition.zeros()[0], signals.Inputs.zeros()[0]
    u['cross_elevation'], u['elevation'], u['cn0_dbhz'] = 1e-4, -2e-5, 46.0

    def said(A, E):
        return monitors.take_repetition(s, u, Pointing(A, E, 0.0, 0.0))

    assert not any(said(0.5, 0.6) for _ in range(1000))
    assert not said(0.5 + 0.9 * monitors.REPETITION_TRAVEL_RAD, 0.6 - 0.9 * monitors.REPETITION_TRAVEL_RAD)
    assert said(0.5, 0.6 - 1.1 * monitors.REPETITION_TRAVEL_RAD) and said(0.5 + 1.1
                                                                            * monitors.REPETITION_TRAVEL_RAD, 0.6)
    u['cn0_dbhz'] = 46.1
    assert not said(0.7, 0.6) and not said(0.7, 0.6) and said(0.8, 0.6)
