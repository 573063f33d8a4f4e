"""Rules of a scenario: the parameters of a node that follow from those of other nodes, the header or a file."""
import dataclasses
import itertools
import math
import typing
from collections.abc import Mapping

import numpy as np

from pedestal_bringup.scenario.header import ScenarioParameters
from pedestal_bringup.scenario.sections import (
    AnyParameters,
    ScenarioError,
    Sections,
    checked_section,
    row_of,
    values_of,
)
from pedestal_common import parameters
from pedestal_common.geometry.geodesy import STATION_NAMES
from pedestal_common.graph import nodes, topics
from pedestal_common.quantities import Seconds, Value
from pedestal_common.structure import StructureParameters

if typing.TYPE_CHECKING:
    from pedestal_hardware.monopulse.params import MonopulseParameters
    from tracking_receiver_sim.params import TargetParameters

SHARED_PARAMETERS = (
    ('adu', 'period', 'acu', 'tracker.receiver.integration'),
    ('adu', 'transport_delay', 'acu', 'command_delay'),
    ('tracking_receiver', 'receiver.latency', 'acu', 'receiver_latency'),
    ('tracking_receiver', 'antenna.beamwidth', 'acu', 'tracker.receiver.beamwidth'),
    ('tracking_receiver', 'antenna.slope', 'acu', 'tracker.receiver.slope'),
    ('tracking_receiver', 'antenna.beamwidth', 'recorder', 'beamwidth'),
    ('tracking_receiver', 'receiver.cn0_dbhz', 'acu', 'tracker.receiver.cn0_dbhz'),
    ('tracking_receiver', 'receiver.cn0_time_constant', 'acu', 'acquisition.time_constant'),
    ('ins', 'latency', 'acu', 'attitude_latency'),
    ('ship_motion', 'imu.output', 'ins', 'imu_output'),
    *(('adu', key, 'acu', key) for axis in topics.AXES for field in dataclasses.fields(StructureParameters)
      for key in (f'{axis}.structure.{field.name}',)),
    *(('tracking_receiver', f'lever_arm.{axis}', 'acu', f'lever_arm.{axis}') for axis in 'xyz'),
    ('tracking_receiver', 'blockage', 'acu', 'blockage'),
    ('tracking_receiver', 'target.leo_pass.start_time', 'acu', 'prediction.start_time'),
    *(('tracking_receiver', f'target.station.{name}', 'acu', f'prediction.station.{name}')
      for name in STATION_NAMES),
)
"""(node, parameter, second node, parameter): the second takes the value of the first where the scenario does not set
it."""

MEASUREMENT_FLAGS = tuple((node.name, topic.measured, topic.flag) for node in nodes.NODES if node.name != 'acu'
                          for topic in map(topics.TOPIC_BY_NAME.__getitem__, node.writes) if topic.measured)
"""(publisher, name of its parameter `measured`, name of the subscribers' parameter `flag`) of each optional topic.
Both parameters are true if the topic exists (topics.Topic)."""

SCANS_BEFORE_COAST = 2.5  # number of errors of a feed with one output that must be missing before autotrack coasts

SIMULATED_BUS = {'bus.interface': 'socketcand', 'bus.host': '127.0.0.1'}
"""{parameter of drive_node: its only value with simulated drives}, because their bus is a server on this machine."""

IQ_LATENCY_STEPS = 2  # latency of a receiver of I/Q samples for the control unit, in steps of the drive

LIMIT_ENDS = (('low', 'lower', 1.0), ('high', 'upper', -1.0))
"""Ends of the travel of an axis: (name in the control unit, name in the drive, sign of the direction into the travel).
"""


def target_of(name: str, receiver_values: Mapping[str, Value],
            header_values: Mapping[str, Value]) -> 'TargetParameters':
    """Return the target parameters of the section `tracking_receiver`."""
    iq = header_values.get('receiver', 'simulated') != 'simulated'
    receiver: AnyParameters = checked_section(name, 'tracking_receiver',
                                       nodes.row('tracking_receiver', iq=iq).parameters_type(), receiver_values)
    return receiver.target


def derive_from_flight(name: str, receiver_values: dict[str, Value],
                        header_values: dict[str, Value]) -> None:
    """Set the parameters that the scenario lacks, from the file of a target's path: station, reference range,
    duration, and for the file of an orbit also the start time. Raises ScenarioError, TableError."""
    target = target_of(name, receiver_values, header_values)
    if target.track_file.path and target.kind != 'track_file':
        raise ScenarioError(f'scenario {name}, tracking_receiver: target.track_file.path = '
                            f'{target.track_file.path!r:.60}: has no effect with target.kind = {target.kind}; take '
                            'target.kind = track_file')
    if not target.track_file.path:
        return
    from tracking_receiver_sim.tracks import files  # imported late, because only a flight needs scipy
    given = {*receiver_values, *({'duration'} & set(header_values))}
    if not given.issuperset(files.DERIVED_PARAMETERS):
        for key, value in files.derived_parameters(target, given).items():
            (header_values if key == 'duration' else receiver_values).setdefault(key, value)


