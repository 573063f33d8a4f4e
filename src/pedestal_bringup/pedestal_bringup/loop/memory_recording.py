"""Recording without a file: a run of the closed loop, with the methods of bag.Bag that pedestal_results uses."""
import functools
from collections.abc import Iterator

import numpy as np

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.parameters import as_dict
from pedestal_common.quantities import Ints, Message, Nanoseconds
from pedestal_common.wire import commands, messages
from pedestal_recording import columns

DIAGNOSTICS_TOPIC = 'diagnostics'

KEYHOLE_ENTRY = 'keyhole', 'keyhole'
"""(key, value) among the diagnostics of the control unit that marks the forecast of a keyhole."""


def record(scenario: Scenario, beam: str = '') -> 'MemoryRecording':
    """Run a scenario in memory and return the recording of a beam, such as beam_2; '': the first."""
    return MemoryRecording(scenario, closed_loop.Loop(scenario, beam).run())


class MemoryRecording:
    """Recording of one beam of a scenario, made from its run. From the diagnostics it holds only the keyhole forecasts
    of the control unit and the last values of each node, because no result uses anything else."""

    def __init__(self, scenario: Scenario, run: closed_loop.Run) -> None:
        receiver = run.units['tracking_receiver'].parameters
        self.path, self.beams = scenario.name, int(scenario.header.beam)
        self.metadata = {'beamwidth': str(receiver.antenna.beamwidth)}
        self.beam = ''
        self.configuration = {'parameters': {'tracking_receiver': as_dict(receiver),
                                             'acu': as_dict(run.units['acu'].parameters)}}
        self._run, self.start, self.end = run, 0, run.t[-1]      # time 0 of the scenario, time of the last step [s]
        self._tables: dict[str, dict[str, closed_loop.Column]] = {}
        self._forecasts = run.forecasts if any(KEYHOLE_ENTRY in values for _, values in run.forecasts) else []

    @functools.cached_property
    def topics(self) -> dict[str, str]:
        """{name: type} of the topics in this recording."""
        of_diagnostics = {DIAGNOSTICS_TOPIC: messages.DiagnosticArray.__msgtype__} if self._forecasts else {}
        of_replies = dict.fromkeys(self._run.replies, messages.DiagnosticStatus.__msgtype__)
        of_tracks = {topic: message.__msgtype__ for topic, message in self._run.tracks.items()}
        return {**self._run.topics, **of_tracks, **of_replies, **of_diagnostics}

    def table(self, topic: str) -> dict[str, closed_loop.Column]:
        """Return {name: column} of a topic with a row per message, like columns.table of a bag."""
        if topic == DIAGNOSTICS_TOPIC:
            return {'t': np.array([stamp for stamp, _ in self._forecasts]) / NS_PER_SECOND}
        if topic in self._run.replies:
            return columns.table([messages.serialize(message) for *_, message in self.messages(topic)],
                                 self.topics[topic], [stamp for stamp, *_ in self._run.replies[topic]])
        if topic not in self._tables:
            self._tables[topic] = self._run.table(topic)
        return self._tables[topic]

    def rows(self, topic: str) -> Ints:
        """Return the indices 0 ... n - 1 of the messages of a topic."""
        return np.arange(len(self.table(topic)['t']))

    def last_values(self, node: str) -> dict[str, str]:
        """Return {key: value} of the diagnostics of a node at the end of the run."""
        return dict(self._run.units[node].diagnose().values)

    def messages(self, topic: str) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Yield (topic, log time, publish time, message) of `diagnostics`, replies or the program track."""
        if topic in self._run.tracks:
            yield topic, 0, 0, self._run.tracks[topic]
        for stamp, command, reply in self._run.replies.get(topic, ()):
            yield topic, stamp, stamp, commands.reply_message(command, reply)
        if topic != DIAGNOSTICS_TOPIC:
            return
        for stamp, values in self._forecasts:
            status = messages.DiagnosticStatus(level=0, name='acu', message='', hardware_id='',
                                               values=[messages.KeyValue(key=key, value=value) for key, value in
                                                       values])
            yield topic, stamp, stamp, messages.DiagnosticArray(header=messages.header(''), status=[status])
