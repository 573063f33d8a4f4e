"""Variant of a scenario: the scenario with the changes of one run, by which trials, tuning, studies and the command
line describe their runs."""
from __future__ import annotations

import dataclasses
import pathlib
import shlex
from collections.abc import Iterable, Mapping

from pedestal_bringup.scenario import files, scenario
from pedestal_bringup.scenario.scenario import Draft, Scenario
from pedestal_common.quantities import Json, Seconds


@dataclasses.dataclass(frozen=True)
class Variant:
    """A scenario with changes."""
    source: str                         # its name or path
    changes: tuple[str, ...] = ()       # texts 'node.key=value'; the last value of a parameter holds
    files: tuple[str | pathlib.Path, ...] = ()      # ROS 2 parameter files, whose values `changes` replace
    seed: int | None = None             # None for that of the scenario
    duration: Seconds | None = None     # None for that of the scenario

    def with_(self, changes: Mapping[str, Json] | Iterable[str] = (), *, seed: int | None = None,
              duration: Seconds | None = None) -> Variant:
        """Return this variant with further changes, as {'node.key': value} or as texts; None keeps a value."""
        texts = (files.override(*change) for change in changes.items()) if isinstance(changes, Mapping) else changes
        return dataclasses.replace(self, changes=(*self.changes, *texts), seed=self.seed if seed is None else seed,
                                   duration=self.duration if duration is None else duration)

    def overrides(self) -> list[str]:
        """Return the texts 'node.key=value' of the files, then those of the changes. Raises ValueError."""
        return [text for file in self.files for text in files.file_overrides(file)] + list(self.changes)

    def draft(self) -> Draft:
        """Return the scenario before its check. Raises ValueError."""
        return scenario.draft(self.source).changed(self.overrides())

    def load(self, pacing: str | None = None) -> Scenario:
        """Return the checked scenario. Raises ValueError."""
        return scenario.checked(self.draft(), self.seed, self.duration, pacing)

    def arguments(self) -> list[str]:
        """Return the arguments of the verb `run` for this variant."""
        seed = [] if self.seed is None else ['--seed', str(self.seed)]
        duration = [] if self.duration is None else ['--duration', repr(self.duration)]
        given = [part for file in self.files for part in ('--params-file', str(file))]
        changed = [part for change in self.changes for part in ('--param', change)]
        return [self.source, *seed, *duration, *given, *changed]

    def command(self) -> str:
        """Return the command line that runs this variant with separate nodes."""
        return shlex.join(['pedestal', 'run', *self.arguments()])
