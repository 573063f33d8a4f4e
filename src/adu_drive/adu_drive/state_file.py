"""File with the state of the simulated plant: a restarted drive resumes there instead of at its initial angles."""
import json
import math
import os
import pathlib
import typing

from pedestal_common.parameters import ParameterError


class PlantState(typing.NamedTuple):
    """State of the plant that a restart keeps.

    azimuth, elevation: load angles, whole turns included [rad]; enabled: True if the drive followed commands, or was
    about to follow them; pinned: True if a stow pin was not out.
    """
    azimuth: float
    elevation: float
    enabled: bool
    pinned: bool = False


def read(path):
    """Return the PlantState in a file, or None if there is no file. Raises ParameterError for invalid content."""
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


def write(path, state):
    """Replace a file by one with a PlantState, in one operation. Raises OSError if the disk refuses it."""
    new = f'{path}.new'
    with open(new, 'w') as file:
        json.dump(state._asdict(), file)
    os.replace(new, path)
