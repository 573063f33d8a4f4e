"""How a bag was made: scenario, parameters of all nodes, versions and git revision, as text for its metadata.

Nothing here depends on the path, the host or the wall clock, so that equal runs still give equal bytes.
"""
import contextlib
import importlib.metadata
import pathlib
import platform
import subprocess

import yaml

from pedestal_common import parameters
from pedestal_common.text_files import plain_yaml

VERSIONED_PACKAGES = ('pedestal_common', 'ship_motion_sim', 'tracking_receiver_sim', 'acu_tracker', 'adu_drive',
                      'pedestal_bringup', 'numpy', 'numba', 'rclpy')
GIT_TIMEOUT_S = 5.0
OMITTED_PARAMETERS = ('bag', 'scenario_yaml', 'parameters_yaml')
"""Parameters of the recorder that are no part of how a run was made: where to, and the configuration itself."""


def _git(*arguments):
    """What a git command on this source tree prints; '' when it fails, or there is no git."""
    try:
        done = subprocess.run(['git', '--no-optional-locks', *arguments], cwd=pathlib.Path(__file__).parent,
                              capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return ''
    return done.stdout.strip()


def git_revision():
    """Revision of the source tree this file is kept in, '-dirty' when a file of it is changed; '' when it is in none
    (installed, also into an environment that lies in somebody's repository)."""
    if not _git('ls-files', '--error-unmatch', pathlib.Path(__file__).name):
        return ''
    # Not `git describe --dirty`, which takes the lock of the index and writes it, whatever it is told.
    revision = _git('rev-parse', '--verify', 'HEAD')
    return revision + ('-dirty' if revision and _git('status', '--porcelain', '--untracked-files=no') else '')


def versions():
    """{'version.NAME': version} of Python, of our packages and of those that make the numbers."""
    versions = {'version.python': platform.python_version()}
    for package in VERSIONED_PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[f'version.{package}'] = importlib.metadata.version(package)
    return versions


def recorder_parameters(scenario):
    """The recorder's parameters {name: text} that describe a scenario.Scenario."""
    values = {node: parameters.as_dict(scenario.node_parameters(node))
              for node in scenario.nodes if node != 'operator'}
    values['recorder'] = {key: value for key, value in values['recorder'].items() if key not in OMITTED_PARAMETERS}
    return {'scenario_yaml': scenario.as_yaml(), 'parameters_yaml': yaml.safe_dump(values)}


def records(scenario_yaml, parameters_yaml):
    """The metadata records {name: {text: text}} of the texts that recorder_parameters gave; none of an empty one."""
    content = {}
    if scenario_yaml:
        content['scenario'] = {'yaml': scenario_yaml}
    if parameters_yaml:
        content['parameters'] = {node: yaml.safe_dump(values)
                                 for node, values in plain_yaml.parse(parameters_yaml).items()}
    return content


def line(bag):
    """One line on how a bag.Bag was made."""
    run = bag.metadata
    parts = ['not said in the bag, it holds no configuration']
    if bag.configuration['scenario']:
        parts = [f'scenario {run.get("scenario", "")}', run.get('pacing', ''), f'seed {run.get("seed", "")}',
                 f'git {run.get("git") or "unknown"}']
        parts += [f'{key.removeprefix("version.")} {value}' for key, value in run.items()
                  if key.startswith('version.')]
    recovered = bag.metadata_records.get('recovered')
    if recovered:
        parts.append(f'recovered ({recovered.get("messages_lost")} messages lost in the middle)')
    return 'made by: ' + ', '.join(parts)
