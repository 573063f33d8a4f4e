"""ROS shell of the antenna drive unit: owns the drive's time, publishes the encoders, obeys rate commands."""
import json
import sys
import time

import numpy as np
from std_srvs.srv import Trigger

from adu_drive import drive_state, faults, thermal
from adu_drive.params import AduNodeParameters
from adu_drive.wire import CLOCK, COMMAND, JOINTS, MOTORS, SHIP, STATE, Adu
from pedestal_common import messages, records, shell

STEP = 'step'
"""The drive's own trigger among its inputs."""

ACKNOWLEDGED_STEPS = 1000
"""Lockstep: the drive waits this often until every reader has all; a reader's queue holds 5000 messages (Fast DDS), so
a slow recorder slows the run and loses nothing."""


class AduNode(shell.Shell):

    def __init__(self):
        super().__init__('adu', AduNodeParameters)
        p = self.parameters
        self.unit = Adu(p, 'ship_motion' in self.graph.members)
        self.unit.prepare()
        self.outputs = self.unit.outputs
        self.now, self.heard_command, self.heard_ship = (records.only(self.unit.heard, name)
                                                         for name in (JOINTS, COMMAND, SHIP))
        self.period_ns = round(p.period * shell.SECOND)
        self.steps_to_go = round(p.duration / p.period) if p.duration > 0.0 else None
        self.k = 0
        self.lost_steps = self.late_ticks = 0
        self.command = None
        self.command_stamp = None
        self.stale = False
        self.code = None
        self.announced = ''
        self.refused = ''
        self.invalid = ''
        self.tick_timer = None
        self.ticking = False
        self.truth = None
        self.begun = self.heard = time.monotonic()

        # What the others wait for goes first.
        self.says = [(self.unit.messages[name], records.only(self.unit.said, name), self.writer(name))
                     for name in (JOINTS, CLOCK, MOTORS)]
        self.send_state = self.writer(STATE)
        for name, what in drive_state.REQUESTS.items():
            self.create_service(Trigger, name, self.service(what))
        self.diagnose_with(self.diagnose)

        if self.graph.lockstep:
            self.follow(STEP, self.unit.followers, self.answered)
        else:
            self.reader(COMMAND, self.on_command)
            if SHIP in self.unit.followers:
                self.reader(SHIP, self.on_truth)
        self.start_timer = self.every(0.001, self.start)

    def start(self):
        """Step 0, once the graph is complete. In realtime the steady timer begins with the first command, when the
        others have found each other; without an ACU at once, and with a mute one after the deadline."""
        self.start_timer.cancel()
        self.await_graph()
        self.heard = time.monotonic()
        self.publish_step()
        if not self.graph.lockstep:
            mute = self.graph.deadline if 'acu' in self.graph.members else self.parameters.period
            self.tick_timer = self.every(mute, self.begin_ticking)

    def begin_ticking(self):
        """Realtime: from now on a step every period."""
        self.tick_timer.cancel()
        self.tick_timer = self.every(self.parameters.period, self.tick)
        self.heard = time.monotonic()
        self.ticking = True

    def publish_step(self):
        """The state when it has changed, then joint_states, clock and motor_states of step k."""
        stamp = self.k * self.period_ns
        self.begin_step(stamp)
        if self.graph.lockstep and self.k % ACKNOWLEDGED_STEPS == 0:
            self.await_acknowledged()
        self.now.stamp[0] = stamp
        self.unit.say()
        self.announce_state()
        for message, place, send in self.says:
            records.put(message, place)
            send(message)
        if self.graph.lockstep:
            self.steps.take(STEP, stamp, None)

    def announce_state(self):
        code = self.unit.said[0][STATE]
        if code != self.code:
            self.code = code
            now = drive_state.described(int(code))
            if now != self.announced:
                self.announced = now
                self.announce(self.send_state, messages.String(data=now))

    def answered(self, _stamp, _trigger, inputs):
        """Lockstep: the command stamped t_k (and the ship's truth) has come."""
        self.command, self.truth = inputs[COMMAND], inputs.get(SHIP)
        self.advance()

    def on_command(self, message):
        """Realtime: the latest command wins; one that is not newer, or from the future, is refused."""
        stamp = messages.nanoseconds(message.header.stamp)
        if self.command_stamp is not None and stamp <= self.command_stamp:
            self.refused = f'stamp went back from {self.command_stamp / 1e9:.3f} to {stamp / 1e9:.3f} s'
        elif stamp > self.k * self.period_ns:
            self.refused = f'stamp {stamp / 1e9:.3f} s lies ahead of the drive ({self.k * self.period_ns / 1e9:.3f} s)'
        else:
            self.command, self.command_stamp = message, stamp
            if self.tick_timer is not None and not self.ticking:
                self.begin_ticking()

    def on_truth(self, message):
        self.truth = message

    def tick(self):
        """Realtime: one period has passed on the steady clock."""
        if self.finished:
            return
        stamp = self.k * self.period_ns
        age = stamp - self.command_stamp if self.command_stamp is not None else stamp
        self.lost_steps += age > 0
        self.late_ticks += time.monotonic() - self.heard > 1.5 * self.parameters.period
        self.heard = time.monotonic()
        self.advance()

    def advance(self):
        """Integrate from t_k to t_k+1 and publish, or end after the last step."""
        if self.k == self.steps_to_go:
            self.end()
            return
        records.take(self.heard_command, self.command)
        records.take(self.heard_ship, self.truth)
        self.stale = self.unit.advance()
        if self.outputs[0]['invalid_command']:
            self.invalid = COMMAND if np.isfinite(self.unit.inputs[0]['base_acceleration']).all() else SHIP
        self.k += 1
        if self.k == 1:
            self.begun = time.monotonic()
        self.publish_step()

    def end(self):
        """The last step has been answered: say how it went and finish. The clock ran from the first answer on, when
        everyone had found everyone."""
        wall = time.monotonic() - self.begun
        self.await_acknowledged()
        factor = (self.k - 1) * self.parameters.period / wall
        print(json.dumps({'steps': self.k, 'wall_s': wall, 'realtime_factor': factor,
                          'lost_steps': int(self.lost_steps), 'late_ticks': int(self.late_ticks)}), flush=True)
        self.finished = True

    def service(self, what):
        """The callback of a service: asks the drive between two steps and answers with what it reads back."""
        def change(_request, response):
            answer = self.unit.ask(what)
            if what == drive_state.RESET_FAULTS and answer == drive_state.GRANTED:
                self.refused = ''
            now = drive_state.described(int(self.outputs[0]['condition']))
            response.success = answer == drive_state.GRANTED
            refusal = '' if response.success else f'refused: {drive_state.REFUSALS[answer]}; '
            response.message = f'{refusal}drive is {now}'
            return response
        return change

    def diagnose(self):
        """What is now, and the topic that held no number since the last diagnosis."""
        outputs = self.outputs[0]
        now = drive_state.described(int(outputs['condition']))
        invalid, self.invalid = self.invalid, ''
        values = [(f'{axis} {name}', '1' if outputs[axis][name] else '0') for axis in messages.AXES
                  for name in ('torque_limited', 'voltage_limited', 'end_stop', 'stopping')]
        values += [(f'{axis} faults', ', '.join(faults.names(outputs[axis]['faults']))) for axis in messages.AXES]
        values += [(f'{axis}_motor_{i} thermal_load', f'{load:.3f}') for axis in messages.AXES
                   for i, load in enumerate(outputs[axis]['thermal_load'], 1)]
        values += [('state', now), ('phase', drive_state.PHASES[outputs['phase']]),
                   ('brakes', 'on' if outputs['braked'] else 'off')]
        values += [('step', str(self.k)), ('lost_steps', str(int(self.lost_steps))),
                   ('late_ticks', str(int(self.late_ticks)))]
        if outputs['emergency'] or any(outputs[axis]['faults'] for axis in messages.AXES):
            return shell.ERROR, now, values
        if invalid:
            return shell.ERROR, f'{invalid} holds NaN or infinity: stopping', values
        if self.stale:
            limit = self.unit.memory['timeout'][0] / 1e9
            return shell.ERROR, f'no new acu/rate_command for {limit:g} s: stopping', values
        if self.refused:
            return shell.WARN, f'acu/rate_command refused: {self.refused}', values
        if now != 'enabled':
            return shell.WARN, now, values
        if any(outputs[axis]['end_stop'] for axis in messages.AXES):
            return shell.WARN, 'at an end stop', values
        hottest = max(outputs[axis]['thermal_load'].max() for axis in messages.AXES)
        if hottest > thermal.WARM:
            return shell.WARN, f'a motor is at {100.0 * hottest:.0f} % of its thermal load', values
        return shell.OK, 'following', values


def main(args=None):
    return shell.main(AduNode, args)


if __name__ == '__main__':
    sys.exit(main())
