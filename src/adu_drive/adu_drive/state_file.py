"""Where a simulated plant was left, in a small file: a restarted drive goes on there and is not teleported."""
import json
import math
import os
import pathlib
import typing

from pedestal_common.parameters import ParameterError


class PlantState(typing.NamedTuple):
    """Load angles [rad], turns included; enabled: whether the drive followed commands, or would once its brakes are
    free; pinned: whether a stow pin was not out."""
    azimuth: float
    elevation: float
    enabled: bool
    pinned: bool = False


def read(path):
    """The Left of a file, None where there is none. Raises ParameterError for a file that holds something else."""
    try:
        values = json.loads(pathlib.Path(path).read_text())
        left = PlantState(float(values['azimuth']), float(values['elevation']), values['enabled'] is True,
                          values.get('pinned') is True)
        if not math.isfinite(left.azimuth + left.elevation):
            raise ValueError('an angle is not finite')
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ParameterError(f"state_file = '{path}': holds no state of a drive ({error}); move it away to start at "
                             'initial_azimuth and initial_elevation') from None
    return left


def write(path, left):
    """Put a Left into a file, whole or not at all. Raises OSError."""
    new = f'{path}.new'
    with open(new, 'w') as file:
        json.dump(left._asdict(), file)
    os.replace(new, path)
