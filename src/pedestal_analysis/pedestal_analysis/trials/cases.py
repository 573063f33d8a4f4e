"""Cases: scenarios with changed parameters, run in the closed loop without ROS.

The studies describe their runs as cases.
"""
import dataclasses
import math
import shlex
from collections.abc import Mapping

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.loop.closed_loop import Run
from pedestal_bringup.scenario import scenario
from pedestal_bringup.scenario.scenario import Scenario
from pedestal_common.quantities import Json, RadiansPerSecond, Seconds


@dataclasses.dataclass(frozen=True)
class Case:
    """A scenario with changed parameters."""
    name: str       # of the case in the results
    scenario: str   # its name or path
    parameters: Mapping[str, Json] = dataclasses.field(default_factory=dict)    # {'node.key': changed value}
    duration: Seconds | None = None     # None for that of the scenario
    seed: int | None = None             # None for that of the scenario

    def with_seed(self, seed: int | None) -> 'Case':
        """Return this case with another seed."""
        return dataclasses.replace(self, seed=seed)

    def loaded(self) -> Scenario:
        """Return the scenario of this case."""
        return scenario.load(self.scenario, self.overrides(), duration=self.duration, seed=self.seed)

    def run(self) -> Run:
        """Run the closed loop of this case."""
        return closed_loop.Loop(self.loaded()).run()

    def overrides(self) -> list[str]:
        """Return the parameters as texts node.key=value."""
        return [f'{key}={value}' for key, value in self.parameters.items()]

    def command(self) -> str:
        """Return the command that runs this case in the graph."""
        duration = [] if self.duration is None else ['--duration', f'{self.duration:g}']
        parameters = [part for override in self.overrides() for part in ('--param', override)]
        seed = [] if self.seed is None else ['--seed', str(self.seed)]
        return shlex.join(['pedestal', 'run', self.scenario, *duration, *seed, *parameters])


def sine_case(case: Case, w: RadiansPerSecond, periods: float) -> Case:
    """Return the case with a target that moves in a sine of w for a number of periods.

    The duration is up to 12 ms longer, so that the last period is complete.
    """
    step = 0.002
    duration = math.ceil((2.0 * math.pi * periods / w + 0.01) / step) * step
    parameters = {**case.parameters, 'tracking_receiver.target.angle.frequency': w / (2.0 * math.pi)}
    return dataclasses.replace(case, parameters=parameters, duration=round(duration, 3))
