"""File with the state of the simulated plant: a restarted drive resumes there instead of at its initial angles."""
import json
import math
import os
import pathlib
import typing

from pedestal_common.parameters import ParameterError
from pedestal_common.quantities import Radians


class PlantState(typing.NamedTuple):
    """State of the plant that a restart keeps."""
    azimuth: Radians        # of the load, whole turns included
    elevation: Radians
    enabled: bool           # True if the drive followed commands, or was about to follow them
    pinned: bool = False    # True if a stow pin was not out


def read(path: str) -> PlantState | None:
    """Return the state in a file, or None if there is no file. Raises ParameterError for invalid content."""
    try:
        values = json.loads(pathlib.Path(path).read_text())
        state = PlantState(float(values['azimuth']), float(values['elevation']), values['enabled'] is True,
                           values.get('pinned') is True)
        if not math.isfinite(state.azimuth + state.elevation):
            raise ValueError('an angle is not finite')
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ParameterError(f"state_file = '{path}': holds no state of a drive ({error}); move it away to start at "
                             'initial_azimuth and initial_elevation') from None
    return state


def write(path: str, state: PlantState) -> None:
    """Replace a file by one with a state, in one operation. Raises OSError if the disk refuses it."""
    new = f'{path}.new'
    with open(new, 'w') as file:
        json.dump(state._asdict(), file)
    os.replace(new, path)
