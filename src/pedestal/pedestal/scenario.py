"""Scenarios of the Python library: `pedestal.load` returns a Scenario, whose parameters can be read and changed."""
from __future__ import annotations

import dataclasses
import datetime
import functools
import pathlib
import typing
from collections.abc import Mapping

import numpy as np

from pedestal.satellite import Choice, chosen
from pedestal_bringup.scenario import files, shipped
from pedestal_bringup.scenario import scenario as bringup
from pedestal_bringup.scenario.variant import Variant
from pedestal_common.parameters import Parameters, as_dict, flatten
from pedestal_common.quantities import Seconds

if typing.TYPE_CHECKING:
    from typing_extensions import Unpack

    from pedestal.satellite import Options

Value = float | int | bool | str


def scenarios() -> dict[str, str]:
    """Return the scenarios that come with the product, {name: title}.

    >>> 'leo_pass' in pedestal.scenarios()
    True
    """
    return shipped.available()


def load(source: str | pathlib.Path, changes: Mapping[str, Value] | None = None, *, duration: float | None = None,
         seed: int | None = None, **choice: Unpack[Options]) -> Scenario:
    """Return the scenario of a name or of a .yaml file.

    changes: {'node.key': value}. changes, duration [s] and seed replace values of the file. tle, satellite, station,
    which and start choose a satellite and its pass as --tle, --satellite, --station, --pass and --start of `pedestal
    run`. Raises ValueError with one line for an unknown name or a value out of range.

    >>> pedestal.load('leo_pass', seed=3).seed
    3
    >>> pedestal.load('leo_pas')
    Traceback (most recent call last):
        ...
    pedestal_bringup.scenario.sections.ScenarioError: unknown scenario 'leo_pas'; did you mean 'leo_pass'? ...
    >>> pedestal.load('leo_pass', which='2019-12-10T12:00', duration=60.0)[
    ...     'tracking_receiver.target.leo_pass.start_time']     # half a minute before the culmination
    '2019-12-10T12:37:55Z'
    """
    own = Choice(**choice)
    if not own.made:
        return Scenario(str(source), dict(changes or {}), duration, seed)
    texts = [files.override(name, value) for name, value in (changes or {}).items()]
    now = datetime.datetime.now(datetime.timezone.utc).replace(tzinfo=None)
    found = chosen(bringup.draft(source), texts, own, duration, now)
    parsed = {f'{node}.{key}': value for node, key, value in map(files.parse_override, found.changes)}
    return Scenario(str(source), parsed, found.duration, seed)


@dataclasses.dataclass(frozen=True)
class Scenario:
    """A scenario with changed parameters, checked at its creation."""
    source: str                             # its name or path
    changes: Mapping[str, Value]            # {'node.key': value}
    given_duration: Seconds | None = None   # None for the value of the file
    given_seed: int | None = None           # None for the value of the file

    def __post_init__(self) -> None:
        self.checked  # noqa: B018  raises ValueError for wrong values

    @functools.cached_property
    def checked(self) -> bringup.Scenario:
        """Scenario of pedestal_bringup with all changes applied."""
        return self.variant.load()

    @functools.cached_property
    def variant(self) -> Variant:
        """Variant of pedestal_bringup that this scenario is."""
        changes = {name: value.item() if isinstance(value, np.generic) else value
                   for name, value in self.changes.items()}
        return Variant(self.source, seed=self.given_seed, duration=self.given_duration).with_(changes)

    @property
    def overrides(self) -> list[str]:
        """Changes as texts for `pedestal run --param`.

        >>> pedestal.load('leo_pass', {'acu.azimuth.filter.ca.noise': 0.05}).overrides
        ['acu.azimuth.filter.ca.noise=0.05']
        """
        return list(self.variant.changes)

    def changed(self, changes: Mapping[str, Value] | None = None, *, duration: float | None = None,
                seed: int | None = None) -> Scenario:
        """Return this scenario with further changes; the original is not modified.

        >>> pedestal.load('leo_pass').changed({'acu.azimuth.filter.kind': 'ca'}, seed=2)['acu.azimuth.filter.kind']
        'ca'
        """
        return Scenario(self.source, {**self.changes, **(changes or {})},
                        self.given_duration if duration is None else duration,
                        self.given_seed if seed is None else seed)

    def __getitem__(self, name: str) -> Value:
        """Return the value of a parameter 'node.key'. Raises KeyError for an unknown name.

        >>> pedestal.load('leo_pass')['adu.period']
        0.005
        """
        node, _, key = name.partition('.')
        return self.parameters(node)[key]

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes with parameters, and 'scenario' for the header.

        >>> pedestal.load('ship_pass').nodes
        ('ship_motion', 'ins', 'tracking_receiver', 'acu', 'adu', 'recorder', 'scenario')
        """
        return (*(node for node in self.checked.nodes if node != 'operator'), 'scenario')

    def parameters(self, node: str) -> dict[str, Value]:
        """Return all parameters of a node, {key: value}. Raises KeyError for a node outside the scenario."""
        return as_dict(self._instance(node))

    def units(self, node: str) -> dict[str, str]:
        """Return the units of the parameters of a node, {key: unit}, without dimensionless parameters.

        >>> pedestal.load('leo_pass').units('adu')['azimuth.load.inertia']
        'kg m2'
        """
        return {key: field.metadata['unit'] for key, field in flatten(type(self._instance(node)))
                if field.metadata.get('unit')}

    def _instance(self, node: str) -> Parameters:
        if node not in self.nodes:
            raise KeyError(f'{node!r} takes no part in {self.source}; there are {", ".join(self.nodes)}')
        return self.checked.header if node == 'scenario' else self.checked.node_parameters(node)

    @property
    def name(self) -> str:
        """Name of the scenario, or name of its file without suffix."""
        return self.checked.name

    @property
    def duration(self) -> Seconds:
        """Length of a run."""
        return self.checked.header.duration

    @property
    def seed(self) -> int:
        """Seed of every noise stream."""
        return self.checked.header.seed

    @property
    def beams(self) -> tuple[str, ...]:
        """Names of the beams of an array, ('',) for a single beam.

        >>> pedestal.load('phased_array_four').beams
        ('beam_1', 'beam_2', 'beam_3', 'beam_4')
        """
        return tuple(prefix.rstrip('/') for prefix in self.checked.prefixes)
