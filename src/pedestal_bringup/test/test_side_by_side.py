"""Trials side by side on lanes against each of them alone: equal to the last bit, in vectors."""
import re

import numba
import pytest

from adu_drive import drive_unit, lanes
from adu_drive import unit as adu_unit
from pedestal_bringup.loop import closed_loop, side_by_side
from pedestal_bringup.scenario import scenario
from pedestal_workbench.trials import ensemble

CHANGES = (
    (), ('adu.azimuth.load.inertia=170', 'adu.transport_delay=0.003',
         'acu.commands=1 stop; 1.5 excite axis=azimuth peak=0.02 duration=1'),
    ('adu.azimuth.structure.inertia_share=0.3', 'adu.elevation.structure.inertia_share=0.2'),
    ('adu.wind.azimuth=300', 'adu.wind.elevation=-200', 'adu.wind.gust.kind=davenport'),
    ('adu.wind.field.speed=12', 'adu.mount.tilt_forward=1e-3', 'adu.azimuth.speed_loop.structure=independent'),
    ('adu.elevating.about_beam=100', 'adu.elevating.about_lift=120', 'adu.azimuth.bias.schedule=off'),
    ('adu.wind.gust.kind=step', 'adu.wind.gust.azimuth=9000', 'adu.wind.gust.start=0.5'),
    ('adu.azimuth.speed_loop.disturbance_observer=400', 'acu.azimuth.filter.kind=ca', 'adu.initially_enabled=false'),
    ('adu.azimuth.faults.overspeed=0.01', 'acu.commands=1 stop; 2 autotrack'))
"""Of the trials: load, delay, excitation, structure, wind, loops, bodies that turn, a drive on its brakes, two that
trip (a gust takes all torque; a low limit)."""


def loops():
    return [closed_loop.Loop(scenario.load('leo_pass', changes, seed=seed, duration=3.0))
            for seed, changes in enumerate(CHANGES)]


@pytest.fixture(scope='module')
def fitting():
    """Loops before their run."""
    return loops()


def test_every_trial_is_what_it_is_alone():
    """All that the topics tell, and the whole memory of drive, receiver and control unit at the end."""
    together = loops()
    assert side_by_side.can_run_parallel(together)
    alone = loops()
    for found, loop in zip(side_by_side.runs(together, ensemble.MEASURED_TOPICS), alone, strict=True):
        expected = loop.run()
        assert found.forecasts == expected.forecasts
        for topic in ensemble.MEASURED_TOPICS:
            assert found[topic].tobytes() == expected[topic].tobytes(), topic
        for name, unit in expected.units.items():
            theirs = found.units[name].memory.record
            for part in theirs.dtype.names:
                assert theirs[part].tobytes() == unit.memory.record[part].tobytes(), (name, part)
    assert [i for i, loop in enumerate(alone) if loop.units['adu'].tripped] == [6, 8]


@pytest.mark.parametrize('change', ['adu.azimuth.gear_train.runout=1e-5', 'adu.elevation.encoder.error.zero=1e-5',
                                    'adu.azimuth.encoder.error.age=1e-3',
                                    'adu.inject=1 gust torque=100', 'scenario.ship=true', 'adu.period=0.01'])
def test_what_does_not_fit_runs_alone(fitting, change):
    """One trial that is of another kind is enough."""
    assert side_by_side.can_run_parallel(fitting)
    assert not side_by_side.can_run_parallel(fitting[:side_by_side.MIN_PARALLEL_LOOPS - 1])
    other = closed_loop.Loop(scenario.load('leo_pass', [change], duration=3.0))
    assert not side_by_side.can_run_parallel([*fitting[1:], other])


def test_the_plant_is_compiled_to_vectors():
    """The divides of friction, of every lane, are packed: of eight or of four numbers at once."""
    @numba.njit(error_model='numpy')
    def period(flat):
        drives = adu_unit.DRIVE_LANES(flat)
        drive_unit.between_speed_periods(drives.state.azimuth, drives.constants.azimuth, 2)

    period(lanes.to_lanes(adu_unit.DriveRecord.zeros()))
    assembly, = period.inspect_asm().values()
    assert len(re.findall(r'vdivpd\s.*%[yz]mm', assembly)) >= 3
