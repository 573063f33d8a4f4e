"""The four cores composed without ROS: the closed loop of a scenario as one compiled call, for studies and benches.

The order within a step is the graph's: ship, INS, receiver, control unit, drive. Each core is the same compiled step
its node calls and draws the same noise, so a run here equals the lockstep run of the scenario to the last bit.
"""
import dataclasses

import numpy as np

from acu_tracker import control_unit
from acu_tracker.program import program_track
from adu_drive import drive_unit, electronic_beam
from adu_drive.beam_unit import Beam
from pedestal_bringup.run.program import program_table
from pedestal_common import line_of_sight, noise
from pedestal_common.compiled import compiled
from ship_motion_sim import imu, ins, motion
from tracking_receiver_sim import receiver, target

RESULT = np.dtype([('t', 'f8'), ('position', 'f8', 2), ('load_position', 'f8', 2), ('torque', 'f8', 2),
                   ('motor_torque', 'f8', (2, 2)), ('motor_velocity', 'f8', (2, 2)), ('bias', 'f8', 2),
                   ('rate', 'f8', 2), ('feedforward', 'f8', 2), ('measured', 'f8', 2), ('true_error', 'f8', 2),
                   ('estimate', 'f8', (2, 3)), ('reference', 'f8', (2, 3)), ('mode', 'i8'),
                   ('innovation', 'f8', 2), ('rate_innovation', 'f8', 2), ('nis', 'f8', 2),
                   ('covariance', 'f8', (2, 3)), ('probability', 'f8', (2, 4))], align=True)
"""One step t_k: encoders and true load angle [rad], torque on the load and of the motors [Nm], motor speeds [rad/s],
bias torque [Nm], the ACU's rate command [rad/s] and feed-forward torque [Nm], the receiver's error and the true one
(cross-elevation, elevation) [rad]; innovations, NIS, covariance and probabilities of control_unit.OUTPUTS."""


@dataclasses.dataclass
class Cores:
    """State, constants, inputs and outputs of the four columns of one scenario, ready for `run`."""
    ship: tuple
    ins: tuple
    receiver: tuple
    acu: tuple
    adu: tuple
    target: target.Target
    program: program_track.ProgramTrack
    streams: tuple
    period_ns: int
    steps: int
    on_ship: bool
    beam: bool


def cores(scenario, beam='') -> Cores:
    """The cores of a scenario as its nodes would make them; beam: of several, '' for the first."""
    prefix = f'{beam}/' if beam else scenario.prefixes[0]
    ship, navigation, tracking, acu, adu = map(scenario.node_parameters, (
        'ship_motion', 'ins', f'{prefix}tracking_receiver', f'{prefix}acu', 'adu'))
    if navigation.method != 'model':
        raise ValueError(f"ins.method = '{navigation.method}': must be model in the closed loop without nodes")
    built = target.build(tracking.target, tracking.duration)
    if scenario.header.beam:
        beam = Beam(adu)
        adu_core = beam.state, beam.constants, beam.inputs, beam.outputs
    else:
        adu_core = (drive_unit.initial_state(adu), drive_unit.constants(adu), np.zeros(1, drive_unit.INPUTS),
                    np.zeros(1, drive_unit.OUTPUTS))
        drive_unit.read(adu_core[0], adu_core[1], adu_core[3])
    program = program_track.NO_TRACK
    if scenario.header.program.source != 'none':
        program = program_track.checked(*program_table(scenario, prefix))
    acu_inputs = np.zeros(1, control_unit.INPUTS)
    acu_inputs['stabilised'] = scenario.header.ship
    acu_inputs['encoder_valid'] = 1
    receiver_inputs = np.zeros(1, receiver.INPUTS)
    receiver_inputs['mat_ed'] = line_of_sight.ashore_matrix()
    receiver_inputs['valid'] = 1
    return Cores(
        ship=(motion.constants(ship.ship), np.zeros(1, motion.INPUTS), np.zeros(1, motion.OUTPUTS),
              imu.initial_state(), imu.constants(ship), np.zeros(1, imu.INPUTS), np.zeros(1, imu.OUTPUTS)),
        ins=(ins.initial_state(), ins.constants(navigation), np.zeros(1, ins.INPUTS), np.zeros(1, ins.OUTPUTS)),
        receiver=(receiver.initial_state(), receiver.constants(tracking, adu.period, built), receiver_inputs,
                  np.zeros(1, receiver.OUTPUTS)),
        acu=(control_unit.initial_state(acu), control_unit.constants(acu), acu_inputs,
             np.zeros(1, control_unit.OUTPUTS)),
        adu=adu_core, target=built, program=program,
        streams=((noise.generator(ship.imu.seed, 'ship_motion'), imu.NORMALS),
                 (noise.generator(navigation.seed, 'ins'), ins.NORMALS),
                 (noise.generator(tracking.seed, 'tracking_receiver'), receiver.normals_per_step(tracking))),
        period_ns=round(adu.period * 1e9), steps=round(scenario.header.duration / adu.period),
        on_ship=scenario.header.ship, beam=scenario.header.beam)


