"""The scenarios that come with the product. A module of its own, because the list of the scenarios needs no numpy."""
import importlib.resources
import typing

from pedestal_common.text_files import plain_yaml

if typing.TYPE_CHECKING:
    from importlib.abc import Traversable


def folder() -> 'Traversable':
    """Return the folder of the scenarios that come with the product."""
    return importlib.resources.files('pedestal_bringup') / 'scenarios'


def available() -> dict[str, str]:
    """Return {name: title} of the scenarios that come with the product."""
    titles = {}
    for entry in sorted(folder().iterdir(), key=lambda entry: entry.name):
        if entry.name.endswith('.yaml'):
            sections = plain_yaml.parse(entry.read_text())
            titles[entry.name[:-5]] = sections['scenario']['ros__parameters']['title']
    return titles
