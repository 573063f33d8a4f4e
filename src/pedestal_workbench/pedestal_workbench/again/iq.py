"""`pedestal recompute --iq`: recorded I/Q samples through the unit of the monopulse receiver, compared with the angle
errors in a bag of the same run.

The samples hold all inputs of the receiver. An equal version on the same machine therefore gives equal bytes.
"""
import pathlib
from collections.abc import Iterator

import numpy as np

from pedestal_common.graph import nodes
from pedestal_common.quantities import Nanoseconds, Row
from pedestal_common.wire import records
from pedestal_hardware.monopulse import blocks, sigmf
from pedestal_hardware.monopulse.params import MonopulseParameters
from pedestal_hardware.monopulse.unit import ANGLE_ERROR_TOPIC, MonopulseReceiver
from pedestal_results.results import row
from pedestal_workbench.again import recompute


def parameters_of(recording: recompute.FedRecording) -> MonopulseParameters:
    """Return the parameters of the receiver of a recording. Raises ValueError for another receiver."""
    if not recording.bag.iq:
        raise ValueError(f'{recording.bag.path}: --iq: the receiver of this recording had no I/Q '
                         'samples')
    parameters = recompute.parameters_of(recording, nodes.MONOPULSE_RECEIVER.name)
    assert isinstance(parameters, MonopulseParameters)
    return parameters


def unit_of(parameters: MonopulseParameters) -> MonopulseReceiver:
    """Return a new unit of the receiver."""
    return nodes.MONOPULSE_RECEIVER.unit_type()(parameters, nodes.MONOPULSE_RECEIVER.reads)


def steps(unit: MonopulseReceiver, recording: sigmf.Recording, epoch: Nanoseconds) -> Iterator[blocks.Block]:
    """Yield each block of a recording after the unit has made its step. epoch: stamp from which the unit counts."""
    made = blocks.Blocks(unit.parameters.source.rate, unit.parameters.block)
    for chunk in recording.chunks():
        for block in made.put(chunk):
            unit.take(block)
            unit.step(np.array([block.middle - epoch]), unit.inputs, unit.outputs)
            yield block


def angle_errors(recording: sigmf.Recording, parameters: MonopulseParameters,
                 epoch: Nanoseconds) -> tuple[dict[Nanoseconds, bytes], MonopulseReceiver]:
    """Return ({stamp: CDR bytes} of the angle errors of a recording, the unit after the last step).

    epoch: stamp from which the unit counts.
    """
    unit = unit_of(parameters)
    encoder = records.Encoder(ANGLE_ERROR_TOPIC, unit.messages[ANGLE_ERROR_TOPIC], unit.outputs)
    found = {}
    for _ in steps(unit, recording, epoch):
        if encoder.due:
            found[int(unit.outputs[0][ANGLE_ERROR_TOPIC]['stamp']) + epoch] = bytes(encoder.encoded(epoch))
    return found, unit


def main(bag: pathlib.Path, samples: pathlib.Path) -> tuple[list[str], list[Row], bool]:
    """Return (lines to print, rows of --json, True if all errors in the bag are equal to the last bit). Raises
    ValueError for a bag or a file that does not fit."""
    recording = recompute.FedRecording(bag)
    node = nodes.MONOPULSE_RECEIVER.name
    if not recording.has(ANGLE_ERROR_TOPIC):
        raise ValueError(f'{bag}: no {ANGLE_ERROR_TOPIC} in the bag')
    parameters = parameters_of(recording)
    file = sigmf.Recording(samples, parameters.feed.channels, parameters.source.rate)
    found, _ = angle_errors(file, parameters, recording.bag.start)
    stamps = (recording.output(ANGLE_ERROR_TOPIC).stamps + recording.bag.start).tolist()
    recorded = dict(zip(stamps, map(bytes, recording.data(ANGLE_ERROR_TOPIC))))
    missing = [stamp for stamp in recorded if stamp not in found]
    different = [stamp for stamp in recorded if stamp in found and found[stamp] != recorded[stamp]]
    equal = len(recorded) - len(missing) - len(different)
    lines = [f'{samples}: {file.count} samples, {len(found)} errors',
             f'{ANGLE_ERROR_TOPIC}: {len(recorded)} in the bag, {equal} equal, '
             f'{len(different)} differ, {len(missing)} not in the samples']
    for text, of_stamps in (('differs', different), ('not in the samples', missing)):
        if of_stamps:
            lines.append(f'first {text}: {(of_stamps[0] - recording.bag.start) * 1e-9:.6f} s')
    if file.cut:
        lines.append(file.cut)
    well = bool(recorded) and not missing and not different
    lines.append(f'{node}: {"identical" if well else "DIFFERS"}')
    rows = [row(node, name, len(found)) for name, found in (('recorded', recorded), ('different', different),
                                                            ('missing', missing))]
    return lines, rows, well
