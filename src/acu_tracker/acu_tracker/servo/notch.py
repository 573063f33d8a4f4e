"""Notch filter of second order in the feedback of the position loop, against a resonance of the structure.

    N(s) = (s^2 + 2 depth width w s + w^2) / (s^2 + 2 width w s + w^2)

    w       centre frequency [rad/s]
    depth   gain of N at w [-]; far from w the gain is 1
    width   damping ratio of the denominator [-]

The discrete filter follows by the bilinear transformation, prewarped so that its centre is exactly at w.
"""
import math

from pedestal_common.compiled import compiled
from pedestal_common.quantities import Floats, Hertz, Seconds


def coefficients(frequency: Hertz, width: float, depth: float,
                 period: Seconds) -> tuple[float, float, float, float, float]:
    """Return the coefficients (b0, b1, b2, a1, a2) of the discrete filter, for steps of a period.

    y_k = b0 x_k + b1 x_k-1 + b2 x_k-2 - a1 y_k-1 - a2 y_k-2. frequency: centre, below 0.5 / period; 0: no notch.
    """
    if frequency == 0.0:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    w = 2.0 * math.pi * frequency
    K = w / math.tan(0.5 * w * period)
    damped, cut = 2.0 * width * w * K, 2.0 * depth * width * w * K
    a0 = K * K + damped + w * w
    b1 = 2.0 * (w * w - K * K) / a0
    return (K * K + cut + w * w) / a0, b1, (K * K - cut + w * w) / a0, b1, (K * K - damped + w * w) / a0


@compiled
def removed(x: float, memory: Floats, coefficients: Floats) -> float:
    """Return the part that the notch removes from x: x minus the output y of the filter, in the unit of x.

    memory: (x_k-1, x_k-2, y_k-1, y_k-2).
    """
    b0, b1, b2, a1, a2 = coefficients[0], coefficients[1], coefficients[2], coefficients[3], coefficients[4]
    y = b0 * x + b1 * memory[0] + b2 * memory[1] - a1 * memory[2] - a2 * memory[3]
    memory[0], memory[1], memory[2], memory[3] = x, memory[0], y, memory[2]
    return x - y
