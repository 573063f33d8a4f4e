"""Cases: scenarios with changed parameters, run in the closed loop without ROS.

The studies describe their runs as cases.
"""
import dataclasses
import math
import shlex

from pedestal_bringup.loop import closed_loop
from pedestal_bringup.scenario import scenario


@dataclasses.dataclass(frozen=True)
class Case:
    """A scenario with changed parameters.

    name         name of the case in the results
    scenario     name or path of the scenario
    parameters   {'node.key': value} of the changed parameters
    duration     [s]; None for that of the scenario
    seed         None for that of the scenario
    """
    name: str
    scenario: str
    parameters: dict = dataclasses.field(default_factory=dict)
    duration: float | None = None
    seed: int | None = None

    def with_seed(self, seed):
        """Return this Case with another seed."""
        return dataclasses.replace(self, seed=seed)

    def loaded(self):
        """Return the scenario.Scenario of this case."""
        return scenario.load(self.scenario, self.overrides(), duration=self.duration, seed=self.seed)

    def run(self):
        """Run the closed loop of this case and return its closed_loop.Run."""
        return closed_loop.Loop(self.loaded()).run()

    def overrides(self):
        """Return the parameters as texts node.key=value."""
        return [f'{key}={value}' for key, value in self.parameters.items()]

    def command(self):
        """Return the command that runs this case in the graph."""
        duration = [] if self.duration is None else ['--duration', f'{self.duration:g}']
        parameters = [part for override in self.overrides() for part in ('--param', override)]
        seed = [] if self.seed is None else ['--seed', str(self.seed)]
        return shlex.join(['pedestal', 'run', self.scenario, *duration, *seed, *parameters])


def sine_case(case, w, periods):
    """Return the Case with a target that moves in a sine of w [rad/s] for a number of periods.

    The duration is up to 12 ms longer, so that the last period is complete.
    """
    step = 0.002
    duration = math.ceil((2.0 * math.pi * periods / w + 0.01) / step) * step
    parameters = {**case.parameters, 'tracking_receiver.target.angle.frequency': w / (2.0 * math.pi)}
    return dataclasses.replace(case, parameters=parameters, duration=round(duration, 3))
