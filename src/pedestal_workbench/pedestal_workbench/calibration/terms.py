"""Terms of the pointing model to first order: names, meaning, and the effect of each term on the sky.

Convention: the sum of the terms is ADDED to the wanted direction to give the angles of the encoders. The VLBI Field
System and katpoint have the same numbers and signs. The law of the control unit, with exact rotations, is
pedestal_common.geometry.pointing_model.

az, el   azimuth, clockwise from north, and elevation of the wanted direction [rad]
"""
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pedestal_common.quantities import Floats, Pairs


class Term(NamedTuple):
    """A term of the pointing model."""
    name: str       # P and its number in the VLBI Field System
    meaning: str    # cause of the term, as a noun
    tpoint: str     # its name in TPOINT, with the sign for the conversion
    # of azimuth and elevation: offsets of a term of 1, cross-elevation and elevation [rad] or [rad per rad]
    effect: Callable[[Floats, Floats], tuple[float | Floats, float | Floats]]
    factor: bool = False    # True for a factor [-]; the other terms are angles

    @property
    def unit(self) -> str:
        """Unit of the term; '' for a factor."""
        return '' if self.factor else 'deg'


TERMS = (
    Term('P1', 'zero of the azimuth encoder', '-IA', lambda az, el: (np.cos(el), 0.0)),
    Term('P3', 'non-perpendicularity of the axes', '-NPAE', lambda az, el: (np.sin(el), 0.0)),
    Term('P4', 'collimation of the beam', 'CA', lambda az, el: (-1.0, 0.0)),
    Term('P5', 'tilt of the azimuth axis to north', 'AN', lambda az, el: (np.sin(az) * np.sin(el), np.cos(az))),
    Term('P6', 'tilt of the azimuth axis to east', '-AW', lambda az, el: (-np.cos(az) * np.sin(el), np.sin(az))),
    Term('P7', 'zero of the elevation encoder', 'IE', lambda az, el: (0.0, 1.0)),
    Term('P8', 'sag of the dish', '-TF', lambda az, el: (0.0, np.cos(el))),
    Term('P9', 'scale of the elevation encoder', 'PEE1', lambda az, el: (0.0, el), True),
    Term('P11', 'asymmetric sag', 'ECES', lambda az, el: (0.0, np.sin(el))),
    Term('P12', 'scale of the azimuth encoder', '-PAA1', lambda az, el: (az * np.cos(el), 0.0), True),
    Term('P13', 'eccentricity of the azimuth encoder', 'ACEC', lambda az, el: (np.cos(az) * np.cos(el), 0.0)),
    Term('P14', 'eccentricity of the azimuth encoder', '-ACES', lambda az, el: (np.sin(az) * np.cos(el), 0.0)),
    Term('P15', 'nod twice per turn', 'HECA2', lambda az, el: (0.0, np.cos(2.0 * az))),
    Term('P16', 'nod twice per turn', '-HESA2', lambda az, el: (0.0, np.sin(2.0 * az))),
    Term('P17', 'tilt of the azimuth encoder', '-HACA2', lambda az, el: (np.cos(2.0 * az) * np.cos(el), 0.0)),
    Term('P18', 'tilt of the azimuth encoder', 'HASA2', lambda az, el: (np.sin(2.0 * az) * np.cos(el), 0.0)),
    Term('P19', 'eight periods of the elevation encoder', 'HECE8', lambda az, el: (0.0, np.cos(8.0 * el))),
    Term('P20', 'eight periods of the elevation encoder', 'HESE8', lambda az, el: (0.0, np.sin(8.0 * el))),
    Term('P21', 'nod once per turn', '-HECA', lambda az, el: (0.0, np.cos(az))),
    Term('P22', 'nod once per turn', 'HESA', lambda az, el: (0.0, np.sin(az))))
"""All terms. P2 and P10 do not exist, because other terms have the same effect."""

TERM_BY_NAME = {term.name: term for term in TERMS}
DEFAULT_TERMS = ('P1', 'P3', 'P4', 'P5', 'P6', 'P7', 'P8')
"""Names of the terms that are fitted by default: the geometry of the pedestal and the sag."""

FULL_TURN_TERMS = frozenset(('P5', 'P6', 'P13', 'P14', 'P15', 'P16', 'P17', 'P18', 'P21', 'P22'))
"""Names of the terms whose effect depends on the azimuth, with a period of one turn or half a turn."""


def chosen(text: str) -> tuple[str, ...]:
    """Return the names of the terms in a text such as 'P1,P7' or 'p1 p7', in the order of TERMS. Raises ValueError."""
    words = text.replace(',', ' ').upper().split()
    given = [word if word.startswith('P') else f'P{word}' for word in words]
    for word, name in zip(words, given):
        if name in ('P2', 'P10'):
            raise ValueError(f'--terms {word}: {name} does not exist for this mount, because '
                             f'{"P1 and P3" if name == "P2" else "P8"} has the same effect')
        if name not in TERM_BY_NAME:
            raise ValueError(f'--terms {word:.40}: must be one of {", ".join(TERM_BY_NAME)}')
        if given.count(name) > 1:
            raise ValueError(f'--terms {word}: is given twice')
    if not given:
        raise ValueError(f'--terms: must name at least one of {", ".join(TERM_BY_NAME)}')
    return tuple(name for name in TERM_BY_NAME if name in given)


def design(names: Sequence[str], directions: Pairs) -> Floats:
    """Return the matrix (n, 2, p) of the offsets on the sky for p terms of 1 at directions [deg]. Multiplied by the
    terms [deg, -], the matrix gives cross-elevation and elevation [deg]."""
    az, el = np.radians(directions).T
    matrix = np.empty((len(directions), 2, len(names)))
    for i, name in enumerate(names):
        term = TERM_BY_NAME[name]
        for axis, effect in enumerate(term.effect(az, el)):
            matrix[:, axis, i] = np.degrees(effect) if term.factor else effect
    return matrix
