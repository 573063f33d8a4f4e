"""Parameters of level_receiver_node."""
import dataclasses

from pedestal_common.parameters import ParameterError, Parameters, parameter, text
from pedestal_hardware.level.line_format import LineFormat
from pedestal_hardware.lines import sources


@dataclasses.dataclass(frozen=True)
class LevelReceiverParameters(Parameters):
    """Parameters of level_receiver_node: the connection, the form of a line, and the meaning of its number."""
    REALTIME_ONLY = ', because the receiver has its own time'

    url: str = text('udp://127.0.0.1:5007', f'connection: {sources.URL_FORMS_TEXT}; udp: HOST is an address of this '
                    'machine')
    baud_rate: int = parameter(9600, 50, 4_000_000, 'Bd', 'speed of a serial device')
    format: str = text('{level}', 'form of a line, with the fields {level} or {level:x}, and {skip}')
    scale: float = parameter(1.0, -1000.0, 1000.0, 'dB', 'level of one unit of the number in a line')
    offset: float = parameter(0.0, -1000.0, 1000.0, 'dB', 'level that is added to the scaled number')
    lowest: float = parameter(-200.0, -1000.0, 1000.0, 'dB', 'lowest level that is published')
    highest: float = parameter(200.0, -1000.0, 1000.0, 'dB', 'highest level that is published',
                               must_be='above lowest')
    latency: float = parameter(0.0, 0.0, 10.0, 's', 'time from the middle of a measurement to the arrival of its line')
    silence: float = parameter(2.0, 0.05, 600.0, 's', 'time without a level from which the diagnostics report an '
                               'error')

    def check(self) -> None:
        """Raise ParameterError for a url, a format or a range that cannot be used."""
        sources.place(self.url)
        LineFormat(self.format)
        if self.scale == 0.0:
            raise ParameterError('scale = 0 dB: must not be 0')
