"""Passes in set-points as gpredict sends them, north of the station and through the zenith: how the antenna follows.

    python docs/rotator/passes.py [--scenario NAME] [--seconds S]

A satellite on a circular orbit of 500 km is pointed at by gpredict, whose two loops are written here after its source
(csete/gpredict c596101, Debian's 2.3-72, src/gtk-rot-ctrl.c; the same in 9399b12 of 2026): `rot_ctrl_timeout_cb`, each
second, and `rotctld_client_thread`, each 0.8 s. Its lines go through the protocol and the set-points of
pedestal_operator to the control unit in the closed loop of a scenario; what is left out is TCP and DDS. Prints a row
for each pass and threshold. --seconds: of the middle of each pass.
"""
import argparse
import math
import sys

import numpy as np

from acu_tracker import modes
from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario
from pedestal_common.graph import topics
from pedestal_operator.remote_node import Requests
from pedestal_operator.rotator import rotctld
from pedestal_operator.rotator.controller import Controller

EARTH, HEIGHT, GRAVITY = 6371e3, 500e3, 3.986e14
"""Radius [m], height of the orbit [m], gravitational parameter [m3/s2]."""

PASSES = {'north': (0.0, 50.0), 'zenith': (60.0, 89.5)}
"""{name: azimuth and elevation of the highest point [deg]}."""

SETTINGS = (5.0, 1.0), (1.0, 1.0), (0.1, 1.0), (0.1, 0.1)
"""Threshold [deg] and cycle [s] in gpredict; the first are its own."""

IDLE = 'scenario.program.source=none', 'acu.initial_mode=standby', 'acu.tracker.handover=false'
"""Changes of a scenario in which nobody but the server moves the antenna."""

RISES = 10.0
"""Elevation [deg] at which a pass begins and ends."""

CLIENT, ANSWERED = 0.8, 0.1
"""Period of gpredict's second loop; time in it from the set-point to the question where the antenna is [s]."""

BACK = 0.02
"""Angle [deg] by which the azimuth must go back to have reversed."""


class Pass:
    """A satellite over an earth that does not turn. highest: azimuth and elevation of its highest point [deg]."""

    def __init__(self, highest):
        azimuth, elevation = np.radians(highest)
        radius = EARTH + HEIGHT
        away = math.acos(EARTH / radius * math.cos(elevation)) - elevation
        self._nearest = radius * np.array([math.sin(away) * math.sin(azimuth), math.sin(away) * math.cos(azimuth),
                                           math.cos(away)])
        self._along = radius * np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
        self._rate = math.sqrt(GRAVITY / radius**3)
        lowest = math.radians(RISES)
        seen = math.acos(EARTH / radius * math.cos(lowest)) - lowest
        self.half = math.acos(math.cos(seen) / math.cos(away)) / self._rate

    def at(self, t):
        """(azimuth 0 to 360, elevation) [deg] at times t [s] after the highest point."""
        angle = self._rate * np.asarray(t)
        east, north, up = (nearest * np.cos(angle) + along * np.sin(angle)
                           for nearest, along in zip(self._nearest, self._along))
        up -= EARTH
        return np.degrees(np.arctan2(east, north)) % 360.0, np.degrees(np.arctan2(up, np.hypot(east, north)))


class Gpredict:
    """Its two loops. target(t) -> (azimuth, elevation) [deg]; begins, ends: times [s] of its engagement, of the pass;
    threshold, cycle: as in SETTINGS; ask(line, t) -> the answer. set_points: how many were sent."""

    def __init__(self, target, begins, ends, threshold, cycle, ask):
        self._target, self._ends, self._ask = target, ends, ask
        self._threshold, self._cycle = threshold, cycle
        self._wanted, self._is_new, self._told = (0.0, 0.0), False, (0.0, 0.0)
        self._sending = False
        self._due = {self._look: begins + 0.3, self._set: begins, self._get: begins + ANSWERED}
        self.set_points = 0

    def go(self, t):
        """Do what is due at t [s]; the time of what is next."""
        while (due := min(self._due.values())) <= t:
            loop = min(self._due, key=self._due.get)
            self._due[loop] += self._cycle if loop == self._look else CLIENT
            loop(due)
        return due

    def _look(self, t):
        """rot_ctrl_timeout_cb: the place in which the satellite leaves the threshold about where it is now."""
        now = self._target(t)
        if max(map(abs, np.subtract(now, self._told))) <= self._threshold:
            return
        ahead = self._ends - t
        step = max(ahead / 2.0, self._cycle)
        while step > self._cycle / 4.0:
            then = self._target(t + ahead)
            beyond = then[1] < 0.0 or max(map(abs, np.subtract(now, then))) > self._threshold
            ahead += -step if beyond else step
            step /= 2.0
        self._wanted, self._is_new = then, True

    def _set(self, t):
        """rotctld_client_thread, first half."""
        self._sending = self._sending or self._is_new
        if self._sending:
            self._sending = self._ask(f'P {self._wanted[0]:.2f} {self._wanted[1]:.2f}', t) != b'RPRT 0\n'
            self.set_points += 1

    def _get(self, t):
        """Its second half; what `_look` has wanted since the first is forgotten."""
        self._told = tuple(map(float, self._ask('p', t).split()))
        self._is_new = self._sending


