"""Scenarios: what is run, with which parameters."""
from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Mapping

import numpy as np

from pedestal_bringup.scenario import scenario as bringup
from pedestal_common import parameters

Value = float | int | bool | str


def scenarios() -> dict[str, str]:
    """{name: title} of the scenarios that come with the product.

    >>> 'leo_pass' in pedestal.scenarios()
    True
    """
    return bringup.available()


def load(source: str | pathlib.Path, changes: Mapping[str, Value] | None = None, *, duration: float | None = None,
         seed: int | None = None) -> Scenario:
    """The scenario of a name, or of the path of a .yaml file.

    changes: {'node.key': value} in the place of the file's; duration [s] and seed: in the place of the file's.
    Raises ValueError, one line, for anything unknown or out of range.

    >>> pedestal.load('leo_pass', seed=3).seed
    3
    >>> pedestal.load('leo_pas')
    Traceback (most recent call last):
        ...
    pedestal_bringup.scenario.scenario.ScenarioError: unknown scenario 'leo_pas'; did you mean 'leo_pass'? ...
    """
    return Scenario(str(source), dict(changes or {}), duration, seed)


@dataclasses.dataclass(frozen=True)
class Scenario:
    """A scenario with some parameters changed; checked when it is made.

    source: name or path; changes: {'node.key': value}; given_duration [s] and given_seed: None for those of the file.
    """
    source: str
    changes: Mapping[str, Value]
    given_duration: float | None = None
    given_seed: int | None = None

    def __post_init__(self) -> None:
        self.checked  # noqa: B018  raises for what is not allowed

    @functools.cached_property
    def checked(self) -> bringup.Scenario:
        """What pedestal_bringup makes of it."""
        return bringup.load(self.source, self.overrides, self.given_seed, self.given_duration)

    @property
    def overrides(self) -> list[str]:
        """Its changes as `pedestal run --param` takes them.

        >>> pedestal.load('leo_pass', {'acu.azimuth.filter.ca.noise': 0.05}).overrides
        ['acu.azimuth.filter.ca.noise=0.05']
        """
        return [bringup.override(name, value.item() if isinstance(value, np.generic) else value)
                for name, value in self.changes.items()]

    def changed(self, changes: Mapping[str, Value] | None = None, *, duration: float | None = None,
                seed: int | None = None) -> Scenario:
        """This scenario with further changes; itself it stays as it is.

        >>> pedestal.load('leo_pass').changed({'acu.azimuth.filter.kind': 'imm'}, seed=2)['acu.azimuth.filter.kind']
        'imm'
        """
        return Scenario(self.source, {**self.changes, **(changes or {})},
                        self.given_duration if duration is None else duration,
                        self.given_seed if seed is None else seed)

    def __getitem__(self, name: str) -> Value:
        """The value of a parameter 'node.key'. Raises KeyError for an unknown one.

        >>> pedestal.load('leo_pass')['adu.period']
        0.005
        """
        node, _, key = name.partition('.')
        return self.parameters(node)[key]

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes that have parameters, and 'scenario' for the header.

        >>> pedestal.load('ship_pass').nodes
        ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder', 'scenario')
        """
        return (*(node for node in self.checked.nodes if node != 'operator'), 'scenario')

    def parameters(self, node: str) -> dict[str, Value]:
        """{key: value} of all parameters of one of its nodes. Raises KeyError for another name."""
        return parameters.as_dict(self._instance(node))

    def units(self, node: str) -> dict[str, str]:
        """{key: unit} of the parameters of one of its nodes that have one.

        >>> pedestal.load('leo_pass').units('adu')['azimuth.load.inertia']
        'kg m2'
        """
        return {key: field.metadata['unit'] for key, field in parameters.flatten(type(self._instance(node)))
                if field.metadata.get('unit')}

    def _instance(self, node: str) -> parameters.Parameters:
        if node not in self.nodes:
            raise KeyError(f'{node!r} takes no part in {self.source}; there are {", ".join(self.nodes)}')
        return self.checked.header if node == 'scenario' else self.checked.node_parameters(node)

    @property
    def name(self) -> str:
        """Its name, of a file the name of that."""
        return self.checked.name

    @property
    def duration(self) -> float:
        """Length of a run [s]."""
        return self.checked.header.duration

    @property
    def seed(self) -> int:
        """Seed of every noise stream."""
        return self.checked.header.seed

    @property
    def beams(self) -> tuple[str, ...]:
        """Names of its beams where there are several, else ('',).

        >>> pedestal.load('phased_array_four').beams
        ('beam_1', 'beam_2', 'beam_3', 'beam_4')
        """
        return tuple(prefix.rstrip('/') for prefix in self.checked.prefixes)
