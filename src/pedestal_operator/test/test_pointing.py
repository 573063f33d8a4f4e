"""Position and set-points of a rotator server: stale angles, unknown limits, ashore and on a ship."""
import math

import pytest

from pedestal_operator.rotator import outcomes, pointing
from pedestal_operator.rotator.controller import Controller
from pedestal_operator.rotator.outcomes import Refused


class Remote:
    """Antenna at rest.

    fresh: topics whose last message is not stale; seen: topics that have, or had, a publisher;
    limits: of the axes [rad], None before the reply; requests: verbs that were sent.
    """

    def __init__(self):
        self.fresh, self.seen, self.limits = {'joint_states'}, {'joint_states'}, [-4.0, 4.0, 0.0, 1.5]
        self.numbers = {pointing.ATTITUDE_TOPIC: (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)}
        self.joints, self.requests, self.who, self.texts = (10.0, 20.0), [], '', {}

    def subscribe_numbers(self, topic):
        pass

    def query(self, names):
        remote = self

        class Query:
            values = property(lambda query: remote.limits)

            def look(self):
                pass
        return Query()

    def present(self, topic, age=2.5):
        return topic in self.fresh

    def exists(self, topic):
        return topic in self.seen

    def angles(self, topic):
        return self.joints

    def request(self, verb, arguments=None):
        self.requests.append(verb)
        return len(self.requests)

    def replied(self, number):
        return None


@pytest.fixture
def remote():
    return Remote()


@pytest.fixture
def control(remote):
    return Controller(remote)


def refusal(control, *direction):
    """(outcome, reason) of a set-point."""
    pending = control.go('a', *direction, 0.0)
    return pending.look(control._remote, 0.0), pending.reason


def test_a_set_point_in_reach_is_commanded(remote, control):
    assert refusal(control, 30.0, 40.0) == (None, '') and remote.requests == ['take', 'preset']
    assert control.pointing.earth_angles() == (10.0, 20.0)


def test_stale_and_missing_angles_are_no_position(remote, control):
    for change in ({'fresh': set()}, {'joints': (math.nan, 20.0)}):
        vars(remote).update(change)
        with pytest.raises(Refused, match='the position of the antenna is unknown: .*joint_states') as refused:
            control.pointing.earth_angles()
        assert refused.value.outcome == outcomes.OUTCOME_NO_POSITION
        assert refusal(control, 30.0, 40.0)[0] == outcomes.OUTCOME_NO_POSITION
        remote.fresh = {'joint_states'}
    assert remote.requests == []


def test_limits_are_never_invented(remote, control):
    remote.limits = None
    with pytest.raises(Refused, match='limits of the antenna are unknown'):
        _ = control.pointing.limits
    assert refusal(control, 30.0, 40.0)[0] == outcomes.OUTCOME_NO_POSITION and remote.requests == []


@pytest.mark.parametrize(('direction', 'reason'), (
    ((30.0, 90.0), 'elevation 90 deg: must be 0 to 85.9437'), ((30.0, -1.0), 'elevation -1 deg: must be 0 to 85.9437'),
    ((721.0, 40.0), 'azimuth 721 deg: must be -720 to 720'),
    ((math.nan, 40.0), 'azimuth nan deg: must be -720 to 720')))
def test_a_set_point_out_of_reach_takes_no_control(remote, control, direction, reason):
    assert refusal(control, *direction) == (outcomes.OUTCOME_OUT_OF_REACH, reason) and remote.requests == []


def test_an_azimuth_without_a_turn_inside_the_limits_is_out_of_reach(remote, control):
    remote.limits = [-1.0, 1.0, 0.0, 1.5]
    assert refusal(control, 180.0, 40.0) == (outcomes.OUTCOME_OUT_OF_REACH,
                                             'azimuth 180 deg: must be -57.2958 to 57.2958')


def test_an_antenna_on_a_ship_without_a_fresh_attitude_has_no_position(remote, control):
    """Its deck angles are no earth angles, also before the first attitude."""
    remote.seen.add(pointing.ATTITUDE_TOPIC)
    with pytest.raises(Refused, match=f'unknown: no {pointing.ATTITUDE_TOPIC}$'):
        control.pointing.earth_angles()
    assert refusal(control, 30.0, 40.0)[0] == outcomes.OUTCOME_NO_POSITION
    remote.fresh.add(pointing.ATTITUDE_TOPIC)
    assert control.pointing.earth_angles() == pytest.approx((100.0, 20.0))    # the deck's azimuth 0 is east
    assert refusal(control, 30.0, 100.0) == (None, '') and remote.requests == ['take', 'slave']


def test_no_reply_has_a_reason(remote, control):
    pending = control.go('a', 30.0, 40.0, 0.0)
    assert pending.look(remote, 2.0) == outcomes.OUTCOME_NO_REPLY
    assert pending.reason == 'the control unit did not reply within 1.5 s'
    assert refusal(control, 31.0, 40.0)[0] is None
    assert control.go('b', 30.0, 40.0, 0.0).reason == 'control is held by a'
