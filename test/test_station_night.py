"""`pedestal station` on a graph of real processes: three passes and an inserted one, each with its bag and report; a
node is killed between them, the station itself within one, and an operator takes control."""
import datetime
import json
import re
import signal
import threading
import time

import numpy as np
import pytest
from shared import PEDESTAL

from pedestal_common.geometry.geodesy import STATION_NAMES, StationParameters
from pedestal_common.wire import messages
from pedestal_recording import bag as bags
from pedestal_recording.verify import verify
from pedestal_station.outputs import file
from tracking_receiver_sim.params import LeoPassParameters

pytestmark = pytest.mark.thorough

BEGIN = datetime.datetime(2019, 12, 10, 12, 35, 40)     # of the run: the satellite culminates 165 s later
CONTACTS = {'ISS/0': (-100.0, -40.0), 'ISS/1': (40.0, 75.0), 'ISS/2': (95.0, 140.0), 'ISS/3': (155.0, 195.0),
            'ISS/4': (205.0, 225.0)}    # the last one is dropped by the plan, and the third is of an ephemeris

LINES = LeoPassParameters().line_1, LeoPassParameters().line_2
FRESHER = f'{LINES[0][:31]}2{LINES[0][32:68]}2\n{LINES[1]}\n'    # by a millisecond


def plan(path):
    """Write the plan of CONTACTS."""
    place, zero = StationParameters(), file.seconds(BEGIN)
    elements = dict(zip(('line_1', 'line_2'), LINES))
    orbit, rows = file.orbit_of(elements, place), []
    for case, (begin, end) in CONTACTS.items():
        azimuth, elevation = file.direction(elements, place, zero + begin)
        track = ()
        if case == 'ISS/3':
            times = zero + np.arange(begin - 10.0, end + 10.0)
            east, north, up = orbit.enu(times).T
            track = tuple(zip(times.tolist(), np.arctan2(east, north).tolist(),
                              np.arctan2(up, np.hypot(east, north)).tolist()))
        rows.append(file.row(file.Contact(
            case, 'ISS', '25544', {} if track else elements, track, zero + begin, zero + end,
            (azimuth + 180.0) % 360.0 - 180.0, elevation, 53.7, case != 'ISS/4', 'not wanted')))
    path.write_text(json.dumps({'pedestal_plan': 1, 'passes': rows,
                                'station': {name: getattr(place, name) for name in STATION_NAMES}}))


class Said:
    """Lines of a process, as they come, while a client goes on hearing."""

    def __init__(self, process, client):
        self.process, self.client, self.lines = process, client, []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        self.lines.extend(iter(self.process.stdout.readline, ''))

    def until(self, text, seconds=240.0):
        deadline = time.monotonic() + seconds
        wrong = text.replace(': done', ': failed').partition('failed')[0] + 'failed' if ': done' in text else '\0'
        while not any(text in line for line in self.lines):
            assert not any(wrong in line for line in self.lines), ''.join(self.lines)
            assert time.monotonic() < deadline and self.process.poll() in (None, 0), (text, ''.join(self.lines),
                                                                                     self.process.poll())
            self.client.spin(0.05)


@pytest.fixture(scope='module')
def running(start_run, patient):
    """A realtime Run in which the satellite is up."""
    run = start_run('leo_pass', '--pacing', 'realtime', '--duration', '330', '--param', 'acu.initial_mode=standby',
                    '--param', f'tracking_receiver.target.leo_pass.start_time={BEGIN.isoformat()}Z', *patient)
    deadline = time.monotonic() + 180.0
    while not (run.bag.exists() and run.recorded(1)):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    yield run
    run.interrupt()


