"""Flexible structure of an axis: its parameters, once in the drive, whose simulated plant swings so, and once in the
control unit, which limits its filter by it. If a scenario does not set the structure of the control unit,
`pedestal run` gives the control unit that of the drive."""
import dataclasses

from pedestal_common.parameters import Parameters, parameter


@dataclasses.dataclass(frozen=True)
class StructureParameters(Parameters):
    """Flexible structure: the dish swings on the rest of the load, to which gear and encoder are attached."""
    inertia_share: float = parameter(0.0, 0.0, 0.9, '', 'share of the dish in the load inertia; 0: rigid; if above 0, '
                                   '`pedestal tune --loops` finds loops')
    frequency: float = parameter(12.0, 1.0, 200.0, 'Hz', 'frequency of the dish on a locked base')
    damping: float = parameter(0.01, 0.0, 1.0, '', 'damping ratio of the dish on a locked base')
