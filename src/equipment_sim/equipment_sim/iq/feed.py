"""Signal at the outputs of a simulated feed. The kinds of feeds: pedestal_hardware.monopulse.feed."""
import cmath
import math
from typing import Annotated

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Complexes, Radians, RadiansPerSample, Records
from pedestal_common.record import Record
from pedestal_hardware.monopulse.feed import ONE_CHANNEL_KIND, THREE_CHANNELS_KIND, reference
from pedestal_hardware.monopulse.params import FEED_KINDS, MonopulseParameters
from tracking_receiver_sim import receiver
from tracking_receiver_sim.wave_path import Image


class Feed(Record):
    """Simulated feed."""
    kind: int                       # index into FEED_KINDS
    of_sum: float                   # share of the sum voltage in the signal [-]
    of_difference: Annotated[Complexes, (2,)]   # shares of the differences, with their phases [-]
    squint: Radians                 # angle between beam and axis of rotation
    angle: Radians                  # of the scan
    turn: RadiansPerSample          # change of this angle in a sample


def record(params: MonopulseParameters) -> Records:
    """Return the Feed (1,), at the angle 0."""
    record, feed = Feed.zeros(), params.feed
    record['kind'] = FEED_KINDS.index(feed.kind)
    record['of_sum'] = math.sqrt(1.0 - feed.coupling)
    record['of_difference'] = [cmath.rect(math.sqrt(feed.coupling), phase)
                          for phase in (params.simulated.x_phase, params.simulated.e_phase)]
    record['squint'] = feed.squint * params.antenna.beamwidth
    record['turn'] = 2.0 * math.pi * feed.scan_rate / params.source.rate
    return record


@compiled
def turn(voltages: Complexes, simulated: Feed) -> None:
    """Set the scan reference in the second channel of voltages (rows, 2), and turn the scan on."""
    for k in range(voltages.shape[0]):
        voltages[k, 1] = reference(simulated.kind, simulated.angle + (k + 0.5) * simulated.turn)
    simulated.angle = (simulated.angle + voltages.shape[0] * simulated.turn) % (2.0 * math.pi)


@compiled
def fill(voltages: Complexes, simulated: Feed, state: receiver.State, constants: receiver.Constants,
         seen: receiver.Incidence) -> None:
    """Set voltages (rows, channels) of a step without noise. state, constants: records of the simulated receiver."""
    for k in range(voltages.shape[0]):
        part = (k + 0.5) / voltages.shape[0]
        if simulated.kind == THREE_CHANNELS_KIND or simulated.kind == ONE_CHANNEL_KIND:
            v = receiver.voltages_at(state, constants, seen, part, seen.amplitude)
            total, x, e = complex(v.s_real, v.s_imag), complex(v.x_real, v.x_imag), complex(v.e_real, v.e_imag)
            if simulated.kind == THREE_CHANNELS_KIND:
                voltages[k, 0], voltages[k, 1], voltages[k, 2] = total, x, e
            else:
                r = voltages[k, 1]
                voltages[k, 0] = (simulated.of_sum * total + r.real * simulated.of_difference[0] * x
                                  + r.imag * simulated.of_difference[1] * e)
        else:
            X, E = receiver.error_at(state, seen, part)
            x, e = simulated.squint * voltages[k, 1].real, simulated.squint * voltages[k, 1].imag
            image = Image(seen.image.real, seen.image.imaginary, seen.image.dX - x, seen.image.dE - e)
            v = receiver.voltages(constants, seen.amplitude, (X - x - constants.boresight[0]) / constants.beamwidth,
                                  (E - e - constants.boresight[1]) / constants.beamwidth, image)
            voltages[k, 0] = complex(v.s_real, v.s_imag)
