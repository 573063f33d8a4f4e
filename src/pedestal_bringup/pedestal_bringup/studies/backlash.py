"""Backlash: bias schedules, reversal and standstill with and without bias torque, two speed loops against one."""
from pedestal_bringup.studies import experiment
from pedestal_bringup.studies.experiment import Case, Result, row

STEP = 0.174
"""Backlash: bias schedules, reversal and standstill with and without bias torque, two speed loops against one."""


def run(progress) -> Result:
    case = Case('paper-r1', 'servo_step')
    progress(0.0, case.name)
    record = case.run()
    t, y = record['t'], record['load_position'][:, 0]
    rows = [row(case.name, 'step_overshoot_percent', experiment.overshoot_percent(y, STEP), '%', 12.0, '12 +- 1.5'),
            row(case.name, 'step_settling_2percent_s', experiment.settling_time(t, y, STEP), 's', 0.2, '0.20 +- 0.03')]

    def step():
        figure, axes = experiment.panels(1)
        axes[0, 0].plot(t, y)
        return figure
    return Result(rows, {'step': step})
