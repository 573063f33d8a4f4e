"""The diagnostics of a node: what it says of itself, and in realtime what its shell has found."""
import time

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.wire import messages

DIAGNOSTICS_PERIOD_S = 1.0
"""Seconds between two diagnostics in realtime."""

DIAGNOSTICS_DEADLINE_S = 2.5
"""Seconds without its diagnostics after which a node counts as silent: they tell it as `deadline_s`."""

STALL_LIMIT_NS = 1_500_000_000
"""Time [ns] between two diagnostics beyond which a node was held up, and says so."""

MIN_URGENT_PERIOD_NS = 100_000_000
"""Time [ns] between two diagnostics that do not wait for their second."""

CLOCK_STEP_REPORT_NS = 60 * NS_PER_SECOND
"""Time [ns] for which the diagnostics speak of a step of the system's clock."""


class Diagnostics:
    """Publish diagnose() -> (level, message, [(key, value text)]) of a Shell; see Shell.diagnose_with."""

    def __init__(self, node, diagnose):
        self._node, self._diagnose, self._write = node, diagnose, node.writer('diagnostics')
        self._published = time.monotonic_ns()
        self._steps_told = 0, None
        if not node.graph.lockstep:
            node.every(DIAGNOSTICS_PERIOD_S, self._publish_now)

    def publish(self, stamp):
        """Publish them in lockstep, with the stamp of a step [ns]."""
        self._send(self._diagnose(), stamp)

    def publish_urgent(self):
        """Publish them in realtime before their second; False where that would be too soon after the last ones."""
        due = time.monotonic_ns() - self._published > MIN_URGENT_PERIOD_NS
        if due:
            self._publish_now()
        return due

    def _publish_now(self):
        diagnosis = Diagnosis(*self._diagnose())
        now, stamp = self._node.clock()
        away, self._published = now - self._published, now
        self._send(self._with_findings(diagnosis, now, away), stamp)

    def _send(self, diagnosis, stamp):
        level, message, values = diagnosis
        array = messages.DiagnosticArray(header=messages.header(''), status=[messages.DiagnosticStatus(
            level=level, name=self._node.name, message=message, hardware_id='pedestal',
            values=[messages.KeyValue(key=key, value=value) for key, value in values])])
        messages.put_stamp(array.header.stamp, stamp)
        self._write(messages.serialize(array))

    def _with_findings(self, diagnosis, now, away):
        """A Diagnosis with what the shell of a realtime node has found, the worst first. away: time since
        the last one [ns]."""
        utc = self._node.utc
        findings = [*filter(None, (listener.finding(now) for listener in self._node.listeners))]
        if away > STALL_LIMIT_NS:
            findings.append((LEVEL_WARN, f'was held up for {away * 1e-9:.1f} s'))
        steps, since = self._steps_told
        if utc.steps != steps:
            steps, since = self._steps_told = utc.steps, now
        if since is not None and now - since < CLOCK_STEP_REPORT_NS:
            findings.append((LEVEL_WARN, f'the clock of this host was stepped by {utc.last_step * 1e-9:+.3f} s'))
        if utc.ahead > self._node.graph.future * NS_PER_SECOND:
            findings.append((LEVEL_WARN, f'goes on {utc.ahead * 1e-9:.3f} s ahead of UTC, whose clock was '
                             'set back: nodes that start now refuse its stamps until it is started again'))
        if diagnosis.level != LEVEL_OK or not findings:
            findings.insert(0, diagnosis[:2])
        findings.sort(key=lambda finding: -finding[0])
        values = [*diagnosis.values, ('deadline_s', f'{DIAGNOSTICS_DEADLINE_S:g}'), ('clock_steps', str(utc.steps)),
                  *(value for listener in self._node.listeners for value in listener.values())]
        return Diagnosis(findings[0][0], '; '.join(text for _, text in findings), values)
