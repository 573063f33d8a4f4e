"""Which reply belongs to which request."""
from pedestal_common.wire.commands import Command, Reply
from pedestal_operator.remote_node import MAX_KEPT_REQUESTS, Requests

GRANTED = Reply(True, 'mode is stop')


def test_a_reply_finds_its_request_whoever_asked_next():
    requests = Requests('7')
    asked = [requests.add('stop', who) for who in ('anna', 'bert', 'anna')]
    for command in reversed(asked):
        requests.take(command, GRANTED)
    assert [requests.replied(command.number) for command in asked] == [GRANTED] * 3
    assert requests.replied(asked[0].number) is None and len(requests) == 0


def test_replies_to_others_are_not_taken():
    requests = Requests('7')
    asked = requests.add('stop', 'anna')
    requests.take(asked._replace(who='bert'), GRANTED)                     # another program with the same numbers
    requests.take(Command('stop', 'anna', '8-1'), GRANTED)
    assert requests.replied(asked.number) is None and requests.replied('8-1') is None


def test_replies_that_nobody_reads_do_not_pile_up():
    requests = Requests('7')
    for _ in range(3 * MAX_KEPT_REQUESTS):
        requests.take(requests.add('rate', 'anna'), GRANTED)
    assert len(requests) == len(requests._replies) == MAX_KEPT_REQUESTS
    last = requests.add('stop', 'anna')
    requests.take(last, GRANTED)
    assert requests.replied(last.number) == GRANTED


def test_arguments_are_texts():
    assert Requests('7').add('preset', 'anna', {'azimuth': 1.0 / 3.0, 'point': 'zenith'}) == Command(
        'preset', 'anna', '7-1', {'azimuth': '0.333333333', 'point': 'zenith'})
