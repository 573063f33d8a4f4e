"""Origin of a bag: scenario, parameters of all nodes, versions and git revision, as texts in its metadata.

They do not depend on the path, the host or the wall clock, so equal runs give equal bytes.
"""
import contextlib
import importlib.metadata
import pathlib
import platform
import subprocess
from collections.abc import Collection, Iterable
from typing import Protocol

from pedestal_common import parameters
from pedestal_common.text_files import plain_yaml
from pedestal_recording.bag import Bag

VERSIONED_PACKAGES = ('pedestal_common', 'ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive',
                      'pedestal_hardware', 'pedestal_bringup', 'numpy', 'numba', 'rclpy')
"""Packages whose versions are recorded."""

GIT_TIMEOUT_S = 5.0  # longest duration of a git command [s]

OMITTED_PARAMETERS = ('bag', 'scenario_yaml', 'parameters_yaml')
"""Parameters of the recorder that the recorded configuration omits: the destination, and the configuration itself."""


class Scenario(Protocol):
    """What this module reads of a scenario.Scenario."""

    @property
    def nodes(self) -> Iterable[str]:
        """Names of its nodes."""

    @property
    def own(self) -> Collection[str]:
        """Those of its nodes that are programs of the user."""

    def node_parameters(self, name: str) -> parameters.Parameters:
        """Return the parameters of a node."""

    def as_yaml(self) -> str:
        """Return the scenario as a ROS 2 parameter file."""


def _git(*arguments: str) -> str:
    """Return the output of a git command on this source tree, '' if it fails or git is missing."""
    try:
        done = subprocess.run(['git', '--no-optional-locks', *arguments], cwd=pathlib.Path(__file__).parent,
                              capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return ''
    return done.stdout.strip()


def git_revision() -> str:
    """Return the revision of this source tree, with '-dirty' if a file of it is changed; '' if installed."""
    if not _git('ls-files', '--error-unmatch', pathlib.Path(__file__).name):
        return ''
    # `git describe --dirty` would lock and write the index in spite of --no-optional-locks.
    revision = _git('rev-parse', '--verify', 'HEAD')
    return revision + ('-dirty' if revision and _git('status', '--porcelain', '--untracked-files=no') else '')


def versions() -> dict[str, str]:
    """Return {'version.NAME': version} of Python and of VERSIONED_PACKAGES."""
    versions = {'version.python': platform.python_version()}
    for package in VERSIONED_PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[f'version.{package}'] = importlib.metadata.version(package)
    return versions


def recorder_parameters(scenario: Scenario) -> dict[str, str]:
    """Return the parameters of the recorder node that hold the configuration of a scenario."""
    values = {node: parameters.as_dict(scenario.node_parameters(node))
              for node in scenario.nodes if node != 'operator' and node not in scenario.own}
    values['recorder'] = {key: value for key, value in values['recorder'].items() if key not in OMITTED_PARAMETERS}
    return {'scenario_yaml': scenario.as_yaml(), 'parameters_yaml': plain_yaml.dump(values)}


def records(scenario_yaml: str, parameters_yaml: str) -> dict[str, dict[str, str]]:
    """Return the metadata records of a bag from the texts of recorder_parameters; none for an empty text."""
    content = {}
    if scenario_yaml:
        content['scenario'] = {'yaml': scenario_yaml}
    if parameters_yaml:
        content['parameters'] = {node: plain_yaml.dump(values)
                                 for node, values in plain_yaml.parse(parameters_yaml).items()}
    return content


def line(bag: Bag) -> str:
    """Return one line on the origin of a bag, 'made by: scenario ...', for the reports."""
    run = bag.metadata
    parts = ['unknown, the bag holds no configuration']
    if 'pacing' in run:
        of_run = [f'scenario {run.get("scenario", "")}', run['pacing'], f'seed {run.get("seed", "")}']
        by_hand = ['a graph started by hand', run['pacing']]
        parts = [*(of_run if bag.configuration['scenario'] else by_hand),
                 f'git {run.get("git") or "unknown"}']
        parts += [f'{key.removeprefix("version.")} {value}' for key, value in run.items()
                  if key.startswith('version.')]
    recovered = bag.metadata_records.get('recovered')
    if recovered:
        parts.append(f'recovered ({recovered.get("messages_lost")} messages lost in the middle)')
    return 'made by: ' + ', '.join(parts)
