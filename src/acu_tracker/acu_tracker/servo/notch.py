"""Second-order notch in the feedback, against a structural resonance.

N(s) = (s^2 + 2 depth width w s + w^2) / (s^2 + 2 width w s + w^2), `depth` at w and 1 far from it;
bilinear, prewarped to w.

w: centre [rad/s]; width: damping ratio of the denominator.
"""
import math

from pedestal_common.compiled import compiled


def coefficients(frequency, width, depth, period):
    """Return (b0, b1, b2, a1, a2) for steps of period [s]; frequency [Hz], below 0.5 / period; 0: no notch."""
    if frequency == 0.0:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    w = 2.0 * math.pi * frequency
    K = w / math.tan(0.5 * w * period)
    damped, cut = 2.0 * width * w * K, 2.0 * depth * width * w * K
    a0 = K * K + damped + w * w
    b1 = 2.0 * (w * w - K * K) / a0
    return (K * K + cut + w * w) / a0, b1, (K * K - cut + w * w) / a0, b1, (K * K - damped + w * w) / a0


@compiled
def removed(x, memory, c):
    """Return x less the notch's output, any unit; memory (4,): the last two x and y; c (5,): as of `coefficients`."""
    y = c[0] * x + c[1] * memory[0] + c[2] * memory[1] - c[3] * memory[2] - c[4] * memory[3]
    memory[0], memory[1], memory[2], memory[3] = x, memory[0], y, memory[2]
    return x - y
