"""Recording: what the results and the report read of a run of one beam, whichever class holds its messages.

    bag.Bag                             the files of a recording; it has more, which recover, verify and replay need
    memory_recording.MemoryRecording    a run of the closed loop, without files
    what_if.Overlay                     another recording, in which some outputs are replaced
"""
import pathlib
from collections.abc import Iterator, Mapping
from typing import Protocol

from pedestal_common.quantities import Ints, Json, Message, Nanoseconds, Records, Seconds, Table


class Recording(Protocol):
    """Messages of a run by topic. The names of the topics have no leading '/'."""

    @property
    def path(self) -> pathlib.Path | str:
        """Path of the files, or name of the scenario; for texts."""

    @property
    def beam(self) -> str:
        """Prefix of the topic names of the only beam in a view of several, else ''."""

    @property
    def beams(self) -> int:
        """Number of beams of an array; 0 for a drive with motors."""

    @property
    def start(self) -> Nanoseconds:
        """Stamp of time 0 of the scenario: UTC in realtime, else 0."""

    @property
    def end(self) -> Seconds:
        """Time of the last message."""

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the run; empty in a foreign bag."""

    @property
    def configuration(self) -> Mapping[str, Json]:
        """'parameters' are {node: {dotted name: value}}, {} if unknown."""

    @property
    def topics(self) -> Mapping[str, str]:
        """{name: type} of the topics with messages."""

    def table(self, topic: str) -> Table:
        """Return the columns of a topic, one row per message; for the names see columns.table."""

    def rows(self, topic: str) -> Records | Ints:
        """Return one element per message of a topic."""

    def messages(self, topic: str) -> Iterator[tuple[str, Nanoseconds, Nanoseconds, Message]]:
        """Yield (topic, log time, publish time, message) of the messages of a topic."""

    def last_values(self, node: str) -> dict[str, str]:
        """Return {key: value} of the last diagnostics of a node, {} without any."""