@compiled
def _ship(k, stamp_ns, period, ship, navigation, imu_normals, ins_normals):
    """Truth, IMU and INS of step k."""
    constants, inputs, truth, imu_state, imu_constants, imu_inputs, felt = ship
    ins_state, ins_constants, ins_inputs, ins_outputs = navigation
    inputs[0].t = imu_inputs[0].t = stamp_ns * 1e-9
    motion.step(constants, inputs, truth)
    imu_inputs[0].dt = period
    imu.step(imu_state, imu_constants, constants, imu_inputs, truth, felt, imu_normals[k])
    ins_inputs[0].stamp_ns = stamp_ns
    for i in range(3):
        ins_inputs[0].angular_velocity[i] = felt[0].angular_velocity[i]
        ins_inputs[0].linear_acceleration[i] = felt[0].linear_acceleration[i]
    ins.step(ins_state, ins_constants, ins_inputs, ins_outputs, ins_normals[k])


@compiled
def _hand_over_attitude(acu_inputs, ins_outputs):
    """INS -> control unit, when a measurement is due."""
    if ins_outputs[0].due:
        acu_inputs[0].attitude_stamp = ins_outputs[0].stamp_ns * 1e-9
        acu_inputs[0].attitude_valid = 1
        for i in range(4):
            acu_inputs[0].quaternion[i] = ins_outputs[0].quaternion[i]
        for i in range(3):
            acu_inputs[0].deck_rate[i] = ins_outputs[0].angular_velocity[i]


@compiled
def _hand_over_error(acu_inputs, constants, error):
    """Receiver -> control unit, when a measurement is due; error: outputs of the receiver."""
    acu_inputs[0].error_rate[0] = acu_inputs[0].error_rate[1] = acu_inputs[0].range = np.nan
    acu_inputs[0].error_valid = error[0].due and error[0].cross_elevation == error[0].cross_elevation
    if error[0].due:
        acu_inputs[0].error_stamp = error[0].stamp_ns * 1e-9
        acu_inputs[0].cross_elevation = error[0].cross_elevation
        acu_inputs[0].elevation = error[0].elevation
        acu_inputs[0].cn0_dbhz = error[0].cn0_dbhz
        acu_inputs[0].error_rate[0], acu_inputs[0].error_rate[1] = error[0].rate[0], error[0].rate[1]
        acu_inputs[0].error_rate_sigma = constants.rate_sigma
        acu_inputs[0].range, acu_inputs[0].range_variance = error[0].range, constants.range_variance


@compiled
def _answer(k, stamp_ns, period, on_ship, ship, navigation, tracking, acu, breaks, coefficients, program,
            imu_normals, ins_normals, receiver_normals):
    """Ship, INS, receiver and control unit at step k; the inputs of the latter hold where the antenna points."""
    receiver_state, receiver_constants, seen, error = tracking
    acu_state, acu_constants, acu_inputs, acu_outputs = acu
    truth = ship[2]
    if on_ship:
        _ship(k, stamp_ns, period, ship, navigation, imu_normals, ins_normals)
        _hand_over_attitude(acu_inputs, navigation[3])
        for i in range(3):
            seen[0].position[i] = truth[0].position[i]
            seen[0].twist_linear[i] = truth[0].velocity_deck[i]
            seen[0].twist_angular[i] = truth[0].angular_velocity[i]
            for j in range(3):
                seen[0].mat_ed[i, j] = truth[0].mat_ed[i, j]
    position, velocity = acu_inputs[0].position, acu_inputs[0].velocity
    seen[0].stamp_ns = stamp_ns
    seen[0].azimuth, seen[0].elevation = position[0], position[1]
    seen[0].azimuth_rate, seen[0].elevation_rate = velocity[0], velocity[1]
    receiver.step(receiver_state, receiver_constants, seen, error, breaks, coefficients, receiver_normals[k])
    _hand_over_error(acu_inputs, receiver_constants[0], error)
    acu_inputs[0].stamp = stamp_ns * 1e-9
    control_unit.step(acu_state, acu_constants, acu_inputs, acu_outputs, program)