class Remote:
    """What a Controller knows of the graph, here the control unit of a closed loop."""

    def __init__(self, acu):
        self.who, self._acu, self._requests = '', acu, Requests('loop')

    @property
    def texts(self):
        """{topic: text}."""
        return {'acu/mode': modes.MODES[self._acu.parts['outputs']['mode']]}

    def subscribe_numbers(self, topic):
        """Do nothing: the encoders are the only source."""

    def present(self, topic, age=None):
        """Return True for the topic that is there."""
        return topic == 'joint_states'

    exists = present

    def directions(self, topic):
        """(azimuth, elevation) [deg] of the encoders, which are the directions without a pointing model."""
        return tuple(np.degrees(self._acu.parts['inputs']['position']))

    def query(self, names):
        """Told at once."""
        class Told:
            values = [getattr(getattr(getattr(self._acu.parameters, axis), limits), end)
                      for axis, limits, end in (name.split('.') for name in names)]
            look = staticmethod(lambda: None)
        return Told

    def request(self, verb, arguments=None):
        """Send a command to the control unit between two steps."""
        command = self._requests.add(verb, self.who, arguments)
        self._requests.take(command, self._acu.command(command))
        return command.number

    def replied(self, number):
        """The reply, which came at once."""
        return self._requests.replied(number)


def direction(azimuth, elevation):
    """Unit vectors (3, n) of azimuths and elevations (n,) [rad]."""
    return np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])


def server(acu):
    """ask(line, t) -> its answer by the server's protocol and control, for the control unit of a closed loop."""
    remote = Remote(acu)
    control = Controller(remote)

    def ask(line, t):
        request = rotctld.read(line)
        control.look(t)
        if request.name == 'get_pos':
            return rotctld.answer(request, rotctld.RESULT_OK, rotctld.position(*control.pointing.earth_angles()))
        outcome = control.go('gpredict', *request.values, t).look(remote, t)
        return rotctld.answer(request, rotctld.RESULT_REJECTED if outcome else rotctld.RESULT_OK)
    return ask


def reversals(angles):
    """How often angles (n,) [deg] turn round and go back by more than BACK."""
    count, way, farthest = 0, 0, angles[0]
    for angle in angles:
        if way * (angle - farthest) >= 0 and (way or abs(angle - farthest) > BACK):
            way, farthest = way or np.sign(angle - farthest), angle
        elif way * (farthest - angle) > BACK:
            count, way, farthest = count + 1, -way, angle
    return count


def measured(name, highest, setting, seconds):
    """{column: number} of a pass against the closed loop of a scenario. setting: one of SETTINGS."""
    satellite = Pass(highest)
    half = math.floor(min(satellite.half, seconds / 2.0))
    azimuth, elevation = satellite.at(-half)
    loop = closed_loop.Loop(scenario.load(name, (
        *IDLE, f'adu.initial_azimuth={math.radians((azimuth + 180.0) % 360.0 - 180.0)}',
        f'adu.initial_elevation={math.radians(elevation)}'), None, 2.0 * half, 'lockstep'))
    gpredict = Gpredict(lambda t: satellite.at(t - half), 1.0, half + satellite.half, *setting,
                        server(loop.units['acu']))
    period = loop.period_ns * 1e-9
    run = loop.run(watch=lambda step: max(math.ceil(gpredict.go(step * period) / period) - step, 1))
    joints, reference = run.table('joint_states'), run.table('acu/reference')
    t = joints['t']
    angles, target = [joints[f'{axis}.position'] for axis in topics.AXES], satellite.at(t - half)
    away = 2.0 * np.arcsin(0.5 * np.linalg.norm(direction(*angles) - direction(*np.radians(target)), axis=0))
    beamwidth = loop.units['acu'].parameters.tracker.receiver.beamwidth
    acceleration = np.degrees([reference[f'{axis}.acceleration'] for axis in topics.AXES])
    return {'satellite deg': np.abs(np.diff(np.unwrap(target[0], period=360.0))).sum(),
            'antenna deg': np.degrees(np.abs(np.diff(angles[0])).sum()), 'reversals': reversals(np.degrees(angles[0])),
            'set-points': gpredict.set_points, 'rms deg': math.degrees(math.sqrt(np.mean(away**2))),
            'off s': period * (away > 0.5 * beamwidth).sum(), 'of s': period * len(t),
            'deg/s2': math.sqrt(np.mean(acceleration**2)),
            'deg/s3': math.sqrt(np.mean((np.diff(acceleration) / period)**2))}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--scenario', default='leo_pass')
    parser.add_argument('--seconds', type=float, default=math.inf)
    options = parser.parse_args(arguments)
    head = None
    for name, highest in PASSES.items():
        for setting in SETTINGS:
            row = measured(options.scenario, highest, setting, options.seconds)
            if head is None:
                head = ' '.join(f'{column:>13}' for column in ('pass', 'threshold deg', 'cycle s', *row))
                print(head)
            print(f'{name:>13}', *(f'{number:13.4g}' for number in (*setting, *row.values())), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
