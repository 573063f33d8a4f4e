"""Position and set-points of a rotator server: stale angles, unknown limits, ashore and on a ship."""
import math

import pytest

from pedestal_operator.rotator import pointing
from pedestal_operator.rotator.controller import Controller
from pedestal_operator.rotator.pointing import Refused


class Remote:
    """Antenna at rest.

    fresh: topics whose last message is not stale; seen: topics that have, or had, a publisher;
    limits: of the axes [rad], None before the reply; requests: verbs that were sent; senders: their clients;
    arguments: of the last one.
    """

    def __init__(self):
        self.fresh, self.seen, self.limits = {'joint_states'}, {'joint_states'}, [-4.0, 4.0, 0.0, 1.5]
        self.numbers = {pointing.ATTITUDE_TOPIC: (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)}
        self.joints, self.requests, self.who, self.texts = (10.0, 20.0), [], '', {}
        self.senders, self.arguments = [], None

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

    def directions(self, topic):
        return self.joints

    def request(self, verb, arguments=None):
        self.requests.append(verb)
        self.senders.append(self.who)
        self.arguments = arguments
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
        assert refused.value.outcome == pointing.OUTCOME_NO_POSITION
        assert refusal(control, 30.0, 40.0)[0] == pointing.OUTCOME_NO_POSITION
        remote.fresh = {'joint_states'}
    assert remote.requests == []


def test_limits_are_never_invented(remote, control):
    remote.limits = None
    with pytest.raises(Refused, match='limits of the antenna are unknown'):
        _ = control.pointing.limits
    assert refusal(control, 30.0, 40.0)[0] == pointing.OUTCOME_NO_POSITION and remote.requests == []


@pytest.mark.parametrize(('direction', 'reason'), (
    ((30.0, 90.0), 'elevation 90 deg: must be 0 to 85.9437'), ((30.0, -1.0), 'elevation -1 deg: must be 0 to 85.9437'),
    ((721.0, 40.0), 'azimuth 721 deg: must be -720 to 720'),
    ((math.nan, 40.0), 'azimuth nan deg: must be -720 to 720')))
def test_a_set_point_out_of_reach_takes_no_control(remote, control, direction, reason):
    assert refusal(control, *direction) == (pointing.OUTCOME_OUT_OF_REACH, reason) and remote.requests == []


def test_an_azimuth_without_a_turn_inside_the_limits_is_out_of_reach(remote, control):
    remote.limits = [-1.0, 1.0, 0.0, 1.5]
    assert refusal(control, 180.0, 40.0) == (pointing.OUTCOME_OUT_OF_REACH,
                                             'azimuth 180 deg: must be -57.2958 to 57.2958')


def test_an_antenna_on_a_ship_without_a_fresh_attitude_has_no_position(remote, control):
    """Its deck angles are no earth angles, also before the first attitude."""
    remote.seen.add(pointing.ATTITUDE_TOPIC)
    with pytest.raises(Refused, match=f'unknown: no {pointing.ATTITUDE_TOPIC}$'):
        control.pointing.earth_angles()
    assert refusal(control, 30.0, 40.0)[0] == pointing.OUTCOME_NO_POSITION
    remote.fresh.add(pointing.ATTITUDE_TOPIC)
    assert control.pointing.earth_angles() == pytest.approx((100.0, 20.0))    # the deck's azimuth 0 is east
    assert refusal(control, 30.0, 100.0) == (None, '') and remote.requests == ['take', 'slave']


def test_no_reply_has_a_reason(remote, control):
    pending = control.go('a', 30.0, 40.0, 0.0)
    assert pending.look(remote, 2.0) == pointing.OUTCOME_NO_REPLY
    assert pending.reason == 'the control unit did not reply within 1.5 s'
    assert refusal(control, 31.0, 40.0)[0] is None
    assert control.go('b', 30.0, 40.0, 0.0).reason == 'control is held by a'


HOST, OTHER_HOST = 'rotctld 4533 from 127.0.0.1', 'rotctld 4533 from 127.0.0.2'


def send(remote, control, clients):
    """Send a set-point a second, 1 deg apart, each from the next client, which leaves when the next is another one."""
    remote.texts['acu/mode'] = 'preset'
    for second, (client, following) in enumerate(zip(clients, (*clients[1:], ''))):
        control.look(second)
        assert control.go(client, 10.0 + second, 40.0, second).outcome is None
        if client != following:
            control.leave(client)