@pytest.mark.excused_by('missed_steps')
def test_a_night_is_tracked_whatever_happens_in_it(running, start_process, run_process, connect, tmp_path):
    domain, path = {'ROS_DOMAIN_ID': str(running.domain_id)}, tmp_path / 'night.json'
    plan(path)
    (tmp_path / 'new').mkdir()
    (tmp_path / 'new' / 'iss.tle').write_text(FRESHER)
    client = connect(running.domain_id)

    def pedestal(*arguments):
        return run_process([*PEDESTAL, *arguments], 60.0, **domain)

    def station():
        return start_process([*PEDESTAL, 'station', '--plan', path, '--lead', '20', '--elements', path.parent / 'new'],
                             **domain)

    def now(text):
        client.until(lambda: client.heard['station/night'] and text in json.loads(
            client.heard['station/night'][-1].data)['now'], 120.0)

    said = Said(station(), client)
    said.until('ISS/1: queued')
    assert 'ISS/0: refused: its time was over at 12:35:00' in said.lines[0]
    client.read('station/night')
    client.read('station/log')
    client.write('station/command')
    client.publish('station/command', messages.DiagnosticStatus(
        level=0, name='skip', message='1', hardware_id='x' * 2000, values=[]))
    said.until('station/command refused: a text of 2000 characters')
    wrong = pedestal('ask', 'insert', 'case=ISS/9', '--node', 'station')
    assert (wrong.returncode, wrong.stdout) == (
        1, 'station: refused: case = ISS/9: must be one of ISS/0, ISS/1, ISS/2, ISS/3, ISS/4\n'), wrong.stderr
    assert ', scenario leo_pass, since ' in wrong.stderr      # the graph beside which the station runs
    assert "unknown command 'jump'" in pedestal('ask', 'jump', '--node', 'station').stdout
    assert 'gust is a command of adu: add --node adu' in pedestal('ask', 'gust').stderr
    added = pedestal('ask', 'insert', 'case=ISS/4', '--node', 'station')
    assert (added.returncode, added.stdout) == (0, 'station: ISS/4 is queued\n')
    other = pedestal('station', '--plan', path)
    assert other.returncode == 1 and 'another station commands this antenna' in other.stderr
    said.until('ISS/2: elements of iss.tle, 0.8 days old at the pass, in place of 0.8')
    said.until('ISS/1: done: on the target for ')
    running.signal('acu', signal.SIGKILL)
    said.until('waits: the control unit is silent')
    said.until('ISS/2: recorded in ')
    now('tracks ISS/2')
    assert pedestal('ask', 'take', '--who', 'bert').returncode == 0
    assert pedestal('mode', 'stop', '--who', 'bert').returncode == 0
    now('waits: control is with bert')
    assert pedestal('ask', 'release', '--who', 'bert').returncode == 0
    said.until('ISS/2: done: on the target for ')
    now('tracks ISS/3')
    said.process.kill()
    said = Said(station(), client)
    said.until('ISS/3: running, ')
    said.until('ISS/3: done: on the target for ')
    said.until('ISS/4: done: on the target for ')
    said.until(' stowed')
    said.until('ISS_3: ')      # the report of the part before the station was killed
    client.until(lambda: said.process.poll() is not None)
    client.spin(1.0)
    assert said.process.returncode == 0
    night = json.loads(client.heard['station/night'][-1].data)
    assert {each['case']: each['state'] for each in night['passes']} == {
        'ISS/0': 'skipped', **dict.fromkeys(('ISS/1', 'ISS/2', 'ISS/3', 'ISS/4'), 'done')}
    told = '\n'.join(message.data for message in client.heard['station/log']).splitlines()
    assert {line.strip() for line in said.lines} <= set(told)
    folder = tmp_path / 'night-bags'
    # The bag of ISS/3 has two parts, because the station was killed in it.
    assert sorted(path.name for path in folder.iterdir() if path.is_dir()) == ['ISS_1', 'ISS_2', 'ISS_3', 'ISS_3-2',
                                                                               'ISS_4']
    for name in ('ISS_1', 'ISS_2', 'ISS_3', 'ISS_3-2', 'ISS_4'):
        bag = bags.load(folder / name)
        assert (folder / name / 'report.html').exists() and verify(bag).complete, verify(bag).lines()
        recorded = [messages.deserialize(data, 'std_msgs/msg/String').data for *_, data in bag.raw('station/log')]
        assert any(re.search(f'{name[:5].replace("_", "/")}: (begins|running)', line) for line in recorded), recorded
    again = pedestal('station', '--plan', path)
    assert again.returncode == 2 and 'all its passes are over' in again.stderr