@dataclasses.dataclass(frozen=True)
class _Rules:
    """Rules for the sections of one scenario; each changes the sections. seed: that of scenario.checked."""
    name: str
    sections: Sections
    header: ScenarioParameters
    seed: int | None

    def share(self, node: str, key: str, value: Value) -> None:
        """Give a node a parameter. Raises ScenarioError if one of its sections has another value."""
        self.sections[node].setdefault(key, value)
        for section in [section for section in self.sections if nodes.plain(section) == node]:
            own = self.sections[section].get(key, value)
            if own != value:
                raise ScenarioError(f'scenario {self.name}, {section}: {key} = {own}: must be {value}, as for the '
                                    'other nodes; leave it out here')

    def value_of(self, node: str, key: str, otherwise: Value = None) -> Value:
        """Return the value of a node, or its default."""
        default = parameters.defaults(row_of(node, self.header).parameters_type()).get(key, otherwise)
        return self.sections[node].get(key, default)

    def share_run(self) -> None:
        """Share duration, seeds, ship and period of a step."""
        header, sections = self.header, self.sections
        for node in ('adu', 'recorder', 'tracking_receiver'):
            self.share(node, 'duration', header.duration)
        self.share('recorder', 'scenario', self.name)
        self.share('recorder', 'seed', header.seed)
        for node, key in (('ship_motion', 'ship.seed'), ('ship_motion', 'imu.seed'), ('ins', 'seed'),
                          ('tracking_receiver', 'seed')):
            if self.seed is not None or key not in sections[node]:
                sections[node][key] = header.seed
        for key, value in sections['ship_motion'].items():
            if key.startswith('ship.'):
                self.share('ins', key, value)
        for node in ('acu', 'tracking_receiver'):
            self.share(node, 'period', self.value_of('adu', 'period'))

    def share_flags(self) -> None:
        """Share the flags of the optional topics that exist. A flag that the scenario itself sets is checked too."""
        sections = self.sections
        for owner, key, flag in MEASUREMENT_FLAGS:
            # A program of the user measures only what the scenario states.
            measured = ((self.header.ship or not nodes.row(owner).optional)
                        and (sections[owner].get(key, False) if owner in self.header.own_programs else
                             self.value_of(owner, key, False)))
            for node in ('acu', 'recorder'):
                if measured or any(flag in values for section, values in sections.items()
                                   if nodes.plain(section) == node):
                    self.share(node, flag, measured)
        # With the flag ins_error the control unit takes the errors of the attitude from the INS, so its own parameters
        # tracker.attitude have no effect.
        modelled = [(section, key) for section in sections for key in sections[section]
                    if key.startswith('tracker.attitude.')]
        if modelled and sections['acu'].get('ins_error'):
            section, key = modelled[0]
            raise ScenarioError(f'scenario {self.name}, {section}: {key}: the INS publishes its errors; this '
                                'parameter needs ins.error_told = false')

    def share_iq(self) -> None:
        """Share the latency of a receiver of I/Q samples. The error of a block of samples has the stamp of its middle,
        and arrives one step after its end."""
        of_iq: AnyParameters = checked_section(self.name, 'tracking_receiver',
                                               nodes.MONOPULSE_RECEIVER.parameters_type(),
                                               values_of(self.sections, 'tracking_receiver'))
        latency = (IQ_LATENCY_STEPS + 0.5 * (of_iq.steps_per_error - 1)) * of_iq.period
        self.sections['acu'].setdefault('receiver_latency', latency)
        if of_iq.feed.scanned:
            _share_scan(self.name, of_iq, latency, self.sections['acu'])

    def share_servo(self) -> None:
        """Share bus and delay of simulated servo drives."""
        for key, value in SIMULATED_BUS.items():
            if self.sections['adu'].get(key, value) != value:
                raise ScenarioError(f'scenario {self.name}, adu: {key} = {self.sections["adu"][key]}: must be {value} '
                                    f'with drives = {self.header.drives}')
        # A command acts with the synchronisation after the one that its joint states belong to.
        self.sections['acu'].setdefault('command_delay', self.value_of('adu', 'period'))

    def share_age(self) -> None:
        """Share the ages of errors and beam of an array, whose beam is held between two steps."""
        # Imported late, because its laws take half a second to import.
        from tracking_receiver_sim import receiver
        self.sections['tracking_receiver'].setdefault('receiver.beam', 'held')
        for prefix in nodes.prefixes(self.header.graph_beams):
            tracking: AnyParameters = checked_section(
                self.name, f'{prefix}tracking_receiver', nodes.row('tracking_receiver').parameters_type(),
                values_of(self.sections, f'{prefix}tracking_receiver'))
            for key, value in (('age', receiver.age(tracking, tracking.period)),
                               ('beam_age', receiver.beam_age(tracking, tracking.period))):
                if f'tracker.receiver.{key}' not in self.sections['acu']:
                    self.sections[f'{prefix}acu'].setdefault(f'tracker.receiver.{key}', value)