@pytest.fixture
def one_shots(remote, control):
    """Send set-points, each from a connection of HOST that ends at once; the time of the last."""
    send(remote, control, [f'{HOST}:{port}' for port in range(5)])
    return 4.0


def test_connections_of_one_host_in_sequence_are_one_motion(remote, control, one_shots):
    connected = Remote()
    send(connected, Controller(connected), [f'{HOST}:1'] * 5)
    assert remote.arguments == connected.arguments and remote.arguments['moves'] == 1.5
    assert remote.requests == ['take', 'preset', *['release', 'take', 'preset'] * 4]
    assert remote.senders[-3:] == [f'{HOST}:3', f'{HOST}:4', f'{HOST}:4']
    assert control.pointing.set_point(one_shots) == (14.0, 40.0)


@pytest.mark.parametrize('client', (f'{OTHER_HOST}:5', 'rotctld 4533 from ::1:5', 'easycomm /dev/ttyUSB0'))
def test_another_host_is_refused_until_the_motion_has_ended(remote, control, one_shots, client):
    sent = len(remote.requests)
    refused = control.go(client, 30.0, 40.0, one_shots + 1.0)
    assert (refused.outcome, refused.reason) == (pointing.OUTCOME_BUSY, f'control is held by {HOST}:4')
    control.look(one_shots + 2.9)
    assert len(remote.requests) == sent and control.holder == f'{HOST}:4'
    control.look(one_shots + 3.1)
    assert remote.requests[sent:] == ['preset', 'release'] and remote.senders[sent:] == [f'{HOST}:4'] * 2
    assert control.holder == '' and control.go(client, 30.0, 40.0, one_shots + 3.2).outcome is None


def test_a_connected_client_in_control_is_not_replaced_by_its_own_host(control, one_shots):
    assert control.go(f'{HOST}:6', 15.0, 40.0, one_shots + 1.0).outcome is None
    assert control.go(f'{HOST}:7', 16.0, 40.0, one_shots + 2.0).outcome == pointing.OUTCOME_BUSY
    control.leave(f'{HOST}:7')
    assert control.holder == f'{HOST}:6'


def test_a_late_set_point_begins_a_new_motion(remote, control, one_shots):
    control.look(one_shots + 4.0)
    assert control.pointing.set_point(one_shots + 4.0) is None
    assert control.go(f'{HOST}:6', 15.0, 40.0, one_shots + 4.0).outcome is None
    assert remote.requests[-2:] == ['take', 'preset'] and remote.arguments['moves'] == 0.0


def test_a_stop_ends_the_motion_and_the_control_of_a_client_that_has_left(remote, control, one_shots):
    sent = len(remote.requests)
    control.stop(f'{OTHER_HOST}:5', one_shots + 0.5)
    control.look(one_shots + 0.6)
    assert remote.requests[sent:] == ['stop', 'release'] and control.holder == ''
    assert remote.senders[sent:] == [f'{OTHER_HOST}:5', f'{HOST}:4']


def test_a_jog_ends_with_its_connection(remote, control):
    control.jog(f'{HOST}:1', (1.0, 0.0), 0.0)
    control.leave(f'{HOST}:1')
    control.look(0.005)
    assert remote.requests == ['take', 'rate', 'stop', 'release'] and control.holder == ''


def test_a_server_that_ends_releases_the_control_of_a_client_that_has_left(remote, control, one_shots):
    control.release(one_shots + 0.5)
    assert remote.requests[-2:] == ['preset', 'release'] and remote.arguments is None and control.holder == ''
    sent = len(remote.requests)
    control.release(one_shots + 0.6)
    assert len(remote.requests) == sent


@pytest.mark.parametrize('ship', [False, True])
@pytest.mark.parametrize('at, asked, sent', [(350.0, 20.0, 380.0), (350.0, 340.0, 340.0), (-170.0, 170.0, -190.0),
                                             (10.0, 350.0, -10.0), (0.0, 180.0, -180.0)])
def test_a_set_point_lies_on_the_turn_next_to_the_antenna(remote, control, at, asked, sent, ship):
    """Seen from where the antenna stands, no azimuth is more than half a turn away."""
    remote.joints, remote.limits = (at, 20.0), [-8.0, 8.0, 0.0, 1.5]
    if ship:
        remote.fresh.add(pointing.ATTITUDE_TOPIC)
        remote.seen.add(pointing.ATTITUDE_TOPIC)
    assert control.pointing.on_ship == ship
    assert control.pointing.target(asked, 40.0, 0.0) == pytest.approx((sent, 40.0))