@compiled
def _steps(first, count, period_ns, on_ship, ship, navigation, tracking, acu, adu, breaks, coefficients, program,
           imu_normals, ins_normals, receiver_normals, deck_rate, injected, result):
    """Steps first ... first + count - 1 into result[:count]."""
    acu_inputs, acu_outputs = acu[2], acu[3]
    adu_state, adu_constants, adu_inputs, axes = adu
    truth = ship[2]
    period = period_ns * 1e-9
    for k in range(count):
        stamp_ns = (first + k) * period_ns
        azimuth, elevation = axes[0].azimuth, axes[0].elevation
        acu_inputs[0].drive_ready = axes[0].following
        acu_inputs[0].position[0], acu_inputs[0].position[1] = azimuth.position, elevation.position
        acu_inputs[0].velocity[0], acu_inputs[0].velocity[1] = azimuth.velocity, elevation.velocity
        _answer(k, stamp_ns, period, on_ship, ship, navigation, tracking, acu, breaks, coefficients, program,
                imu_normals, ins_normals, receiver_normals)
        _record(result[k], acu_inputs[0], acu_outputs[0], tracking[3][0])
        _record_axis(result[k], azimuth, 0)
        _record_axis(result[k], elevation, 1)
        if on_ship:
            for i in range(3):
                rise = (truth[0].angular_velocity[i] - deck_rate[i]) / period
                adu_inputs[0].base_acceleration[i] = rise if first + k > 0 else 0.0
                deck_rate[i] = truth[0].angular_velocity[i]
        rate, torque = acu_outputs[0].rate, acu_outputs[0].torque
        adu_inputs[0].azimuth.rate, adu_inputs[0].azimuth.torque = rate[0] + injected[k, 0], torque[0]
        adu_inputs[0].elevation.rate, adu_inputs[0].elevation.torque = rate[1] + injected[k, 1], torque[1]
        adu_inputs[0].enable = 1
        drive_unit.step(adu_state, adu_constants, adu_inputs, axes)


@compiled
def _beam_steps(first, count, period_ns, on_ship, ship, navigation, tracking, acu, adu, breaks, coefficients, program,
                imu_normals, ins_normals, receiver_normals, injected, result):
    """The same with an electronic beam in the drive's place."""
    acu_inputs, acu_outputs = acu[2], acu[3]
    beam_state, beam_constants, command, beam = adu
    acu_inputs[0].drive_ready = 1
    for k in range(count):
        stamp_ns = (first + k) * period_ns
        acu_inputs[0].position[0], acu_inputs[0].position[1] = beam[0].position[0], beam[0].position[1]
        _answer(k, stamp_ns, period_ns * 1e-9, on_ship, ship, navigation, tracking, acu, breaks, coefficients, program,
                imu_normals, ins_normals, receiver_normals)
        _record(result[k], acu_inputs[0], acu_outputs[0], tracking[3][0])
        command[0].stamp_ns = command[0].command_stamp_ns = stamp_ns
        command[0].due = 1
        for i in range(2):
            result[k].load_position[i] = beam[0].position[i]
            command[0].position[i] = acu_outputs[0].reference[i, 0] + injected[k, i]
        electronic_beam.step(beam_state, beam_constants, command, beam)


@compiled
def _record_axis(row, axis, i):
    row.load_position[i], row.torque[i], row.bias[i] = axis.load_position, axis.torque, axis.bias
    for j in range(2):
        row.motor_torque[i, j], row.motor_velocity[i, j] = axis.motor_torque[j], axis.motor_velocity[j]


@compiled
def _record(row, inputs, acu, error):
    """What the control unit had and said, and the receiver."""
    row.t, row.mode = inputs.stamp, acu.mode
    row.position[0], row.position[1] = inputs.position[0], inputs.position[1]
    row.measured[0], row.measured[1] = error.cross_elevation, error.elevation
    row.true_error[0], row.true_error[1] = error.true_cross_elevation, error.true_elevation
    for i in range(2):
        row.rate[i], row.feedforward[i] = acu.rate[i], acu.torque[i]
        for j in range(3):
            row.estimate[i, j], row.reference[i, j] = acu.estimate[i, j], acu.reference[i, j]
            row.covariance[i, j] = acu.covariance[i, j]
        row.innovation[i], row.rate_innovation[i], row.nis[i] = acu.innovation[i], acu.rate_innovation[i], acu.nis[i]
        for j in range(4):
            row.probability[i, j] = acu.probability[i, j]


BLOCK = 2000
"""Steps whose noise is drawn at once."""


def run(loop: Cores, injected=None) -> np.ndarray:
    """Every step 0 ... steps of a scenario's closed loop as RESULT records (steps + 1,).

    injected (steps + 1, 2): azimuth and elevation rate [rad/s] added to the command on its way to the drive; of a beam
    the angle [rad].
    """
    if injected is None:
        injected = np.zeros((loop.steps + 1, 2))
    result = np.zeros(loop.steps + 1, RESULT)
    deck_rate = np.zeros(3)
    for first in range(0, len(result), BLOCK):
        count = min(BLOCK, len(result) - first)
        normals = [stream.standard_normal((count if loop.on_ship or i == 2 else 0, width))
                   for i, (stream, width) in enumerate(loop.streams)]
        inputs = (first, count, loop.period_ns, loop.on_ship, loop.ship, loop.ins, loop.receiver, loop.acu, loop.adu,
                  loop.target.breaks, loop.target.coefficients, loop.program, *normals)
        if loop.beam:
            _beam_steps(*inputs, injected[first:first + count], result[first:first + count])
        else:
            _steps(*inputs, deck_rate, injected[first:first + count], result[first:first + count])
    return result
