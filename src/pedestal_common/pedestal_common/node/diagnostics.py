"""Publisher of a node's diagnostics: the diagnosis of the node itself and, in realtime, the findings of its shell
(stalls, steps of the host's clock, dropped messages)."""
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from pedestal_common.graph.steps import NS_PER_SECOND
from pedestal_common.node.unit import LEVEL_OK, LEVEL_WARN, Diagnosis
from pedestal_common.quantities import Message, Nanoseconds
from pedestal_common.wire import messages

if TYPE_CHECKING:
    from pedestal_common.node.shell import Shell

Diagnose: TypeAlias = Callable[[], tuple[int, str, list[tuple[str, str]]]]
"""Function that returns a Diagnosis."""

DIAGNOSTICS_PERIOD_S = 1.0  # time between two diagnostics in realtime [s]

DIAGNOSTICS_DEADLINE_S = 2.5
"""Time without its diagnostics after which a node counts as silent, published as `deadline_s` [s]."""

STALL_LIMIT_NS = 1_500_000_000  # gap between two diagnostics above which the node reports a stall [ns]

MIN_URGENT_PERIOD_NS = 100_000_000
"""Shortest time from the last diagnostics to diagnostics that are published early, because of a change [ns]."""

CLOCK_STEP_REPORT_NS = 60 * NS_PER_SECOND  # time for which the diagnostics report a step of the system's clock [ns]


class Diagnostics:
    """Publish the diagnoses of a Shell; see Shell.diagnose_with."""

    def __init__(self, node: 'Shell', diagnose: Diagnose) -> None:
        self._node, self._diagnose, self._write = node, diagnose, node.writer('diagnostics')
        self._published = time.monotonic_ns()
        # number of the last reported steps of the clock, and their time
        self._reported_steps: tuple[int, Nanoseconds | None] = 0, None
        if not node.graph.lockstep:
            node.every(DIAGNOSTICS_PERIOD_S, self._publish_now)

    def publish(self, stamp: Nanoseconds) -> None:
        """Publish the diagnostics in lockstep, with the stamp of a step."""
        self._send(self._diagnose(), stamp)

    def publish_urgent(self) -> bool:
        """Publish in realtime at once, except within MIN_URGENT_PERIOD_NS after the last. Return True if published."""
        due = time.monotonic_ns() - self._published > MIN_URGENT_PERIOD_NS
        if due:
            self._publish_now()
        return due

    def _publish_now(self) -> None:
        diagnosis = Diagnosis(*self._diagnose())
        now, stamp = self._node.clock()
        elapsed, self._published = now - self._published, now
        self._send(self._with_findings(diagnosis, now, elapsed), stamp)

    def _send(self, diagnosis: tuple[int, str, list[tuple[str, str]]], stamp: Nanoseconds) -> None:
        level, message, values = diagnosis
        array: Message = messages.DiagnosticArray(header=messages.header(''), status=[messages.DiagnosticStatus(
            level=level, name=self._node.name, message=message, hardware_id='pedestal',
            values=[messages.KeyValue(key=key, value=value) for key, value in values])])
        messages.put_stamp(array.header.stamp, stamp)
        self._write(messages.serialize(array))

    def _with_findings(self, diagnosis: Diagnosis, now: Nanoseconds, elapsed: Nanoseconds) -> Diagnosis:
        """Return a Diagnosis with the findings of the shell, the worst first. elapsed: time since the last one."""
        utc = self._node.utc
        findings: list[tuple[int, str]] = [*filter(None, (listener.finding(now) for listener in self._node.listeners))]
        if elapsed > STALL_LIMIT_NS:
            findings.append((LEVEL_WARN, f'stalled for {elapsed * 1e-9:.1f} s'))
        steps, since = self._reported_steps
        if utc.steps != steps:
            steps, since = self._reported_steps = utc.steps, now
        if since is not None and now - since < CLOCK_STEP_REPORT_NS:
            findings.append((LEVEL_WARN, f'the clock of this host was stepped by {utc.last_step * 1e-9:+.3f} s'))
        if utc.ahead > self._node.graph.future * NS_PER_SECOND:
            findings.append((LEVEL_WARN, f'is {utc.ahead * 1e-9:.3f} s ahead of UTC, because the clock of this host '
                             'was set back: nodes that start now refuse its stamps until this node is started again'))
        if diagnosis.level != LEVEL_OK or not findings:
            findings.insert(0, diagnosis[:2])
        findings.sort(key=lambda finding: -finding[0])
        values = [*diagnosis.values, ('deadline_s', f'{DIAGNOSTICS_DEADLINE_S:g}'), ('clock_steps', str(utc.steps)),
                  *(value for listener in self._node.listeners for value in listener.values())]
        return Diagnosis(findings[0][0], '; '.join(text for _, text in findings), values)
