"""State of the antenna for operators: one table for the terminal, for JSON and for other programs."""
import math
import typing

from pedestal_common.graph import topics
from pedestal_common.node.unit import LEVEL_OK


class Row(typing.NamedTuple):
    """An item: group, name, number or text (None if not received), unit."""
    group: str
    name: str
    value: object
    unit: str = ''

    @property
    def text(self):
        """Value as text for a person."""
        if self.value is None or isinstance(self.value, float) and math.isnan(self.value):
            return '-'
        return f'{self.value:.4f}' if isinstance(self.value, float) else str(self.value)


ACU_STATUS_KEYS = ('mode', 'reason', 'fallback', 'control', 'drive', 'faults', 'locked', 'coasting', 'keyhole')
"""Keys in the diagnostics of the control unit."""


def rows(remote) -> list:
    """Return the Rows of the present state of a remote_node.Remote."""
    actual, commanded = remote.angles('joint_states'), remote.angles('acu/reference')
    acu = remote.diagnostics_of('acu')
    found = [Row('angle', axis, angle, 'deg') for axis, angle in zip(topics.AXES, actual)]
    found += [Row('commanded', axis, angle, 'deg') for axis, angle in zip(topics.AXES, commanded)]
    found += [Row('deviation', axis, a - b, 'deg') for axis, a, b in zip(topics.AXES, commanded, actual)]
    found += [Row('rate', axis, rate, 'deg/s') for axis, rate in zip(topics.AXES, remote.rates())]
    found += [Row('receiver', name, value, unit) for name, value, unit in _receiver(remote)]
    found += [Row('acu', key, acu.get(key)) for key in ACU_STATUS_KEYS]
    found.append(Row('adu', 'state', remote.texts.get('adu/state')))
    return found


def alarms(remote) -> list:
    """Return [(node, text)] of the nodes whose diagnostics are not OK, and of silent nodes."""
    found = [(name, status.message) for name, status in remote.status.items()
             if status.level != LEVEL_OK and remote.present(name)]
    return found + [(name, 'silent') for name in remote.status if not remote.present(name)]


def _receiver(remote):
    values = (math.nan,) * 3
    if remote.present('tracking_receiver/angle_error'):
        values = remote.numbers['tracking_receiver/angle_error']
    cross_elevation, elevation, level = values
    return (('cross_elevation_error', math.degrees(cross_elevation), 'deg'),
            ('elevation_error', math.degrees(elevation), 'deg'), ('level', float(level), 'dB-Hz'))