def share(name: str, sections: Sections, header: ScenarioParameters, seed: int | None) -> None:
    """Give every node the parameters that several nodes share. seed: argument of scenario.checked. Raises
    ScenarioError if the section of a node has another value."""
    rules = _Rules(name, sections, header, seed)
    rules.share_run()
    rules.share_flags()
    if header.iq:
        rules.share_iq()
    if header.servo:
        rules.share_servo()
    for owner, key, node, known_as in SHARED_PARAMETERS:
        # A control unit has no default position. Because a scenario simulates the antenna, its default place will do.
        if key in sections[owner] or known_as.startswith('prediction.station.'):
            sections[node].setdefault(known_as, rules.value_of(owner, key))
    if header.beam:
        rules.share_age()


def _share_scan(name: str, receiver: 'MonopulseParameters', latency: Seconds, values: dict[str, Value]) -> None:
    """Give the section `acu` the parameters that follow from a feed with one output: the noise of its errors, and the
    time between them. latency: age of the errors. Raises ScenarioError for a scan that is too slow."""
    # Imported late, because their laws take half a second to import.
    from acu_tracker.geometry.history import MAX_DELAY_STEPS
    from pedestal_hardware.monopulse import feed
    oldest = MAX_DELAY_STEPS * receiver.period
    if latency > oldest:
        raise ScenarioError(f'scenario {name}, tracking_receiver: feed.scan_rate = {receiver.feed.scan_rate:g} Hz: '
                            f'its errors are up to {latency:g} s old, must be at most {oldest:g} s')
    values.setdefault('tracker.receiver.integration', feed.effective_integration(receiver))
    coast_after = SCANS_BEFORE_COAST * receiver.steps_per_error * receiver.period
    if coast_after > parameters.defaults(nodes.row('acu').parameters_type())['tracker.coast_after']:
        values.setdefault('tracker.coast_after', coast_after)


def share_with_beam(name: str, node: str, sections: Sections, header: ScenarioParameters, seed: int | None) -> None:
    """Give a node of one beam, such as beam_2/acu, the parameters that it shares with the other nodes of this beam.
    The receiver of the beam gets a seed of its own for its noise."""
    values, beam = sections[node], nodes.beam_of(node)
    own_receiver = f'{beam}/tracking_receiver'
    if node == own_receiver and (seed is not None or 'seed' not in values):
        spread = np.random.SeedSequence((header.seed, int(beam.removeprefix('beam_'))))
        # Seeds are below 2^31.
        values['seed'] = int(spread.generate_state(1)[0] >> 1)
    for owner, key, other, known_as in SHARED_PARAMETERS:
        own = sections.get(f'{beam}/{owner}', {})
        if nodes.plain(node) == other and key in own:
            values.setdefault(known_as, own[key])
    for _, key, _ in MEASUREMENT_FLAGS:
        if key in sections[own_receiver]:
            raise ScenarioError(f'scenario {name}, {own_receiver}: {key}: must be equal for every beam; set it in '
                                'tracking_receiver')


def narrow(sections: Sections, header: ScenarioParameters) -> tuple[str, ...]:
    """Set each limit of travel of a control unit to that of the drive if the drive's limit is narrower. Return a line
    for each limit changed. Control unit and drive have equal defaults, so a scenario that sets no limit is not
    changed."""
    if header.beam:
        return ()
    drive, notes = nodes.row('adu').parameters_type(), []
    acu_defaults, drive_defaults = parameters.defaults(nodes.row('acu').parameters_type()), parameters.defaults(drive)
    for section in [section for section in sections if nodes.plain(section) == 'acu']:
        for axis, (end, drive_end, inward) in itertools.product(topics.AXES, LIMIT_ENDS):
            own, of_drive = f'{axis}.limits.{end}', f'{axis}.limits.{drive_end}'
            wide: Value = values_of(sections, section).get(own, acu_defaults[own])
            narrow: Value = sections['adu'].get(of_drive, drive_defaults[of_drive])
            if inward * (narrow - wide) > 0.0:
                sections[section][own] = narrow
                notes.append(f'{section}.{own} = {wide:g} rad is wider than the travel of the drive: '
                             f'adu.{of_drive} = {narrow:g} rad ({math.degrees(narrow):.1f} deg) holds')
    return tuple(notes)
